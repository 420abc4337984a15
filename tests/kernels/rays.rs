//! Rays whose way through the box is known.

use anyhow::Result;
use glam::{DAffine3, DVec2, DVec3};
use nerf::camera::{Camera, Lens, LensKind};
use nerf::field::renderer::Renderer;
use nerf::field::viewing;
use nerf::verify::check::Setup;
use nerf::verify::check::rays::{DeviceRay, begin_rays, pixel_camera};

use crate::bench::workbench;
use crate::close::assert_close;

/// A renderer says so when a camera has a lens that it was not built for.
#[test]
fn lenses_that_were_left_out_are_refused() -> Result<()> {
    let bench = workbench(Setup::tiny())?;
    let linked = [LensKind::Pinhole, LensKind::OpenCv].into();
    let mut renderer = Renderer::new(&bench.field, &linked)?;
    let mut camera = Camera {
        width: 3,
        height: 2,
        focal_px: DVec2::splat(2.0),
        center_px: DVec2::new(1.5, 1.0),
        lens: Lens::Fisheye { k: [0.0; 4] },
        world_from_camera: DAffine3::from_translation(2.0 * DVec3::Z),
    };
    let refusal = format!("{:#}", renderer.render(&camera).expect_err("it is not linked"));
    assert!(refusal.contains("pinhole, OpenCV") && refusal.contains("fisheye"), "{refusal}");
    camera.lens = Lens::Pinhole;
    assert_eq!(renderer.render(&camera)?.depth.len(), 6);
    Ok(())
}

/// Rays along the axes, from inside, from outside, and past the box.
#[test]
fn rays_along_the_axes() -> Result<()> {
    let mut bench = workbench(Setup::tiny())?;
    bench.workspace.allocate(&bench.gpu, &viewing::buffers(&bench.plan))?;
    let stage = viewing::rays(&bench.gpu, &bench.plan, &bench.workspace)?;
    let near = bench.plan.config.march.near;
    for (origin, back, want) in [
        ([0.5, 0.5, 3.0], [0.0, 0.0, 1.0], Some([2.0, 3.0])),
        ([0.5, 0.5, 0.5], [0.0, 0.0, 1.0], Some([near, 0.5])),
        ([0.25, 0.5, 0.5], [-1.0, 0.0, 0.0], Some([near, 0.75])),
        ([0.0, 0.5, -2.0], [0.0, 0.0, -1.0], Some([2.0, 3.0])),
        ([0.5, 7.0, 0.5], [0.0, -1.0, 0.0], None),
        ([1.5, 0.5, 3.0], [0.0, 0.0, 1.0], None),
        ([-0.001, 0.5, 3.0], [0.0, 0.0, 1.0], None),
    ] {
        let camera = pixel_camera(DVec3::from_array(origin), -DVec3::from_array(back));
        bench.write("view_camera", &[camera]);
        begin_rays(&bench, 0..1);
        bench.run([&stage])?;
        let ray = &DeviceRay::read(&bench, 1)?[0];
        match want {
            Some(want) => assert_close("axis", &[ray.t_near, ray.t_far], &want, 0.0, 1e-6),
            None => assert!(ray.t_far <= ray.t_near, "{origin:?} hits: {} {}", ray.t_near, ray.t_far),
        }
    }
    Ok(())
}
