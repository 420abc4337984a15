//! What a run that goes on does not take from the command line and the files around it, though it was stated.

use super::Train;
use crate::commands::Session;
use nerf::capture::dataset::Dataset;
use nerf::field::checkpoint::Metadata;
use nerf::run::RunFolder;
use serde_json::Value;

/// Says it. `earlier` is what the checkpoint says, `now` how the run goes on.
pub(super) fn say(
    args: &Train,
    (earlier, now): (&Metadata, &Metadata),
    dataset: &Dataset,
    folder: &RunFolder,
    session: &Session<'_>,
) {
    let note = |text: &str| session.console.say(&format!("note: {text}"));
    if earlier.contents.is_none() {
        note(
            "the checkpoint is from before datasets were known by their contents; names, sizes and the distance of the cameras are compared",
        );
    }
    let test: Vec<_> = dataset.test.iter().map(|&index| &dataset.frames[index].name).collect();
    if args.hold_out.is_some() && !test.into_iter().eq(&earlier.splits.test) {
        let count = earlier.splits.test.len();
        note(&format!(
            "--hold-out has no effect on --resume; the run keeps its own test views, {count} of them"
        ));
    }
    let [then, found] = [&earlier.bounds, &dataset.bounds];
    let is_same_box = found.center.distance(then.center) < 0.01 * then.half
        && (found.half - then.half).abs() < 0.01 * then.half
        && found.cascades == then.cascades;
    if args.hold_out.is_none() && !is_same_box {
        note(&format!(
            "the dataset's scene box is another one now; the run keeps its own, centre {:.4}, half side {:.4}",
            then.center,
            then.outer_half()
        ));
    }
    let differences = folder.config().map_or(Vec::new(), |file| edits(&file, earlier, now));
    if let Some((first, rest)) = differences.split_first() {
        let path = folder.path().join(RunFolder::CONFIG);
        let further = if rest.is_empty() { String::new() } else { format!(", and {} more", rest.len()) };
        note(&format!(
            "{0} is not read on --resume, and differs from the run: {first}{further}; add --config {0} to change them",
            path.display()
        ));
    }
}

/// The settings of a file that are neither those of the checkpoint nor those that the run goes on with.
fn edits(file: &str, earlier: &Metadata, now: &Metadata) -> Vec<String> {
    let value = |metadata: &Metadata| serde_json::to_value(&*metadata.config).unwrap_or_default();
    let mut found = Vec::new();
    match serde_json::from_str(file) {
        Ok(file) => compare("", &file, &value(earlier), &value(now), &mut found),
        Err(_) => found.push("it is not JSON".to_owned()),
    }
    found
}

fn compare(path: &str, file: &Value, earlier: &Value, now: &Value, found: &mut Vec<String>) {
    if let (Value::Object(settings), false) = (file, path.contains('.')) {
        for (key, value) in settings {
            let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
            compare(&path, value, &earlier[key], &now[key], found);
        }
    } else if !is_same(file, earlier) && !is_same(file, now) {
        found.push(format!("{path} is {file} there and {now} in the run"));
    }
}

/// Whether two settings are equal, 1 and 1.0 too.
fn is_same(one: &Value, other: &Value) -> bool {
    one == other || one.as_f64().zip(other.as_f64()).is_some_and(|(one, other)| one == other)
}
