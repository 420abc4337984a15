//! NumPy's `.npy`: one array of numbers.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};

use super::check_size;

pub(super) const MAGIC: &[u8] = b"\x93NUMPY";
const UNFINISHED: &str = "the file ends before its numbers do; copy it again";
/// Most bytes of a header.
const MOST_HEADER: usize = 1 << 16;

/// An array of one number per pixel.
#[derive(Debug)]
pub(super) struct Array {
    pub(super) width: u32,
    pub(super) height: u32,
    /// Row by row; the largest that whole numbers of its kind can be is infinite.
    pub(super) values: Vec<f32>,
    /// Bytes of a whole number; `None` of floats.
    pub(super) integer_bytes: Option<usize>,
}

/// Reads an array of two axes, or of one more with a single entry.
pub(super) fn load(path: &Path) -> Result<Array> {
    let file = File::open(path)?;
    let bytes_in_file = file.metadata()?.len();
    let mut reader = BufReader::new(file);
    let header = header(&mut reader)?;
    let text = |key: &str| {
        let rest = header.split_once(&format!("'{key}':")).map(|(_, rest)| rest.trim_start());
        rest.with_context(|| {
            format!("the header of the .npy file has no {key}; save it again with numpy.save")
        })
    };
    let kind = text("descr")?;
    let kind = kind.strip_prefix('\'').and_then(|kind| kind.split('\'').next()).unwrap_or(kind);
    let number = number(kind).with_context(|| {
        format!(
            "expected numbers of float32, float64, uint16 or the like, found {kind}; save depth.astype('<f4')"
        )
    })?;
    ensure!(
        text("fortran_order")?.starts_with("False"),
        "expected an array row by row, found one column by column; save numpy.ascontiguousarray(depth)"
    );
    let shape = text("shape")?;
    let shape = shape.strip_prefix('(').and_then(|shape| shape.split(')').next()).unwrap_or_default();
    let axes: Vec<u64> = shape.split(',').filter_map(|axis| axis.trim().parse().ok()).collect();
    let (height, width) = match axes[..] {
        [height, width] | [height, width, 1] | [1, height, width] => (height, width),
        _ => bail!("expected an array of height x width, found one of ({shape}); save depth alone"),
    };
    check_size(width, height)?;
    let length = (width * height) as usize * number.bytes;
    ensure!(length as u64 <= bytes_in_file, UNFINISHED);
    let mut bytes = vec![0; length];
    reader.read_exact(&mut bytes).context(UNFINISHED)?;
    let values = bytes.chunks_exact(number.bytes).map(number.read).collect();
    let integer_bytes = number.is_integer.then_some(number.bytes);
    Ok(Array { width: width as u32, height: height as u32, values, integer_bytes })
}

/// The header's text, which is a literal of Python.
fn header(reader: &mut impl Read) -> Result<String> {
    let mut begin = [0; 8];
    reader.read_exact(&mut begin)?;
    let mut length = vec![0; if begin[6] == 1 { 2 } else { 4 }];
    reader.read_exact(&mut length)?;
    let length = length.iter().rev().fold(0, |sum, &byte| sum * 256 + usize::from(byte));
    ensure!(length <= MOST_HEADER, "the header of the .npy file is damaged; save it again with numpy.save");
    let mut header = vec![0; length];
    reader.read_exact(&mut header).context("the file ends within its header; copy it again")?;
    Ok(String::from_utf8_lossy(&header).replace('"', "'"))
}

/// How a number is stored.
struct Number {
    bytes: usize,
    is_integer: bool,
    read: fn(&[u8]) -> f32,
}

/// The numbers of a kind that are read, low bytes first.
fn number(kind: &str) -> Option<Number> {
    macro_rules! number {
        ($kind:ty, $is_integer:literal, $convert:expr) => {{
            let read: fn(&[u8]) -> f32 = |bytes| {
                // A chunk has as many bytes as the number.
                let value = bytes.try_into().map(<$kind>::from_le_bytes).unwrap_or_default();
                $convert(value)
            };
            Number { bytes: size_of::<$kind>(), is_integer: $is_integer, read }
        }};
    }
    macro_rules! integer {
        ($kind:ty) => {
            number!($kind, true, |value| if value == <$kind>::MAX { f32::INFINITY } else { value as f32 })
        };
    }
    Some(match kind {
        "<f2" => number!(u16, false, |bits| exr::prelude::f16::from_bits(bits).to_f32()),
        "<f4" => number!(f32, false, |value| value),
        "<f8" => number!(f64, false, |value| value as f32),
        "|u1" => integer!(u8),
        "<u2" => integer!(u16),
        "<i2" => integer!(i16),
        "<u4" => integer!(u32),
        "<i4" => integer!(i32),
        "<i8" => integer!(i64),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What comes of an array with these keys.
    fn read(header: &str, numbers: &[u8]) -> Result<Array> {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("depth.npy");
        let length = (header.len() as u16).to_le_bytes();
        let file = [MAGIC, &[1, 0], &length, header.as_bytes(), numbers].concat();
        std::fs::write(&path, file).expect("writable");
        load(&path)
    }

    #[test]
    fn arrays_of_one_number_per_pixel_are_read() {
        let floats: Vec<u8> = [0.5_f32, 2.0].iter().flat_map(|value| value.to_le_bytes()).collect();
        let array = read("{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2), }\n", &floats);
        let array = array.expect("readable");
        assert_eq!((array.width, array.height, array.integer_bytes), (2, 1, None));
        assert_eq!(array.values, [0.5, 2.0]);
        let double = 1e10_f64.to_le_bytes();
        let array = read("{'descr': '<f8', 'fortran_order': False, 'shape': (1, 1, 1), }", &double);
        assert_eq!(array.expect("readable").values, [1e10]);
        let steps: Vec<u8> = [1500_u16, 0, 65535, 7].iter().flat_map(|value| value.to_le_bytes()).collect();
        let array = read("{'shape': (2, 2), 'fortran_order': False, 'descr': '<u2'}", &steps);
        let array = array.expect("readable");
        assert_eq!(
            (array.integer_bytes, &array.values[..]),
            (Some(2), &[1500.0, 0.0, f32::INFINITY, 7.0][..])
        );
    }

    #[test]
    fn other_arrays_are_named() {
        let told =
            |header: &str, numbers: &[u8]| format!("{:#}", read(header, numbers).expect_err("refused"));
        let usual = "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2), }";
        assert!(told(usual, &[0; 7]).contains("ends before its numbers do"));
        assert!(told(&usual.replace("<f4", ">f4"), &[0; 8]).contains("found >f4; save depth.astype('<f4')"));
        assert!(told(&usual.replace("<f4", "|O"), &[0; 8]).contains("found |O"));
        assert!(told(&usual.replace("False", "True"), &[0; 8]).contains("column by column"));
        assert!(told(&usual.replace("1, 2", "2, 2, 3"), &[0; 48]).contains("found one of (2, 2, 3)"));
        assert!(told(&usual.replace("1, 2", "9000000, 9000000"), &[]).contains("9000000"));
        assert!(told("{}", &[]).contains("no descr"));
    }
}
