//! Files that cannot be read, told by what is wrong with them: one message for each kind, for any number of files.

use anyhow::Error;

use super::image_file::Foreign;
use crate::support::format::few;

/// A file that cannot be read.
#[derive(Debug)]
pub struct Unreadable {
    /// What it is called in the dataset.
    pub name: String,
    /// Whose it is and why it cannot be read.
    pub error: Error,
}

/// The files of a kind.
#[derive(Debug)]
pub struct Kind {
    /// What they are, how many and which, and what to do about them.
    pub message: String,
    /// Their indices among those that were given, in order.
    pub members: Vec<usize>,
}

/// The kinds of some files that cannot be read, of `total` things.
#[must_use]
pub fn kinds(files: &[Unreadable], total: usize, things: &str) -> Vec<Kind> {
    let mut kinds: Vec<(String, Vec<usize>)> = Vec::new();
    for (index, file) in files.iter().enumerate() {
        let cause = cause(&file.error);
        match kinds.iter_mut().find(|(known, _)| *known == cause) {
            Some((_, members)) => members.push(index),
            None => kinds.push((cause, vec![index])),
        }
    }
    let told = |(_, members): (String, Vec<usize>)| {
        let of_kind: Vec<&Unreadable> = members.iter().map(|&index| &files[index]).collect();
        Kind { message: message(&of_kind, total, things), members }
    };
    kinds.into_iter().map(told).collect()
}

/// What is wrong with a file, without the numbers in it.
fn cause(error: &Error) -> String {
    error.root_cause().to_string().chars().filter(|c| !c.is_ascii_digit()).collect()
}

/// What is said about the files of one kind.
fn message(files: &[&Unreadable], total: usize, things: &str) -> String {
    let Some(first) = files.first() else { return String::new() };
    let count = files.len();
    if count == 1 {
        return format!("{:#}", first.error);
    }
    let names: Vec<&str> = files.iter().map(|file| file.name.as_str()).collect();
    match first.error.downcast_ref::<Foreign>() {
        Some(foreign) => {
            format!(
                "{count} of {total} {things} cannot be read ({}): each is {}; {}",
                few(&names),
                foreign.what,
                foreign.remedy
            )
        }
        None => format!(
            "{count} of {total} {things} cannot be read ({}), the first: {:#}",
            few(&names),
            first.error
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::anyhow;

    #[test]
    fn many_files_of_a_kind_are_one_message() {
        let foreign = |what| Foreign { what, remedy: "convert it" };
        let file = |index: usize| {
            let error = match index % 3 {
                0 => Error::from(foreign("a HEIC picture")),
                1 => Error::from(foreign("an empty file")),
                _ => anyhow!("ends after {index} bytes"),
            };
            Unreadable { name: format!("{index}.jpg"), error: error.context(format!("reading {index}.jpg")) }
        };
        let files: Vec<_> = (0..300).map(file).collect();
        let kinds = kinds(&files, 400, "photos");
        let messages: Vec<_> = kinds.iter().map(|kind| kind.message.as_str()).collect();
        let expected = [
            "100 of 400 photos cannot be read (0.jpg, 3.jpg, 6.jpg, …): each is a HEIC picture; convert it",
            "100 of 400 photos cannot be read (1.jpg, 4.jpg, 7.jpg, …): each is an empty file; convert it",
            "100 of 400 photos cannot be read (2.jpg, 5.jpg, 8.jpg, …), the first: reading 2.jpg: ends after 2 bytes",
        ];
        assert_eq!(messages, expected);
        assert_eq!(kinds[1].members[..2], [1, 4]);
        let one = super::kinds(&files[..1], 400, "photos");
        assert!(one[0].message.starts_with("reading 0.jpg: expected PNG"), "{}", one[0].message);
    }
}
