//! What `nerf generate` takes.

use super::size;
use clap::{Args, ValueEnum};
use nerf::camera::LensKind;
use std::path::PathBuf;

/// `nerf generate`
#[derive(Args, Debug)]
pub(crate) struct Generate {
    /// Name of the scene; see --list
    #[arg(required_unless_present = "list")]
    pub(crate) scene: Option<String>,
    /// New or empty folder to write the dataset to
    #[arg(long, value_name = "DIR", required_unless_present = "list")]
    pub(crate) out: Option<PathBuf>,
    /// List the scenes
    #[arg(long)]
    pub(crate) list: bool,
    /// Views in all splits
    #[arg(long, value_name = "N", default_value = "100")]
    pub(crate) views: usize,
    /// Size of the images in pixels, WxH or N for NxN
    #[arg(long, value_name = "WxH", default_value = "200", value_parser = size)]
    pub(crate) size: (u32, u32),
    /// Scene-linear OpenEXR images instead of PNG
    #[arg(long)]
    pub(crate) hdr: bool,
    /// Lens of the cameras; without a name, OpenCV's distortion
    #[arg(long, value_name = "LENS", num_args = 0..=1, default_value = "pinhole", default_missing_value = "opencv")]
    pub(crate) lens: LensChoice,
    /// Sub-rays per pixel along each axis
    #[arg(long, value_name = "N", default_value = "4")]
    pub(crate) samples: u32,
    /// Varies where the cameras are
    #[arg(long, value_name = "K", default_value = "0")]
    pub(crate) seed: u64,
}

/// The lens of generated cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum LensChoice {
    /// No distortion
    Pinhole,
    /// Radial and tangential distortion
    Opencv,
    /// OpenCV's fisheye, 180 degrees across the diagonal
    Fisheye,
    /// Parallel rays
    Orthographic,
    /// The whole sphere, for images twice as wide as high
    Equirectangular,
    /// All of them in turn
    Mixed,
}

impl LensChoice {
    /// The lenses, to be taken in turn.
    pub(crate) fn kinds(self) -> Vec<LensKind> {
        match self {
            Self::Pinhole => vec![LensKind::Pinhole],
            Self::Opencv => vec![LensKind::OpenCv],
            Self::Fisheye => vec![LensKind::Fisheye],
            Self::Orthographic => vec![LensKind::Orthographic],
            Self::Equirectangular => vec![LensKind::Equirectangular],
            Self::Mixed => LensKind::ALL.to_vec(),
        }
    }
}
