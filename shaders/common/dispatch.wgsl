// Provides: the sizes of the dispatches over counts that the device knows.
// needs: group

var<storage, read_write> dispatch: array<vec3<u32>>;

fn dispatch_over_samples(count: u32) {
    dispatch[DISPATCH_SAMPLES] = workgroups(count, 1u);
    dispatch[DISPATCH_ENCODE] = vec3(workgroups(count, 1u).x, LEVELS / 2u, 1u);
    dispatch[DISPATCH_SAMPLE_TILES] = workgroups(count, SAMPLES_PER_THREAD);
}

fn dispatch_over_kept(count: u32) {
    dispatch[DISPATCH_KEPT] = workgroups(count, 1u);
    dispatch[DISPATCH_KEPT_TILES] = workgroups(count, SAMPLES_PER_THREAD);
    // Four threads for a run.
    dispatch[DISPATCH_SCATTER] = vec3(workgroups(count, SCATTER_RUN / 4u).x, LEVELS, 1u);
}
