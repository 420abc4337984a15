// Provides: Adam's update (Kingma & Ba 2015); see `reference::adam`.
// needs: step

struct Adam {
    parameter: vec4<f32>,
    first: vec4<f32>,
    second: vec4<f32>,
}

fn adam_update(old: Adam, gradient: vec4<f32>) -> Adam {
    let first = BETA_1 * old.first + (1.0 - BETA_1) * gradient;
    let second = BETA_2 * old.second + (1.0 - BETA_2) * gradient * gradient;
    let mean = first * step.first_correction;
    let deviation = sqrt(second * step.second_correction);
    return Adam(old.parameter - step.learning_rate * RATE * mean / (deviation + EPSILON), first, second);
}
