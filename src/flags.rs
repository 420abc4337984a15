//! The library's advice in terms of command-line flags.

use anyhow::Error;
use nerf::support::remedy::{Advised, Remedy};

/// An error with its causes, and advice in terms of flags.
pub(crate) fn with_flags(error: &Error) -> String {
    let text = format!("{error:#}");
    match error.downcast_ref::<Advised>() {
        Some(advised) => text.replace(&advised.to_string(), &advised.with(&advice(&advised.remedy))),
        None => text,
    }
}

/// A message whose remedy is given as flags instead of plain words.
pub(crate) fn message_with_flags(message: &str, remedy: Option<&Remedy>) -> String {
    match remedy {
        Some(remedy) => message.replace(&remedy.to_string(), &advice(remedy)),
        None => message.to_owned(),
    }
}

fn advice(remedy: &Remedy) -> String {
    match remedy {
        Remedy::HalveOrThinOut { most_images } => {
            format!("use --downscale 2 or --max-images {most_images}")
        }
        Remedy::FewerPixels => {
            "use --downscale 2, --crop or --max-images N to train on fewer pixels".to_owned()
        }
        Remedy::FittingPixels { downscale, percent } => format!(
            "use --downscale {downscale}, or --max-images or --crop to leave {percent} % of the pixels"
        ),
        Remedy::SmallerField => remedy.to_string(),
        Remedy::RelieveDevice => {
            "try again, a training with --resume; should it happen again, close what else uses the \
             adapter, train with less (--downscale 2, --max-images N, a smaller --set batch.kept=N or \
             grid.log2_table=N), or choose another --adapter"
                .to_owned()
        }
        Remedy::OrOvercommit(less) => {
            format!("{}, or add --overcommit to train all the same", advice(less))
        }
        Remedy::Downscale(by) => format!("--downscale {by}"),
        Remedy::InvertMasks => "try --invert-masks".to_owned(),
        Remedy::LeaveMasks => "leave out --invert-masks".to_owned(),
        Remedy::StraightAlpha => "use --alpha straight".to_owned(),
        Remedy::Adapter => "--adapter".to_owned(),
        Remedy::Setting => "--set".to_owned(),
        Remedy::StepsAlone => "--steps N and no --seconds".to_owned(),
        Remedy::SameField => {
            "on --resume; leave those settings out, or start anew with --overwrite".to_owned()
        }
        Remedy::SameReading { setting, then, now } => {
            let flag = format!("--{}", setting.replace('_', "-"));
            format!(
                "the run began with {flag} {then}, and now it is {now}; leave {flag} out on --resume, or start \
                 anew with --overwrite"
            )
        }
        Remedy::SameDataset { dataset } => format!(
            "--resume with the dataset that it began with, {dataset}, as it was then, or start anew with --overwrite"
        ),
        Remedy::UsedFolder => {
            "name another one, or add --resume to go on with the run in it, or --overwrite to replace it"
                .to_owned()
        }
        Remedy::RunFolder => "the folder that `nerf train --out` wrote".to_owned(),
        Remedy::FindPoses { photos } => format!(
            "run `ns-process-data images --data {photos} --output-dir OUT` (nerfstudio), or `colmap2nerf.py --images \
             {photos} --run_colmap` (instant-ngp), then `nerf train OUT`"
        ),
        Remedy::FindPosesOfVideo { video } => format!(
            "run `ns-process-data video --data {video} --output-dir OUT` (nerfstudio), or `colmap2nerf.py --video_in \
             {video} --run_colmap` (instant-ngp), then `nerf train OUT`"
        ),
        Remedy::ConvertColmap { model } => format!(
            "run `ns-process-data images --skip-colmap --colmap-model-path {model} --data IMAGES --output-dir OUT` \
             (nerfstudio; its path counts from OUT), or `colmap model_converter --input_path {model} --output_path \
             {model} --output_type TXT` and `colmap2nerf.py --images IMAGES --text {model}` (instant-ngp), then `nerf \
             train OUT`"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::{Context, anyhow};

    #[test]
    fn errors_tell_flags_wherever_the_advice_is_among_their_causes() {
        let advised = || Advised::new("", Remedy::Downscale(3), " leaves nothing");
        let root = Error::from(advised()).context("frame 2").context("opening");
        assert_eq!(with_flags(&root), "opening: frame 2: --downscale 3 leaves nothing");
        let middle = Err::<(), _>(anyhow!("no such key"))
            .context(Advised::new("in ", Remedy::Setting, " a=1"))
            .context("configuring");
        assert_eq!(with_flags(&middle.expect_err("failed")), "configuring: in --set a=1: no such key");
        assert_eq!(with_flags(&anyhow!("plain")), "plain");
    }

    #[test]
    fn messages_tell_flags() {
        let message = Advised::new("inverted? ", Remedy::InvertMasks, "").to_string();
        assert_eq!(message_with_flags(&message, Some(&Remedy::InvertMasks)), "inverted? try --invert-masks");
        assert_eq!(message_with_flags("plain", None), "plain");
        let now = Remedy::SameReading { setting: "max_images", then: "all".into(), now: "7".into() };
        assert!(
            advice(&now).contains("began with --max-images all, and now it is 7; leave --max-images out")
        );
    }
}
