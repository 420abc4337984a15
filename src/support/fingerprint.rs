//! Whether files and values are those that they were, on any machine and with any compiler.

use crc32fast::Hasher;
use std::fs::File;
use std::io::{Read, Result, Seek, SeekFrom};
use std::path::Path;

/// Files up to this size, in bytes, are read as a whole.
const WHOLE: u64 = 1 << 20;
/// Parts of larger ones that are read: together as much.
const PARTS: u64 = 16;

/// A checksum of the length and the bytes of a file. Of a large one only parts are read, evenly spaced from its beginning to
/// its end: an edit of a compressed picture moves all that comes after it.
///
/// # Errors
/// When the file cannot be read.
pub fn fingerprint(path: &Path) -> Result<u32> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    let (parts, size) = if length <= WHOLE { (1, length) } else { (PARTS, WHOLE / PARTS) };
    let mut checksum = Hasher::new();
    checksum.update(&length.to_le_bytes());
    let mut bytes = vec![0; size as usize];
    for number in 0..parts {
        file.seek(SeekFrom::Start((length - size) * number / (parts - 1).max(1)))?;
        file.read_exact(&mut bytes)?;
        checksum.update(&bytes);
    }
    Ok(checksum.finalize())
}

/// A text that tells values apart: a checksum of their lengths and bytes, one after the other.
#[must_use]
pub fn checksum<T: AsRef<[u8]>>(values: impl IntoIterator<Item = T>) -> String {
    let mut checksum = Hasher::new();
    for value in values {
        checksum.update(&(value.as_ref().len() as u64).to_le_bytes());
        checksum.update(value.as_ref());
    }
    format!("{:08x}", checksum.finalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_are_those_of_every_machine() {
        assert_eq!(checksum(["123456789"]), "85a458e8");
        assert_ne!(checksum(["ab", "c"]), checksum(["a", "bc"]));
        assert_eq!(checksum::<&str>([]), "00000000");
    }

    #[test]
    fn lengths_and_bytes_count() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("photo");
        let of = |bytes: &[u8]| {
            std::fs::write(&path, bytes).expect("writable");
            fingerprint(&path).expect("readable")
        };
        assert_ne!(of(&[]), of(&[0]));
        assert_eq!(of(&[1, 2, 3]), of(&[1, 2, 3]));
        let mut large: Vec<u8> = (0..5_000_000u32).map(|i| (i % 251) as u8).collect();
        let before = of(&large);
        for at in [0, 4_999_999] {
            large[at] ^= 1;
            assert_ne!(of(&large), before);
            large[at] ^= 1;
        }
        large.insert(2_500_000, 7);
        assert_ne!(of(&large), before);
        large.remove(2_500_000);
        assert_eq!(of(&large), before);
    }
}
