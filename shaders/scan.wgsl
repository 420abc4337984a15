// Turns the counts in `ray_spans` into first indices (an exclusive prefix sum, in the order of the rays, so that the
// order of the samples does not depend on scheduling). Rays that exceed CAPACITY get no samples. One workgroup, which
// takes the rays in tiles: neighbours read neighbours, four rows of them at once, and the next tile is read while this
// one is summed.
// needs: scanned

const THREADS = 256u;
const TILE = 4u * THREADS;

var<storage, read_write> ray_spans: array<vec2<u32>>;
var<workgroup> sums: array<vec4<u32>, THREADS>;
// The first ray that does not fit, and the samples in front of it.
var<workgroup> fitting: vec2<u32>;

fn counts_load(first: u32, rays: u32) -> vec4<u32> {
    let index = vec4(first) + vec4(0u, THREADS, 2u * THREADS, 3u * THREADS);
    let counts = vec4(
        ray_spans[index.x].y,
        ray_spans[index.y].y,
        ray_spans[index.z].y,
        ray_spans[index.w].y,
    );
    return select(vec4(0u), counts, index < vec4(rays));
}

fn span_store(ray: u32, rays: u32, first: u32, count: u32) {
    if ray >= rays {
        return;
    }
    let fits = first + count <= CAPACITY;
    if !fits && first <= CAPACITY {
        fitting = vec2(ray, first);
    }
    ray_spans[ray] = select(vec2(0u), vec2(first, count), fits);
}

@compute @workgroup_size(THREADS)
fn main(@builtin(local_invocation_index) thread: u32) {
    let rays = scan_rays();
    var total = 0u;
    var next = counts_load(thread, rays);
    if thread == 0u {
        fitting = vec2(rays, CAPACITY + 1u);
    }
    for (var tile = 0u; tile < rays; tile += TILE) {
        let counts = next;
        next = counts_load(tile + TILE + thread, rays);
        sums[thread] = counts;
        workgroupBarrier();
        for (var reach = 1u; reach < THREADS; reach *= 2u) {
            var below = vec4(0u);
            if thread >= reach {
                below = sums[thread - reach];
            }
            workgroupBarrier();
            sums[thread] += below;
            workgroupBarrier();
        }
        let rows = sums[THREADS - 1u];
        let behind = vec4(rows.x, rows.x + rows.y, rows.x + rows.y + rows.z, rows.x + rows.y + rows.z + rows.w);
        let first = total + (behind - rows) + (sums[thread] - counts);
        let ray = tile + thread;
        span_store(ray, rays, first.x, counts.x);
        span_store(ray + THREADS, rays, first.y, counts.y);
        span_store(ray + 2u * THREADS, rays, first.z, counts.z);
        span_store(ray + 3u * THREADS, rays, first.w, counts.w);
        total += behind.w;
        // The next tile's sums take the place of these.
        workgroupBarrier();
    }
    if thread == 0u {
        scan_finish(fitting.x, min(fitting.y, total), total);
    }
}
