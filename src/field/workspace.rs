//! Buffers and tensors by name.

use super::Plan;
use super::generated::group_size;
use super::parameters::{Array, Numbers};
use crate::gpu::Gpu;
use crate::gpu::buffer::Buffer;
use crate::gpu::buffer_spec::{Allocation, BufferSpec};
use crate::gpu::kernel::{Bound, Kernel, Resource};
use crate::gpu::paged_array::PagedArray;
use crate::gpu::pass::Stage;
use crate::gpu::tensor::Tensor;
use anyhow::{Context, Result, ensure};

/// Buffers and tensors by name: what kernels are bound to.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    buffers: Vec<Buffer>,
    tensors: Vec<Tensor>,
    pages: Option<PagedArray>,
}

impl Workspace {
    /// Adds a buffer; its name must be new.
    pub fn add(&mut self, buffer: Buffer) {
        debug_assert!(
            self.buffers.iter().all(|b| b.name != buffer.name),
            "two buffers named {}",
            buffer.name
        );
        self.buffers.push(buffer);
    }

    /// Allocates and adds what is demanded.
    ///
    /// # Errors
    /// When the adapter cannot hold it.
    pub fn allocate(&mut self, gpu: &Gpu, buffers: &[BufferSpec]) -> Result<()> {
        for spec in buffers {
            match spec.allocate(gpu)? {
                Allocation::Buffer(buffer) => self.add(buffer),
                Allocation::Tensor(tensor) => self.add_tensor(tensor),
            }
        }
        Ok(())
    }

    /// Adds a tensor; its name must be new.
    pub fn add_tensor(&mut self, tensor: Tensor) {
        debug_assert!(
            self.tensors.iter().all(|t| t.name != tensor.name),
            "two tensors named {}",
            tensor.name
        );
        self.tensors.push(tensor);
    }

    /// Adds the pages that hold the training photos.
    pub fn add_pages(&mut self, pages: PagedArray) {
        self.pages = Some(pages);
    }

    /// The part that reads the pages.
    ///
    /// # Errors
    /// When there are none: only a training run has photos.
    pub fn pages_part(&self) -> Result<String> {
        Ok(self.pages.as_ref().context("this workspace has no photos")?.part())
    }

    /// The buffer `name`.
    ///
    /// # Panics
    /// When there is none: names are fixed in this module and its children.
    #[must_use]
    pub fn get(&self, name: &str) -> &Buffer {
        self.find(name).unwrap_or_else(|| unreachable!("no buffer named '{name}'"))
    }

    /// The buffer `name`, if there is one.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<&Buffer> {
        self.buffers.iter().find(|buffer| buffer.name == name)
    }

    /// The tensor `name`.
    ///
    /// # Panics
    /// When there is none: names are fixed in this module and its children.
    #[must_use]
    pub fn tensor(&self, name: &str) -> &Tensor {
        let found = self.tensors.iter().find(|tensor| tensor.name == name);
        found.unwrap_or_else(|| unreachable!("no tensor named '{name}'"))
    }

    /// Reads the first `count` values of a buffer or tensor, waiting for the device.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn read<T: bytemuck::Pod>(&self, gpu: &Gpu, name: &str, count: usize) -> Result<Vec<T>> {
        match self.tensors.iter().find(|tensor| tensor.name == name) {
            Some(tensor) => gpu.read_tensor(tensor, count),
            None => gpu.read(self.get(name), 0, count),
        }
    }

    /// Writes `data` at the start of a buffer or tensor, before the next submission.
    pub fn write<T: bytemuck::Pod>(&self, gpu: &Gpu, name: &str, data: &[T]) {
        match self.tensors.iter().find(|tensor| tensor.name == name) {
            Some(tensor) => gpu.write_tensor(tensor, data),
            None => gpu.write(self.get(name), 0, data),
        }
    }

    /// The numbers of the plan's arrays.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn arrays(&self, gpu: &Gpu, plan: &Plan) -> Result<Vec<(&'static str, Numbers)>> {
        let numbers = |array: Array| {
            let (name, count) = (array.name, array.count());
            Ok((
                name,
                match array.has_words() {
                    true => Numbers::Words(self.read(gpu, name, count)?),
                    false => Numbers::Floats(self.read(gpu, name, count)?),
                },
            ))
        };
        plan.arrays().map(numbers).collect()
    }

    /// Sets those of the plan's arrays that are here.
    ///
    /// # Errors
    /// When one is missing, or of another size.
    pub fn set_arrays(&self, gpu: &Gpu, plan: &Plan, arrays: &[(&'static str, Numbers)]) -> Result<()> {
        for array in plan.arrays() {
            let (name, expected) = (array.name, array.count());
            let numbers = arrays.iter().find(|(own, _)| *own == name).map(|(_, numbers)| numbers);
            let found = numbers.map_or(0, Numbers::count);
            ensure!(
                found == expected,
                "the state's '{name}' has {found} numbers, and this configuration needs {expected}"
            );
            match numbers.filter(|_| self.has(name)) {
                Some(Numbers::Floats(numbers)) => self.write(gpu, name, numbers),
                Some(Numbers::Words(numbers)) => self.write(gpu, name, numbers),
                None => {}
            }
        }
        Ok(())
    }

    /// Whether there is a buffer or a tensor of this name.
    pub(super) fn has(&self, name: &str) -> bool {
        self.find(name).is_some() || self.tensors.iter().any(|tensor| tensor.name == name)
    }

    /// Shares the buffers and tensors of `other`.
    pub fn share(&mut self, other: &Self) {
        self.buffers.extend(other.buffers.iter().cloned());
        self.tensors.extend(other.tensors.iter().cloned());
    }

    /// Shares those buffers and tensors of `other` that are described.
    pub fn share_some(&mut self, other: &Self, described: &[BufferSpec]) {
        let is_described = |name: &str| described.iter().any(|spec| spec.name == name);
        self.buffers.extend(other.buffers.iter().filter(|buffer| is_described(buffer.name)).cloned());
        self.tensors.extend(other.tensors.iter().filter(|tensor| is_described(tensor.name)).cloned());
    }

    /// Binds `kernel` to what it uses; `renamed` pairs a WGSL name with the name here.
    ///
    /// # Errors
    /// When one is missing.
    pub fn bind(&self, gpu: &Gpu, kernel: &Kernel, renamed: &[(&str, &str)]) -> Result<Bound> {
        self.bind_with(gpu, kernel, renamed, &[])
    }

    /// As [`Workspace::bind`], with further resources.
    ///
    /// # Errors
    /// When one is missing.
    pub fn bind_with(
        &self,
        gpu: &Gpu,
        kernel: &Kernel,
        renamed: &[(&str, &str)],
        further: &[Resource<'_>],
    ) -> Result<Bound> {
        let mut resources = further.to_vec();
        for (name, here) in renamed {
            resources.extend(self.buffers.iter().find(|b| b.name == *here).map(|b| b.named(name)));
            resources.extend(self.tensors.iter().find(|t| t.name == *here).map(|t| t.named(name)));
        }
        resources.extend(self.buffers.iter().map(Buffer::resource));
        resources.extend(self.tensors.iter().map(|tensor| tensor.named(tensor.name)));
        resources.extend(self.pages.iter().flat_map(PagedArray::resources));
        kernel.bind(gpu, &resources)
    }

    /// A kernel over a count that the device knows, one of [`super::dispatch`].
    ///
    /// # Errors
    /// When its workgroups have another size than those that the device counts: a mistake in its shader.
    pub fn stage(&self, bound: Bound, over: usize) -> Result<Stage> {
        ensure!(
            bound.group_size as usize == group_size(),
            "the kernel '{}' has workgroups of {} threads, and counts are divided into {}",
            bound.label,
            bound.group_size,
            group_size()
        );
        Ok(Stage::indirect(bound, self.get("dispatch"), over))
    }

    /// Sets the size of the dispatches over a count that the host knows: one of [`super::dispatch`].
    pub fn set_dispatch(&self, gpu: &Gpu, over: usize, count: usize) {
        let groups = [[count.div_ceil(group_size()).max(1) as u32, 1, 1, 0]];
        gpu.write(self.get("dispatch"), over, &groups);
    }

    /// Bytes of everything in it.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let buffers: u64 = self.buffers.iter().map(|buffer| buffer.raw.size()).sum();
        let pages: u64 = self.pages.iter().map(PagedArray::bytes).sum();
        buffers + pages + self.tensors.iter().map(Tensor::bytes).sum::<u64>()
    }
}
