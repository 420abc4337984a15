//! Training runs of a tiny field over many steps.

use anyhow::Result;
use nerf::verify::check::Setup;
use nerf::verify::check::step::{LEARNING_RATE, TinyTraining, setups};

use crate::bench::adapter;
use crate::close::assert_close;

/// Both train on the samples that the device chose; the losses stay together while Adam amplifies rounding.
#[test]
fn twenty_losses_agree_with_the_reference() -> Result<()> {
    for (name, setup) in setups() {
        let mut tiny = TinyTraining::new(&adapter()?, setup)?;
        let mut reference = tiny.reference()?;
        let (mut got, mut want) = (Vec::new(), Vec::new());
        for _ in 0..20 {
            let (stats, batch) = tiny.step()?;
            got.push(stats.loss);
            want.push(reference.step(&batch, LEARNING_RATE).loss);
        }
        println!("{name}: loss {:.4} to {:.4}, reference {:.4}", got[0], got[19], want[19]);
        assert_close(&format!("20 losses, {name}"), &got, &want, 0.0, 2e-4);
        let sum = |losses: &[f64]| losses.iter().sum::<f64>();
        assert!(sum(&want[15..]) < 0.8 * sum(&want[..5]), "{name}: {want:?}");
    }
    Ok(())
}

/// Starting over, and going on from a state, repeat the same steps.
#[test]
fn states_are_restored() -> Result<()> {
    let mut tiny = TinyTraining::new(&adapter()?, Setup::tiny())?;
    tiny.trainer.warm_up()?;
    let losses = |tiny: &mut TinyTraining, steps: usize| -> Result<Vec<f64>> {
        (0..steps).map(|_| Ok(tiny.step()?.0.loss)).collect()
    };
    let first = losses(&mut tiny, 5)?;
    let state = tiny.trainer.state()?;
    let rest = losses(&mut tiny, 15)?;
    tiny.trainer.restore(&state)?;
    assert_eq!(tiny.trainer.steps(), 5);
    assert_eq!(tiny.trainer.state()?, state);
    // Float atomics add in any order.
    assert_close("losses after a restore", &losses(&mut tiny, 15)?, &rest, 0.0, 1e-3);
    tiny.trainer.reset()?;
    assert_close("losses after a reset", &losses(&mut tiny, 5)?, &first, 0.0, 1e-3);
    Ok(())
}
