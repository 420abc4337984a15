//! The rays that a training run draws: from which pixel of which photo, and what they should look like.

use super::{DeviceRay, bounds, camera, is_close_to_a_fold};
use crate::camera::{Camera, Lens};
use crate::config::Background;
use crate::field::records::Units;
use crate::field::{self, RayTarget, SceneFeatures, dimension, rays};
use crate::gpu::paged_array::ROW;
use crate::photo::Photo;
use crate::photo::{Image, Pixels};
use crate::verify::check::inputs::{Random, SEED, STEP, uniform};
use crate::verify::check::{CheckResult, CheckedAdapter, Setup, Workbench};
use crate::verify::reference::random::random_u32;
use anyhow::Result;
use glam::DVec2;

/// Photos smaller than a row of the pages, and one that lies in several pages.
const SIZES: [(u32, u32); 5] = [(5, 3), (4, 4), (1, 1), (70, 131), (2, 31)];
/// A rig that mixes lenses.
const LENSES: [Lens; 5] = [
    Lens::OpenCv { k: [-0.27, 0.11, -0.03, 0.004], p: [2e-3, 1e-3] },
    Lens::Fisheye { k: [-0.03, 0.004, -0.0008, 0.00002] },
    Lens::Orthographic,
    Lens::Pinhole,
    Lens::Equirectangular,
];
/// What colours and depths are multiplied with on their way to the device.
const UNITS: Units = Units { color: 0.25, depth: 0.5 };

/// Which view and which of its pixels, of which each has so many, the kernel draws for a ray.
#[must_use]
pub fn drawn(ray: usize, pixels: &[u32]) -> (usize, u32) {
    let draw = |dimension| random_u32(SEED, STEP, ray as u32, dimension);
    let view = draw(dimension::IMAGE) as usize % pixels.len();
    (view, draw(dimension::PIXEL) % pixels[view])
}

/// Photos of a batch, as they went to the device.
struct Photos {
    cameras: Vec<Camera>,
    photos: Vec<Photo>,
    /// Positions of the pixels that count, photo by photo.
    counting: Vec<Vec<u32>>,
}

/// Rays, targets and backgrounds that a training run draws, from photos of all kinds, with masks and depth.
///
/// # Errors
/// When the device was lost or refuses a kernel.
pub fn training_rays(adapter: &CheckedAdapter) -> Result<CheckResult> {
    let mut result =
        CheckResult::new("training rays", 4e-7, "a rotation, a unit vector, a product of colours round");
    let kind = |alpha, hdr, deep, masks, depth| SceneFeatures {
        alpha,
        hdr,
        deep,
        masks,
        depth,
        ..SceneFeatures::default()
    };
    let kinds = [
        (Background::Black, kind(true, false, false, false, false)),
        (Background::Random, kind(true, true, false, false, true)),
        (Background::Random, kind(true, false, false, true, false)),
        (Background::White, kind(true, false, true, true, true)),
        (Background::Color([0.25, 0.5, 0.75]), kind(false, false, false, false, false)),
    ];
    for (background, features) in kinds {
        let mut setup = Setup::tiny();
        setup.config.background = background;
        let lenses = LENSES.iter().map(Lens::kind).collect();
        setup.features = SceneFeatures { lenses, ..features };
        setup.bounds = bounds();
        let mut bench = adapter.workbench(setup)?;
        let photos = Photos::upload(&mut bench, &mut Random::new(41))?;
        let stage = rays::stage(&bench.gpu, &bench.plan, &bench.workspace, SIZES.len())?;
        for count in [1, 3, 65, 250] {
            bench.set_rays(count);
            bench.run([&stage])?;
            let case = format!("{background:?}, {:?}, {count} rays", bench.plan.features);
            photos.compare(&mut result, &case, &bench, count)?;
        }
    }
    Ok(result)
}

impl Photos {
    fn upload(bench: &mut Workbench, random: &mut Random) -> Result<Self> {
        let cameras: Vec<_> =
            SIZES.iter().zip(LENSES).map(|(&size, lens)| camera(random, size, lens)).collect();
        let features = bench.plan.features.clone();
        let photos: Vec<_> = SIZES.iter().map(|&size| photo(random, size, &features)).collect();
        let record = bench.plan.record();
        let (mut words, mut on_device, mut counting) = (Vec::new(), Vec::new(), Vec::new());
        for (camera, photo) in cameras.iter().zip(&photos) {
            let pixels = 0..camera.width * camera.height;
            let counts: Vec<_> =
                pixels.filter(|&pixel| photo.ignored.get(pixel as usize) != Some(&true)).collect();
            on_device.push(field::DeviceCamera {
                first_row: (words.len() / ROW) as u32,
                pixel_count: counts.len() as u32,
                ..field::DeviceCamera::in_box(camera, &bench.plan.space)
            });
            counting.push(counts);
            words.extend_from_slice(&record.of(photo, UNITS)?);
            words.resize(words.len().next_multiple_of(ROW), 0);
        }
        bench.add_photos(&words)?;
        bench.workspace.add(bench.gpu.storage_with("cameras", &on_device)?);
        Ok(Self { cameras, photos, counting })
    }

    fn compare(&self, result: &mut CheckResult, case: &str, bench: &Workbench, count: usize) -> Result<()> {
        let targets: Vec<RayTarget> = bench.read("ray_targets", count)?;
        let features = &bench.plan.features;
        let pixels: Vec<u32> = self.counting.iter().map(|counting| counting.len() as u32).collect();
        for (index, ray) in DeviceRay::read(bench, count)?.into_iter().enumerate() {
            let case = format!("{case}, ray {index}");
            let (view, drawn) = drawn(index, &pixels);
            let (camera, photo) = (&self.cameras[view], &self.photos[view]);
            let texel = self.counting[view][drawn as usize];
            let pixel =
                DVec2::new(f64::from(texel % camera.width) + 0.5, f64::from(texel / camera.width) + 0.5);
            if let Some(want) = camera.ray(pixel).filter(|_| !is_close_to_a_fold(camera, pixel)) {
                result.each(&case, &ray.direction.to_array(), &want.direction.to_array(), |_| 1.0);
                if features.depth {
                    let depth = f64::from(photo.depth[texel as usize] * UNITS.depth);
                    let distance = depth / camera.depth_of_unit(want.direction);
                    result.value(targets[index].depth.into(), distance, 1.0 + distance, || {
                        format!("{case}, depth")
                    });
                }
                let origin = (want.origin - bounds().min()) / (2.0 * bounds().outer_half());
                let size = 1.0 + origin.abs().max_element();
                result.each(&format!("{case}, origin"), &ray.origin.to_array(), &origin.to_array(), |_| size);
            }
            let behind = match bench.plan.config.background {
                Background::Random => {
                    [0, 1, 2].map(|channel| uniform(index, dimension::BACKGROUND + channel))
                }
                solid => solid.solid().map(f64::from),
            };
            let [r, g, b, alpha] = target(&photo.image.pixels, texel as usize, features.alpha);
            let over = |color: f64, channel: usize| color + (1.0 - alpha) * behind[channel];
            let target = [over(r, 0), over(g, 1), over(b, 2), alpha];
            result.each(&format!("{case}, target"), &targets[index].color, &target, |_| 1.0);
            result.each(&format!("{case}, background"), &targets[index].background, &behind, |_| 1.0);
        }
        Ok(())
    }
}

/// Random pixels, of which some are ignored and some have no depth.
fn photo(random: &mut Random, (width, height): (u32, u32), features: &SceneFeatures) -> Photo {
    let count = width * height;
    let mut values = |most: f64| -> [f64; 4] { std::array::from_fn(|_| random.number(0.0, most)) };
    let pixels = if features.hdr {
        Pixels::Linear((0..count).map(|_| values(4.0).map(|x| x as f32)).collect())
    } else if features.deep {
        Pixels::Srgb16((0..count).map(|_| values(65_536.0).map(|x| x as u16)).collect())
    } else {
        Pixels::Srgb8((0..count).map(|_| values(256.0).map(|x| x as u8)).collect())
    };
    let mut photo = Photo::from(Image { width, height, pixels, has_alpha: features.alpha });
    if features.masks {
        // The pixel of the smallest photo counts.
        photo.ignored = (0..count).map(|pixel| pixel % 3 == 1).collect();
    }
    if features.depth {
        let depth = |pixel| if pixel % 4 == 0 { 0.0 } else { random.number(0.5, 9.0) as f32 };
        photo.depth = (0..count).map(depth).collect();
    }
    photo
}

/// Premultiplied colour and alpha of a pixel, as a target should have them.
fn target(pixels: &Pixels, pixel: usize, has_alpha: bool) -> [f64; 4] {
    let straight = match pixels {
        Pixels::Srgb8(data) => data[pixel].map(|x| f64::from(x) / 255.0),
        Pixels::Srgb16(data) => data[pixel].map(|x| f64::from(x) / 65_535.0),
        Pixels::Linear(data) => {
            let [r, g, b, alpha] = data[pixel].map(f64::from);
            let unit = f64::from(UNITS.color);
            return [r * unit, g * unit, b * unit, alpha];
        }
    };
    let alpha = if has_alpha { straight[3] } else { 1.0 };
    [straight[0] * alpha, straight[1] * alpha, straight[2] * alpha, alpha]
}
