//! Rendering the frames of a path one after the other, while other threads write those that are done.

use super::Job;
use super::writer::Writer;
use crate::progress::Progress;
use anyhow::Result;
use nerf::field::renderer::{Renderer, View};
use serde_json::Value;
use std::panic::resume_unwind;
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::thread::{available_parallelism, scope};
use std::time::Instant;

/// Most memory of views that are being written, in bytes, unless there is only one of them.
const MOST_BYTES: usize = 1 << 30;
/// Processors for each thread that writes: it waits for the disk, and the others have views to render.
const CORES_PER_WRITER: usize = 4;

/// What frames took, in seconds, in their order.
#[derive(Debug, Default)]
pub(super) struct Timing {
    /// Each to be rendered.
    seconds: Vec<f64>,
    /// Of it until the device was done, and its pixels had come to the host.
    device: Vec<f64>,
    /// Of all together, until their files were written.
    elapsed: f64,
}

impl Timing {
    /// Adds it to what is told about the rendering.
    pub(super) fn tell(&self, result: &mut Value) {
        result["seconds"] = self.seconds.as_slice().into();
        result["device_seconds"] = self.device.as_slice().into();
        result["elapsed_seconds"] = self.elapsed.into();
    }
}

/// Renders the jobs in order, and describes their files. Other threads write views while the next ones render.
pub(super) fn render_and_write(
    renderer: &mut Renderer,
    jobs: &[Job],
    writer: &Writer<'_>,
    progress: &Progress,
) -> Result<Timing> {
    let begin = Instant::now();
    let mut timing = Timing::default();
    // Without room in between: where all are busy, the next view waits for one of them.
    let (sender, receiver) = sync_channel::<(&Job, View)>(0);
    let queue = Mutex::new(Some(receiver));
    scope(|scope| {
        let write = || write_all(&queue, writer);
        let threads: Vec<_> = (0..writers(jobs)).map(|_| scope.spawn(write)).collect();
        let mut render = || -> Result<()> {
            for (number, job) in jobs.iter().enumerate() {
                let clock = Instant::now();
                let view = renderer.render_sampled(&job.camera, job.samples)?;
                timing.seconds.push(clock.elapsed().as_secs_f64());
                timing.device.push(renderer.take_cost().device.as_secs_f64());
                // Nobody receives it where writing failed, which is reported below.
                if sender.send((job, view)).is_err() {
                    break;
                }
                progress.count(number + 1, jobs.len(), "frames");
            }
            Ok(())
        };
        let rendered = render();
        drop(sender);
        let join = |thread: std::thread::ScopedJoinHandle<'_, _>| {
            thread.join().unwrap_or_else(|panic| resume_unwind(panic))
        };
        let written: Vec<Result<()>> = threads.into_iter().map(join).collect();
        let listed = writer.flush();
        written.into_iter().collect::<Result<()>>()?;
        listed.and(rendered)
    })?;
    timing.elapsed = begin.elapsed().as_secs_f64();
    Ok(timing)
}

/// Writes views until there are no more. The queue ends where one cannot be written.
fn write_all(queue: &Mutex<Option<Receiver<(&Job, View)>>>, writer: &Writer<'_>) -> Result<()> {
    let lock = || queue.lock().unwrap_or_else(PoisonError::into_inner);
    let next = || lock().as_ref().and_then(|views| views.recv().ok());
    while let Some((job, view)) = next() {
        if let Err(error) = writer.write(job, &view) {
            lock().take();
            return Err(error);
        }
    }
    Ok(())
}

/// How many threads write.
fn writers(jobs: &[Job]) -> usize {
    let bytes = |job: &Job| job.camera.width as usize * job.camera.height as usize * size_of::<[f32; 5]>();
    let room = MOST_BYTES / jobs.iter().map(bytes).max().unwrap_or(0).max(1);
    let cores = available_parallelism().map_or(1, usize::from);
    (cores / CORES_PER_WRITER).min(room).clamp(1, jobs.len().max(1))
}
