//! Smaller versions: colours are averaged, flags and depths are not.

use rayon::prelude::*;

use crate::photo::{Image, Pixels};

/// The source pixels along one axis that a smaller pixel covers: the first one, and the share of each.
struct Span {
    first: usize,
    /// Parts of the smaller pixel, sum 1.
    weights: Vec<f64>,
}

/// The spans of `to` pixels on `from`, `to <= from`.
fn spans(from: u32, to: u32) -> Vec<Span> {
    let scale = f64::from(from) / f64::from(to);
    let span = |index: u32| {
        let (begin, end) = (f64::from(index) * scale, (f64::from(index + 1) * scale).min(f64::from(from)));
        let first = begin.floor() as usize;
        // A sliver that only rounding put there is no part.
        let last = ((end - 1e-9).floor() as usize).max(first);
        let share = |pixel: usize| (end.min(pixel as f64 + 1.0) - begin.max(pixel as f64)) / scale;
        Span { first, weights: (first..=last).map(share).collect() }
    };
    (0..to).map(span).collect()
}

/// The source pixels that one smaller pixel covers.
struct Footprint<'a> {
    across: &'a Span,
    down: &'a Span,
    /// Of the source, in pixels.
    width: usize,
}

impl Footprint<'_> {
    /// Index and weight of each; the weights have the sum 1.
    fn pixels(&self) -> impl Iterator<Item = (usize, f64)> {
        self.down.weights.iter().enumerate().flat_map(|(j, &wy)| {
            let start = (self.down.first + j) * self.width + self.across.first;
            self.across.weights.iter().enumerate().map(move |(i, &wx)| (start + i, wx * wy))
        })
    }
}

/// The smaller pixels, row by row, as `make` makes them of what they cover.
fn each<T: Send>(from: [u32; 2], to: [u32; 2], make: impl Fn(Footprint<'_>) -> T + Sync) -> Vec<T> {
    let (columns, rows) = (spans(from[0], to[0]), spans(from[1], to[1]));
    let width = from[0] as usize;
    let row = |down: &Span| -> Vec<T> {
        columns.iter().map(|across| make(Footprint { across, down, width })).collect()
    };
    rows.par_iter().map(row).collect::<Vec<_>>().into_iter().flatten().collect()
}

impl Image {
    /// The pixels at `size`, which is at most as large: each is the mean of the area it covers.
    pub(crate) fn reduced(self, size: [u32; 2]) -> Self {
        let pixels = reduce(&self.pixels, self.size(), size);
        let [width, height] = size;
        Self { width, height, pixels, ..self }
    }
}

/// Averages in the encoding of the pixels, weighted by area and, where alpha is straight, by alpha.
fn reduce(pixels: &Pixels, from: [u32; 2], to: [u32; 2]) -> Pixels {
    match pixels {
        Pixels::Srgb8(pixels) => Pixels::Srgb8(each(from, to, |covered| {
            straight_mean(covered.pixels().map(|(index, weight)| (pixels[index].map(f64::from), weight)))
                .map(|value| (value + 0.5) as u8)
        })),
        Pixels::Srgb16(pixels) => Pixels::Srgb16(each(from, to, |covered| {
            straight_mean(covered.pixels().map(|(index, weight)| (pixels[index].map(f64::from), weight)))
                .map(|value| (value + 0.5) as u16)
        })),
        Pixels::Linear(pixels) => Pixels::Linear(each(from, to, |covered| {
            let mut sum = [0.0; 4];
            for (index, weight) in covered.pixels() {
                for (sum, &value) in sum.iter_mut().zip(&pixels[index]) {
                    *sum += weight * f64::from(value);
                }
            }
            sum.map(|value| value as f32)
        })),
    }
}

/// `Σ w α c / Σ w α` and `Σ w α`; no colour where nothing has alpha.
fn straight_mean(covered: impl Iterator<Item = ([f64; 4], f64)>) -> [f64; 4] {
    let mut sum = [0.0; 4];
    for ([r, g, b, alpha], weight) in covered {
        let opacity = weight * alpha;
        sum[0] += opacity * r;
        sum[1] += opacity * g;
        sum[2] += opacity * b;
        sum[3] += opacity;
    }
    let [r, g, b, alpha] = sum;
    if alpha > 0.0 { [r / alpha, g / alpha, b / alpha, alpha] } else { [0.0; 4] }
}

/// `true` where any of the pixels that a smaller one covers is `true`, `[height * width]`.
pub(crate) fn reduce_any(flags: &[bool], from: [u32; 2], to: [u32; 2]) -> Vec<bool> {
    if from == to {
        return flags.to_vec();
    }
    each(from, to, |covered| covered.pixels().any(|(index, _)| flags[index]))
}

/// The lower median of the known depths (above 0) that a smaller pixel covers, `[height * width]`; 0 without
/// one. A mean would put points between the two sides of an edge, where nothing is.
pub(crate) fn reduce_depth(depth: &[f32], from: [u32; 2], to: [u32; 2]) -> Vec<f32> {
    each(from, to, |covered| {
        let mut known: Vec<f32> =
            covered.pixels().map(|(index, _)| depth[index]).filter(|&depth| depth > 0.0).collect();
        if known.is_empty() {
            return 0.0;
        }
        let middle = (known.len() - 1) / 2;
        *known.select_nth_unstable_by(middle, f32::total_cmp).1
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_cover_everything_once() {
        for (from, to) in [(12, 4), (13, 4), (7, 7), (1920, 481), (5, 1), (65536, 21845)] {
            let mut total = vec![0.0; from as usize];
            for span in spans(from, to) {
                assert!((span.weights.iter().sum::<f64>() - 1.0).abs() < 1e-6, "{from} {to}");
                for (i, weight) in span.weights.iter().enumerate() {
                    total[span.first + i] += weight * f64::from(from) / f64::from(to);
                }
            }
            assert!(total.iter().all(|&total| (total - 1.0).abs() < 1e-6), "{from} {to}");
        }
    }

    #[test]
    fn colours_count_as_much_as_they_are_opaque() {
        let pixels = vec![[200, 100, 0, 255], [0, 0, 0, 0], [100, 50, 30, 255], [9, 9, 9, 0]];
        let reduced = reduce(&Pixels::Srgb8(pixels), [2, 2], [1, 1]);
        assert_eq!(reduced, Pixels::Srgb8(vec![[150, 75, 15, 128]]));
        let nothing = reduce(&Pixels::Srgb16(vec![[9, 9, 9, 0]; 4]), [4, 1], [1, 1]);
        assert_eq!(nothing, Pixels::Srgb16(vec![[0; 4]]));
        let linear = vec![[1.0, 0.5, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0]];
        assert_eq!(
            reduce(&Pixels::Linear(linear), [2, 1], [1, 1]),
            Pixels::Linear(vec![[0.5, 0.25, 0.0, 0.5]])
        );
    }

    #[test]
    fn a_third_of_a_pixel_counts_a_third() {
        // Three pixels on two: each covers one and a half.
        let pixels = vec![[30, 0, 0, 255], [60, 0, 0, 255], [240, 0, 0, 255]];
        let reduced = reduce(&Pixels::Srgb8(pixels), [3, 1], [2, 1]);
        assert_eq!(reduced, Pixels::Srgb8(vec![[40, 0, 0, 255], [180, 0, 0, 255]]));
    }

    #[test]
    fn flags_spread_and_depths_stay_on_their_side() {
        let flags = [false, false, true, false, false, false, false, false];
        assert_eq!(reduce_any(&flags, [4, 2], [2, 1]), [false, true]);
        let depth = [1.0, 1.1, 9.0, 0.0, 0.0, 0.0, 0.0, 5.0];
        assert_eq!(reduce_depth(&depth, [4, 2], [2, 1]), [1.0, 5.0]);
        assert_eq!(reduce_depth(&[0.0; 4], [2, 2], [1, 1]), [0.0]);
    }
}
