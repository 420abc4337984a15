//! Truevision's TGA, which begins with nothing that tells it: what its header may say, and how long it must be.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use anyhow::Result;

/// What newer files end with.
const END: &[u8] = b"TRUEVISION-XFILE.\0";

/// Whether a file that begins with `head` is a TGA.
pub(super) fn is_tga(path: &Path, head: &[u8]) -> Result<bool> {
    let Some(bytes) = expected_bytes(head) else { return Ok(false) };
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    let is_named_so = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("tga"));
    if is_named_so || bytes.is_some_and(|bytes| bytes == length) {
        return Ok(true);
    }
    let mut end = Vec::new();
    file.seek(SeekFrom::Start(length.saturating_sub(END.len() as u64)))?;
    file.read_to_end(&mut end)?;
    Ok(end == END)
}

/// How long the file of a header without a footer is, where that is plausible; inside, `None` for compressed pixels.
fn expected_bytes(head: &[u8]) -> Option<Option<u64>> {
    let header = head.first_chunk::<18>()?;
    let word = |at: usize| u64::from(u16::from_le_bytes([header[at], header[at + 1]]));
    let [id, has_map, kind, .., bits, flags] = *header;
    let (width, height) = (word(12), word(14));
    let is_mapped = matches!(kind, 1 | 9);
    let is_plausible = matches!(kind, 1..=3 | 9..=11)
        && (has_map == 1 || (has_map == 0 && !is_mapped))
        && matches!(bits, 8 | 15 | 16 | 24 | 32)
        && flags >> 6 == 0
        && width > 0
        && height > 0;
    let map = if has_map == 1 { word(5) * u64::from(header[7]).div_ceil(8) } else { 0 };
    let pixels = width * height * u64::from(bits).div_ceil(8);
    is_plausible.then(|| (kind < 8).then_some(18 + u64::from(id) + map + pixels))
}
