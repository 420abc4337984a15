//! Where world, box and hash grid meet: the twin of `shaders/space`.
//!
//! *World* space is the dataset's own. *Box* space is what the kernels march through: the scene's box is its unit cube.
//! The hash grid covers the unit cube of *grid* space, which is box space where space is not bent. Densities and
//! distances along rays are in sides of the inner cube.

use crate::camera::Bounds;
use crate::config::March;
use glam::DVec3;

/// Most cells per axis of a hash grid over cascades, whose far cubes no view sees as sharply as the inner one, …
const MOST_CELLS_OF_CASCADES: f64 = 4096.0;
/// … unless that leaves the inner cube fewer than this.
const CELLS_OF_INNER_CUBE: f64 = 128.0;
/// Most cells per axis of any hash grid.
const MOST_CELLS: f64 = 65536.0;

/// The space of a scene: cubes about one centre, each twice as wide as the one in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Space {
    center: DVec3,
    /// Half the side of the inner cube, in world units.
    half: f64,
    /// Half that of the box.
    outer_half: f64,
    cascades: u32,
}

impl From<&Bounds> for Space {
    fn from(bounds: &Bounds) -> Self {
        let Bounds { center, half, cascades, .. } = *bounds;
        Self { center, half, outer_half: bounds.outer_half(), cascades }
    }
}

impl Space {
    /// Whether all of it is the inner cube.
    #[must_use]
    pub fn is_bounded(&self) -> bool {
        self.cascades == 1
    }

    /// Number of cubes.
    #[must_use]
    pub fn cascades(&self) -> usize {
        self.cascades as usize
    }

    /// Sides of the inner cube along that of the box.
    #[must_use]
    pub fn cubes_per_box(&self) -> f64 {
        self.outer_half / self.half
    }

    /// World units along the side of the box.
    #[must_use]
    pub fn world_per_box(&self) -> f64 {
        2.0 * self.outer_half
    }

    /// Sides of the inner cube along a world unit.
    #[must_use]
    pub fn cubes_per_world(&self) -> f64 {
        0.5 / self.half
    }

    /// A point of the world, in box space.
    #[must_use]
    pub fn in_box(&self, world: DVec3) -> DVec3 {
        let corner = self.center - self.outer_half;
        (world - corner) / self.world_per_box()
    }

    /// The least and the largest step of a ray in box units, of an occupancy grid of `cells` cells per axis: a part of the
    /// inner cube's diagonal, and a cell of the outermost cube.
    #[must_use]
    pub fn step_range(&self, march: &March, cells: u32) -> [f64; 2] {
        [3f64.sqrt() / f64::from(march.steps) / self.cubes_per_box(), 1.0 / f64::from(cells)]
    }

    /// Where sampling begins, in box units from the camera.
    #[must_use]
    pub fn near(&self, march: &March) -> f64 {
        march.near / self.cubes_per_box()
    }

    /// The shape of an occupancy grid of `cells` cells per axis: cubes from the inside out, then z, y and x.
    #[must_use]
    pub fn grid_shape(&self, cells: u32) -> [usize; 4] {
        let cells = cells as usize;
        [self.cascades(), cells, cells, cells]
    }

    /// The world-space centre and side of cell `index` of such a grid.
    #[must_use]
    pub fn cell(&self, index: u32, cells: u32) -> (DVec3, f64) {
        let per_cube = cells.pow(3);
        let side = 2.0 * self.half * f64::from(1u32 << (index / per_cube)) / f64::from(cells);
        let within = index % per_cube;
        let corner = DVec3::new(
            f64::from(within % cells),
            f64::from(within / cells % cells),
            f64::from(within / (cells * cells)),
        );
        (self.center + (corner + 0.5 - f64::from(cells) / 2.0) * side, side)
    }

    /// Most cells per axis that a hash grid has use for.
    #[must_use]
    pub fn most_grid_cells(&self) -> f64 {
        match self.is_bounded() {
            true => MOST_CELLS,
            false => f64::max(MOST_CELLS_OF_CASCADES, CELLS_OF_INNER_CUBE * self.cubes_per_box()),
        }
    }

    /// Distance of a point from the centre in world units, but no less than a tenth of the inner cube's half side.
    #[must_use]
    pub fn distance_from_center(&self, world: DVec3) -> f64 {
        world.distance(self.center).max(0.1 * self.half)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPACE: Space = Space { center: DVec3::new(1.0, 2.0, 3.0), half: 0.5, outer_half: 2.0, cascades: 3 };

    #[test]
    fn the_box_is_the_unit_cube() {
        assert_eq!((SPACE.cubes_per_box(), SPACE.world_per_box(), SPACE.cubes_per_world()), (4.0, 4.0, 1.0));
        assert_eq!(SPACE.in_box(DVec3::new(1.0, 2.0, 3.0)), DVec3::splat(0.5));
        assert_eq!(SPACE.in_box(DVec3::new(-1.0, 4.0, 3.5)), DVec3::new(0.0, 1.0, 0.625));
    }

    #[test]
    fn cells_fill_the_cubes_from_the_inside_out() {
        assert_eq!(SPACE.grid_shape(2), [3, 2, 2, 2]);
        assert_eq!(SPACE.cell(0, 2), (DVec3::new(0.75, 1.75, 2.75), 0.5));
        assert_eq!(SPACE.cell(7 + 8 * 2, 2), (DVec3::new(2.0, 3.0, 4.0), 2.0));
        let volume: f64 = (0..3 * 8).map(|index| SPACE.cell(index, 2).1.powi(3)).sum();
        assert_eq!(volume, 1.0 + 8.0 + 64.0);
    }

    #[test]
    fn steps_are_parts_of_the_inner_cube_and_cells_of_the_outer() {
        let march = March { steps: 100, near: 0.2, ..March::default() };
        let [least, most] = SPACE.step_range(&march, 64);
        assert!((least * SPACE.world_per_box() - 3f64.sqrt() / 100.0).abs() < 1e-15);
        assert_eq!((most, SPACE.near(&march)), (1.0 / 64.0, 0.05));
    }
}
