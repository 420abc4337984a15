//! The structs that kernels and the host share.

use super::Space;
use super::lenses;
use crate::camera::Geometry;
use crate::config::Optimizer;
use crate::field::layout::Level;
use crate::gpu::kernel::{Shared, StructLayout};
use crate::gpu_struct;

/// Every struct that kernels and the host share.
pub const LAYOUTS: &[StructLayout] = &[
    Step::LAYOUT,
    Counters::LAYOUT,
    Progress::LAYOUT,
    RayTarget::LAYOUT,
    RayResult::LAYOUT,
    DeviceCamera::LAYOUT,
    Level::LAYOUT,
    Tile::LAYOUT,
];

gpu_struct! {
    /// The numbers that change from step to step.
    Step {
        /// Start of this step's random numbers.
        stream: u32,
        /// First cell of an occupancy chunk.
        first_cell: u32,
        /// Distance between its cells.
        cell_stride: u32,
        /// Number of its cells.
        cell_count: u32,
        /// Adam's learning rate.
        learning_rate: f32,
        /// 1 / (1 - beta_1^t).
        first_correction: f32,
        /// 1 / (1 - beta_2^t).
        second_correction: f32,
    }
}

impl Step {
    /// What Adam needs to know of its step `step`, counted from 1.
    #[must_use]
    pub fn learning(optimizer: &Optimizer, step: u32, learning_rate: f64) -> Self {
        let correction = |beta: f64| (1.0 / (1.0 - beta.powf(f64::from(step)))) as f32;
        Self {
            learning_rate: learning_rate as f32,
            first_correction: correction(optimizer.beta_1),
            second_correction: correction(optimizer.beta_2),
            ..Self::default()
        }
    }
}

gpu_struct! {
    /// What is counted on the device; see `shaders/common/counters.wgsl`.
    Counters {
        /// Rays of the next step.
        rays: u32,
        /// Rays whose samples fit.
        rays_used: u32,
        /// Marched samples.
        samples: u32,
        /// Marched samples all rays asked for.
        samples_wanted: u32,
        /// Kept samples.
        kept: u32,
        /// Kept samples all rays asked for.
        kept_wanted: u32,
        /// By how much steps are longer than those of the configuration, as a share of them.
        step_excess: f32,
        /// Steps since the sums were cleared.
        sum_steps: u32,
        /// Rays since then.
        sum_rays: u32,
        /// Marched samples since then.
        sum_samples: u32,
        /// Kept samples since then.
        sum_kept: u32,
        /// Steps since then whose gradients could not be used, and which changed nothing.
        sum_skipped: u32,
        /// Sum of the other steps' losses.
        sum_loss: f32,
        /// Sum of their mean squared colour errors.
        sum_color_error: f32,
    }
}

gpu_struct! {
    /// How far the rendering of a view's band of pixels is; see `shaders/common/progress.wgsl`.
    Progress {
        /// Most samples of a ray in this round.
        quota: u32,
        /// Rays in work.
        rays: u32,
        /// Rounds begun.
        rounds: u32,
        /// First pixel among the rays that begin in this round.
        first_pixel: u32,
        /// First pixel among those of the next.
        next_pixel: u32,
        /// First pixel of the band.
        band_begin: u32,
        /// The pixel behind its last.
        band_end: u32,
    }
}

gpu_struct! {
    /// What a training ray should show; see `shaders/common/ray_target.wgsl`.
    RayTarget {
        /// Colour composited over the background, and opacity.
        color: [f32; 4],
        /// The background's colour.
        background: [f32; 3],
        /// Distance in sides of the inner cube; 0 where unknown.
        depth: f32,
    }
}

gpu_struct! {
    /// What a training ray showed; see `shaders/common/ray_result.wgsl`.
    RayResult {
        /// Colour over the background, and opacity.
        rendered: [f32; 4],
        /// Squared errors of the four channels with their weights; opacity's also holds what further terms add.
        errors: [f32; 4],
    }
}

gpu_struct! {
    /// The shape of a layer whose weight gradient is summed; see `shaders/common/tile.wgsl`.
    Tile {
        /// Quads per row of inputs.
        input_quads: u32,
        /// First quad in the weight buffer.
        first_quad: u32,
        /// 1 when the inputs lie in the order of all marched samples.
        of_samples: u32,
        /// Padding.
        unused: u32,
    }
}

gpu_struct! {
    /// A camera in box space; see `shaders/common/camera.wgsl`.
    DeviceCamera as Camera {
        /// Position.
        origin: [f32; 3],
        /// Pixels per row.
        width: u32,
        /// +X axis.
        right: [f32; 3],
        /// Rows.
        height: u32,
        /// +Y axis.
        up: [f32; 3],
        /// The photo's first row in the pages.
        first_row: u32,
        /// +Z axis, away from the view.
        back: [f32; 3],
        /// Pixels that can be drawn.
        pixel_count: u32,
        /// Focal lengths in pixels, per radian or per box unit.
        focal_px: [f32; 2],
        /// Principal point.
        center_px: [f32; 2],
        /// k1..k4.
        radial: [f32; 4],
        /// p1, p2.
        tangential: [f32; 2],
        /// Which lens.
        lens: u32,
        /// Where the lens's polynomial stops growing.
        rim: f32,
    }
}

impl DeviceCamera {
    /// `camera` in box space, without a photo.
    #[must_use]
    pub fn in_box(camera: &crate::camera::Camera, space: &Space) -> Self {
        let pose = camera.world_from_camera;
        let side = space.world_per_box();
        let axis = |axis: glam::DVec3| axis.normalize_or_zero().as_vec3().to_array();
        let (radial, tangential) = camera.lens.coefficients();
        // A parallel projection has pixels per length, and lengths are those of the box.
        let focal_px = match camera.lens.geometry() {
            Geometry::Parallel => camera.focal_px * side,
            Geometry::Plane | Geometry::Angles => camera.focal_px,
        };
        Self {
            origin: space.in_box(pose.translation).as_vec3().to_array(),
            width: camera.width,
            right: axis(pose.matrix3.x_axis),
            height: camera.height,
            up: axis(pose.matrix3.y_axis),
            first_row: 0,
            pixel_count: 1,
            back: axis(pose.matrix3.z_axis),
            focal_px: focal_px.as_vec2().to_array(),
            center_px: camera.center_px.as_vec2().to_array(),
            radial: radial.map(|k| k as f32),
            tangential: tangential.map(|p| p as f32),
            lens: lenses::number(camera.lens.kind()),
            rim: camera.lens.rim().unwrap_or_default() as f32,
        }
    }
}
