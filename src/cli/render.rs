//! `nerf render`

use super::{Format, PictureBackground, frames, picture_background};
use clap::Args;
use std::path::PathBuf;

/// `nerf render`
#[derive(Args, Debug)]
pub(crate) struct Render {
    /// The folder that `nerf train` wrote, or a checkpoint in it
    #[arg(value_name = "RUN|CHECKPOINT")]
    pub(crate) run: PathBuf,
    /// Folder to write 0000.png, … and frames.json to
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Where to look from.
    #[command(flatten)]
    pub(crate) path: CameraPath,
    /// File format; may be repeated
    #[arg(long, value_enum, default_value = "png")]
    pub(crate) format: Vec<Format>,
    /// Write half floats to OpenEXR; depth stays float
    #[arg(long)]
    pub(crate) half: bool,
    /// Also write depth as a grey PNG, white near and black far
    #[arg(long)]
    pub(crate) depth: bool,
    /// Width in pixels; alone, the height follows [default: the file's, else the run's]
    ///
    /// Pixels keep their shape: at another aspect, the vertical field of view stays, and the view is wider or narrower.
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(1..=16_384))]
    pub(crate) width: Option<u32>,
    /// Height in pixels; alone, the width follows
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(1..=16_384))]
    pub(crate) height: Option<u32>,
    /// Vertical field of view in degrees, instead of the cameras' own
    #[arg(long, value_name = "DEGREES", value_parser = degrees)]
    pub(crate) fov: Option<f64>,
    /// Samples per pixel [default: 1, or up to 16 where pixels are coarser than those of the training photos]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) spp: Option<u32>,
    /// Depth in world units, or inf, to write where nothing is seen [default: 0, and transparent as PNG]
    #[arg(long, value_name = "V", value_parser = depth, allow_negative_numbers = true)]
    pub(crate) far_depth: Option<f32>,
    /// Only frames A to B - 1, counted from 0
    #[arg(long, value_name = "A..B", value_parser = frames)]
    pub(crate) frames: Option<(usize, usize)>,
    /// Replace the frames in DIR; those of the same rendering stay where they are not rendered again
    #[arg(long)]
    pub(crate) overwrite: bool,
    /// Go on with the frames in DIR, which must be of the same rendering; also while others do so with other --frames
    #[arg(long, conflicts_with = "overwrite")]
    pub(crate) skip_existing: bool,
    /// What to put behind the PNG files: transparent, black, white or r,g,b in 0..1
    #[arg(long, value_name = "COLOR", default_value = "transparent", value_parser = picture_background)]
    pub(crate) background: PictureBackground,
}

/// The cameras to render.
#[derive(Args, Debug)]
#[group(required = true, multiple = false)]
pub(crate) struct CameraPath {
    /// The cameras of a transforms.json, or of a camera path of nerfstudio or instant-ngp
    #[arg(long, value_name = "FILE")]
    pub(crate) cameras: Option<PathBuf>,
    /// N cameras in a circle around the scene
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(crate) orbit: Option<u32>,
}

fn degrees(text: &str) -> Result<f64, String> {
    let angle = text.parse().ok().filter(|angle: &f64| *angle > 0.0 && *angle <= 360.0);
    angle.ok_or_else(|| "expected an angle above 0, up to 360".to_owned())
}

fn depth(text: &str) -> Result<f32, String> {
    let depth = text.parse().ok().filter(|depth: &f32| *depth >= 0.0);
    depth.ok_or_else(|| "expected a number from 0 on, or inf".to_owned())
}
