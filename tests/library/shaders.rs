//! Links and checks every kernel with every variant of its parts, as the product links it, without a GPU.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use glam::DVec3;
use nerf::camera::{Bounds, LensKind};
use nerf::config::{Accumulation, Config};
use nerf::field::layer::Product;
use nerf::field::link::{self, Link};
use nerf::field::{Capabilities, LAYOUTS, Plan, SceneFeatures, Space, records, variants};
use nerf::gpu::kernel::StructLayout;
use nerf::gpu::paged_array::PageCapacity;
use nerf::gpu::source::{Linked, Source};
use nerf::gpu::tensor::TensorMemory;
use wgpu::{BindingType, naga};

/// A file of `shaders/` by its name below it, without the ending.
fn text(name: &str) -> String {
    std::fs::read_to_string(Path::new("shaders").join(format!("{name}.wgsl"))).expect("a shader")
}

/// Every set of lenses.
fn lens_sets() -> impl Iterator<Item = BTreeSet<LensKind>> {
    (1..1 << LensKind::ALL.len()).map(|members: u32| {
        LensKind::ALL.into_iter().filter(|kind| members >> (*kind as u32) & 1 == 1).collect()
    })
}

/// What a file defines for others.
fn definitions(text: &str) -> Vec<String> {
    let name =
        |rest: &str| -> String { rest.chars().take_while(|&c| c.is_alphanumeric() || c == '_').collect() };
    let mut names = Vec::new();
    for line in text.lines() {
        for keyword in ["fn ", "struct ", "const "] {
            names.extend(line.strip_prefix(keyword).map(name));
        }
        names.extend(
            line.split_once("> ").filter(|(kind, _)| kind.starts_with("var<")).map(|(_, rest)| name(rest)),
        );
    }
    names
}

fn plan(memory: TensorMemory, cascades: u32) -> Plan {
    let mut config = Config::default();
    config.grid.finest = 2048;
    let features = SceneFeatures { alpha: true, ..SceneFeatures::default() };
    let bounds = Bounds { center: DVec3::ZERO, half: 1.0, cascades, source: String::new(), is_guess: false };
    let product = Product::Rows(2);
    let adapter = Capabilities { memory, ..Capabilities::GPU };
    Plan {
        product,
        accumulation: Accumulation::Exchange,
        chunks: 32,
        ..Plan::suited_to(adapter, config, features, Space::from(&bounds))
    }
}

/// Everything that was linked.
struct Linker {
    plan: Plan,
    slots: BTreeMap<&'static str, Vec<&'static str>>,
    used: BTreeSet<String>,
    combinations: usize,
    /// Structs that were compared with Rust's.
    compared: BTreeSet<&'static str>,
}

impl Linker {
    fn new(plan: Plan) -> Self {
        let slots = link::slots().into_iter().collect();
        Self { plan, slots, used: BTreeSet::new(), combinations: 0, compared: BTreeSet::new() }
    }

    /// The slots that a text needs, itself or through others, in the order in which they are met.
    fn slots_of(&self, text_of_main: &str) -> Vec<&'static str> {
        let (mut slots, mut seen) = (Vec::new(), BTreeSet::new());
        let mut left: Vec<String> = link::needs(text_of_main).map(str::to_owned).collect();
        while let Some(name) = left.pop() {
            if !seen.insert(name.clone()) || name == "lens" || name == records::NAME {
                continue;
            }
            let files: Vec<String> = match self.slots.get_key_value(name.as_str()) {
                Some((slot, variants)) => {
                    slots.push(*slot);
                    variants.iter().map(|variant| format!("{slot}/{variant}")).collect()
                }
                None => vec![format!("common/{name}")],
            };
            for file in files {
                left.extend(link::needs(&text(&file)).map(str::to_owned));
            }
        }
        slots
    }

    /// Links a kernel with every combination of the variants of its slots; returns how many there are.
    ///
    /// A combination that the product does not have may not link: a kernel that writes the counters cannot read them as
    /// a uniform. `fixed` says what is one way only.
    fn link_all(&mut self, kernel: &Link, main: &str, fixed: &[(&str, &str)]) -> usize {
        let before = self.combinations;
        let slots = self.slots_of(main);
        let kernel = fixed.iter().fold(kernel.clone(), |kernel, (slot, variant)| kernel.with(slot, variant));
        let open: Vec<_> =
            slots.into_iter().filter(|slot| fixed.iter().all(|(fixed, _)| fixed != slot)).collect();
        self.resolve(kernel, &open, &mut fixed.iter().map(|(s, v)| format!("{s}/{v}")).collect());
        self.combinations - before
    }

    fn resolve(&mut self, kernel: Link, open: &[&'static str], chosen: &mut Vec<String>) {
        let Some((slot, rest)) = open.split_first() else {
            let linked = self.plan.source(&kernel).and_then(|source| source.link());
            return self.check(&linked.unwrap_or_else(|error| panic!("{chosen:?}: {error:#}")), chosen);
        };
        for variant in self.slots[slot].clone() {
            chosen.push(format!("{slot}/{variant}"));
            self.resolve(kernel.clone().with(slot, variant), rest, chosen);
            chosen.pop();
        }
    }

    /// Every kernel runs on an adapter that has what WebGPU guarantees, and no more.
    fn check_bindings(linked: &Linked, chosen: &[String]) {
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
            assert!(count <= most as usize, "{} with {chosen:?} has {count} {name}, of {most}", linked.label);
        }
    }

    fn check(&mut self, linked: &Linked, chosen: &[String]) {
        self.combinations += 1;
        self.used.extend(chosen.iter().cloned());
        let entry = &linked.module.entry_points;
        assert!(entry.len() == 1 && entry[0].name == "main", "{}", linked.label);
        let names: BTreeSet<&str> = linked.bindings.iter().map(|binding| binding.name.as_str()).collect();
        assert_eq!(names.len(), linked.bindings.len(), "{}: {names:?}", linked.label);
        Self::check_bindings(linked, chosen);
        let built_in = |argument: &naga::FunctionArgument| {
            argument.binding == Some(naga::Binding::BuiltIn(naga::BuiltIn::NumWorkGroups))
        };
        let main = &entry[0].function;
        assert!(!main.arguments.iter().any(built_in), "{} reads num_workgroups", linked.label);
        for layout in LAYOUTS {
            let found =
                linked.module.types.iter().find(|(_, kind)| kind.name.as_deref() == Some(layout.name));
            if let Some((_, kind)) = found {
                compare(&linked.label, kind, *layout);
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

/// What of a kernel's slots is one way only: scans and the end of a step write the counters, and a scan knows what.
fn fixed(file: &str) -> Vec<(&'static str, &'static str)> {
    match file {
        "scan" | "finish" | "occupancy_samples" => vec![("counted", "written")],
        "scatter_ordered" => vec![("counted", "read"), ("gradient_add", "ordered")],
        _ => vec![("counted", "read")],
    }
}

#[test]
fn every_combination_links() {
    for (memory, cascades) in [(TensorMemory::Buffers, 1), (TensorMemory::Textures, 3)] {
        let mut linker = Linker::new(plan(memory, cascades));
        let capacity = PageCapacity::of(&wgpu::Limits::default(), memory);
        for file in link::entry_points() {
            // What single kernels know of their own.
            let own = [("CAPACITY", 16), ("CAMERA_COUNT", 3), ("PARAMETER_QUADS", 8), ("MARCH_LANES", 4)];
            let kernel = Link::of_file(file, file).counts(&own).float("RATE", 1.0).float("L2", 0.1);
            let main = text(file);
            let count = match link::needs(&main).any(|needed| needed == "pixels") {
                // How many pages the photos fill, and which lenses the cameras have.
                true => [1, capacity.pages()]
                    .into_iter()
                    .map(|pages| {
                        linker.link_all(
                            &kernel.clone().part(records::NAME, capacity.part(records::NAME, pages)),
                            &main,
                            &fixed(file),
                        )
                    })
                    .sum(),
                false => linker.link_all(&kernel, &main, &fixed(file)),
            };
            println!("{memory:?} {file}: {count}");
            assert!(count > 0, "{file} does not link");
        }
        for (width, product) in [(16, Product::Rows(2)), (64, Product::SharedWeights), (48, Product::Tiled)] {
            for (name, main) in
                [("forward", product.forward(width, 16)), ("backward", product.backward(width, width, 16))]
            {
                let kernel = Link::of_text(name, main.clone())
                    .counts(&[("INPUT_QUADS", width / 4), ("OUTPUT_QUADS", 4)]);
                // The gradient of colours ends in their own buffer.
                let layers: &[&[(&str, &str)]] = match name {
                    "forward" => &[&[]],
                    _ => &[
                        &[("layer_gradient", "linear")],
                        &[("layer_gradient", "color"), ("layer_d_store", "hidden")],
                    ],
                };
                for layer in layers {
                    let count =
                        linker.link_all(&kernel, &main, &[layer, [("counted", "read")].as_slice()].concat());
                    println!("{memory:?} {name} {width}: {count}");
                    assert!(count > 0, "{name} does not link");
                }
            }
        }
        let products = [
            (4, Product::Rows(2)),
            (16, Product::Rows(2)),
            (4, Product::SharedWeights),
            (64, Product::SharedWeights),
            (48, Product::Tiled),
        ];
        for (outputs, product) in products {
            let main = product.weight_gradient(16, outputs);
            let kernel = Link::of_text("weight gradient", main.clone());
            assert!(linker.link_all(&kernel, &main, &[("counted", "read")]) > 0);
        }
        let unused: Vec<_> = linker
            .slots
            .iter()
            .flat_map(|(slot, variants)| variants.iter().map(move |variant| format!("{slot}/{variant}")))
            .filter(|name| !linker.used.contains(name))
            .collect();
        assert!(unused.is_empty(), "no kernel uses {unused:?}");
        assert_eq!(linker.compared.len(), LAYOUTS.len(), "compared only {:?}", linker.compared);
        println!("{memory:?}: {} combinations", linker.combinations);
    }
}

#[test]
fn every_set_of_lenses_links() {
    let mut linker = Linker::new(plan(TensorMemory::Buffers, 1));
    for lenses in lens_sets() {
        linker.plan.features.lenses = lenses;
        // Rays of a view begin, and their samples are told their depth.
        let of_view = [
            ("counted", "read"),
            ("distance", "depth"),
            ("extent", "round"),
            ("jitter", "off"),
            ("space", "cube"),
        ];
        for file in ["view_rays", "samples"] {
            linker.link_all(&Link::of_file(file, file), &text(file), &of_view);
        }
    }
    assert_eq!(linker.combinations, 2 * 31);
}

/// The table in `shaders/README.md` is what the linker goes by.
#[test]
fn the_table_of_slots_is_true() {
    let variants: BTreeMap<_, _> = link::slots().into_iter().collect();
    let chosen_by: Vec<_> = variants::chosen_by().collect();
    let named: BTreeSet<_> = chosen_by.iter().map(|(slot, _)| *slot).collect();
    assert_eq!(named, variants.keys().copied().collect(), "every folder is a slot, and every slot a folder");
    let row = |(slot, by): &(&str, &str)| {
        let mut files = variants[slot].clone();
        files.sort_unstable();
        let files: Vec<_> = files.iter().map(|file| format!("`{file}`")).collect();
        format!("| `{slot}` | {} | {by} |\n", files.join(", "))
    };
    let rows: String = chosen_by.iter().map(row).collect();
    let table = format!("| slot | variants | chosen by |\n| --- | --- | --- |\n{rows}");
    let readme = std::fs::read_to_string("shaders/README.md").expect("a readme");
    assert!(readme.contains(&table), "shaders/README.md should have:\n{table}");
}

/// A line of needs that names what the file does not use, or that is not there at all, misleads.
#[test]
fn files_use_what_they_say_that_they_need() {
    let slots: BTreeMap<_, _> = link::slots().into_iter().collect();
    let mut names: Vec<String> = link::entry_points().map(str::to_owned).collect();
    for (slot, variants) in &slots {
        names.extend(variants.iter().map(|variant| format!("{slot}/{variant}")));
    }
    for name in names {
        let own = text(&name);
        let code: String = own.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
        for needed in link::needs(&own).filter(|needed| !["lens", records::NAME].contains(needed)) {
            let files: Vec<String> = match slots.get(needed) {
                Some(variants) => variants.iter().map(|variant| format!("{needed}/{variant}")).collect(),
                None => vec![format!("common/{needed}")],
            };
            let mut defined: Vec<String> = files.iter().flat_map(|file| definitions(&text(file))).collect();
            if needed == "counters" {
                defined.push("counters".to_owned());
            }
            assert!(defined.iter().any(|word| code.contains(word.as_str())), "{name} does not use {needed}");
        }
    }
}

/// A folder is a slot: what other files call of one of its files, all of them define, so that each can take another's place.
#[test]
fn variants_are_interchangeable() {
    let slots = link::slots();
    for (slot, variants) in &slots {
        let functions: Vec<BTreeSet<String>> =
            variants.iter().map(|variant| signatures(&text(&format!("{slot}/{variant}")))).collect();
        let first = functions.first().unwrap_or_else(|| panic!("no files in {slot}"));
        let common = functions.iter().fold(first.clone(), |common, own| &common & own);
        let others = slots.iter().filter(|(other, _)| other != slot);
        let others =
            others.flat_map(|(other, files)| files.iter().map(move |file| format!("{other}/{file}")));
        let others: Vec<String> = others.chain(link::entry_points().map(str::to_owned)).collect();
        for (own, variant) in functions.iter().zip(variants) {
            for signature in own.difference(&common) {
                let name = signature.split('(').next().unwrap_or_default();
                let caller = others.iter().find(|file| text(file).contains(&format!("{name}(")));
                assert!(caller.is_none(), "{caller:?} calls {name}, which only {slot}/{variant} defines");
            }
        }
    }
}

/// The functions of a file, each with the types of its parameters and its own.
fn signatures(text: &str) -> BTreeSet<String> {
    let signature = |line: &str| {
        let (name, rest) = line.strip_prefix("fn ")?.split_once('(')?;
        let (parameters, rest) = rest.split_once(") ")?;
        let types: Vec<_> =
            parameters.split(", ").map(|own| own.split_once(": ").map_or(own, |own| own.1)).collect();
        Some(format!("{name}({}) {}", types.join(", "), rest.split('{').next()?.trim()))
    };
    text.lines().filter_map(signature).collect()
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

#[test]
fn what_is_missing_is_named() {
    let message = |link: &Link| {
        let error = plan(TensorMemory::Buffers, 1).source(link).expect_err("something is missing");
        format!("{error:#}")
    };
    assert!(message(&Link::of("no such kernel")).contains("'no such kernel'"));
    let unknown = message(&Link::of_text("probe", "// needs: nothing_known\nfn main() {}\n".to_owned()));
    assert!(unknown.contains("'probe' needs 'nothing_known'"), "{unknown}");
    let open = message(&Link::of("kept"));
    assert!(open.contains("'kept' needs 'packing'") && open.contains("no variant"), "{open}");
}
