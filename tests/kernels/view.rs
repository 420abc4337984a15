//! A whole view through the renderer against the reference.

use glam::{DAffine3, DMat3, DVec2, DVec3};
use nerf::camera::{Camera, Lens};
use nerf::dataset::Bounds;
use nerf::reference::composite::{mean_depth, opacity, optical_depth, transmittances};
use nerf::reference::march::{BoxRay, March};
use nerf::reference::occupancy::OccupancyShape;
use nerf::render::Renderer;

use crate::bench::{Bench, Random, Setup};
use crate::close::assert_close;

#[test]
fn pixels_agree_with_the_reference() {
    let mut random = Random::new(90);
    for (cascades, hdr, lens) in
        [(1, false, Lens::Pinhole), (3, true, Lens::OpenCv { k: [-0.1, 0.02, 0.0, 0.0], p: [1e-3, -1e-3] })]
    {
        let mut setup = Setup::tiny().network(32, 2).hdr(hdr);
        setup.needs.cascades = cascades;
        setup.config.selection.stop_transmittance = 1e-4;
        let bench = Bench::new(&setup);
        bench.randomise(&mut random, 2.0, 1.5);
        bench.write("occupancy_bits", &vec![u32::MAX; bench.plan.cell_count() / 32]);
        let bounds =
            Bounds { center: DVec3::new(1.0, 2.0, 3.0), half: 0.75, cascades, source: String::new() };
        let back = DVec3::new(0.3, -0.2, 1.0).normalize();
        let right = back.any_orthonormal_vector();
        let camera = Camera {
            width: 11,
            height: 9,
            focal_px: DVec2::splat(13.0),
            center_px: DVec2::new(5.0, 4.0),
            lens,
            world_from_camera: DAffine3::from_mat3_translation(
                DMat3::from_cols(right, back.cross(right), back),
                bounds.center + 1.2 * back * bounds.outer_half(),
            ),
        };
        let linked = lens != Lens::Pinhole;
        let mut renderer =
            Renderer::new(&bench.gpu, &bench.plan, &bench.workspace, &bounds, linked).expect("a renderer");
        let view = renderer.render(&camera).expect("a view");
        assert_eq!((view.width, view.height, view.color.len(), view.depth.len()), (11, 9, 99, 99));

        let march = March {
            shape: OccupancyShape { cascades, resolution: bench.plan.config.occupancy.cells },
            steps: bench.plan.config.march.steps,
            cone: bench.plan.config.march.cone,
            near: bench.plan.config.march.near / bench.plan.density_scale(),
            max_steps: bench.plan.config.march.most_steps as u32,
        };
        let words = vec![u32::MAX; bench.plan.cell_count() / 32];
        let (model, objective) = (bench.model(), bench.objective());
        let side = 2.0 * bounds.outer_half();
        let (mut colors, mut depths) = (Vec::new(), Vec::new());
        for index in 0..99 {
            let pixel = DVec2::new(f64::from(index % 11) + 0.5, f64::from(index / 11) + 0.5);
            let ray = camera.ray(pixel).expect("a ray");
            let in_box = BoxRay { origin: (ray.origin - bounds.min()) / side, direction: ray.direction };
            let (mut taus, mut values, mut z) = (Vec::new(), Vec::new(), Vec::new());
            for sample in march.samples(in_box, 0.5, &words) {
                if (-taus.iter().sum::<f64>()).exp() < 1e-4 {
                    break;
                }
                let (s, color) = model.query(objective.color_range, sample.position, ray.direction);
                taus.push(optical_depth(s, sample.delta));
                values.push(color);
                z.push((sample.position - in_box.origin).dot(-back) * side);
            }
            let weights: Vec<f64> = (transmittances(objective.transmittance, &taus).iter().zip(&taus))
                .map(|(t, &tau)| t * opacity(tau))
                .collect();
            let channel = |x: usize| weights.iter().zip(&values).map(|(w, c)| w * c[x]).sum::<f64>();
            colors.extend([channel(0), channel(1), channel(2), weights.iter().sum()]);
            depths.push(mean_depth(&weights, &z));
        }
        assert!(depths.iter().any(|&z| z > 0.0));
        let name = format!("view, {cascades} cascades");
        assert_close(&name, view.color.as_flattened(), &colors, 2e-4, 2e-4);
        assert_close(&format!("depth, {name}"), &view.depth, &depths, 2e-4, 2e-4);
    }
}
