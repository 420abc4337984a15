// The mean over all cells that a camera sees. One workgroup; four cells at a time, since a software driver may end
// loops after 65535 rounds.

const THREADS = 256u;

var<storage, read> occupancy: array<vec4<f32>>;
var<storage, read_write> occupancy_mean: array<f32>;
var<workgroup> sums: array<vec2<f32>, THREADS>;

@compute @workgroup_size(THREADS)
fn main(@builtin(local_invocation_index) thread: u32) {
    var sum = vec2(0.0);
    for (var i = thread; i < CELL_COUNT / 4u; i += THREADS) {
        let values = occupancy[i];
        let seen = select(vec4(0.0), vec4(1.0), values >= vec4(0.0));
        sum += vec2(dot(values, seen), dot(seen, vec4(1.0)));
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
