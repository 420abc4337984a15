// Provides: equal steps of STEP_MIN along the ray; see `reference::march`.

fn stepping_index(t: f32) -> f32 {
    return t / STEP_MIN;
}

// Length of the step that begins at u; not a difference of distances, which would cancel.
fn stepping_length(u: f32) -> f32 {
    return STEP_MIN;
}

fn stepping_distance(u: f32) -> f32 {
    return u * STEP_MIN;
}
