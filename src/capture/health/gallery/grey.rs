//! Reduced grey pictures, which are cheap to measure.

use crate::photo::Photo;
use crate::photo::Pixels;
use std::hash::{DefaultHasher, Hash, Hasher};

/// Blocks along either side of a thumbnail.
pub(super) const THUMBNAIL: usize = 12;

/// A grey picture: display-referred brightness over black, and alpha.
#[derive(Clone, Debug)]
pub(super) struct Grey {
    width: usize,
    height: usize,
    /// Brightness multiplied with alpha, and alpha, `[height * width]`.
    pixels: Vec<[f32; 2]>,
}

impl Grey {
    /// Means over blocks of `side` times `side` pixels; masked pixels are transparent.
    pub(super) fn of(photo: &Photo, side: u32) -> Self {
        let image = &photo.image;
        let ignored = |index: usize| photo.ignored.get(index).copied().unwrap_or(false);
        let size = [image.width as usize, image.height as usize];
        match &image.pixels {
            Pixels::Srgb8(data) => Self::blocks(size, side as usize, |index| match ignored(index) {
                true => [0.0; 2],
                false => straight(data[index].map(|value| f32::from(value) / 255.0)),
            }),
            Pixels::Srgb16(data) => Self::blocks(size, side as usize, |index| match ignored(index) {
                true => [0.0; 2],
                false => straight(data[index].map(|value| f32::from(value) / 65_535.0)),
            }),
            Pixels::Linear(data) => {
                let unit = photo.image.grey().unwrap_or(1.0) as f32;
                Self::blocks(size, side as usize, |index| match ignored(index) {
                    true => [0.0; 2],
                    false => toned(data[index], unit),
                })
            }
        }
    }

    /// The means of blocks of whole pixels; what is left at the right and bottom rims is not used, unless there is no
    /// whole block.
    fn blocks([width, height]: [usize; 2], side: usize, pixel: impl Fn(usize) -> [f32; 2]) -> Self {
        let side = side.clamp(1, width.min(height).max(1));
        let (columns, rows) = (width / side, height / side);
        let mut pixels = vec![[0.0f32; 2]; columns * rows];
        for y in 0..rows * side {
            let row = &mut pixels[y / side * columns..][..columns];
            for (block, sum) in row.iter_mut().enumerate() {
                for x in block * side..(block + 1) * side {
                    let [value, alpha] = pixel(y * width + x);
                    sum[0] += value;
                    sum[1] += alpha;
                }
            }
        }
        let scale = 1.0 / (side * side) as f32;
        pixels.iter_mut().flatten().for_each(|value| *value *= scale);
        Self { width: columns, height: rows, pixels }
    }

    /// The same at 1 / `side` of its size.
    pub(super) fn reduced(&self, side: u32) -> Self {
        Self::blocks([self.width, self.height], side as usize, |index| self.pixels[index])
    }

    /// Number of pixels.
    pub(super) fn pixels(&self) -> usize {
        self.pixels.len()
    }

    fn at(&self, x: usize, y: usize) -> f64 {
        f64::from(self.pixels[y * self.width + x][0])
    }

    /// Mean square of the Laplacian: high for fine detail.
    pub(super) fn laplacian_energy(&self) -> f64 {
        let inner = (1..self.height.saturating_sub(1))
            .flat_map(|y| (1..self.width.saturating_sub(1)).map(move |x| (x, y)));
        mean(inner.map(|(x, y)| {
            let around = self.at(x - 1, y) + self.at(x + 1, y) + self.at(x, y - 1) + self.at(x, y + 1);
            (around - 4.0 * self.at(x, y)).powi(2)
        }))
    }

    /// Mean square of the gradient.
    pub(super) fn gradient_energy(&self) -> f64 {
        let inner = (0..self.height.saturating_sub(1))
            .flat_map(|y| (0..self.width.saturating_sub(1)).map(move |x| (x, y)));
        mean(inner.map(|(x, y)| {
            let here = self.at(x, y);
            (self.at(x + 1, y) - here).powi(2) + (self.at(x, y + 1) - here).powi(2)
        }))
    }

    pub(super) fn variance(&self) -> f64 {
        let middle = mean(self.pixels.iter().map(|pixel| f64::from(pixel[0])));
        mean(self.pixels.iter().map(|pixel| (f64::from(pixel[0]) - middle).powi(2)))
    }

    /// Means of functions of the brightness over what is not transparent; `None` where all is.
    pub(super) fn opaque_means<const N: usize>(&self, values: [fn(f32) -> f32; N]) -> [Option<f64>; N] {
        let opaque = || self.pixels.iter().filter(|pixel| pixel[1] > 0.01);
        let weight: f64 = opaque().map(|pixel| f64::from(pixel[1])).sum();
        values.map(|value| {
            let sum: f64 = opaque().map(|&[v, alpha]| f64::from(value(v / alpha) * alpha)).sum();
            (weight > 0.0).then(|| sum / weight)
        })
    }

    /// Means over a grid of blocks, which need not be of one size.
    pub(super) fn thumbnail(&self) -> [f32; THUMBNAIL * THUMBNAIL] {
        std::array::from_fn(|index| {
            let span = |at: usize, size: usize| {
                let from = at * size / THUMBNAIL;
                from..((at + 1) * size / THUMBNAIL).max(from + 1).min(size)
            };
            let (columns, rows) = (span(index % THUMBNAIL, self.width), span(index / THUMBNAIL, self.height));
            let pixels = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
            mean(pixels.map(|(x, y)| self.at(x, y))) as f32
        })
    }

    /// A hash of all pixels.
    pub(super) fn fingerprint(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        (self.width, self.height).hash(&mut hasher);
        bytemuck::cast_slice::<_, u8>(&self.pixels).hash(&mut hasher);
        hasher.finish()
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0f64);
    values.for_each(|value| {
        sum += value;
        count += 1.0;
    });
    sum / count.max(1.0)
}

/// Rec. 709's weights.
fn luma(r: f32, g: f32, b: f32) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

fn straight([r, g, b, alpha]: [f32; 4]) -> [f32; 2] {
    [luma(r, g, b) * alpha, alpha]
}

/// Linear light, premultiplied, in display-referred values below 1; the photo's own typical brightness becomes 0.5.
fn toned([r, g, b, alpha]: [f32; 4], unit: f32) -> [f32; 2] {
    let light = luma(r, g, b).max(0.0);
    [light / (light + unit * alpha.max(1e-3)) * alpha, alpha]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photo::Image;

    fn grey(width: u32, height: u32, value: impl Fn(u32, u32) -> [u8; 4]) -> Grey {
        let pixels = (0..width * height).map(|index| value(index % width, index / width)).collect();
        let image = Image { width, height, pixels: Pixels::Srgb8(pixels), has_alpha: true };
        Grey::of(&image.into(), 1)
    }

    #[test]
    fn detail_is_in_the_laplacian_and_edges_in_the_gradient() {
        let board = grey(32, 32, |x, y| if (x + y) % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] });
        let step = grey(32, 32, |x, _| if x < 16 { [255; 4] } else { [0, 0, 0, 255] });
        let flat = grey(32, 32, |_, _| [128; 4]);
        assert!((board.laplacian_energy() - 16.0).abs() < 1e-5);
        assert!((step.gradient_energy() - 1.0 / 31.0).abs() < 1e-5);
        assert!(flat.laplacian_energy() < 1e-9 && flat.variance() < 1e-9);
        assert!(board.reduced(2).variance() < 1e-9);
        assert_ne!(board.fingerprint(), step.fingerprint());
    }

    #[test]
    fn transparent_pixels_do_not_count() {
        let half = grey(4, 4, |x, _| if x < 2 { [255; 4] } else { [0; 4] });
        assert_eq!(half.opaque_means([|v| v]), [Some(1.0)]);
        assert_eq!(grey(4, 4, |_, _| [9, 9, 9, 0]).opaque_means([|v| v]), [None]);
        assert_eq!((half.reduced(3).width, half.reduced(9).width), (1, 1));
    }
}
