// Provides: equal steps along the ray; see `reference::march`.
// needs: counters

fn stepping_index(t: f32) -> f32 {
    return t / stepping_length(0.0);
}

// Length of the step that begins at u; not a difference of distances, which would cancel.
fn stepping_length(u: f32) -> f32 {
    return STEP_MIN * (1.0 + counters.step_excess);
}

fn stepping_distance(u: f32) -> f32 {
    return u * stepping_length(u);
}
