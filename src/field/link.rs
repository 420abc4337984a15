//! From what a shader says that it needs to the text that is linked.
//!
//! A file of `shaders/` has a line `// needs: name, name, …` at the end of its first comment. A name is that of a file in
//! `shaders/common`, of a folder, which is a slot of which one variant is linked, or of a part that Rust writes.

use super::variants::SLOTS;
use super::{Plan, lenses};
use crate::gpu::source::Source;
use anyhow::{Context, Result, bail, ensure};
use include_dir::{Dir, include_dir};

/// Every file.
static SHADERS: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/shaders");

/// The folder of the parts that have no variants.
const COMMON: &str = "common";
/// The part that has the lenses of a scene's cameras.
const LENS: &str = "lens";

/// What a kernel is linked from.
#[derive(Clone, Debug)]
pub struct Link {
    label: String,
    /// The text with the entry point.
    main: String,
    /// Variants of slots that are the kernel's own, not the plan's.
    variants: Vec<(String, String)>,
    /// Parts that Rust writes.
    written: Vec<(&'static str, String)>,
    constants: Vec<(&'static str, Constant)>,
}

/// A number that a kernel knows at compile time.
#[derive(Clone, Copy, Debug)]
enum Constant {
    Count(usize),
    Float(f64),
}

impl Link {
    /// The kernel `label` of the file of that name, in which `_` stands for spaces.
    #[must_use]
    pub fn of(label: &str) -> Self {
        Self::of_file(label, &label.replace(' ', "_"))
    }

    /// The kernel `label` of `shaders/FILE.wgsl`.
    #[must_use]
    pub fn of_file(label: &str, file: &str) -> Self {
        Self::of_text(label, text(&format!("{file}.wgsl")).unwrap_or_default().to_owned())
    }

    /// The kernel `label` whose entry point is in `main`.
    #[must_use]
    pub fn of_text(label: &str, main: String) -> Self {
        let label = label.to_owned();
        Self { label, main, variants: Vec::new(), written: Vec::new(), constants: Vec::new() }
    }

    /// The kernel's name.
    #[must_use]
    pub fn label(&self) -> &str {
        &self.label
    }

    /// With this variant of a slot.
    #[must_use]
    pub fn with(mut self, slot: &str, variant: &str) -> Self {
        self.variants.push((slot.to_owned(), variant.to_owned()));
        self
    }

    /// With a part that Rust writes.
    #[must_use]
    pub fn part(mut self, name: &'static str, text: String) -> Self {
        self.written.push((name, text));
        self
    }

    /// With a constant.
    #[must_use]
    pub fn count(mut self, name: &'static str, value: usize) -> Self {
        self.constants.push((name, Constant::Count(value)));
        self
    }

    /// With a constant that is no whole number.
    #[must_use]
    pub fn float(mut self, name: &'static str, value: f64) -> Self {
        self.constants.push((name, Constant::Float(value)));
        self
    }

    /// With several constants.
    #[must_use]
    pub fn counts(self, constants: &[(&'static str, usize)]) -> Self {
        constants.iter().fold(self, |link, &(name, value)| link.count(name, value))
    }
}

impl Plan {
    /// The text of a kernel behind the plan's constants, before it is linked.
    ///
    /// # Errors
    /// When a shader needs a part that is not there, or a slot has no variant: a mistake in the program.
    pub fn source(&self, link: &Link) -> Result<Source> {
        ensure!(!link.main.is_empty(), "there is no shader for the kernel '{}'", link.label);
        let source = self.constants(Source::new(&link.label).memory(self.memory));
        let source = link.constants.iter().fold(source, |source, (name, value)| match value {
            Constant::Count(value) => source.count(name, *value),
            Constant::Float(value) => source.float(name, *value),
        });
        let mut linker = Linker { plan: self, link, source, seen: Vec::new() };
        linker
            .add(&link.label, &link.main)
            .with_context(|| format!("linking the kernel '{}'", link.label))?;
        Ok(linker.source)
    }
}

struct Linker<'a> {
    plan: &'a Plan,
    link: &'a Link,
    source: Source,
    seen: Vec<String>,
}

impl Linker<'_> {
    /// Adds a part behind what it needs.
    fn add(&mut self, name: &str, text: &str) -> Result<()> {
        if self.seen.iter().any(|seen| seen == name) {
            return Ok(());
        }
        self.seen.push(name.to_owned());
        for needed in needs(text) {
            self.resolve(needed).with_context(|| format!("'{name}' needs '{needed}'"))?;
        }
        self.source = std::mem::take(&mut self.source).part(name, text);
        Ok(())
    }

    fn add_file(&mut self, folder: &str, file: &str) -> Result<()> {
        let name = format!("{folder}/{file}.wgsl");
        let text = text(&name).with_context(|| format!("there is no shaders/{name}"))?;
        self.add(&name, text)
    }

    fn resolve(&mut self, name: &str) -> Result<()> {
        if let Some((name, text)) = self.link.written.iter().find(|(written, _)| *written == name) {
            return self.add(name, text);
        }
        if name == LENS {
            let lenses = &self.plan.features.lenses;
            for &kind in lenses {
                self.add_file(LENS, &lenses::file(kind))?;
            }
            return self.add(LENS, &lenses::choice(lenses));
        }
        if SHADERS.get_dir(name).is_none() {
            return self.add_file(COMMON, name);
        }
        let own = self.link.variants.iter().find(|(slot, _)| slot == name);
        match own.map(|(_, variant)| variant.as_str()).or_else(|| self.plan.variant(name)) {
            Some(variant) => self.add_file(name, variant),
            None => bail!("the slot has no variant for this kernel"),
        }
    }
}

fn text(name: &str) -> Option<&'static str> {
    SHADERS.get_file(name).and_then(include_dir::File::contents_utf8)
}

/// What a shader needs, in its own words.
pub fn needs(text: &str) -> impl Iterator<Item = &str> {
    let comment = text.lines().take_while(|line| line.starts_with("//"));
    comment.filter_map(|line| line.strip_prefix("// needs: ")).flat_map(|list| list.split(", "))
}

/// The names of all slots, and of the variants of each.
#[must_use]
pub fn slots() -> Vec<(&'static str, Vec<&'static str>)> {
    let name =
        |path: &'static std::path::Path| path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    let folders = SHADERS.dirs().filter(|folder| ![COMMON, LENS].contains(&name(folder.path())));
    folders
        .map(|folder| (name(folder.path()), folder.files().map(|file| name(file.path())).collect()))
        .collect()
}

/// Entry points: the files beside the folders, without their ending.
pub fn entry_points() -> impl Iterator<Item = &'static str> {
    SHADERS.files().filter_map(|file| file.path().to_str()?.strip_suffix(".wgsl"))
}

impl Plan {
    /// The variant of a slot that suits the plan; `None` for slots of which each kernel has its own.
    #[must_use]
    pub fn variant(&self, slot: &str) -> Option<&'static str> {
        let slot = SLOTS.iter().find(|row| row.name == slot)?;
        slot.variants.iter().find(|variant| (variant.suits)(self)).map(|variant| variant.name)
    }

    /// What is not linked for this scene and these settings, each with the reason.
    #[must_use]
    pub fn left_out(&self) -> Vec<String> {
        let absent: Vec<_> = lenses::absent(&self.features.lenses).collect();
        let lenses =
            (!absent.is_empty()).then(|| format!("lens models {} (no camera has them)", absent.join("/")));
        let variants = SLOTS.iter().flat_map(|slot| {
            let chosen = self.variant(slot.name);
            slot.variants.iter().filter(move |variant| Some(variant.name) != chosen)
        });
        let told = variants.filter_map(|variant| {
            let (what, reason) = variant.left_out?;
            Some(format!("{what} ({})", reason(self)?))
        });
        lenses.into_iter().chain(told).collect()
    }
}
