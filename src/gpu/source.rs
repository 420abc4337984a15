//! Linking WGSL: generated constants in front of whole files, checked and bound by naga.
//!
//! A part declares the buffers it touches without `@group` and `@binding`; the linker numbers them, and
//! [`super::kernel::Kernel`] binds them by name.

use super::tensor::{self, Element, TensorMemory};
use anyhow::{Result, anyhow};
use std::fmt::{Display, Write};
use std::iter;
use wgpu::naga;

/// WGSL text under construction: constants first, then parts, each once.
#[derive(Clone, Debug, Default)]
pub struct Source {
    label: String,
    memory: TensorMemory,
    constants: String,
    parts: Vec<(String, String)>,
}

/// A checked module and which of its buffers the entry point uses.
#[derive(Debug)]
pub struct Linked {
    /// The kernel's name.
    pub label: String,
    /// The module, its buffers numbered in the order of `bindings`.
    pub module: naga::Module,
    /// The resources the entry point `main` reaches; the index is the binding number.
    pub bindings: Vec<Binding>,
    /// Threads of a workgroup along x.
    pub group_size: u32,
}

/// One buffer or texture of a kernel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Binding {
    /// The WGSL variable's name.
    pub name: String,
    /// How the kernel sees it.
    pub kind: wgpu::BindingType,
}

impl Source {
    /// An empty source for the kernel `label`.
    #[must_use]
    pub fn new(label: &str) -> Self {
        Self { label: label.to_owned(), ..Self::default() }
    }

    /// Chooses where the kernel's tensors live.
    #[must_use]
    pub fn memory(self, memory: TensorMemory) -> Self {
        Self { memory, ..self }
    }

    /// Adds `const name = value;`, the value written as WGSL reads it (`4u`, `0.5`).
    #[must_use]
    pub fn constant(mut self, name: &str, value: impl Display) -> Self {
        // Writing to a String cannot fail.
        let _ = writeln!(self.constants, "const {name} = {value};");
        self
    }

    /// Adds an f32 constant with all its digits.
    #[must_use]
    pub fn float(self, name: &str, value: f64) -> Self {
        let value = value as f32;
        self.constant(name, format_args!("f32({value:?})"))
    }

    /// Adds a u32 constant.
    #[must_use]
    pub fn count(self, name: &str, value: usize) -> Self {
        self.constant(name, format_args!("{value}u"))
    }

    /// Adds a whole file; a name that is already there is not added twice.
    #[must_use]
    pub fn part(mut self, name: &str, text: impl Into<String>) -> Self {
        if !self.parts.iter().any(|(present, _)| present == name) {
            self.parts.push((name.to_owned(), text.into()));
        }
        self
    }

    /// The text that the driver compiles, before the buffers are numbered.
    #[must_use]
    pub fn text(&self) -> String {
        let headings: Vec<String> = self.parts.iter().map(|(name, _)| format!("// {name}")).collect();
        let parts = headings.iter().zip(&self.parts);
        let lines: Vec<&str> =
            parts.flat_map(|(heading, (_, part))| iter::once(heading.as_str()).chain(part.lines())).collect();
        let mut text = self.constants.clone();
        for line in tensor::expanded(&lines, self.memory) {
            let _ = writeln!(text, "{line}");
        }
        text
    }

    /// Parses, numbers the buffers and validates.
    ///
    /// # Errors
    /// naga's message with the part and its line.
    pub fn link(&self) -> Result<Linked> {
        let text = self.text();
        let mut module = naga::front::wgsl::parse_str(&text).map_err(|error| {
            let place = error.location(&text).map_or(String::new(), |at| self.place(at.line_number));
            anyhow!("linking the kernel '{}': {place}: {}", self.label, error.emit_to_string(&text))
        })?;
        for (index, (_, variable)) in module.global_variables.iter_mut().enumerate() {
            if is_resource(variable.space) {
                variable.binding = Some(naga::ResourceBinding { group: 0, binding: index as u32 });
            }
        }
        let info = naga::valid::Validator::new(
            naga::valid::ValidationFlags::all(),
            naga::valid::Capabilities::all(),
        )
        .validate(&module)
        .map_err(|error| anyhow!("checking the kernel '{}': {}", self.label, error.emit_to_string(&text)))?;
        let entry = info.get_entry_point(0);
        // What the entry point does not reach gets numbers behind the used ones, to stay valid.
        let (used, unused): (Vec<_>, Vec<_>) = module
            .global_variables
            .iter()
            .filter(|(_, variable)| is_resource(variable.space))
            .map(|(handle, _)| handle)
            .partition(|&handle| !entry[handle].is_empty());
        let bindings = used.iter().map(|&handle| {
            let variable = &module.global_variables[handle];
            Binding { name: variable.name.clone().unwrap_or_default(), kind: binding_type(&module, variable) }
        });
        let bindings = bindings.collect();
        for (binding, handle) in used.into_iter().chain(unused).enumerate() {
            let resource = naga::ResourceBinding { group: 0, binding: binding as u32 };
            module.global_variables[handle].binding = Some(resource);
        }
        let group_size = module.entry_points[0].workgroup_size[0];
        Ok(Linked { label: self.label.clone(), module, bindings, group_size })
    }

    /// Names the part that holds `line` of the linked text, and the line within it.
    fn place(&self, line: u32) -> String {
        let mut first = self.constants.lines().count() as u32 + 1;
        for (name, part) in &self.parts {
            let length = part.lines().count() as u32 + 1;
            if line < first + length {
                return format!("{name}:{}", line - first);
            }
            first += length;
        }
        "constants".to_owned()
    }
}

fn is_resource(space: naga::AddressSpace) -> bool {
    use naga::AddressSpace as Space;
    matches!(space, Space::Storage { .. } | Space::Uniform | Space::Handle)
}

fn binding_type(module: &naga::Module, variable: &naga::GlobalVariable) -> wgpu::BindingType {
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    match (variable.space, &module.types[variable.ty].inner) {
        (naga::AddressSpace::Storage { access }, _) => buffer(wgpu::BufferBindingType::Storage {
            read_only: !access.contains(naga::StorageAccess::STORE),
        }),
        (_, naga::TypeInner::Image { class: naga::ImageClass::Storage { format, access }, .. }) => {
            wgpu::BindingType::StorageTexture {
                access: match (
                    access.contains(naga::StorageAccess::LOAD),
                    access.contains(naga::StorageAccess::STORE),
                ) {
                    (true, true) => wgpu::StorageTextureAccess::ReadWrite,
                    (true, false) => wgpu::StorageTextureAccess::ReadOnly,
                    _ => wgpu::StorageTextureAccess::WriteOnly,
                },
                format: texture_format(*format),
                view_dimension: wgpu::TextureViewDimension::D2,
            }
        }
        (_, naga::TypeInner::Image { class: naga::ImageClass::Sampled { kind, .. }, arrayed, .. }) => {
            wgpu::BindingType::Texture {
                sample_type: match kind {
                    naga::ScalarKind::Uint => wgpu::TextureSampleType::Uint,
                    _ => wgpu::TextureSampleType::Float { filterable: false },
                },
                view_dimension: match arrayed {
                    true => wgpu::TextureViewDimension::D2Array,
                    false => wgpu::TextureViewDimension::D2,
                },
                multisampled: false,
            }
        }
        _ => buffer(wgpu::BufferBindingType::Uniform),
    }
}

fn texture_format(format: naga::StorageFormat) -> wgpu::TextureFormat {
    match format {
        naga::StorageFormat::Rg32Float => Element::Vec2.format(),
        naga::StorageFormat::Rg32Uint => Element::Vec2u.format(),
        naga::StorageFormat::R32Uint => Element::U32.format(),
        _ => Element::Vec4.format(),
    }
}
