//! How cameras were held: photos are taken upright or turned by a quarter, so that one direction of the picture runs
//! along the vertical of the world.

use crate::capture::focus::median;
use glam::{DMat3, DVec3};
use std::f64::consts::FRAC_PI_2;

/// Cosine between view and vertical of a camera that looks up or down, whose picture has no upright.
pub(super) const STEEP: f64 = 0.9;
/// Fewer of the cameras than this say nothing.
const ENOUGH: f64 = 0.5;
/// Degrees that an axis of the world may be worse by than the best direction: it is what they were aligned to.
const ALIGNED_DEGREES: f64 = 3.0;

/// The vertical that cameras were held along, as far as their rolls tell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hold {
    /// Unit vector.
    pub(super) vertical: DVec3,
    /// Typical roll away from upright or a quarter turn, in degrees: a few where people held the cameras, 22.5 where
    /// all rolls are as frequent.
    pub(super) roll_degrees: f64,
}

impl Hold {
    /// The best among the axes of the world and the directions that rows and columns of the pictures run across;
    /// `axes` are those of the cameras: right, up, back. `None` where half of them look along each of these.
    pub(super) fn of(axes: &[DMat3]) -> Option<Self> {
        let across_rows = least_along(axes.iter().map(|axes| axes.x_axis));
        let across_columns = least_along(axes.iter().map(|axes| axes.y_axis));
        let best = |verticals: &[DVec3]| {
            let holds = verticals.iter().filter_map(|&vertical| Self::along(axes, vertical));
            holds.min_by(|a, b| a.roll_degrees.total_cmp(&b.roll_degrees))
        };
        let aligned = best(&[DVec3::Z, DVec3::Y, DVec3::X]);
        let free = best(&[across_rows, across_columns]);
        match (aligned, free) {
            (Some(aligned), Some(free)) if aligned.roll_degrees > free.roll_degrees + ALIGNED_DEGREES => {
                Some(free)
            }
            (aligned, free) => aligned.or(free),
        }
    }

    fn along(axes: &[DMat3], vertical: DVec3) -> Option<Self> {
        let level = axes.iter().filter(|axes| axes.z_axis.dot(vertical).abs() < STEEP);
        let rolls: Vec<f64> = level.map(|axes| roll_degrees(axes, vertical)).collect();
        let is_enough = rolls.len() as f64 >= ENOUGH * axes.len() as f64;
        (is_enough && !rolls.is_empty()).then(|| Self { vertical, roll_degrees: median(rolls.into_iter()) })
    }

    /// The mean direction of the cameras' up axes along the vertical: 1 upright, -1 upside down, 0 turned by a quarter.
    pub(super) fn upright(&self, axes: &[DMat3]) -> f64 {
        let ups = axes.iter().map(|axes| axes.y_axis.dot(self.vertical));
        ups.sum::<f64>() / axes.len() as f64
    }
}

/// Roll from the nearest of upright, upside down and the quarters between.
fn roll_degrees(axes: &DMat3, vertical: DVec3) -> f64 {
    let roll = axes.x_axis.dot(vertical).atan2(axes.y_axis.dot(vertical));
    let quarters = roll / FRAC_PI_2;
    ((quarters - quarters.round()) * FRAC_PI_2).abs().to_degrees()
}

/// The unit vector that directions have least in common with.
fn least_along(directions: impl Iterator<Item = DVec3>) -> DVec3 {
    let mut sum = DMat3::ZERO;
    let mut count = 0.0;
    for direction in directions {
        sum += DMat3::from_cols(direction * direction.x, direction * direction.y, direction * direction.z);
        count += 1.0;
    }
    // Power iteration on what the sum lacks.
    let lacking = DMat3::IDENTITY - sum * f64::recip(f64::max(count, 1.0));
    let mut least = DVec3::new(0.48, 0.6, 0.64);
    for _ in 0..200 {
        least = (lacking * least).try_normalize().unwrap_or(least);
    }
    least
}
