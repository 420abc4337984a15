//! Files that were found where no name leads: one note for each way of finding them.

use std::path::Path;

use super::json::shortened;
use super::notes::Notes;
use super::search::Way;

/// What was found by guessing, of one role.
#[derive(Default)]
pub(super) struct Guesses {
    ways: Vec<Guess>,
    total: usize,
}

/// The files that were found in one way.
struct Guess {
    how: &'static str,
    count: usize,
    /// The first, and the name that it is taken for.
    example: String,
}

impl Guesses {
    /// Counts a file that was found for a name.
    pub(super) fn add(&mut self, name: &str, path: &Path, way: Way, root: &Path) {
        self.total += 1;
        let Some(how) = way.guess() else { return };
        match self.ways.iter_mut().find(|guess| guess.how == how) {
            Some(guess) => guess.count += 1,
            None => {
                let example = format!("{} is taken for '{}'", below(path, root), shortened(name));
                self.ways.push(Guess { how, count: 1, example });
            }
        }
    }

    /// Says what was guessed; `things` are not where `key` leads.
    pub(super) fn tell(&self, things: &str, key: &str, notes: &mut Notes) {
        for Guess { how, count, example } in &self.ways {
            let total = self.total;
            let message =
                format!("{count} of {total} {things} are not where `{key}` leads; they were found {how}: ");
            notes.note(message + example);
        }
    }
}

/// A path as seen from the dataset.
pub(super) fn below(path: &Path, root: &Path) -> String {
    path.strip_prefix(root).unwrap_or(path).display().to_string()
}
