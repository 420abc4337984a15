//! What a scene needs of the kernels.

use anyhow::{Result, ensure};
use nerf::camera::LensKind;
use nerf::capture::dataset::{Dataset, Frame, evenly_spaced};
use nerf::config::Config;
use nerf::field::Needs;
use nerf::photo::{BitDepth, Image};

/// Photos that tell how bright a linear scene is.
const PHOTOS_FOR_GREY: usize = 8;

/// What training on `dataset` needs.
///
/// # Errors
/// When photos cannot be read, or are no use to what `config` asks for.
pub(in crate::commands) fn of(dataset: &Dataset, config: &Config) -> Result<Needs> {
    Ok(Needs { grey: grey(dataset)?, ..of_headers(dataset, config)? })
}

/// As [`of`], without looking at photos: their brightness is taken for 1.
///
/// # Errors
/// When `config` asks for what the photos do not have.
pub(in crate::commands) fn of_headers(dataset: &Dataset, config: &Config) -> Result<Needs> {
    let used = dataset.train.iter().chain(&dataset.test);
    let needs = Needs {
        lenses: LensKind::among(used.map(|&index| &dataset.frames[index].camera)),
        hdr: dataset.is_hdr,
        grey: 1.0,
        ..Needs::default()
    };
    for_photos(needs, dataset, &dataset.train, config)
}

/// `needs` with what a record of a photo's pixel must hold, which may differ from one run of a training to the next:
/// somebody may have added masks, alpha or depth.
///
/// # Errors
/// When depth is asked for and not there.
pub(in crate::commands) fn for_photos(
    needs: Needs,
    dataset: &Dataset,
    train: &[usize],
    config: &Config,
) -> Result<Needs> {
    let any = |condition: fn(&Frame) -> bool| train.iter().any(|&index| condition(&dataset.frames[index]));
    let has_depth = any(|frame| frame.has_depth);
    ensure!(
        has_depth || config.loss.depth == 0.0,
        "loss.depth is {}, and no training frame has a depth file; name them by `depth_file_path`, or set it to 0",
        config.loss.depth
    );
    Ok(Needs {
        alpha: any(|frame| frame.has_alpha),
        deep: dataset.bit_depth == BitDepth::Sixteen,
        masks: any(|frame| frame.has_mask),
        depth: has_depth && config.loss.depth > 0.0,
        ..needs
    })
}

/// Brightness of a typical pixel of linear photos, which the field then takes for 1; 1 for others.
fn grey(dataset: &Dataset) -> Result<f32> {
    if !dataset.is_hdr {
        return Ok(1.0);
    }
    let few = evenly_spaced(&dataset.train, PHOTOS_FOR_GREY);
    let mut logs = Vec::with_capacity(few.len());
    dataset.stream(&few, false, &mut |_, photo| {
        logs.extend(Image::grey(&photo.image).map(f64::ln));
        Ok(())
    })?;
    let grey = (logs.iter().sum::<f64>() / logs.len().max(1) as f64).exp() as f32;
    ensure!(grey.is_normal(), "the photos are as dark or as bright as {grey:e}; scale them to about 1");
    Ok(grey)
}
