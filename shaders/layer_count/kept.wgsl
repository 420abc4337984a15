// Provides: the rows of a layer that runs over the kept samples.
// needs: counters


fn layer_count() -> u32 {
    return counters.kept;
}
