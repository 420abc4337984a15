//! Pipelines that drivers compile side by side: in the background, or by whoever needs them first.

use super::Gpu;
use crate::support::interrupt::Interrupt;
use anyhow::{Result, anyhow, bail};
use std::borrow::Cow;
use std::mem;
use std::sync::{Arc, Mutex, PoisonError};
use wgpu::naga;

/// A compute pipeline that may not be compiled yet. Its clones are one; the last one waits for a compilation that has
/// begun, and keeps others from beginning.
#[derive(Clone, Debug)]
pub(super) struct Pipeline(Arc<Compilation>);

#[derive(Debug)]
struct Compilation {
    /// Locked while a thread compiles.
    state: Arc<Mutex<State>>,
    interrupt: Interrupt,
}

/// What a pipeline is compiled from.
#[derive(Debug)]
pub(super) struct Job {
    /// The kernel's name.
    pub label: String,
    /// The module with the entry point `main`.
    pub module: naga::Module,
    /// Its only group of bindings.
    pub group: wgpu::BindGroupLayout,
}

#[derive(Debug)]
enum State {
    /// Nobody has begun.
    Waiting(Box<(wgpu::Device, String, Job)>),
    Compiled(wgpu::ComputePipeline),
    Refused(String),
    /// Nobody needs it any more.
    Dropped,
}

impl Pipeline {
    /// Begins to compile as soon as a thread has time.
    pub(super) fn begin(gpu: &Gpu, job: Job) -> Self {
        let state = State::Waiting(Box::new((gpu.device.clone(), gpu.info.name.clone(), job)));
        let (state, interrupt) = (Arc::new(Mutex::new(state)), gpu.interrupt.clone());
        let pipeline =
            Self(Arc::new(Compilation { state: Arc::clone(&state), interrupt: interrupt.clone() }));
        rayon::spawn(move || {
            // Where it is locked, somebody compiles it.
            if let Ok(mut state) = state.try_lock()
                && !interrupt.is_raised()
            {
                state.compile();
            }
        });
        pipeline
    }

    /// The pipeline, compiled here unless another thread has done so or is at it.
    ///
    /// # Errors
    /// When the driver refuses it, or the device's interrupt was raised before it was compiled.
    pub(super) fn get(&self) -> Result<wgpu::ComputePipeline> {
        let mut state = self.0.state.lock().unwrap_or_else(PoisonError::into_inner);
        if matches!(*state, State::Waiting(_)) {
            self.0.interrupt.check()?;
            state.compile();
        }
        match &*state {
            State::Compiled(pipeline) => Ok(pipeline.clone()),
            State::Refused(message) => bail!(message.clone()),
            State::Waiting(_) | State::Dropped => Err(anyhow!("a pipeline is used after its end")),
        }
    }
}

impl Drop for Compilation {
    fn drop(&mut self) {
        *self.state.lock().unwrap_or_else(PoisonError::into_inner) = State::Dropped;
    }
}

impl State {
    /// Compiles what waits.
    fn compile(&mut self) {
        *self = match mem::replace(self, Self::Dropped) {
            Self::Waiting(waiting) => {
                let (device, adapter, job) = *waiting;
                compiled(&device, &adapter, job).map_or_else(Self::Refused, Self::Compiled)
            }
            other => other,
        };
    }
}

/// Compiles a pipeline; why not, where the driver refuses it.
fn compiled(device: &wgpu::Device, adapter: &str, job: Job) -> Result<wgpu::ComputePipeline, String> {
    let Job { label, module, group } = job;
    // Scopes are the thread's own.
    let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
    let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(&label),
        source: wgpu::ShaderSource::Naga(Cow::Owned(module)),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(&label),
        bind_group_layouts: &[Some(&group)],
        immediate_size: 0,
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(&label),
        layout: Some(&layout),
        module: &shader,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions {
            zero_initialize_workgroup_memory: false,
            ..Default::default()
        },
        cache: None,
    });
    match pollster::block_on(scope.pop()) {
        Some(error) => Err(format!("creating the kernel '{label}' on '{adapter}': {error}")),
        None => Ok(pipeline),
    }
}
