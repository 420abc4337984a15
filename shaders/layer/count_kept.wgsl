// Provides: the rows of a layer that runs over the kept samples. Needs: counters.

var<uniform> counters: Counters;

fn layer_count() -> u32 {
    return counters.kept;
}
