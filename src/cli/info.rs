//! What `nerf info` takes.

use super::photo_flags::PhotoFlags;
use clap::Args;
use nerf::capture::dataset::HoldOut;
use std::path::PathBuf;

/// `nerf info`
#[derive(Args, Debug)]
pub(crate) struct Info {
    /// A folder with transforms.json or transforms_train.json, or such a file
    pub(crate) dataset: PathBuf,
    /// Draw the cameras from above and from the side, to a .svg file
    #[arg(long, value_name = "FILE.svg", value_parser = map)]
    pub(crate) plot: Option<PathBuf>,
    /// Do not decode the photos to look for blurred, dark, bright and repeated ones
    #[arg(long)]
    pub(crate) no_photos: bool,
    /// Without a test split, keep every N-th frame for testing, or none
    #[arg(long, value_name = "N|none", default_value = "8", value_parser = super::hold_out)]
    pub(crate) hold_out: HoldOut,
    /// Settings of the training to look ahead to, as `nerf train` takes them: a JSON file
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// A single setting, for example loss.depth=1; may be repeated
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub(crate) set: Vec<String>,
    /// How photos are read.
    #[command(flatten)]
    pub(crate) reading: PhotoFlags,
}

fn map(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let is_svg = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("svg"));
    is_svg.then_some(path).ok_or_else(|| {
        format!(
            "expected a name that ends in .svg, found '{text}'; name an SVG file, which any browser shows"
        )
    })
}
