//! Which file the photo of each listed frame is, and what is said of those that are not where they are listed.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::file_names::mean_the_same;
use super::guesses::{Guesses, below};
use super::listing::FrameEntry;
use super::notes::Notes;
use super::search::{Found, Role, Search, Way};
use crate::capture::image_file::FORMATS;
use crate::support::format::{count, few};

/// Most listed names that a message tells the candidates of.
const MOST_TOLD: usize = 3;

/// A listed frame, and the file of its photo.
pub(super) struct Sought {
    pub(super) entry: FrameEntry,
    pub(super) found: Found,
}

impl Sought {
    /// The file, where there is one.
    pub(super) fn path(&self) -> Option<&Path> {
        match &self.found {
            Found::One(path, _) => Some(path),
            _ => None,
        }
    }
}

/// Looks for the photos of the lists of one dataset. What the strictest way finds is nobody else's: the photo of
/// one listed name is never taken for that of another.
pub(super) fn find(lists: Vec<Vec<FrameEntry>>, search: &mut Search, notes: &mut Notes) -> Vec<Vec<Sought>> {
    let seek = |entry| Sought { entry, found: Found::Nothing };
    let mut lists: Vec<Vec<Sought>> =
        lists.into_iter().map(|list| list.into_iter().map(seek).collect()).collect();
    let mut owners: HashMap<PathBuf, String> = HashMap::new();
    for way in Way::ALL {
        let mut found_now: HashMap<PathBuf, Vec<String>> = HashMap::new();
        for Sought { entry, found } in lists.iter_mut().flatten() {
            if *found != Found::Nothing {
                continue;
            }
            let name = &entry.file_path;
            let owner = |path: &Path| owners.get(&canonical(path));
            let is_free = |path: &Path| owner(path).is_none_or(|owner| mean_the_same(owner, name));
            *found = search.by(way, name, Role::Photo(entry.split), &is_free);
            if let Found::One(path, _) = found {
                found_now.entry(canonical(path)).or_default().push(name.clone());
            }
        }
        if way.guess().is_some() && way != Way::ByEnd {
            refuse_shared(&mut lists, way, &found_now);
        }
        owners.extend(found_now.into_iter().map(|(path, names)| (path, names[0].clone())));
    }
    let mut guesses = Guesses::default();
    for Sought { entry, found } in lists.iter().flatten() {
        if let Found::One(path, way) = found {
            guesses.add(&entry.file_path, path, *way, search.root);
        }
    }
    guesses.tell("photos", "file_path", notes);
    lists
}

pub(super) fn canonical(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

/// Takes back what was found for names that do not mean the same.
fn refuse_shared(lists: &mut [Vec<Sought>], way: Way, found_now: &HashMap<PathBuf, Vec<String>>) {
    for Sought { found, .. } in lists.iter_mut().flatten() {
        let Found::One(path, by) = found else { continue };
        let is_now = *by == way;
        let names = found_now.get(&canonical(path)).filter(|_| is_now);
        if names.is_some_and(|names| names.iter().any(|name| !mean_the_same(name, &names[0]))) {
            *found = Found::Shared(std::mem::take(path));
        }
    }
}

/// What is wrong with the listed photos that were not found: how many, and which files could be meant.
pub(super) fn missing(nowhere: &[&Sought], listed: usize, root: &Path) -> String {
    let names: Vec<&str> = nowhere.iter().map(|sought| sought.entry.file_path.as_str()).collect();
    let (count, place) = (names.len(), root.display());
    let mut message = format!("{count} of {listed} listed images are missing in {place}: {}", few(&names));
    let unclear: Vec<String> = nowhere.iter().filter_map(|sought| candidates(sought, root)).collect();
    for text in unclear.iter().take(MOST_TOLD) {
        message += &format!("; {text}");
    }
    if unclear.len() > MOST_TOLD {
        message += &format!("; and so on for {} more", unclear.len() - MOST_TOLD);
    }
    message
}

/// What to do where no listed photo was found.
pub(super) fn remedy(nowhere: &[&Sought], search: &mut Search) -> String {
    if nowhere.iter().any(|sought| matches!(sought.found, Found::Several(_) | Found::Shared(_))) {
        return "correct `file_path`, or leave one file that fits each".to_owned();
    }
    let root = search.root;
    match search.folders.pictures(root) {
        Some((folder, names)) => format!(
            "found {} in {}, such as {}, where no `file_path` leads; correct `file_path`",
            count(names.len(), "picture"),
            folder.display(),
            few(&names[..1])
        ),
        None => format!("put the images where `file_path` says, as {FORMATS}"),
    }
}

/// Which files a name could mean.
fn candidates(sought: &Sought, root: &Path) -> Option<String> {
    let name = &sought.entry.file_path;
    match &sought.found {
        Found::Several(paths) => {
            let paths: Vec<_> = paths.iter().map(|path| below(path, root)).collect();
            Some(format!("'{name}' could be any of {}", few(&paths)))
        }
        Found::Shared(path) => {
            Some(format!("'{name}' could be {}, as other listed names could", below(path, root)))
        }
        Found::One(..) | Found::Nothing => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::dataset::Split;
    use crate::capture::dataset::transforms::parse;
    use serde_json::json;

    /// What is found for the names of each list, with commas, in a folder with these files; then what is said.
    fn found(files: &[&str], lists: &[(Option<Split>, &[&str])]) -> (Vec<String>, String) {
        let folder = tempfile::tempdir().expect("temporary folder");
        let root = folder.path();
        for file in files {
            let path = root.join(file);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
            std::fs::write(path, "").expect("writable");
        }
        let pose = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]];
        let entries = |&(split, names): &(Option<Split>, &[&str])| {
            let frames: Vec<_> =
                names.iter().map(|name| json!({"file_path": name, "transform_matrix": pose})).collect();
            let listing = parse(&json!({"fl_x": 9, "frames": frames}).to_string()).expect("valid");
            listing.frames.into_iter().map(|entry| FrameEntry { split, ..entry }).collect()
        };
        let (mut search, mut notes) = (Search::new(root), Notes::default());
        let lists = find(lists.iter().map(entries).collect(), &mut search, &mut notes);
        let show = |sought: &Sought| sought.path().map_or("-".to_owned(), |path| below(path, root));
        let shown = lists.iter().map(|list| list.iter().map(show).collect::<Vec<_>>().join(",")).collect();
        let mut said: String = notes.finish().iter().map(|note| format!("{note}\n")).collect();
        let nowhere: Vec<_> = lists.iter().flatten().filter(|sought| sought.path().is_none()).collect();
        if !nowhere.is_empty() {
            said += &format!("{}; {}", missing(&nowhere, 9, root), remedy(&nowhere, &mut search));
        }
        (shown, said)
    }

    const TRAIN: Option<Split> = Some(Split::Train);
    const TEST: Option<Split> = Some(Split::Test);

    #[test]
    fn each_way_of_finding_is_told_once() {
        let names = ["images/1.jpg", "images/2.jpg", "images/x%203.jpg", "4.jpg"];
        let files = ["images/1.JPG", "images/2.JPG", "images/x 3.jpg", "images/4.jpg"];
        let (found, said) = found(&files, &[(None, &names)]);
        assert_eq!(found, ["images/1.JPG,images/2.JPG,images/x 3.jpg,images/4.jpg"]);
        assert_eq!(said.lines().count(), 3, "{said}");
        assert!(
            said.contains(
                "2 of 4 photos are not where `file_path` leads; they were found with other small and capital \
                           letters: images/1.JPG is taken for 'images/1.jpg'"
            ),
            "{said}"
        );
    }

    #[test]
    fn the_photo_of_one_name_is_never_that_of_another() {
        for (files, lists, expected) in [
            // The strictest way wins.
            (
                &["images/a.jpg"][..],
                &[(None, &["images/a.png", "images/a.JPG"][..])][..],
                vec!["-,images/a.jpg"],
            ),
            (&["images/1.png"], &[(None, &["cam1/1.png", "cam2/1.png"])], vec!["-,-"]),
            (
                &["train/r_0.png"],
                &[(TRAIN, &["./train/r_0"]), (TEST, &["./test/r_0"])],
                vec!["train/r_0.png", "-"],
            ),
            (&["test/r_0.png"], &[(TRAIN, &["./train/r_0"])], vec!["-"]),
            (
                &["train/r_0.png", "test/r_0.png"],
                &[(TRAIN, &["r_0"]), (TEST, &["r_0"])],
                vec!["train/r_0.png", "test/r_0.png"],
            ),
            // Names that mean the same.
            (
                &["images/a.JPG"],
                &[(TRAIN, &["images/a.jpg"]), (TEST, &["./images/a.jpg"])],
                vec!["images/a.JPG"; 2],
            ),
        ] {
            assert_eq!(found(files, lists).0, expected, "{files:?} {lists:?}");
        }
    }

    #[test]
    fn what_could_be_meant_is_told() {
        let several = found(&["rgb/a.png", "color/a.png"], &[(None, &["a.png"])]).1;
        assert!(
            several.contains("'a.png' could be any of rgb/a.png, color/a.png; correct `file_path`"),
            "{several}"
        );
        let shared = found(&["images/1.png"], &[(None, &["cam1/1.png", "cam2/1.png"])]).1;
        assert!(
            shared.contains("'cam1/1.png' could be images/1.png, as other listed names could"),
            "{shared}"
        );
        let others = found(&["scans/IMG_2.heic", "scans/IMG_10.heic"], &[(None, &["images/a.png"])]).1;
        assert!(
            others.contains("found 2 pictures in") && others.contains("scans, such as IMG_2.heic"),
            "{others}"
        );
        let nothing = found(&[], &[(None, &["images/a.png"])]).1;
        assert!(nothing.contains("put the images where `file_path` says"), "{nothing}");
    }
}
