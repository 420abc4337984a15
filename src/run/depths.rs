//! How far away lies what rendered test views show, and whether it hangs right before the cameras.
//!
//! Distances are relative: 1 is the distance from the camera to the scene's focus
//! ([`Dataset::focus`](crate::capture::dataset::Dataset::focus)). Depth is compared with it as the lens defines it
//! ([`LensKind::depth_is_distance`](crate::camera::LensKind::depth_is_distance)).

pub use super::onlookers::Onlookers;
use crate::camera::Camera;
use crate::capture::focus::median;
use crate::field::renderer::View;
use crate::support::format::percent;
use glam::DVec2;
use std::iter::Sum;

/// Surfaces below this relative distance are near, if few cameras have them in their picture: where many do, something
/// is there, as a table that cameras look down on, whose axes cross below it.
pub const NEAR: f64 = 0.5;
/// Share of near pixels above which a field is likely to be fog.
pub const FOG: f64 = 0.05;

/// The distribution has so many bins while the distance doubles, …
const BINS_PER_OCTAVE: i32 = 8;
/// … for so many doublings up to the relative distance 1, and as many beyond it.
const OCTAVES: i32 = 5;
const BINS: usize = (2 * OCTAVES * BINS_PER_OCTAVE) as usize;

/// Relative distances of the pixels of some views.
#[derive(Clone, Debug, PartialEq)]
pub struct Depths {
    /// Pixels, those that show nothing included.
    pixels: u64,
    /// Pixels with a surface that is near and has few onlookers.
    near: u64,
    /// Sum of the opacities of the pixels in each bin; what lies beyond the outermost ones is in them.
    opacities: [f64; BINS],
}

/// A part of the opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bin {
    /// Relative distances from and to.
    pub distances: [f64; 2],
    /// Its share of the opacity of all pixels, in `[0, 1]`.
    pub share: f64,
}

impl Default for Depths {
    fn default() -> Self {
        Self { pixels: 0, near: 0, opacities: [0.0; BINS] }
    }
}

impl Depths {
    /// Those of a view of `camera`, without the pixels that are `ignored` (none where that is empty). A pixel's
    /// opacity counts at its mean depth.
    #[must_use]
    pub fn of(view: &View, camera: &Camera, ignored: &[bool], onlookers: &Onlookers) -> Self {
        let unit = onlookers.distance(camera);
        let is_alone = |pixel: usize, z: f32| {
            let [x, y] = [pixel % view.width as usize, pixel / view.width as usize];
            let place = camera.point(DVec2::new(x as f64 + 0.5, y as f64 + 0.5), f64::from(z));
            place.is_some_and(|place| onlookers.are_few(place))
        };
        let mut depths = Self::default();
        for (pixel, (&z, color)) in view.depth.iter().zip(&view.color).enumerate() {
            if ignored.get(pixel) == Some(&true) {
                continue;
            }
            depths.pixels += 1;
            if z > 0.0 {
                let distance = f64::from(z) / unit;
                depths.near += u64::from(distance < NEAR && is_alone(pixel, z));
                depths.opacities[bin(distance)] += f64::from(color[3]);
            }
        }
        depths
    }

    /// Part of the pixels that show a surface below the relative distance [`NEAR`] with few onlookers; `None` without
    /// pixels.
    #[must_use]
    pub fn near_share(&self) -> Option<f64> {
        (self.pixels > 0).then(|| self.near as f64 / self.pixels as f64)
    }

    /// The opacity by distance, from the nearest bin with some to the farthest.
    #[must_use]
    pub fn distribution(&self) -> Vec<Bin> {
        let all: f64 = self.opacities.iter().sum();
        let edge = |bin: usize| 2f64.powf(bin as f64 / f64::from(BINS_PER_OCTAVE) - f64::from(OCTAVES));
        let bins = self.opacities.iter().enumerate().map(|(number, opacity)| Bin {
            distances: [edge(number), edge(number + 1)],
            share: opacity / all,
        });
        let is_filled = |bin: &Bin| bin.share > 0.0;
        let mut bins: Vec<Bin> = bins.skip_while(|bin| !is_filled(bin)).collect();
        bins.truncate(bins.iter().rposition(is_filled).map_or(0, |last| last + 1));
        bins
    }
}

impl<'a> Sum<&'a Self> for Depths {
    fn sum<I: Iterator<Item = &'a Self>>(all: I) -> Self {
        all.fold(Self::default(), |mut sum, more| {
            sum.pixels += more.pixels;
            sum.near += more.near;
            sum.opacities.iter_mut().zip(&more.opacities).for_each(|(sum, more)| *sum += more);
            sum
        })
    }
}

/// The bin of a relative distance.
fn bin(distance: f64) -> usize {
    let place = (distance.log2() + f64::from(OCTAVES)) * f64::from(BINS_PER_OCTAVE);
    place.clamp(0.0, (BINS - 1) as f64) as usize
}

/// The median of the known depths (above 0), in their unit; 1 where none is.
#[must_use]
pub fn median_depth(depth: &[f32]) -> f64 {
    let median = median(depth.iter().filter(|z| **z > 0.0).map(|&z| f64::from(z)));
    if median.is_finite() { median } else { 1.0 }
}

/// The warning for a near share that looks like fog.
#[must_use]
pub fn fog(near_share: f64) -> Option<String> {
    (near_share > FOG).then(|| {
        format!(
            "surfaces seem to hang right in front of the cameras: {} of the pixels measured show something nearer \
             than half the way to what the cameras look at, which few other cameras have in their picture. Unless the \
             scene really has something there, the photos are painted onto fog near each lens, and other views show \
             that fog. Check the poses with `nerf info`; photos \
             from more directions and a longer training may help, and so may a larger march.near, the distance from \
             the camera within which nothing is sampled",
            percent(near_share)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Lens;
    use glam::{DAffine3, DVec3};

    /// A camera of so many pixels side by side that looks down -z from `back` behind the origin, straight through the
    /// middle of all of them.
    fn camera(width: usize, back: f64) -> Camera {
        Camera {
            width: width as u32,
            height: 1,
            focal_px: DVec2::splat(1e6),
            center_px: DVec2::new(width as f64 / 2.0, 0.5),
            lens: Lens::Pinhole,
            world_from_camera: DAffine3::from_translation(DVec3::new(0.0, 0.0, back)),
        }
    }

    /// The depths of a view from four units away from the focus, where all others look from the side.
    fn alone(view: &View, ignored: &[bool]) -> Depths {
        let sides = (0..9).map(|number| Camera {
            width: 100,
            height: 100,
            focal_px: DVec2::splat(100.0),
            center_px: DVec2::splat(50.0),
            world_from_camera: DAffine3::from_rotation_y(1.2 + 0.05 * f64::from(number))
                * DAffine3::from_translation(DVec3::new(0.0, 0.0, 4.0)),
            ..camera(100, 4.0)
        });
        let own = camera(view.width as usize, 4.0);
        let all: Vec<_> = sides.chain([own.clone()]).collect();
        Depths::of(view, &own, ignored, &Onlookers::around(DVec3::ZERO, &all))
    }

    /// Pixels of these depths and opacities.
    fn view(pixels: &[(f32, f32)]) -> View {
        View {
            width: pixels.len() as u32,
            height: 1,
            color: pixels.iter().map(|&(_, alpha)| [0.0, 0.0, 0.0, alpha]).collect(),
            depth: pixels.iter().map(|&(z, _)| z).collect(),
        }
    }

    #[test]
    fn surfaces_before_half_the_way_are_near() {
        let view = view(&[(1.9, 1.0), (2.0, 1.0), (4.0, 0.5), (0.0, 0.0), (0.1, 0.002)]);
        assert_eq!(alone(&view, &[]).near_share(), Some(0.4));
        let ignored = [true, false, false, false, true];
        assert_eq!(alone(&view, &ignored).near_share(), Some(0.0));
        assert_eq!(alone(&view, &[true; 5]).near_share(), None);
        let views = [alone(&view, &[]), alone(&view, &ignored)];
        assert_eq!(views.iter().sum::<Depths>().near_share(), Some(0.25), "of all pixels, not of all views");
    }

    #[test]
    fn what_many_see_is_not_near() {
        let view = view(&[(1.9, 1.0), (0.1, 1.0)]);
        let own = camera(2, 4.0);
        // All stand beside one another: each sees what is near to any.
        let crowd = vec![own.clone(); 7];
        let near = |cameras: &[Camera]| {
            Depths::of(&view, &own, &[], &Onlookers::around(DVec3::ZERO, cameras)).near_share()
        };
        assert_eq!(near(&crowd), Some(0.0));
    }

    #[test]
    fn opacity_is_found_at_its_distance() {
        let pixels = [(0.001, 1.0), (3.9, 0.5), (4.1, 0.25), (1e9, 1.25), (0.0, 0.9)];
        let bins = alone(&view(&pixels), &[]).distribution();
        let at = |distance: f64| {
            let is_there = |bin: &&Bin| bin.distances[0] <= distance && distance < bin.distances[1];
            bins.iter().find(is_there).expect("a bin").share
        };
        assert!((bins.iter().map(|bin| bin.share).sum::<f64>() - 1.0).abs() < 1e-12);
        assert_eq!([at(0.97), at(1.02), at(0.5), at(31.0)], [1.0 / 6.0, 1.0 / 12.0, 0.0, 1.25 / 3.0]);
        assert_eq!(
            (bins.len(), bins[0].distances[0]),
            (BINS, 1.0 / 32.0),
            "the outermost have what lies beyond"
        );
        assert!(bins.windows(2).all(|pair| pair[0].distances[1] == pair[1].distances[0]));
        let one = alone(&view(&[(1.0, 1.0)]), &[]).distribution();
        assert_eq!((one.len(), one[0].share), (1, 1.0));
        assert!(alone(&view(&[(0.0, 1.0)]), &[]).distribution().is_empty());
        for back in [0.0, f64::INFINITY, f64::NAN] {
            let own = camera(1, back);
            let onlookers = Onlookers::around(DVec3::ZERO, std::slice::from_ref(&own));
            let odd = Depths::of(&view(&[(1.0, 1.0)]), &own, &[], &onlookers).distribution();
            assert_eq!(odd.len(), 1, "{back}");
        }
    }

    #[test]
    fn medians_are_of_what_is_there() {
        assert_eq!(median_depth(&[0.0, 3.0, 0.0, 1.0, 2.0]), 2.0);
        assert_eq!([median_depth(&[]), median_depth(&[0.0])], [1.0, 1.0]);
    }

    #[test]
    fn much_that_is_near_is_fog() {
        assert_eq!((fog(0.0), fog(FOG)), (None, None));
        assert!(fog(0.123).is_some_and(|text| text.contains("12 %") && text.contains("march.near")));
    }
}
