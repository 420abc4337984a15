//! What each setting may be.

use super::{Accumulation, Background, Config};
use anyhow::{Result, bail};

/// Most rays or samples of a step: what every adapter dispatches along one axis, 65,535 workgroups of 64.
const MOST_COUNT: usize = 65_535 * 64;

impl Config {
    /// Checks every range.
    ///
    /// # Errors
    /// Names the first key out of range, what is allowed and what was found.
    pub fn validate(&self) -> Result<()> {
        let Self { grid, network, march, occupancy, batch, selection, loss, optimizer, .. } = self;
        if self.deterministic && matches!(self.accumulation, Accumulation::Float | Accumulation::Exchange) {
            bail!(
                "a deterministic run must not add floats in any order: accumulation must be auto, ordered, \
                 fixed or long; found {:?}",
                self.accumulation
            );
        }
        let whole = |key: &str, value: usize, low: usize, high: usize, step: usize| {
            if value < low || value > high || !value.is_multiple_of(step) {
                let kind = if step == 1 { "whole number".to_owned() } else { format!("multiple of {step}") };
                bail!("{key} must be a {kind} from {low} to {high}; found {value}");
            }
            Ok(())
        };
        whole("grid.levels", grid.levels, 8, 32, 8)?;
        whole("grid.base", grid.base as usize, 1, 1 << 16, 1)?;
        whole("grid.finest", grid.finest as usize, 0, 1 << 20, 1)?;
        whole("grid.log2_table", grid.log2_table as usize, 8, 24, 1)?;
        whole("network.width", network.width, 16, 128, 16)?;
        whole("network.color_layers", network.color_layers, 1, 4, 1)?;
        whole("march.steps", march.steps as usize, 8, 1 << 14, 1)?;
        whole("march.most_steps", march.most_steps, 32, 1 << 14, 32)?;
        whole("occupancy.cells", occupancy.cells as usize, 16, 256, 16)?;
        whole("occupancy.interval", occupancy.interval as usize, 1, 1 << 20, 1)?;
        whole("batch.kept", batch.kept, march.most_steps, MOST_COUNT, 1)?;
        whole("batch.samples", batch.samples, batch.kept.max(march.most_steps), MOST_COUNT, 1)?;
        whole("batch.rays", batch.rays, 64, MOST_COUNT, 1)?;
        whole("batch.first_rays", batch.first_rays as usize, 1, batch.rays, 1)?;
        let real = |key: &str, value: f64, low: f64, high: f64| {
            if !(low..=high).contains(&value) {
                bail!("{key} must lie between {low} and {high}; found {value}");
            }
            Ok(())
        };
        if let Background::Color(color) = self.background {
            color.iter().try_for_each(|&part| real("background", part.into(), 0.0, 1e6))?;
        }
        real("march.samples_per_ray", march.samples_per_ray, 1.0, 1e6)?;
        real("march.longest_step", march.longest_step, 1.0, 64.0)?;
        real("march.cone", march.cone, 1e-5, 0.1)?;
        // The growth of the longest steps, whose logarithm the kernels know by a series.
        real("march.cone times march.longest_step", march.cone * march.longest_step, 0.0, 1.0)?;
        real("march.near", march.near, 0.0, 10.0)?;
        real("occupancy.share", occupancy.share, 0.0, 10.0)?;
        real("occupancy.decay", occupancy.decay, 0.0, 1.0)?;
        real("occupancy.threshold", occupancy.threshold, 0.0, 1e6)?;
        real("selection.weight_floor", selection.weight_floor, 0.0, 1.0)?;
        real("selection.light_share", selection.light_share, 0.0, 1.0)?;
        real("selection.stop_transmittance", selection.stop_transmittance, 0.0, 0.5)?;
        real("loss.depth", loss.depth, 0.0, 1e6)?;
        real("loss.distortion", loss.distortion, 0.0, 1e3)?;
        real("loss.sparsity", loss.sparsity, 0.0, 1e3)?;
        real("optimizer.learning_rate", optimizer.learning_rate, 0.0, 1e3)?;
        real("optimizer.final_learning_rate", optimizer.final_learning_rate, 0.0, 1e3)?;
        real("optimizer.beta_1", optimizer.beta_1, 0.0, 0.999_999)?;
        real("optimizer.beta_2", optimizer.beta_2, 0.0, 0.999_999)?;
        real("optimizer.epsilon", optimizer.epsilon, 1e-30, 1.0)?;
        real("optimizer.l2", optimizer.l2, 0.0, 1.0)
    }
}
