//! How measurements are written: JSON objects, comma-separated values and Markdown tables.

use crate::gpu::Gpu;
use crate::support::file::write_atomically;
use anyhow::Result;
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;
use std::time::SystemTime;

/// What every result begins with: where, by what and when it was measured.
#[must_use]
pub fn circumstances(gpu: &Gpu) -> Value {
    let info = &gpu.info;
    json!({
        "adapter": info.name,
        "backend": format!("{:?}", info.backend),
        "driver": format!("{} {}", info.driver, info.driver_info).trim(),
        "version": env!("CARGO_PKG_VERSION"),
        "date": humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
    })
}

/// `first`'s entries, then those of `second`; both are objects.
#[must_use]
pub fn joined(mut first: Value, second: Value) -> Value {
    if let (Value::Object(all), Value::Object(more)) = (&mut first, second) {
        all.extend(more);
    }
    first
}

/// A text as a file.
///
/// # Errors
/// When the file cannot be written.
pub fn write_text(path: &Path, text: &str) -> Result<()> {
    write_atomically(path, |file| Ok(file.write_all(text.as_bytes())?))
}

/// A file of comma-separated values; they hold neither commas nor quotes but for those that [`quoted`] adds.
///
/// # Errors
/// When the file cannot be written.
pub fn write_csv(path: &Path, header: &str, rows: impl Iterator<Item = String>) -> Result<()> {
    let lines: Vec<_> = std::iter::once(header.to_owned()).chain(rows).collect();
    write_text(path, &(lines.join("\n") + "\n"))
}

/// A text as one value of a CSV file (RFC 4180).
#[must_use]
pub fn quoted(text: &str) -> String {
    if text.contains(['"', ',', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// A number, or nothing where it was not measured.
#[must_use]
pub fn optional<T: ToString>(value: Option<T>) -> String {
    value.map_or_else(String::new, |value| value.to_string())
}

/// A Markdown table whose columns line up.
#[must_use]
pub fn markdown(header: &[&str], rows: &[Vec<String>]) -> String {
    let cells =
        |column: usize| rows.iter().filter_map(move |row| row.get(column)).map(|cell| cell.chars().count());
    let widths: Vec<usize> = (header.iter().enumerate())
        .map(|(column, title)| cells(column).chain([title.chars().count(), 3]).max().unwrap_or(3))
        .collect();
    let line = |cells: &mut dyn Iterator<Item = String>| {
        let padded = cells.zip(&widths).enumerate().map(|(column, (cell, &width))| match column {
            0 => format!("{cell:width$}"),
            _ => format!("{cell:>width$}"),
        });
        format!("| {} |", padded.collect::<Vec<_>>().join(" | "))
    };
    let rule = |(column, &width): (usize, &usize)| match column {
        0 => "-".repeat(width),
        _ => format!("{}:", "-".repeat(width - 1)),
    };
    let mut lines = vec![
        line(&mut header.iter().map(|&title| title.to_owned())),
        line(&mut widths.iter().enumerate().map(rule)),
    ];
    lines.extend(rows.iter().map(|row| line(&mut row.iter().cloned())));
    lines.join("\n")
}
