//! Whether a JPEG file is all there: its decoder fills what is missing with grey, without a word.

use std::path::Path;

use anyhow::{Result, ensure};

/// Refuses a file that ends before its picture does.
pub(super) fn check_complete(path: &Path) -> Result<()> {
    let bytes = std::fs::read(path)?;
    ensure!(
        is_complete(&bytes),
        "the file ends before the picture does, after {} bytes; copy it again, or leave the frame out",
        bytes.len()
    );
    Ok(())
}

/// Walks from marker to marker (ITU T.81, annex B) until the end of the image. Thumbnails in the metadata have
/// ends of their own, so that just looking for the end's two bytes would not do.
fn is_complete(bytes: &[u8]) -> bool {
    const START_OF_IMAGE: u8 = 0xd8;
    const END_OF_IMAGE: u8 = 0xd9;
    const START_OF_SCAN: u8 = 0xda;
    let mut at = 0;
    let mut in_scan = false;
    while let Some(&[lead, code]) = bytes.get(at..at + 2).and_then(|pair| pair.first_chunk()) {
        match (lead, code) {
            (0xff, END_OF_IMAGE) => return true,
            (0xff, 0xff) => at += 1,
            // Stuffed bytes and restart markers belong to the scan.
            (0xff, START_OF_IMAGE | 0x00 | 0x01 | 0xd0..=0xd7) => at += 2,
            (0xff, _) => {
                let Some(length) = bytes.get(at + 2..at + 4) else { return false };
                at += 2 + usize::from(u16::from_be_bytes([length[0], length[1]]));
                in_scan |= code == START_OF_SCAN;
            }
            // Some cameras pad between segments.
            _ if !in_scan => at += 1,
            _ => {
                let Some(skip) = bytes[at..].iter().position(|&byte| byte == 0xff) else { return false };
                at += skip;
            }
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_is_looked_for_behind_the_scan() {
        // A thumbnail with an end of its own inside an APP1 segment, a scan with a stuffed byte and a restart.
        let segment = [0xff, 0xe1, 0, 6, 0xff, 0xd8, 0xff, 0xd9];
        let scan = [0xff, 0xda, 0, 3, 7, 1, 2, 0xff, 0, 3, 0xff, 0xd0, 4];
        let whole = [&[0xff, 0xd8][..], &segment, &scan, &[0xff, 0xff, 0xd9, 0, 0]].concat();
        assert!(is_complete(&whole));
        for end in 0..whole.len() - 2 {
            assert!(!is_complete(&whole[..end]), "{end}");
        }
    }
}
