//! The optimiser, of the table and of the networks, over several steps.

use super::check_result::largest;
use super::inputs::{Random, quiet_step};
use super::{CheckResult, CheckedAdapter, Setup, Workbench};
use crate::field::{Counters, Step, optimize};
use crate::verify::reference::adam::{Adam, Moments, Schedule};
use anyhow::Result;

const STEPS: u32 = 6;

/// Moments and parameters of table and networks over several steps, gradients of exactly zero among them.
///
/// # Errors
/// When the device was lost or refuses a kernel.
pub fn adam(adapter: &CheckedAdapter) -> Result<Vec<CheckResult>> {
    let mut setup = Setup::tiny().network(32, 2);
    setup.config.optimizer.beta_1 = 0.9;
    setup.config.optimizer.beta_2 = 0.99;
    setup.config.optimizer.l2 = 1e-3;
    let bench = adapter.workbench(setup)?;
    Ok(vec![table(&bench)?, networks(&bench)?])
}

/// The bench's constants as the reference takes them.
fn reference(bench: &Workbench, l2: f64, skip_zero: bool) -> Adam {
    let config = &bench.plan.config.optimizer;
    Adam { beta1: config.beta_1, beta2: config.beta_2, epsilon: config.epsilon, l2, skip_zero }
}

/// Sets what Adam needs to know of step `step`.
pub fn begin(bench: &Workbench, step: u32, learning_rate: f64) {
    let config = &bench.plan.config.optimizer;
    bench.set_step(Step { stream: quiet_step().stream, ..Step::learning(config, step, learning_rate) });
    bench.set_counters(Counters { rays: 3, rays_used: 3, ..Counters::default() });
}

fn exact(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&value| f64::from(value)).collect()
}

/// Gradients from 1e-12 to 1, a third of them zero: in the first half always the same, then others every step.
fn gradients(random: &mut Random, step: u32, count: usize) -> Vec<f32> {
    (0..count)
        .map(|i| {
            let sign = if random.number(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
            let size = 10f64.powf(random.number(-12.0, 0.0));
            let turn = if i < count / 2 { 0 } else { step as usize };
            if (i + turn) % 3 == 0 { 0.0 } else { (sign * size) as f32 }
        })
        .collect()
}

fn table(bench: &Workbench) -> Result<CheckResult> {
    let mut result = CheckResult::new("Adam: table", 3e-6, "four roundings per step and moment, six steps");
    let stages = optimize::stages(&bench.gpu, &bench.plan, &bench.workspace)?;
    let mut random = Random::new(70);
    let count = bench.plan.layout.entries * 2;
    let start = random.numbers(count, -1.0, 1.0);
    bench.set_table(&start);
    let (mut want, mut moments) = (exact(&start), Moments::new(count));
    let mut sizes = vec![0.0_f64; count];
    let adam = reference(bench, 0.0, true);
    for step in 1..=STEPS {
        let learning_rate = f64::from(0.01_f32) / f64::from(step);
        let gradient = gradients(&mut random, step, count);
        begin(bench, step, learning_rate);
        bench.set_table_gradient(&gradient);
        bench.run_only(&stages, "adam table")?;
        adam.update(Schedule { step, learning_rate }, &mut moments, &mut want, &exact(&gradient));
        sizes.iter_mut().zip(&gradient).for_each(|(size, g)| *size = size.max(f64::from(g.abs())));
    }
    let [first, second] = bench.table_moments()?;
    result.each("first moments", &first, &moments.first, |i| sizes[i]);
    result.each("second moments", &second, &moments.second, |i| moments.second[i].max(1e-24));
    let table = bench.table()?;
    result.each("parameters", &table, &want, |_| 1.0);
    // Every third gradient of the first half was always zero.
    let untouched = (0..count / 2).step_by(3).all(|i| table[i] == start[i] && second[i] == 0.0);
    result.holds(untouched, || "parameters without a gradient".into());
    Ok(result)
}

fn networks(bench: &Workbench) -> Result<CheckResult> {
    let mut result =
        CheckResult::new("Adam: networks", 5e-6, "sums of 32 chunks and four roundings per step, six steps");
    let stages = optimize::stages(&bench.gpu, &bench.plan, &bench.workspace)?;
    let mut random = Random::new(71);
    bench.randomise(&mut random, 1.0, 1.0)?;
    let quads = bench.plan.layout.quads;
    let start: Vec<f32> = bench.read("mlp", quads * 4)?;
    let (mut want, mut moments) = (exact(&start), Moments::new(quads * 4));
    let adam = reference(bench, bench.plan.config.optimizer.l2, false);
    for step in 1..=STEPS {
        let learning_rate = f64::from(0.01_f32) / f64::from(step);
        let chunks = random.numbers(bench.plan.chunks * quads * 4, -0.1, 0.1);
        let mut gradient = vec![0.0; quads * 4];
        for chunk in chunks.chunks_exact(quads * 4) {
            gradient.iter_mut().zip(chunk).for_each(|(sum, &part)| *sum += f64::from(part));
        }
        begin(bench, step, learning_rate);
        bench.write("d_weight_chunks", &chunks);
        bench.run_only(&stages, "weight sums")?;
        bench.run_only(&stages, "adam mlp")?;
        adam.update(Schedule { step, learning_rate }, &mut moments, &mut want, &gradient);
    }
    let read = |name: &str| -> Result<Vec<f32>> { bench.read(name, quads * 4) };
    result.all("first moments", &read("mlp_first")?, &moments.first);
    result.all("second moments", &read("mlp_second")?, &moments.second);
    let scale = largest(&want);
    result.each("parameters", &read("mlp")?, &want, |_| scale);
    Ok(result)
}
