//! Closed-form textures: a surface point in, a linear colour out.

use crate::photo::color_space::linear_from_srgb;
use glam::{DVec2, DVec3};

/// How far below the surface textures are read, so that faces lying on a cell border have one colour.
const INSET: f64 = 1e-4;

/// The colour of a surface, a function of the point in the object's local space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Texture {
    /// One colour.
    Plain(DVec3),
    /// Cubes of alternating colour.
    Checker {
        /// The two colours.
        colors: [DVec3; 2],
        /// Edge of a cube.
        size: f64,
    },
    /// Layers of alternating colour across a direction.
    Stripes {
        /// The two colours.
        colors: [DVec3; 2],
        /// Unit vector across the layers.
        across: DVec3,
        /// Thickness of a layer.
        width: f64,
    },
    /// Sectors about z of alternating colour.
    Sectors {
        /// The two colours.
        colors: [DVec3; 2],
        /// Number of sectors, even.
        count: f64,
    },
    /// A wavy mixture of two colours.
    Marble {
        /// The two colours.
        colors: [DVec3; 2],
        /// Spatial frequency, radians per unit.
        frequency: f64,
    },
    /// Bricks whose colours vary between two, with joints.
    Bricks {
        /// The ends of the range of colours.
        colors: [DVec3; 2],
        /// Colour of the joints.
        joint: DVec3,
        /// Width and height of a brick.
        size: DVec2,
        /// How far a course is shifted against the one below, in bricks.
        shift: f64,
    },
    /// A sky: a gradient over the elevation, brighter towards the sun.
    Sky {
        /// Colours at the horizon and in the zenith.
        colors: [DVec3; 2],
        /// Unit vector towards the sun.
        sun: DVec3,
    },
}

impl Texture {
    /// The linear colour at `point` on a surface with the given outer unit normal, both in local space.
    pub(super) fn color(&self, point: DVec3, normal: DVec3) -> DVec3 {
        let p = point - INSET * normal;
        let pick = |colors: [DVec3; 2], cell: f64| colors[usize::from(cell.rem_euclid(2.0) >= 1.0)];
        match *self {
            Self::Plain(color) => color,
            Self::Checker { colors, size } => pick(colors, (p / size).floor().element_sum()),
            Self::Stripes { colors, across, width } => pick(colors, p.dot(across) / width),
            Self::Sectors { colors, count } => pick(colors, p.y.atan2(p.x) / std::f64::consts::TAU * count),
            Self::Marble { colors, frequency } => {
                let q = frequency * p;
                let wave = q.x + 0.6 * q.y + 1.7 * (0.7 * q.z + 1.3 * (0.4 * q.x - 0.5 * q.y).sin()).sin();
                colors[0].lerp(colors[1], 0.5 + 0.5 * wave.sin())
            }
            Self::Bricks { colors, joint, size, shift } => {
                bricks(p, normal, size, shift).map_or(joint, |shade| colors[0].lerp(colors[1], shade))
            }
            Self::Sky { colors, sun } => {
                let up = point.normalize_or(DVec3::Z);
                let base = colors[0].lerp(colors[1], up.z.max(0.0).sqrt());
                let glow = up.dot(sun).max(0.0);
                base + DVec3::new(1.0, 0.9, 0.7) * (0.35 * glow.powi(12) + 4.0 * glow.powi(400))
            }
        }
    }
}

/// The shade in `[0, 1]` of the brick at `p`, or `None` on a joint. Courses run along the first and are
/// stacked along the second of the axes that span the face.
fn bricks(p: DVec3, normal: DVec3, size: DVec2, shift: f64) -> Option<f64> {
    let n = normal.abs();
    let face = if n.z >= n.x.max(n.y) {
        DVec2::new(p.x, p.y)
    } else if n.x >= n.y {
        DVec2::new(p.y, p.z)
    } else {
        DVec2::new(p.x, p.z)
    };
    let course = (face.y / size.y).floor();
    let along = face.x / size.x + shift * course;
    let joint = 0.06 * size.min_element();
    let within = DVec2::new((along - along.floor()) * size.x, face.y - course * size.y);
    let in_joint = within.x < joint || within.y < joint;
    (!in_joint).then(|| shade(along.floor() as i64, course as i64))
}

/// A fixed pseudo-random number in `[0, 1)` for a cell.
fn shade(x: i64, y: i64) -> f64 {
    let mut h = (x.cast_unsigned().wrapping_mul(0x9E37_79B9_7F4A_7C15))
        ^ (y.cast_unsigned().wrapping_mul(0xC2B2_AE3D_27D4_EB4F));
    h = (h ^ (h >> 31)).wrapping_mul(0xD6E8_FEB8_6659_FD93);
    h ^= h >> 32;
    (h >> 11) as f64 / (1_u64 << 53) as f64
}

/// The linear colour of `0xRRGGBB`.
pub(super) fn paint(hex: u32) -> DVec3 {
    let channel = |shift: u32| f64::from(linear_from_srgb(((hex >> shift) & 0xFF) as f32 / 255.0));
    DVec3::new(channel(16), channel(8), channel(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLORS: [DVec3; 2] = [DVec3::X, DVec3::Y];

    #[test]
    fn checker_alternates_and_is_steady_on_faces() {
        let checker = Texture::Checker { colors: COLORS, size: 0.5 };
        // The face z = 0.5 lies on a border of cells; it reads the cell below.
        for jitter in [-1e-12, 0.0, 1e-12] {
            let at = |x: f64| checker.color(DVec3::new(x, 0.1, 0.5 + jitter), DVec3::Z);
            assert_eq!([at(0.1), at(0.6), at(-0.1)], [COLORS[0], COLORS[1], COLORS[1]]);
        }
    }

    #[test]
    fn stripes_and_sectors_alternate() {
        let stripes = Texture::Stripes { colors: COLORS, across: DVec3::Z, width: 0.2 };
        let at = |z: f64| stripes.color(DVec3::new(1.0, 0.0, z), DVec3::X);
        assert_eq!([at(0.1), at(0.3), at(-0.1)], [COLORS[0], COLORS[1], COLORS[1]]);
        let sectors = Texture::Sectors { colors: COLORS, count: 4.0 };
        let at = |x: f64, y: f64| sectors.color(DVec3::new(x, y, 0.0), DVec3::Z);
        assert_eq!([at(1.0, 1.0), at(-1.0, 1.0), at(-1.0, -1.0)], [COLORS[0], COLORS[1], COLORS[0]]);
    }

    #[test]
    fn bricks_have_joints_and_shades() {
        let size = DVec2::new(0.4, 0.2);
        assert_eq!(bricks(DVec3::new(0.2, 0.0, 0.001), DVec3::Y, size, 0.5), None);
        let shades: Vec<f64> = (0..100)
            .filter_map(|i| bricks(DVec3::new(0.2 + 0.4 * i as f64, 0.0, 0.1), DVec3::Y, size, 0.5))
            .collect();
        assert_eq!(shades.len(), 100);
        let mean = shades.iter().sum::<f64>() / 100.0;
        assert!(shades.iter().all(|s| (0.0..1.0).contains(s)) && (mean - 0.5).abs() < 0.15, "{mean}");
    }

    #[test]
    fn paint_decodes_srgb() {
        assert_eq!(paint(0x00FF_FFFF), DVec3::ONE);
        assert!((paint(0x0080_0000).x - 0.215_86).abs() < 1e-4);
    }
}
