//! Photos of 16 bits and of linear light.

use super::driving::{checkpoint, folder, generated, number, rows, text, train};
use super::{
    PLAIN, Random, SIZE, SMALL, STEPS, TOYS, all_images, copy, edit_frames, linear, remarks, rendered, srgb8,
    stem, write_linear,
};
use image::codecs::hdr::HdrEncoder;
use image::{ImageBuffer, Rgb, Rgba};
use serde_json::json;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Toys of which the photos that `chosen` says have 16 bits, all of them used.
fn deep(name: &str, chosen: impl Fn(usize) -> bool) -> PathBuf {
    let dataset = copy(&TOYS, name);
    let mut random = Random(3);
    for (_, photo) in all_images(&dataset, "png").iter().enumerate().filter(|(index, _)| chosen(*index)) {
        let mut widen = |value: u8| match value {
            0 | 255 => u16::from(value) * 257,
            // What 8 bits would round away.
            _ => u16::from(value) * 257 + random.below(256) as u16 - 128,
        };
        let wide = srgb8(photo).iter().flatten().map(|&value| widen(value)).collect();
        let picture = ImageBuffer::<Rgba<u16>, Vec<u16>>::from_raw(SIZE, SIZE, wide).expect("all pixels");
        picture.save(photo).expect("writable");
    }
    dataset
}

#[test]
fn sixteen_bits_train_like_eight() {
    let left_out = |run: &Path, deep: bool| {
        let left_out = rows(run)[0]["left_out"].to_string();
        assert_eq!(left_out.contains("16-bit pixels"), !deep, "{left_out}");
        assert_eq!(left_out.contains("8-bit pixels (not"), deep, "{left_out}");
        assert_eq!(checkpoint(run).about.needs.deep, deep);
    };
    let (plain, eight) = &*PLAIN;
    left_out(plain, false);
    let datasets = [("sixteen", deep("sixteen", |_| true)), ("mixed", deep("mixed", |index| index % 2 == 0))];
    for (name, dataset) in datasets {
        let run = folder(&format!("{name}_run"));
        let psnr = number(&train(&dataset, &run, &STEPS)["psnr"]);
        left_out(&run, true);
        println!("{eight:.2} dB with 8 bits, {psnr:.2} dB {name}");
        assert!((psnr - eight).abs() < 0.5, "{eight} {psnr}");
    }
}

static LINEAR: LazyLock<PathBuf> =
    LazyLock::new(|| generated("toys", "linear", &[&SMALL[..], &["--hdr"]].concat()));

/// Linear toys that are so many times as bright.
fn scaled(name: &str, factor: f32) -> PathBuf {
    let dataset = copy(&LINEAR, name);
    for photo in all_images(&dataset, "exr") {
        let scale = |[r, g, b, alpha]: [f32; 4]| [r * factor, g * factor, b * factor, alpha];
        let pixels: Vec<_> = linear(&photo).into_iter().map(scale).collect();
        write_linear(&photo, &pixels);
    }
    dataset
}

/// The same in Radiance's format, which has no alpha.
fn radiance() -> PathBuf {
    let dataset = copy(&LINEAR, "radiance");
    for photo in all_images(&dataset, "exr") {
        let colors: Vec<_> = linear(&photo).into_iter().map(|[r, g, b, _]| Rgb([r, g, b])).collect();
        let file = File::create(photo.with_extension("hdr")).expect("writable");
        HdrEncoder::new(file).encode(&colors, SIZE as usize, SIZE as usize).expect("writable");
        fs::remove_file(photo).expect("removed");
    }
    edit_frames(&dataset, |name| vec![("file_path", json!(name.replace(".exr", ".hdr")))]);
    dataset
}

/// How well linear test views are rendered.
#[derive(Debug)]
struct Errors {
    /// Median relative errors of pixels brighter and darker than [`BRIGHT`].
    bright: f32,
    dark: f32,
    /// Mean squared relative error, in decibels.
    relative_db: f64,
    /// Largest rendered and true values.
    most: [f32; 2],
}

/// Beyond what a display shows.
const BRIGHT: f32 = 1.0;
/// In the shade.
const DARK: f32 = 0.2;

/// Compares renderings of linear toys, whose colours were multiplied with `factor`, with the truth.
fn errors(run: &Path, dataset: &Path, factor: f32) -> Errors {
    let (mut bright, mut dark) = (Vec::new(), Vec::new());
    let (mut sum, mut count, mut most) = (0.0, 0.0, [0.0f32; 2]);
    for view in rendered(run, dataset) {
        let truth = linear(&LINEAR.join(format!("test/{}.exr", stem(&view))));
        for (ours, truth) in linear(&view).iter().zip(&truth) {
            for channel in 0..3 {
                let (value, wanted) = (ours[channel] / factor, truth[channel]);
                most = [most[0].max(value), most[1].max(wanted)];
                let both = 0.5 * (value * value + wanted * wanted) + 0.01;
                sum += f64::from((value - wanted).powi(2) / both);
                count += 1.0;
                let error = (value - wanted).abs() / wanted;
                match truth[3] > 0.999 {
                    true if wanted > BRIGHT => bright.push(error),
                    true if wanted < DARK && wanted > 0.01 => dark.push(error),
                    _ => {}
                }
            }
        }
    }
    let median = |mut values: Vec<f32>| {
        assert!(values.len() > 30, "{} pixels", values.len());
        values.sort_by(f32::total_cmp);
        values[values.len() / 2]
    };
    let errors = Errors {
        bright: median(bright),
        dark: median(dark),
        relative_db: -10.0 * f64::log10(sum / count),
        most,
    };
    println!("{}: {errors:?}", text(run));
    errors
}

#[test]
fn linear_light_is_learnt_from_dark_to_bright() {
    let radiance = radiance();
    for (name, dataset) in [("open_exr", &*LINEAR), ("radiance", &radiance)] {
        let run = folder(&format!("{name}_run"));
        train(dataset, &run, &STEPS);
        let about = checkpoint(&run).about;
        assert!(about.needs.hdr && about.needs.alpha == (name == "open_exr"));
        let errors = errors(&run, dataset, 1.0);
        assert!(errors.most[0] > 0.5 * errors.most[1] && errors.most[1] > BRIGHT, "{errors:?}");
        assert!(errors.bright < 0.3 && errors.dark < 0.3, "{errors:?}");
    }
}

#[test]
fn a_linear_scene_has_no_brightness_of_its_own() {
    let [plain, bright, dark] = [1.0, 1e3, 1e-3].map(|factor| {
        let name = format!("times_{factor}");
        let (dataset, run) = (scaled(&name, factor), folder(&format!("{name}_run")));
        train(&dataset, &run, &[&STEPS[..], &["--no-eval"]].concat());
        errors(&run, &dataset, factor).relative_db
    });
    assert!((plain - bright).abs() < 0.7 && (plain - dark).abs() < 0.7, "{plain} {bright} {dark}");
}

#[test]
fn linear_and_display_referred_photos_do_not_mix() {
    let dataset = copy(&LINEAR, "both");
    fs::copy(TOYS.join("train/0003.png"), dataset.join("train/0003.exr")).expect("copied");
    let (success, said) = remarks(&dataset, &folder("both_run"), &STEPS);
    assert!(!success && said.contains("0003.exr; convert one kind"), "{said}");
}
