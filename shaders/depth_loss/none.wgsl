// Provides: the depth's share of the loss where it has none.

struct DepthRay {
    unused: u32,
}

fn depth_begin(goal: f32) -> DepthRay {
    return DepthRay(0u);
}

fn depth_forward(depth: DepthRay, i: u32, root: f32, alpha: f32, zero: u32) -> DepthRay {
    return depth;
}

fn depth_turn(depth: DepthRay) -> DepthRay {
    return depth;
}

fn depth_squared_error(depth: DepthRay) -> f32 {
    return 0.0;
}

fn depth_gradient(depth: DepthRay, i: u32, alpha: f32, missing: f32) -> f32 {
    return 0.0;
}

fn depth_backward(depth: DepthRay, i: u32, part: Passage, zero: u32) -> DepthRay {
    return depth;
}
