// The largest gradient of the encoding and the largest squared error, before any gradient is used.
// needs: counters, group, magnitude, ray_result

// Two levels in each.
tensor<read> d_encoding: vec4<f32>;
var<storage, read> ray_results: array<RayResult>;
var<storage, read_write> gradient_range: array<atomic<u32>>;
var<workgroup> most_gradient: atomic<u32>;
var<workgroup> most_error: atomic<u32>;

@compute @workgroup_size(GROUP_SIZE)
fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    if thread == 0u {
        atomicStore(&most_gradient, 0u);
        atomicStore(&most_error, 0u);
    }
    workgroupBarrier();
    if id.x < counters.kept {
        var own = 0u;
        for (var i = 0u; i < LEVELS / 2u; i++) {
            own = max(own, magnitude_bits(d_encoding_load(id.x * (LEVELS / 2u) + i)));
        }
        atomicMax(&most_gradient, own);
    }
    // As many threads as the dispatch over kept samples has; D3D12 does not tell the number of its workgroups.
    let threads = workgroups(counters.kept, 1u).x * GROUP_SIZE;
    for (var ray = id.x; ray < counters.rays_used; ray += threads) {
        atomicMax(&most_error, magnitude_bits(ray_results[ray].errors));
    }
    workgroupBarrier();
    if thread == 0u {
        atomicMax(&gradient_range[0], atomicLoad(&most_gradient));
        atomicMax(&gradient_range[2], atomicLoad(&most_error));
    }
}
