//! From listed names to image files.

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

use super::notes::Notes;
use crate::capture::diagnostics::Severity;

/// Extensions that a listed name may lack, the most common first.
const EXTENSIONS: [&str; 9] = ["png", "jpg", "jpeg", "exr", "webp", "tif", "tiff", "bmp", "hdr"];

/// Finds the image that `file_path` (forward slashes) means, relative to the folder of the file that
/// lists it; `owner` names the frame in notes.
pub(super) fn find(root: &Path, file_path: &str, owner: &str, notes: &mut Notes) -> Option<PathBuf> {
    let (path, is_by_tail) = locate(root, file_path)?;
    if is_by_tail {
        let message =
            "`file_path` does not lead to a file from here; the image was found by the end of the path";
        notes.frame(Severity::Note, owner, message);
    }
    Some(path)
}

/// The file that a name in a dataset means, and whether only the end of the name led to it.
pub(super) fn locate(root: &Path, name: &str) -> Option<(PathBuf, bool)> {
    let bytes = name.as_bytes();
    let has_drive = bytes.len() > 2 && bytes[0].is_ascii_alphabetic() && bytes[1] == b':';
    let is_absolute = name.starts_with('/') || has_drive;
    let existing = |path: &Path| candidates(path).find(|path| path.is_file());
    if let Some(path) = existing(&root.join(name)) {
        return Some((path, false));
    }
    // Paths of another machine, or relative to where some exporter ran, are found again by their tail.
    // A bare name is too little to go by unless the path was absolute.
    let parts: Vec<_> =
        (name.split('/')).filter(|part| !part.is_empty() && *part != "." && *part != "..").collect();
    let shortest = if is_absolute { 1 } else { 2 };
    let lengths = (shortest..parts.len() + usize::from(!is_absolute)).rev();
    let tails = lengths.map(|length| root.join(parts[parts.len() - length..].join("/")));
    tails.into_iter().find_map(|path| existing(&path)).map(|path| (path, true))
}

/// The path itself, then with every extension that it may lack.
pub(super) fn candidates(path: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    let extensions = EXTENSIONS.into_iter().map(str::to_owned);
    let base = path.as_os_str().to_owned();
    let extended = extensions.chain(EXTENSIONS.into_iter().map(str::to_uppercase)).map(move |extension| {
        let mut name = base.clone();
        name.push(".");
        name.push(extension);
        PathBuf::from(name)
    });
    std::iter::once(path.to_owned()).chain(extended)
}

/// Orders names as people count: `r_2` before `r_10`.
pub(super) fn natural_order(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (a, b);
    loop {
        let (x, y) = (token(left), token(right));
        let order = if is_number(x) && is_number(y) {
            let (p, q) = (x.trim_start_matches('0'), y.trim_start_matches('0'));
            p.len().cmp(&q.len()).then_with(|| p.cmp(q))
        } else {
            x.cmp(y)
        };
        if order != Ordering::Equal {
            return order;
        }
        if x.is_empty() {
            // Equal but for leading zeros.
            return a.cmp(b);
        }
        (left, right) = (&left[x.len()..], &right[y.len()..]);
    }
}

/// The digits, or the character, that a text starts with.
fn token(text: &str) -> &str {
    let digits = text.bytes().take_while(u8::is_ascii_digit).count();
    let length = match digits {
        0 => text.chars().next().map_or(0, char::len_utf8),
        some => some,
    };
    &text[..length]
}

fn is_number(token: &str) -> bool {
    token.starts_with(|c: char| c.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_sort_as_people_count() {
        let mut names = ["r_10", "r_2", "r_2b", "r_002", "q", "r_", "r_1/9", "r_1/10", "é1"];
        names.sort_by(|a, b| natural_order(a, b));
        let expected = ["q", "r_", "r_1/9", "r_1/10", "r_002", "r_2", "r_2b", "r_10", "é1"];
        assert_eq!(names, expected);
    }

    #[test]
    fn files_are_found_under_many_names() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let root = folder.path();
        std::fs::create_dir_all(root.join("images")).expect("writable");
        for name in ["images/a.png", "images/b.JPG", "images/c.v1.exr", "d.png"] {
            std::fs::write(root.join(name), "").expect("writable");
        }
        let found = |name: &str| {
            let path = find(root, name, "frame 0", &mut Notes::default())?;
            Some(path.file_name()?.to_string_lossy().into_owned())
        };
        for (name, expected) in [
            ("images/a.png", Some("a.png")),
            ("./images/a", Some("a.png")),
            ("images/b", Some("b.JPG")),
            ("images/c.v1", Some("c.v1.exr")),
            ("/home/someone/images/a.png", Some("a.png")),
            ("C:/Users/someone/d.png", Some("d.png")),
            ("../elsewhere/images/a.png", Some("a.png")),
            ("other/d.png", None),
            ("d.png/nothing", None),
            ("images", None),
        ] {
            assert_eq!(found(name).as_deref(), expected, "{name}");
        }
    }
}
