// Provides: march_start.
// needs: jitter, random, ray, space, step

// Where the first sample of a ray lies, in steps: one random offset for the whole ray while training, and
// half a step when JITTER is off.
fn march_start(ray: Ray, index: u32) -> f32 {
    if JITTER {
        return space_step_index(ray.t_near) + random_f32(step.stream, index, RANDOM_OFFSET);
    }
    return space_step_index(ray.t_near) + 0.5;
}
