//! What a photo shows to be empty, at a resolution that carving needs.

use crate::photo::Photo;
use crate::photo::Pixels;
use glam::DVec2;

/// Most blocks along a side: enough for cells, and little memory for a thousand photos.
const MOST_BLOCKS: u32 = 512;

/// Where a photo may show something, in blocks of pixels. Opaque photos have no silhouette.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Silhouette {
    /// Pixels along a side of a block.
    side: u32,
    /// Blocks per row.
    width: usize,
    /// Number of blocks that may show something in the rectangle from the corner to here,
    /// `(width + 1) × (height + 1)`; empty for an opaque photo.
    sums: Vec<u32>,
}

impl Silhouette {
    /// The silhouette of a photo: ignored pixels may show anything.
    #[must_use]
    pub fn of(photo: &Photo) -> Self {
        if !photo.image.has_alpha {
            return Self::default();
        }
        let (columns, rows) = (photo.image.width, photo.image.height);
        let side = columns.max(rows).div_ceil(MOST_BLOCKS).max(1);
        let (width, height) = (columns.div_ceil(side) as usize, rows.div_ceil(side) as usize);
        let mut blocks = vec![false; width * height];
        for (index, shows) in shows_something(photo).enumerate() {
            let (x, y) = (index as u32 % columns, index as u32 / columns);
            blocks[(y / side) as usize * width + (x / side) as usize] |= shows;
        }
        let mut sums = vec![0; (width + 1) * (height + 1)];
        for y in 0..height {
            let mut row = 0;
            for x in 0..width {
                row += u32::from(blocks[y * width + x]);
                sums[(y + 1) * (width + 1) + x + 1] = sums[y * (width + 1) + x + 1] + row;
            }
        }
        Self { side, width, sums }
    }

    /// Whether the photo is opaque everywhere, as far as its file can tell.
    #[must_use]
    pub fn is_opaque(&self) -> bool {
        self.sums.is_empty()
    }

    /// Whether everything in a rectangle is transparent; pixel positions within the photo.
    #[must_use]
    pub fn is_empty_within(&self, low: DVec2, high: DVec2) -> bool {
        if self.is_opaque() {
            return false;
        }
        let side = f64::from(self.side);
        let (low, high) = ((low / side).floor(), (high / side).ceil());
        let stride = self.width + 1;
        let height = self.sums.len() / stride - 1;
        let at = |x: f64, y: f64| self.sums[(y as usize).min(height) * stride + (x as usize).min(self.width)];
        at(high.x, high.y) + at(low.x, low.y) == at(low.x, high.y) + at(high.x, low.y)
    }
}

fn shows_something(photo: &Photo) -> impl Iterator<Item = bool> + '_ {
    let is_seen = |index: usize| match &photo.image.pixels {
        Pixels::Srgb8(pixels) => pixels[index][3] > 0,
        Pixels::Srgb16(pixels) => pixels[index][3] > 0,
        Pixels::Linear(pixels) => pixels[index][3] > 0.0,
    };
    let count = photo.image.width as usize * photo.image.height as usize;
    (0..count).map(move |index| is_seen(index) || photo.ignored.get(index).copied().unwrap_or(false))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photo::Image;

    /// A photo with one opaque pixel.
    fn dot(width: u32, height: u32, x: u32, y: u32) -> Photo {
        let mut pixels = vec![[0; 4]; (width * height) as usize];
        pixels[(y * width + x) as usize] = [9, 9, 9, 1];
        Image { width, height, pixels: Pixels::Srgb8(pixels), has_alpha: true }.into()
    }

    #[test]
    fn a_dot_is_found_and_nothing_else() {
        for (width, height, x, y) in [(7, 5, 3, 2), (1025, 3, 1024, 0), (600, 1300, 0, 1299)] {
            let silhouette = Silhouette::of(&dot(width, height, x, y));
            let (x, y) = (f64::from(x), f64::from(y));
            let whole = DVec2::new(f64::from(width), f64::from(height));
            assert!(!silhouette.is_empty_within(DVec2::ZERO, whole));
            assert!(!silhouette.is_empty_within(DVec2::new(x + 0.2, y + 0.2), DVec2::new(x + 0.8, y + 0.8)));
            let far = DVec2::new(
                if x > 4.0 { 0.0 } else { whole.x - 1.0 },
                if y > 4.0 { 0.0 } else { whole.y - 1.0 },
            );
            assert!(silhouette.is_empty_within(far, far + 0.5));
        }
    }

    #[test]
    fn ignored_pixels_may_show_anything() {
        let mut photo = dot(4, 4, 0, 0);
        let corner = (DVec2::splat(3.1), DVec2::splat(3.9));
        assert!(Silhouette::of(&photo).is_empty_within(corner.0, corner.1));
        photo.ignored = (0..16).map(|index| index == 15).collect();
        assert!(!Silhouette::of(&photo).is_empty_within(corner.0, corner.1));
        photo.image.has_alpha = false;
        assert!(Silhouette::of(&photo).is_opaque());
    }
}
