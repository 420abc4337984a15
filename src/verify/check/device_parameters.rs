//! The parameters of a workbench's field: what lies where on the device, and the same for the reference.

use super::Workbench;
use super::inputs::Random;
use crate::config;
use crate::field::layout::{FEATURES, Layer};
use crate::verify::reference::ColorRange;
use crate::verify::reference::grid::GridLevel;
use crate::verify::reference::loss::Loss;
use crate::verify::reference::mlp::{self, Mlp};
use crate::verify::reference::model::{Model, Objective};
use anyhow::{Result, ensure};

impl Workbench {
    /// The layers of both networks, the density network first.
    #[must_use]
    pub fn layers(&self) -> Vec<Layer> {
        self.plan.layout.density.iter().chain(&self.plan.layout.color).copied().collect()
    }

    /// The table, `[entries, 2]`.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn table(&self) -> Result<Vec<f32>> {
        self.read("table", self.plan.layout.entries * FEATURES)
    }

    /// Sets the table, `[entries, 2]`.
    pub fn set_table(&self, values: &[f32]) {
        self.write("table", values);
    }

    /// Adam's first and second moments of the table, `[entries, 2]` each.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn table_moments(&self) -> Result<[Vec<f32>; 2]> {
        let moments: Vec<[f32; 4]> = self.read("table_moments", self.plan.layout.entries)?;
        Ok([0, 2].map(|at| moments.iter().flat_map(|entry| [entry[at], entry[at + 1]]).collect()))
    }

    pub(super) fn clear_table_moments(&self) {
        self.write("table_moments", &vec![[0.0_f32; 4]; self.plan.layout.entries]);
    }

    /// The table's gradient `[entries, 2]`, ready for Adam. No sample is kept.
    pub fn set_table_gradient(&self, gradient: &[f32]) {
        if !self.plan.accumulation.is_of_integers() {
            return self.write("d_table", gradient);
        }
        let most = gradient.iter().fold(0.0_f32, |most, value| most.max(value.abs()));
        self.write("gradient_range", &[most.to_bits()]);
        // As `gradient/fixed_scale.wgsl` says: |gradient| < 2^exponent becomes an integer below 2^62.
        let exponent = (most.to_bits() >> 23).cast_signed() - 126;
        let scale = 2f64.powi((62 - exponent).min(100));
        let sums: Vec<i64> =
            gradient.iter().map(|&value| (f64::from(value) * scale).round() as i64).collect();
        self.write("d_table", &sums);
    }

    /// The weights `mlp`, or moments in their layout, layer by layer, `[outputs, inputs]`.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn weights(&self, name: &str) -> Result<Vec<Vec<f32>>> {
        let all: Vec<f32> = self.read(name, self.plan.layout.quads * 4)?;
        Ok(self.layers().iter().map(|layer| unpack(layer, &all)).collect())
    }

    /// Sets what [`Workbench::weights`] reads.
    ///
    /// # Errors
    /// When a layer is of another size.
    pub fn set_weights(&self, name: &str, weights: &[Vec<f32>]) -> Result<()> {
        self.write(name, &self.pack(weights)?);
        Ok(())
    }

    /// The weight buffer that holds these weights, layer by layer, `[outputs, inputs]`.
    ///
    /// # Errors
    /// When a layer is of another size.
    pub fn pack(&self, weights: &[Vec<f32>]) -> Result<Vec<f32>> {
        let mut all = vec![0.0; self.plan.layout.quads * 4];
        for (layer, weights) in self.layers().iter().zip(weights) {
            let expected = layer.inputs * layer.outputs;
            ensure!(weights.len() == expected, "a layer of {expected} weights was given {}", weights.len());
            for (i, &weight) in weights.iter().enumerate() {
                all[layer.index(i / layer.inputs, i % layer.inputs)] = weight;
            }
        }
        Ok(all)
    }

    /// Random parameters: the table within ±`table`, weights within ±`gain` times Glorot's bound.
    ///
    /// # Errors
    /// Never: the layers are the plan's own.
    pub fn randomise(&self, random: &mut Random, table: f64, gain: f64) -> Result<()> {
        self.set_table(&random.numbers(self.plan.layout.entries * FEATURES, -table, table));
        let last = self.layers().len() - 1;
        let weights: Vec<Vec<f32>> = (self.layers().iter().enumerate())
            .map(|(number, layer)| {
                let most = gain * (6.0 / (layer.inputs + layer.outputs) as f64).sqrt();
                let mut weights = random.numbers(layer.inputs * layer.outputs, -most, most);
                if number == last {
                    weights[3 * layer.inputs..].fill(0.0);
                }
                weights
            })
            .collect();
        self.set_weights("mlp", &weights)
    }

    /// The parameters on the device, as the reference takes them.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn model(&self) -> Result<Model> {
        Ok(self.model_of(&self.table()?, &self.weights("mlp")?))
    }

    /// These parameters as the reference takes them: the table `[entries, 2]`, weights layer by layer.
    #[must_use]
    pub fn model_of(&self, table: &[f32], weights: &[Vec<f32>]) -> Model {
        let layers: Vec<mlp::Layer> = (self.layers().iter().zip(weights))
            .map(|(layer, weights)| {
                let outputs = if layer.outputs == 4 { 3 } else { layer.outputs };
                let weights = weights[..outputs * layer.inputs].iter().map(|&w| f64::from(w)).collect();
                mlp::Layer { inputs: layer.inputs, outputs, weights }
            })
            .collect();
        let (density, color) = layers.split_at(self.plan.layout.density.len());
        Model {
            levels: self.levels(),
            table: table.iter().map(|&x| f64::from(x)).collect(),
            density: Mlp { layers: density.to_vec() },
            color: Mlp { layers: color.to_vec() },
        }
    }

    /// The grid's levels as the reference takes them.
    #[must_use]
    pub fn levels(&self) -> Vec<GridLevel> {
        (self.plan.layout.levels.iter())
            .map(|level| GridLevel {
                resolution: level.resolution,
                offset: level.first as usize,
                entries: level.entries as usize,
                dense: level.dense == 1,
            })
            .collect()
    }

    /// What the plan minimises, as the reference takes it.
    #[must_use]
    pub fn objective(&self) -> Objective {
        let transmittance = self.plan.config.transmittance;
        let color_range = if self.plan.features.hdr { ColorRange::Hdr } else { ColorRange::Ldr };
        let depth = if self.plan.features.depth { self.plan.config.loss.depth } else { 0.0 };
        let config::Loss { distortion, sparsity, .. } = self.plan.config.loss;
        let loss = Loss { is_relative: self.plan.has_relative_loss(), depth, distortion, sparsity };
        Objective { transmittance, color_range, loss }
    }
}

fn unpack(layer: &Layer, all: &[f32]) -> Vec<f32> {
    (0..layer.outputs * layer.inputs).map(|i| all[layer.index(i / layer.inputs, i % layer.inputs)]).collect()
}
