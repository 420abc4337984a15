//! Rays that are hard on arithmetic, with what the f64 reference makes of them.

use nerf::check::draw::Random;
use nerf::reference::Transmittance;
use nerf::reference::composite::{CompositeInput, composite, opacity, optical_depth, transmittances};
use nerf::reference::vectors::{Expected, GoldenFile, GoldenRay};

/// Rays of each kind.
const RAYS: u32 = 16;
/// Largest colour of a ray in display-referred and in linear light.
const HDR: f64 = 1e4;

/// A kind of rays.
struct Family {
    name: &'static str,
    samples: usize,
    /// Decimal logarithms of the least and the largest optical depth of a sample.
    depths: (f64, f64),
    /// Those of the last eighth of the samples, if they differ.
    wall: Option<(f64, f64)>,
    /// Largest colour.
    brightest: f64,
}

const FAMILIES: [Family; 7] = [
    Family { name: "ordinary", samples: 48, depths: (-2.0, -0.3), wall: None, brightest: 1.0 },
    Family { name: "nearly transparent", samples: 512, depths: (-9.0, -7.0), wall: None, brightest: 1.0 },
    Family {
        name: "moderately stiff everywhere",
        samples: 128,
        depths: (0.0, 1.7),
        wall: None,
        brightest: 1.0,
    },
    Family {
        name: "stiff wall behind fog",
        samples: 64,
        depths: (-3.0, -1.5),
        wall: Some((2.0, 6.0)),
        brightest: 1.0,
    },
    Family {
        name: "twelve decades of optical depth",
        samples: 80,
        depths: (-8.0, 4.0),
        wall: None,
        brightest: 1.0,
    },
    Family { name: "high dynamic range", samples: 64, depths: (-2.0, 0.0), wall: None, brightest: HDR },
    Family {
        name: "density beyond f32 behind thin samples",
        samples: 16,
        depths: (-4.0, -2.0),
        wall: Some((39.0, 45.0)),
        brightest: 1.0,
    },
];

/// Rays of every family; the same in every run, of numbers that f32 holds exactly.
pub(super) fn golden(convention: Transmittance) -> GoldenFile {
    let mut random = Random::new(7);
    let rays_in_batch = RAYS * FAMILIES.len() as u32;
    let each = FAMILIES.iter().flat_map(|family| (0..RAYS).map(move |_| family));
    let rays = each.map(|family| family.ray(&mut random, convention, rays_in_batch)).collect();
    GoldenFile { transmittance: convention, rays_in_batch, loss: None, rays }
}

impl Family {
    fn ray(&self, random: &mut Random, convention: Transmittance, rays_in_batch: u32) -> GoldenRay {
        let delta: Vec<f64> = (0..self.samples).map(|_| random.number(0.001, 0.1)).collect();
        let s: Vec<f64> = (delta.iter().enumerate())
            .map(|(i, delta)| {
                let is_wall = i >= self.samples - self.samples / 8;
                let (least, most) = self.wall.filter(|_| is_wall).unwrap_or(self.depths);
                let depth = random.number(least, most);
                f64::from((depth * std::f64::consts::LN_10 - delta.ln()) as f32)
            })
            .collect();
        let high = self.brightest;
        let color: Vec<[f64; 3]> = (0..self.samples).map(|_| random.vector(0.0, high).to_array()).collect();
        let target = random.vector(0.0, high).extend(random.number(0.0, 1.0)).to_array();
        let background = random.vector(0.0, high).to_array();
        let input = CompositeInput { s: &s, delta: &delta, color: &color, target, background, rays_in_batch };
        let expect = expected(convention, &input);
        let [red, green, blue, gt_alpha] = target;
        GoldenRay {
            name: self.name.to_owned(),
            s,
            delta,
            c: color,
            gt: [red, green, blue],
            gt_alpha,
            background,
            expect,
        }
    }
}

/// What the reference makes of a ray, and the scales of errors: the sizes of the terms, as [`Expected`] has them.
fn expected(convention: Transmittance, ray: &CompositeInput<'_>) -> Expected {
    let output = composite(convention, ray);
    let m = f64::from(ray.rays_in_batch);
    let end = output.transmittance_end;
    let color = |i: usize, x: usize| if x < 3 { ray.color[i][x] } else { 1.0 };
    let background = |x: usize| if x < 3 { ray.background[x] } else { 0.0 };
    let size: [f64; 4] = std::array::from_fn(|x| output.rendered[x].abs() + ray.target[x].abs());
    let sum = |x: usize| output.weights.iter().enumerate().map(|(i, w)| w * color(i, x).abs()).sum::<f64>();
    let rendered_scale = std::array::from_fn(|x| sum(x) + end * background(x).abs());
    let d_color_scale =
        output.weights.iter().map(|w| std::array::from_fn(|x| size[x] / (2.0 * m) * w)).collect();

    let depths: Vec<f64> = ray.s.iter().zip(ray.delta).map(|(&s, &delta)| optical_depth(s, delta)).collect();
    let through = transmittances(convention, &depths);
    let mut d_s_scale = vec![0.0; depths.len()];
    for (x, size) in size.into_iter().enumerate() {
        let residual = (output.rendered[x] - ray.target[x]).abs();
        // All behind sample i as a sum of terms of one sign: colours are not negative.
        let mut later = 0.0;
        for i in (0..depths.len()).rev() {
            let own = through[i] * (-depths[i]).exp() * color(i, x);
            let with_sample = later + through[i] * opacity(depths[i]) * color(i, x);
            let behind = if convention == Transmittance::Inclusive { with_sample } else { later };
            let last = end * background(x);
            let derivative = depths[i] * (own - behind - last);
            let terms = depths[i] * (own.abs() + behind.abs() + last.abs());
            d_s_scale[i] += (residual * terms + size * derivative.abs()) / (2.0 * m);
            later = with_sample;
        }
    }
    Expected {
        rendered: output.rendered,
        loss_terms: output.loss_terms,
        loss: output.loss,
        weights: output.weights,
        d_color: output.d_color,
        d_s: output.d_s,
        rendered_scale,
        loss_scale: size.iter().map(|size| size * size).sum::<f64>() / (4.0 * m),
        d_color_scale,
        d_s_scale,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nerf::reference::textbook::{Precision, textbook_d_s};
    use nerf::reference::vectors::RayError;
    use std::path::Path;

    const CONVENTIONS: [Transmittance; 2] = [Transmittance::Exclusive, Transmittance::Inclusive];

    /// On the golden rays, computed in 60 digits, the scales are those of the file.
    #[test]
    fn scales_are_those_of_golden_rays() {
        for name in ["composite_exclusive.json", "composite_inclusive.json"] {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/vectors").join(name);
            let file = GoldenFile::load(&path).expect("golden rays");
            for ray in &file.rays {
                let ours = expected(file.transmittance, &file.input(ray));
                let pairs = ours.d_s_scale.iter().zip(&ray.expect.d_s_scale);
                let pairs = pairs.chain(ours.rendered_scale.iter().zip(&ray.expect.rendered_scale));
                let pairs = pairs.chain([(&ours.loss_scale, &ray.expect.loss_scale)]);
                for (ours, theirs) in pairs {
                    assert!(
                        (ours - theirs).abs() <= 1e-9 * theirs.max(1e-30),
                        "{}: {ours:e} {theirs:e}",
                        ray.name
                    );
                }
            }
        }
    }

    #[test]
    fn stiff_rays_break_the_textbook_form_in_single_precision_only() {
        for convention in CONVENTIONS {
            let file = golden(convention);
            let mut worst = 0.0_f64;
            for ray in &file.rays {
                let input = file.input(ray);
                let mut output = composite(convention, &input);
                assert!(RayError::new(&ray.expect, &output).error == 0.0, "{}", ray.name);
                assert!(ray.s.iter().chain(&ray.delta).all(|&number| f64::from(number as f32) == number));
                output.d_s = textbook_d_s(convention, Precision::Single, &input);
                let error = RayError::new(&ray.expect, &output);
                if ray.name == "ordinary" {
                    assert!(error.error < 1e-4, "{convention:?} {}", error.error);
                }
                worst = worst.max(error.error);
            }
            assert!(worst > 0.1, "{convention:?}: {worst}");
        }
    }
}
