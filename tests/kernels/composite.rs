//! The fused kernel on files of golden rays, on many more hard ones, and on one worked out by hand.

use std::path::Path;

use anyhow::Result;
use nerf::config::Transmittance;
use nerf::verify::check::fused::{BOUND, Fused, golden_rays};
use nerf::verify::check::inputs::Random;
use nerf::verify::check::stress_rays::StressRay;
use nerf::verify::reference::vectors::GoldenFile;

use crate::bench::adapter;
use crate::close::assert_close;

#[track_caller]
fn meets(file: &GoldenFile) -> Result<()> {
    let errors = golden_rays(&adapter()?, file)?;
    assert_eq!(errors.len(), file.rays.len());
    let named = file.rays.iter().zip(errors);
    let Some((ray, worst)) = named.max_by(|a, b| a.1.error.total_cmp(&b.1.error)) else { return Ok(()) };
    let found =
        format!("{:?}: {:.1e} in {} of '{}'", file.transmittance, worst.error, worst.quantity, ray.name);
    println!("{found}");
    assert!(worst.finite && worst.error <= BOUND, "{found}");
    Ok(())
}

#[test]
fn golden_rays_are_met() -> Result<()> {
    for name in ["composite_exclusive.json", "composite_inclusive.json"] {
        meets(&GoldenFile::load(&Path::new("tests/vectors").join(name))?)?;
    }
    Ok(())
}

/// Files of no rays, of part of a batch of billions, and of many batches of one or a few; thousands of rays, more
/// than run at once; rays longer than any that is marched. `HARD_RAYS` is how many times, each with other rays.
#[test]
fn stress_rays_are_met() -> Result<()> {
    let rounds = std::env::var("HARD_RAYS").ok().and_then(|rounds| rounds.parse().ok()).unwrap_or(1);
    for seed in 100..100 + rounds {
        let mut random = Random::new(seed);
        for (count, longest, rays_in_batch) in
            [(0, 0, 7), (300, 33, 1), (300, 4096, 300_000), (5000, 7, u32::MAX), (300, 20_000, 130)]
        {
            let rays = StressRay::many(&mut random, count, longest);
            for convention in [Transmittance::Exclusive, Transmittance::Inclusive] {
                meets(&StressRay::golden(convention, rays_in_batch, &rays))?;
            }
        }
    }
    Ok(())
}

/// Worked out by hand. Two samples of optical depth ln 2, so α = 1/2 and T = 1, 1/2, 1/4; colours 1 and 0
/// in red; background 1, target 0 and opacity 1; one ray:
/// R_r = 1/2 + 1/4 = 3/4, R_α = 3/4, d_c1 = 3/8 · 1/2, d_c2 = 3/8 · 1/4.
#[test]
fn one_ray_by_hand() -> Result<()> {
    let ray = StressRay {
        s: vec![std::f64::consts::LN_2.ln(); 2],
        delta: vec![1.0; 2],
        color: vec![[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
        target: [0.0, 0.0, 0.0, 1.0],
        background: [1.0, 0.0, 0.0],
        ..StressRay::default()
    };
    let output = &Fused::new(&adapter()?, Transmittance::Exclusive, 2)?.run(&[ray.input(1)])?[0];
    assert_close("rendered by hand", &output.rendered, &[0.75, 0.0, 0.0, 0.75], 3e-7, 0.0);
    assert_close("weights by hand", &output.weights, &[0.5, 0.25], 2e-7, 0.0);
    let d_red: Vec<f64> = output.d_color.iter().map(|d| d[0]).collect();
    assert_close("d_color by hand", &d_red, &[0.1875, 0.09375], 2e-7, 0.0);
    // ln 2 · [3/8 · (1/2 (1 − 1/2) , 1/4 (0 − 1)) − 1/8 · (1/2 (1 − 1/2), 1/4 · 1)].
    let d_s = [0.25 * 0.25, -0.125].map(|d| d * std::f64::consts::LN_2);
    assert_close("d_s by hand", &output.d_s, &d_s, 2e-7, 0.0);
    Ok(())
}
