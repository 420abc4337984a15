//! The folder that frames are rendered to, and `frames.json` in it, to which several processes may add at the same time.

use anyhow::{Context, Result, bail};
use nerf::support::file::{writable_folder, write_json};
use nerf::support::lock::{FolderLock, is_used, one_at_a_time};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The file that lists the frames.
const LISTING: &str = "frames.json";
/// Listing frames takes at most this part of the time, unless it takes less than [`SHORT`].
const MOST_SHARE: u32 = 20;
const SHORT: Duration = Duration::from_millis(20);

/// What becomes of the frames that are in a folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Earlier {
    /// There must not be any.
    Refused,
    /// They are replaced; those of the same rendering stay where they are not rendered again.
    Replaced,
    /// They are of the same rendering, and stay.
    Kept,
}

/// A folder that frames of one rendering are written to.
#[derive(Debug)]
pub(super) struct FrameFolder {
    path: PathBuf,
    lock: FolderLock,
    /// What all its frames have in common.
    rendering: Map<String, Value>,
    /// Frames that are whole but not listed yet.
    unlisted: Frames,
    /// When they were listed last, and how long that took.
    listed: (Instant, Duration),
}

/// Frames as they are listed, by their index.
type Frames = BTreeMap<u64, Value>;

impl FrameFolder {
    /// Takes the folder for frames of a `rendering`, whose description is what they have in common; the frames that are
    /// there already and stay.
    ///
    /// # Errors
    /// When it cannot be written to, another process has it for something else, or it holds what must not be mixed with
    /// them.
    pub(super) fn take(
        path: &Path,
        rendering: Map<String, Value>,
        earlier: Earlier,
    ) -> Result<(Self, Vec<u64>)> {
        writable_folder(path)?;
        one_at_a_time(path, || {
            let lock = if earlier == Earlier::Kept { FolderLock::shared } else { FolderLock::alone };
            let lock = lock(path)?;
            let folder = Self {
                path: path.to_owned(),
                lock,
                rendering,
                unlisted: Frames::new(),
                listed: (Instant::now(), Duration::ZERO),
            };
            let frames = folder.earlier_frames(earlier)?;
            folder.list(&frames)?;
            // Others with frames of the same rendering may join.
            folder.lock.share()?;
            Ok((folder, frames.into_keys().collect()))
        })
    }

    /// Whether nothing keeps other processes from mixing their files with these, since the file system has no locks.
    pub(super) fn is_unguarded(&self) -> bool {
        !self.lock.is_effective()
    }

    /// Pictures in the folder of no frame for which `is_ours`.
    pub(super) fn strangers(&self, is_ours: impl Fn(u64) -> bool) -> usize {
        let index = |path: &PathBuf| path.file_stem()?.to_str()?.split('_').next()?.parse().ok();
        self.pictures().iter().filter(|path| !index(path).is_some_and(&is_ours)).count()
    }

    /// Adds a frame whose files are whole.
    pub(super) fn add(&mut self, index: usize, mut frame: Value) -> Result<()> {
        frame["bytes"] = self.bytes(&frame).context("a frame's files have vanished")?.into();
        self.unlisted.insert(index as u64, frame);
        let (last, took) = self.listed;
        if took > SHORT && last.elapsed() < MOST_SHARE * took { Ok(()) } else { self.flush() }
    }

    /// Lists the frames that are whole.
    pub(super) fn flush(&mut self) -> Result<()> {
        let begin = Instant::now();
        one_at_a_time(&self.path, || {
            let listing = read(&self.path)?.unwrap_or_default();
            let is_mine = listing.is_empty() || differences(&listing, &self.rendering).is_empty();
            anyhow::ensure!(is_mine, "another process has replaced {}", self.path.join(LISTING).display());
            let mut frames = frames(&listing);
            frames.append(&mut self.unlisted.clone());
            self.list(&frames)
        })?;
        self.unlisted.clear();
        self.listed = (Instant::now(), begin.elapsed());
        Ok(())
    }

    fn list(&self, frames: &Frames) -> Result<()> {
        let mut listing = self.rendering.clone();
        listing.insert("frames".to_owned(), frames.values().cloned().collect());
        write_json(&self.path.join(LISTING), &listing)
    }

    /// The frames that stay; what does not is removed.
    fn earlier_frames(&self, earlier: Earlier) -> Result<Frames> {
        let show = self.path.display();
        let listing = match read(&self.path) {
            Err(_) if earlier == Earlier::Replaced => None,
            listing => listing.with_context(|| {
                format!("what is in {show} cannot be told; name another folder, or add --overwrite to replace the frames in it")
            })?,
        };
        let whole = |mut frames: Frames| {
            frames.retain(|_, frame| self.bytes(frame).is_some_and(|bytes| frame["bytes"] == bytes));
            frames
        };
        let Some(listing) = listing else {
            let used = is_used(&self.path)?;
            match earlier {
                Earlier::Refused if used => bail!(
                    "the folder {show} is not empty; name another one, or add --overwrite to replace the frames in it, \
                     or --skip-existing to go on with a path that was interrupted"
                ),
                Earlier::Kept if !self.pictures().is_empty() => bail!(
                    "the folder {show} has pictures but no {LISTING}, which would tell what they show; name another \
                     folder, or add --overwrite instead of --skip-existing to replace them"
                ),
                _ => return Ok(Frames::new()),
            }
        };
        let differences = differences(&listing, &self.rendering);
        let is_empty = frames(&listing).is_empty() && self.pictures().is_empty();
        match earlier {
            Earlier::Refused if !is_empty => bail!(
                "the folder {show} has frames already; name another one, or add --skip-existing to go on with them, or \
                 --overwrite to replace them"
            ),
            Earlier::Kept if !is_empty && !differences.is_empty() => bail!(
                "the frames in {show} are of another rendering, and must not be mixed with these: {}; name another \
                 folder, or add --overwrite instead of --skip-existing to replace them",
                differences.join("; ")
            ),
            _ if differences.is_empty() => return Ok(whole(frames(&listing))),
            _ => {}
        }
        for picture in self.pictures() {
            fs::remove_file(&picture).with_context(|| format!("removing {}", picture.display()))?;
        }
        Ok(Frames::new())
    }

    /// The files in the folder that are named like those of a frame.
    fn pictures(&self) -> Vec<PathBuf> {
        let entries = fs::read_dir(&self.path).into_iter().flatten().flatten();
        let is_picture = |path: &PathBuf| {
            let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or("");
            let index = stem.strip_suffix("_depth").unwrap_or(stem);
            let is_index = index.len() >= 4 && index.bytes().all(|digit| digit.is_ascii_digit());
            is_index && path.extension().is_some_and(|end| end == "png" || end == "exr")
        };
        entries.map(|entry| entry.path()).filter(is_picture).collect()
    }

    /// Bytes of a frame's files; `None` where one is not there.
    fn bytes(&self, frame: &Value) -> Option<u64> {
        let mut files = frame["files"].as_object()?.values();
        files.try_fold(0, |sum, file| Some(sum + fs::metadata(self.path.join(file.as_str()?)).ok()?.len()))
    }
}

/// What is listed in a folder, if there is a listing.
fn read(folder: &Path) -> Result<Option<Map<String, Value>>> {
    let path = folder.join(LISTING);
    let text = match fs::read_to_string(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        text => text.with_context(|| format!("reading {}", path.display()))?,
    };
    let listing = serde_json::from_str(&text).with_context(|| format!("reading {}", path.display()))?;
    Ok(Some(listing))
}

fn frames(listing: &Map<String, Value>) -> Frames {
    let frames = listing.get("frames").and_then(Value::as_array).into_iter().flatten();
    frames.filter_map(|frame| Some((frame["index"].as_u64()?, frame.clone()))).collect()
}

/// What two renderings do not have in common, in words.
fn differences(then: &Map<String, Value>, now: &Map<String, Value>) -> Vec<String> {
    let differs = |key: &str| then.get(key) != now.get(key);
    let mut told = Vec::new();
    if differs("field") {
        let of = |listing: &Map<String, Value>| {
            let text = |key| {
                listing.get(key).map_or("unknown".to_owned(), |value| value.to_string().replace('"', ""))
            };
            format!("step {} of {}", text("step"), text("checkpoint"))
        };
        told.push(format!("another field ({}, and now {})", of(then), of(now)));
    }
    if differs("cameras") {
        told.push("other cameras or sizes".to_owned());
    }
    let none = Map::new();
    let settings = |listing| Map::get(listing, "settings").and_then(Value::as_object).unwrap_or(&none);
    for (key, value) in settings(now) {
        match settings(then).get(key) {
            Some(earlier) if earlier == value => {}
            Some(earlier) => told.push(format!("{key} was {earlier}, and now it is {value}")),
            None => told.push(format!("it is not known whether {key} was {value}")),
        }
    }
    told
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn rendering(field: &str, background: &str) -> Map<String, Value> {
        let listing = json!({
            "checkpoint": "run/checkpoint.safetensors",
            "step": 7,
            "field": field,
            "cameras": "c",
            "settings": { "background": background },
        });
        listing.as_object().expect("an object").clone()
    }

    fn add(folder: &mut FrameFolder, index: usize) {
        let file = format!("{index:04}.png");
        fs::write(folder.path.join(&file), "a picture").expect("writable");
        folder.add(index, json!({ "index": index, "files": { "png": file } })).expect("listed");
    }

    fn listed(path: &Path) -> Vec<u64> {
        frames(&read(path).expect("readable").expect("there")).into_keys().collect()
    }

    fn complaint(path: &Path, rendering: Map<String, Value>, earlier: Earlier) -> String {
        format!("{:#}", FrameFolder::take(path, rendering, earlier).expect_err("refused"))
    }

    #[test]
    fn frames_of_one_rendering_come_together_and_others_are_refused() {
        let place = tempfile::tempdir().expect("temporary folder");
        let path = place.path().join("views");
        let black = || rendering("f", "black");
        let (mut one, kept) = FrameFolder::take(&path, black(), Earlier::Refused).expect("nothing is there");
        assert!(kept.is_empty() && !one.is_unguarded() && listed(&path).is_empty());
        add(&mut one, 3);
        let (mut other, kept) = FrameFolder::take(&path, black(), Earlier::Kept).expect("the same");
        assert_eq!(kept, [3]);
        add(&mut other, 12);
        add(&mut one, 4);
        assert_eq!(listed(&path), [3, 4, 12]);
        assert!(complaint(&path, black(), Earlier::Replaced).contains("is in use"));
        drop((one, other));
        let used = complaint(&path, black(), Earlier::Refused);
        assert!(used.contains("--overwrite") && used.contains("--skip-existing"), "{used}");
        let mixed = complaint(&path, rendering("g", "white"), Earlier::Kept);
        assert!(mixed.contains("another field") && mixed.contains("background was \"black\""), "{mixed}");
        fs::write(path.join("0004.png"), "a pic").expect("writable");
        let (one, kept) = FrameFolder::take(&path, black(), Earlier::Kept).expect("the same");
        assert_eq!((kept, listed(&path)), (vec![3, 12], vec![3, 12]), "4 is not whole");
        drop(one);
        FrameFolder::take(&path, rendering("g", "black"), Earlier::Replaced).expect("replaced");
        let left: Vec<_> =
            fs::read_dir(&path).expect("a folder").map(|e| e.expect("readable").file_name()).collect();
        assert_eq!(left, [LISTING], "no frame of another field, and no lock");
        FrameFolder::take(&path, black(), Earlier::Refused).expect("no frames are there");
    }

    #[test]
    fn pictures_that_nobody_listed_are_neither_kept_nor_removed() {
        let place = tempfile::tempdir().expect("temporary folder");
        let photo = place.path().join("0000.png");
        fs::write(&photo, "a photo").expect("writable");
        let again = || rendering("f", "black");
        assert!(complaint(place.path(), again(), Earlier::Refused).contains("is not empty"));
        assert!(complaint(place.path(), again(), Earlier::Kept).contains("no frames.json"));
        fs::write(place.path().join("0007_depth.png"), "a photo").expect("writable");
        let (folder, kept) = FrameFolder::take(place.path(), again(), Earlier::Replaced).expect("as asked");
        assert_eq!([0, 1, 8].map(|ours| folder.strangers(|index| index < ours)), [2, 1, 0]);
        assert!(kept.is_empty() && photo.exists());
        drop(folder);
        fs::write(place.path().join(LISTING), "{").expect("writable");
        let broken = complaint(place.path(), again(), Earlier::Kept);
        assert!(broken.contains("add --overwrite"), "{broken}");
    }
}
