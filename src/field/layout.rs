//! The parameters of a field and their layout: levels of the grid, layers of the networks.

use super::Space;
use crate::camera::Camera;
use crate::config::{Config, Grid};
use crate::gpu_struct;
use crate::support::statistics::median;

/// Features per entry of the hash table.
pub const FEATURES: usize = 2;
/// Outputs of the density network: the log-density and 15 features.
pub const DENSITY_OUTPUTS: usize = 16;
/// Inputs of the colour network: the density network's outputs and 16 harmonics.
pub const COLOR_INPUTS: usize = DENSITY_OUTPUTS + 16;
/// Outputs of the colour network, the fourth unused.
pub const COLOR_OUTPUTS: usize = 4;
/// Layers start at multiples of this many vec4 (256 bytes), so that each can be bound as a uniform.
const LAYER_ALIGNMENT: usize = 16;

gpu_struct! {
    /// One level of the hash grid.
    Level {
        /// Cells per axis.
        resolution: u32,
        /// First entry in the table.
        first: u32,
        /// Number of entries.
        entries: u32,
        /// 1 when every vertex has an entry of its own.
        dense: u32,
    }
}

/// One layer without bias. Weights are stored as vec4 over four outputs: `[outputs / 4][inputs]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layer {
    /// Number of inputs, a multiple of 4.
    pub inputs: usize,
    /// Number of outputs, a multiple of 4.
    pub outputs: usize,
    /// First vec4 in the weight buffer.
    pub first_quad: usize,
}

impl Layer {
    /// Number of vec4.
    #[must_use]
    pub fn quads(&self) -> usize {
        self.inputs * self.outputs / 4
    }

    /// Index of the weight from `input` to `output` in the weight buffer, in floats.
    #[must_use]
    pub fn index(&self, output: usize, input: usize) -> usize {
        (self.first_quad + (output / 4) * self.inputs + input) * 4 + output % 4
    }
}

/// Sizes and offsets of all parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Levels of the grid, coarsest first.
    pub levels: Vec<Level>,
    /// Entries of the table over all levels.
    pub entries: usize,
    /// The density network's layers.
    pub density: Vec<Layer>,
    /// The colour network's layers.
    pub color: Vec<Layer>,
    /// Number of vec4 in the weight buffer.
    pub quads: usize,
}

impl Layout {
    /// The layout that `config` describes, whose `grid.finest` is never 0.
    #[must_use]
    pub fn new(config: &Config) -> Self {
        let levels = grid_levels(&config.grid);
        let entries = levels.last().map_or(0, |level| (level.first + level.entries) as usize);
        let width = config.network.width;
        let encoding = config.grid.levels * FEATURES;
        let mut quads = 0;
        let mut chain = |sizes: &[usize]| -> Vec<Layer> {
            sizes
                .windows(2)
                .map(|pair| {
                    let layer = Layer { inputs: pair[0], outputs: pair[1], first_quad: quads };
                    quads += layer.quads().next_multiple_of(LAYER_ALIGNMENT);
                    layer
                })
                .collect()
        };
        let density = chain(&[encoding, width, DENSITY_OUTPUTS]);
        let mut sizes = vec![COLOR_INPUTS];
        sizes.extend(std::iter::repeat_n(width, config.network.color_layers));
        sizes.push(COLOR_OUTPUTS);
        let color = chain(&sizes);
        Self { levels, entries, density, color, quads }
    }

    /// Features of an encoded position.
    #[must_use]
    pub fn encoding(&self) -> usize {
        self.levels.len() * FEATURES
    }

    /// Table entries drawn uniformly from ±1e-4, as Müller et al. do.
    #[must_use]
    pub fn initial_table(&self, seed: u32) -> Vec<f32> {
        let mut random = InitialNumbers::new(seed, 1);
        (0..self.entries * FEATURES).map(|_| (random.uniform() * 2.0 - 1.0) * 1e-4).collect()
    }

    /// Weights drawn uniformly as Glorot & Bengio (2010) do; unused outputs are 0 and stay so.
    #[must_use]
    pub fn initial_weights(&self, seed: u32) -> Vec<f32> {
        let mut random = InitialNumbers::new(seed, 2);
        let mut weights = vec![0.0; self.quads * 4];
        let last = self.color.len() - 1;
        for (number, layer) in self.density.iter().chain(&self.color).enumerate() {
            let is_color = number == self.density.len() + last;
            let used = if is_color { 3 } else { layer.outputs };
            let most = (6.0 / (layer.inputs + used) as f32).sqrt();
            for output in 0..used {
                for input in 0..layer.inputs {
                    weights[layer.index(output, input)] = (random.uniform() * 2.0 - 1.0) * most;
                }
            }
        }
        weights
    }
}

fn grid_levels(grid: &Grid) -> Vec<Level> {
    let count = grid.levels;
    let base = f64::from(grid.base);
    let growth = (f64::from(grid.finest.max(grid.base)) / base).powf(1.0 / (count - 1) as f64);
    let largest = 1u64 << grid.log2_table;
    let mut first = 0;
    (0..count)
        .map(|level| {
            let resolution = (base * growth.powi(level as i32) + 0.5).floor() as u64;
            let vertices = (resolution + 1).pow(3);
            let dense = vertices <= largest;
            let entries = if dense { vertices.next_multiple_of(2) } else { largest } as u32;
            let level = Level { resolution: resolution as u32, first, entries, dense: u32::from(dense) };
            first += entries;
            level
        })
        .collect()
}

/// Finest cells along a pixel of a training view.
const CELLS_PER_PIXEL: f64 = 1.5;

/// Cells per axis of the finest level: what the configuration says or, where it leaves them open, one and a half along
/// what a pixel of the median training view covers at the box's centre.
#[must_use]
pub fn finest_resolution(grid: &Grid, space: &Space, cameras: &[Camera]) -> u32 {
    if grid.finest > 0 {
        return grid.finest;
    }
    let sharpness = |camera: &Camera| camera.pixels_per_length(space.distance_from_center(camera.position()));
    let middle = median(cameras.iter().map(sharpness)).unwrap_or(0.0);
    let cells = CELLS_PER_PIXEL * space.world_per_box() * middle;
    (cells.min(space.most_grid_cells()) as u32).max(grid.base)
}

/// The project's integer hash (PCG, Jarzynski & Olano 2020), the same as in the kernels.
#[must_use]
pub fn pcg(value: u32) -> u32 {
    let state = value.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// A sequence of random numbers for the initial parameters.
struct InitialNumbers {
    stream: u32,
    index: u32,
}

impl InitialNumbers {
    fn new(seed: u32, stream: u32) -> Self {
        Self { stream: pcg(stream.wrapping_add(pcg(seed))), index: 0 }
    }

    /// Uniform in [0, 1).
    fn uniform(&mut self) -> f32 {
        self.index += 1;
        (pcg(self.index.wrapping_add(self.stream)) >> 8) as f32 / (1 << 24) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Bounds, Lens};
    use glam::{DAffine3, DVec2, DVec3};

    #[test]
    fn the_finest_cells_follow_the_pixels() {
        let camera = |distance: f64| Camera {
            width: 100,
            height: 100,
            focal_px: DVec2::splat(200.0),
            center_px: DVec2::splat(50.0),
            lens: Lens::Pinhole,
            world_from_camera: DAffine3::from_translation(DVec3::new(distance, 0.0, 0.0)),
        };
        let cameras = [camera(2.0), camera(4.0), camera(40.0)];
        let open = |base| Grid { base, ..Grid::default() };
        let space = |cascades| {
            let source = String::new();
            Space::from(&Bounds { center: DVec3::ZERO, half: 1.0, cascades, source, is_guess: false })
        };
        // 200 px / 4 = 50 pixels per unit, 100 across the box of side 2, 150 cells.
        assert_eq!(finest_resolution(&open(16), &space(1), &cameras), 150);
        assert_eq!(finest_resolution(&open(16), &space(3), &cameras), 600);
        // 128 cells at least across the inner cube, which is a 128th of the box.
        assert_eq!(finest_resolution(&open(16), &space(8), &cameras), 128 * 128);
        assert_eq!(finest_resolution(&open(256), &space(1), &cameras), 256);
        assert_eq!(finest_resolution(&open(16), &space(1), &[]), 16);
        assert_eq!(finest_resolution(&open(16), &space(1), &[camera(0.0)]), 6000);
        // Parallel rays are as dense at any distance.
        let parallel = Camera { lens: Lens::Orthographic, ..camera(40.0) };
        assert_eq!(finest_resolution(&open(16), &space(1), &[parallel]), 600);
        let sphere = Camera { lens: Lens::Equirectangular, ..camera(4.0) };
        assert_eq!(finest_resolution(&open(16), &space(1), &[sphere]), 150);
    }
}
