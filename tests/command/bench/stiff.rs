//! Rays that are hard on arithmetic, and the textbook gradient on them.

use super::studies::equations::stiff::golden;
use super::studies::equations::textbook::{Precision, textbook_d_s};
use nerf::config::Transmittance;
use nerf::verify::reference::composite::composite;
use nerf::verify::reference::vectors::RayError;

const CONVENTIONS: [Transmittance; 2] = [Transmittance::Exclusive, Transmittance::Inclusive];

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
