//! An array of words that may be larger than one binding: rows of [`ROW`] words in as many pages as it takes.
//!
//! A page is a storage buffer or, where that is faster, an array of textures. Kernels call `name_word(first_row,
//! word)` of the part that [`PagedArray::part`] generates, and do not know where a page ends.

use super::Gpu;
use super::buffer::Buffer;
use super::kernel::Resource;
use super::tensor::TensorMemory;
use crate::support::format;
use anyhow::{Context, Result, ensure};
use std::fmt::Write;

/// Words per row.
pub const ROW: usize = 4096;
/// Rows of one layer of a texture page.
const LAYER_ROWS: usize = 4096;
/// Bytes that software drivers allow for all layers of a texture stay below this.
const TEXTURE_BYTES: u64 = 1 << 30;
const ROW_BYTES: u64 = (ROW * size_of::<u32>()) as u64;
/// Storage buffers that a kernel may need besides; `tests/library/shaders.rs` sees to it.
const OTHER_BINDINGS: u32 = 3;
/// Bytes written before the device is waited for, which then lets go of its staging memory.
pub const STAGED_BYTES: u64 = 64 << 20;
/// Names of the pages.
const NAMES: [&str; 32] = [
    "page_0", "page_1", "page_2", "page_3", "page_4", "page_5", "page_6", "page_7", "page_8", "page_9",
    "page_10", "page_11", "page_12", "page_13", "page_14", "page_15", "page_16", "page_17", "page_18",
    "page_19", "page_20", "page_21", "page_22", "page_23", "page_24", "page_25", "page_26", "page_27",
    "page_28", "page_29", "page_30", "page_31",
];

/// How much an adapter holds, and how it is divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PageCapacity {
    memory: TensorMemory,
    /// Rows of one page.
    page_rows: usize,
    /// Most pages.
    pages: usize,
}

impl PageCapacity {
    /// What `limits` allow.
    #[must_use]
    pub fn of(limits: &wgpu::Limits, memory: TensorMemory) -> Self {
        let (page_rows, bindings) = match memory {
            TensorMemory::Buffers => {
                let bytes = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
                (bytes / ROW_BYTES, limits.max_storage_buffers_per_shader_stage)
            }
            TensorMemory::Textures => {
                let layers = u64::from(limits.max_texture_array_layers) * LAYER_ROWS as u64;
                (layers.min(TEXTURE_BYTES / ROW_BYTES), limits.max_sampled_textures_per_shader_stage)
            }
        };
        let pages = bindings.saturating_sub(OTHER_BINDINGS).max(1) as usize;
        Self { memory, page_rows: page_rows.max(1) as usize, pages: pages.min(NAMES.len()) }
    }

    /// Most pages.
    #[must_use]
    pub fn pages(&self) -> usize {
        self.pages
    }

    /// Most bytes of all pages together.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        (self.page_rows * self.pages) as u64 * ROW_BYTES
    }

    /// The part that reads an array of so many pages: `name_word(first_row, word)`.
    #[must_use]
    pub fn part(&self, name: &str, pages: usize) -> String {
        let Self { memory, page_rows, .. } = self;
        let mut text = String::new();
        let mut cases = String::new();
        for (index, page) in NAMES.iter().take(pages).enumerate() {
            let (declaration, load) = match memory {
                TensorMemory::Buffers => (
                    format!("var<storage, read> {page}: array<u32>;"),
                    format!("{page}[row * {ROW}u + column]"),
                ),
                TensorMemory::Textures => (
                    format!("var {page}: texture_2d_array<u32>;"),
                    format!(
                        "textureLoad({page}, vec2(column, row % {LAYER_ROWS}u), row / {LAYER_ROWS}u, 0).x"
                    ),
                ),
            };
            // Writing to a String cannot fail.
            let _ = writeln!(text, "{declaration}");
            let label = if index + 1 == pages { "default".into() } else { format!("case {index}u") };
            let _ = writeln!(cases, "        {label}: {{ return {load}; }}");
        }
        let _ = writeln!(
            text,
            "fn {name}_word(first_row: u32, word: u32) -> u32 {{\n    \
                 let column = word % {ROW}u;\n    \
                 let row = (first_row + word / {ROW}u) % {page_rows}u;\n    \
                 switch (first_row + word / {ROW}u) / {page_rows}u {{\n{cases}    }}\n}}"
        );
        text
    }

    /// The same with pages of at most `rows` rows, so that small arrays take several.
    #[must_use]
    pub fn with_page_rows(self, rows: usize) -> Self {
        Self { page_rows: self.page_rows.min(rows), ..self }
    }
}

/// Rows that `words` take, which begin a row of their own.
#[must_use]
pub fn rows_of(words: usize) -> usize {
    words.div_ceil(ROW)
}

/// Bytes that `rows` take.
#[must_use]
pub fn bytes_of(rows: usize) -> u64 {
    rows as u64 * ROW_BYTES
}

/// The array.
#[derive(Clone, Debug)]
pub struct PagedArray {
    name: &'static str,
    capacity: PageCapacity,
    pages: Vec<Page>,
    /// Bytes written since the device was waited for.
    staged: u64,
}

#[derive(Clone, Debug)]
enum Page {
    Buffer(Buffer),
    Texture(wgpu::Texture, wgpu::TextureView),
}

impl PagedArray {
    /// A zeroed array of `rows` rows.
    ///
    /// # Errors
    /// When the adapter cannot bind or does not have as much; the message says both sizes.
    pub fn new(gpu: &Gpu, name: &'static str, rows: usize, capacity: PageCapacity) -> Result<Self> {
        let count = rows.div_ceil(capacity.page_rows).max(1);
        ensure!(
            count <= capacity.pages,
            "the {name} need {} bytes on the device, and the adapter '{}' binds at most {} for them",
            bytes_of(rows),
            gpu.info.name,
            capacity.bytes()
        );
        let page = |index: usize| {
            let rows = rows.saturating_sub(index * capacity.page_rows).clamp(1, capacity.page_rows);
            match capacity.memory {
                TensorMemory::Buffers => Ok(Page::Buffer(gpu.storage::<u32>(NAMES[index], rows * ROW)?)),
                TensorMemory::Textures => texture(gpu, NAMES[index], rows),
            }
        };
        let pages: Result<Vec<_>> = (0..count).map(page).collect();
        let pages = pages.with_context(|| format!("the {name} need {}", format::bytes(bytes_of(rows))))?;
        Ok(Self { name, capacity, pages, staged: 0 })
    }

    /// Bytes on the device.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let bytes = |page: &Page| match page {
            Page::Buffer(buffer) => buffer.raw.size(),
            Page::Texture(texture, _) => {
                bytes_of(texture.height() as usize) * u64::from(texture.depth_or_array_layers())
            }
        };
        self.pages.iter().map(bytes).sum()
    }

    /// Writes `words` from the start of row `first` on, and now and then waits for the device, so that not all of
    /// an array is staged on the host.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn write(&mut self, gpu: &Gpu, first: usize, words: &[u32]) -> Result<()> {
        let mut row = first;
        let mut rest = words;
        while !rest.is_empty() {
            let within = row % self.capacity.page_rows;
            let room = (self.capacity.page_rows - within) * ROW;
            let (now, later) = rest.split_at(rest.len().min(room));
            match &self.pages[row / self.capacity.page_rows] {
                Page::Buffer(buffer) => gpu.write(buffer, within * ROW, now),
                Page::Texture(texture, _) => write_texture(gpu, texture, within, now),
            }
            row += rows_of(now.len());
            rest = later;
        }
        self.staged += size_of_val(words) as u64;
        if self.staged >= STAGED_BYTES {
            self.staged = 0;
            gpu.queue.submit([]);
            gpu.wait()?;
        }
        Ok(())
    }

    /// The part that reads it: `name_word(first_row, word)`.
    #[must_use]
    pub fn part(&self) -> String {
        self.capacity.part(self.name, self.pages.len())
    }

    /// The pages under the names that the part knows.
    #[must_use]
    pub fn resources(&self) -> Vec<Resource<'_>> {
        self.pages.iter().zip(NAMES).map(|(page, name)| page.named(name)).collect()
    }
}

impl Page {
    fn named(&self, name: &'static str) -> Resource<'_> {
        match self {
            Self::Buffer(buffer) => buffer.named(name),
            Self::Texture(_, view) => Resource { name, binding: wgpu::BindingResource::TextureView(view) },
        }
    }
}

fn texture(gpu: &Gpu, name: &'static str, rows: usize) -> Result<Page> {
    let descriptor = wgpu::TextureDescriptor {
        label: Some(name),
        size: wgpu::Extent3d {
            width: ROW as u32,
            height: rows.min(LAYER_ROWS) as u32,
            depth_or_array_layers: rows.div_ceil(LAYER_ROWS) as u32,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::R32Uint,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    };
    let texture = gpu.allocated(name, bytes_of(rows), || gpu.device.create_texture(&descriptor))?;
    let view = texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    });
    Ok(Page::Texture(texture, view))
}

/// Writes whole rows, layer by layer; the last row is filled up with zeros.
fn write_texture(gpu: &Gpu, texture: &wgpu::Texture, first: usize, words: &[u32]) {
    let mut row = first;
    let mut rest = words;
    while !rest.is_empty() {
        let room = (LAYER_ROWS - row % LAYER_ROWS) * ROW;
        let (now, later) = rest.split_at(rest.len().min(room));
        let (whole, end) = now.split_at(now.len() / ROW * ROW);
        write_rows(gpu, texture, row, whole);
        row += whole.len() / ROW;
        if !end.is_empty() {
            let mut padded = [0; ROW];
            padded[..end.len()].copy_from_slice(end);
            write_rows(gpu, texture, row, &padded);
            row += 1;
        }
        rest = later;
    }
}

fn write_rows(gpu: &Gpu, texture: &wgpu::Texture, row: usize, words: &[u32]) {
    if words.is_empty() {
        return;
    }
    let origin = wgpu::Origin3d { x: 0, y: (row % LAYER_ROWS) as u32, z: (row / LAYER_ROWS) as u32 };
    let height = (words.len() / ROW) as u32;
    gpu.queue.write_texture(
        wgpu::TexelCopyTextureInfo { origin, ..texture.as_image_copy() },
        bytemuck::cast_slice(words),
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(ROW_BYTES as u32),
            rows_per_image: None,
        },
        wgpu::Extent3d { width: ROW as u32, height, depth_or_array_layers: 1 },
    );
}
