//! A compute pipeline whose buffers are bound by name and whose structs are checked against Rust's.

use super::Gpu;
use super::buffer::Buffer;
use super::pipeline::{Job, Pipeline};
use super::source::{Binding, Linked, Source};
use super::tensor::{Tensor, TensorStorage};
use anyhow::{Result, anyhow, bail};
use wgpu::naga;

/// Name, fields and size of a `#[repr(C)]` struct that is shared with WGSL.
#[derive(Clone, Copy, Debug)]
pub struct StructLayout {
    /// The struct's name in WGSL.
    pub name: &'static str,
    /// Each field with its byte offset.
    pub fields: &'static [(&'static str, usize)],
    /// Size in bytes.
    pub size: usize,
}

/// A struct shared with WGSL; made by [`crate::gpu_struct!`].
pub trait Shared: bytemuck::Pod {
    /// Where its fields lie.
    const LAYOUT: StructLayout;
}

/// Defines a `#[repr(C)]` struct of plain numbers together with its field list. `Name as Other` is called `Other` in WGSL.
#[macro_export]
macro_rules! gpu_struct {
    ($(#[$meta:meta])* $name:ident { $($fields:tt)* }) => {
        $crate::gpu_struct! { $(#[$meta])* $name as $name { $($fields)* } }
    };
    ($(#[$meta:meta])* $name:ident as $wgsl:ident { $($(#[$field_meta:meta])* $field:ident: $kind:ty),* $(,)? }) => {
        $(#[$meta])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
        pub struct $name { $($(#[$field_meta])* pub $field: $kind),* }
        impl $crate::gpu::kernel::Shared for $name {
            const LAYOUT: $crate::gpu::kernel::StructLayout = $crate::gpu::kernel::StructLayout {
                name: stringify!($wgsl),
                fields: &[$((stringify!($field), core::mem::offset_of!($name, $field))),*],
                size: core::mem::size_of::<$name>(),
            };
        }
    };
}

/// A kernel with the entry point `main`, which the driver may still compile.
#[derive(Debug)]
pub struct Kernel {
    /// The kernel's name, also in profiles.
    pub label: String,
    pipeline: Pipeline,
    group: wgpu::BindGroupLayout,
    bindings: Vec<Binding>,
    group_size: u32,
}

/// A kernel with its buffers: ready to be dispatched.
#[derive(Debug)]
pub struct Bound {
    /// The kernel's name.
    pub label: String,
    /// Threads of a workgroup along x, as its shader says.
    pub group_size: u32,
    pub(super) pipeline: Pipeline,
    pub(super) group: wgpu::BindGroup,
}

/// A buffer or a texture under the name a kernel knows it by.
#[derive(Clone, Debug)]
pub struct Resource<'a> {
    /// The WGSL variable's name.
    pub name: &'a str,
    /// What is bound.
    pub binding: wgpu::BindingResource<'a>,
}

impl Buffer {
    /// The whole buffer under its own name.
    #[must_use]
    pub fn resource(&self) -> Resource<'_> {
        self.named(self.name)
    }

    /// The whole buffer under another name.
    #[must_use]
    pub fn named<'a>(&'a self, name: &'a str) -> Resource<'a> {
        Resource { name, binding: self.raw.as_entire_binding() }
    }

    /// `length` bytes from `offset` on under another name.
    #[must_use]
    pub fn range<'a>(&'a self, name: &'a str, offset: u64, length: u64) -> Resource<'a> {
        let binding = wgpu::BufferBinding { buffer: &self.raw, offset, size: wgpu::BufferSize::new(length) };
        Resource { name, binding: wgpu::BindingResource::Buffer(binding) }
    }
}

impl Tensor {
    /// The tensor under a name.
    #[must_use]
    pub fn named<'a>(&'a self, name: &'a str) -> Resource<'a> {
        let binding = match &self.place {
            TensorStorage::Buffer(buffer) => buffer.as_entire_binding(),
            TensorStorage::Texture(_, view) => wgpu::BindingResource::TextureView(view),
        };
        Resource { name, binding }
    }
}

impl Kernel {
    /// Links `source`, compares the structs that it names with `layouts` and begins to compile the pipeline. That the driver
    /// refuses it is told where it runs, by [`Gpu::run`].
    ///
    /// # Errors
    /// When the WGSL does not link, a struct differs from Rust's, it has more bindings than the adapter takes, or the
    /// device's interrupt was raised.
    pub fn new(gpu: &Gpu, source: &Source, layouts: &[StructLayout]) -> Result<Self> {
        gpu.interrupt.check()?;
        let Linked { label, module, bindings, group_size } = source.link()?;
        for layout in layouts {
            compare_layout(&label, &module, layout)?;
        }
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let group = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(&label),
            entries: &layout_entries(&bindings),
        });
        if let Some(error) = pollster::block_on(scope.pop()) {
            bail!("creating the kernel '{label}' on '{}': {error}", gpu.info.name);
        }
        let pipeline = Pipeline::begin(gpu, Job { label: label.clone(), module, group: group.clone() });
        Ok(Self { label, pipeline, group, bindings, group_size })
    }

    /// Binds the buffers this kernel uses out of `resources`; others are ignored.
    ///
    /// # Errors
    /// When one is missing: a mistake in the program, named so that it is found at once.
    pub fn bind(&self, gpu: &Gpu, resources: &[Resource<'_>]) -> Result<Bound> {
        let entries = self
            .bindings
            .iter()
            .enumerate()
            .map(|(index, binding)| {
                let found = resources.iter().find(|r| r.name == binding.name).ok_or_else(|| {
                    anyhow!("the kernel '{}' needs the buffer '{}'", self.label, binding.name)
                })?;
                Ok(wgpu::BindGroupEntry { binding: index as u32, resource: found.binding.clone() })
            })
            .collect::<Result<Vec<_>>>()?;
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(&self.label),
            layout: &self.group,
            entries: &entries,
        });
        let (label, pipeline) = (self.label.clone(), self.pipeline.clone());
        Ok(Bound { label, group_size: self.group_size, pipeline, group })
    }
}

fn layout_entries(bindings: &[Binding]) -> Vec<wgpu::BindGroupLayoutEntry> {
    bindings
        .iter()
        .enumerate()
        .map(|(index, binding)| wgpu::BindGroupLayoutEntry {
            binding: index as u32,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: binding.kind,
            count: None,
        })
        .collect()
}

/// Compares a Rust struct with the WGSL struct of the same name.
fn compare_layout(label: &str, module: &naga::Module, layout: &StructLayout) -> Result<()> {
    let found = module.types.iter().find(|(_, kind)| kind.name.as_deref() == Some(layout.name));
    let Some((_, naga::Type { inner: naga::TypeInner::Struct { members, span }, .. })) = found else {
        return Ok(());
    };
    let wgsl: Vec<(String, usize)> = members
        .iter()
        .map(|member| (member.name.clone().unwrap_or_default(), member.offset as usize))
        .collect();
    let rust: Vec<(String, usize)> =
        layout.fields.iter().map(|&(name, offset)| (name.to_owned(), offset)).collect();
    if wgsl != rust || *span as usize != layout.size {
        bail!(
            "the struct '{}' of the kernel '{label}' differs:\n  WGSL {wgsl:?}, {span} bytes\n  Rust {rust:?}, {} bytes",
            layout.name,
            layout.size
        );
    }
    Ok(())
}
