// Provides: steps that grow with the distance, between STEP_MIN and STEP_MAX; see `reference::march`.

const STEPPING_LINEAR_END = STEP_MIN / CONE;
const STEPPING_CONE_END = STEP_MAX / CONE;

fn stepping_index(t: f32) -> f32 {
    let middle = clamp(t, STEPPING_LINEAR_END, STEPPING_CONE_END);
    return min(t, STEPPING_LINEAR_END) / STEP_MIN + log(middle / STEPPING_LINEAR_END) / LOG_CONE
        + max(t - STEPPING_CONE_END, 0.0) / STEP_MAX;
}

fn stepping_distance(u: f32) -> f32 {
    let linear = 1.0 / CONE;
    let cone = log(STEP_MAX / STEP_MIN) / LOG_CONE;
    if u <= linear {
        return u * STEP_MIN;
    }
    return STEPPING_LINEAR_END * exp(min(u - linear, cone) * LOG_CONE) + max(u - linear - cone, 0.0) * STEP_MAX;
}

// Length of the step that begins at u. Where a step lies within one of the three parts it is not a difference of
// distances, which would cancel.
fn stepping_length(u: f32) -> f32 {
    let linear = 1.0 / CONE;
    if u + 1.0 <= linear {
        return STEP_MIN;
    }
    let t = stepping_distance(u);
    if u >= linear && t * (1.0 + CONE) <= STEPPING_CONE_END {
        return t * CONE;
    }
    return stepping_distance(u + 1.0) - t;
}
