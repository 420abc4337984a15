//! Paths that are no dataset, though one may take them for one: what they are, and the command that leads to one.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use anyhow::{Error, anyhow};

use super::file_names::{is_picture, natural_order};
use crate::capture::image_file::{Foreign, Header};
use crate::support::format::{count, few};
use crate::support::remedy::{Advised, Remedy};

/// Files that list a dataset.
const LISTS: [&str; 4] =
    ["transforms.json", "transforms_train.json", "transforms_val.json", "transforms_test.json"];
/// Files of a COLMAP model that alone tell it.
const COLMAP: [&str; 2] = ["images.bin", "images.txt"];
/// Where COLMAP models lie in a folder of a project.
const COLMAP_FOLDERS: [&str; 8] =
    [".", "0", "sparse/0", "sparse", "colmap/sparse/0", "colmap/sparse", "colmap", "dense/sparse"];
/// Of an archive, so many bytes at its end are looked at for its names.
const TABLE: u64 = 4 << 20;
/// Most folders within or beside that are looked into.
const MOST_FOLDERS: usize = 200;

/// What a file is that lists no dataset; `None` where it may be one that does.
pub(super) fn file(path: &Path) -> Option<Error> {
    let show = path.display();
    let name = path.file_name()?.to_string_lossy().to_lowercase();
    if Header::read(path).is_ok() {
        let text = format!("{show} is a single picture; expected a folder of photos with their poses: ");
        return Some(Advised::new(text, Remedy::FindPoses { photos: parent(path) }, "").into());
    }
    let mut head = Vec::new();
    File::open(path).ok()?.take(300).read_to_end(&mut head).ok()?;
    if head.starts_with(b"PK\x03\x04") {
        return Some(zip(path));
    }
    if let Some(unpack) = unpacking(path, &head) {
        return Some(anyhow!(
            "{show} is an archive; expected a folder with a transforms.json; run `{unpack}`"
        ));
    }
    if head.starts_with(b"\x93NUMPY") {
        let what = if name.contains("poses_bounds") { "poses of LLFF" } else { "a NumPy array" };
        return Some(anyhow!("{show} has {what}, not a transforms.json; {LLFF}"));
    }
    if head.starts_with(b"SQLite format 3") || name.ends_with(".bin") && COLMAP_FILES.contains(&name.as_str())
    {
        let text = format!("{show} belongs to COLMAP, whose models are not read: ");
        return Some(Advised::new(text, Remedy::ConvertColmap { model: parent(path) }, "").into());
    }
    if head.starts_with(b"ply\n") || head.starts_with(b"ply\r") {
        return Some(anyhow!(
            "{show} is a point cloud or a mesh (PLY); expected photos with poses: a transforms.json"
        ));
    }
    if name.ends_with(".safetensors") {
        return Some(anyhow!(
            "{show} is a checkpoint; expected a dataset; render it with `nerf render {}`",
            quoted(path)
        ));
    }
    match Foreign::of(path).ok()?.what {
        "a video" => {
            let text = format!("{show} is a video; expected a folder of photos with their poses: ");
            Some(Advised::new(text, Remedy::FindPosesOfVideo { video: quoted(path) }, "").into())
        }
        // Those, the reader of JSON explains itself.
        "an empty file" | "text in place of the picture" | "a web page in place of the picture" => None,
        what if what.starts_with("bytes") || what.contains("pointer") => None,
        what => Some(anyhow!("{show} is {what}; expected a transforms.json, or a folder with one")),
    }
}

const COLMAP_FILES: [&str; 4] = ["cameras.bin", "images.bin", "points3d.bin", "rigs.bin"];
const LLFF: &str = "convert it first: torch-ngp's `llff2nerf.py FOLDER` writes a transforms.json";

/// What a ZIP archive has, by the names in it.
fn zip(path: &Path) -> Error {
    let (show, names) = (path.display(), zip_names(path).unwrap_or_default());
    if !names.is_empty() && names.iter().all(|name| name.ends_with(".npy")) {
        return anyhow!(
            "{show} is a NumPy archive ({}), which is not read; write its pictures as PNG and its poses as a \
             transforms.json with `file_path` and `transform_matrix` (camera-to-world) for each",
            few(&names)
        );
    }
    let folder = path.with_extension("");
    let list = names.iter().find(|name| LISTS.iter().any(|list| name.rsplit('/').next() == Some(list)));
    let inner =
        list.and_then(|list| list.rsplit_once('/')).map_or(folder.clone(), |(inner, _)| folder.join(inner));
    let what = if list.is_some() { "a dataset in a ZIP archive" } else { "a ZIP archive" };
    anyhow!(
        "{show} is {what}; expected a folder; run `unzip -q {} -d {} && nerf train {}`",
        quoted(path),
        quoted(&folder),
        quoted(&inner)
    )
}

/// The names in a ZIP archive, as the table at its end has them.
fn zip_names(path: &Path) -> Option<Vec<String>> {
    let mut file = File::open(path).ok()?;
    let length = file.metadata().ok()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(TABLE))).ok()?;
    let mut end = Vec::new();
    file.take(TABLE).read_to_end(&mut end).ok()?;
    let mut names = Vec::new();
    for at in 0..end.len().saturating_sub(46) {
        let entry = &end[at..];
        if entry.starts_with(b"PK\x01\x02") {
            let length = usize::from(u16::from_le_bytes([entry[28], entry[29]]));
            names.extend(entry.get(46..46 + length).map(|name| String::from_utf8_lossy(name).into_owned()));
        }
    }
    Some(names)
}

/// The command that unpacks an archive, if it is one, and trains on what comes out.
fn unpacking(path: &Path, head: &[u8]) -> Option<String> {
    let name = path.file_name()?.to_string_lossy().into_owned();
    let lower = name.to_lowercase();
    let stem =
        ["tar.gz", "tar.xz", "tar.bz2", "tar.zst", "tar", "tgz", "txz", "tbz2", "7z", "rar", "gz", "xz"]
            .iter()
            .find_map(|end| lower.strip_suffix(end)?.strip_suffix('.').map(|stem| &name[..stem.len()]));
    let folder = quoted(&path.with_file_name(stem.filter(|stem| !stem.is_empty()).unwrap_or("unpacked")));
    let archive = quoted(path);
    let is_packed =
        [&b"\x1f\x8b"[..], b"\xfd7zXZ", b"BZh", b"\x28\xb5\x2f\xfd"].iter().any(|m| head.starts_with(m));
    let unpack = if head.get(257..262) == Some(b"ustar") || is_packed {
        format!("mkdir -p {folder} && tar -xf {archive} -C {folder}")
    } else if head.starts_with(b"7z\xbc\xaf\x27\x1c") {
        format!("7z x {archive} -o{folder}")
    } else if head.starts_with(b"Rar!") {
        format!("unrar x {archive} {folder}/")
    } else {
        return None;
    };
    Some(format!("{unpack} && nerf train {folder}"))
}

/// Why a path that is not there is none, with what is there by a like name.
pub(super) fn nowhere(path: &Path) -> Error {
    let show = path.display();
    let archive = ["zip", "tar", "tar.gz", "tgz", "7z", "npz"].iter().find_map(|end| {
        let archive = PathBuf::from(format!("{}.{end}", show.to_string().trim_end_matches('/')));
        archive.is_file().then(|| file(&archive)).flatten()
    });
    match archive {
        Some(archive) => anyhow!("{show} does not exist, but {archive}"),
        None => anyhow!("{show} does not exist; expected a folder with a transforms.json, or a .json file"),
    }
}

/// What a folder is that has no list of a dataset.
pub(super) fn folder(path: &Path) -> Error {
    let show = path.display();
    let expected = format!("expected transforms.json or transforms_train.json in {show}");
    let is_there = |name: &str| path.join(name).exists();
    if is_there("checkpoint.safetensors") || (is_there("config.json") && is_there("log.jsonl")) {
        let run = quoted(path);
        return anyhow!(
            "{show} is the folder of a training run, not a dataset; name the dataset that it was trained on, or use the \
             run: `nerf render {run}`, `nerf eval {run}`"
        );
    }
    let names = names(path);
    let inner = datasets(path, &names);
    if let Some(first) = inner.first() {
        let shown: Vec<_> = inner.iter().map(|folder| folder.display().to_string()).collect();
        return anyhow!(
            "{expected}, found none there but in {}; run `nerf train {}`",
            few(&shown),
            quoted(first)
        );
    }
    let lists: Vec<_> = names.iter().filter(|name| name.to_lowercase().ends_with(".json")).collect();
    if !lists.is_empty() {
        return anyhow!("{expected}, found {}; name the file itself", few(&lists));
    }
    let outer = outer(path);
    if let Some(dataset) = outer.as_ref().filter(|outer| is_dataset(outer)) {
        let name = dataset.display();
        return anyhow!("{expected}, found none there but in {name}; run `nerf train {}`", quoted(dataset));
    }
    let has_model = |folder: &&&str| COLMAP.iter().any(|name| is_there(&format!("{folder}/{name}")));
    if let Some(model) = COLMAP_FOLDERS.iter().find(has_model) {
        // Tools count relative paths from other folders.
        let model = if *model == "." { path.to_owned() } else { path.join(model) };
        let model = model.canonicalize().unwrap_or(model);
        let text = format!("{expected}, found a COLMAP model, which is not read: ");
        return Advised::new(text, Remedy::ConvertColmap { model: quoted(&model) }, "").into();
    }
    if is_there("poses_bounds.npy") {
        return anyhow!("{expected}, found poses_bounds.npy, the poses of LLFF, which are not read; {LLFF}");
    }
    let beside = outer.and_then(|outer| only_dataset(&outer));
    contents(path, &names, &expected, beside)
}

/// What to make of what is in a folder without any poses; the dataset beside it may be of another scene.
fn contents(path: &Path, names: &[String], expected: &str, beside: Option<PathBuf>) -> Error {
    let ends = |ends: &[&str]| {
        let is_so = |name: &&String| ends.iter().any(|end| name.to_lowercase().ends_with(end));
        names.iter().find(is_so).map(|name| path.join(name))
    };
    let archive = ends(&[".zip", ".tar", ".tar.gz", ".tgz", ".7z", ".rar", ".npz"]);
    if let Some(error) = archive.and_then(|archive| file(&archive)) {
        return anyhow!("{expected}, found none; {error}");
    }
    let inner = ["images", "rgb", "input", "train"].map(|name| path.join(name));
    let folders = std::iter::once(path.to_owned()).chain(inner);
    let pictures = |folder: &Path| self::names(folder).iter().filter(|name| is_picture(name)).count();
    if let Some((folder, number)) =
        folders.map(|folder| (folder.clone(), pictures(&folder))).find(|(_, number)| *number > 0)
    {
        let theirs =
            beside.map(|dataset| format!("; if {} lists them, run `nerf train {0}`", quoted(&dataset)));
        let text = format!("{expected}, found {} and no poses: ", count(number, "picture"));
        let remedy = Remedy::FindPoses { photos: quoted(&folder) };
        return Advised::new(text, remedy, theirs.unwrap_or_default()).into();
    }
    if let Some(video) = ends(&[".mp4", ".mov", ".mkv", ".avi", ".webm", ".m4v"]) {
        let text = format!("{expected}, found a video: ");
        return Advised::new(text, Remedy::FindPosesOfVideo { video: quoted(&video) }, "").into();
    }
    let found = if names.is_empty() { "an empty folder".to_owned() } else { few(names) };
    if let Some(dataset) = beside {
        let command = quoted(&dataset);
        return anyhow!(
            "{expected}, found {found}; if {} beside it is meant, run `nerf train {command}`",
            dataset.display()
        );
    }
    anyhow!(
        "{expected}, found {found} and no .json file; convert your photos with COLMAP and one of its exporters"
    )
}

/// The datasets in a folder.
fn datasets(path: &Path, names: &[String]) -> Vec<PathBuf> {
    let inner = names.iter().take(MOST_FOLDERS).map(|name| path.join(name));
    inner.filter(|folder| is_dataset(folder)).collect()
}

fn is_dataset(folder: &Path) -> bool {
    LISTS.iter().any(|list| folder.join(list).is_file())
}

/// The folder that a folder is in.
fn outer(path: &Path) -> Option<PathBuf> {
    let is_named =
        path.file_name().is_some() && path.parent().is_some_and(|outer| !outer.as_os_str().is_empty());
    if is_named {
        Some(path.parent()?.to_owned())
    } else {
        Some(path.canonicalize().ok()?.parent()?.to_owned())
    }
}

/// The dataset in a folder, where there is one alone.
fn only_dataset(folder: &Path) -> Option<PathBuf> {
    let found = datasets(folder, &names(folder));
    found.first().filter(|_| found.len() == 1).cloned()
}

/// The names in a folder that are not hidden, in natural order.
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    let mut names: Vec<_> = names.filter(|name| !name.starts_with('.')).collect();
    names.sort_by(|a, b| natural_order(a, b));
    names
}

/// The folder that a file is in, for a command line.
fn parent(path: &Path) -> String {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    quoted(parent.unwrap_or(Path::new(".")))
}

/// A path for a command line.
fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+,=:@%".contains(c);
    match text.chars().all(is_plain) && !text.is_empty() {
        true => text,
        false => format!("'{}'", text.replace('\'', "'\\''")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with these files, and what they have in them.
    fn folder_of(files: &[(&str, &[u8])]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("temporary folder");
        for (name, content) in files {
            let path = folder.path().join("a").join(name);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
            std::fs::write(path, content).expect("writable");
        }
        folder
    }

    #[test]
    fn folders_are_told_by_what_is_in_them() {
        for (files, name, expected) in [
            (&[("lego/transforms_train.json", &b"{}"[..])][..], "a", "a/lego; run `nerf train"),
            (&[("transforms.json", b"{}"), ("images/x.txt", b"")], "a/images", "/a; run `nerf train"),
            (
                &[("lego/transforms.json", b"{}"), ("photos/x.txt", b"")],
                "a/photos",
                "a/lego beside it is meant, run `nerf train",
            ),
            (
                &[("fox/transforms.json", b"{}"), ("mine/1.jpg", b"")],
                "a/mine",
                "found 1 picture and no poses",
            ),
            (&[("fox/transforms.json", b"{}"), ("mine/1.jpg", b"")], "a/mine", "a/fox lists them, run"),
            (&[("fox/transforms.json", b"{}"), ("m/0/images.bin", b"")], "a/m", "found a COLMAP model"),
            (&[("fox/transforms.json", b"{}"), ("m/x.tar", &[0; 600])], "a/m", "x.tar is nothing but zeros"),
            (&[("poses.json", b"{}")], "a", "found poses.json; name the file itself"),
            (&[("checkpoint.safetensors", b"")], "a", "the folder of a training run"),
            (&[("sparse/0/images.bin", b"")], "a", "a/sparse/0 to a transforms.json"),
            (&[("cameras.txt", b""), ("images.txt", b"")], "a", "found a COLMAP model"),
            (&[("poses_bounds.npy", b"")], "a", "the poses of LLFF"),
            (&[("1.jpg", b""), ("2.HEIC", b"")], "a", "found 2 pictures and no poses: find the poses"),
            (&[("a b.mp4", b"")], "a", "a b.mp4' with"),
            (&[("x.tar", &[0; 600])], "a", "x.tar is nothing but zeros"),
        ] {
            let outer = folder_of(files);
            let found = folder(&outer.path().join(name)).to_string();
            assert!(found.contains(expected), "{found} for {expected}");
        }
    }

    #[test]
    fn files_are_told_with_the_command_that_leads_to_a_dataset() {
        let mut tar = vec![0; 512];
        tar[257..262].copy_from_slice(b"ustar");
        let entry = |name: &str| {
            let mut entry = b"PK\x01\x02".to_vec();
            entry.resize(46, 0);
            entry[28] = name.len() as u8;
            [&entry[..], name.as_bytes()].concat()
        };
        let zip = |name: &str| [b"PK\x03\x04".to_vec(), entry(name)].concat();
        for (name, content, expected) in [
            ("x.zip", zip("lego/transforms.json"), "a dataset in a ZIP archive"),
            ("y z.zip", zip("readme"), "y z.zip' -d '"),
            ("x.npz", zip("poses.npy"), "a NumPy archive (poses.npy)"),
            ("x.tar", tar, "tar -xf"),
            ("x.tgz", b"\x1f\x8b\x08".to_vec(), "tar -xf"),
            ("x.mp4", b"\x00\x00\x00\x18ftypisom".to_vec(), "is a video"),
            ("database.db", b"SQLite format 3\0".to_vec(), "belongs to COLMAP"),
            ("poses_bounds.npy", b"\x93NUMPY".to_vec(), "has poses of LLFF"),
            ("x.pdf", b"%PDF-1".to_vec(), "is a PDF document"),
        ] {
            let outer = folder_of(&[(name, &content)]);
            let path = outer.path().join("a").join(name);
            let found = file(&path).expect("known").to_string();
            assert!(found.contains(expected), "{found} for {expected}");
        }
        let outer =
            folder_of(&[("x.zip", &zip("x/transforms.json")), ("x.json", b"{}"), ("y.json", b"\xff\xfe{\0")]);
        let missing = nowhere(&outer.path().join("a/x")).to_string();
        assert!(missing.contains("does not exist, but") && missing.contains("a/x/x`"), "{missing}");
        assert!(
            file(&outer.path().join("a/x.json")).is_none() && file(&outer.path().join("a/y.json")).is_none()
        );
    }
}
