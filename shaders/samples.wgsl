// Writes the marked steps of each ray as samples: where the hash grid has them, and the length of the step. Several
// threads share the words of a ray.
// needs: counters, distance, extent, group, march_start, ray_load, space

var<storage, read> ray_steps: array<u32>;
var<storage, read> ray_spans: array<vec2<u32>>;
// Position in the hash grid, and the step's length in units of the inner cube's side.
tensor<write> samples: vec4<f32>;

@compute @workgroup_size(GROUP_SIZE, RAY_LANES)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let index = group.x * GROUP_SIZE + thread / RAY_LANES;
    if index >= counters.rays_used {
        return;
    }
    let span = ray_spans[index];
    if span.y == 0u {
        return;
    }
    let ray = ray_load(index);
    let first = march_start(ray, index);
    let lane = thread % RAY_LANES;
    var written = 0u;
    // Each thread has a word of its own, and counts those in front of it. Words behind the last sample write nothing.
    for (var i = extent_first(index) >> 5u; written < span.y && i < STEP_WORDS; i += RAY_LANES) {
        var word = 0u;
        var before = written;
        for (var other = 0u; other < RAY_LANES; other++) {
            let found = ray_steps[index * STEP_WORDS + i + other];
            let count = countOneBits(found);
            word = select(word, found, other == lane);
            before += select(0u, count, other < lane);
            written += count;
        }
        word_store(ray, first, i + lane, word, span.x + before, span.x + span.y);
    }
}

// Writes the marked steps of a word from sample `begin` on, and none from `end` on.
fn word_store(ray: Ray, first: f32, word_index: u32, word: u32, begin: u32, end: u32) {
    var left = word;
    for (var sample = begin; left != 0u && sample < end; sample++) {
        let u = first + f32(word_index * 32u + countTrailingZeros(left));
        left &= left - 1u;
        let t = space_step_distance(u);
        let delta = space_step_length(u) * DENSITY_SCALE;
        samples_store(sample, vec4(space_in_grid(ray_at(ray, t)), delta));
        distance_store(sample, ray, t);
    }
}
