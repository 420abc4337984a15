// Ends a step: sums the errors of its rays and chooses the number of rays of the next one, so that the kept samples
// meet their target and the marched ones fit. One workgroup, whose threads have four rays under way at once.
// needs: counters, dispatch, group, ray_result, usable

const THREADS = 256u;

var<storage, read> ray_results: array<RayResult>;
var<workgroup> sums: array<vec4<f32>, THREADS>;

fn errors_of(ray: u32, rays: u32) -> vec4<f32> {
    return select(vec4(0.0), ray_results[ray].errors, ray < rays);
}

@compute @workgroup_size(THREADS)
fn main(@builtin(local_invocation_index) thread: u32) {
    let rays = counters.rays_used;
    var sum = vec4(0.0);
    for (var ray = thread; ray < rays; ray += 4u * THREADS) {
        sum += (errors_of(ray, rays) + errors_of(ray + THREADS, rays))
            + (errors_of(ray + 2u * THREADS, rays) + errors_of(ray + 3u * THREADS, rays));
    }
    sums[thread] = sum;
    workgroupBarrier();
    for (var half = THREADS / 2u; half > 0u; half /= 2u) {
        if thread < half {
            sums[thread] += sums[thread + half];
        }
        workgroupBarrier();
    }
    if thread != 0u {
        return;
    }
    let total = sums[0];
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
