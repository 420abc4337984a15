// Provides: whether a step's loss and gradients can be used. Judged by bit patterns, whose order is that of the magnitudes
// with infinities and NaN above all: WGSL lets a driver assume that neither occurs, so no comparison of floats may
// be trusted to find them.

// Bits of the largest magnitude among the gradients of the encoding, among those of the networks' weights, and
// among the squared errors of the rays.
var<storage, read_write> gradient_range: array<u32>;

// 2^42: sums over all kept samples stay below 2^63 ...
const ENCODING_GRADIENT_END = 169u << 23u;
// ... whose square Adam can still hold.
const WEIGHT_GRADIENT_END = 190u << 23u;
// 2^100: the sum over all rays stays finite.
const ERROR_END = 227u << 23u;

fn gradients_usable() -> bool {
    return gradient_range[0] < ENCODING_GRADIENT_END && gradient_range[1] < WEIGHT_GRADIENT_END
        && gradient_range[2] < ERROR_END;
}
