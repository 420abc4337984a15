//! Checkpoints: a field, the state of its training, and everything needed to render it without its dataset.
//!
//! One safetensors file. Tensors: the parameters and Adam's moments (`table`: `[entries, 2]`,
//! `table_moments`: `[entries, 4]`, `mlp*`: `[quads, 4]`), `occupancy` (`[cascades, cells, cells, cells]`),
//! `occupancy_bits`, and [`CHECKSUMS`] of all that is before them. The metadata entry [`KEY`] holds [`Metadata`] as JSON.

mod earlier;
mod file;
mod metadata;

pub use earlier::{Opened, locate, remove_earlier, replace};
pub use file::CHECKSUMS;
pub use metadata::{FrameContents, Metadata, SplitNames};

use crate::field::parameters::Array;
use crate::field::state::State;
use crate::support::file::write_atomically;
use anyhow::{Context, Result, bail, ensure};
use file::Reader;
use std::fmt;
use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;

/// The layout of the file that this version writes. Those before had no checksums.
pub const FORMAT: u64 = 4;
/// The oldest layout that is read. It had the number of cascades among the features, where it is the box's now.
const OLDEST_FORMAT: u64 = 2;
/// The key of the metadata entry.
pub const KEY: &str = "nerf";
/// The file's name in the folder of a training run.
pub const FILE: &str = "checkpoint.safetensors";

/// A trained field and where its training stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// Where it comes from and how it is to be linked.
    pub metadata: Metadata,
    /// Parameters, moments and occupancy.
    pub state: State,
}

/// The file is of a format that this version does not know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OtherVersion {
    /// The number of its format.
    pub found: u64,
}

impl fmt::Display for OtherVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let found = self.found;
        write!(
            f,
            "expected format {FORMAT}, found {found}: another version of nerf wrote it; render it with that version, \
             or train again"
        )
    }
}

impl std::error::Error for OtherVersion {}

impl Checkpoint {
    /// Writes the file, or leaves the one that is there alone.
    ///
    /// # Errors
    /// When a number is not finite, or the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        let mut arrays = Vec::new();
        for (array, (name, numbers)) in self.metadata.arrays().zip(&self.state.arrays) {
            let (found, expected) = (numbers.count(), array.count());
            ensure!(
                *name == array.name && found == expected,
                "the tensor '{name}' has {found} numbers, and {expected} of '{}' are expected",
                array.name
            );
            check_finite(name, numbers.floats())?;
            arrays.push((array, numbers));
        }
        let description = serde_json::to_string(&self.metadata)?;
        write_atomically(path, |file| file::write(file, &description, &arrays))
    }

    /// Reads the file and checks it against its checksums and its own description.
    ///
    /// # Errors
    /// When it is missing, not a checkpoint, of another version ([`OtherVersion`]), cut short or damaged; the message names
    /// what is damaged.
    pub fn load(path: &Path) -> Result<Self> {
        let name = path.display();
        let file = File::open(path).with_context(|| format!("reading the checkpoint {name}"))?;
        Self::read(file).with_context(|| format!("the checkpoint {name} cannot be used"))
    }

    /// As [`Checkpoint::load`], from what was opened already.
    ///
    /// # Errors
    /// As [`Checkpoint::load`].
    pub fn read(source: impl Read + Seek) -> Result<Self> {
        let mut reader = Reader::new(source)?;
        let metadata = Metadata::parse(reader.description()?, reader.has_checksums())?;
        let numbers = |array: Array| {
            let numbers = reader.numbers(&array)?;
            check_finite(array.name, numbers.floats())?;
            Ok((array.name, numbers))
        };
        let arrays = metadata.arrays().map(numbers).collect::<Result<_>>()?;
        let Metadata { step, rays, step_excess, .. } = metadata;
        Ok(Self { metadata, state: State { step, rays, step_excess, arrays } })
    }

    /// What a file says of itself, if all of it is as it was written, as far as it has checksums. Little of it is in memory
    /// at a time.
    ///
    /// # Errors
    /// As [`Checkpoint::load`].
    pub fn check(path: &Path) -> Result<Metadata> {
        let mut reader = Reader::new(File::open(path)?)?;
        let metadata = Metadata::parse(reader.description()?, reader.has_checksums())?;
        reader.check()?;
        Ok(metadata)
    }
}

fn check_finite(name: &str, values: &[f32]) -> Result<()> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(index) => bail!(
            "the tensor '{name}' has a value that is not finite ({} at {index}): training diverged; \
             start again with a smaller optimizer.learning_rate",
            values[index]
        ),
    }
}

#[cfg(test)]
mod tests;
