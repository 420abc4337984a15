//! Photos small enough to be compared at many places.

use crate::camera::Camera;
use crate::photo::{Photo, Pixels};
use glam::DVec2;

/// Longer side, in pixels.
const SIDE: u32 = 128;
/// Pixels of the photo that a small one is the mean of, along either side.
const MOST_SAMPLES: u32 = 4;
/// What is more transparent shows what is behind.
const OPAQUE: f32 = 0.9;

/// A small version of a photo.
#[derive(Clone, Debug)]
pub(super) struct SmallPhoto {
    /// At its size.
    pub(super) camera: Camera,
    /// Mean of red, green and blue, display-referred within `[0, 1]`; not a number where a mask ignores it or it is
    /// transparent.
    values: Vec<f32>,
}

impl SmallPhoto {
    pub(super) fn of(camera: &Camera, photo: &Photo) -> Self {
        let size = photo.image.size();
        let by = (f64::from(SIDE) / f64::from(size[0].max(size[1]))).min(1.0);
        let [width, height] = size.map(|side| ((f64::from(side) * by).round() as u32).max(1));
        let samples = size[0].max(size[1]).div_ceil(SIDE).min(MOST_SAMPLES);
        let value = |index: u32| {
            let corner = [index % width, index / width].map(|at| at * samples);
            let offsets = (0..samples * samples).map(|sample| [sample % samples, sample / samples]);
            let sum: f32 = offsets
                .map(|[x, y]| {
                    let at = |axis: usize, at: u32, small: u32| {
                        let middle = (f64::from(at) + 0.5) / f64::from(small * samples);
                        (middle * f64::from(size[axis])) as usize
                    };
                    let [x, y] = [at(0, corner[0] + x, width), at(1, corner[1] + y, height)];
                    value(photo, y * size[0] as usize + x)
                })
                .sum();
            sum / (samples * samples) as f32
        };
        let mut values: Vec<f32> = (0..width * height).map(value).collect();
        if photo.image.is_hdr() {
            tone(&mut values);
        }
        Self { camera: camera.resized(width, height), values }
    }

    /// Between pixels; not a number where that is not known.
    pub(super) fn at(&self, place: DVec2) -> f64 {
        let [width, height] = [self.camera.width, self.camera.height].map(|side| side as usize);
        let corner = (place - 0.5).floor();
        let part = place - 0.5 - corner;
        let last = DVec2::new(width as f64, height as f64) - 2.0;
        if !(corner.cmpge(DVec2::ZERO).all() && corner.cmple(last).all()) {
            return f64::NAN;
        }
        let first = corner.y as usize * width + corner.x as usize;
        let row = |first: usize| {
            let [a, b] = [self.values[first], self.values[first + 1]].map(f64::from);
            a + part.x * (b - a)
        };
        let [a, b] = [row(first), row(first + width)];
        a + part.y * (b - a)
    }
}

/// The mean of the colours of a pixel: display-referred, or linear light. Not a number where there is nothing to see.
fn value(photo: &Photo, index: usize) -> f32 {
    let of = |[red, green, blue, alpha]: [f32; 4]| {
        if alpha < OPAQUE { f32::NAN } else { (red + green + blue) / 3.0 }
    };
    match &photo.image.pixels {
        _ if photo.ignored.get(index).copied().unwrap_or(false) => f32::NAN,
        Pixels::Srgb8(pixels) => of(pixels[index].map(|value| f32::from(value) / 255.0)),
        Pixels::Srgb16(pixels) => of(pixels[index].map(|value| f32::from(value) / 65_535.0)),
        Pixels::Linear(pixels) => of(pixels[index]),
    }
}

/// Linear light as display-referred values; the mean becomes 0.5.
fn tone(values: &mut [f32]) {
    let known = || values.iter().filter(|value| value.is_finite());
    let mean = known().sum::<f32>() / known().count().max(1) as f32;
    values
        .iter_mut()
        .for_each(|value| *value = value.max(0.0) / (value.max(0.0) + mean.max(f32::MIN_POSITIVE)));
}
