// Provides: the rows of a layer that runs over all marched samples.
// needs: counters


fn layer_count() -> u32 {
    return counters.samples;
}
