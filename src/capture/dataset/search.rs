//! From a listed name to the file that it means: one ordered list of ways of looking.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::file_names::{Likeness, parts};
use super::folders::Folders;
use crate::photo::Split;

/// Folders that a listed path may have in front of what is there.
const DEEPEST: usize = 32;

/// What a file is to a frame, and with it where it usually lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// A photo, with the split that it is listed in.
    Photo(Option<Split>),
    Mask,
    Depth,
}

/// Folders of the splits; what is listed in one of them is never looked for in another.
const SPLIT_FOLDERS: [(Split, &str); 3] =
    [(Split::Train, "train"), (Split::Val, "val"), (Split::Test, "test")];

impl Role {
    /// Folders that such files usually lie in, and those of reduced ones, which count where the others have none.
    fn usual_folders(self) -> [&'static [&'static str]; 2] {
        match self {
            Self::Photo(_) => [
                &[
                    "images",
                    "image",
                    "imgs",
                    "img",
                    "rgb",
                    "rgbs",
                    "color",
                    "colors",
                    "colour",
                    "input",
                    "inputs",
                    "photos",
                    "photo",
                    "frames",
                    "undistorted",
                ],
                &["images_2", "images_4", "images_8"],
            ],
            Self::Mask => [&["masks", "mask"], &["masks_2", "masks_4", "masks_8"]],
            Self::Depth => [
                &["depth", "depths", "depth_maps"],
                &["depth_2", "depth_4", "depth_8", "depths_2", "depths_4", "depths_8"],
            ],
        }
    }

    /// Folders of splits that a file listed with the folders `parts` may lie in.
    fn split_folders(self, parts: &[&str]) -> impl Iterator<Item = &'static str> {
        let names_split = parts.iter().any(|part| SPLIT_FOLDERS.iter().any(|(_, folder)| part == folder));
        let is_meant = move |of: Split| match self {
            Self::Photo(listed) => !names_split && listed.is_none_or(|listed| listed == of),
            Self::Mask | Self::Depth => false,
        };
        SPLIT_FOLDERS.into_iter().filter(move |(split, _)| is_meant(*split)).map(|(_, folder)| folder)
    }
}

/// A way of looking for a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    /// Where the name leads.
    AsListed,
    /// There, with an extension that the name lacks.
    Extended,
    /// Where an end of the path leads, the longest first: it is that of another machine, or relative to where some
    /// exporter ran. A bare name is too little to go by unless the path was absolute.
    ByEnd,
    /// There or at an end of it, by a name that is like the listed one.
    Like(Likeness),
    /// In the folders that such files usually lie in, by any end of the path.
    InUsualFolder(Likeness),
}

impl Way {
    /// From the strictest to the loosest.
    pub(super) const ALL: [Self; 10] = [
        Self::AsListed,
        Self::Extended,
        Self::ByEnd,
        Self::Like(Likeness::Spelling),
        Self::Like(Likeness::Case),
        Self::Like(Likeness::Extension),
        Self::InUsualFolder(Likeness::Same),
        Self::InUsualFolder(Likeness::Spelling),
        Self::InUsualFolder(Likeness::Case),
        Self::InUsualFolder(Likeness::Extension),
    ];

    /// How a file was found that the name does not lead to; `None` where it does.
    pub(super) fn guess(self) -> Option<&'static str> {
        match self {
            Self::AsListed | Self::Extended => None,
            Self::ByEnd => Some("by the end of the path"),
            Self::Like(Likeness::Same | Likeness::Spelling) => {
                Some("spelled otherwise (percent-encoding, separators, blanks or Unicode form)")
            }
            Self::Like(Likeness::Case) => Some("with other small and capital letters"),
            Self::Like(Likeness::Extension) => Some("with another extension"),
            Self::InUsualFolder(_) => Some("in another folder"),
        }
    }
}

/// What was found for a name.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Found {
    One(PathBuf, Way),
    /// Each of these could be meant.
    Several(Vec<PathBuf>),
    /// This one could be meant by other names, too.
    Shared(PathBuf),
    Nothing,
}

/// Looks for files of a dataset in the folder `root`.
pub(super) struct Search<'a> {
    pub(super) root: &'a Path,
    pub(super) folders: Folders,
    /// The folders in the root that are called like a usual one.
    usual: HashMap<&'static str, Vec<PathBuf>>,
}

impl<'a> Search<'a> {
    pub(super) fn new(root: &'a Path) -> Self {
        Self { root, folders: Folders::default(), usual: HashMap::new() }
    }

    /// The file that `name` (forward slashes) means, by the first way that leads to any. What is not free is only
    /// found where the name leads.
    pub(super) fn find(&mut self, name: &str, role: Role, is_free: &dyn Fn(&Path) -> bool) -> Found {
        let mut found = Way::ALL.into_iter().map(|way| self.by(way, name, role, is_free));
        found.find(|found| *found != Found::Nothing).unwrap_or(Found::Nothing)
    }

    /// What one way of looking leads to; what is not free is only found where the name leads.
    pub(super) fn by(&mut self, way: Way, name: &str, role: Role, is_free: &dyn Fn(&Path) -> bool) -> Found {
        let mut paths = self.candidates(name, role, way);
        paths.retain(|path| way.guess().is_none() || is_free(path));
        // The first extension and the longest end are meant; what is merely alike must be the only one.
        let is_ordered = matches!(way, Way::AsListed | Way::Extended | Way::ByEnd);
        match paths.len() {
            0 => Found::Nothing,
            2.. if !is_ordered => Found::Several(paths),
            _ => Found::One(paths.swap_remove(0), way),
        }
    }

    /// The files that a way of looking leads to.
    fn candidates(&mut self, name: &str, role: Role, way: Way) -> Vec<PathBuf> {
        let root = self.root;
        match way {
            Way::AsListed => Some(root.join(name)).filter(|path| path.is_file()).into_iter().collect(),
            Way::Extended => self.folders.extended(root, name),
            Way::ByEnd => {
                let mut ends = ends(name).into_iter().map(|parts| parts.join("/"));
                let found = ends.find_map(|end| self.exactly(&end));
                found.into_iter().collect()
            }
            Way::Like(likeness) => {
                let spelled = Likeness::Spelling.key(name);
                let ends = ends(&spelled);
                let mut found = ends.iter().map(|parts| self.folders.files_like(root, parts, likeness));
                found.find(|paths| !paths.is_empty()).unwrap_or_default()
            }
            Way::InUsualFolder(likeness) => self.in_usual_folders(name, role, likeness),
        }
    }

    /// The file at `end` of a path, or there with an extension that it lacks.
    fn exactly(&mut self, end: &str) -> Option<PathBuf> {
        let path = self.root.join(end);
        if path.is_file() {
            return Some(path);
        }
        self.folders.extended(self.root, end).into_iter().next()
    }

    fn in_usual_folders(&mut self, name: &str, role: Role, likeness: Likeness) -> Vec<PathBuf> {
        let spelled = Likeness::Spelling.key(name);
        let parts = parts(&spelled);
        let Some(bare) = parts.last() else { return Vec::new() };
        let [full, reduced] = role.usual_folders();
        let mut found = Vec::new();
        for folder in full.iter().copied().chain(role.split_folders(&parts)) {
            found.extend(self.in_folder(folder, &parts, likeness));
        }
        if matches!(role, Role::Photo(_)) {
            found.extend(self.folders.files_like(self.root, &[bare], likeness));
        }
        let mut reduced = reduced.iter();
        while let (true, Some(folder)) = (found.is_empty(), reduced.next()) {
            found.extend(self.in_folder(folder, &parts, likeness));
        }
        found
    }

    /// The files in a usual folder that the longest end of a path leads to.
    fn in_folder(&mut self, folder: &'static str, parts: &[&str], likeness: Likeness) -> Vec<PathBuf> {
        let folders = &mut self.folders;
        let mut found = Vec::new();
        for folder in self.usual.entry(folder).or_insert_with(|| folders.inner(self.root, folder)) {
            let starts = parts.len().saturating_sub(DEEPEST)..parts.len();
            let mut ends = starts.map(|start| folders.files_like(folder, &parts[start..], likeness));
            found.extend(ends.find(|paths| !paths.is_empty()).unwrap_or_default());
        }
        found
    }
}

/// A path without what means nothing, then its ends, the longest first.
fn ends(name: &str) -> Vec<Vec<&str>> {
    let bytes = name.as_bytes();
    let has_drive = bytes.len() > 2 && bytes[0].is_ascii_alphabetic() && bytes[1] == b':';
    let shortest = if name.starts_with('/') || has_drive { 1 } else { 2 };
    let parts = parts(name);
    // Whole, a bare name is a path, too.
    let shortest = shortest.min(parts.len().max(1));
    let lengths = (shortest..=parts.len().min(DEEPEST)).rev();
    lengths.map(|length| parts[parts.len() - length..].to_vec()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with these files, each empty.
    fn folder(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("temporary folder");
        for file in files {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
            std::fs::write(path, "").expect("writable");
        }
        folder
    }

    /// What is found for a name, from the folder on; several with commas.
    fn found(root: &Path, name: &str, role: Role) -> String {
        let show = |path: &PathBuf| path.strip_prefix(root).expect("below").display().to_string();
        match Search::new(root).find(name, role, &|_| true) {
            Found::One(path, _) => show(&path),
            Found::Several(paths) => paths.iter().map(show).collect::<Vec<_>>().join(","),
            Found::Shared(_) | Found::Nothing => String::new(),
        }
    }

    #[test]
    fn photos_are_found_under_many_names() {
        let files =
            ["images/a.png", "images/b.JPG", "images/c.v1.exr", "d.png", "images/e é.jpg", "RGB/f.png"];
        let folder = folder(&files);
        std::fs::create_dir(folder.path().join("g.png")).expect("writable");
        for (name, expected) in [
            ("images/a.png", "images/a.png"),
            ("./images/a", "images/a.png"),
            ("images/b", "images/b.JPG"),
            ("images/c.v1", "images/c.v1.exr"),
            ("/home/someone/images/a.png", "images/a.png"),
            ("C:/Users/someone/d.png", "d.png"),
            ("../elsewhere/images/a.png", "images/a.png"),
            ("other/d.png", "d.png"),
            ("d.png/nothing", ""),
            ("images", ""),
            ("Images/A.PNG", "images/a.png"),
            ("/home/x/IMAGES/B.jpeg", "images/b.JPG"),
            ("images/e%20e%CC%81.JPG", "images/e é.jpg"),
            ("images%2fa.png", "images/a.png"),
            ("a.png", "images/a.png"),
            ("f.jpg", "RGB/f.png"),
            ("frames/f", "RGB/f.png"),
            ("g.png", ""),
            ("g", ""),
            ("", ""),
            ("..", ""),
        ] {
            assert_eq!(found(folder.path(), name, Role::Photo(None)), expected, "{name}");
        }
        let long = "x/".repeat(3000) + &"y".repeat(300);
        assert_eq!(found(folder.path(), &long, Role::Photo(None)), "");
    }

    #[test]
    fn what_is_alike_must_be_the_only_one() {
        let folder =
            folder(&["A.png", "a.PNG", "images/b.png", "images_2/b.png", "rgb/c.png", "color/c.png"]);
        let root = folder.path();
        assert_eq!(found(root, "A.PNG", Role::Photo(None)), "A.png,a.PNG");
        assert_eq!(found(root, "b.png", Role::Photo(None)), "images/b.png");
        assert_eq!(found(root, "c.png", Role::Photo(None)), "rgb/c.png,color/c.png");
    }

    #[test]
    fn a_photo_is_no_mask() {
        let folder = folder(&["images/a.png", "images/b.png", "Masks/b.JPG", "depth/a.npy"]);
        for (name, role, expected) in [
            ("a.png", Role::Mask, ""),
            ("b.png", Role::Mask, "Masks/b.JPG"),
            ("mask/b.png", Role::Mask, "Masks/b.JPG"),
            ("a.png", Role::Depth, "depth/a.npy"),
            ("b.png", Role::Photo(None), "images/b.png"),
        ] {
            assert_eq!(found(folder.path(), name, role), expected, "{name} {role:?}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn odd_folders_do_no_harm() {
        use std::os::unix::ffi::OsStrExt;
        let folder = folder(&["images\\a.png", "images/%41b.png"]);
        let root = folder.path();
        std::fs::write(root.join(std::ffi::OsStr::from_bytes(b"\xff\xfe.png")), "").expect("writable");
        std::os::unix::fs::symlink(root.join("loop"), root.join("loop")).expect("writable");
        std::os::unix::fs::symlink(root, root.join("images/images")).expect("writable");
        for (name, expected) in [
            ("images/a.png", "images\\a.png"),
            ("images/%41b.png", "images/%41b.png"),
            ("loop/a.png", ""),
            ("\u{fffd}.png", ""),
        ] {
            assert_eq!(found(root, name, Role::Photo(None)), expected, "{name}");
        }
    }
}
