//! Photos of 16 bits and of linear light.

use super::{
    PLAIN, Random, SIZE, SMALL, STEPS, TOYS, all_images, copy, edit_frames, linear, remarks, rendered, srgb8,
    stem, write_linear,
};
use crate::program::{checkpoint, generated, number, place, rows, text, train};
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
        assert_eq!(checkpoint(run).metadata.features.deep, deep);
    };
    let (plain, eight) = &*PLAIN;
    left_out(plain, false);
    let datasets = [("sixteen", deep("sixteen", |_| true)), ("mixed", deep("mixed", |index| index % 2 == 0))];
    for (name, dataset) in datasets {
        let run = place(&format!("{name}_run"));
        let psnr = number(&train(&dataset, &run, &STEPS)["psnr"]);
        left_out(&run, true);
        println!("{eight:.2} dB with 8 bits, {psnr:.2} dB {name}");
        assert!((psnr - eight).abs() < 0.5, "{eight} {psnr}");
    }
}

static LINEAR: LazyLock<PathBuf> =
    LazyLock::new(|| generated("toys", "linear", &[&SMALL[..], &["--hdr"]].concat()));

/// Linear toys whose colours are changed, one straight value at a time.
fn recolored(name: &str, change: impl Fn(f32) -> f32) -> PathBuf {
    let dataset = copy(&LINEAR, name);
    for photo in all_images(&dataset, "exr") {
        let of_pixel = |[r, g, b, alpha]: [f32; 4]| {
            let [r, g, b] = [r, g, b].map(|value| alpha * change(value / alpha.max(f32::MIN_POSITIVE)));
            [r, g, b, alpha]
        };
        let pixels: Vec<_> = linear(&photo).into_iter().map(of_pixel).collect();
        write_linear(&photo, &pixels);
    }
    dataset
}

/// Toys in a light so strong that much of them is brighter than white.
static BRIGHTENED: LazyLock<PathBuf> = LazyLock::new(|| recolored("brightened", |value| 4.0 * value));

/// Those in Radiance's format, which has no alpha.
fn radiance() -> PathBuf {
    let dataset = copy(&BRIGHTENED, "radiance");
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
    /// Median relative errors of opaque values above [`BRIGHT`] and below [`DARK`].
    bright: f32,
    dark: f32,
    /// Of the values above [`BRIGHT`], the share that is rendered above it.
    rendered_bright: f64,
    /// Mean squared relative error, in decibels.
    relative_db: f64,
}

/// Beyond what a display shows.
const BRIGHT: f32 = 1.0;
/// In the shade.
const DARK: f32 = 0.3;

/// Compares renderings of test views with the photos of `truth`, whose colours are `1 / factor` of those trained on.
fn errors(run: &Path, dataset: &Path, truth: &Path, factor: f32) -> Errors {
    let (mut bright, mut dark, mut squares, mut above) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for view in rendered(run, dataset) {
        let photo = linear(&truth.join(format!("test/{}.exr", stem(&view))));
        for (ours, &[r, g, b, photo_alpha]) in linear(&view).iter().zip(&photo) {
            for (value, wanted) in ours.iter().map(|value| value / factor).zip([r, g, b]) {
                let both = 0.5 * (value * value + wanted * wanted) + 0.01;
                squares.push(f64::from((value - wanted).powi(2) / both));
                let error = (value - wanted).abs() / wanted;
                if photo_alpha < 0.999 {
                    continue;
                }
                if wanted > BRIGHT {
                    bright.push(error);
                    above += usize::from(value > BRIGHT);
                } else if wanted < DARK {
                    dark.push(error);
                }
            }
        }
    }
    let errors = Errors {
        rendered_bright: above as f64 / bright.len() as f64,
        bright: median(bright),
        dark: median(dark),
        relative_db: -10.0 * (squares.iter().sum::<f64>() / squares.len() as f64).log10(),
    };
    println!("{}: {errors:?}", text(run));
    errors
}

fn median(mut values: Vec<f32>) -> f32 {
    assert!(values.len() > 30, "{} values", values.len());
    values.sort_by(f32::total_cmp);
    values[values.len() / 2]
}

#[test]
fn linear_light_is_learnt_from_dark_to_bright() {
    let radiance = radiance();
    for (name, dataset) in [("open_exr", &*BRIGHTENED), ("radiance", &radiance)] {
        let run = place(&format!("{name}_run"));
        train(dataset, &run, &["--no-eval", "--steps", "600"]);
        let metadata = checkpoint(&run).metadata;
        assert!(metadata.features.hdr && metadata.features.alpha == (name == "open_exr"));
        let errors = errors(&run, dataset, &BRIGHTENED, 1.0);
        // A field that ends at white renders nothing brighter; one that learns squared errors, no shades. Without
        // alpha, what is black behind the toys makes their shades harder to learn.
        let [rendered_bright, bright, dark] =
            if metadata.features.alpha { [0.7, 0.35, 0.6] } else { [0.3, 0.7, 2.0] };
        assert!(errors.rendered_bright > f64::from(rendered_bright), "{errors:?}");
        assert!(errors.bright < bright && errors.dark < dark, "{errors:?}");
    }
}

#[test]
fn a_linear_scene_has_no_brightness_of_its_own() {
    let [plain, bright, dark] = [1.0, 1e3, 1e-3].map(|factor| {
        let name = format!("times_{factor}");
        let (dataset, run) = (recolored(&name, |value| factor * value), place(&format!("{name}_run")));
        train(&dataset, &run, &[&STEPS[..], &["--no-eval"]].concat());
        errors(&run, &dataset, &LINEAR, factor).relative_db
    });
    assert!((plain - bright).abs() < 0.7 && (plain - dark).abs() < 0.7, "{plain} {bright} {dark}");
}

#[test]
fn linear_and_display_referred_photos_do_not_mix() {
    let dataset = copy(&LINEAR, "both");
    fs::copy(TOYS.join("train/0003.png"), dataset.join("train/0003.exr")).expect("copied");
    let (success, said) = remarks(&dataset, &place("both_run"), &STEPS);
    assert!(!success && said.contains("0003.exr; convert one kind"), "{said}");
}
