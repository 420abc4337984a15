//! Rays and targets: pixels through lenses to rays in box space, and what they should look like.

use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};
use nerf::camera::{Camera, Lens};
use nerf::config::Background;
use nerf::dataset::Bounds;
use nerf::kernels::{self, training, viewing};
use nerf::reference::random::random_u32;

use crate::bench::{Bench, Random, SEED, STEP, Setup, dimension, quiet_step, uniform};
use crate::close::assert_close;

fn bounds() -> Bounds {
    Bounds { center: DVec3::new(0.5, -1.0, 2.0), half: 1.5, cascades: 1, source: String::new() }
}

/// A camera outside of the box that looks at it, its principal point off the centre.
fn camera(random: &mut Random, width: u32, height: u32, lens: Lens) -> Camera {
    let rotation = DQuat::from_rotation_y(random.number(-3.0, 3.0))
        * DQuat::from_rotation_x(random.number(-1.2, 1.2))
        * DQuat::from_rotation_z(random.number(-3.0, 3.0));
    let size = DVec2::new(f64::from(width), f64::from(height));
    Camera {
        width,
        height,
        focal_px: DVec2::new(0.81, 0.77) * size.x.max(4.0),
        center_px: size * DVec2::new(0.43, 0.61),
        lens,
        world_from_camera: DAffine3::from_mat3_translation(
            DMat3::from_quat(rotation),
            bounds().center + rotation * DVec3::new(0.2, -0.1, random.number(1.0, 5.0)),
        ),
    }
}

/// Lenses of a phone, an action camera and a strong barrel that folds within the image; and a pincushion.
fn lenses() -> [(&'static str, Lens); 6] {
    let open_cv = |k, p| Lens::OpenCv { k, p };
    [
        ("pinhole", Lens::Pinhole),
        ("none", open_cv([0.0; 4], [0.0; 2])),
        ("mild", open_cv([0.05, -0.08, 0.02, 0.0], [1e-3, -5e-4])),
        ("action", open_cv([-0.27, 0.11, -0.03, 0.004], [2e-3, 1e-3])),
        ("fold", open_cv([-0.45, 0.05, 0.0, 0.0], [1e-3, 2e-3])),
        ("pincushion", open_cv([0.35, 0.12, 0.01, 0.0], [-3e-3, 2e-3])),
    ]
}

/// A ray as the device stores it.
struct DeviceRay {
    origin: DVec3,
    direction: DVec3,
    t_near: f64,
    t_far: f64,
}

fn read_rays(bench: &Bench, count: usize) -> Vec<DeviceRay> {
    let vector = |[x, y, z, _]: [f32; 4]| DVec3::from_array([x, y, z].map(f64::from));
    (bench.rays(count).into_iter())
        .map(|[origin, direction]| DeviceRay {
            origin: vector(origin),
            direction: vector(direction),
            t_near: f64::from(origin[3]),
            t_far: f64::from(direction[3]),
        })
        .collect()
}

/// Where a ray is inside of `low..high` from `near` on, by the slab test.
fn interval(ray: &DeviceRay, [low, high]: [f64; 2], near: f64) -> [f64; 2] {
    let (mut t_near, mut t_far) = (near, f64::INFINITY);
    for axis in 0..3 {
        let [a, b] = [low, high].map(|side| (side - ray.origin[axis]) / ray.direction[axis]);
        t_near = t_near.max(a.min(b));
        t_far = t_far.min(a.max(b));
    }
    [t_near, t_far]
}

/// Whether the lens model decides by rounding: the answer differs a little nearer to or farther from the centre.
fn is_close_to_a_fold(camera: &Camera, pixel: DVec2) -> bool {
    let seen = |scale: f64| camera.ray(camera.center_px + (pixel - camera.center_px) * scale).is_some();
    [0.97, 1.03].iter().any(|&scale| seen(scale) != seen(1.0))
}

#[test]
fn every_pixel_of_every_lens() {
    let mut random = Random::new(40);
    for (name, lens) in lenses() {
        let mut setup = Setup::tiny();
        setup.needs.lens = lens != Lens::Pinhole;
        let (width, height) = (17, 13);
        setup.config.batch.rays = 256;
        let mut bench = Bench::new(&setup);
        viewing::allocate(&bench.0.gpu, &bench.0.plan, &mut bench.0.workspace).expect("a view");
        let stage = viewing::rays(&bench.gpu, &bench.plan, &bench.workspace).expect("view rays");
        let camera = camera(&mut random, width, height, lens);
        bench.write("cameras", &[kernels::Camera::in_box(&camera, &bounds(), 0)]);
        let pixels = (width * height) as usize;
        // Two chunks, the second starts in the middle of a row.
        let mut rays = Vec::new();
        for (first, count) in [(0, 130), (130, pixels - 130)] {
            bench.set_rays(count);
            bench.set_step(kernels::Step { first_pixel: first as u32, ..quiet_step() });
            bench.run([&stage]);
            rays.extend(read_rays(&bench, count));
        }
        let (mut directions, mut wanted, mut none, mut unclear) = (Vec::new(), Vec::new(), 0, 0);
        for (index, ray) in rays.iter().enumerate() {
            let (x, y) = (index as u32 % width, index as u32 / width);
            let pixel = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            if is_close_to_a_fold(&camera, pixel) {
                unclear += 1;
                continue;
            }
            let Some(want) = camera.ray(pixel) else {
                none += 1;
                assert!(ray.t_far <= ray.t_near, "{name}: pixel {pixel} has no ray");
                continue;
            };
            let origin = (want.origin - bounds().min()) / (2.0 * bounds().outer_half());
            assert_eq!(ray.origin.as_vec3(), origin.as_vec3(), "{name}: origin");
            directions.extend(ray.direction.to_array());
            wanted.extend(want.direction.to_array());
            assert!((ray.direction.length() - 1.0).abs() < 3e-7, "{name}: length at {pixel}");
            let [t_near, t_far] = interval(ray, [0.0, 1.0], bench.plan.config.march.near);
            if (t_far - t_near).abs() > 1e-5 {
                assert_eq!(ray.t_near < ray.t_far, t_near < t_far, "{name}: hits the box at {pixel}");
            }
            if t_near < t_far {
                let near_and_far = [ray.t_near, ray.t_far];
                assert_close(&format!("box, {name}"), &near_and_far, &[t_near, t_far], 1e-6, 1e-6);
            }
        }
        println!("{name}: {none} pixels without a ray, {unclear} too close to a fold");
        assert!((name == "fold") == (none > 0));
        assert_close(&format!("directions, {name}"), &directions, &wanted, 1e-6, 0.0);
    }
}

/// Rays along the axes, from inside, from outside, and past the box.
#[test]
fn rays_along_the_axes() {
    let mut bench = Bench::new(&Setup::tiny());
    viewing::allocate(&bench.0.gpu, &bench.0.plan, &mut bench.0.workspace).expect("a view");
    let stage = viewing::rays(&bench.gpu, &bench.plan, &bench.workspace).expect("view rays");
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
        bench.write("cameras", &[camera]);
        bench.set_rays(1);
        bench.run([&stage]);
        let ray = &read_rays(&bench, 1)[0];
        match want {
            Some(want) => assert_close("axis", &[ray.t_near, ray.t_far], &want, 0.0, 1e-6),
            None => assert!(ray.t_far <= ray.t_near, "{origin:?} hits: {} {}", ray.t_near, ray.t_far),
        }
    }
}

/// A camera of one pixel whose only ray goes along `direction`, all of it in box space.
pub(crate) fn pixel_camera(origin: DVec3, direction: DVec3) -> kernels::Camera {
    let right = direction.any_orthonormal_vector();
    let array = |vector: DVec3| vector.as_vec3().to_array();
    kernels::Camera {
        origin: array(origin),
        width: 1,
        right: array(right),
        height: 1,
        up: array(right.cross(-direction)),
        back: array(-direction),
        focal_px: [1.0; 2],
        center_px: [0.5; 2],
        ..kernels::Camera::default()
    }
}

/// Which view and which of its pixels the kernel draws for a ray.
pub(crate) fn drawn(ray: usize, sizes: &[(u32, u32)]) -> (usize, u32) {
    let draw = |dimension| random_u32(SEED, STEP, ray as u32, dimension);
    let view = draw(dimension::IMAGE) as usize % sizes.len();
    (view, draw(dimension::PIXEL) % (sizes[view].0 * sizes[view].1))
}

#[test]
fn targets_of_mixed_images() {
    let mut random = Random::new(41);
    let sizes = [(5, 3), (4, 4), (1, 1), (2, 31)];
    let lens = lenses()[3].1;
    for background in
        [Background::Black, Background::White, Background::Random, Background::Color([0.25, 0.5, 0.75])]
    {
        for hdr in [false, true] {
            let mut setup = Setup::tiny().hdr(hdr);
            setup.config.background = background;
            setup.needs.lens = true;
            setup.needs.cameras = sizes.len();
            let mut bench = Bench::new(&setup);
            let cameras = sizes.map(|(width, height)| camera(&mut random, width, height, lens));
            let mut first = 0;
            let on_device: Vec<_> = (cameras.iter())
                .map(|camera| {
                    let result = kernels::Camera::in_box(camera, &bounds(), first);
                    first += camera.width * camera.height;
                    result
                })
                .collect();
            let texels = first as usize;
            // Premultiplied colour and alpha, as the target should have them.
            let pixels: Vec<[f64; 4]> = if hdr {
                let data: Vec<[f32; 4]> =
                    (0..texels).map(|_| std::array::from_fn(|_| random.number(0.0, 1.0) as f32)).collect();
                bench.0.workspace.add(bench.0.gpu.storage_with("pixels", &data).expect("pixels"));
                data.iter().map(|pixel| pixel.map(f64::from)).collect()
            } else {
                let data: Vec<[u8; 4]> =
                    (0..texels).map(|_| std::array::from_fn(|_| random.number(0.0, 256.0) as u8)).collect();
                bench.0.workspace.add(bench.0.gpu.storage_with("pixels", &data).expect("pixels"));
                let premultiplied = |&[r, g, b, a]: &[u8; 4]| {
                    let alpha = f64::from(a) / 255.0;
                    let [r, g, b] = [r, g, b].map(|x| f64::from(x) / 255.0 * alpha);
                    [r, g, b, alpha]
                };
                data.iter().map(premultiplied).collect()
            };
            bench.0.workspace.add(bench.0.gpu.storage_with("cameras", &on_device).expect("cameras"));
            let stage = training::rays(&bench.gpu, &bench.plan, &bench.workspace).expect("rays");
            for count in [1, 3, 65, 130] {
                bench.set_rays(count);
                bench.run([&stage]);
                let rays = read_rays(&bench, count);
                let targets: Vec<[f32; 4]> = bench.read("targets", count);
                let backgrounds: Vec<[f32; 4]> = bench.read("backgrounds", count);
                let (mut directions, mut want_directions) = (Vec::new(), Vec::new());
                let (mut want_targets, mut want_backgrounds) = (Vec::new(), Vec::new());
                for (index, ray) in rays.iter().enumerate() {
                    let (view, texel) = drawn(index, &sizes);
                    let camera = &cameras[view];
                    let pixel = DVec2::new(
                        f64::from(texel % camera.width) + 0.5,
                        f64::from(texel / camera.width) + 0.5,
                    );
                    if let Some(want) = camera.ray(pixel)
                        && !is_close_to_a_fold(camera, pixel)
                    {
                        directions.extend(ray.direction.to_array());
                        want_directions.extend(want.direction.to_array());
                    }
                    let behind = match background {
                        Background::Random => {
                            [0, 1, 2].map(|channel| uniform(index, dimension::BACKGROUND + channel))
                        }
                        solid => solid.solid().map(f64::from),
                    };
                    let [r, g, b, alpha] = pixels[on_device[view].first_texel as usize + texel as usize];
                    let over = |color: f64, channel: usize| color + (1.0 - alpha) * behind[channel];
                    want_targets.push([over(r, 0), over(g, 1), over(b, 2), alpha]);
                    want_backgrounds.push([behind[0], behind[1], behind[2], 0.0]);
                }
                let name = format!("{background:?}, hdr {hdr}, {count} rays");
                let flat = |values: &[[f32; 4]]| values.as_flattened().to_vec();
                assert_close(&format!("drawn rays, {name}"), &directions, &want_directions, 1e-6, 0.0);
                assert_close("targets", &flat(&targets), want_targets.as_flattened(), 3e-7, 0.0);
                assert_close("backgrounds", &flat(&backgrounds), want_backgrounds.as_flattened(), 0.0, 0.0);
            }
        }
    }
}
