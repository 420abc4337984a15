// Provides: the counters, for kernels that write them.

var<storage, read_write> counters: Counters;
