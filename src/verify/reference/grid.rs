//! The multiresolution hash grid (Müller et al. 2022, section 3) and its gradient.
//!
//! Level `l` has `N_l = ⌊base · growth^l + ½⌋` cells per axis, with two features on each of its `(N_l + 1)³`
//! vertices. A vertex `(x, y, z)` of a level that fits into the table has the entry
//! `x + y (N+1) + z (N+1)²`; of any other level, `(x ⊕ y·2654435761 ⊕ z·805459861) mod T` in 32-bit arithmetic
//! (eq. 4), where different vertices share entries.

use glam::DVec3;

/// Features per entry.
pub const FEATURES: usize = 2;
/// Multipliers of the spatial hash (Müller et al. 2022, eq. 4).
pub const HASH_PRIMES: [u32; 3] = [1, 2_654_435_761, 805_459_861];

/// One level of the grid and its place in the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GridLevel {
    /// `N`: cells per axis.
    pub resolution: u32,
    /// First entry of the level in the table.
    pub offset: usize,
    /// Number of entries.
    pub entries: usize,
    /// Whether every vertex has an entry of its own.
    pub dense: bool,
}

/// One vertex around a position: its entry in the whole table, and its trilinear weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Entry in the table.
    pub entry: usize,
    /// Share of the vertex in the interpolated value; the eight sum to 1.
    pub weight: f64,
}

/// The levels from `base` to `finest` cells per axis, with `growth = (finest/base)^(1/(count−1))`.
///
/// `table_size` is `T`, a power of two: the most entries that a level has.
pub fn levels(base: u32, finest: u32, count: usize, table_size: u32) -> Vec<GridLevel> {
    let ratio = f64::from(finest) / f64::from(base.max(1));
    let growth = match count {
        0 | 1 => 1.0,
        _ => ratio.powf(1.0 / (count - 1) as f64),
    };
    let mut offset = 0;
    (0..count)
        .map(|l| {
            let cells = (f64::from(base) * growth.powf(l as f64) + 0.5).floor();
            let resolution = (cells as u32).max(1);
            let vertices = (u128::from(resolution) + 1).pow(3);
            let dense = vertices <= u128::from(table_size);
            let entries = if dense { vertices.next_multiple_of(2) as usize } else { table_size as usize };
            let level = GridLevel { resolution, offset, entries, dense };
            offset += entries;
            level
        })
        .collect()
}

/// Entries of all levels together; the table has [`FEATURES`] values for each.
pub fn table_entries(levels: &[GridLevel]) -> usize {
    levels.iter().map(|level| level.entries).sum()
}

impl GridLevel {
    /// Entry, within the level, of the vertex with these integer coordinates, each in `0..=N`.
    pub fn index(&self, vertex: [u32; 3]) -> usize {
        let [x, y, z] = vertex;
        if self.dense {
            let side = self.resolution as usize + 1;
            x as usize + y as usize * side + z as usize * side * side
        } else {
            let hash = x.wrapping_mul(HASH_PRIMES[0])
                ^ y.wrapping_mul(HASH_PRIMES[1])
                ^ z.wrapping_mul(HASH_PRIMES[2]);
            hash as usize % self.entries
        }
    }

    /// The eight vertices around a position in box space, x varying fastest.
    ///
    /// `p = x N`, `cell = min(⌊p⌋, N − 1)`, `frac = p − cell`; the weight is the product of `frac` or
    /// `1 − frac` per axis. Positions outside the box are clamped to it.
    pub fn corners(&self, position: DVec3) -> [Corner; 8] {
        let n = f64::from(self.resolution);
        let scaled = position.to_array().map(|x| x.clamp(0.0, 1.0) * n);
        let cell = scaled.map(|p| p.floor().min(n - 1.0));
        std::array::from_fn(|corner| {
            let mut weight = 1.0;
            let vertex = std::array::from_fn(|axis| {
                let upper = (corner >> axis) & 1;
                let frac = scaled[axis] - cell[axis];
                weight *= if upper == 1 { frac } else { 1.0 - frac };
                cell[axis] as u32 + upper as u32
            });
            Corner { entry: self.offset + self.index(vertex), weight }
        })
    }
}

/// Features `[levels · 2]`, level-major, at a position in box space; the table is `[entries, 2]`.
pub fn grid_encode(levels: &[GridLevel], table: &[f64], position: DVec3) -> Vec<f64> {
    let mut encoded = vec![0.0; levels.len() * FEATURES];
    for (level, features) in levels.iter().zip(encoded.chunks_exact_mut(FEATURES)) {
        for corner in level.corners(position) {
            for (f, feature) in features.iter_mut().enumerate() {
                *feature += corner.weight * table[corner.entry * FEATURES + f];
            }
        }
    }
    encoded
}

/// Adds a position's part of ∂loss/∂table, `d_table += weight · d_encoded` at each of its vertices.
///
/// `d_encoded` is `[levels · 2]`, `d_table` is `[entries, 2]`.
pub fn grid_encode_backward(levels: &[GridLevel], position: DVec3, d_encoded: &[f64], d_table: &mut [f64]) {
    for (level, d_features) in levels.iter().zip(d_encoded.chunks_exact(FEATURES)) {
        for corner in level.corners(position) {
            for (f, d_feature) in d_features.iter().enumerate() {
                d_table[corner.entry * FEATURES + f] += corner.weight * d_feature;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_by_hand() {
        let levels = levels(2, 8, 3, 64);
        let expected = [(2, 0, 28, true), (4, 28, 64, false), (8, 92, 64, false)];
        for (level, (resolution, offset, entries, dense)) in levels.iter().zip(expected) {
            let hand = GridLevel { resolution, offset, entries, dense };
            assert_eq!(*level, hand);
        }
        assert_eq!(table_entries(&levels), 156);
        assert_eq!(super::levels(16, 512, 1, 1 << 15)[0].resolution, 16);
        assert!(super::levels(16, 512, 0, 1 << 15).is_empty());
    }

    #[test]
    fn hash_wraps_and_collides() {
        let level = levels(64, 64, 1, 1 << 12)[0];
        let hash = 3 ^ 5_u32.wrapping_mul(2_654_435_761) ^ 7_u32.wrapping_mul(805_459_861);
        assert_eq!(level.index([3, 5, 7]), (hash % 4096) as usize);
        let mut seen = vec![0_u32; level.entries];
        for i in 0..65 * 65 * 65_u32 {
            seen[level.index([i % 65, i / 65 % 65, i / 4225])] += 1;
        }
        assert!(seen.iter().any(|&n| n > 1));
    }

    /// A table that holds a linear function of the vertex position reproduces it anywhere in the box.
    #[test]
    fn linear_functions_are_interpolated_exactly() {
        let levels = levels(3, 3, 1, 64);
        let mut table = vec![0.0; levels[0].entries * FEATURES];
        let linear = |p: DVec3| 1.0 + 2.0 * p.x - 3.0 * p.y + 5.0 * p.z;
        for i in 0..64_u32 {
            let vertex = [i % 4, i / 4 % 4, i / 16];
            let position = DVec3::from_array(vertex.map(|v| f64::from(v) / 3.0));
            table[levels[0].index(vertex) * FEATURES] = linear(position);
        }
        for position in [DVec3::ZERO, DVec3::ONE, DVec3::new(0.3, 0.77, 0.999)] {
            let encoded = grid_encode(&levels, &table, position);
            assert!((encoded[0] - linear(position)).abs() < 1e-12);
            assert_eq!(encoded[1], 0.0);
        }
        let outside = grid_encode(&levels, &table, DVec3::new(-4.0, 2.0, 1e30));
        assert!((outside[0] - linear(DVec3::new(0.0, 1.0, 1.0))).abs() < 1e-12);
    }
}
