//! Descriptions of buffers and tensors that are yet to be allocated, from which their sizes are known before there is a device.

use super::Gpu;
use super::buffer::Buffer;
use super::tensor::{Element, Tensor, TensorMemory};
use anyhow::Result;
use wgpu::BufferUsages;

/// A buffer or a tensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BufferSpec {
    /// The name of the WGSL variable it stands for.
    pub name: &'static str,
    kind: Storage,
    /// Bytes of an element.
    size: usize,
    count: usize,
    /// What its size follows from, as its user says it; empty where it is always small.
    pub sized_by: &'static str,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Storage {
    Buffer(BufferUsages),
    Tensor(Element, TensorMemory),
}

/// Something on a device.
#[derive(Clone, Debug)]
pub enum Allocation {
    /// A buffer.
    Buffer(Buffer),
    /// A tensor.
    Tensor(Tensor),
}

impl BufferSpec {
    /// A storage buffer of `count` elements of `T`.
    #[must_use]
    pub fn storage<T>(name: &'static str, count: usize) -> Self {
        Self { name, kind: Storage::Buffer(BufferUsages::STORAGE), size: size_of::<T>(), count, sized_by: "" }
    }

    /// A buffer that kernels read as uniform and write as storage.
    #[must_use]
    pub fn uniform_storage<T>(name: &'static str, count: usize) -> Self {
        Self {
            kind: Storage::Buffer(BufferUsages::STORAGE | BufferUsages::UNIFORM),
            ..Self::storage::<T>(name, count)
        }
    }

    /// A uniform buffer of one `T`.
    #[must_use]
    pub fn uniform<T>(name: &'static str) -> Self {
        Self { kind: Storage::Buffer(BufferUsages::UNIFORM), ..Self::storage::<T>(name, 1) }
    }

    /// A storage buffer of words that also holds the sizes of indirect dispatches.
    #[must_use]
    pub fn indirect(name: &'static str, count: usize) -> Self {
        let kind = Storage::Buffer(BufferUsages::STORAGE | BufferUsages::INDIRECT);
        Self { kind, ..Self::storage::<u32>(name, count) }
    }

    /// A tensor.
    #[must_use]
    pub fn tensor(name: &'static str, element: Element, count: usize, memory: TensorMemory) -> Self {
        Self { name, kind: Storage::Tensor(element, memory), size: element.bytes(), count, sized_by: "" }
    }

    /// The same with what its size follows from.
    #[must_use]
    pub fn sized_by(self, sized_by: &'static str) -> Self {
        Self { sized_by, ..self }
    }

    /// Bytes on the device, but for the rounding of small buffers.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        (self.size * self.count) as u64
    }

    /// Whether something of this kind can be taken for `other`, of the same name.
    #[must_use]
    pub fn holds(&self, other: &Self) -> bool {
        let shape = |spec: &Self| (spec.name, spec.kind, spec.size);
        shape(self) == shape(other) && self.count >= other.count
    }

    /// Whether the adapter can bind as much.
    ///
    /// # Errors
    /// When it cannot; the message says both sizes.
    pub fn check(&self, gpu: &Gpu) -> Result<()> {
        match self.kind {
            Storage::Tensor(_, TensorMemory::Textures) => gpu.check_texture(self.name, self.count),
            _ => gpu.check_buffer(self.name, self.bytes()),
        }
    }

    /// Allocates it, zeroed.
    ///
    /// # Errors
    /// When it is larger than the adapter can bind; the message says both sizes.
    pub fn allocate(&self, gpu: &Gpu) -> Result<Allocation> {
        Ok(match self.kind {
            Storage::Buffer(usage) => Allocation::Buffer(gpu.buffer(self.name, self.bytes(), usage)?),
            Storage::Tensor(element, memory) => {
                Allocation::Tensor(gpu.tensor(self.name, element, self.count, memory)?)
            }
        })
    }
}
