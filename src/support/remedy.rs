//! What a user may choose otherwise, as a value: a library says it in plain words, a command line with its own.

use std::error::Error;
use std::fmt;

/// A choice of the user that a message is about. It is displayed in plain words, as a part of a sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Remedy {
    /// Photos by half as wide and high, or at most so many of them.
    HalveOrThinOut {
        /// At most so many photos.
        most_images: usize,
    },
    /// Smaller photos, parts of them, or fewer.
    FewerPixels,
    /// As many pixels less as it takes to fit.
    FittingPixels {
        /// What width and height are to be divided by.
        downscale: u32,
        /// Or what part of the pixels may be left, in percent.
        percent: u32,
    },
    /// A field or a batch that takes less.
    SmallerField,
    /// A device that has more memory and time left for what is asked of it.
    RelieveDevice,
    /// What takes less memory, or to begin although it seems not to suffice.
    OrOvercommit(Box<Self>),
    /// What width and height are divided by.
    Downscale(u32),
    /// Masks that mean the opposite.
    InvertMasks,
    /// Masks that mean what they say.
    LeaveMasks,
    /// Colours that are not multiplied with alpha.
    StraightAlpha,
    /// The choice of an adapter.
    Adapter,
    /// A single setting.
    Setting,
    /// A number of steps, and no time, as the end of a run.
    StepsAlone,
    /// The same field, or a new run.
    SameField,
    /// Photos read as they were before.
    SameReading {
        /// The name of the setting that differs.
        setting: &'static str,
        /// As it was.
        then: String,
        /// As it is now.
        now: String,
    },
    /// The dataset that a run began with, or a new run.
    SameDataset {
        /// Its path, as it was given then.
        dataset: String,
    },
    /// Another folder, or what is in it.
    UsedFolder,
    /// The folder of a run.
    RunFolder,
    /// Poses for photos.
    FindPoses {
        /// Their folder, as a shell has it.
        photos: String,
    },
    /// Poses for the pictures of a video.
    FindPosesOfVideo {
        /// The file, as a shell has it.
        video: String,
    },
    /// A COLMAP model as a transforms.json.
    ConvertColmap {
        /// Its folder, as a shell has it.
        model: String,
    },
}

impl fmt::Display for Remedy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::HalveOrThinOut { most_images } => {
                write!(f, "divide their width and height by 2, or take at most {most_images} of them")
            }
            Self::FewerPixels => f.write_str(
                "divide the photos' width and height by 2, crop them or take fewer, to train on fewer pixels",
            ),
            Self::FittingPixels { downscale, percent } => write!(
                f,
                "divide their width and height by {downscale}, or take fewer or crop them to leave {percent} % of the \
                 pixels"
            ),
            Self::SmallerField => {
                f.write_str("use a smaller table or batch (see configs/cpu.json), or another machine")
            }
            Self::RelieveDevice => f.write_str(
                "try again, a training from its last checkpoint; should it happen again, close what else uses the adapter, \
                 ask less of it (fewer or smaller photos, a smaller batch or table), or choose another one",
            ),
            Self::OrOvercommit(less) => write!(f, "{less}, or begin all the same"),
            Self::Downscale(by) => write!(f, "a downscale of {by}"),
            Self::InvertMasks => f.write_str("try to invert them"),
            Self::LeaveMasks => f.write_str("do not invert them"),
            Self::StraightAlpha => f.write_str("read them as straight"),
            Self::Adapter => f.write_str("the choice of an adapter"),
            Self::Setting => f.write_str("a setting"),
            Self::StepsAlone => f.write_str("a number of steps and no seconds"),
            Self::SameField => {
                f.write_str("when it goes on; leave those settings as they are, or start anew")
            }
            Self::SameReading { setting, then, now } => write!(
                f,
                "the run began with {setting} {then}, and now it is {now}; leave it as it was, or start anew"
            ),
            Self::SameDataset { dataset } => write!(
                f,
                "go on with the dataset that it began with, {dataset}, as it was then, or start anew"
            ),
            Self::UsedFolder => f.write_str("name another one, go on with the run in it, or replace it"),
            Self::RunFolder => f.write_str("the folder of a training run"),
            Self::FindPoses { photos } => write!(
                f,
                "find the poses of the photos in {photos} with nerfstudio's ns-process-data or instant-ngp's colmap2nerf.py"
            ),
            Self::FindPosesOfVideo { video } => write!(
                f,
                "find the poses of {video} with nerfstudio's ns-process-data or instant-ngp's colmap2nerf.py"
            ),
            Self::ConvertColmap { model } => write!(
                f,
                "convert {model} to a transforms.json with nerfstudio's ns-process-data or instant-ngp's colmap2nerf.py"
            ),
        }
    }
}

/// A message about a [`Remedy`], whose plain words are a part of it: an error, or the context of one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Advised {
    /// Before the remedy, and behind it.
    text: [String; 2],
    /// What to choose otherwise.
    pub remedy: Remedy,
}

impl Advised {
    /// `before`, the remedy and `after`.
    pub fn new(before: impl Into<String>, remedy: Remedy, after: impl Into<String>) -> Self {
        Self { text: [before.into(), after.into()], remedy }
    }

    /// The message with other words for the remedy.
    #[must_use]
    pub fn with(&self, words: &str) -> String {
        let [before, after] = &self.text;
        format!("{before}{words}{after}")
    }
}

impl fmt::Display for Advised {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [before, after] = &self.text;
        write!(f, "{before}{}{after}", self.remedy)
    }
}

impl Error for Advised {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_have_one_remedy_in_two_wordings() {
        let advised = Advised::new("too large; ", Remedy::HalveOrThinOut { most_images: 3 }, "");
        assert_eq!(
            advised.to_string(),
            "too large; divide their width and height by 2, or take at most 3 of them"
        );
        assert_eq!(advised.with("use less"), "too large; use less");
    }

    /// What names a flag, the help of the command line included, belongs to the binary's own files.
    #[test]
    fn the_library_names_no_flag() {
        let source = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        let mut folders = vec![source.clone()];
        while let Some(folder) = folders.pop() {
            for entry in
                std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path())
            {
                let name = entry.strip_prefix(&source).expect("below it").display().to_string();
                let is_binary = ["cli", "commands", "main.rs", "flags.rs", "narrator.rs", "outcome.rs"];
                if is_binary.iter().any(|part| name.starts_with(part)) {
                    continue;
                }
                if entry.is_dir() {
                    folders.push(entry);
                } else if name.ends_with(".rs") {
                    let text = std::fs::read_to_string(&entry).expect("readable");
                    let is_code = |line: &&str| !line.trim_start().starts_with("//");
                    let flag = text.lines().filter(is_code).find(|line| names_a_flag(line));
                    assert_eq!(flag, None, "in {name}");
                }
            }
        }
    }

    fn names_a_flag(line: &str) -> bool {
        line.split([' ', '"', '(', '`']).any(|word| {
            word.strip_prefix("--")
                .is_some_and(|flag| flag.starts_with(|first: char| first.is_ascii_lowercase()))
        })
    }
}
