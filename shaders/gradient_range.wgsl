// The largest gradient of the encoding, before any of them is used. Needs: counters, magnitude.

var<storage, read> counters: Counters;
// Two levels in each.
tensor<read> d_encoding: vec4<f32>;
var<storage, read_write> gradient_range: array<atomic<u32>>;
var<workgroup> most: atomic<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    if thread == 0u {
        atomicStore(&most, 0u);
    }
    workgroupBarrier();
    if id.x < counters.kept {
        var own = 0u;
        for (var i = 0u; i < LEVELS / 2u; i++) {
            own = max(own, magnitude_bits(d_encoding_load(id.x * (LEVELS / 2u) + i)));
        }
        atomicMax(&most, own);
    }
    workgroupBarrier();
    if thread == 0u {
        atomicMax(&gradient_range[0], atomicLoad(&most));
    }
}
