// Provides: the distortion's share of the loss where it has none.

struct SpreadRay {
    unused: u32,
}

fn spread_begin() -> SpreadRay {
    return SpreadRay(0u);
}

fn spread_before(spread: SpreadRay) -> vec2<f32> {
    return vec2(0.0);
}

fn spread_forward(spread: SpreadRay, i: u32, weight: f32) -> SpreadRay {
    return spread;
}

fn spread_error(spread: SpreadRay) -> f32 {
    return 0.0;
}

fn spread_turn(spread: SpreadRay) -> SpreadRay {
    return spread;
}

fn spread_gradient(spread: SpreadRay, i: u32, before: vec2<f32>, weight: f32, alpha: f32, missing: f32) -> f32 {
    return 0.0;
}

fn spread_backward(spread: SpreadRay, i: u32, before: vec2<f32>, weight: f32, part: Passage, zero: u32) -> SpreadRay {
    return spread;
}
