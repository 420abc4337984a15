//! A training run as a whole, without a terminal: from a dataset and options to a folder with a checkpoint, a log and a
//! report.
//!
//! [`TrainOptions`] and a dataset become [`Resolved`] settings; a [`TrainingRun`] of them becomes a [`TrainingSession`],
//! which takes the steps, evaluates test views, logs and saves. What happens is reported to an [`Observer`]; nothing here
//! prints. The pieces stand alone, too: [`TrainingPhotos`] puts photos on a device,
//! [`Trainer::on`](crate::field::trainer::Trainer::on) is a trainer on a dataset, an [`Evaluator`] compares rendered views
//! with photos, and a [`TrainedField`] is a checkpoint to be rendered.

mod clock;
mod contents;
pub mod depths;
mod disk;
mod estimate;
mod evaluate;
mod event;
mod folder;
pub mod log;
mod log_writer;
pub mod memory;
mod onlookers;
mod options;
pub mod report;
mod resolve;
pub mod results;
mod scene_features;
mod scores;
mod session;
mod settings;
mod stage_times;
mod stepper;
mod trained;
mod training_photos;

pub use clock::StepClock;
pub use contents::Differences;
pub use estimate::Estimate;
pub use evaluate::{Compared, Evaluator};
pub use event::{DepthTold, Event, Observer, StepsTaken, Warning};
pub use folder::RunFolder;
pub use log_writer::LogWriter;
pub use options::{EvaluationAtEnd, EvaluationOptions, SavingOptions, TrainOptions};
pub use resolve::Resolved;
pub use scores::{Means, Score, Scores};
pub use session::{NoTestViews, TrainingEnd, TrainingRun, TrainingSession};
pub use settings::Settings;
pub use stage_times::StageTimes;
pub use stepper::{Block, Stepper};
pub use trained::TrainedField;
pub use training_photos::TrainingPhotos;
