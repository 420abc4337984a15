// Provides: a slot for a ray of a view.

struct ViewRay {
    // The pixel that it shows; NO_PIXEL where it shows none.
    pixel: u32,
    // The first step of this round, and of the next: MAX_STEPS where none is left.
    first_step: u32,
    next_step: u32,
}
