//! Names of files, as people count them and as they compare: tools, file systems and archives change them on the way.

use std::borrow::Cow;
use std::cmp::Ordering;
use std::path::{Path, PathBuf};

use unicode_normalization::UnicodeNormalization;

/// Extensions that a listed name may lack or have in place of another, the most common first.
const EXTENSIONS: [&str; 14] =
    ["png", "jpg", "jpeg", "exr", "webp", "tif", "tiff", "bmp", "hdr", "tga", "ppm", "pgm", "pnm", "jpe"];

/// Extensions of pictures that are not read, which a listed name may have in place of one that is.
const STRANGERS: [&str; 14] =
    ["heic", "heif", "avif", "gif", "jxl", "jp2", "psd", "svg", "dng", "cr2", "cr3", "nef", "arw", "npy"];

/// How a file is called in comparison with how it is listed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Likeness {
    /// Exactly so.
    Same,
    /// So, but for percent-encoding, backslashes and the Unicode form of its accents.
    Spelling,
    /// So, but for small and capital letters, too.
    Case,
    /// So, but for the extension of a picture, too.
    Extension,
}

impl Likeness {
    /// What names that are alike have in common.
    pub(super) fn key(self, name: &str) -> Cow<'_, str> {
        match self {
            Self::Same => Cow::Borrowed(name),
            Self::Spelling => spelling(name).into(),
            Self::Case => folded(name).into(),
            Self::Extension => stem(&folded(name)).to_owned().into(),
        }
    }
}

/// A name with its percent-encoding undone, with forward slashes, without blanks around its parts, and with accents in
/// one Unicode form.
fn spelling(name: &str) -> String {
    let decoded = decoded(name).replace('\\', "/");
    let trimmed: Vec<&str> = decoded.split('/').map(str::trim).collect();
    trimmed.join("/").nfc().collect()
}

/// The spelling without the difference of small and capital letters, or of letters that look alike.
fn folded(name: &str) -> String {
    let lower: String = spelling(name).nfkc().flat_map(char::to_lowercase).collect();
    // Some capital letters are made of other parts than their small ones.
    lower.nfkc().collect()
}

/// A name without the extension of a picture, if it has one; the name is in small letters.
fn stem(name: &str) -> &str {
    let is_extension = |end: &str| EXTENSIONS.contains(&end) || STRANGERS.contains(&end);
    match name.rsplit_once('.') {
        Some((stem, end)) if is_extension(end) && !stem.is_empty() && !stem.ends_with('/') => stem,
        _ => name,
    }
}

/// Every extension that a name may lack, the most common first.
pub(super) fn extensions() -> impl Iterator<Item = String> {
    EXTENSIONS.map(str::to_owned).into_iter().chain(EXTENSIONS.map(str::to_uppercase))
}

/// The path itself, then with every extension that it may lack.
pub fn with_extensions(path: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    let base = path.as_os_str().to_owned();
    let extended = extensions().map(move |extension| {
        let mut name = base.clone();
        name.push(".");
        name.push(extension);
        PathBuf::from(name)
    });
    std::iter::once(path.to_owned()).chain(extended)
}

/// Whether a name has the extension of a picture.
#[must_use]
pub fn is_picture(name: &str) -> bool {
    let lower = name.to_lowercase();
    stem(&lower).len() < lower.len() && !name.starts_with('.') && !lower.ends_with(".npy")
}

/// A name with `%20` and the like as what they stand for, if that is text.
fn decoded(name: &str) -> Cow<'_, str> {
    if !name.contains('%') {
        return Cow::Borrowed(name);
    }
    let hex = |byte: u8| char::from(byte).to_digit(16).map(|digit| digit as u8);
    let mut rest = name.as_bytes();
    let mut bytes = Vec::with_capacity(rest.len());
    while let [first, after @ ..] = rest {
        let encoded = match (first, after) {
            (b'%', &[high, low, ..]) => hex(high).zip(hex(low)).map(|(high, low)| 16 * high + low),
            _ => None,
        };
        bytes.push(encoded.unwrap_or(*first));
        rest = if encoded.is_some() { &after[2..] } else { after };
    }
    String::from_utf8(bytes).map_or(Cow::Borrowed(name), Cow::Owned)
}

/// The parts of a path that mean something.
pub(super) fn parts(path: &str) -> Vec<&str> {
    path.split('/').filter(|part| !matches!(*part, "" | "." | "..")).collect()
}

/// Whether two listed names can only mean the same file: one is the end of the other.
pub(super) fn mean_the_same(a: &str, b: &str) -> bool {
    let (a, b) = (spelling(a), spelling(b));
    let (a, b) = (parts(&a), parts(&b));
    a.ends_with(&b) || b.ends_with(&a)
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
    fn names_are_alike_in_degrees() {
        use Likeness::{Case, Extension, Same, Spelling};
        for (a, b, expected) in [
            ("a.png", "a.png", Some(Same)),
            ("My%20Scan%20%231.jpg", "My Scan #1.jpg", Some(Spelling)),
            ("M%C3%BCll.jpg", "Mu\u{308}ll.jpg", Some(Spelling)),
            ("caf\u{e9}", "cafe\u{301}", Some(Spelling)),
            ("100%.png", "100%25.png", Some(Spelling)),
            ("a /b.png ", "a/b.png", Some(Spelling)),
            ("11.30\u{202f}PM.png", "11.30 PM.png", Some(Case)),
            ("50%zz.png", "50%ZZ.PNG", Some(Case)),
            ("IMG_1.JPG", "img_1.jpg", Some(Case)),
            ("É.png", "e\u{301}.png", Some(Case)),
            ("ｆ１.png", "F1.png", Some(Case)),
            ("a.v1", "A.V1.heic", Some(Extension)),
            ("a.JPG", "a", Some(Extension)),
            ("a.v1", "a.v2", None),
            (".png", ".jpg", None),
            ("%ff.png", "ÿ.png", None),
        ] {
            let all = [Same, Spelling, Case, Extension];
            let found = all.into_iter().find(|likeness| likeness.key(a) == likeness.key(b));
            assert_eq!(found, expected, "{a} {b}");
        }
        assert!(mean_the_same("./train/r_0", "/home/x/train/r_0") && !mean_the_same("a.png", "A.png"));
    }
}
