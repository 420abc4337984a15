//! Which frames train and which are held out.

use std::collections::HashSet;
use std::path::Path;

use super::notes::Notes;
use crate::photo::Split;

/// How frames are held out for testing when a dataset does not say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HoldOut {
    /// Every n-th present frame, starting with the first; n is at least 2.
    Every(u32),
    /// No frame.
    None,
}

impl Default for HoldOut {
    fn default() -> Self {
        Self::Every(8)
    }
}

/// At most `most` of some items, evenly spaced from the first on.
#[must_use]
pub fn evenly_spaced<T: Copy>(items: &[T], most: usize) -> Vec<T> {
    let count = items.len().min(most);
    (0..count).map(|i| items[i * items.len() / count]).collect()
}

/// The numbers below `count` in an order of which every beginning is roughly evenly spaced: van der Corput's sequence
/// in base 2. The first `2^k` are those that [`evenly_spaced`] takes.
#[must_use]
pub fn spread_order(count: usize) -> Vec<usize> {
    let parts = count.next_power_of_two().max(2);
    let unused_bits = usize::BITS - parts.trailing_zeros();
    let mut is_taken = vec![false; count];
    let places = (0..parts).map(|number| (number.reverse_bits() >> unused_bits) * count / parts);
    places
        .filter(|&place| is_taken.get_mut(place).is_some_and(|taken| !std::mem::replace(taken, true)))
        .collect()
}

/// Indices of frames per split.
#[derive(Debug, Default)]
pub(super) struct Splits {
    pub(super) train: Vec<usize>,
    pub(super) val: Vec<usize>,
    pub(super) test: Vec<usize>,
}

/// One frame as far as splitting goes: the split it is listed in, and its file.
pub(super) type Member<'a> = (Option<Split>, &'a Path);

/// Assigns the frames, in natural order; those without a split of their own are held out by rule.
pub(super) fn assign(frames: &[Member], hold_out: HoldOut, notes: &mut Notes) -> Splits {
    let listed = |split| -> Vec<usize> {
        let indices = 0..frames.len();
        indices.filter(|&i| frames[i].0 == Some(split)).collect()
    };
    if frames.iter().all(|frame| frame.0.is_none()) {
        return by_rule(frames.len(), hold_out, notes);
    }
    let mut splits =
        Splits { train: listed(Split::Train), val: listed(Split::Val), test: listed(Split::Test) };
    if splits.test.is_empty() && !splits.val.is_empty() {
        splits.test.clone_from(&splits.val);
        notes.note("there is no test split; the validation split is used for testing");
    }
    if splits.test.is_empty() {
        let held = by_rule(splits.train.len(), hold_out, notes);
        let chosen = |picked: Vec<usize>| picked.into_iter().map(|i| splits.train[i]).collect();
        return Splits { test: chosen(held.test), train: chosen(held.train), val: splits.val };
    }
    remove_leaks(frames, &mut splits, notes);
    splits
}

fn by_rule(count: usize, hold_out: HoldOut, notes: &mut Notes) -> Splits {
    let (test, train): (Vec<_>, Vec<_>) = match hold_out {
        HoldOut::Every(_) if count < 2 => {
            notes.note("a single frame: it trains, and nothing is held out for testing");
            (Vec::new(), vec![0; count])
        }
        HoldOut::Every(every) => {
            let split = (0..count).partition(|i| i % every as usize == 0);
            notes.note(format!(
                "one frame in {every} is held out for testing, {} of {count}",
                count.div_ceil(every as usize)
            ));
            split
        }
        HoldOut::None => {
            notes.note("nothing is held out for testing, as asked");
            (Vec::new(), (0..count).collect())
        }
    };
    Splits { train, val: Vec::new(), test }
}

/// An image that is tested on must not be trained on, whatever the lists say.
fn remove_leaks(frames: &[Member], splits: &mut Splits, notes: &mut Notes) {
    let held: HashSet<&Path> = (splits.test.iter().chain(&splits.val)).map(|&i| frames[i].1).collect();
    let is_clean = |i: &&usize| !held.contains(frames[**i].1);
    let clean: Vec<usize> = splits.train.iter().filter(is_clean).copied().collect();
    let leaks = splits.train.len() - clean.len();
    if leaks == 0 {
        return;
    }
    if clean.is_empty() {
        notes.warn(
            "every training image is also a test or validation image; scores measure memory, not new views",
        );
        return;
    }
    notes.warn(format!(
        "{leaks} training frames show images that are also in the test or validation split; they are not trained on"
    ));
    splits.train = clean;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split(frames: &[(Option<Split>, &str)], hold_out: HoldOut) -> (Splits, usize) {
        let members: Vec<Member> = frames.iter().map(|f| (f.0, Path::new(f.1))).collect();
        let mut notes = Notes::default();
        let splits = assign(&members, hold_out, &mut notes);
        (splits, notes.finish().len())
    }

    const TRAIN: Option<Split> = Some(Split::Train);
    const VAL: Option<Split> = Some(Split::Val);
    const TEST: Option<Split> = Some(Split::Test);

    #[test]
    fn every_nth_frame_is_held_out() {
        let names: Vec<String> = (0..17).map(|i| i.to_string()).collect();
        let frames: Vec<_> = names.iter().map(|name| (None, name.as_str())).collect();
        assert_eq!(split(&frames, HoldOut::default()).0.test, [0, 8, 16]);
        assert_eq!(split(&frames, HoldOut::default()).0.train.len(), 14);
        assert_eq!(split(&frames, HoldOut::None).0.train.len(), 17);
        let (single, notes) = split(&frames[..1], HoldOut::default());
        assert_eq!((single.train, single.test.len(), notes), (vec![0], 0, 1));
        let listed: Vec<_> = names.iter().map(|name| (TRAIN, name.as_str())).collect();
        assert_eq!(split(&listed, HoldOut::Every(10)).0.test, [0, 10]);
    }

    #[test]
    fn every_beginning_of_a_spread_order_is_spaced() {
        assert_eq!(spread_order(6), [0, 3, 1, 4, 2, 5]);
        for count in 0..70 {
            let order = spread_order(count);
            let sorted = |numbers: &[usize]| {
                let mut numbers = numbers.to_vec();
                numbers.sort_unstable();
                numbers
            };
            let all: Vec<usize> = (0..count).collect();
            assert_eq!(sorted(&order), all);
            for first in 1..=count {
                let places = sorted(&order[..first]);
                let ends = places.iter().skip(1).chain([&count]);
                let widest = places.iter().zip(ends).map(|(a, b)| b - a).max().expect("not empty");
                let even = count.div_ceil(first);
                assert!(widest <= 2 * even, "{widest} among the first {first} of {count}");
                if first.is_power_of_two() {
                    assert_eq!(places, evenly_spaced(&all, first));
                }
            }
        }
    }

    #[test]
    fn listed_splits_are_kept_apart() {
        let frames = [(TRAIN, "a"), (TRAIN, "b"), (TRAIN, "c"), (VAL, "b"), (TEST, "c")];
        let (splits, notes) = split(&frames, HoldOut::default());
        assert_eq!((splits.train, splits.val, splits.test), (vec![0], vec![3], vec![4]));
        assert_eq!(notes, 1);
        let (splits, _) = split(&frames[..4], HoldOut::default());
        assert_eq!((splits.train, splits.test), (vec![0, 2], vec![3]));
        let (splits, notes) = split(&[(TRAIN, "a"), (TEST, "a")], HoldOut::default());
        assert_eq!((splits.train, splits.test, notes), (vec![0], vec![1], 1));
    }
}
