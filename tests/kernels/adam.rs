//! The optimiser, of the table and of the networks, over several steps.

use nerf::config::Accumulation;
use nerf::gpu::pass::Stage;
use nerf::kernels::{Counters, Step, training};
use nerf::reference::adam::{Adam, Moments, Schedule};

use crate::bench::{Bench, Random, Setup, quiet_step};
use crate::close::{assert_close, largest};

const STEPS: u32 = 6;
const RAYS: usize = 3;

fn setup() -> Setup {
    let mut setup = Setup::tiny();
    setup.config.optimizer.beta_1 = 0.9;
    setup.config.optimizer.beta_2 = 0.99;
    setup.config.optimizer.l2 = 1e-3;
    setup
}

/// The bench's constants as the reference takes them.
fn reference(bench: &Bench, l2: f64, skip_zero: bool) -> Adam {
    let config = &bench.plan.config.optimizer;
    Adam { beta1: config.beta_1, beta2: config.beta_2, epsilon: config.epsilon, l2, skip_zero }
}

fn begin(bench: &Bench, step: u32, learning_rate: f64) {
    let config = &bench.plan.config.optimizer;
    let correction = |beta: f64| (1.0 / (1.0 - beta.powf(f64::from(step)))) as f32;
    bench.set_step(Step {
        learning_rate: learning_rate as f32,
        first_correction: correction(config.beta_1),
        second_correction: correction(config.beta_2),
        ..quiet_step()
    });
    let rays = RAYS as u32;
    bench.set_counters(Counters { rays, rays_used: rays, ..Counters::default() });
}

fn stages(bench: &Bench) -> Vec<Stage> {
    training::update(&bench.gpu, &bench.plan, &bench.workspace).expect("update")
}

fn exact(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&value| f64::from(value)).collect()
}

/// Gradients from 1e-12 to 1, a third of them zero.
fn gradients(random: &mut Random, count: usize) -> Vec<f32> {
    (0..count)
        .map(|i| {
            let sign = if random.number(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
            let size = 10f64.powf(random.number(-12.0, 0.0));
            if i % 3 == 0 { 0.0 } else { (sign * size) as f32 }
        })
        .collect()
}

#[test]
fn table_agrees_with_the_reference() {
    for accumulation in [Accumulation::Auto, Accumulation::Exchange, Accumulation::Fixed] {
        let bench = Bench::new(&setup().accumulation(accumulation));
        let stages = stages(&bench);
        let mut random = Random::new(70);
        let count = bench.plan.layout.entries * 2;
        let start = random.numbers(count, -1.0, 1.0);
        bench.set_table(&start);
        let (mut want, mut moments) = (exact(&start), Moments::new(count));
        let adam = reference(&bench, 0.0, true);
        for step in 1..=STEPS {
            let learning_rate = f64::from(0.01_f32) / f64::from(step);
            let gradient = gradients(&mut random, count);
            begin(&bench, step, learning_rate);
            bench.set_table_gradient(&gradient);
            bench.run_only(&stages, "adam table");
            adam.update(Schedule { step, learning_rate }, &mut moments, &mut want, &exact(&gradient));
        }
        let name = format!("{:?}", bench.plan.accumulation);
        let [first, second] = bench.table_moments();
        assert_close(&format!("first moments, table, {name}"), &first, &moments.first, 1e-7, 2e-6);
        assert_close(&format!("second moments, table, {name}"), &second, &moments.second, 1e-30, 2e-6);
        assert_close(&format!("table, {name}"), &bench.table(), &want, 1e-6, 0.0);
        // Every third gradient was always zero.
        let table = bench.table();
        assert!((0..count).step_by(3).all(|i| table[i] == start[i] && moments.second[i] == 0.0));
    }
}

#[test]
fn networks_agree_with_the_reference() {
    let bench = Bench::new(&setup().network(32, 2));
    let stages = stages(&bench);
    let mut random = Random::new(71);
    bench.randomise(&mut random, 1.0, 1.0);
    let quads = bench.plan.layout.quads;
    let start: Vec<f32> = bench.read("mlp", quads * 4);
    let (mut want, mut moments) = (exact(&start), Moments::new(quads * 4));
    let adam = reference(&bench, bench.plan.config.optimizer.l2, false);
    for step in 1..=STEPS {
        let learning_rate = f64::from(0.01_f32) / f64::from(step);
        let chunks = random.numbers(bench.plan.chunks * quads * 4, -0.1, 0.1);
        let mut gradient = vec![0.0; quads * 4];
        for chunk in chunks.chunks_exact(quads * 4) {
            gradient.iter_mut().zip(chunk).for_each(|(sum, &part)| *sum += f64::from(part));
        }
        begin(&bench, step, learning_rate);
        bench.write("d_weight_chunks", &chunks);
        bench.run_only(&stages, "weight sums");
        bench.run_only(&stages, "adam mlp");
        adam.update(Schedule { step, learning_rate }, &mut moments, &mut want, &gradient);
    }
    let read = |name: &str| -> Vec<f32> { bench.read(name, quads * 4) };
    let first = 2e-6 * largest(&moments.first);
    assert_close("first moments, networks", &read("mlp_first"), &moments.first, first, 0.0);
    let second = 2e-6 * largest(&moments.second);
    assert_close("second moments, networks", &read("mlp_second"), &moments.second, second, 0.0);
    assert_close("networks", &read("mlp"), &want, 5e-6, 0.0);
}

/// No gradient at all: the second moment is 0 and so is the step. With L2 alone the weights shrink.
#[test]
fn nothing_to_divide_by() {
    let bench = Bench::new(&setup());
    let stages = stages(&bench);
    let quads = bench.plan.layout.quads;
    let start: Vec<f32> = (0..quads * 4).map(|i| if i % 2 == 0 { 0.0 } else { 1.0 }).collect();
    bench.write("mlp", &start);
    begin(&bench, 1, 0.25);
    bench.run_only(&stages, "weight sums");
    bench.run_only(&stages, "adam mlp");
    let got: Vec<f32> = bench.read("mlp", quads * 4);
    let want: Vec<f64> = start.iter().map(|&w| if w == 0.0 { 0.0 } else { 0.75 }).collect();
    assert_close("networks without gradient", &got, &want, 1e-6, 0.0);
    assert!(got.iter().step_by(2).all(|&w| w == 0.0));
}
