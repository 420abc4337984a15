//! Whole training steps of a small model: gradients of a batch, then Adam.

use super::adam::{Adam, Moments, Schedule};
use super::mlp::Mlp;
use super::model::{BatchOutput, Model, Objective, TrainingRay};

/// A model in training.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelTraining {
    /// The parameters.
    pub model: Model,
    /// What is minimised.
    pub objective: Objective,
    /// Optimiser of the grid's table.
    pub table_adam: Adam,
    /// Optimiser of both networks.
    pub mlp_adam: Adam,
    /// Moments of the grid's table.
    pub table_moments: Moments,
    /// Moments of the density network, one per layer.
    pub density_moments: Vec<Moments>,
    /// Moments of the colour network, one per layer.
    pub color_moments: Vec<Moments>,
    /// Steps taken.
    pub steps: u32,
}

impl ModelTraining {
    /// A model before its first step, with [`Adam::table`] and [`Adam::mlp`].
    pub fn new(model: Model, objective: Objective) -> Self {
        Self {
            table_adam: Adam::table(),
            mlp_adam: Adam::mlp(),
            table_moments: Moments::new(model.table.len()),
            density_moments: moments(&model.density),
            color_moments: moments(&model.color),
            model,
            objective,
            steps: 0,
        }
    }

    /// One step on a batch; returns the batch's loss and gradients before the update.
    pub fn step(&mut self, rays: &[TrainingRay], learning_rate: f64) -> BatchOutput {
        let batch = self.model.forward_backward(self.objective, rays);
        self.steps += 1;
        let schedule = Schedule { step: self.steps, learning_rate };
        let (model, gradients) = (&mut self.model, &batch.gradients);
        let table = &mut model.table;
        (self.table_adam).update(schedule, &mut self.table_moments, table, &gradients.table);
        for (mlp, gradients, moments) in [
            (&mut model.density, &gradients.density, &mut self.density_moments),
            (&mut model.color, &gradients.color, &mut self.color_moments),
        ] {
            for ((layer, gradient), moments) in mlp.layers.iter_mut().zip(gradients).zip(moments) {
                (self.mlp_adam).update(schedule, moments, &mut layer.weights, gradient);
            }
        }
        batch
    }
}

fn moments(mlp: &Mlp) -> Vec<Moments> {
    (mlp.layers.iter()).map(|layer| Moments::new(layer.weights.len())).collect()
}
