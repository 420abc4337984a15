//! Files that are wrong, and exactly what is said about each.
//!
//! `tests/malformed/messages.txt` has a line `name | severity: message` for every remark about
//! `tests/malformed/name.json`, in the order of the names.

use std::fmt::Write;
use std::path::Path;

use crate::support::files;
use nerf::capture::dataset::transforms;
use nerf::capture::diagnostics::Severity;

/// What is said about one file, a line per remark.
fn remarks(name: &str, bytes: &[u8]) -> String {
    let lines: Vec<String> = match transforms::parse_bytes(bytes) {
        Err(error) => vec![format!("error: {error:#}")],
        Ok(listing) => {
            let severity = |severity| match severity {
                Severity::Note => "note",
                Severity::Warning => "warning",
                Severity::Error => "error",
            };
            let notes = listing.notes();
            notes.iter().map(|note| format!("{}: {note}", severity(note.severity))).collect()
        }
    };
    assert!(!lines.is_empty(), "{name}: nothing is said");
    lines.iter().fold(String::new(), |mut text, line| {
        writeln!(text, "{name} | {line}").expect("a string grows");
        text
    })
}

#[test]
fn every_mistake_is_explained() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/malformed");
    let files = files(&folder, "json");
    assert!(files.len() >= 40, "{} files", files.len());
    let mut found = String::new();
    for path in files {
        let name = path.file_stem().expect("a name").to_string_lossy();
        found += &remarks(&name, &std::fs::read(&path).expect("readable"));
    }
    let expected = std::fs::read_to_string(folder.join("messages.txt")).expect("committed");
    for (expected, found) in expected.lines().zip(found.lines()) {
        assert_eq!(expected, found);
    }
    assert_eq!(expected, found);
}
