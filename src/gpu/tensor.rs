//! Arrays that live in a storage buffer or, where that is faster, in a texture.
//!
//! llvmpipe reads a storage buffer lane by lane, with a bounds check each; texels it gathers. A vec4 from a
//! texture costs a tenth of one from a buffer there, which is worth a factor of three on a whole step; and a storage
//! texture, which has one size, a third of a sampled one, whose size it looks up by the mipmap level of every lane. GPUs
//! read all equally fast, and buffers can be larger: there every tensor is a buffer.
//!
//! WGSL declares `tensor<read> name: vec4<f32>;` (or `write`, `read_write`; `vec2<f32>`, `vec2<u32>`, `u32`)
//! and calls `name_load(index)` and `name_store(index, value)`. It is the one extension of the linker.

use super::Gpu;
use anyhow::{Result, ensure};
use bytemuck::Pod;
use std::borrow::Cow;

/// Where the tensors of a kernel live.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TensorMemory {
    /// Storage buffers.
    #[default]
    Buffers,
    /// Textures [`WIDTH`] texels wide.
    Textures,
}

/// What an adapter must have for tensors in textures.
pub const TEXTURE_FEATURES: wgpu::Features =
    wgpu::Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES.union(wgpu::Features::CLEAR_TEXTURE);

/// Texels per row.
pub const WIDTH: usize = 1024;

/// The type of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// `vec4<f32>`
    Vec4,
    /// `vec2<f32>`
    Vec2,
    /// `vec2<u32>`
    Vec2u,
    /// `u32`
    U32,
}

impl Element {
    const ALL: [Self; 4] = [Self::Vec4, Self::Vec2, Self::Vec2u, Self::U32];

    /// The WGSL type.
    #[must_use]
    pub fn wgsl(self) -> &'static str {
        match self {
            Self::Vec4 => "vec4<f32>",
            Self::Vec2 => "vec2<f32>",
            Self::Vec2u => "vec2<u32>",
            Self::U32 => "u32",
        }
    }

    /// Bytes per element.
    #[must_use]
    pub fn bytes(self) -> usize {
        match self {
            Self::Vec4 => 16,
            Self::Vec2 | Self::Vec2u => 8,
            Self::U32 => 4,
        }
    }

    /// The texture format that holds it.
    #[must_use]
    pub fn format(self) -> wgpu::TextureFormat {
        match self {
            Self::Vec4 => wgpu::TextureFormat::Rgba32Float,
            Self::Vec2 => wgpu::TextureFormat::Rg32Float,
            Self::Vec2u => wgpu::TextureFormat::Rg32Uint,
            Self::U32 => wgpu::TextureFormat::R32Uint,
        }
    }

    /// Format name, sampled type, components and the value widened to four components.
    fn texel(self) -> (&'static str, &'static str, &'static str, &'static str) {
        match self {
            Self::Vec4 => ("rgba32float", "f32", "", "value"),
            Self::Vec2 => ("rg32float", "f32", ".xy", "vec4(value, 0.0, 0.0)"),
            Self::Vec2u => ("rg32uint", "u32", ".xy", "vec4(value, 0u, 0u)"),
            Self::U32 => ("r32uint", "u32", ".x", "vec4(value, 0u, 0u, 0u)"),
        }
    }
}

/// A declaration of a tensor in WGSL.
#[derive(Clone, Copy, Debug)]
struct Declaration<'a> {
    access: &'a str,
    name: &'a str,
    element: Element,
}

impl<'a> Declaration<'a> {
    /// What `line` declares, if it declares a tensor.
    fn of(line: &'a str) -> Option<Self> {
        let (access, rest) = line.strip_prefix("tensor<")?.split_once("> ")?;
        let (name, kind) = rest.trim_end().strip_suffix(';')?.split_once(": ")?;
        let element = Element::ALL.into_iter().find(|element| element.wgsl() == kind)?;
        Some(Self { access, name, element })
    }

    fn is_written(&self) -> bool {
        self.access != "read"
    }

    /// Its WGSL: one line, so that positions in error messages stay true.
    fn text(&self, memory: TensorMemory, is_storage: bool) -> String {
        let Self { access, name, element } = *self;
        let kind = element.wgsl();
        let (format, sampled, components, widened) = element.texel();
        let at = format!("vec2<u32>(index % {WIDTH}u, index / {WIDTH}u)");
        let (variable, load, store) = match memory {
            TensorMemory::Buffers => {
                let access = if self.is_written() { "read_write" } else { "read" };
                let variable = format!("var<storage, {access}> {name}: array<{kind}>;");
                (variable, format!("{name}[index]"), format!("{name}[index] = value;"))
            }
            TensorMemory::Textures if is_storage => {
                let variable = format!("var {name}: texture_storage_2d<{format}, {access}>;");
                let load = format!("textureLoad({name}, {at}){components}");
                (variable, load, format!("textureStore({name}, {at}, {widened});"))
            }
            TensorMemory::Textures => {
                let load = format!("textureLoad({name}, {at}, 0){components}");
                (format!("var {name}: texture_2d<{sampled}>;"), load, String::new())
            }
        };
        let mut text = variable;
        if access != "write" {
            text += &format!(" fn {name}_load(index: u32) -> {kind} {{ return {load}; }}");
        }
        if self.is_written() {
            text += &format!(" fn {name}_store(index: u32, value: {kind}) {{ {store} }}");
        }
        text
    }
}

/// The lines of a kernel with their declarations of tensors expanded. As many as WebGPU guarantees become storage textures, those
/// that are written before all, then those of the last lines, where the entry point is; what is only read can be sampled, too.
pub fn expanded<'a>(lines: &[&'a str], memory: TensorMemory) -> Vec<Cow<'a, str>> {
    let written = lines.iter().filter_map(|line| Declaration::of(line)).filter(Declaration::is_written);
    let most = wgpu::Limits::default().max_storage_textures_per_shader_stage as usize;
    let mut left = most.saturating_sub(written.count());
    let expanded = |line: &&'a str| {
        let Some(tensor) = Declaration::of(line) else { return Cow::Borrowed(*line) };
        let is_storage = tensor.is_written() || left > 0;
        left -= usize::from(is_storage && !tensor.is_written());
        Cow::Owned(tensor.text(memory, is_storage))
    };
    let mut text: Vec<_> = lines.iter().rev().map(expanded).collect();
    text.reverse();
    text
}

/// An array on the device.
#[derive(Clone, Debug)]
pub struct Tensor {
    /// The name of the WGSL declaration it stands for.
    pub name: &'static str,
    /// The type of its elements.
    pub element: Element,
    /// Number of elements.
    pub count: usize,
    /// Where they live.
    pub place: TensorStorage,
}

/// Where a tensor lives.
#[derive(Clone, Debug)]
pub enum TensorStorage {
    /// A storage buffer.
    Buffer(wgpu::Buffer),
    /// A texture and its only view.
    Texture(wgpu::Texture, wgpu::TextureView),
}

impl Tensor {
    /// Bytes on the device.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        (self.count * self.element.bytes()) as u64
    }

    /// The commands that set it to zero.
    pub fn clear(&self, encoder: &mut wgpu::CommandEncoder) {
        match &self.place {
            TensorStorage::Buffer(buffer) => encoder.clear_buffer(buffer, 0, None),
            TensorStorage::Texture(texture, _) => {
                encoder.clear_texture(texture, &wgpu::ImageSubresourceRange::default());
            }
        }
    }
}

impl Gpu {
    /// The memory that suits this adapter.
    #[must_use]
    pub fn fast_memory(&self) -> TensorMemory {
        if self.is_cpu() && self.has(TEXTURE_FEATURES) {
            TensorMemory::Textures
        } else {
            TensorMemory::Buffers
        }
    }

    /// A zeroed tensor.
    ///
    /// # Errors
    /// When it is larger than the adapter can bind; the message says both sizes.
    pub fn tensor(
        &self,
        name: &'static str,
        element: Element,
        count: usize,
        memory: TensorMemory,
    ) -> Result<Tensor> {
        let place = match memory {
            TensorMemory::Buffers => {
                TensorStorage::Buffer(self.storage::<u8>(name, count * element.bytes())?.raw)
            }
            TensorMemory::Textures => self.texture(name, element, count)?,
        };
        Ok(Tensor { name, element, count, place })
    }

    /// Whether the adapter has textures for so many elements.
    pub(super) fn check_texture(&self, name: &str, count: usize) -> Result<()> {
        let (rows, most) = (texture_rows(count), self.device.limits().max_texture_dimension_2d as usize);
        ensure!(
            rows <= most,
            "the tensor '{name}' needs {rows} rows of {WIDTH} texels, and the adapter '{}' has textures of at most \
             {most} rows",
            self.info.name
        );
        Ok(())
    }

    fn texture(&self, name: &'static str, element: Element, count: usize) -> Result<TensorStorage> {
        self.check_texture(name, count)?;
        let rows = texture_rows(count);
        use wgpu::TextureUsages as Usage;
        let texture = self.allocated(name, (rows * WIDTH * element.bytes()) as u64, || {
            self.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(name),
                size: wgpu::Extent3d { width: WIDTH as u32, height: rows as u32, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: element.format(),
                usage: Usage::TEXTURE_BINDING | Usage::STORAGE_BINDING | Usage::COPY_SRC | Usage::COPY_DST,
                view_formats: &[],
            })
        })?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Ok(TensorStorage::Texture(texture, view))
    }

    /// Writes `data` at the tensor's start, before the next submission.
    pub fn write_tensor<T: Pod>(&self, tensor: &Tensor, data: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        match &tensor.place {
            TensorStorage::Buffer(buffer) => self.queue.write_buffer(buffer, 0, bytes),
            TensorStorage::Texture(texture, _) => {
                let row = WIDTH * tensor.element.bytes();
                let mut padded = bytes.to_vec();
                padded.resize(bytes.len().next_multiple_of(row), 0);
                let height = padded.len() / row;
                if height > 0 {
                    self.queue.write_texture(
                        texture.as_image_copy(),
                        &padded,
                        row_layout(tensor.element),
                        wgpu::Extent3d {
                            width: WIDTH as u32,
                            height: height as u32,
                            depth_or_array_layers: 1,
                        },
                    );
                }
            }
        }
    }

    /// Reads the first `count` values of type `T`, waiting for the device.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn read_tensor<T: Pod>(&self, tensor: &Tensor, count: usize) -> Result<Vec<T>> {
        let bytes = count * size_of::<T>();
        let (TensorStorage::Texture(texture, _), 1..) = (&tensor.place, count) else {
            let TensorStorage::Buffer(buffer) = &tensor.place else { return Ok(Vec::new()) };
            return self.read(&super::buffer::Buffer { name: tensor.name, raw: buffer.clone() }, 0, count);
        };
        let row = WIDTH * tensor.element.bytes();
        let rows = bytes.div_ceil(row);
        let staging = self.storage::<u8>("read back", rows * row)?;
        let mut encoder = self.encoder("read back");
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo { buffer: &staging.raw, layout: row_layout(tensor.element) },
            wgpu::Extent3d { width: WIDTH as u32, height: rows as u32, depth_or_array_layers: 1 },
        );
        self.submit(encoder);
        self.read(&staging, 0, count)
    }
}

fn texture_rows(count: usize) -> usize {
    count.div_ceil(WIDTH).max(1)
}

fn row_layout(element: Element) -> wgpu::TexelCopyBufferLayout {
    wgpu::TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: Some((WIDTH * element.bytes()) as u32),
        rows_per_image: None,
    }
}
