//! What a run reports while it goes on: one list of events, and who listens.

use super::memory::{MemoryUse, Shortage};
use super::scores::Means;
use super::stepper::Block;
use crate::capture::diagnostics::Diagnostic;
use crate::field::Plan;
use crate::field::checkpoint::Metadata;
use crate::gpu::Gpu;
use crate::photo::Photo;
use crate::support::format::{bytes, count, few};
use std::fmt;
use std::path::Path;

/// Listens to a run.
pub trait Observer {
    /// Something happened. The run waits until this returns.
    fn notice(&mut self, event: &Event<'_>);
}

/// Nobody listens.
impl Observer for () {
    fn notice(&mut self, _: &Event<'_>) {}
}

/// What happened.
#[derive(Clone, Copy, Debug)]
pub enum Event<'a> {
    /// It is known what is trained on which device; nothing was loaded yet.
    Resolved {
        /// What the run's checkpoints say, at the first step of this session.
        metadata: &'a Metadata,
        /// How the kernels are linked.
        plan: &'a Plan,
        /// The device.
        gpu: &'a Gpu,
        /// Number of test views.
        test_views: usize,
    },
    /// What the run takes of the memory, before it is taken.
    Memory(MemoryUse),
    /// Photos with depth are on the device.
    Depth(DepthTold),
    /// So many training photos are on the device.
    Loading {
        /// So many, from 0 on.
        done: usize,
        /// Of so many.
        all: usize,
    },
    /// A block of steps was taken.
    Steps(StepsTaken),
    /// A few test views were measured after `step` steps.
    Evaluated {
        /// Steps taken.
        step: u32,
        /// What they say.
        means: Means,
    },
    /// A checkpoint was written.
    Saved {
        /// Steps taken.
        step: u32,
        /// The file.
        path: &'a Path,
    },
    /// The last step was taken, and saved.
    Ended,
    /// So many views were rendered and compared.
    Measuring {
        /// So many, from 0 on.
        done: usize,
        /// Of so many at most.
        all: usize,
    },
    /// Something that probably makes results worse.
    Warning(Warning<'a>),
}

/// How much the depth files of the training photos tell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DepthTold {
    /// Number of photos with depth.
    pub photos: usize,
    /// Mean part of their pixels whose depth is known, within `[0, 1]`.
    pub known: f64,
    /// Mean part of their files' values that stand for far away, and are unknown.
    pub far: f64,
}

impl DepthTold {
    /// Counts a photo in, if it has depth.
    pub(super) fn add(&mut self, photo: &Photo) {
        if photo.depth.is_empty() {
            return;
        }
        let known = photo.depth.iter().filter(|depth| **depth > 0.0).count() as f64;
        self.photos += 1;
        let share = 1.0 / self.photos as f64;
        self.known += share * (known / photo.depth.len() as f64 - self.known);
        self.far += share * (photo.far_depth - self.far);
    }
}

/// A block of steps, and how far the run is after it.
#[derive(Clone, Copy, Debug)]
pub struct StepsTaken {
    /// Steps taken, those of earlier sessions included.
    pub step: u32,
    /// Seconds of training, those of earlier sessions included.
    pub seconds: f64,
    /// What happened in the block, and how long it took.
    pub block: Block,
    /// PSNR of the rays trained on, in decibels; `None` where the loss is relative.
    pub psnr: Option<f64>,
    /// The part of the budget that is spent, within `[0, 1]`.
    pub spent: f64,
    /// Seconds of training until all of it is, if it goes on like this.
    pub remaining: f64,
}

/// Something that probably makes results worse, as a sentence without a full stop.
#[derive(Clone, Copy, Debug)]
pub enum Warning<'a> {
    /// The run begins although its memory seems not to suffice, as asked.
    Overcommitted(Shortage),
    /// The adapter does not bind buffers for the usual batch.
    SmallerBatch {
        /// Its name.
        adapter: &'a str,
        /// Kept samples of a step.
        kept: usize,
        /// As many as there are usually.
        usual: usize,
    },
    /// Masks ignore every pixel of some training photos.
    IgnoredPhotos {
        /// The photos.
        names: &'a [&'a str],
        /// Number of all training photos.
        all: usize,
    },
    /// Masks ignore no pixel of any training photo.
    UselessMasks {
        /// Number of photos with masks.
        masks: usize,
        /// Whether masks are inverted.
        inverted: bool,
    },
    /// The mask of a test view ignores every pixel, so it is not measured.
    NotMeasured {
        /// The view.
        name: &'a str,
    },
    /// Nothing keeps other processes from writing to the run's folder.
    Unguarded {
        /// The folder.
        folder: &'a Path,
    },
    /// The file system has hardly room for what is to be saved.
    LittleRoom {
        /// Bytes that checkpoints take at most.
        needed: u64,
        /// Bytes that are left.
        available: u64,
        /// The run's folder.
        folder: &'a Path,
    },
    /// A checkpoint could not be written.
    NotSaved {
        /// When, what is kept, and why.
        reason: &'a str,
    },
    /// The log could not be written.
    NotLogged {
        /// Why.
        reason: &'a str,
    },
    /// The run's folder was removed, and is made again.
    FolderRemoved {
        /// The folder.
        folder: &'a Path,
    },
    /// Much of what the photos show seems to lie beyond the scene box.
    BeyondBox {
        /// How much, and what to do.
        finding: &'a Diagnostic,
    },
    /// The rays of the last steps had no samples.
    Empty {
        /// Steps taken.
        step: u32,
    },
    /// Steps whose gradients could not be used, for the first time in this session.
    Skipped {
        /// Steps taken.
        step: u32,
        /// How many were skipped.
        skipped: u32,
    },
}

impl fmt::Display for Warning<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Overcommitted(shortage) => {
                write!(f, "{shortage}; it begins all the same, as asked, and the system may end it")
            }
            Self::SmallerBatch { adapter, kept, usual } => write!(
                f,
                "the adapter '{adapter}' binds no buffers for the usual batch: steps have {kept} kept samples instead of \
                 {usual}"
            ),
            Self::IgnoredPhotos { names, all } => write!(
                f,
                "masks ignore every pixel of {} of {all} training photos, which add nothing: {}",
                names.len(),
                few(names)
            ),
            Self::UselessMasks { masks, inverted } => write!(
                f,
                "the masks of {} ignore no pixel; what is to be ignored must be {}",
                count(*masks, "training photo"),
                match inverted {
                    true => "white, as masks are inverted",
                    false => "black, 0 in red, green and blue",
                }
            ),
            Self::NotMeasured { name } => write!(f, "{name} is not measured: its mask ignores every pixel"),
            Self::Unguarded { folder } => write!(
                f,
                "the file system of {} has no locks, so nothing keeps another training out of this folder",
                folder.display()
            ),
            Self::LittleRoom { needed, available, folder } => write!(
                f,
                "checkpoints take up to {}, and the file system of {} has {} left; where that does not do, saving fails, \
                 which is said and tried again",
                bytes(*needed),
                folder.display(),
                bytes(*available)
            ),
            Self::NotSaved { reason } => {
                write!(f, "could not save {reason}; training is not lost by it, and saving is tried again")
            }
            Self::NotLogged { reason } => {
                write!(
                    f,
                    "could not log ({reason}); training goes on, and the rows are kept until they can be written"
                )
            }
            Self::FolderRemoved { folder } => {
                write!(
                    f,
                    "the folder {} was removed; it is made again, and saved to at once",
                    folder.display()
                )
            }
            Self::BeyondBox { finding } => finding.fmt(f),
            Self::Empty { step } => write!(
                f,
                "at step {step} the rays meet nothing any more, the field has become empty; try a smaller \
                 optimizer.learning_rate, occupancy.threshold or loss.sparsity"
            ),
            Self::Skipped { step, skipped } => write!(
                f,
                "up to step {step}, {} skipped: {} gradients were not finite or far too large; if it goes on, try a \
                 smaller optimizer.learning_rate",
                were(*skipped),
                if *skipped == 1 { "its" } else { "their" }
            ),
        }
    }
}

/// `1 step was`, `2 steps were`.
fn were(steps: u32) -> String {
    format!("{} {}", count(steps as usize, "step"), if steps == 1 { "was" } else { "were" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_are_sentences() {
        let ignored = Warning::IgnoredPhotos { names: &["a.png"], all: 3 };
        assert!(ignored.to_string().ends_with("1 of 3 training photos, which add nothing: a.png"));
        let skipped = |skipped| Warning::Skipped { step: 48, skipped }.to_string();
        assert!(skipped(1).starts_with("up to step 48, 1 step was skipped: its gradients"));
        assert!(skipped(2).starts_with("up to step 48, 2 steps were skipped: their gradients"));
    }
}
