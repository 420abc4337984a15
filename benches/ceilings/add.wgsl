// Additions to anywhere in a table, as the hash grid's gradients are summed. Needs: random, add_one.

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    for (var round = 0u; round < ROUNDS; round++) {
        add_one(random_index(id.x, round));
    }
}
