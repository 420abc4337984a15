//! What `nerf generate` takes.

use super::one_of::OneOf;
use super::size;
use clap::Args;
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
    // Written with its path, a vector is one of the values, not an argument that may be repeated.
    /// Lens of the cameras; without a name, OpenCV's distortion
    #[arg(long, value_name = "LENS", num_args = 0..=1, default_value = "pinhole", default_missing_value = "opencv", value_parser = lenses())]
    pub(crate) lens: std::vec::Vec<LensKind>,
    /// Sub-rays per pixel along each axis
    #[arg(long, value_name = "N", default_value = "4")]
    pub(crate) samples: u32,
    /// Varies where the cameras are
    #[arg(long, value_name = "K", default_value = "0")]
    pub(crate) seed: u64,
}

/// Kinds of lenses that cameras have in turn.
fn lenses() -> OneOf<Vec<LensKind>> {
    let one = LensKind::ALL.map(|kind| (kind.name().to_lowercase(), kind.description(), vec![kind]));
    OneOf::new(one.into_iter().chain([("mixed".to_owned(), "All of them in turn", LensKind::ALL.to_vec())]))
}
