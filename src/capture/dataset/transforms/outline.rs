//! Where in a document the frames are.

use anyhow::{Result, bail, ensure};
use serde_json::Value;

use crate::capture::dataset::json::{Fields, REMEDY, describe, shortened};
use crate::photo::Split;

/// Some frames of a document.
pub(super) struct Section<'a> {
    /// The split that the place of the frames stands for.
    pub(super) split: Option<Split>,
    /// The objects around the frames, innermost first.
    pub(super) around: Vec<Fields<'a>>,
    /// The frames, each with its key where they are not a list.
    pub(super) frames: Vec<(Option<&'a str>, &'a Value)>,
}

/// The frames of a document: the list or object `frames`, ScanNet++'s `test_frames` beside it, the same one
/// object further inside, or a document that is nothing but the list.
pub(super) fn sections(document: &Value) -> Result<Vec<Section<'_>>> {
    let map = match document {
        Value::Array(list) if list.first().is_some_and(Value::is_object) => {
            return Ok(vec![Section { split: None, around: Vec::new(), frames: frames(document, "")? }]);
        }
        Value::Object(map) => map,
        other => {
            bail!("expected a JSON object with a list `frames`, found {}; name another file", describe(other))
        }
    };
    let file = Fields(map);
    let mut found = within(file, &[])?;
    if found.is_empty() {
        for (key, inner) in map {
            if let Value::Object(inner) = inner {
                let inner = within(Fields(inner), &[file])?;
                found.extend(
                    inner
                        .into_iter()
                        .map(|section| Section { split: section.split.or(named(key)), ..section }),
                );
            }
        }
    }
    if found.is_empty() {
        let keys: Vec<_> = map.keys().take(8).map(|key| shortened(key)).collect();
        bail!(
            "expected a transforms.json with a list `frames`, found {}; name another file",
            if keys.is_empty() {
                "no key at all".to_owned()
            } else {
                format!("the keys {}", keys.join(", "))
            }
        );
    }
    ensure!(
        found.iter().any(|section| !section.frames.is_empty()),
        "`frames` is empty; expected at least one frame, so register the images and export again"
    );
    Ok(found)
}

/// The frames that are directly in an object.
fn within<'a>(object: Fields<'a>, outer: &[Fields<'a>]) -> Result<Vec<Section<'a>>> {
    let around = || std::iter::once(object).chain(outer.iter().copied()).collect();
    let mut sections = Vec::new();
    if let Some(value) = object.get("frames") {
        sections.push(Section { split: None, around: around(), frames: frames(value, "frames")? });
    }
    let is_list = |value: &&Value| value.as_array().is_some_and(|list| list.iter().any(Value::is_object));
    if let Some(value) = object.get("test_frames").filter(is_list) {
        for section in &mut sections {
            section.split = Some(Split::Train);
        }
        let frames = frames(value, "test_frames")?;
        sections.push(Section { split: Some(Split::Test), around: around(), frames });
    }
    Ok(sections)
}

fn frames<'a>(value: &'a Value, key: &str) -> Result<Vec<(Option<&'a str>, &'a Value)>> {
    match value {
        Value::Array(list) => Ok(list.iter().map(|frame| (None, frame)).collect()),
        Value::Object(map) => Ok(map.iter().map(|(name, frame)| (Some(name.as_str()), frame)).collect()),
        other => bail!("`{key}` must be a list, found {}; {REMEDY}", describe(other)),
    }
}

fn named(key: &str) -> Option<Split> {
    match key {
        "train" | "training" => Some(Split::Train),
        "val" | "validation" => Some(Split::Val),
        "test" | "eval" => Some(Split::Test),
        _ => None,
    }
}
