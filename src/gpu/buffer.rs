//! Buffers with a name, and typed transfers to and from them.

use super::Gpu;
use anyhow::{Result, ensure};
use bytemuck::Pod;
use std::ops::Range;
use wgpu::BufferUsages as Usage;

/// A device buffer; its label is the name kernels bind it by.
#[derive(Clone, Debug)]
pub struct Buffer {
    /// The name of the WGSL variable it stands for.
    pub name: &'static str,
    /// The device buffer.
    pub raw: wgpu::Buffer,
}

impl Gpu {
    /// A zeroed storage buffer of `count` elements of `T`.
    ///
    /// # Errors
    /// When it is larger than the adapter can bind, in which case the message says both sizes, or its memory is full.
    pub fn storage<T>(&self, name: &'static str, count: usize) -> Result<Buffer> {
        self.buffer(name, (count * size_of::<T>()) as u64, Usage::STORAGE)
    }

    /// A uniform buffer of one `T`.
    ///
    /// # Errors
    /// As [`Gpu::storage`].
    pub fn uniform<T: Pod>(&self, name: &'static str, value: &T) -> Result<Buffer> {
        let buffer = self.buffer(name, size_of::<T>() as u64, Usage::UNIFORM)?;
        self.write(&buffer, 0, std::slice::from_ref(value));
        Ok(buffer)
    }

    /// A storage buffer filled with `data`.
    ///
    /// # Errors
    /// As [`Gpu::storage`].
    pub fn storage_with<T: Pod>(&self, name: &'static str, data: &[T]) -> Result<Buffer> {
        let buffer = self.storage::<T>(name, data.len().max(1))?;
        self.write(&buffer, 0, data);
        Ok(buffer)
    }

    /// Whether the adapter binds a buffer of so many bytes.
    pub(super) fn check_buffer(&self, name: &str, bytes: u64) -> Result<()> {
        let limits = self.device.limits();
        let most = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
        ensure!(
            bytes <= most,
            "the buffer '{name}' needs {bytes} bytes, and the adapter '{}' binds at most {most}",
            self.info.name
        );
        Ok(())
    }

    pub(super) fn buffer(&self, name: &'static str, bytes: u64, usage: Usage) -> Result<Buffer> {
        self.check_buffer(name, bytes)?;
        let raw = self.allocated(name, bytes, || {
            self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(name),
                size: bytes.max(16).next_multiple_of(16),
                usage: usage | Usage::COPY_DST | Usage::COPY_SRC,
                mapped_at_creation: false,
            })
        })?;
        Ok(Buffer { name, raw })
    }

    /// Writes `data` at element `first` of `buffer`, before the next submission.
    pub fn write<T: Pod>(&self, buffer: &Buffer, first: usize, data: &[T]) {
        let offset = (first * size_of::<T>()) as u64;
        self.queue.write_buffer(&buffer.raw, offset, bytemuck::cast_slice(data));
    }

    /// Reads `count` elements of `buffer` from element `first` on, waiting for the device.
    ///
    /// # Errors
    /// When the device was lost, or its memory is full.
    pub fn read<T: Pod>(&self, buffer: &Buffer, first: usize, count: usize) -> Result<Vec<T>> {
        let staging = self.staging::<T>(count)?;
        self.read_through(&staging, buffer, first..first + count, |elements: &[T]| elements.to_vec())
    }

    /// Memory that the host reads, with room for `count` elements of `T`.
    ///
    /// # Errors
    /// When there is not as much.
    pub fn staging<T: Pod>(&self, count: usize) -> Result<wgpu::Buffer> {
        let (label, size) = ("read back", staged_bytes::<T>(count).max(4));
        self.allocated(label, size, || {
            self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage: Usage::MAP_READ | Usage::COPY_DST,
                mapped_at_creation: false,
            })
        })
    }

    /// Copies `elements` of `buffer` to `staging`, waits for the device, and gives `take` what is there.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn read_through<T: Pod, R>(
        &self,
        staging: &wgpu::Buffer,
        buffer: &Buffer,
        elements: Range<usize>,
        take: impl FnOnce(&[T]) -> R,
    ) -> Result<R> {
        if elements.is_empty() {
            return Ok(take(&[]));
        }
        let bytes = staged_bytes::<T>(elements.len());
        let mut encoder = self.encoder("read back");
        encoder.copy_buffer_to_buffer(
            &buffer.raw,
            (elements.start * size_of::<T>()) as u64,
            staging,
            0,
            bytes,
        );
        self.submit(encoder);
        staging.map_async(wgpu::MapMode::Read, ..bytes, |_| {});
        self.wait()?;
        let taken = {
            let mapped = staging.get_mapped_range(..bytes).map_err(|failure| self.lost(failure))?;
            take(bytemuck::cast_slice(&mapped[..elements.len() * size_of::<T>()]))
        };
        staging.unmap();
        Ok(taken)
    }
}

/// Bytes of a copy of so many elements, which are whole words.
fn staged_bytes<T>(count: usize) -> u64 {
    ((count * size_of::<T>()) as u64).next_multiple_of(4)
}
