//! The occupancy grid where nothing is seen, and at its largest.

use anyhow::Result;
use nerf::field::occupancy::Update;
use nerf::verify::check::Setup;

use crate::bench::workbench;

/// A grid of which no camera sees anything is empty, and its mean is a number.
#[test]
fn nothing_is_seen() -> Result<()> {
    let bench = workbench(Setup::tiny())?;
    let cells = bench.plan.cell_count();
    bench.write("occupancy", &vec![-1.0_f32; cells]);
    bench.write("occupancy_bits", &vec![u32::MAX; cells / 32]);
    let update = Update::new(&bench.gpu, &bench.plan, &bench.workspace)?;
    bench.run(update.bits())?;
    assert_eq!(bench.read::<f32>("occupancy_mean", 1)?, [0.0]);
    assert!(bench.read::<u32>("occupancy_bits", cells / 32)?.iter().all(|&word| word == 0));
    Ok(())
}

/// Software drivers end long loops: the cells behind the last round would be forgotten.
#[test]
fn the_last_cells_of_the_largest_grid_count() -> Result<()> {
    let mut setup = Setup::tiny();
    setup.config.occupancy.cells = 256;
    let bench = workbench(setup)?;
    let mut values = vec![0.0_f32; bench.plan.cell_count()];
    let last = values.len() - 256;
    values[last..].fill(65_536.0);
    bench.write("occupancy", &values);
    let update = Update::new(&bench.gpu, &bench.plan, &bench.workspace)?;
    bench.run(update.bits())?;
    assert_eq!(bench.read::<f32>("occupancy_mean", 1)?, [1.0]);
    Ok(())
}
