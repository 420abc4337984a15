//! Where renderings of photos are saved: beside no input of the dataset, under names that tell the photo.

use anyhow::{Result, ensure};
use nerf::capture::dataset::{Dataset, is_picture};
use nerf::support::file::first_within;
use std::collections::HashSet;
use std::fs::canonicalize;
use std::path::{Component, Path, PathBuf};

/// The files in `folder`, which is there, to save the frames of `indices` to.
pub(super) fn paths(folder: &Path, dataset: &Dataset, indices: &[usize]) -> Result<Vec<PathBuf>> {
    let show = folder.display();
    let beside = first_within(folder, dataset.input_files().cloned());
    ensure!(
        beside.is_none(),
        "the folder {show} holds files of the dataset ({}), which renderings could replace; name another one",
        beside.unwrap_or_default().display()
    );
    let names = names(indices.iter().map(|&index| dataset.frames[index].name.as_str()));
    let paths: Vec<_> = names.into_iter().map(|name| folder.join(name)).collect();
    let links = paths.iter().filter(|path| path.is_symlink());
    let behind_links: HashSet<_> = links.filter_map(|path| canonicalize(path).ok()).collect();
    let is_behind = |input: &&PathBuf| canonicalize(input).is_ok_and(|input| behind_links.contains(&input));
    let input = if behind_links.is_empty() { None } else { dataset.input_files().find(is_behind) };
    ensure!(
        input.is_none(),
        "a link in {show} leads to a file of the dataset ({}), which a rendering would replace; name another folder",
        input.cloned().unwrap_or_default().display()
    );
    Ok(paths)
}

/// Names of files: those of the photos with the folders that they lie in. Photos whose names would come to the same are told
/// apart by their endings, else by numbers.
fn names<'a>(photos: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut taken = HashSet::new();
    let name = |(number, photo): (usize, &str)| {
        let path = Path::new(photo);
        let numbered = format!("{}_{number}", flat(path));
        // Other names may have full stops, too.
        let is_image = path.file_name().and_then(|name| name.to_str()).is_some_and(is_picture);
        let bare = if is_image { path.with_extension("") } else { path.to_owned() };
        let candidates = [flat(&bare), flat(path), numbered];
        // Some file systems take upper and lower case for the same.
        let free = candidates.into_iter().find(|name| taken.insert(name.to_lowercase()));
        format!("{}.png", free.unwrap_or_else(|| number.to_string()))
    };
    photos.enumerate().map(name).collect()
}

/// A path as one name.
fn flat(path: &Path) -> String {
    let parts = path.components().filter_map(|part| match part {
        Component::Normal(name) => Some(name.to_string_lossy()),
        _ => None,
    });
    let joined = parts.collect::<Vec<_>>().join("_");
    joined.replace(|c: char| c.is_control() || "<>:\"|?*\\".contains(c), "_")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_the_photo() {
        let photos =
            ["./test/r_3", "images/a.JPG", "images/a.png", "Images/A.png", "../x:1.jpg", "test/r_3", "b.01"];
        let expected =
            ["test_r_3", "images_a", "images_a.png", "Images_A.png_3", "x_1", "test_r_3_5", "b.01"];
        assert_eq!(names(photos.into_iter()), expected.map(|name| format!("{name}.png")));
    }
}
