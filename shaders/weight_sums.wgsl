// The gradients of the networks' weights: L2, and the partial sums of all chunks in a fixed order. The threads of a
// workgroup along x read neighbours; those along y share the chunks, where there are many.
// needs: magnitude

const QUADS = 16u;
const SHARES = clamp(CHUNKS / 32u, 1u, 16u);
const_assert CHUNKS % (4u * SHARES) == 0u;

var<storage, read> mlp: array<vec4<f32>>;
tensor<read> d_weight_chunks: vec4<f32>;
var<storage, read_write> d_weights: array<vec4<f32>>;
var<storage, read_write> gradient_range: array<atomic<u32>>;
var<workgroup> sums: array<array<vec4<f32>, QUADS>, SHARES>;

@compute @workgroup_size(QUADS, SHARES)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_id) thread: vec3<u32>) {
    let index = min(id.x, MLP_QUADS - 1u);
    let share = thread.y;
    var sum = select(vec4(0.0), L2 * mlp[index], share == 0u);
    // Four under way at once, added one after the other.
    for (var chunk = share; chunk < CHUNKS; chunk += 4u * SHARES) {
        let first = d_weight_chunks_load(chunk * MLP_QUADS + index);
        let second = d_weight_chunks_load((chunk + SHARES) * MLP_QUADS + index);
        let third = d_weight_chunks_load((chunk + 2u * SHARES) * MLP_QUADS + index);
        let fourth = d_weight_chunks_load((chunk + 3u * SHARES) * MLP_QUADS + index);
        sum = (((sum + first) + second) + third) + fourth;
    }
    sums[share][thread.x] = sum;
    workgroupBarrier();
    if share != 0u || id.x >= MLP_QUADS {
        return;
    }
    for (var other = 1u; other < SHARES; other++) {
        sum += sums[other][thread.x];
    }
    d_weights[index] = sum;
    atomicMax(&gradient_range[1], magnitude_bits(sum));
}
