//! How photos are read, on the command line.

use super::one_of::OneOf;
use clap::Args;
use nerf::photo::{AlphaMode, Crop, Reading};

/// How photos are read; a flag that is left out changes nothing.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "How photos are read")]
pub(crate) struct PhotoFlags {
    /// What colours are multiplied with in photos with transparency [default: auto]
    #[arg(long, value_parser = alphas())]
    alpha: Option<AlphaMode>,
    /// Divide width and height by N, after --crop [default: 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    downscale: Option<u32>,
    /// Cut N pixels off every side, or L,T,R,B off the left, top, right and bottom [default: 0]
    #[arg(long, value_name = "N|L,T,R,B", value_parser = crop)]
    crop: Option<Crop>,
    /// Train on at most N frames, evenly spaced [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    max_images: Option<u32>,
    /// Masks mean the opposite: white pixels are ignored
    #[arg(
        long, value_name = "BOOL", num_args = 0..=1, require_equals = true, default_missing_value = "true"
    )]
    invert_masks: Option<bool>,
}

fn alphas() -> OneOf<AlphaMode> {
    OneOf::named([
        (AlphaMode::Auto, "As the pixels of 8 and 16 bit files show; linear files are premultiplied"),
        (AlphaMode::Straight, "Nothing"),
        (AlphaMode::Premultiplied, "Alpha"),
    ])
}

impl PhotoFlags {
    /// `settings`, changed as the command line says.
    pub(crate) fn over(&self, settings: Reading) -> Reading {
        Reading {
            alpha: self.alpha.unwrap_or(settings.alpha),
            downscale: self.downscale.unwrap_or(settings.downscale),
            crop: self.crop.unwrap_or(settings.crop),
            max_images: self.max_images.map(|most| most as usize).or(settings.max_images),
            invert_masks: self.invert_masks.unwrap_or(settings.invert_masks),
        }
    }
}

fn crop(text: &str) -> Result<Crop, String> {
    let sides: Option<Vec<u32>> = text.split(',').map(|side| side.trim().parse().ok()).collect();
    match sides.as_deref() {
        Some(&[all]) => Ok(Crop { left: all, top: all, right: all, bottom: all }),
        Some(&[left, top, right, bottom]) => Ok(Crop { left, top, right, bottom }),
        _ => {
            Err("expected a number of pixels, or four like 0,0,0,120 for left, top, right and bottom"
                .to_owned())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crops_are_one_number_or_four() {
        assert_eq!(crop("15"), Ok(Crop { left: 15, top: 15, right: 15, bottom: 15 }));
        assert_eq!(crop("1,2, 3,4"), Ok(Crop { left: 1, top: 2, right: 3, bottom: 4 }));
        assert!(crop("1,2").is_err() && crop("-1").is_err() && crop("").is_err());
    }

    #[test]
    fn what_is_not_said_stays() {
        let settings = Reading { downscale: 4, invert_masks: true, ..Reading::default() };
        assert_eq!(PhotoFlags::default().over(settings.clone()), settings);
        let said = PhotoFlags { downscale: Some(2), invert_masks: Some(false), ..PhotoFlags::default() };
        assert_eq!(said.over(settings), Reading { downscale: 2, ..Reading::default() });
    }
}
