//! Rays that are hard on arithmetic, with what the f64 reference makes of them.

use nerf::config::Transmittance;
use nerf::verify::check::inputs::Random;
use nerf::verify::check::stress_rays::StressRay;
use nerf::verify::reference::vectors::GoldenFile;

/// Rays of each kind.
const RAYS: u32 = 16;
/// Largest colour of a ray in display-referred and in linear light.
const HDR: f64 = 1e4;

/// A kind of rays.
struct Family {
    name: &'static str,
    samples: usize,
    /// Decimal logarithms of the least and the largest optical depth of a sample.
    depths: (f64, f64),
    /// Those of the last eighth of the samples, if they differ.
    wall: Option<(f64, f64)>,
    /// Largest colour.
    brightest: f64,
}

const FAMILIES: [Family; 7] = [
    Family { name: "ordinary", samples: 48, depths: (-2.0, -0.3), wall: None, brightest: 1.0 },
    Family { name: "nearly transparent", samples: 512, depths: (-9.0, -7.0), wall: None, brightest: 1.0 },
    Family {
        name: "moderately stiff everywhere",
        samples: 128,
        depths: (0.0, 1.7),
        wall: None,
        brightest: 1.0,
    },
    Family {
        name: "stiff wall behind fog",
        samples: 64,
        depths: (-3.0, -1.5),
        wall: Some((2.0, 6.0)),
        brightest: 1.0,
    },
    Family {
        name: "twelve decades of optical depth",
        samples: 80,
        depths: (-8.0, 4.0),
        wall: None,
        brightest: 1.0,
    },
    Family { name: "high dynamic range", samples: 64, depths: (-2.0, 0.0), wall: None, brightest: HDR },
    Family {
        name: "density beyond f32 behind thin samples",
        samples: 16,
        depths: (-4.0, -2.0),
        wall: Some((39.0, 45.0)),
        brightest: 1.0,
    },
];

/// Rays of every family; the same in every run, of numbers that f32 holds exactly.
pub(crate) fn golden(convention: Transmittance) -> GoldenFile {
    let mut random = Random::new(7);
    let rays_in_batch = RAYS * FAMILIES.len() as u32;
    let each = FAMILIES.iter().flat_map(|family| (0..RAYS).map(move |_| family));
    let rays: Vec<_> = each.map(|family| family.ray(&mut random)).collect();
    StressRay::golden(convention, rays_in_batch, &rays)
}

impl Family {
    fn ray(&self, random: &mut Random) -> StressRay {
        let delta: Vec<f64> = (0..self.samples).map(|_| random.number(0.001, 0.1)).collect();
        let s: Vec<f64> = (delta.iter().enumerate())
            .map(|(i, delta)| {
                let is_wall = i >= self.samples - self.samples / 8;
                let (least, most) = self.wall.filter(|_| is_wall).unwrap_or(self.depths);
                let depth = random.number(least, most);
                f64::from((depth * std::f64::consts::LN_10 - delta.ln()) as f32)
            })
            .collect();
        let high = self.brightest;
        StressRay {
            name: self.name.to_owned(),
            s,
            delta,
            color: (0..self.samples).map(|_| random.vector(0.0, high).to_array()).collect(),
            target: random.vector(0.0, high).extend(random.number(0.0, 1.0)).to_array(),
            background: random.vector(0.0, high).to_array(),
        }
    }
}
