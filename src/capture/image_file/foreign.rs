//! Files that are listed as pictures and are none that is read: what they are, and what to do about them.

use std::fmt;
use std::io::Read;
use std::path::Path;

use anyhow::Result;

use super::FORMATS;

/// What a file is that is none of the [`FORMATS`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Foreign {
    /// What it is, as "a GIF".
    pub what: &'static str,
    /// What to do about it.
    pub remedy: &'static str,
}

impl fmt::Display for Foreign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "expected {FORMATS}, found {}; {}", self.what, self.remedy)
    }
}

impl std::error::Error for Foreign {}

/// So many bytes tell what a file is.
const HEAD: u64 = 4096;

const AGAIN: &str = "copy or download it again";
const HEIC: &str = "convert it, as with `magick mogrify -format jpg *.heic` or `heif-convert`, and move the original away: \
                    a photo is found under another extension";
const CONVERT: &str = "convert it to PNG or JPEG, as with `magick mogrify -format png`, and move the original away: a \
                       photo is found under another extension";
const DEVELOP: &str = "develop it to JPEG, PNG or 16-bit TIFF, and move the original away: a photo is found under another \
                       extension";
const EXTRACT: &str = "take pictures out of it, as with `ffmpeg -i VIDEO -vf fps=2 images/%04d.png`, before their poses are \
                       found";
const UNPACK: &str = "unpack it";

/// What files of a kind begin with: bytes at a place, what the file is, and what to do.
const BEGINNINGS: [(usize, &[u8], &str, &str); 46] = [
    (
        0,
        b"version https://git-lfs",
        "a Git LFS pointer in place of the picture",
        "run `git lfs pull` in the dataset's folder",
    ),
    (
        0,
        b"/annex/objects/",
        "a git-annex pointer in place of the picture",
        "run `git annex get .` in the dataset's folder",
    ),
    (0, b"outs:\n- md5", "a DVC pointer in place of the picture", "run `dvc pull` in the dataset's folder"),
    (
        0,
        b"\x00\x05\x16\x07",
        "metadata of macOS (AppleDouble)",
        "list the picture, whose name has no ._ in front",
    ),
    (4, b"ftypheic", "a HEIC picture", HEIC),
    (4, b"ftypheix", "a HEIC picture", HEIC),
    (4, b"ftyphevc", "a HEIC picture", HEIC),
    (4, b"ftypheim", "a HEIC picture", HEIC),
    (4, b"ftypheis", "a HEIC picture", HEIC),
    (4, b"ftypmif1", "a HEIC picture", HEIC),
    (4, b"ftypmsf1", "a HEIC picture", HEIC),
    (4, b"ftypavif", "an AVIF picture", CONVERT),
    (4, b"ftypavis", "an AVIF picture", CONVERT),
    (4, b"ftypcrx ", "a raw photo (CR3)", DEVELOP),
    (4, b"ftyp", "a video", EXTRACT),
    (4, b"moov", "a video", EXTRACT),
    (4, b"mdat", "a video", EXTRACT),
    (8, b"AVI ", "a video", EXTRACT),
    (0, b"\x1a\x45\xdf\xa3", "a video", EXTRACT),
    (0, b"\x00\x00\x01\xba", "a video", EXTRACT),
    (0, b"\x00\x00\x01\xb3", "a video", EXTRACT),
    (0, b"\xff\x0a", "a JPEG XL picture", CONVERT),
    (0, b"\x00\x00\x00\x0cJXL ", "a JPEG XL picture", CONVERT),
    (0, b"\x00\x00\x00\x0cjP  ", "a JPEG 2000 picture", CONVERT),
    (0, b"\xff\x4f\xff\x51", "a JPEG 2000 picture", CONVERT),
    (0, b"GIF8", "a GIF", CONVERT),
    (0, b"8BPS", "a Photoshop document", CONVERT),
    (0, b"gimp xcf", "a GIMP document", CONVERT),
    (0, b"%PDF", "a PDF document", CONVERT),
    (0, b"DDS ", "a DDS texture", CONVERT),
    (0, b"\xabKTX ", "a KTX texture", CONVERT),
    (0, b"qoif", "a QOI picture", CONVERT),
    (0, b"farbfeld", "a farbfeld picture", CONVERT),
    (0, b"\x00\x00\x01\x00", "an icon", CONVERT),
    (0, b"FUJIFILMCCD-RAW", "a raw photo (RAF)", DEVELOP),
    (0, b"IIU\x00", "a raw photo (RW2)", DEVELOP),
    (0, b"IIRO", "a raw photo (ORF)", DEVELOP),
    (0, b"IIRS", "a raw photo (ORF)", DEVELOP),
    (0, b"FOVb", "a raw photo (X3F)", DEVELOP),
    (0, b"\x93NUMPY", "a NumPy array", "write it as PNG"),
    (0, b"\x89HDF", "an HDF5 file", "write what is in it as PNG"),
    (0, b"PK\x03\x04", "a ZIP archive", UNPACK),
    (0, b"7z\xbc\xaf\x27\x1c", "a 7z archive", UNPACK),
    (0, b"\x1f\x8b", "a compressed file (gzip)", UNPACK),
    (0, b"\xfd7zXZ", "a compressed file (xz)", UNPACK),
    (0, b"Rar!", "a RAR archive", UNPACK),
];

impl Foreign {
    /// What a file is that no decoder knows.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn of(path: &Path) -> Result<Self> {
        let mut head = Vec::new();
        std::fs::File::open(path)?.take(HEAD).read_to_end(&mut head)?;
        Ok(Self::of_head(&head))
    }

    /// What a file is that begins so, in at most [`HEAD`] bytes.
    fn of_head(head: &[u8]) -> Self {
        if head.is_empty() {
            return Self { what: "an empty file", remedy: AGAIN };
        }
        let begins = |&&(at, bytes, ..): &&(usize, &[u8], &str, &str)| {
            head.get(at..).is_some_and(|rest| rest.starts_with(bytes))
        };
        if let Some(&(_, _, what, remedy)) = BEGINNINGS.iter().find(begins) {
            return Self { what, remedy };
        }
        if head.iter().all(|&byte| byte == 0) {
            return Self { what: "nothing but zeros, as an interrupted copy leaves them", remedy: AGAIN };
        }
        Self::of_text(head).unwrap_or(Self {
            what: "bytes that are none of them",
            remedy: "copy or export it again, as PNG or JPEG",
        })
    }

    /// What text is, if it is that.
    fn of_text(head: &[u8]) -> Option<Self> {
        // The last character may be cut.
        let text = match std::str::from_utf8(head) {
            Ok(text) => text,
            Err(error) if error.error_len().is_none() => {
                std::str::from_utf8(&head[..error.valid_up_to()]).ok()?
            }
            Err(_) => return None,
        };
        if text.chars().any(|c| c.is_control() && !c.is_whitespace()) {
            return None;
        }
        let lower = text.trim_start_matches('\u{feff}').trim_start().to_lowercase();
        Some(if lower.contains("<svg") {
            Self { what: "an SVG drawing", remedy: CONVERT }
        } else if lower.starts_with("<!doctype html") || lower.contains("<html") {
            let remedy = "download it again: the address answers with a page, as for a login or a large file";
            Self { what: "a web page in place of the picture", remedy }
        } else {
            let remedy = "look into it: it may tell why a download failed";
            Self { what: "text in place of the picture", remedy }
        })
    }

    /// A raw photo in the clothes of a TIFF, whose first picture is only a preview.
    pub(super) fn raw(path: &Path, head: &[u8]) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_lowercase();
        let is_raw = ["dng", "nef", "nrw", "arw", "sr2", "srw", "cr2", "pef", "erf", "3fr", "iiq", "rwl"];
        let is_canon = head.get(8..10) == Some(b"CR");
        (is_canon || is_raw.contains(&extension.as_str()))
            .then_some(Self { what: "a raw photo", remedy: DEVELOP })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_known_by_what_they_begin_with() {
        let zeros = [0; 40];
        let cut = [b"caf".as_slice(), b"\xc3"].concat();
        for (head, expected) in [
            (&b""[..], "an empty file"),
            (&zeros, "nothing but zeros"),
            (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "a Git LFS pointer"),
            (b"/annex/objects/SHA256E-s3--0.jpg\n", "a git-annex pointer"),
            (b"\x00\x00\x00\x18ftypheic", "a HEIC picture"),
            (b"\x00\x00\x00\x18ftypavif", "an AVIF picture"),
            (b"\x00\x00\x00\x18ftypisom", "a video"),
            (b"RIFF\x00\x00\x00\x00AVI LIST", "a video"),
            (b"GIF89a......", "a GIF"),
            (b"\n <!DOCTYPE html><html>", "a web page"),
            (b"<?xml version=\"1.0\"?><Error>denied</Error>", "text in place"),
            (b"<svg xmlns=''/>", "an SVG drawing"),
            (b"%PDF-1.4", "a PDF"),
            (b"PK\x03\x04", "a ZIP archive"),
            (&cut, "text in place"),
            (b"\x01\x02\x03\xff", "bytes that are none of them"),
        ] {
            let found = Foreign::of_head(head).what;
            assert!(found.starts_with(expected), "{found} for {expected}");
        }
    }
}
