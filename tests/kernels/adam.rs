//! The optimiser where there is nothing to divide by.

use anyhow::Result;
use nerf::field::optimize;
use nerf::verify::check::Setup;
use nerf::verify::check::adam::begin;

use crate::bench::workbench;
use crate::close::assert_close;

/// No gradient at all: the second moment is 0 and so is the step. With L2 alone the weights shrink.
#[test]
fn nothing_to_divide_by() -> Result<()> {
    let mut setup = Setup::tiny();
    setup.config.optimizer.beta_1 = 0.9;
    setup.config.optimizer.beta_2 = 0.99;
    setup.config.optimizer.l2 = 1e-3;
    let bench = workbench(setup)?;
    let stages = optimize::stages(&bench.gpu, &bench.plan, &bench.workspace)?;
    let quads = bench.plan.layout.quads;
    let start: Vec<f32> = (0..quads * 4).map(|i| if i % 2 == 0 { 0.0 } else { 1.0 }).collect();
    bench.write("mlp", &start);
    begin(&bench, 1, 0.25);
    bench.run_only(&stages, "weight sums")?;
    bench.run_only(&stages, "adam mlp")?;
    let got: Vec<f32> = bench.read("mlp", quads * 4)?;
    let want: Vec<f64> = start.iter().map(|&w| if w == 0.0 { 0.0 } else { 0.75 }).collect();
    assert_close("networks without gradient", &got, &want, 1e-6, 0.0);
    assert!(got.iter().step_by(2).all(|&w| w == 0.0));
    Ok(())
}
