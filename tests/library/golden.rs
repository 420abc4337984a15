//! The f64 reference against golden rays, computed in 60-digit arithmetic from the defining sums.

#[path = "../../benches/studies/equations/textbook.rs"]
mod textbook;

use std::path::Path;

use nerf::config::Transmittance;
use nerf::verify::reference::composite::composite;
use nerf::verify::reference::vectors::{Expected, GoldenFile, NOT_FINITE, RayError};
use textbook::{Precision, textbook_d_s};

const CONVENTIONS: [Transmittance; 2] = [Transmittance::Exclusive, Transmittance::Inclusive];

fn golden(convention: Transmittance) -> GoldenFile {
    let name = match convention {
        Transmittance::Exclusive => "composite_exclusive.json",
        Transmittance::Inclusive => "composite_inclusive.json",
    };
    let file = GoldenFile::load(&Path::new("tests/vectors").join(name)).expect("golden rays");
    assert_eq!(file.transmittance, convention);
    file
}

#[test]
fn golden_rays_are_met() {
    for convention in CONVENTIONS {
        let file = golden(convention);
        let mut loss = 0.0;
        let mut worst = 0.0_f64;
        for ray in &file.rays {
            let output = composite(convention, &file.input(ray));
            let error = RayError::new(&ray.expect, &output);
            println!("{convention:?} {:<40} {:.1e} {}", ray.name, error.error, error.quantity);
            assert!(error.finite, "{}", ray.name);
            for (got, expected) in output.loss_terms.iter().zip(ray.expect.loss_terms) {
                let scale = 4.0 * f64::from(file.rays_in_batch) * ray.expect.loss_scale;
                assert!((got - expected).abs() <= 1e-12 * scale, "{}", ray.name);
            }
            worst = worst.max(error.error);
            loss += output.loss;
        }
        println!("{convention:?} worst {worst:.1e}");
        assert!(worst < 1e-12, "{convention:?} {worst}");
        let total = file.loss.expect("loss of all rays");
        assert!((loss - total).abs() <= 1e-12 * total);
    }
}

#[test]
fn golden_errors_notice_what_is_wrong() {
    let file = golden(Transmittance::Exclusive);
    let ray = &file.rays[0];
    let right = composite(file.transmittance, &file.input(ray));
    let wrong = composite(Transmittance::Inclusive, &file.input(ray));
    assert!(RayError::new(&ray.expect, &wrong).error > 0.01);
    let mut broken = right.clone();
    broken.weights[3] = f64::NAN;
    let error = RayError::new(&ray.expect, &broken);
    assert!(!error.finite && error.error == NOT_FINITE);
    broken = right;
    broken.d_s.pop();
    assert!(!RayError::new(&ray.expect, &broken).finite);
}

#[test]
fn golden_files_explain_what_is_wrong_with_them() {
    let text = std::fs::read_to_string("tests/vectors/composite_exclusive.json").expect("golden rays");
    let message = |text: &str| format!("{:#}", GoldenFile::parse(text).expect_err("broken"));
    assert!(message("{}").contains("transmittance"));
    assert!(message(&text.replace("\"dL_ds\"", "\"dl_ds\"")).contains("dL_ds"));
    let short = message(&text.replacen("\"delta\": [", "\"delta\": [0.5, ", 1));
    assert!(short.contains("ray 0 \"ordinary\"") && short.contains("delta has 49 elements, expected 48"));
    let missing = GoldenFile::load(Path::new("tests/vectors/none.json")).expect_err("no such file");
    assert!(format!("{missing:#}").contains("none.json"));
}

/// Error of the textbook gradient on a golden ray, all else being right; infinite if it is not finite.
fn textbook_error(file: &GoldenFile, name: &str, precision: Precision) -> f64 {
    let ray = file.rays.iter().find(|ray| ray.name == name).expect("a ray of that name");
    let input = file.input(ray);
    let mut output = composite(file.transmittance, &input);
    output.d_s = textbook_d_s(file.transmittance, precision, &input);
    let error = RayError::new(&ray.expect, &output);
    if error.finite { error.error } else { f64::INFINITY }
}

#[test]
fn textbook_gradient_cancels_in_single_precision() {
    for convention in CONVENTIONS {
        let file = golden(convention);
        for ray in &file.rays {
            let [single, double] =
                [Precision::Single, Precision::Double].map(|p| textbook_error(&file, &ray.name, p));
            println!("{convention:?} {:<40} f32 {single:.1e} f64 {double:.1e}", ray.name);
        }
        let ordinary = textbook_error(&file, "ordinary", Precision::Double);
        assert!(ordinary < 1e-9, "the same formula: {ordinary}");
    }
    let file = golden(Transmittance::Exclusive);
    for name in ["high dynamic range", "moderately stiff everywhere", "optical depth across twelve decades"] {
        assert!(textbook_error(&file, name, Precision::Single) > 0.1, "{name}");
    }
    let overflow = textbook_error(&file, "density overflow behind thin samples", Precision::Single);
    assert_eq!(overflow, f64::INFINITY);
}

/// Expectations from f64, and their scales, are those of 60-digit arithmetic.
#[test]
fn expectations_are_those_of_the_files() {
    for convention in CONVENTIONS {
        let file = golden(convention);
        for ray in &file.rays {
            let got = Expected::of(convention, &file.input(ray));
            let want = &ray.expect;
            let close = |name: &str, got: &[f64], want: &[f64]| {
                assert_eq!(got.len(), want.len());
                for (got, want) in got.iter().zip(want) {
                    let bound = 1e-9 * want.abs() + 1e-35;
                    assert!((got - want).abs() <= bound, "{} {name}: {got:e}, {want:e}", ray.name);
                }
            };
            close("R", &got.rendered_scale, &want.rendered_scale);
            close("loss", &[got.loss_scale], &[want.loss_scale]);
            close("dL_dc", got.d_color_scale.as_flattened(), want.d_color_scale.as_flattened());
            close("dL_ds", &got.d_s_scale, &want.d_s_scale);
        }
    }
}
