//! The slots whose variant follows from the scene, the settings or the adapter: each variant with its condition, and what
//! is said where it is left out. Slots that are not here (`extent`, `packing`, …) are chosen by each kernel.

use super::Plan;
use crate::config::{Accumulation, Background, Transmittance};

/// A folder of `shaders/`.
pub(super) struct Slot {
    pub(super) name: &'static str,
    /// The first that suits is linked.
    pub(super) variants: &'static [Variant],
}

/// A file in it.
pub(super) struct Variant {
    pub(super) name: &'static str,
    pub(super) suits: fn(&Plan) -> bool,
    /// What a scene does without where it is not linked, and why, if that is worth saying.
    pub(super) left_out: Option<(&'static str, Reason)>,
}

/// Why a variant is not linked; `None` where that is not worth saying.
type Reason = fn(&Plan) -> Option<&'static str>;

const fn when(name: &'static str, suits: fn(&Plan) -> bool) -> Variant {
    Variant { name, suits, left_out: None }
}

const fn otherwise(name: &'static str) -> Variant {
    when(name, |_| true)
}

const fn told(variant: Variant, what: &'static str, reason: Reason) -> Variant {
    Variant { left_out: Some((what, reason)), ..variant }
}

const fn slot(name: &'static str, variants: &'static [Variant]) -> Slot {
    Slot { name, variants }
}

fn has_depth(plan: &Plan) -> bool {
    plan.features.depth
}

pub(super) static SLOTS: &[Slot] = &[
    slot(
        "space",
        &[
            told(when("cascades", |plan| !plan.space.is_bounded()), "cascades and growing steps", |_| {
                Some("the scene is bounded")
            }),
            otherwise("cube"),
        ],
    ),
    slot(
        "pixels",
        &[
            told(when("linear", |plan| plan.features.hdr), "linear pixels", |_| {
                Some("the images are display-referred")
            }),
            told(when("srgb16", |plan| plan.features.deep), "16-bit pixels", |_| Some("no image has them")),
            told(when("srgb8", |plan| plan.features.alpha), "alpha", |plan| {
                (!plan.features.alpha && !plan.features.hdr).then_some("the images are opaque")
            }),
            told(otherwise("srgb8_opaque"), "8-bit pixels", |plan| {
                (plan.features.hdr || plan.features.deep).then_some("not all images have them")
            }),
        ],
    ),
    slot(
        "position",
        &[
            told(when("listed", |plan| plan.features.masks), "masks", |_| Some("there are none")),
            otherwise("all"),
        ],
    ),
    slot("depth_target", &[when("stored", has_depth), otherwise("none")]),
    slot(
        "depth_loss",
        &[told(when("squared", has_depth), "depth", |_| Some("loss.depth is 0")), otherwise("none")],
    ),
    slot("distance", &[when("along", Plan::needs_distances), otherwise("none")]),
    slot(
        "distortion",
        &[
            told(when("pairs", |plan| plan.config.loss.distortion > 0.0), "the distortion loss", |_| {
                Some("loss.distortion is 0")
            }),
            otherwise("none"),
        ],
    ),
    slot(
        "sparsity",
        &[
            told(when("logarithm", |plan| plan.config.loss.sparsity > 0.0), "the sparsity loss", |_| {
                Some("loss.sparsity is 0")
            }),
            otherwise("none"),
        ],
    ),
    slot(
        "loss",
        &[
            told(when("relative", Plan::has_relative_loss), "the relative loss", |plan| {
                Some(if plan.features.hdr {
                    "loss.color is squared"
                } else {
                    "the images are display-referred"
                })
            }),
            otherwise("squared"),
        ],
    ),
    slot(
        "background",
        &[
            told(
                when("random", |plan| plan.config.background == Background::Random),
                "random backgrounds",
                |_| Some("not asked for"),
            ),
            otherwise("solid"),
        ],
    ),
    slot("activation", &[when("exponential", |plan| plan.features.hdr), otherwise("sigmoid")]),
    slot(
        "transmittance",
        &[
            when("inclusive", |plan| plan.config.transmittance == Transmittance::Inclusive),
            otherwise("exclusive"),
        ],
    ),
    slot(
        "gradient_add",
        &[
            when("fixed", |plan| plan.accumulation == Accumulation::Fixed),
            when("float", |plan| plan.accumulation == Accumulation::Float),
            when("exchange", |plan| plan.accumulation == Accumulation::Exchange),
            otherwise("ordered"),
        ],
    ),
    slot(
        "gradient_take",
        &[
            when("fixed", |plan| plan.accumulation == Accumulation::Fixed),
            when("ordered", |plan| matches!(plan.accumulation, Accumulation::Auto | Accumulation::Ordered)),
            otherwise("float"),
        ],
    ),
    slot("counted", &[otherwise("read")]),
];
