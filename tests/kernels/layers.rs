//! Both networks, forwards and backwards, with the activations and the harmonics in between.

use nerf::gpu::pass::Stage;
use nerf::gpu::tensor::Memory;
use nerf::kernels::layer::Product;
use nerf::reference::ColorRange;
use nerf::reference::activation::color;
use nerf::reference::grid::grid_encode;
use nerf::reference::harmonics::harmonics;
use nerf::reference::model::TrainingRay;

use crate::bench::{Bench, Random, Setup, random_batch};
use crate::close::assert_close_to_scale;

/// Values relative to the largest of their kind.
const VALUES: f64 = 5e-6;
/// Gradients likewise: they sum up more terms.
const GRADIENTS: f64 = 2e-5;

/// Compares everything that a batch leaves with the reference.
fn check(name: &str, bench: &Bench, stages: &[Stage], rays: &[TrainingRay], tolerance: f64) {
    let got = bench.train(stages, rays);
    let model = bench.model();
    let range = bench.objective().color_range;
    let (mut density, mut colors) = (Vec::new(), Vec::new());
    for ray in rays {
        for sample in &ray.samples {
            let encoded = grid_encode(&model.levels, &model.table, sample.position);
            let outputs = model.density.forward(&encoded).pop().expect("outputs");
            let input = [outputs.as_slice(), &harmonics(ray.direction)].concat();
            let raw = model.color.forward(&input).pop().expect("outputs");
            colors.extend(raw.iter().map(|&raw| color(range, raw)));
            density.extend(outputs);
        }
    }
    let want = model.forward_backward(bench.objective(), rays);
    let values = VALUES * tolerance;
    let gradients = GRADIENTS * tolerance;
    assert_close_to_scale(&format!("density, {name}"), &got.density, &density, values);
    assert_close_to_scale(&format!("color, {name}"), &got.color, &colors, values);
    let rendered = want.rendered.as_flattened();
    assert_close_to_scale(&format!("rendered, {name}"), got.rendered.as_flattened(), rendered, values);
    assert_close_to_scale(&format!("loss, {name}"), &[got.loss], &[want.loss], values);
    assert_close_to_scale(&format!("d_table, {name}"), &got.d_table, &want.gradients.table, gradients);
    let layers = want.gradients.density.iter().chain(&want.gradients.color);
    for (number, (got, want)) in got.d_weights.iter().zip(layers).enumerate() {
        let (used, unused) = got.split_at(want.len());
        assert_close_to_scale(&format!("d_weights {number}, {name}"), used, want, gradients);
        assert!(unused.iter().all(|&d| d == 0.0), "{name}: gradients of outputs that nobody uses");
    }
}

#[test]
fn networks_of_all_shapes() {
    let mut random = Random::new(20);
    for (width, color_layers, hdr, rows) in [
        (16, 1, false, None),
        (16, 3, true, Some(1)),
        (32, 2, false, Some(4)),
        (32, 3, true, None),
        (64, 1, true, Some(2)),
        (64, 2, false, None),
    ] {
        let product = rows.map(|rows| Product { rows, shared_weights: false });
        let setup = Setup { product, ..Setup::tiny().network(width, color_layers) };
        let bench = Bench::new(&setup.hdr(hdr));
        bench.randomise(&mut random, 1.0, 1.0);
        let stages = bench.stages();
        for (rays, samples) in [(3, 0), (1, 1), (2, 3), (9, 65), (33, 130)] {
            let batch = random_batch(&mut random, rays, samples);
            let name = format!("{width}x{color_layers} hdr {hdr}, {samples}");
            check(&name, &bench, &stages, &batch, 1.0);
        }
    }
}

/// The base configuration's 16 levels: an encoding of 32.
#[test]
fn sixteen_levels() {
    let mut setup = Setup::tiny().network(32, 2);
    setup.config.grid.levels = 16;
    let bench = Bench::new(&setup);
    let mut random = Random::new(21);
    bench.randomise(&mut random, 1.0, 1.0);
    check("16 levels", &bench, &bench.stages(), &random_batch(&mut random, 9, 65), 1.0);
}

/// Tensors in buffers, whatever suits this adapter best.
#[test]
fn tensors_in_buffers() {
    let setup = Setup { memory: Some(Memory::Buffers), ..Setup::tiny().network(32, 2) };
    let bench = Bench::new(&setup);
    let mut random = Random::new(23);
    bench.randomise(&mut random, 1.0, 1.0);
    check("buffers", &bench, &bench.stages(), &random_batch(&mut random, 33, 130), 1.0);
}

/// Last weights so large that densities and colours reach their clamps, and sigmoids saturate.
#[test]
fn saturated_activations() {
    let mut random = Random::new(22);
    for hdr in [false, true] {
        let bench = Bench::new(&Setup::tiny().network(32, 2).hdr(hdr));
        bench.randomise(&mut random, 1.0, 1.0);
        let mut weights = bench.weights("mlp");
        weights[1][..32].iter_mut().for_each(|weight| *weight *= 64.0);
        let last = weights.len() - 1;
        weights[last].iter_mut().for_each(|weight| *weight *= 12.0);
        bench.set_weights("mlp", &weights);
        let mut batch = random_batch(&mut random, 33, 130);
        // Steps so short that a clamped density is not opaque, and has a gradient of either sign.
        for sample in batch.iter_mut().step_by(2).flat_map(|ray| &mut ray.samples) {
            sample.delta = f64::from((sample.delta * 1e-6) as f32);
        }
        let model = bench.model();
        let range = bench.objective().color_range;
        let query = |ray: &TrainingRay| {
            let direction = ray.direction;
            (ray.samples.iter())
                .map(|sample| model.query(range, sample.position, direction))
                .collect::<Vec<_>>()
        };
        let all: Vec<_> = batch.iter().flat_map(query).collect();
        assert!(all.iter().any(|(s, _)| *s == 15.0), "no density at its clamp");
        let limit = if range == ColorRange::Hdr { 11.5_f64.exp() } else { 1.0 - 1e-9 };
        assert!(all.iter().any(|(_, c)| c.iter().any(|&c| c >= limit)), "no colour at its limit");
        // exp turns the error of a large raw colour into as large a relative one, and a saturated sigmoid's
        // slope c (1 − c) has lost most of its digits.
        check(&format!("saturated, hdr {hdr}"), &bench, &bench.stages(), &batch, 20.0);
    }
}
