//! The command line: types only. Their doc comments are the help.

pub(crate) mod bench;
pub(crate) mod check;
pub(crate) mod generate;
pub(crate) mod info;
mod one_of;
pub(crate) mod photo_flags;
mod render;

use clap::{ArgAction, Args, Parser, Subcommand, ValueEnum};
use nerf::capture::dataset::HoldOut;
use nerf::config::Background;
use nerf::photo::Split;
use nerf::run::SavingOptions;
use one_of::OneOf;
pub(crate) use render::Render;
use std::path::PathBuf;

/// What an exit code says, also to a scheduler.
const EXIT_CODES: &str = "\
Exit codes:
  0    Done
  1    Failed for good: bad data, or it does not fit
  2    Usage
  3    Failed, and may work when it is tried again: disk full or failing, device lost, busy
       or out of memory, too many open files, folder in use by another process
  129  Interrupted by SIGHUP, 130 by SIGINT (Ctrl-C), 143 by SIGTERM; a training is saved
       first, unless a second signal comes";

/// Train neural radiance fields from posed photos and render new views of them.
///
/// Runs on any GPU with Vulkan, Metal or DX12, and on a CPU through a software driver.
/// Results go to stdout, progress and messages to stderr.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true, propagate_version = true, after_help = EXIT_CODES)]
pub(crate) struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
    /// What every command takes.
    #[command(flatten)]
    pub(crate) global: Global,
}

/// Options of every command.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Options of every command")]
pub(crate) struct Global {
    /// The adapter to run on: an index of `nerf adapters`, or parts of its name and backend [default: the first]
    #[arg(long, global = true, value_name = "INDEX|NAME")]
    pub(crate) adapter: Option<String>,
    /// Print one JSON object as the result, also when failing
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// No progress and no messages
    #[arg(long, short, global = true)]
    pub(crate) quiet: bool,
    /// More messages
    #[arg(long, short, global = true, action = ArgAction::Count, conflicts_with = "quiet")]
    pub(crate) verbose: u8,
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Train a field on a dataset
    #[command(after_help = EXIT_CODES)]
    Train(Box<Train>),
    /// Render views of a trained field
    Render(Render),
    /// Measure a trained field against photos: PSNR and SSIM
    Eval(Eval),
    /// Write the page about a training run: curves, test views, settings
    Report(Report),
    /// Look at a dataset before training on it: what was read, what was assumed, what is wrong
    Info(info::Info),
    /// Write an analytic scene with exact ground truth as a dataset
    Generate(generate::Generate),
    /// Measure error against run time
    #[command(subcommand)]
    Bench(bench::Bench),
    /// Compare every kernel with a reference in double precision, on this adapter
    Check(check::Check),
    /// List the adapters of this machine
    Adapters,
}

/// `nerf train`
#[derive(Args, Debug)]
pub(crate) struct Train {
    /// A folder with transforms.json or transforms_train.json, or such a file
    pub(crate) dataset: PathBuf,
    /// Folder to write config.json, checkpoint.safetensors, log.jsonl and report.html to
    #[arg(long, value_name = "RUN")]
    pub(crate) out: PathBuf,
    /// JSON file with the settings that differ from the defaults
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// Change one setting, for example grid.levels=8; may be repeated
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub(crate) set: Vec<String>,
    /// Stop after this many steps, those before --resume included [default: 20000 on a GPU]
    #[arg(long, value_name = "N")]
    pub(crate) steps: Option<u32>,
    /// Stop after this many seconds of training, those before --resume included [default: 300 on a CPU]
    ///
    /// Loading, compiling, evaluating and saving do not count. The learning rate falls along a cosine that
    /// ends where the run does; with --steps too, whichever is nearer to its end counts.
    #[arg(long, value_name = "S", value_parser = seconds, allow_negative_numbers = true)]
    pub(crate) seconds: Option<f64>,
    /// Seed of every random number
    #[arg(long, value_name = "K")]
    pub(crate) seed: Option<u32>,
    /// The same checkpoint bit for bit, in any number of threads, from the same adapter, program, seed and --steps
    #[arg(long, conflicts_with = "seconds")]
    pub(crate) deterministic: bool,
    /// Measure a few test views every N steps
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) eval_every: Option<u32>,
    /// Seconds of training between checkpoints
    #[arg(long, value_name = "SECONDS", default_value_t = SavingOptions::default().every, value_parser = seconds)]
    pub(crate) checkpoint_every: f64,
    /// Most checkpoints that stay in RUN, the newest among them
    ///
    /// Those before it are called checkpoint-STEP.safetensors. Where the newest is damaged, every command takes the one
    /// before, and says so.
    #[arg(long, value_name = "N", default_value_t = SavingOptions::default().keep as u32, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) keep: u32,
    /// What lies behind transparent photos: black, white, random or r,g,b in 0..1
    #[arg(long, value_name = "COLOR", value_parser = training_background)]
    pub(crate) background: Option<Background>,
    /// Without a test split, keep every N-th frame for testing, or none [default: 8]
    #[arg(long, value_name = "N|none", value_parser = hold_out)]
    pub(crate) hold_out: Option<HoldOut>,
    /// Continue the run in RUN
    #[arg(long, conflicts_with = "overwrite")]
    pub(crate) resume: bool,
    /// Continue the run in RUN if one was saved there, else start it: for jobs that are queued again
    #[arg(long, conflicts_with_all = ["resume", "overwrite"])]
    pub(crate) resume_or_start: bool,
    /// Replace the run in RUN
    #[arg(long)]
    pub(crate) overwrite: bool,
    /// Do not measure the test views at the end
    #[arg(long)]
    pub(crate) no_eval: bool,
    /// Measure all test views at the end, however long it takes
    ///
    /// Otherwise it takes at most a tenth of the training time: where not all test views fit, evenly spaced ones
    /// are measured, at least one. A --deterministic run always measures all.
    #[arg(long, conflicts_with = "no_eval")]
    pub(crate) eval_all: bool,
    /// Train even where the memory of this machine seems not to suffice, by an estimate
    #[arg(long)]
    pub(crate) overcommit: bool,
    /// How photos are read.
    #[command(flatten)]
    pub(crate) reading: photo_flags::PhotoFlags,
}

/// `nerf eval`
#[derive(Args, Debug)]
pub(crate) struct Eval {
    /// The folder that `nerf train` wrote, or a checkpoint in it
    #[arg(value_name = "RUN|CHECKPOINT")]
    pub(crate) run: PathBuf,
    /// The dataset with the photos to compare with
    pub(crate) dataset: PathBuf,
    /// The views to compare
    #[arg(long, value_parser = splits(), default_value = "test")]
    pub(crate) split: Split,
    /// What to put behind photo and rendering
    #[arg(long, value_enum, default_value = "black")]
    pub(crate) background: Shade,
    /// Samples per pixel
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) spp: u32,
    /// Write the renderings, over the background, as PNG to this folder
    #[arg(long, value_name = "DIR")]
    pub(crate) save: Option<PathBuf>,
    /// Replace renderings of another field or dataset in the folder to save to
    #[arg(long, requires = "save")]
    pub(crate) overwrite: bool,
    /// How photos are read.
    #[command(flatten)]
    pub(crate) reading: photo_flags::PhotoFlags,
}

/// `nerf report`
#[derive(Args, Debug)]
pub(crate) struct Report {
    /// The folder that `nerf train` wrote
    pub(crate) run: PathBuf,
    /// The dataset with the photos to show [default: the one trained on, where it was then]
    #[arg(long)]
    pub(crate) dataset: Option<PathBuf>,
    /// The page to write [default: RUN/report.html]
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// How photos are read.
    #[command(flatten)]
    pub(crate) reading: photo_flags::PhotoFlags,
}

/// A file format to render to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// Scene-linear R, G, B premultiplied by A, and depth Z in world units
    Exr,
    /// 8-bit sRGB with straight alpha
    Png,
}

/// What to measure over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Shade {
    /// Black
    Black,
    /// White
    White,
}

/// What is behind a PNG.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum PictureBackground {
    /// Nothing: the file has alpha.
    Transparent,
    /// A display-referred colour.
    Color([f32; 3]),
}

impl Shade {
    /// Its name on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Black => "black",
            Self::White => "white",
        }
    }

    /// Its colour.
    pub(crate) fn color(self) -> [f32; 3] {
        match self {
            Self::Black => [0.0; 3],
            Self::White => [1.0; 3],
        }
    }
}

fn splits() -> OneOf<Split> {
    OneOf::named([
        (Split::Test, "Views that were held out"),
        (Split::Val, "Views to choose settings by"),
        (Split::Train, "Views that were trained on"),
    ])
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| "expected a number".to_owned())?;
    let is_time = seconds.is_finite() && seconds >= 0.0;
    is_time.then_some(seconds).ok_or_else(|| "expected a number from 0 on".to_owned())
}

fn training_background(text: &str) -> Result<Background, String> {
    match text {
        "black" => Ok(Background::Black),
        "white" => Ok(Background::White),
        "random" => Ok(Background::Random),
        other => color(other).map(Background::Color).ok_or_else(|| {
            "expected black, white, random or three numbers from 0 to 1 like 0.5,0.5,0.5".to_owned()
        }),
    }
}

fn picture_background(text: &str) -> Result<PictureBackground, String> {
    match text {
        "transparent" => Ok(PictureBackground::Transparent),
        "black" => Ok(PictureBackground::Color([0.0; 3])),
        "white" => Ok(PictureBackground::Color([1.0; 3])),
        other => color(other).map(PictureBackground::Color).ok_or_else(|| {
            "expected transparent, black, white or three numbers from 0 to 1 like 0.5,0.5,0.5".to_owned()
        }),
    }
}

fn color(text: &str) -> Option<[f32; 3]> {
    let numbers: Vec<f32> = text.split(',').map(|part| part.trim().parse().ok()).collect::<Option<_>>()?;
    let color: [f32; 3] = numbers.try_into().ok()?;
    color.iter().all(|value| (0.0..=1.0).contains(value)).then_some(color)
}

fn hold_out(text: &str) -> Result<HoldOut, String> {
    match text.parse() {
        _ if text == "none" => Ok(HoldOut::None),
        Ok(every) if every >= 2 => Ok(HoldOut::Every(every)),
        _ => Err("expected a number from 2 on, or none".to_owned()),
    }
}

fn frames(text: &str) -> Result<(usize, usize), String> {
    let range = text.split_once("..").and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
    range
        .filter(|(first, end)| first < end)
        .ok_or_else(|| "expected A..B with A below B, for example 0..10 for the first ten frames".to_owned())
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let (width, height) = text.split_once('x').unwrap_or((text, text));
    let size = width.parse().ok().zip(height.parse().ok());
    size.ok_or_else(|| "expected WxH or N, for example 320x240".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn values_are_understood() {
        assert_eq!(color("0,0.5, 1"), Some([0.0, 0.5, 1.0]));
        assert_eq!(
            (color("0,0"), color("0,0,2"), color("a,b,c"), color("0,0,nan")),
            (None, None, None, None)
        );
        assert_eq!(frames("3..5"), Ok((3, 5)));
        assert!(frames("5..3").is_err() && frames("5").is_err() && frames("..").is_err());
        assert_eq!((size("30x20"), size("64")), (Ok((30, 20)), Ok((64, 64))));
        assert!(size("x").is_err() && size("3x-1").is_err());
        assert_eq!((hold_out("none"), hold_out("5")), (Ok(HoldOut::None), Ok(HoldOut::Every(5))));
        assert!(hold_out("1").is_err() && hold_out("all").is_err());
        assert!(seconds("-1").is_err() && seconds("inf").is_err() && seconds("2.5") == Ok(2.5));
    }
}
