//! The training views on their way to the device: cameras, photos, and their silhouettes.

use super::Space;
use crate::camera::Camera;
use crate::field::records::{self, Record, Units};
use crate::field::silhouette::Silhouette;
use crate::field::{self, Plan};
use crate::gpu::Gpu;
use crate::gpu::paged_array::{PageCapacity, PagedArray, rows_of};
use crate::photo::Photo;
use crate::support::remedy::{Advised, Remedy};
use anyhow::{Context, Result, bail, ensure};
use std::sync::Arc;

/// Views whose photos are added one by one, so that not all of them need to be decoded at a time.
#[derive(Debug)]
pub struct TrainingViews {
    pub(crate) cameras: Vec<Camera>,
    pub(crate) space: Space,
    /// One per photo that was added.
    pub(crate) silhouettes: Vec<Silhouette>,
    /// In box space; one per photo of which a pixel can be drawn.
    pub(crate) on_device: Vec<field::DeviceCamera>,
    pub(crate) pages: PagedArray,
    gpu: Arc<Gpu>,
    record: Record,
    units: Units,
    /// The first row that is free.
    row: usize,
}

impl TrainingViews {
    /// Room for the photos of `cameras`, which are in world space.
    ///
    /// # Errors
    /// When the adapter cannot hold them.
    pub fn new(gpu: &Arc<Gpu>, plan: &Plan, cameras: &[Camera]) -> Result<Self> {
        Self::within(gpu, plan, cameras, PageCapacity::of(&gpu.device.limits(), plan.memory))
    }

    /// As [`TrainingViews::new`], divided as `capacity` says.
    ///
    /// # Errors
    /// As [`TrainingViews::new`].
    pub fn within(gpu: &Arc<Gpu>, plan: &Plan, cameras: &[Camera], capacity: PageCapacity) -> Result<Self> {
        let record = plan.record();
        let pixels = |camera: &Camera| camera.width as usize * camera.height as usize;
        let rows = cameras.iter().map(|camera| record.rows(pixels(camera))).sum();
        if u32::try_from(rows).is_err() || !cameras.iter().all(|camera| is_addressable(camera, record)) {
            let remedy = Remedy::HalveOrThinOut { most_images: cameras.len() / 2 };
            bail!(Advised::new("the photos are too large to be addressed; ", remedy, ""));
        }
        let pages = PagedArray::new(gpu, records::NAME, rows, capacity).context(Advised::new(
            "",
            Remedy::FewerPixels,
            "",
        ))?;
        Ok(Self {
            cameras: cameras.to_vec(),
            space: plan.space,
            silhouettes: Vec::with_capacity(cameras.len()),
            on_device: Vec::with_capacity(cameras.len()),
            pages,
            gpu: Arc::clone(gpu),
            record,
            units: Units { color: 1.0 / plan.features.grey, depth: plan.space.cubes_per_world() as f32 },
            row: 0,
        })
    }

    /// Adds the photo of the next camera.
    ///
    /// # Errors
    /// When it is not of the camera's size, has more channels than the plan's features say, there is no camera left, or
    /// the device was lost.
    pub fn add(&mut self, photo: &Photo) -> Result<()> {
        let number = self.silhouettes.len();
        let camera = self.cameras.get(number);
        let camera =
            camera.with_context(|| format!("there are only {number} cameras, and one more photo"))?;
        ensure!(
            (photo.image.width, photo.image.height) == (camera.width, camera.height),
            "photo {number} has {}x{} pixels, and its camera {}x{}; start again",
            photo.image.width,
            photo.image.height,
            camera.width,
            camera.height
        );
        let records = self.record.of(photo, self.units).with_context(|| format!("photo {number}"))?;
        self.pages.write(&self.gpu, self.row, &records)?;
        let pixel_count = (records.len() / self.record.words()) as u32;
        if pixel_count > 0 {
            let first_row = self.row as u32;
            let camera = field::DeviceCamera::in_box(camera, &self.space);
            self.on_device.push(field::DeviceCamera { first_row, pixel_count, ..camera });
        }
        self.row += rows_of(records.len());
        self.silhouettes.push(Silhouette::of(photo));
        Ok(())
    }

    /// Whether every camera has its photo, some pixel can be drawn, and the photos are as `plan` reads them.
    pub(crate) fn check_for(&self, plan: &Plan) -> Result<()> {
        let (photos, cameras) = (self.silhouettes.len(), self.cameras.len());
        ensure!(photos == cameras, "{photos} photos were added for {cameras} cameras");
        ensure!(!self.on_device.is_empty(), "masks ignore every pixel of all {photos} photos");
        ensure!(
            self.record == plan.record() && self.space == plan.space,
            "the photos were loaded for another plan, with other masks, depth, bits or another box; load them again"
        );
        Ok(())
    }
}

/// Whether a kernel can count the words of one photo.
fn is_addressable(camera: &Camera, record: Record) -> bool {
    let words = u64::from(camera.width) * u64::from(camera.height) * record.words() as u64;
    u32::try_from(words).is_ok()
}
