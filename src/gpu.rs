//! The device: adapter choice, linking of WGSL, pipelines bound by name, typed buffers and timers.
//!
//! Nothing here knows what a radiance field is.

pub mod adapter;
pub mod buffer;
pub mod buffer_spec;
pub mod kernel;
pub mod paged_array;
pub mod pass;
mod pipeline;
pub mod source;
pub mod tensor;
pub mod timer;

use crate::support::format;
use crate::support::interrupt::Interrupt;
use crate::support::remedy::{Advised, Remedy};
use crate::support::transient::Transient;
use anyhow::{Context, Result, bail};
use std::fmt::Display;
use std::sync::{Arc, Mutex, PoisonError};

/// An open device and what it can do.
#[derive(Debug)]
pub struct Gpu {
    /// The logical device.
    pub device: wgpu::Device,
    /// Its only queue.
    pub queue: wgpu::Queue,
    /// Name, driver and kind of the adapter.
    pub info: wgpu::AdapterInfo,
    /// Asked by what takes long on it: loading photos, steps, views.
    pub interrupt: Interrupt,
    error: Arc<Mutex<Option<DeviceError>>>,
}

/// What a device reported outside of a call that could return it.
#[derive(Clone, Debug)]
struct DeviceError {
    cause: Cause,
    message: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cause {
    /// A mistake in the program or in the driver.
    Invalid,
    /// Its memory was full.
    Full,
    /// It was lost.
    Lost,
}

/// Features that speed training up and are used wherever the adapter has them.
pub const WANTED_FEATURES: wgpu::Features = wgpu::Features::SHADER_FLOAT32_ATOMIC
    .union(wgpu::Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES)
    .union(wgpu::Features::CLEAR_TEXTURE)
    .union(wgpu::Features::SUBGROUP)
    .union(LONG_ATOMICS)
    .union(wgpu::Features::TIMESTAMP_QUERY);

/// Atomic addition of 64-bit integers.
pub const LONG_ATOMICS: wgpu::Features =
    wgpu::Features::SHADER_INT64.union(wgpu::Features::SHADER_INT64_ATOMIC_ALL_OPS);

impl Gpu {
    /// Opens the adapter that `choice` names, as [`adapter::choose`] understands it; the first one where it names none.
    ///
    /// # Errors
    /// When there is no adapter, or none that fits, or the driver refuses to create the device.
    pub fn choose(choice: Option<&str>) -> Result<Self> {
        Self::open(&adapter::choose(choice)?)
    }

    /// Opens `adapter` with its own limits and every wanted feature it has.
    ///
    /// # Errors
    /// When the driver refuses to create the device.
    pub fn open(adapter: &wgpu::Adapter) -> Result<Self> {
        let opened = Self::open_with(adapter, WANTED_FEATURES, adapter.limits());
        // It has what is asked for: it is busy, or its memory is full.
        opened.map_err(|failure| {
            let name = adapter.get_info().name;
            busy(&format!("the adapter '{name}' cannot be opened"), failure.root_cause())
        })
    }

    /// Opens `adapter` with these limits and those of `features` that it has.
    ///
    /// # Errors
    /// When the driver refuses to create the device.
    pub fn open_with(
        adapter: &wgpu::Adapter,
        features: wgpu::Features,
        limits: wgpu::Limits,
    ) -> Result<Self> {
        let info = adapter.get_info();
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("nerf"),
            required_features: adapter.features() & features,
            required_limits: limits,
            memory_hints: wgpu::MemoryHints::Performance,
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .with_context(|| format!("opening the adapter '{}'", info.name))?;
        Ok(Self::from_device(device, queue, info))
    }

    /// A device that is open already, for example that of a viewer: of the wanted features it uses those that it has. Its
    /// errors are reported by [`Gpu::check`] from now on.
    #[must_use]
    pub fn from_device(device: wgpu::Device, queue: wgpu::Queue, info: wgpu::AdapterInfo) -> Self {
        let error = Arc::new(Mutex::new(None));
        // The first is told, but that it was lost may come behind what follows from it.
        let report = |cause: Cause, message: String, sink: &Mutex<Option<DeviceError>>| {
            let mut told = sink.lock().unwrap_or_else(PoisonError::into_inner);
            let is_first =
                told.as_ref().is_none_or(|told| cause == Cause::Lost && told.cause == Cause::Invalid);
            if is_first {
                *told = Some(DeviceError { cause, message });
            }
        };
        let sink = Arc::clone(&error);
        device.on_uncaptured_error(Arc::new(move |failure: wgpu::Error| {
            let is_full = matches!(failure, wgpu::Error::OutOfMemory { .. });
            report(if is_full { Cause::Full } else { Cause::Invalid }, failure.to_string(), &sink);
        }));
        let sink = Arc::clone(&error);
        device.set_device_lost_callback(move |_, message| report(Cause::Lost, message, &sink));
        Self { device, queue, info, interrupt: Interrupt::default(), error }
    }

    /// Whether the adapter runs on the CPU (lavapipe, WARP), where the fast layout is another one.
    #[must_use]
    pub fn is_cpu(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Whether the opened device has `features`.
    #[must_use]
    pub fn has(&self, features: wgpu::Features) -> bool {
        self.device.features().contains(features)
    }

    /// Whether subgroups hold at least `size` threads, as a multiple of it.
    #[must_use]
    pub fn has_subgroups_of(&self, size: u32) -> bool {
        let least = self.info.subgroup_min_size;
        self.has(wgpu::Features::SUBGROUP) && least >= size && least.is_multiple_of(size)
    }

    /// Submits the recorded commands.
    pub fn submit(&self, encoder: wgpu::CommandEncoder) -> wgpu::SubmissionIndex {
        self.queue.submit([encoder.finish()])
    }

    /// Starts recording commands.
    #[must_use]
    pub fn encoder(&self, label: &str) -> wgpu::CommandEncoder {
        self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some(label) })
    }

    /// Waits until everything submitted has run.
    ///
    /// # Errors
    /// When the device was lost or a command was invalid; the first driver message is passed on.
    pub fn wait(&self) -> Result<()> {
        self.wait_until(wgpu::PollType::wait_indefinitely())
    }

    /// Waits until one submission and those before it have run.
    ///
    /// # Errors
    /// As [`Gpu::wait`].
    pub fn wait_for(&self, submission: wgpu::SubmissionIndex) -> Result<()> {
        self.wait_until(wgpu::PollType::Wait { submission_index: Some(submission), timeout: None })
    }

    fn wait_until(&self, end: wgpu::PollType) -> Result<()> {
        let waited = self.device.poll(end);
        self.check()?;
        waited.map(drop).map_err(|failure| self.lost(failure))
    }

    /// Reports the first error the device raised outside of a call that could return it.
    ///
    /// # Errors
    /// That error, with the adapter's name; [`Transient`] where the device was lost, or its memory was full.
    pub fn check(&self) -> Result<()> {
        let told = self.error.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let Some(DeviceError { cause, message }) = told else { return Ok(()) };
        match cause {
            Cause::Invalid => bail!("the adapter '{}' reported: {message}", self.info.name),
            Cause::Full => Err(self.full(message)),
            Cause::Lost => Err(self.lost(message)),
        }
    }

    /// What `make` allocates on the device.
    ///
    /// # Errors
    /// When its memory is full: says for what.
    fn allocated<T>(&self, what: &str, bytes: u64, make: impl FnOnce() -> T) -> Result<T> {
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let made = make();
        match pollster::block_on(scope.pop()) {
            Some(_) => {
                Err(self.full(format!("there is no room for the {} of '{what}'", format::bytes(bytes))))
            }
            None => Ok(made),
        }
    }

    /// The error for a device whose memory is full.
    fn full(&self, failure: impl Display) -> anyhow::Error {
        busy(&format!("the memory of the adapter '{}' is full", self.info.name), failure)
    }

    /// The error for a device that does not answer any more.
    fn lost(&self, failure: impl Display) -> anyhow::Error {
        busy(&format!("the adapter '{}' was lost", self.info.name), failure)
    }
}

/// The error for a device that may do another time what it does not do now.
fn busy(what: &str, failure: impl Display) -> anyhow::Error {
    let advised = Advised::new(format!("{what}; "), Remedy::RelieveDevice, "");
    anyhow::Error::from(Transient::new(format!("{failure:#}"))).context(advised)
}
