// Ends a step: sums the errors of its rays and chooses the number of rays of the next one, so that the kept samples
// meet their target and the marched ones fit. One workgroup.
// needs: counters, dispatch, group, ray_result, usable

var<storage, read> ray_results: array<RayResult>;
var<workgroup> sums: array<vec4<f32>, GROUP_SIZE>;

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(local_invocation_index) thread: u32) {
    let rays = counters.rays_used;
    var sum = vec4(0.0);
    for (var i = thread; i < rays; i += GROUP_SIZE) {
        sum += ray_results[i].errors;
    }
    sums[thread] = sum;
    workgroupBarrier();
    if thread != 0u {
        return;
    }
    var total = vec4(0.0);
    for (var i = 0u; i < GROUP_SIZE; i++) {
        total += sums[i];
    }
    let used = f32(max(rays, 1u));
    counters.sum_steps += 1u;
    counters.sum_rays += rays;
    counters.sum_samples += counters.samples;
    counters.sum_kept += counters.kept;
    if gradients_usable() {
        counters.sum_loss += dot(total, vec4(0.25)) / used;
        counters.sum_color_error += (total.x + total.y + total.z) / (3.0 * used);
    } else {
        counters.sum_skipped += 1u;
    }
    gradient_range[0] = 0u;
    gradient_range[1] = 0u;
    gradient_range[2] = 0u;

    let asked = f32(counters.rays);
    let crowding = f32(counters.samples_wanted) / (asked * SAMPLES_PER_RAY);
    let scale = (1.0 + counters.step_excess) * clamp(crowding, STEP_SHRINKAGE, STEP_GROWTH);
    counters.step_excess = clamp(scale - 1.0, 0.0, LONGEST_STEP - 1.0);
    let fit_kept = f32(TARGET_KEPT) / max(f32(counters.kept_wanted), 1.0) * (used / asked);
    let fit_samples = f32(TARGET_SAMPLES) / max(f32(counters.samples_wanted), 1.0);
    let factor = clamp(min(fit_kept, fit_samples), 0.5, 1.5);
    let next = clamp(u32(asked * factor), LEAST_RAYS, MOST_RAYS);
    counters.rays = next;
    dispatch[DISPATCH_RAYS] = workgroups(next, 1u);
}
