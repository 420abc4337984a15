//! The file of a checkpoint: a safetensors file whose last tensor, [`CHECKSUMS`], holds a CRC-32 of the numbers of each
//! tensor before it, in their order, and in the end that of the header (its length and padding included). A CRC-32 finds
//! every single flipped bit, and every damage within 32 bits of each other.

use super::KEY;
use crate::field::parameters::{Array, Numbers};
use anyhow::{Context, Result, anyhow, bail, ensure};
use safetensors::tensor::{Dtype, Metadata as Header};
use serde_json::{Map, json};
use std::io::{Read, Seek, SeekFrom, Write};

/// The name of the tensor with the checksums.
pub const CHECKSUMS: &str = "checksums";
/// Most bytes of a header: what readers of such files accept.
const LONGEST_HEADER: u64 = 100_000_000;
/// Bytes of the length in front of the header.
const LENGTH_BYTES: u64 = 8;
/// Bytes that are read to see whether it is a checkpoint at all.
const FIRST_LOOK: u64 = 64;
/// Bytes of a tensor that are in memory while it is checked.
const READ_AT_ONCE: usize = 1 << 20;
const NOT_OURS: &str = "expected a safetensors file written by `nerf train`, found something else";
/// How the header of every checkpoint begins, so that a damaged one is known as such.
const BEGINNING: &[u8] = b"{\"__metadata__\":{\"nerf\":\"{";

/// Writes the arrays, what `description` says of them, and the checksums.
///
/// # Errors
/// When the description is too long, or the file cannot be written.
pub(super) fn write(file: &mut impl Write, description: &str, arrays: &[(Array, &Numbers)]) -> Result<()> {
    let header = header(description, arrays)?;
    file.write_all(&header)?;
    let mut checksums = Vec::with_capacity(arrays.len() + 1);
    for (_, numbers) in arrays {
        let bytes: &[u8] = match numbers {
            Numbers::Floats(numbers) => bytemuck::cast_slice(numbers),
            Numbers::Words(numbers) => bytemuck::cast_slice(numbers),
        };
        file.write_all(bytes)?;
        checksums.push(crc32fast::hash(bytes));
    }
    checksums.push(crc32fast::hash(&header));
    Ok(file.write_all(bytemuck::cast_slice(&checksums))?)
}

/// The header with its length, padded so that the numbers are aligned.
fn header(description: &str, arrays: &[(Array, &Numbers)]) -> Result<Vec<u8>> {
    let mut table = Map::new();
    table.insert("__metadata__".to_owned(), json!({ KEY: description }));
    let mut begin = 0;
    let mut add = |name: &str, dtype: Dtype, shape: &[usize]| {
        let end = begin + 4 * shape.iter().product::<usize>();
        let row = json!({ "dtype": dtype, "shape": shape, "data_offsets": [begin, end] });
        table.insert(name.to_owned(), row);
        begin = end;
    };
    for (array, _) in arrays {
        add(array.name, dtype(array), &array.shape);
    }
    add(CHECKSUMS, Dtype::U32, &[arrays.len() + 1]);
    let mut text = serde_json::to_vec(&table)?;
    text.resize(text.len().next_multiple_of(8), b' ');
    let length = text.len() as u64;
    ensure!(length <= LONGEST_HEADER, "the description has {length} bytes, more than {LONGEST_HEADER}");
    Ok([&length.to_le_bytes()[..], &text].concat())
}

fn dtype(array: &Array) -> Dtype {
    if array.has_words() { Dtype::U32 } else { Dtype::F32 }
}

/// A checkpoint that is being read: its header was, and is as it was written.
pub(super) struct Reader<R> {
    source: R,
    header: Header,
    /// Where the numbers of the tensors begin.
    data: u64,
    /// Those of the tensors, in their order; `None` in files of earlier formats, which have none.
    checksums: Option<Vec<u32>>,
}

impl<R: Read + Seek> Reader<R> {
    /// Reads the header, and nothing else into memory.
    ///
    /// # Errors
    /// When it is damaged, of something else, or not as long as it says.
    pub(super) fn new(mut source: R) -> Result<Self> {
        let length = source.seek(SeekFrom::End(0))?;
        source.rewind()?;
        ensure!(length > LENGTH_BYTES, "it is cut short: found {length} bytes, not even a header");
        let mut bytes = vec![0; length.min(FIRST_LOOK) as usize];
        source.read_exact(&mut bytes)?;
        let in_header = bytes.first_chunk().map_or(0, |length| u64::from_le_bytes(*length));
        let data = LENGTH_BYTES.saturating_add(in_header);
        let is_known = looks_like_ours(&bytes[LENGTH_BYTES as usize..]);
        if in_header > LONGEST_HEADER || data > length {
            ensure!(is_known, NOT_OURS);
            bail!("it is cut short or damaged: found {length} bytes, and its header is to have {in_header}");
        }
        source.seek(SeekFrom::Start(LENGTH_BYTES))?;
        bytes.resize(data as usize, 0);
        source.read_exact(&mut bytes[LENGTH_BYTES as usize..])?;
        let header = serde_json::from_slice::<Header>(&bytes[LENGTH_BYTES as usize..]);
        let header = header.map_err(|error| match is_known {
            true => anyhow!("its header is damaged ({error})"),
            false => anyhow!("{NOT_OURS} ({error})"),
        })?;
        let mut reader = Self { source, header, data, checksums: None };
        let described = data.checked_add(reader.header.data_len() as u64);
        ensure!(
            described == Some(length),
            "it is cut short or damaged: found {length} bytes, and its header describes another length"
        );
        reader.read_checksums(&bytes)?;
        Ok(reader)
    }

    /// Reads the checksums where there are some, and compares that of the header.
    fn read_checksums(&mut self, header: &[u8]) -> Result<()> {
        let Some(info) = self.header.info(CHECKSUMS) else { return Ok(()) };
        let (begin, end) = info.data_offsets;
        let count = self.header.offset_keys().len();
        let is_last = end == self.header.data_len() && end.checked_sub(begin) == Some(4 * count);
        ensure!(is_last, "its header is damaged: it has no room for its {count} checksums");
        let mut checksums = vec![0u32; count];
        self.source.seek(SeekFrom::Start(self.data + begin as u64))?;
        self.source.read_exact(bytemuck::cast_slice_mut(&mut checksums))?;
        let is_whole = checksums.pop() == Some(crc32fast::hash(header));
        ensure!(is_whole, "its header is damaged: it does not have the checksum that it was written with");
        self.checksums = Some(checksums);
        Ok(())
    }

    /// What it says of itself.
    ///
    /// # Errors
    /// When it says nothing.
    pub(super) fn description(&self) -> Result<&str> {
        let entry = self.header.metadata().as_ref().and_then(|entries| entries.get(KEY));
        entry.map(String::as_str).context("it is a safetensors file, but `nerf train` did not write it")
    }

    /// Whether it has checksums.
    pub(super) fn has_checksums(&self) -> bool {
        self.checksums.is_some()
    }

    /// The numbers of an array. No more memory is taken than the file has bytes.
    ///
    /// # Errors
    /// When the array is missing, of another kind or shape, or damaged; the message names it.
    pub(super) fn numbers(&mut self, array: &Array) -> Result<Numbers> {
        let Array { name, shape, .. } = array;
        let info = self.header.info(name).ok_or_else(|| anyhow!("the tensor '{name}' is missing"))?;
        let dtype = dtype(array);
        ensure!(
            info.dtype == dtype && info.shape == *shape,
            "the tensor '{name}' should be {dtype:?} {shape:?}, found {:?} {:?}",
            info.dtype,
            info.shape
        );
        let (begin, end) = info.data_offsets;
        let fits = end <= self.header.data_len() && end.checked_sub(begin) == Some(4 * array.count());
        ensure!(fits, "the tensor '{name}' has another number of bytes than its shape says");
        self.source.seek(SeekFrom::Start(self.data + begin as u64))?;
        let mut numbers = match dtype {
            Dtype::U32 => Numbers::Words(vec![0; array.count()]),
            _ => Numbers::Floats(vec![0.0; array.count()]),
        };
        let bytes: &mut [u8] = match &mut numbers {
            Numbers::Floats(numbers) => bytemuck::cast_slice_mut(numbers),
            Numbers::Words(numbers) => bytemuck::cast_slice_mut(numbers),
        };
        let read = self.source.read_exact(bytes);
        read.with_context(|| format!("the tensor '{name}' cannot be read"))?;
        let found = crc32fast::hash(bytes);
        self.compare(name, found)?;
        Ok(numbers)
    }

    /// Compares all tensors with their checksums, where there are some.
    ///
    /// # Errors
    /// Names the first that is damaged.
    pub(super) fn check(&mut self) -> Result<()> {
        let mut part = vec![0; READ_AT_ONCE];
        for name in self.header.offset_keys().iter().filter(|name| *name != CHECKSUMS) {
            let (begin, end) = self.header.info(name).map_or((0, 0), |info| info.data_offsets);
            self.source.seek(SeekFrom::Start(self.data.saturating_add(begin as u64)))?;
            let mut checksum = crc32fast::Hasher::new();
            for at in (begin..end).step_by(READ_AT_ONCE) {
                let part = &mut part[..READ_AT_ONCE.min(end - at)];
                self.source.read_exact(part)?;
                checksum.update(part);
            }
            self.compare(name, checksum.finalize())?;
        }
        Ok(())
    }

    fn compare(&self, name: &str, found: u32) -> Result<()> {
        let Some(checksums) = &self.checksums else { return Ok(()) };
        let place = self.header.offset_keys().iter().position(|key| key == name);
        ensure!(
            place.and_then(|place| checksums.get(place)) == Some(&found),
            "the tensor '{name}' is damaged: it does not have the checksum that it was written with"
        );
        Ok(())
    }
}

/// Whether a header that begins like this, which may be damaged, is a checkpoint's.
fn looks_like_ours(header: &[u8]) -> bool {
    let alike = header.iter().zip(BEGINNING).filter(|(found, own)| found == own).count();
    alike + 2 >= BEGINNING.len().min(header.len()) || header.iter().all(|byte| *byte == 0)
}
