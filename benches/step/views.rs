//! Speed of views of the trained field, without files.

use anyhow::Result;
use nerf::camera::{Camera, LensKind};
use nerf::field::renderer::{Renderer, ViewCost};
use nerf::field::{Field, Rounds};
use serde::Serialize;
use std::time::Instant;

/// What views took, each as the mean over all.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Views {
    count: usize,
    width: u32,
    height: u32,
    /// From the camera to the pixels in the host's memory.
    seconds: f64,
    /// Of it until the device was done, and its pixels had come to the host.
    device_seconds: f64,
    /// Rounds of samples, and how many rays and samples they have room for.
    rounds: f64,
    rays: usize,
    samples: usize,
    /// The first view, which does not know how many rounds it will take, and is not among the others.
    first_seconds: f64,
}

impl Views {
    /// Renders `count` views of the cameras' own sizes, from one camera after the other, in rounds that are `factor` times
    /// as large as the adapter's.
    pub(crate) fn measure(field: &Field, cameras: &[Camera], factor: usize, count: usize) -> Result<Self> {
        let usual = field.plan().rounds;
        let [rays, samples] = [usual.rays, usual.samples].map(|room| factor * room);
        let field = field.with_rounds(Rounds { rays, samples, ..usual });
        let mut renderer = Renderer::new(&field, &LensKind::among(cameras))?;
        let mut clock = Instant::now();
        let mut lap = || std::mem::replace(&mut clock, Instant::now()).elapsed().as_secs_f64();
        let mut views = Self { count, rays, samples, ..Self::default() };
        for (number, camera) in cameras.iter().cycle().take(count + 1).enumerate() {
            renderer.render(camera)?;
            if number == 0 {
                (views.first_seconds, views.width, views.height) = (lap(), camera.width, camera.height);
                renderer.take_cost();
            }
        }
        let ViewCost { device, rounds, .. } = renderer.take_cost();
        let count = count.max(1) as f64;
        views.seconds = lap() / count;
        views.device_seconds = device.as_secs_f64() / count;
        views.rounds = rounds as f64 / count;
        Ok(views)
    }

    /// A line for readers.
    pub(crate) fn line(&self) -> String {
        let Self { count, width, height, seconds, device_seconds, rounds, rays, samples, first_seconds } =
            self;
        format!(
            "views      {count} of {width}x{height}: {:.1} ms each, {:.1} of it on the device in {rounds:.1} rounds of \
             {samples} samples of {rays} rays; the first one {:.1} ms",
            1e3 * seconds,
            1e3 * device_seconds,
            1e3 * first_seconds
        )
    }
}
