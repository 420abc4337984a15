//! A list of dispatches: what one training step does, in order.

use super::Gpu;
use super::buffer::Buffer;
use super::kernel::Bound;
use super::timer::Timer;
use anyhow::Result;

/// How many workgroups a stage launches.
#[derive(Clone, Debug)]
pub enum Size {
    /// Fixed numbers along x and y.
    Fixed(u32, u32),
    /// Three numbers written by an earlier kernel, at this index of an array of vec3 (16 bytes apart).
    Indirect(Buffer, usize),
}

/// One dispatch.
#[derive(Debug)]
pub struct Stage {
    /// The kernel and its buffers.
    pub bound: Bound,
    /// Its size.
    pub size: Size,
}

/// Workgroups along x of a dispatch that has several rows of them; kernels know it as GROUP_COLUMNS. Adapters take 65,535
/// at least.
pub const GROUP_COLUMNS: u32 = 1 << 15;

impl Bound {
    /// Workgroups whose threads along x are at least `threads`.
    #[must_use]
    pub fn groups(&self, threads: usize) -> u32 {
        threads.div_ceil(self.group_size as usize) as u32
    }
}

impl Stage {
    /// A stage of so many threads along one axis, rounded up to whole workgroups.
    #[must_use]
    pub fn over(bound: Bound, threads: usize) -> Self {
        let size = Size::Fixed(bound.groups(threads), 1);
        Self { bound, size }
    }

    /// A stage of so many threads, whose workgroups need not fit along one axis: the kernel counts rows of
    /// [`GROUP_COLUMNS`].
    #[must_use]
    pub fn wide(bound: Bound, threads: usize) -> Self {
        let groups = bound.groups(threads);
        let columns = groups.min(GROUP_COLUMNS);
        Self { size: Size::Fixed(columns, groups.div_ceil(columns.max(1))), bound }
    }

    /// A stage of one workgroup.
    #[must_use]
    pub fn single(bound: Bound) -> Self {
        Self { bound, size: Size::Fixed(1, 1) }
    }

    /// A stage whose size lies at `index` of `dispatch`.
    #[must_use]
    pub fn indirect(bound: Bound, dispatch: &Buffer, index: usize) -> Self {
        Self { bound, size: Size::Indirect(dispatch.clone(), index) }
    }

    /// Makes it one of so many threads along one axis.
    pub fn resize(&mut self, threads: usize) {
        self.size = Size::Fixed(self.bound.groups(threads), 1);
    }

    fn record(&self, pass: &mut wgpu::ComputePass<'_>) -> Result<()> {
        pass.set_pipeline(&self.bound.pipeline.get()?);
        pass.set_bind_group(0, &self.bound.group, &[]);
        match &self.size {
            Size::Fixed(x, y) => pass.dispatch_workgroups(*x, *y, 1),
            Size::Indirect(buffer, index) => {
                pass.dispatch_workgroups_indirect(&buffer.raw, (index * 4 * size_of::<u32>()) as u64);
            }
        }
        Ok(())
    }
}

impl Gpu {
    /// Submits `stages` in order, once the driver has compiled them; with a timer, each in a pass of its own between two
    /// timestamps.
    ///
    /// # Errors
    /// When the driver refuses a kernel, or the device's interrupt was raised before it was compiled.
    pub fn run<'a>(
        &self,
        label: &str,
        stages: impl IntoIterator<Item = &'a Stage>,
        timer: Option<&mut Timer>,
    ) -> Result<wgpu::SubmissionIndex> {
        let mut encoder = self.encoder(label);
        if let Some(timer) = timer {
            for stage in stages {
                let writes = timer.writes(&stage.bound.label);
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some(&stage.bound.label),
                    timestamp_writes: writes,
                });
                stage.record(&mut pass)?;
            }
            timer.resolve(&mut encoder);
        } else {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(label),
                timestamp_writes: None,
            });
            for stage in stages {
                stage.record(&mut pass)?;
            }
        }
        Ok(self.submit(encoder))
    }
}
