//! The gradients of the f64 reference against central differences of its own forward passes, and properties.

use glam::DVec3;
use nerf::config::Transmittance;
use nerf::verify::reference::ColorRange;
use nerf::verify::reference::activation::{color, color_backward, log_density, log_density_backward};
use nerf::verify::reference::composite::{CompositeInput, CompositeOutput, composite};
use nerf::verify::reference::grid::{FEATURES, grid_encode, grid_encode_backward, levels, table_entries};
use nerf::verify::reference::loss::Loss;
use nerf::verify::reference::mlp::Mlp;
use nerf::verify::reference::model::{BatchOutput, Model, Objective, RaySample, TrainingRay};
use nerf::verify::reference::random::{random_u32, uniform};
use nerf::verify::reference::step::ModelTraining;

const CONVENTIONS: [Transmittance; 2] = [Transmittance::Exclusive, Transmittance::Inclusive];

/// Step of the central differences.
const STEP: f64 = 1e-5;
/// Relative to the largest gradient of the group: what truncation leaves at this step.
const TOLERANCE: f64 = 1e-6;

/// Numbers in `[low, high)`, reproducible.
struct Random {
    next: u32,
}

impl Random {
    fn new(seed: u32) -> Self {
        Self { next: seed << 16 }
    }

    fn number(&mut self, low: f64, high: f64) -> f64 {
        self.next += 1;
        low + (high - low) * f64::from(uniform(random_u32(0, 0, self.next, 0)))
    }

    fn numbers(&mut self, count: usize, low: f64, high: f64) -> Vec<f64> {
        (0..count).map(|_| self.number(low, high)).collect()
    }

    fn triple(&mut self, low: f64, high: f64) -> [f64; 3] {
        std::array::from_fn(|_| self.number(low, high))
    }

    fn direction(&mut self) -> DVec3 {
        DVec3::from_array(self.triple(-1.0, 1.0)).normalize()
    }
}

/// Compares `gradient` with central differences of `loss` at `at`, and returns how many coordinates counted.
///
/// A coordinate whose one-sided slopes disagree sits on a kink and is skipped.
fn check_gradient(name: &str, at: &[f64], gradient: &[f64], loss: impl Fn(&[f64]) -> f64) -> usize {
    assert_eq!(at.len(), gradient.len());
    let centre = loss(at);
    let scale = gradient.iter().fold(1e-3_f64, |max, g| max.max(g.abs()));
    let mut checked = 0;
    for i in 0..at.len() {
        let shifted = |by: f64| {
            let mut moved = at.to_vec();
            moved[i] += by;
            loss(&moved)
        };
        let (up, down) = (shifted(STEP), shifted(-STEP));
        let (right, left) = ((up - centre) / STEP, (centre - down) / STEP);
        if (right - left).abs() > 1e-3 * scale {
            continue;
        }
        let central = (up - down) / (2.0 * STEP);
        let error = (central - gradient[i]).abs();
        assert!(error <= TOLERANCE * scale, "{name}[{i}]: {} but slope {central}", gradient[i]);
        checked += 1;
    }
    checked
}

/// A ray of `samples`, with background and opacity target, as owned vectors.
struct Ray {
    s: Vec<f64>,
    delta: Vec<f64>,
    color: Vec<[f64; 3]>,
    target: [f64; 4],
    background: [f64; 3],
}

impl Ray {
    fn random(random: &mut Random, samples: usize) -> Self {
        Self {
            s: random.numbers(samples, -3.0, 3.0),
            delta: random.numbers(samples, 0.01, 0.3),
            color: (0..samples).map(|_| random.triple(0.0, 1.0)).collect(),
            target: std::array::from_fn(|_| random.number(0.0, 1.0)),
            background: random.triple(0.0, 1.0),
        }
    }

    fn composite(&self, convention: Transmittance, s: &[f64], color: &[[f64; 3]]) -> CompositeOutput {
        let input = CompositeInput {
            s,
            delta: &self.delta,
            color,
            target: self.target,
            background: self.background,
            rays_in_batch: 3,
        };
        composite(convention, &input)
    }
}

#[test]
fn composite_gradients_are_slopes() {
    let mut random = Random::new(1);
    for convention in CONVENTIONS {
        for samples in [1, 2, 7, 20] {
            let ray = Ray::random(&mut random, samples);
            let output = ray.composite(convention, &ray.s, &ray.color);
            let by_s = |s: &[f64]| ray.composite(convention, s, &ray.color).loss;
            let checked = check_gradient("d_s", &ray.s, &output.d_s, by_s);
            assert_eq!(checked, samples);
            let by_color = |c: &[f64]| ray.composite(convention, &ray.s, c.as_chunks::<3>().0).loss;
            let (at, gradient) = (ray.color.as_flattened(), output.d_color.as_flattened());
            assert_eq!(check_gradient("d_color", at, gradient, by_color), 3 * samples);
        }
    }
}

#[test]
fn weights_and_what_is_left_make_one() {
    let mut random = Random::new(2);
    for samples in [0, 1, 10, 300] {
        let mut ray = Ray::random(&mut random, samples);
        ray.s = random.numbers(samples, -20.0, 9.0);
        let output = ray.composite(Transmittance::Exclusive, &ray.s, &ray.color);
        let total: f64 = output.weights.iter().sum();
        assert!((total + output.transmittance_end - 1.0).abs() < 1e-12);
        assert!((total - output.rendered[3]).abs() < 1e-12);
    }
}

#[test]
fn grid_gradients_are_slopes() {
    let mut random = Random::new(3);
    let levels = levels(2, 12, 4, 256);
    assert!(levels.iter().any(|level| level.dense) && levels.iter().any(|level| !level.dense));
    let table = random.numbers(table_entries(&levels) * FEATURES, -1.0, 1.0);
    let positions: Vec<DVec3> = (0..5).map(|_| DVec3::from_array(random.triple(-0.1, 1.1))).collect();
    let d_encoded = random.numbers(levels.len() * FEATURES, -1.0, 1.0);
    let mut d_table = vec![0.0; table.len()];
    for &position in &positions {
        grid_encode_backward(&levels, position, &d_encoded, &mut d_table);
    }
    let loss = |table: &[f64]| -> f64 {
        let encoded = positions.iter().flat_map(|&position| grid_encode(&levels, table, position));
        encoded.zip(d_encoded.iter().cycle()).map(|(e, d)| e * d).sum()
    };
    assert_eq!(check_gradient("d_table", &table, &d_table, loss), table.len());
}

#[test]
fn mlp_gradients_are_slopes() {
    let mut random = Random::new(4);
    let widths = [5, 8, 6, 3];
    let weights = random.numbers(Mlp::weight_count(&widths), -1.0, 1.0);
    let input = random.numbers(5, -1.0, 1.0);
    let d_output = random.numbers(3, -1.0, 1.0);
    let loss = |weights: &[f64], input: &[f64]| -> f64 {
        let activations = Mlp::from_weights(&widths, weights).forward(input);
        activations[3].iter().zip(&d_output).map(|(y, d)| y * d).sum()
    };
    let mlp = Mlp::from_weights(&widths, &weights);
    let mut d_weights = mlp.zero_gradients();
    let d_input = mlp.backward(&mlp.forward(&input), &d_output, &mut d_weights);
    let checked = check_gradient("d_weights", &weights, &d_weights.concat(), |w| loss(w, &input));
    assert!(checked > weights.len() / 2);
    assert_eq!(check_gradient("d_input", &input, &d_input, |x| loss(&weights, x)), 5);
}

#[test]
fn activation_gradients_are_slopes() {
    let raw: Vec<f64> = (-60..=60).map(|i| f64::from(i) * 0.19).collect();
    for range in [ColorRange::Ldr, ColorRange::Hdr] {
        for &x in &raw {
            // In units of the value, as exp spans ten decades.
            let unit = color(range, x).max(1e-3);
            let gradient = color_backward(range, x, 1.0) / unit;
            assert_eq!(check_gradient("color", &[x], &[gradient], |x| color(range, x[0]) / unit), 1);
        }
    }
    for x in [-20.0, 3.0, 14.9] {
        assert_eq!(check_gradient("s", &[x], &[log_density_backward(x, 1.0)], |x| log_density(x[0])), 1);
    }
}

/// A tiny field: 3 levels (one hashed), 6 → 8 → 4, 4 + 16 → 8 → 8 → 3.
fn tiny_model(random: &mut Random) -> Model {
    let levels = levels(2, 8, 3, 128);
    let table = random.numbers(table_entries(&levels) * FEATURES, -1.0, 1.0);
    let mut mlp = |widths: &[usize]| {
        let weights = random.numbers(Mlp::weight_count(widths), -0.7, 0.7);
        Mlp::from_weights(widths, &weights)
    };
    let (density, color) = (mlp(&[6, 8, 4]), mlp(&[20, 8, 8, 3]));
    Model { levels, table, density, color }
}

/// Rays with 0, 1, 2… samples.
fn tiny_batch(random: &mut Random, rays: usize) -> Vec<TrainingRay> {
    let sample = |random: &mut Random| RaySample {
        position: DVec3::from_array(random.triple(0.0, 1.0)),
        delta: random.number(0.05, 0.5),
        gains: [1.0; 2],
        distance: random.number(0.0, 2.0),
    };
    (0..rays)
        .map(|count| TrainingRay {
            direction: random.direction(),
            samples: (0..count).map(|_| sample(random)).collect(),
            target: std::array::from_fn(|_| random.number(0.0, 1.0)),
            background: random.triple(0.0, 1.0),
            depth: if count % 3 == 1 { 0.0 } else { random.number(0.1, 1.5) },
        })
        .collect()
}

#[test]
fn whole_step_gradients_are_slopes() {
    let mut random = Random::new(5);
    let model = tiny_model(&mut random);
    let rays = tiny_batch(&mut random, 5);
    for transmittance in CONVENTIONS {
        for color_range in [ColorRange::Ldr, ColorRange::Hdr] {
            let loss = Loss { depth: 0.3, distortion: 0.2, ..Loss::default() };
            let objective = Objective { transmittance, color_range, loss };
            let gradients = model.forward_backward(objective, &rays).gradients;
            let by_table = |table: &[f64]| {
                let moved = Model { table: table.to_vec(), ..model.clone() };
                moved.forward_backward(objective, &rays).loss
            };
            let checked = check_gradient("table", &model.table, &gradients.table, by_table);
            assert!(checked * 10 > model.table.len() * 9, "{checked}");
            let weights = |mlp: &Mlp| mlp.layers.iter().flat_map(|l| l.weights.clone()).collect::<Vec<_>>();
            let by_density = |w: &[f64]| {
                let moved = Model { density: Mlp::from_weights(&[6, 8, 4], w), ..model.clone() };
                moved.forward_backward(objective, &rays).loss
            };
            let (at, gradient) = (weights(&model.density), gradients.density.concat());
            assert!(check_gradient("density", &at, &gradient, by_density) * 10 > at.len() * 9);
            let by_color = |w: &[f64]| {
                let moved = Model { color: Mlp::from_weights(&[20, 8, 8, 3], w), ..model.clone() };
                moved.forward_backward(objective, &rays).loss
            };
            let (at, gradient) = (weights(&model.color), gradients.color.concat());
            assert!(check_gradient("color", &at, &gradient, by_color) * 10 > at.len() * 9);
        }
    }
}

/// Samples in no estimate only absorb; those in one of them have no squared error, but that of the other.
#[test]
fn samples_that_are_left_out_have_no_gradient() {
    let mut random = Random::new(6);
    let model = tiny_model(&mut random);
    let mut rays = tiny_batch(&mut random, 5);
    let [none, one, other, both] = [[0.0; 2], [1.0, 0.0], [0.0, 1.0], [1.0; 2]].map(|gains| {
        for sample in rays.iter_mut().flat_map(|ray| &mut ray.samples) {
            sample.gains = gains;
        }
        model.forward_backward(Objective::default(), &rays)
    });
    assert!(none.gradients.table.iter().all(|&d| d == 0.0));
    assert_eq!((one.loss, &one.gradients), (other.loss, &other.gradients));
    assert!(one.gradients != both.gradients);
    for (number, ray) in rays.iter().enumerate() {
        for x in 0..4 {
            let error = |batch: &BatchOutput| batch.rendered[number][x] - ray.target[x];
            assert!((both.loss_terms[number][x] - error(&both).powi(2)).abs() < 1e-12);
            assert!((one.loss_terms[number][x] - error(&both) * error(&none)).abs() < 1e-12);
        }
    }
}

#[test]
fn twenty_steps_reduce_the_loss() {
    let mut random = Random::new(7);
    let model = tiny_model(&mut random);
    let rays = tiny_batch(&mut random, 12);
    let mut training = ModelTraining::new(model.clone(), Objective::default());
    let losses: Vec<f64> = (0..20).map(|_| training.step(&rays, 1e-2).loss).collect();
    assert!(losses.windows(2).all(|pair| pair[1] < pair[0]), "{losses:?}");
    assert!(losses[19] < 0.7 * losses[0], "{losses:?}");
    assert_eq!(training.steps, 20);
    // Entries that no sample touches are untouched.
    let gradient = model.forward_backward(Objective::default(), &rays).gradients.table;
    let untouched = (0..gradient.len()).filter(|&i| training.table_moments.second[i] == 0.0);
    assert!(untouched.clone().count() > 0);
    assert!(untouched.into_iter().all(|i| training.model.table[i] == model.table[i]));
    assert_eq!(training.step(&[], 1e-2).loss, 0.0);
}
