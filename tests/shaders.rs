//! Links and checks every kernel with every variant of its parts, without a GPU.
//!
//! No list of kernels here: an entry point names what it needs, and this test looks for the parts that define
//! it. Where several do, they are the variants of a slot, and every one of them is linked.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use nerf::camera::LensKind;
use nerf::config::{Accumulation, Config};
use nerf::gpu::banks::Capacity;
use nerf::gpu::kernel::{Layout as StructLayout, Shared};
use nerf::gpu::source::{Linked, Source};
use nerf::gpu::tensor::Memory;
use nerf::kernels::layer::Product;
use nerf::kernels::training::Tile;
use nerf::kernels::{Camera, Counters, Needs, Plan, Progress, RayResult, RayTarget, Step, Traits, photos};
use nerf::model::{Layout, Level};
use wgpu::{BindingType, naga};

/// A file of WGSL: its name below `shaders` and its text.
type File = (String, String);

/// All files of `shaders` and its folders.
fn files() -> Vec<File> {
    let root = Path::new("shaders");
    let list = |folder: &Path| -> Vec<_> {
        let entries = std::fs::read_dir(folder).expect("a folder of shaders");
        entries.map(|entry| entry.expect("an entry").path()).collect()
    };
    let mut files = Vec::new();
    for path in list(root) {
        let found = if path.is_dir() { list(&path) } else { vec![path] };
        let found = found.into_iter().filter(|path| path.extension().is_some_and(|end| end == "wgsl"));
        files.extend(found.map(|path| {
            let name = path.strip_prefix(root).expect("below shaders").display().to_string();
            (name.replace('\\', "/"), std::fs::read_to_string(path).expect("a shader"))
        }));
    }
    files.sort();
    files
}

/// The choice between the lenses of every set of cameras: a part that the plan writes.
fn lens_choices() -> Vec<File> {
    (1..1 << LensKind::ALL.len())
        .map(|members: u32| {
            let is_member = |kind: &LensKind| members >> (*kind as u32) & 1 == 1;
            let kinds: BTreeSet<LensKind> = LensKind::ALL.into_iter().filter(is_member).collect();
            (format!("lens choice {kinds:?}"), nerf::kernels::lens::choice(&kinds))
        })
        .collect()
}

/// What a part defines for others.
fn definitions(text: &str) -> Vec<String> {
    let name =
        |rest: &str| -> String { rest.chars().take_while(|&c| c.is_alphanumeric() || c == '_').collect() };
    let mut names = Vec::new();
    for line in text.lines() {
        for keyword in ["fn ", "struct ", "const "] {
            names.extend(line.strip_prefix(keyword).map(name));
        }
        if let Some((kind, rest)) = line.split_once("> ") {
            if kind.starts_with("var<") {
                names.push(name(rest));
            } else if kind.starts_with("tensor<") {
                names.extend(["load", "store"].map(|access| format!("{}_{access}", name(rest))));
            }
        }
    }
    names
}

fn plan(memory: Memory, cascades: u32) -> Plan {
    let config = Config::default();
    let needs = Needs { alpha: true, cascades, cameras: 3, ..Needs::default() };
    let layout = Layout::new(&config, 2048);
    let product = Product { rows: 2, shared_weights: false };
    let adapter = Traits { memory, ..Traits::GPU };
    Plan {
        product,
        accumulation: Accumulation::Exchange,
        chunks: 32,
        ..Plan::suited_to(adapter, config, layout, needs)
    }
}

/// Everything that was linked.
struct Linker {
    plan: Plan,
    parts: Vec<File>,
    /// Which parts define a name.
    definers: BTreeMap<String, Vec<usize>>,
    used: BTreeSet<String>,
    combinations: usize,
    /// Structs that were compared with Rust's.
    compared: BTreeSet<&'static str>,
}

/// The structs that Rust and WGSL share.
const SHARED: [StructLayout; 8] = [
    Step::LAYOUT,
    Counters::LAYOUT,
    Progress::LAYOUT,
    RayTarget::LAYOUT,
    RayResult::LAYOUT,
    Camera::LAYOUT,
    Level::LAYOUT,
    Tile::LAYOUT,
];

impl Linker {
    fn new(plan: Plan) -> Self {
        let mut parts: Vec<File> = files().into_iter().filter(|(name, _)| name.contains('/')).collect();
        // What reads the photos depends on how many banks they fill.
        let capacity = Capacity::of(&wgpu::Limits::default(), plan.memory);
        let photos = |banks| (format!("photos in {banks} banks"), capacity.part(photos::NAME, banks));
        parts.extend([photos(1), photos(capacity.banks())]);
        parts.extend(lens_choices());
        let mut definers: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for (index, (_, text)) in parts.iter().enumerate() {
            for name in definitions(text) {
                definers.entry(name).or_default().push(index);
            }
        }
        let (used, compared) = (BTreeSet::new(), BTreeSet::new());
        Self { plan, parts, definers, used, combinations: 0, compared }
    }

    /// Links `name` with every combination of the variants that it needs; returns how many there are.
    ///
    /// Variants that clash are passed over where `clashes`: no layer is the first and the last.
    fn link_all(&mut self, name: &str, text: &str, clashes: bool) -> usize {
        let source = self.plan.source(name, &[]).part(name, text);
        let before = self.combinations;
        self.resolve(source, &mut vec![], clashes);
        self.combinations - before
    }

    fn resolve(&mut self, source: Source, chosen: &mut Vec<usize>, clashes: bool) {
        let error = match source.link() {
            Ok(linked) => return self.check(&linked, chosen),
            Err(error) => format!("{error:#}"),
        };
        let names = |chosen: &[usize]| chosen.iter().map(|&i| self.parts[i].0.as_str()).collect::<Vec<_>>();
        let Some(missing) = error.split_once("no definition in scope for identifier: `") else {
            assert!(clashes && error.contains("redefinition"), "{:?}: {error}", names(chosen));
            return;
        };
        let missing = missing.1.split('`').next().unwrap_or_default().to_owned();
        if let Some(definers) = self.definers.get(&missing).cloned() {
            for part in definers {
                let (name, text) = self.parts[part].clone();
                chosen.push(part);
                self.resolve(source.clone().part(&name, text), chosen, clashes);
                chosen.pop();
            }
        } else {
            // Constants of one kernel: any number does.
            let is_constant =
                missing.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_');
            assert!(is_constant, "no part defines {missing}, {:?}: {error}", names(chosen));
            self.resolve(source.constant(&missing, 16), chosen, clashes);
        }
    }

    /// Every kernel runs on an adapter that has what WebGPU guarantees, and no more.
    fn check_bindings(&self, linked: &Linked, chosen: &[usize]) {
        let limits = wgpu::Limits::default();
        let storage = |kind: &BindingType| {
            matches!(kind, BindingType::Buffer { ty: wgpu::BufferBindingType::Storage { .. }, .. })
        };
        let storage_texture = |kind: &BindingType| matches!(kind, BindingType::StorageTexture { .. });
        let texture = |kind: &BindingType| matches!(kind, BindingType::Texture { .. });
        let counts = [
            ("storage buffers", bindings(linked, storage), limits.max_storage_buffers_per_shader_stage),
            (
                "storage textures",
                bindings(linked, storage_texture),
                limits.max_storage_textures_per_shader_stage,
            ),
            ("textures", bindings(linked, texture), limits.max_sampled_textures_per_shader_stage),
        ];
        for (name, count, most) in counts {
            let parts: Vec<_> = chosen.iter().map(|&part| &self.parts[part].0).collect();
            assert!(count <= most as usize, "{} with {parts:?} has {count} {name}, of {most}", linked.label);
        }
    }

    fn check(&mut self, linked: &Linked, chosen: &[usize]) {
        self.combinations += 1;
        self.used.extend(chosen.iter().map(|&part| self.parts[part].0.clone()));
        let entry = &linked.module.entry_points;
        assert!(entry.len() == 1 && entry[0].name == "main", "{}", linked.label);
        let names: BTreeSet<&str> = linked.bindings.iter().map(|binding| binding.name.as_str()).collect();
        assert_eq!(names.len(), linked.bindings.len(), "{}: {names:?}", linked.label);
        self.check_bindings(linked, chosen);
        let built_in = |argument: &naga::FunctionArgument| {
            argument.binding == Some(naga::Binding::BuiltIn(naga::BuiltIn::NumWorkGroups))
        };
        let main = &entry[0].function;
        assert!(!main.arguments.iter().any(built_in), "{} reads num_workgroups", linked.label);
        for layout in SHARED {
            let found =
                linked.module.types.iter().find(|(_, kind)| kind.name.as_deref() == Some(layout.name));
            if let Some((_, kind)) = found {
                compare(&linked.label, kind, layout);
                self.compared.insert(layout.name);
            }
        }
    }
}

/// How many bindings of a kind a module has.
fn bindings(linked: &Linked, is_counted: fn(&BindingType) -> bool) -> usize {
    linked.bindings.iter().filter(|binding| is_counted(&binding.kind)).count()
}

fn compare(label: &str, kind: &naga::Type, layout: StructLayout) {
    let naga::TypeInner::Struct { members, span } = &kind.inner else {
        panic!("{label}: {} is no struct", layout.name);
    };
    let wgsl: Vec<(&str, usize)> = (members.iter())
        .map(|member| (member.name.as_deref().unwrap_or_default(), member.offset as usize))
        .collect();
    assert_eq!(wgsl, layout.fields, "{label}: {}", layout.name);
    assert_eq!(*span as usize, layout.size, "{label}: {}", layout.name);
}

#[test]
fn every_combination_links() {
    for (memory, cascades) in [(Memory::Buffers, 1), (Memory::Textures, 3)] {
        let mut linker = Linker::new(plan(memory, cascades));
        for (name, text) in files().iter().filter(|(name, _)| !name.contains('/')) {
            let count = linker.link_all(name, text, false);
            println!("{memory:?} {name}: {count}");
            assert!(count > 0, "{name} does not link");
        }
        for (width, shared_weights) in [(16, false), (64, true)] {
            let product = Product { rows: 2, shared_weights };
            let quads = [("INPUT_QUADS", width / 4), ("OUTPUT_QUADS", 4)];
            for (name, text) in
                [("forward", product.forward(width, 16)), ("backward", product.backward(width, width, 16))]
            {
                let constants = quads.map(|(name, value)| format!("const {name} = {value}u;\n")).concat();
                let count = linker.link_all(name, &(constants + &text), true);
                println!("{memory:?} {name} {width}: {count}");
                assert!(count > 0, "{name} does not link");
            }
        }
        for (quads, shared_weights) in [(1, false), (4, false), (1, true), (16, true)] {
            let product = Product { rows: 2, shared_weights };
            assert!(linker.link_all("weight gradient", &product.weight_gradient(quads), false) > 0);
        }
        let unused: Vec<_> =
            linker.parts.iter().map(|(name, _)| name).filter(|name| !linker.used.contains(*name)).collect();
        assert!(unused.is_empty(), "no kernel uses {unused:?}");
        assert_eq!(linker.compared.len(), SHARED.len(), "compared only {:?}", linker.compared);
        println!("{memory:?}: {} combinations", linker.combinations);
    }
}

/// A folder is a slot: its files define the same functions, so that each can take another's place.
#[test]
fn variants_are_interchangeable() {
    for slot in [
        "activation",
        "background",
        "depth_loss",
        "depth_target",
        "distance",
        "extent",
        "loss",
        "pixels",
        "position",
        "stepping",
        "transmittance",
        "weights",
    ] {
        let mut wanted: Option<(String, BTreeSet<String>)> = None;
        for (name, text) in files().into_iter().filter(|(name, _)| name.starts_with(&format!("{slot}/"))) {
            let prefix =
                |line: &str| line.strip_prefix("fn ").map(|rest| rest.split('{').next().map(str::to_owned));
            let signatures: BTreeSet<String> = text.lines().filter_map(prefix).flatten().collect();
            match &wanted {
                None => wanted = Some((name, signatures)),
                Some((first, wanted)) => {
                    assert!(wanted.intersection(&signatures).count() > 0, "{first} and {name} share nothing");
                }
            }
        }
        assert!(wanted.is_some(), "no files in {slot}");
    }
}

#[test]
fn errors_name_the_part_and_its_line() {
    let broken = "fn helper() -> u32 {\n    return missing;\n}\n";
    let main = "@compute @workgroup_size(1)\nfn main() { let x = helper(); }\n";
    let source =
        Source::new("test").count("ONE", 1).part("common/broken.wgsl", broken).part("main.wgsl", main);
    let message = format!("{:#}", source.link().expect_err("broken"));
    assert!(message.contains("test") && message.contains("common/broken.wgsl:2"), "{message}");
}
