//! Rearranging the values of pixels: turning, cutting, and picking the nearest.

use crate::photo::{Image, Pixels};

/// A turn of a picture that swaps its width and its height.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// By a quarter, clockwise.
    Right,
    /// By a quarter, counterclockwise.
    Left,
    /// Mirrored at the diagonal from the top left.
    Transpose,
    /// Mirrored at the diagonal from the top right.
    Transverse,
}

/// A rectangle of pixels in a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Left and top, in pixels from the picture's corner.
    pub corner: [u32; 2],
    /// Width and height in pixels.
    pub size: [u32; 2],
}

impl Turn {
    /// Width and height afterwards.
    #[must_use]
    pub fn size(self, [width, height]: [u32; 2]) -> [u32; 2] {
        [height, width]
    }

    /// The turned values of a picture of `size`, row by row.
    pub(crate) fn apply<T: Copy>(self, values: &[T], size: [u32; 2]) -> Vec<T> {
        let [width, height] = size.map(|side| side as usize);
        let source = |x: usize, y: usize| match self {
            Self::Right => (y, height - 1 - x),
            Self::Left => (width - 1 - y, x),
            Self::Transpose => (y, x),
            Self::Transverse => (width - 1 - y, height - 1 - x),
        };
        let places = (0..width).flat_map(|y| (0..height).map(move |x| (x, y)));
        places.map(|(x, y)| source(x, y)).map(|(x, y)| values[y * width + x]).collect()
    }
}

/// The values inside `window` of a picture of `size`.
pub(crate) fn crop<T: Copy>(values: &[T], size: [u32; 2], window: Window) -> Vec<T> {
    if size == window.size {
        return values.to_vec();
    }
    let [left, top] = window.corner.map(|side| side as usize);
    let [width, height] = window.size.map(|side| side as usize);
    let rows = values.chunks_exact(size[0] as usize).skip(top).take(height);
    rows.flat_map(|row| &row[left..left + width]).copied().collect()
}

/// The values of a picture of size `from` at size `to`: at each pixel's centre, those of the pixel there.
pub(crate) fn nearest<T: Copy>(values: &[T], from: [u32; 2], to: [u32; 2]) -> Vec<T> {
    if from == to {
        return values.to_vec();
    }
    let places = |axis: usize| -> Vec<usize> {
        let (from, to) = (u64::from(from[axis]), u64::from(to[axis]));
        (0..to).map(|i| ((2 * i + 1) * from / (2 * to)) as usize).collect()
    };
    let (columns, rows) = (places(0), places(1));
    let width = from[0] as usize;
    rows.iter().flat_map(|row| columns.iter().map(move |column| values[row * width + column])).collect()
}

impl Image {
    /// The picture turned as [`Turn`] says.
    pub(crate) fn turned(self, turn: Turn) -> Self {
        let size = self.size();
        let [width, height] = turn.size(size);
        let pixels = match self.pixels {
            Pixels::Srgb8(pixels) => Pixels::Srgb8(turn.apply(&pixels, size)),
            Pixels::Srgb16(pixels) => Pixels::Srgb16(turn.apply(&pixels, size)),
            Pixels::Linear(pixels) => Pixels::Linear(turn.apply(&pixels, size)),
        };
        Self { width, height, pixels, ..self }
    }

    /// The part of the picture inside `window`, which lies within it.
    pub(crate) fn cropped(self, window: Window) -> Self {
        let own = self.size();
        if own == window.size {
            return self;
        }
        let pixels = match self.pixels {
            Pixels::Srgb8(pixels) => Pixels::Srgb8(crop(&pixels, own, window)),
            Pixels::Srgb16(pixels) => Pixels::Srgb16(crop(&pixels, own, window)),
            Pixels::Linear(pixels) => Pixels::Linear(crop(&pixels, own, window)),
        };
        let [width, height] = window.size;
        Self { width, height, pixels, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::image::metadata::Orientation;
    use ::image::{DynamicImage, GrayImage};

    #[test]
    fn turns_are_those_of_viewers() {
        let values: Vec<u8> = (0..6).collect();
        let picture = GrayImage::from_raw(3, 2, values.clone()).expect("3x2");
        let mut turns = 0;
        for exif in 1..=8 {
            let orientation = Orientation::from_exif(exif).expect("1 to 8");
            let mut upright = DynamicImage::ImageLuma8(picture.clone());
            upright.apply_orientation(orientation);
            let swaps = upright.width() == 2;
            assert_eq!(Turn::of(orientation).is_some(), swaps, "{orientation:?}");
            if let Some(turn) = Turn::of(orientation) {
                turns += 1;
                assert_eq!(turn.size([3, 2]), [2, 3]);
                assert_eq!(turn.apply(&values, [3, 2]), upright.into_luma8().into_raw(), "{turn:?}");
            }
        }
        assert_eq!(turns, 4);
    }

    #[test]
    fn windows_and_nearest_pixels() {
        let values: Vec<u32> = (0..12).collect();
        let window = Window { corner: [1, 1], size: [2, 2] };
        assert_eq!(crop(&values, [4, 3], window), [5, 6, 9, 10]);
        assert_eq!(crop(&values, [4, 3], Window { corner: [0, 0], size: [4, 3] }), values);
        assert_eq!(nearest(&values, [4, 3], [2, 1]), [5, 7]);
        assert_eq!(nearest(&[1, 2], [2, 1], [4, 2]), [1, 1, 2, 2, 1, 1, 2, 2]);
        assert_eq!(nearest(&values, [4, 3], [4, 3]), values);
    }
}
