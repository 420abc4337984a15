// Turns the counts in `ray_spans` into first indices (an exclusive prefix sum, in the order of the rays, so that the
// order of the samples does not depend on scheduling). Rays that exceed CAPACITY get no samples. One workgroup.
// needs: scanned

const THREADS = 256u;

var<storage, read_write> ray_spans: array<vec2<u32>>;
var<workgroup> sums: array<u32, THREADS>;
var<workgroup> first_dropped: atomic<u32>;

@compute @workgroup_size(THREADS)
fn main(@builtin(local_invocation_index) thread: u32) {
    let rays = scan_rays();
    let share = (rays + THREADS - 1u) / THREADS;
    let begin = min(thread * share, rays);
    let end = min(begin + share, rays);
    var sum = 0u;
    for (var i = begin; i < end; i++) {
        sum += ray_spans[i].y;
    }
    sums[thread] = sum;
    if thread == 0u {
        atomicStore(&first_dropped, rays);
    }
    workgroupBarrier();
    for (var reach = 1u; reach < THREADS; reach *= 2u) {
        var below = 0u;
        if thread >= reach {
            below = sums[thread - reach];
        }
        workgroupBarrier();
        sums[thread] += below;
        workgroupBarrier();
    }
    var first = sums[thread] - sum;
    for (var i = begin; i < end; i++) {
        let count = ray_spans[i].y;
        if first + count > CAPACITY {
            atomicMin(&first_dropped, i);
            ray_spans[i] = vec2(0u, 0u);
        } else {
            ray_spans[i] = vec2(first, count);
        }
        first += count;
    }
    // The spans that other threads wrote are read below.
    storageBarrier();
    workgroupBarrier();
    if thread == 0u {
        let used = atomicLoad(&first_dropped);
        var total = 0u;
        if used > 0u {
            let last = ray_spans[used - 1u];
            total = last.x + last.y;
        }
        scan_finish(used, total, sums[THREADS - 1u]);
    }
}
