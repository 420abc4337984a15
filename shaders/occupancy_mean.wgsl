// The mean over all cells that a camera sees. One workgroup; sixteen cells at a time, since a software driver may end
// loops after 65535 rounds, and a GPU waits for what it reads.

const THREADS = 256u;

var<storage, read> occupancy: array<vec4<f32>>;
var<storage, read_write> occupancy_mean: array<f32>;
var<workgroup> sums: array<vec2<f32>, THREADS>;

// The sum and the number of those that are seen.
fn seen_of(values: vec4<f32>) -> vec2<f32> {
    let seen = select(vec4(0.0), vec4(1.0), values >= vec4(0.0));
    return vec2(dot(values, seen), dot(seen, vec4(1.0)));
}

@compute @workgroup_size(THREADS)
fn main(@builtin(local_invocation_index) thread: u32) {
    var sum = vec2(0.0);
    for (var i = thread; i < CELL_COUNT / 4u; i += 4u * THREADS) {
        let first = occupancy[i];
        let second = occupancy[i + THREADS];
        let third = occupancy[i + 2u * THREADS];
        let fourth = occupancy[i + 3u * THREADS];
        sum = (((sum + seen_of(first)) + seen_of(second)) + seen_of(third)) + seen_of(fourth);
    }
    sums[thread] = sum;
    workgroupBarrier();
    for (var half = THREADS / 2u; half > 0u; half /= 2u) {
        if thread < half {
            sums[thread] += sums[thread + half];
        }
        workgroupBarrier();
    }
    if thread == 0u {
        occupancy_mean[0] = sums[0].x / max(sums[0].y, 1.0);
    }
}
