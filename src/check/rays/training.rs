//! Rays of a training, with their targets and backgrounds.

use super::{DeviceRay, bounds, camera, is_close_to_a_fold};
use crate::camera::{Camera, Lens};
use crate::check::draw::{Random, SEED, STEP, uniform};
use crate::check::{Setup, Subject, Tally, Workbench};
use crate::config::Background;
use crate::kernels::{self, dimension, training};
use crate::reference::random::random_u32;
use anyhow::Result;
use glam::DVec2;

/// Which view and which of its pixels the kernel draws for a ray.
#[must_use]
pub fn drawn(ray: usize, sizes: &[(u32, u32)]) -> (usize, u32) {
    let draw = |dimension| random_u32(SEED, STEP, ray as u32, dimension);
    let view = draw(dimension::IMAGE) as usize % sizes.len();
    (view, draw(dimension::PIXEL) % (sizes[view].0 * sizes[view].1))
}

/// A rig that mixes lenses.
const LENSES: [Lens; 4] = [
    Lens::OpenCv { k: [-0.27, 0.11, -0.03, 0.004], p: [2e-3, 1e-3] },
    Lens::Fisheye { k: [-0.03, 0.004, -0.0008, 0.00002] },
    Lens::Orthographic,
    Lens::Equirectangular,
];

/// Images of a batch: their sizes, cameras and pixels.
struct Images {
    sizes: [(u32, u32); 4],
    cameras: Vec<Camera>,
    first_texels: Vec<u32>,
    /// Premultiplied colour and alpha of all pixels, as a target should have them.
    pixels: Vec<[f64; 4]>,
}

/// Rays, targets and backgrounds that a training draws, from images of all kinds.
///
/// # Errors
/// When the device was lost or refuses a kernel.
pub fn training_rays(subject: &Subject) -> Result<Tally> {
    let mut tally =
        Tally::new("rays of a training", 4e-7, "a rotation, a unit vector, a product of colours round");
    let backgrounds =
        [Background::Black, Background::Random, Background::Random, Background::Color([0.25, 0.5, 0.75])];
    let kinds = [(false, true), (true, true), (false, true), (false, false)];
    for (background, (hdr, alpha)) in backgrounds.into_iter().zip(kinds) {
        let mut setup = Setup::tiny().hdr(hdr);
        setup.config.background = background;
        setup.needs.alpha = alpha;
        setup.needs.lenses = LENSES.iter().map(Lens::kind).collect();
        setup.needs.cameras = 4;
        let mut bench = subject.workbench(setup)?;
        let images = Images::upload(&mut bench, &mut Random::new(41))?;
        let stage = training::rays(&bench.gpu, &bench.plan, &bench.workspace)?;
        for count in [1, 3, 65, 250] {
            bench.set_rays(count);
            bench.run([&stage])?;
            let case = format!("{background:?}, hdr {hdr}, alpha {alpha}, {count} rays");
            images.compare(&mut tally, &case, &bench, count)?;
        }
    }
    Ok(tally)
}

impl Images {
    fn upload(bench: &mut Workbench, random: &mut Random) -> Result<Self> {
        let sizes = [(5, 3), (4, 4), (1, 1), (2, 31)];
        let cameras = (sizes.into_iter().zip(LENSES))
            .map(|(size, lens)| camera(random, size, lens))
            .collect::<Vec<_>>();
        let mut first_texels = vec![0];
        first_texels.extend(sizes.iter().scan(0, |sum, (width, height)| {
            *sum += width * height;
            Some(*sum)
        }));
        let texels = first_texels.pop().unwrap_or(0);
        let on_device: Vec<_> = (cameras.iter().zip(&first_texels))
            .map(|(camera, &first)| kernels::Camera::in_box(camera, &bounds(), first))
            .collect();
        let (gpu, workspace) = (&bench.gpu, &mut bench.workspace);
        workspace.add(gpu.storage_with("cameras", &on_device)?);
        let alpha = bench.plan.needs.alpha;
        let pixels = if bench.plan.needs.hdr {
            let mut pixel = || std::array::from_fn(|_| random.number(0.0, 1.0) as f32);
            let data: Vec<[f32; 4]> = (0..texels).map(|_| pixel()).collect();
            workspace.add(gpu.storage_with("pixels", &data)?);
            data.iter().map(|pixel| pixel.map(f64::from)).collect()
        } else {
            let mut pixel = || std::array::from_fn(|_| random.number(0.0, 256.0) as u8);
            let data: Vec<[u8; 4]> = (0..texels).map(|_| pixel()).collect();
            workspace.add(gpu.storage_with("pixels", &data)?);
            data.iter().map(|&pixel| premultiplied(pixel, alpha)).collect()
        };
        Ok(Self { sizes, cameras, first_texels, pixels })
    }

    fn compare(&self, tally: &mut Tally, case: &str, bench: &Workbench, count: usize) -> Result<()> {
        let targets: Vec<[f32; 4]> = bench.read("targets", count)?;
        let backgrounds: Vec<[f32; 4]> = bench.read("backgrounds", count)?;
        for (index, ray) in DeviceRay::read(bench, count)?.into_iter().enumerate() {
            let case = format!("{case}, ray {index}");
            let (view, texel) = drawn(index, &self.sizes);
            let camera = &self.cameras[view];
            let pixel =
                DVec2::new(f64::from(texel % camera.width) + 0.5, f64::from(texel / camera.width) + 0.5);
            if let Some(want) = camera.ray(pixel).filter(|_| !is_close_to_a_fold(camera, pixel)) {
                tally.each(&case, &ray.direction.to_array(), &want.direction.to_array(), |_| 1.0);
                let origin = (want.origin - bounds().min()) / (2.0 * bounds().outer_half());
                let size = 1.0 + origin.abs().max_element();
                tally.each(&format!("{case}, origin"), &ray.origin.to_array(), &origin.to_array(), |_| size);
            }
            let behind = match bench.plan.config.background {
                Background::Random => {
                    [0, 1, 2].map(|channel| uniform(index, dimension::BACKGROUND + channel))
                }
                solid => solid.solid().map(f64::from),
            };
            let [r, g, b, alpha] = self.pixels[(self.first_texels[view] + texel) as usize];
            let over = |color: f64, channel: usize| color + (1.0 - alpha) * behind[channel];
            let target = [over(r, 0), over(g, 1), over(b, 2), alpha];
            tally.each(&format!("{case}, target"), &targets[index], &target, |_| 1.0);
            let want = [behind[0], behind[1], behind[2], 0.0];
            tally.each(&format!("{case}, background"), &backgrounds[index], &want, |_| 1.0);
        }
        Ok(())
    }
}

fn premultiplied([r, g, b, a]: [u8; 4], has_alpha: bool) -> [f64; 4] {
    let alpha = if has_alpha { f64::from(a) / 255.0 } else { 1.0 };
    let [r, g, b] = [r, g, b].map(|x| f64::from(x) / 255.0 * alpha);
    [r, g, b, alpha]
}
