//! The fused kernel.

use std::path::Path;

use nerf::check::draw::Random;
use nerf::check::fused::{BOUND, Fused, fused, golden_rays};
use nerf::check::hard_rays::HardRay;
use nerf::reference::Transmittance;
use nerf::reference::vectors::GoldenFile;

use crate::bench::{passes, subject};
use crate::close::assert_close;

const CONVENTIONS: [Transmittance; 2] = [Transmittance::Exclusive, Transmittance::Inclusive];

#[test]
fn hard_rays_agree_with_the_reference() {
    passes(fused(&subject()).expect("runs"));
}

fn meets(file: &GoldenFile) {
    let errors = golden_rays(&subject(), file).expect("runs");
    let mut order: Vec<_> = errors.iter().zip(&file.rays).collect();
    order.sort_by(|a, b| b.0.error.total_cmp(&a.0.error));
    for (error, ray) in order.iter().take(if std::env::var("SHOW").is_ok() { 40 } else { 1 }) {
        println!("{:?}: {:.2e} in {} of '{}'", file.transmittance, error.error, error.quantity, ray.name);
    }
    assert!(order.iter().all(|(error, _)| error.finite && error.error <= BOUND));
}

#[test]
fn golden_rays_are_met() {
    for name in ["composite_exclusive.json", "composite_inclusive.json"] {
        meets(&GoldenFile::load(&Path::new("tests/vectors").join(name)).expect("golden rays"));
    }
}

/// Batches of one ray and of billions, of which a file holds only some; thousands of rays, more than fit at once.
#[test]
fn many_hard_rays_are_met() {
    let seeds = std::env::var("SEEDS").ok().and_then(|seeds| seeds.parse().ok()).unwrap_or(1);
    for convention in CONVENTIONS {
        for seed in 100..100 + seeds {
            let mut random = Random::new(seed);
            for (count, longest, rays_in_batch) in
                [(400, 1 << 14, 400), (5000, 7, u32::MAX), (1, 4096, 1), (300, 33, 300_000)]
            {
                let rays = HardRay::many(&mut random, count, longest);
                meets(&HardRay::golden(convention, rays_in_batch, &rays));
            }
        }
    }
}

/// Worked out by hand. Two samples of optical depth ln 2, so α = 1/2 and T = 1, 1/2, 1/4; colours 1 and 0
/// in red; background 1, target 0 and opacity 1; one ray:
/// R_r = 1/2 + 1/4 = 3/4, R_α = 3/4, d_c1 = 3/8 · 1/2, d_c2 = 3/8 · 1/4.
#[test]
fn one_ray_by_hand() {
    let ray = HardRay {
        s: vec![std::f64::consts::LN_2.ln(); 2],
        delta: vec![1.0; 2],
        color: vec![[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
        target: [0.0, 0.0, 0.0, 1.0],
        background: [1.0, 0.0, 0.0],
        ..HardRay::default()
    };
    let fused = Fused::new(&subject(), Transmittance::Exclusive, 2).expect("buffers");
    let output = &fused.run(&[ray.input(1)]).expect("runs")[0];
    assert_close("rendered by hand", &output.rendered, &[0.75, 0.0, 0.0, 0.75], 3e-7, 0.0);
    assert_close("weights by hand", &output.weights, &[0.5, 0.25], 2e-7, 0.0);
    let d_red: Vec<f64> = output.d_color.iter().map(|d| d[0]).collect();
    assert_close("d_color by hand", &d_red, &[0.1875, 0.09375], 2e-7, 0.0);
    // ln 2 · [3/8 · (1/2 (1 − 1/2) , 1/4 (0 − 1)) − 1/8 · (1/2 (1 − 1/2), 1/4 · 1)].
    let d_s = [0.25 * 0.25, -0.125].map(|d| d * std::f64::consts::LN_2);
    assert_close("d_s by hand", &output.d_s, &d_s, 2e-7, 0.0);
}
