//! The slots of the shaders: which variants there are, what chooses one, and what is said where one is left out. What is
//! linked, the line "left out" and the table in `shaders/README.md` follow from this.

use super::Plan;
use crate::config::{Accumulation, Background, Transmittance};

/// A folder of `shaders/`.
pub(super) struct Slot {
    pub(super) name: &'static str,
    /// What its variant follows from, in words.
    pub(super) chosen_by: &'static str,
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

const fn slot(name: &'static str, chosen_by: &'static str, variants: &'static [Variant]) -> Slot {
    Slot { name, chosen_by, variants }
}

fn has_depth(plan: &Plan) -> bool {
    plan.features.depth
}

pub(super) static SLOTS: &[Slot] = &[
    slot(
        "space",
        "one cube, or several",
        &[
            told(when("cascades", |plan| !plan.space.is_bounded()), "cascades and growing steps", |_| {
                Some("the scene is bounded")
            }),
            otherwise("cube"),
        ],
    ),
    slot(
        "pixels",
        "images of 8 bits with or without alpha, of 16 bits, or linear ones",
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
        "masks: with them, pixels that count are listed",
        &[
            told(when("listed", |plan| plan.features.masks), "masks", |_| Some("there are none")),
            otherwise("all"),
        ],
    ),
    slot(
        "depth_target",
        "depth images, and `loss.depth` above 0",
        &[when("stored", has_depth), otherwise("none")],
    ),
    slot(
        "depth_loss",
        "depth images, and `loss.depth` above 0",
        &[told(when("squared", has_depth), "depth", |_| Some("loss.depth is 0")), otherwise("none")],
    ),
    slot(
        "distance",
        "depth or distortion in the loss; of a view, what its lens calls depth",
        &[when("along", Plan::needs_distances), otherwise("none")],
    ),
    slot(
        "distortion",
        "`loss.distortion` above 0",
        &[
            told(when("pairs", |plan| plan.config.loss.distortion > 0.0), "the distortion loss", |_| {
                Some("loss.distortion is 0")
            }),
            otherwise("none"),
        ],
    ),
    slot(
        "sparsity",
        "`loss.sparsity` above 0",
        &[
            told(when("logarithm", |plan| plan.config.loss.sparsity > 0.0), "the sparsity loss", |_| {
                Some("loss.sparsity is 0")
            }),
            otherwise("none"),
        ],
    ),
    slot(
        "loss",
        "`loss.color`; relative for linear images",
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
        "`background`",
        &[
            told(
                when("random", |plan| plan.config.background == Background::Random),
                "random backgrounds",
                |_| Some("not asked for"),
            ),
            otherwise("solid"),
        ],
    ),
    slot(
        "activation",
        "linear images",
        &[when("exponential", |plan| plan.features.hdr), otherwise("sigmoid")],
    ),
    slot(
        "transmittance",
        "`transmittance`",
        &[
            when("inclusive", |plan| plan.config.transmittance == Transmittance::Inclusive),
            otherwise("exclusive"),
        ],
    ),
    slot(
        "gradient_add",
        "`accumulation`, adapter",
        &[
            when("fixed", |plan| plan.accumulation == Accumulation::Fixed),
            when("long", |plan| plan.accumulation == Accumulation::Long),
            when("float", |plan| plan.accumulation == Accumulation::Float),
            otherwise("exchange"),
        ],
    ),
    slot(
        "gradient_take",
        "`accumulation`, adapter",
        &[
            when("fixed", |plan| plan.accumulation.is_of_integers()),
            when("ordered", |plan| matches!(plan.accumulation, Accumulation::Auto | Accumulation::Ordered)),
            otherwise("float"),
        ],
    ),
    slot("counted", "whether a kernel writes the counters", &[otherwise("read")]),
];

/// The slots of which each kernel has its own variant, and what that follows from.
static SLOTS_OF_KERNELS: &[(&str, &str)] = &[
    ("extent", "training, or rendering front to back"),
    ("jitter", "training, or rendering"),
    ("packing", "training, or rendering"),
    ("weights", "training, or a check against the reference"),
    ("scanned", "what a scan packs"),
    ("layer_count", "how many rows a matrix product has"),
    ("layer_store", "where its outputs go"),
    ("layer_gradient", "where the gradients of its outputs come from"),
    ("layer_d_store", "where those of its inputs go"),
];

/// Every slot, with what its variant follows from.
pub fn chosen_by() -> impl Iterator<Item = (&'static str, &'static str)> {
    let of_plans = SLOTS.iter().map(|slot| (slot.name, slot.chosen_by));
    of_plans.chain(SLOTS_OF_KERNELS.iter().copied())
}
