//! The invariants of `docs/architecture.md` that the text of the sources can show.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// What each room of the library may import. The program may import every room.
const ROOMS: &[(&str, &[&str])] = &[
    ("support", &[]),
    ("camera", &["support"]),
    ("photo", &["camera", "support"]),
    ("config", &["support"]),
    ("gpu", &["support"]),
    ("capture", &["camera", "photo", "support"]),
    ("field", &["camera", "config", "gpu", "photo", "support"]),
    ("run", &["camera", "capture", "config", "field", "gpu", "photo", "support"]),
    ("verify", &["camera", "capture", "config", "field", "gpu", "photo", "run", "support"]),
];

/// A file of `src`: its module's path, and its text without its tests.
struct Source {
    module: Vec<String>,
    text: String,
    /// The modules that it declares.
    children: Vec<String>,
}

impl Source {
    fn room(&self) -> &str {
        self.module.first().map_or("", String::as_str)
    }

    /// Whether it is a part of the program: `main.rs`, or what that declares.
    fn is_program(&self, all: &[Self]) -> bool {
        let main = all.iter().find(|source| source.room() == "main").expect("src/main.rs");
        self.room() == "main" || main.children.iter().any(|child| child == self.room())
    }

    fn name(&self) -> String {
        self.module.join("::")
    }
}

/// Every Rust file in a folder and the folders in it.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("readable").path());
    let each = |path: PathBuf| match path.is_dir() {
        true => files(&path),
        false => vec![path],
    };
    entries.flat_map(each).filter(|path| path.extension().is_some_and(|end| end == "rs")).collect()
}

/// Every file but `lib.rs` and files of tests.
fn sources() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let source = |path: PathBuf| {
        let inner = path.strip_prefix(&root).expect("in src").with_extension("");
        let module = inner.iter().map(|part| part.to_string_lossy().into_owned()).collect();
        let text = std::fs::read_to_string(&path).expect("a source");
        let end = text.find("\n#[cfg(test)]").unwrap_or(text.len());
        let text = text[..end].to_owned();
        let declared = |line: &str| Some(line.split_once("mod ")?.1.strip_suffix(';')?.to_owned());
        let children = text.lines().filter_map(declared).collect();
        Source { module, text, children }
    };
    let all = files(&root).into_iter().map(source);
    let all: Vec<_> =
        all.filter(|source| source.room() != "lib" && !source.name().ends_with("tests")).collect();
    assert!(all.len() > 150, "found only {} files", all.len());
    all
}

/// The paths that a `use` names, its groups taken apart: `a::{b, c::d}` is `a::b` and `a::c::d`.
fn flattened(tree: &str) -> Vec<String> {
    let Some(open) = tree.find('{') else {
        return vec![tree.split(" as ").next().unwrap_or_default().trim().to_owned()];
    };
    let (prefix, inner) = (&tree[..open], &tree[open + 1..tree.rfind('}').unwrap_or(tree.len())]);
    let (mut depth, mut part, mut parts) = (0, String::new(), Vec::new());
    for letter in inner.chars() {
        depth += i32::from(letter == '{') - i32::from(letter == '}');
        if letter == ',' && depth == 0 {
            parts.push(std::mem::take(&mut part));
        } else {
            part.push(letter);
        }
    }
    parts.push(part);
    let parts = parts.iter().map(|part| part.trim()).filter(|part| !part.is_empty());
    parts.flat_map(flattened).map(|path| format!("{}{path}", prefix.trim())).collect()
}

/// What a file imports from its own crate or, as the binary does, from the library, as paths from the root.
fn imports(source: &Source) -> Vec<Vec<String>> {
    let code: String = source
        .text
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .collect::<Vec<_>>()
        .join("\n");
    let mut found = Vec::new();
    for statement in code.split(';') {
        // Attributes and the end of what came before stand in front of it.
        let Some((_, tree)) =
            format!("\n{statement}").rsplit_once("use ").map(|(a, b)| (a.to_owned(), b.to_owned()))
        else {
            continue;
        };
        if tree.contains(['(', '=', '"']) {
            continue;
        }
        for path in flattened(&tree) {
            let parts: Vec<String> = path.split("::").map(|part| part.trim().to_owned()).collect();
            found.extend(from_root(source, &parts));
        }
    }
    // Paths that are written out.
    for start in ["crate::", "nerf::"] {
        for (at, _) in code.match_indices(start) {
            let before = code[..at].chars().next_back().unwrap_or(' ');
            if before.is_alphanumeric() || before == '_' || before == ':' {
                continue;
            }
            let is_name = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
            let path: String = code[at + start.len()..].chars().take_while(|&c| is_name(c)).collect();
            found.push(path.split("::").filter(|part| !part.is_empty()).map(str::to_owned).collect());
        }
    }
    found
}

fn from_root(source: &Source, path: &[String]) -> Option<Vec<String>> {
    let mut base = source.module.clone();
    let mut rest = path;
    match path.first()?.as_str() {
        "crate" | "nerf" => return Some(path[1..].to_vec()),
        "self" => rest = &path[1..],
        "super" => {
            while rest.first().is_some_and(|part| part == "super") {
                base.pop();
                rest = &rest[1..];
            }
        }
        // A module of its own folder.
        first if source.children.iter().any(|child| child == first) => {}
        _ => return None,
    }
    base.extend(rest.iter().cloned());
    Some(base)
}

#[test]
fn imports_go_one_way() {
    let rooms: BTreeMap<_, _> = ROOMS.iter().copied().collect();
    let mut wrong = BTreeSet::new();
    let all = sources();
    for source in all.iter().filter(|source| !source.is_program(&all)) {
        let allowed = rooms.get(source.room()).unwrap_or_else(|| panic!("{} is no room", source.room()));
        for path in imports(source) {
            let Some(room) = path.first().filter(|room| rooms.contains_key(room.as_str())) else { continue };
            if room != source.room() && !allowed.contains(&room.as_str()) {
                wrong.insert(format!("{} imports {}", source.name(), path.join("::")));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The commands share what stands in `commands.rs`, and nothing else of each other.
#[test]
fn no_command_imports_another() {
    let mut wrong = BTreeSet::new();
    let all = sources();
    let commands: BTreeSet<&str> = all
        .iter()
        .filter(|file| file.room() == "commands")
        .filter_map(|file| Some(file.module.get(1)?.as_str()))
        .collect();
    for source in all.iter().filter(|file| file.room() == "commands" && file.module.len() > 1) {
        for path in imports(source).iter().filter(|path| path.first().is_some_and(|room| room == "commands"))
        {
            let other = path.get(1).filter(|name| commands.contains(name.as_str()));
            if other.is_some_and(|other| *other != source.module[1]) {
                wrong.insert(format!("{} imports {}", source.name(), path.join("::")));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The file in which what a path names is defined: that of the longest module in it, re-exports followed.
fn definition(all: &BTreeMap<Vec<String>, &Source>, path: &[String]) -> Option<Vec<String>> {
    let mut path = path.to_vec();
    for _ in 0..8 {
        let module =
            (1..=path.len()).rev().map(|end| path[..end].to_vec()).find(|module| all.contains_key(module))?;
        let Some(name) = path.get(module.len()) else { return Some(module) };
        let source = all.get(&module)?;
        let exported = reexports(source).into_iter().find(|(exported, _)| exported == name);
        let Some((_, target)) = exported else { return Some(module) };
        path = [target, path[module.len() + 1..].to_vec()].concat();
    }
    None
}

/// What a file exports that others define, each with the path to it.
fn reexports(source: &Source) -> Vec<(String, Vec<String>)> {
    let mut found = Vec::new();
    for statement in source.text.split(';') {
        let Some(at) = statement.rfind("pub use ").or_else(|| statement.rfind("pub(crate) use ")) else {
            continue;
        };
        let tree = &statement[at..];
        let tree = &tree[tree.find("use ").map_or(0, |use_at| use_at + 4)..];
        for path in flattened(tree) {
            let parts: Vec<String> = path.split("::").map(|part| part.trim().to_owned()).collect();
            let target =
                from_root(source, &parts).unwrap_or_else(|| [source.module.clone(), parts.clone()].concat());
            found.extend(parts.last().map(|name| (name.clone(), target)));
        }
    }
    found
}

/// A file that another one imports, itself or through others, does not import it. What a module exports of others counts as
/// what defines it, and parts in its folder may take from it what they share.
#[test]
fn no_file_imports_in_a_circle() {
    let all = sources();
    let by_module: BTreeMap<Vec<String>, &Source> =
        all.iter().map(|source| (source.module.clone(), source)).collect();
    let mut edges: BTreeMap<Vec<String>, BTreeSet<Vec<String>>> = BTreeMap::new();
    for source in &all {
        let targets = imports(source).into_iter().filter_map(|path| definition(&by_module, &path));
        // A module and the parts in its folder are one.
        edges.insert(source.module.clone(), targets.filter(|to| !source.module.starts_with(to)).collect());
    }
    let reached = |from: &Vec<String>| -> BTreeSet<Vec<String>> {
        let (mut seen, mut left) = (BTreeSet::new(), vec![from.clone()]);
        while let Some(module) = left.pop() {
            let further = edges.get(&module).into_iter().flatten().filter(|to| !seen.contains(*to));
            let further: Vec<_> = further.cloned().collect();
            seen.extend(further.iter().cloned());
            left.extend(further);
        }
        seen
    };
    let reach: BTreeMap<_, _> = edges.keys().map(|module| (module, reached(module))).collect();
    let mut circles = BTreeSet::new();
    for (from, to) in edges.iter().flat_map(|(from, all)| all.iter().map(move |to| (from, to))) {
        if reach.get(to).is_some_and(|back| back.contains(from)) {
            circles.insert(format!("{} imports {}", from.join("::"), to.join("::")));
        }
    }
    assert!(circles.is_empty(), "{circles:#?}");
}

/// What the library has to say, its callers hear: it neither writes to the terminal nor ends the program.
#[test]
fn the_library_never_prints() {
    let all = sources();
    for source in all.iter().filter(|source| !source.is_program(&all)) {
        let code = source.text.lines().filter(|line| !line.trim_start().starts_with("//"));
        for line in code {
            for word in ["println!", "eprint!", "print!(", "stdout()", "stderr()", "process::exit", "dbg!"] {
                assert!(!line.contains(word), "{} has {word}", source.name());
            }
        }
    }
}

/// A file is a noun: whoever opens it reads it as a whole.
#[test]
fn sources_stay_small() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for folder in ["src", "tests", "benches"] {
        for path in files(&root.join(folder)) {
            let lines = std::fs::read_to_string(&path).expect("a source").lines().count();
            assert!(lines <= 400, "{} has {lines} lines", path.display());
        }
    }
}
