// Decides which samples of a ray get colour and gradients. A sample of at least WEIGHT_FLOOR is heavy and is kept.
// The light ones between two heavy ones form groups of at least that weight, of which one member, drawn by weight,
// stands for all: its colour has the weight of the group, so that the mean over all draws is the colour of the whole
// ray. A group that stays lighter than LIGHT_SHARE of the floor is kept by chance; what that adds to the ray's weight
// or takes from it is made up for by the next kept sample. Opacity and transmittance are those of all samples.
// Nothing is kept behind the point where the ray is opaque; see `reference::selection`.
// Needs: random, step, counters, exp, density, refresh.

var<storage, read> counters: Counters;
tensor<read> samples: vec4<f32>;
tensor<read> density_out: vec4<f32>;
var<storage, read> ray_spans: array<vec2<u32>>;
var<storage, read_write> kept_spans: array<vec2<u32>>;
// Optical depth behind the last kept sample of each ray.
var<storage, read_write> ray_tails: array<f32>;
// The chosen samples of ray r from index ray_spans[r].x on: sample (as a number), the optical depth of those left out
// in front of it, and its gain: the weight that its colour has, as a multiple of its own.
tensor<write> chosen: vec4<f32>;

struct Walk {
    // Where the next choice goes.
    next: u32,
    // Optical depth up to the far end of the last kept sample.
    kept_depth: f32,
    // Weight that the next kept sample makes up for.
    carry: f32,
    // The open group of light samples: its weight, and the member that stands for it.
    light: f32,
    member: u32,
    member_weight: f32,
    // Optical depth up to that member, and of itself.
    member_depth: f32,
    member_tau: f32,
}

fn keep(walk: Walk, sample: u32, before: f32, tau: f32, gain: f32) -> Walk {
    chosen_store(walk.next, vec4(f32(sample), before - walk.kept_depth, gain, 0.0));
    var after = walk;
    after.next++;
    after.kept_depth = before + tau;
    after.carry = 0.0;
    return after;
}

// Ends the open group.
fn close(walk: Walk) -> Walk {
    if !(walk.light > 0.0) {
        return walk;
    }
    let probability = min(walk.light / (WEIGHT_FLOOR * LIGHT_SHARE), 1.0);
    var after = walk;
    if random_f32(step.stream, walk.member, RANDOM_LIGHT) < probability {
        let weight = walk.light / probability;
        let gain = (weight + walk.carry) / walk.member_weight;
        after = keep(walk, walk.member, walk.member_depth, walk.member_tau, gain);
        after.carry = walk.light - weight;
    } else {
        after.carry += walk.light;
    }
    after.light = 0.0;
    return after;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays_used {
        return;
    }
    let span = ray_spans[index];
    var depth = 0.0;
    var transmittance = 1.0;
    var walk = Walk(span.x, 0.0, 0.0, 0.0, 0u, 0.0, 0.0, 0.0);
    for (var i = span.x; i < span.x + span.y; i++) {
        let sample = samples_load(i);
        let log_density = density_log(density_out_load(i * DENSITY_QUADS).x);
        let tau = optical_depth(log_density, sample.w);
        occupancy_refresh(sample.xyz, log_density);
        let weight = transmittance * opacity(tau);
        if weight >= WEIGHT_FLOOR {
            walk = close(walk);
            walk = keep(walk, i, depth, tau, 1.0 + walk.carry / max(weight, 1e-30));
        } else if weight > 1e-30 {
            walk.light += weight;
            if random_f32(step.stream, i, RANDOM_SELECTION) * walk.light < weight {
                walk.member = i;
                walk.member_weight = weight;
                walk.member_depth = depth;
                walk.member_tau = tau;
            }
            if walk.light >= WEIGHT_FLOOR {
                walk = close(walk);
            }
        }
        depth += tau;
        transmittance = exp_accurate(-depth);
        if transmittance < STOP_TRANSMITTANCE {
            break;
        }
    }
    walk = close(walk);
    kept_spans[index] = vec2(0u, walk.next - span.x);
    ray_tails[index] = depth - walk.kept_depth;
}
