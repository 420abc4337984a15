//! The occupancy grid: which cells of the box hold anything, in `C` nested cascades of `R³` cells.
//!
//! Cascade `c` is the centred cube of side `2^(c−(C−1))` of the box: cascade 0 the inner cube, the last the
//! whole box. Cell `(x, y, z)` of cascade `c` has the index `c R³ + x + y R + z R²`, and the bit of that number in
//! an array of 32-bit words, the lowest bit first.

use glam::DVec3;

use super::activation::log_density;

/// What a cell usually keeps of its value at an update.
pub const DECAY: f64 = 0.95;
/// Value of a cell that no camera sees; it keeps it, and is never occupied.
pub const UNSEEN: f64 = -1.0;

/// Shape of the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OccupancyShape {
    /// `C`: number of cascades, at least 1.
    pub cascades: u32,
    /// `R`: cells per axis of each cascade.
    pub resolution: u32,
}

impl OccupancyShape {
    /// Number of cells of all cascades.
    pub fn cells(&self) -> usize {
        self.cascades as usize * (self.resolution as usize).pow(3)
    }

    /// Side of cascade `c` in box space, `2^(c−(C−1))`.
    pub fn side(&self, cascade: u32) -> f64 {
        2.0_f64.powi(cascade as i32 - (self.cascades as i32 - 1))
    }

    /// The smallest cascade that holds a position of box space; the last one for positions outside.
    pub fn cascade(&self, position: DVec3) -> u32 {
        let reach = (position - 0.5).abs().max_element();
        (0..self.cascades).find(|&c| reach < 0.5 * self.side(c)).unwrap_or(self.cascades.saturating_sub(1))
    }

    /// The cell of a position of box space, in its smallest cascade; positions outside go to the nearest cell.
    pub fn cell(&self, position: DVec3) -> usize {
        let cascade = self.cascade(position);
        let r = self.resolution as usize;
        let [x, y, z] = ((position - 0.5) / self.side(cascade) + 0.5)
            .to_array()
            .map(|p| ((p * r as f64).floor().max(0.0) as usize).min(r.saturating_sub(1)));
        cascade as usize * r.pow(3) + x + y * r + z * r * r
    }

    /// The position of box space at `offset`, each in `[0, 1)`, within a cell.
    pub fn position(&self, cell: usize, offset: DVec3) -> DVec3 {
        let r = (self.resolution as usize).max(1);
        let (cascade, cell) = (cell / r.pow(3), cell % r.pow(3));
        let corner = [cell % r, cell / r % r, cell / (r * r)].map(|i| i as f64);
        let in_cascade = (DVec3::from_array(corner) + offset) / r as f64;
        (in_cascade - 0.5) * self.side(cascade as u32) + 0.5
    }
}

/// New value of a visited cell, an optical depth: `max(old, exp(min(raw, 15)) δ_min)`; an unseen cell stays. Visits are
/// those of an update and of every marched sample of a training run.
///
/// `raw` is the network's log-density somewhere in the cell. `delta_min` is the shortest step in units of the
/// inner cube's side, `dt_min 2^(C−1)`.
pub fn visit(old: f64, raw: f64, delta_min: f64) -> f64 {
    if old < 0.0 { old } else { old.max(log_density(raw).exp() * delta_min) }
}

/// What an update leaves of a cell's value once its bit is known; `decay` is usually [`DECAY`].
pub fn fade(value: f64, decay: f64) -> f64 {
    if value > 0.0 { value * decay } else { value }
}

/// The value above which a cell counts as occupied: half the mean over all cells that are seen, but at most `limit`.
pub fn threshold(values: &[f64], limit: f64) -> f64 {
    let (sum, seen) = (values.iter().filter(|&&value| value >= 0.0))
        .fold((0.0, 0_usize), |(sum, seen), value| (sum + value, seen + 1));
    (0.5 * sum / seen.max(1) as f64).min(limit)
}

/// The bits of all cells: set where `value > threshold`.
pub fn bits(values: &[f64], threshold: f64) -> Vec<u32> {
    (values.chunks(32))
        .map(|word| {
            let set = |(i, &value): (usize, &f64)| u32::from(value > threshold) << i;
            word.iter().enumerate().map(set).sum()
        })
        .collect()
}

/// Whether a cell's bit is set; cells beyond the words are empty.
pub fn is_set(words: &[u32], cell: usize) -> bool {
    words.get(cell / 32).is_some_and(|word| (word >> (cell % 32)) & 1 == 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPE: OccupancyShape = OccupancyShape { cascades: 3, resolution: 4 };

    #[test]
    fn cells_by_hand() {
        // Inner cube: [0.375, 0.625]³; x = 0.4 is 0.1 of it, cell 0; y = z = 0.5 cell 2.
        assert_eq!(SHAPE.cell(DVec3::new(0.4, 0.5, 0.5)), 2 * 4 + 2 * 16);
        // Cascade 1: [0.25, 0.75]³; x = 0.3 is 0.1 of it.
        assert_eq!(SHAPE.cell(DVec3::new(0.3, 0.5, 0.5)), 64 + 40);
        // Cascade 2: the box; outside goes to the border.
        assert_eq!(SHAPE.cell(DVec3::new(1.0, 0.0, 0.5)), 128 + 3 + 32);
        assert_eq!(SHAPE.cell(DVec3::new(1e30, -9.0, 0.5)), 128 + 3 + 32);
        assert_eq!(SHAPE.cells(), 192);
    }

    #[test]
    fn positions_lie_in_their_cell() {
        let inner = |cell: usize| {
            let centre = SHAPE.position(cell, DVec3::splat(0.5));
            (SHAPE.cascade(centre) as usize == cell / 64).then(|| SHAPE.cell(centre))
        };
        for cell in 0..SHAPE.cells() {
            assert!(inner(cell).is_none_or(|found| found == cell), "{cell}");
        }
        // Cascade 0 whole, an eighth less in each of the others, which the next smaller one covers.
        assert_eq!((0..192).filter_map(inner).count(), 64 + 2 * 56);
    }

    #[test]
    fn values_become_bits() {
        assert_eq!((visit(1.0, -30.0, 0.01), fade(1.0, DECAY)), (1.0, 0.95));
        assert_eq!(visit(1e-3, 0.0, 0.01), 0.01);
        assert!(visit(0.0, 1e30, 0.01).is_finite());
        assert_eq!((visit(UNSEEN, 1e30, 0.01), fade(UNSEEN, DECAY)), (UNSEEN, UNSEEN));
        let mut values = vec![0.0; 40];
        values[33] = 4.0;
        assert_eq!(threshold(&values, 1.0), 0.05);
        assert_eq!(threshold(&values, 0.01), 0.01);
        values[..20].fill(UNSEEN);
        assert_eq!(threshold(&values, 1.0), 0.1);
        assert_eq!(bits(&values, threshold(&[UNSEEN], 1.0)), [0, 2]);
        let words = bits(&values, 0.1);
        assert_eq!(words, [0, 2]);
        assert!(is_set(&words, 33) && !is_set(&words, 32) && !is_set(&words, 64));
        assert_eq!(threshold(&[], 1.0), 0.0);
    }
}
