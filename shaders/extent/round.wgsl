// Provides: the steps of a ray that are marched at once: those of a round, from where the round before ended up to
// `progress.quota` samples. A ray whose next step is MAX_STEPS has none left.
// needs: progress, view_ray

var<uniform> progress: Progress;
var<storage, read_write> view_rays: array<ViewRay>;
// 1 in the second where a slot's ray has left the box, or the slot has none.
var<storage, read_write> view_slots: array<vec2<u32>>;

// The first step to march, and the first of those that were marched.
fn extent_begin(index: u32) -> u32 {
    return view_rays[index].next_step;
}

fn extent_first(index: u32) -> u32 {
    return view_rays[index].first_step;
}

// Most samples of a ray.
fn extent_most() -> u32 {
    return progress.quota;
}

// Marching ended in front of step `next`; MAX_STEPS where it left the box.
fn extent_end(index: u32, next: u32) {
    view_rays[index].first_step = view_rays[index].next_step;
    view_rays[index].next_step = next;
    view_slots[index] = vec2(0u, u32(next >= MAX_STEPS));
}
