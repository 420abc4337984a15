//! Renders one view of a scene with a fixed pattern of sub-rays per pixel.

use super::Scene;
use crate::camera::Camera;
use glam::{DVec2, dvec2};
use rayon::prelude::*;

/// A rendered view: row-major, one entry per pixel.
pub(super) struct RenderedImage {
    /// Premultiplied linear colour and alpha.
    pub linear: Vec<[f32; 4]>,
    /// Straight sRGB colour and alpha, rounded to 8 bits; averaged premultiplied in encoded values.
    pub srgb: Vec<[u8; 4]>,
    /// Mean depth (see [`crate::camera::LensKind::depth_is_distance`]) weighted by alpha, 0 where alpha is 0.
    pub depth: Vec<f32>,
}

/// Renders `camera`'s view with `samples * samples` sub-rays per pixel.
pub(super) fn render(scene: &Scene, camera: &Camera, samples: u32) -> RenderedImage {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let pattern = pattern(samples);
    let pixels: Vec<Pixel> = (0..width * height)
        .into_par_iter()
        .with_min_len(width)
        .map(|i| {
            let corner = dvec2((i % width) as f64, (i / width) as f64);
            pixel(scene, camera, corner, &pattern)
        })
        .collect();
    RenderedImage {
        linear: pixels.iter().map(Pixel::linear).collect(),
        srgb: pixels.iter().map(Pixel::srgb8).collect(),
        depth: pixels.iter().map(Pixel::depth).collect(),
    }
}

/// Sub-pixel positions in `[0, 1)²`, one in each cell of a `samples`² grid, sheared so that no two share a row
/// or a column: an edge along an axis then has `samples`² levels of coverage instead of `samples`.
fn pattern(samples: u32) -> Vec<DVec2> {
    let n = f64::from(samples);
    let cells = (0..samples).flat_map(|j| (0..samples).map(move |i| (f64::from(i), f64::from(j))));
    cells.map(|(i, j)| dvec2(i + (j + 0.5) / n, j + (i + 0.5) / n) / n).collect()
}

/// Means over the sub-rays of a pixel.
#[derive(Default)]
struct Pixel {
    /// Premultiplied linear colour.
    linear: [f64; 3],
    /// Premultiplied encoded colour.
    srgb: [f64; 3],
    alpha: f64,
    /// Alpha times the depth.
    alpha_depth: f64,
}

/// The pixel whose top-left corner is `corner`. Sub-rays that the lens cannot form see nothing.
fn pixel(scene: &Scene, camera: &Camera, corner: DVec2, pattern: &[DVec2]) -> Pixel {
    let share = 1.0 / pattern.len() as f64;
    let mut sum = Pixel::default();
    for ray in pattern.iter().filter_map(|&offset| camera.ray(corner + offset)) {
        let hit = scene.trace(ray.origin, ray.direction);
        if hit.alpha <= 0.0 {
            continue;
        }
        let weight = share * hit.alpha;
        for channel in 0..3 {
            sum.linear[channel] += weight * hit.color_linear[channel];
            sum.srgb[channel] += weight * hit.color_srgb[channel];
        }
        sum.alpha += weight;
        sum.alpha_depth += weight * hit.t * camera.depth_of_unit(ray.direction);
    }
    sum.alpha = sum.alpha.min(1.0);
    sum
}

impl Pixel {
    fn linear(&self) -> [f32; 4] {
        let [r, g, b] = self.linear.map(|value| value as f32);
        [r, g, b, self.alpha as f32]
    }

    fn srgb8(&self) -> [u8; 4] {
        if self.alpha <= 0.0 {
            return [0; 4];
        }
        let byte = |value: f64| (255.0 * value).round().clamp(0.0, 255.0) as u8;
        let [r, g, b] = self.srgb.map(|value| byte(value / self.alpha));
        [r, g, b, byte(self.alpha)]
    }

    fn depth(&self) -> f32 {
        if self.alpha > 0.0 { (self.alpha_depth / self.alpha) as f32 } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pattern_is_stratified_along_both_axes() {
        for samples in [1, 2, 4, 5] {
            let pattern = pattern(samples);
            let count = (samples * samples) as usize;
            let strata = |axis: usize| {
                let mut rows: Vec<usize> =
                    pattern.iter().map(|p| (p[axis] * count as f64).floor() as usize).collect();
                rows.sort_unstable();
                rows
            };
            assert_eq!(strata(0), (0..count).collect::<Vec<_>>());
            assert_eq!(strata(1), (0..count).collect::<Vec<_>>());
            let mean = pattern.iter().sum::<DVec2>() / count as f64;
            assert!(mean.abs_diff_eq(DVec2::splat(0.5), 1e-12));
        }
    }

    #[test]
    fn colours_of_edges_are_straight() {
        let edge = Pixel { srgb: [0.4, 0.2, 0.0], alpha: 0.5, alpha_depth: 1.5, ..Pixel::default() };
        assert_eq!(edge.srgb8(), [204, 102, 0, 128]);
        assert_eq!(edge.depth(), 3.0);
        assert_eq!((Pixel::default().srgb8(), Pixel::default().depth()), ([0; 4], 0.0));
    }
}
