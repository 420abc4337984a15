//! Point clouds in PLY files, text or binary of either byte order: where their points are, a sample of many.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::str::SplitAsciiWhitespace;

use anyhow::{Context, Result, bail, ensure};
use glam::DVec3;

/// Of more points than this, every so many-th is read.
const MOST_POINTS: u64 = 50_000;
/// No line of a header or of a text is longer, in bytes.
const LONGEST_LINE: u64 = 1 << 16;
/// No header has more lines.
const MOST_LINES: usize = 1000;

/// The positions of a file's vertices in its own coordinates, evenly spaced in their order; those that are not finite
/// are left out.
///
/// # Errors
/// When the file cannot be read, is no PLY file with vertices, or ends before the last of them.
pub(super) fn positions(path: &Path) -> Result<Vec<DVec3>> {
    let read = || -> Result<Vec<DVec3>> {
        let mut reader = BufReader::new(File::open(path)?);
        let Header { encoding, elements } = Header::read(&mut reader)?;
        let mut body = Body { reader, encoding };
        for element in &elements {
            if element.name == "vertex" {
                return body.vertices(element).context("its vertices cannot be read; export the cloud again");
            }
            body.skip(element, element.count)?;
        }
        bail!("expected an element `vertex`, found none")
    };
    read().with_context(|| format!("reading {}", path.display()))
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

#[derive(Debug)]
struct Header {
    encoding: Encoding,
    elements: Vec<Element>,
}

#[derive(Debug)]
struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

#[derive(Debug)]
struct Property {
    name: String,
    kind: Kind,
    /// That of the length before the values of a list.
    length: Option<Kind>,
}

/// A kind of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Signed(usize),
    Unsigned(usize),
    Float(usize),
}

impl Kind {
    fn of(name: &str) -> Result<Self> {
        Ok(match name {
            "char" | "int8" => Self::Signed(1),
            "short" | "int16" => Self::Signed(2),
            "int" | "int32" => Self::Signed(4),
            "uchar" | "uint8" => Self::Unsigned(1),
            "ushort" | "uint16" => Self::Unsigned(2),
            "uint" | "uint32" => Self::Unsigned(4),
            "float" | "float32" => Self::Float(4),
            "double" | "float64" => Self::Float(8),
            other => bail!("expected a kind of numbers, found `{}`", other.escape_debug()),
        })
    }

    fn bytes(self) -> usize {
        let (Self::Signed(bytes) | Self::Unsigned(bytes) | Self::Float(bytes)) = self;
        bytes
    }

    /// The number in so many bytes, the least first.
    fn value(self, bytes: [u8; 8]) -> f64 {
        let low = u64::from_le_bytes(bytes);
        match self {
            Self::Float(4) => f64::from(f32::from_bits(low as u32)),
            Self::Float(_) => f64::from_bits(low),
            Self::Unsigned(_) => low as f64,
            Self::Signed(bytes) => {
                let unused = 64 - 8 * bytes as u32;
                ((low << unused) as i64 >> unused) as f64
            }
        }
    }
}

impl Header {
    fn read(reader: &mut impl BufRead) -> Result<Self> {
        ensure!(line(reader)?.trim_end() == "ply", "expected a PLY file, which begins with `ply`");
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        for _ in 0..MOST_LINES {
            let text = line(reader)?;
            let mut words = text.split_ascii_whitespace();
            match words.next() {
                Some("format") => encoding = Some(encoding_of(words.next().unwrap_or(""))?),
                Some("element") => {
                    let (name, count) =
                        words.next().zip(words.next()).context("an element without a count")?;
                    let count = count.parse().context("an element's count is no number")?;
                    elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
                }
                Some("property") => {
                    let element = elements.last_mut().context("a property before any element")?;
                    element.properties.push(Property::read(&mut words)?);
                }
                Some("end_header") => {
                    let encoding = encoding.context("its header has no line `format`")?;
                    return Ok(Self { encoding, elements });
                }
                // Comments, and what exporters invent.
                _ => {}
            }
        }
        bail!("expected a line `end_header`, found none in {MOST_LINES} lines")
    }
}

fn encoding_of(name: &str) -> Result<Encoding> {
    Ok(match name {
        "ascii" => Encoding::Text,
        "binary_little_endian" => Encoding::LittleEndian,
        "binary_big_endian" => Encoding::BigEndian,
        other => bail!(
            "expected the format ascii, binary_little_endian or binary_big_endian, found `{}`",
            other.escape_debug()
        ),
    })
}

impl Property {
    fn read(words: &mut SplitAsciiWhitespace<'_>) -> Result<Self> {
        let mut word = || words.next().context("a property without a kind or a name");
        let first = word()?;
        let (length, kind) = match first {
            "list" => (Some(Kind::of(word()?)?), Kind::of(word()?)?),
            kind => (None, Kind::of(kind)?),
        };
        Ok(Self { name: word()?.to_owned(), kind, length })
    }
}

impl Element {
    /// Bytes of each, where all have as many.
    fn stride(&self) -> Option<u64> {
        let is_even = self.properties.iter().all(|property| property.length.is_none());
        is_even.then(|| self.properties.iter().map(|property| property.kind.bytes() as u64).sum())
    }
}

/// What follows the header.
#[derive(Debug)]
struct Body {
    reader: BufReader<File>,
    encoding: Encoding,
}

impl Body {
    fn vertices(&mut self, element: &Element) -> Result<Vec<DVec3>> {
        let place = |name: &str| element.properties.iter().position(|p| p.name == name && p.length.is_none());
        let [x, y, z] = ["x", "y", "z"].map(place);
        let (Some(x), Some(y), Some(z)) = (x, y, z) else { bail!("expected properties x, y and z") };
        let every = element.count.div_ceil(MOST_POINTS).max(1);
        let mut positions = Vec::new();
        let mut values = Vec::new();
        for index in 0..element.count.div_ceil(every) {
            self.next(element, &mut values)?;
            let position = DVec3::new(values[x], values[y], values[z]);
            positions.extend(Some(position).filter(|position| position.is_finite()));
            self.skip(element, (every - 1).min(element.count - index * every - 1))?;
        }
        Ok(positions)
    }

    fn skip(&mut self, element: &Element, count: u64) -> Result<()> {
        if let Some(stride) = element.stride().filter(|_| self.encoding != Encoding::Text) {
            return self.pass(count.saturating_mul(stride));
        }
        // Nothing stands for what has no properties.
        let count = if element.properties.is_empty() { 0 } else { count };
        let mut values = Vec::new();
        (0..count).try_for_each(|_| self.next(element, &mut values))
    }

    fn pass(&mut self, bytes: u64) -> Result<()> {
        let bytes = i64::try_from(bytes).context("it ends before its last element")?;
        Ok(self.reader.seek_relative(bytes)?)
    }

    /// One number per property of the next element; of lists, their length.
    fn next(&mut self, element: &Element, values: &mut Vec<f64>) -> Result<()> {
        values.clear();
        if self.encoding == Encoding::Text {
            let text = line(&mut self.reader)?;
            let mut words = text.split_ascii_whitespace();
            for Property { length, .. } in &element.properties {
                let value: f64 = words.next().context("a line with too few numbers")?.parse()?;
                let passed = if length.is_some() { value as usize } else { 0 };
                ensure!(passed == 0 || words.nth(passed - 1).is_some(), "a line with too few numbers");
                values.push(value);
            }
            return Ok(());
        }
        for Property { kind, length, .. } in &element.properties {
            let value = self.number(length.unwrap_or(*kind))?;
            if length.is_some() {
                ensure!(value >= 0.0, "a list of {value} numbers");
                self.pass((value as u64).saturating_mul(kind.bytes() as u64))?;
            }
            values.push(value);
        }
        Ok(())
    }

    fn number(&mut self, kind: Kind) -> Result<f64> {
        let mut bytes = [0; 8];
        let used = &mut bytes[..kind.bytes()];
        self.reader.read_exact(used)?;
        if self.encoding == Encoding::BigEndian {
            used.reverse();
        }
        Ok(kind.value(bytes))
    }
}

/// The next line; an error at the end of the file.
fn line(reader: &mut impl BufRead) -> Result<String> {
    let mut bytes = Vec::new();
    reader.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut bytes)?;
    ensure!(bytes.last() == Some(&b'\n') || (bytes.len() as u64) < LONGEST_LINE, "a line without an end");
    ensure!(!bytes.is_empty(), "it ends too early");
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

#[cfg(test)]
mod tests;
