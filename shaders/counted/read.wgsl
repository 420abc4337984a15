// Provides: the counters, for kernels that only read them.

var<uniform> counters: Counters;
