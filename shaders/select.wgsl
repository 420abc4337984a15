// Decides which samples of a ray get colour and gradients. A sample of at least WEIGHT_FLOOR is heavy and is kept. The
// light ones between two heavy ones form groups of about twice that weight. Of each, one member, drawn by weight,
// stands for all: its colour has the weight of the group, so that the mean over all draws is the colour of the whole
// ray. That is done twice, for two estimates of the colour that know nothing of each other; see `composite.wgsl`. A
// group that stays lighter than LIGHT_SHARE of the floor is kept by chance; what that adds to the ray's weight or takes
// from it is made up for by the estimate's next kept sample. Opacity and transmittance are those of all samples.
// Nothing is kept behind the point where the ray is opaque; see `reference::selection`.
// needs: counters, exp, group, marched, occupancy_raise, random, step

var<storage, read> ray_spans: array<vec2<u32>>;
var<storage, read_write> kept_spans: array<vec2<u32>>;
// Optical depth behind the last kept sample of each ray.
var<storage, read_write> ray_tails: array<f32>;
// The marched samples, over which the chosen ones of ray r are written from index ray_spans[r].x on: sample (as a number),
// the optical depth of those left out in front of it, and its gains: the weight that its colour has in both estimates, as a
// multiple of its own.
tensor<read_write> chosen: vec4<f32>;

// A sample: its index, its weight, the optical depth in front of it and its own.
struct Member {
    sample: u32,
    weight: f32,
    before: f32,
    tau: f32,
}

struct Walk {
    // Where the next choice goes.
    next: u32,
    // Optical depth up to the far end of the last kept sample.
    kept_depth: f32,
    // Weights that the estimates' next kept samples make up for.
    carry: vec2<f32>,
    // The open group of light samples: its weight, and the members that stand for it.
    light: f32,
    first: Member,
    second: Member,
}

fn keep(walk: Walk, member: Member, gains: vec2<f32>) -> Walk {
    chosen_store(walk.next, vec4(f32(member.sample), member.before - walk.kept_depth, gains));
    var after = walk;
    after.next++;
    after.kept_depth = member.before + member.tau;
    return after;
}

// Ends the open group.
fn close(walk: Walk) -> Walk {
    if !(walk.light > 0.0) {
        return walk;
    }
    let probability = min(walk.light / (WEIGHT_FLOOR * LIGHT_SHARE), 1.0);
    let weight = walk.light / probability;
    let luck = vec2(
        random_f32(step.stream, walk.first.sample, RANDOM_LIGHT),
        random_f32(step.stream, walk.second.sample, RANDOM_LIGHT + 1u),
    );
    let kept = luck < vec2(probability);
    let gains = select(vec2(0.0), (weight + walk.carry) / vec2(walk.first.weight, walk.second.weight), kept);
    var after = walk;
    after.carry = select(walk.carry + walk.light, vec2(walk.light - weight), kept);
    after.light = 0.0;
    let is_same = walk.first.sample == walk.second.sample;
    if is_same && any(kept) {
        return keep(after, walk.first, gains);
    }
    if kept.x && walk.first.sample < walk.second.sample {
        after = keep(after, walk.first, vec2(gains.x, 0.0));
    }
    if kept.y {
        after = keep(after, walk.second, vec2(0.0, gains.y));
    }
    if kept.x && walk.first.sample > walk.second.sample {
        after = keep(after, walk.first, vec2(gains.x, 0.0));
    }
    return after;
}

// A light sample joins the open group.
fn join(walk: Walk, member: Member) -> Walk {
    var after = walk;
    after.light += member.weight;
    if random_f32(step.stream, member.sample, RANDOM_SELECTION) * after.light < member.weight {
        after.first = member;
    }
    if random_f32(step.stream, member.sample, RANDOM_SELECTION + 1u) * after.light < member.weight {
        after.second = member;
    }
    return after;
}

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays_used {
        return;
    }
    let span = ray_spans[index];
    var depth = 0.0;
    var transmittance = 1.0;
    let nobody = Member(0u, 1.0, 0.0, 0.0);
    var walk = Walk(span.x, 0.0, vec2(0.0), 0.0, nobody, nobody);
    // The next sample is on its way while this one is weighed.
    var next = chosen_load(span.x);
    for (var i = span.x; i < span.x + span.y; i++) {
        let sample = marched_unpack(next);
        next = chosen_load(i + 1u);
        let member = Member(i, transmittance * sample.alpha, depth, sample.tau);
        // Where rays go, the occupancy grid costs no samples of its own.
        occupancy_raise(sample.cell, sample.occupancy);
        if member.weight >= WEIGHT_FLOOR {
            walk = close(walk);
            walk = keep(walk, member, 1.0 + walk.carry / max(member.weight, 1e-30));
            walk.carry = vec2(0.0);
        } else if member.weight > 1e-30 {
            walk = join(walk, member);
            if walk.light >= 2.0 * WEIGHT_FLOOR {
                walk = close(walk);
            }
        }
        depth += sample.tau;
        transmittance = exp_accurate(-depth);
        if transmittance < STOP_TRANSMITTANCE {
            break;
        }
    }
    walk = close(walk);
    kept_spans[index] = vec2(0u, walk.next - span.x);
    ray_tails[index] = depth - walk.kept_depth;
}
