//! The part of an image that is used, and its size.

use crate::capture::image_file::Window;
use crate::photo::{Crop, Reading};
use crate::support::remedy::{Advised, Remedy};
use anyhow::{Result, bail, ensure};

impl Reading {
    /// The part of an image of `size` that is used, and the size in pixels that it is reduced to: the nearest
    /// whole numbers to width and height over `downscale`, at least 1.
    pub(crate) fn part(&self, size: [u32; 2]) -> Result<(Window, [u32; 2])> {
        let Crop { left, top, right, bottom } = self.crop;
        let rest =
            |all: u32, cut: [u32; 2]| all.checked_sub(cut[0].checked_add(cut[1])?).filter(|&rest| rest > 0);
        let rest = rest(size[0], [left, right]).zip(rest(size[1], [top, bottom]));
        ensure!(
            rest.is_some() && self.downscale > 0,
            "the crop {} leaves nothing of {}x{} pixels at 1/{}; crop less",
            self.crop,
            size[0],
            size[1],
            self.downscale
        );
        let kept = rest.map_or(size, |(width, height)| [width, height]);
        if kept.iter().any(|&side| side < self.downscale) {
            let [width, height] = kept;
            let left = format!(" leaves less than a pixel of {width}x{height}; divide by less");
            bail!(Advised::new("", Remedy::Downscale(self.downscale), left));
        }
        let reduced = |side: u32| {
            let nearest = (u64::from(side) + u64::from(self.downscale) / 2) / u64::from(self.downscale);
            nearest.max(1) as u32
        };
        Ok((Window { corner: [left, top], size: kept }, kept.map(reduced)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_cropped_before_they_are_reduced() {
        let crop = Crop { left: 1, top: 2, right: 3, bottom: 0 };
        let reading = Reading { downscale: 3, crop, ..Reading::default() };
        let (window, size) = reading.part([14, 13]).expect("something is left");
        assert_eq!(window, Window { corner: [1, 2], size: [10, 11] });
        assert_eq!(size, [3, 4]);
        assert_eq!(reading.part([7, 6]).expect("a pixel").1, [1, 1]);
        assert!(
            reading.part([7, 4]).expect_err("too little").to_string().contains("less than a pixel of 3x2")
        );
        let message = reading.part([4, 13]).expect_err("nothing left").to_string();
        assert!(message.contains("1,2,3,0 leaves nothing of 4x13"), "{message}");
        let (window, size) = Reading::default().part([7, 9]).expect("everything");
        assert_eq!((window.corner, window.size, size), ([0, 0], [7, 9], [7, 9]));
    }
}
