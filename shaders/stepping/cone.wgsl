// Provides: steps that grow with the distance, between STEP_MIN and STEP_MAX, all of them times the scale; see
// `reference::march`.
// needs: counters, log

const STEPPING_LINEAR_END = STEP_MIN / CONE;
const STEPPING_CONE_END = STEP_MAX / CONE;

fn stepping_scale() -> f32 {
    return 1.0 + counters.step_excess;
}

fn stepping_index(t: f32) -> f32 {
    let scale = stepping_scale();
    let middle = clamp(t, STEPPING_LINEAR_END, STEPPING_CONE_END);
    return min(t, STEPPING_LINEAR_END) / (scale * STEP_MIN)
        + log(middle / STEPPING_LINEAR_END) / log_one_plus(scale * CONE)
        + max(t - STEPPING_CONE_END, 0.0) / (scale * STEP_MAX);
}

fn stepping_distance(u: f32) -> f32 {
    let scale = stepping_scale();
    let growth = log_one_plus(scale * CONE);
    let linear = 1.0 / (scale * CONE);
    let cone = log(STEP_MAX / STEP_MIN) / growth;
    if u <= linear {
        return u * scale * STEP_MIN;
    }
    return STEPPING_LINEAR_END * exp(min(u - linear, cone) * growth) + max(u - linear - cone, 0.0) * scale * STEP_MAX;
}

// Length of the step that begins at u. Where a step lies within one of the three parts it is not a difference of
// distances, which would cancel.
fn stepping_length(u: f32) -> f32 {
    let scale = stepping_scale();
    let linear = 1.0 / (scale * CONE);
    if u + 1.0 <= linear {
        return scale * STEP_MIN;
    }
    let t = stepping_distance(u);
    if u >= linear && t * (1.0 + scale * CONE) <= STEPPING_CONE_END {
        return t * scale * CONE;
    }
    return stepping_distance(u + 1.0) - t;
}
