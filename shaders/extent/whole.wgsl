// Provides: the steps of a ray that are marched at once: all of them.

// The first step to march, and the first of those that were marched.
fn extent_begin(index: u32) -> u32 {
    return 0u;
}

fn extent_first(index: u32) -> u32 {
    return 0u;
}

// Most samples of a ray.
fn extent_most() -> u32 {
    return MAX_STEPS;
}

// Marching ended in front of step `next`; MAX_STEPS where it left the box.
fn extent_end(index: u32, next: u32) {}
