// Provides: the depth's share of the loss, DEPTH_WEIGHT / M times the square of sum_i w_i (t_i - g) over the rays whose
// distance g is known. It is a fifth channel whose colour is t_i - g, over 0: what is transparent is left to the other
// channels. Distances are in sides of the inner cube.
// needs: counters, exp, kept_load, sum, transmittance

struct DepthRay {
    // 0 where unknown.
    goal: f32,
    // On the way there the channel in x, on the way back what lies behind.
    sum: Sum,
    // dL/dR of the channel.
    d_result: f32,
}

fn depth_begin(goal: f32) -> DepthRay {
    return DepthRay(goal, sum_of(vec4(0.0)), 0.0);
}

// The channel's colour of a sample.
fn depth_offset(depth: DepthRay, i: u32) -> vec4<f32> {
    return vec4(select(0.0, kept_step(i).w - depth.goal, depth.goal > 0.0), 0.0, 0.0, 0.0);
}

fn depth_forward(depth: DepthRay, i: u32, root: f32, alpha: f32, zero: u32) -> DepthRay {
    var next = depth;
    next.sum = sum_add(depth.sum, squared_times(root, alpha * depth_offset(depth, i), zero), zero);
    return next;
}

// From the way there to the way back.
fn depth_turn(depth: DepthRay) -> DepthRay {
    var next = depth;
    next.d_result = 2.0 * DEPTH_WEIGHT * depth.sum.value.x / f32(counters.rays_used);
    next.sum = sum_of(vec4(0.0));
    return next;
}

// As a part of a ray's squared errors, of which the loss is a quarter.
fn depth_squared_error(depth: DepthRay) -> f32 {
    return 4.0 * DEPTH_WEIGHT * depth.sum.value.x * depth.sum.value.x;
}

// The channel's part of dL/ds_i, but for tau and T.
fn depth_gradient(depth: DepthRay, i: u32, alpha: f32, missing: f32) -> f32 {
    let offset = depth_offset(depth, i);
    return depth.d_result * (gradient_color(alpha, offset, depth.sum).x - missing * offset.x);
}

fn depth_backward(depth: DepthRay, i: u32, part: Passage, zero: u32) -> DepthRay {
    var next = depth;
    next.sum = behind_next(depth.sum, depth_offset(depth, i), part, zero);
    return next;
}
