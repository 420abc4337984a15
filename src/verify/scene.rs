//! The analytic scenes of `nerf generate`: exact ground truth by closed-form ray intersections.
//!
//! World space is z-up. Each pixel averages a fixed pattern of sub-rays: for HDR and depth files the
//! premultiplied colour in linear light, for 8-bit files the premultiplied *sRGB-encoded* colour, because a
//! field trained on 8-bit images composites there, and its ground truth has to be formed as it forms its
//! images. The same options always give the same bytes.

mod courtyard;
mod files;
mod fog;
mod picture;
mod rig;
mod shape;
mod texture;
mod toys;
mod world;

use crate::camera::LensKind;
use crate::photo::color_space::srgb_from_linear;
use crate::support::interrupt::Interrupt;
use anyhow::{Result, bail};
use fog::Fog;
use glam::{DVec3, dvec3};
use std::path::Path;
use world::World;

/// A scene's name and what it shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneInfo {
    /// What the command line takes.
    pub name: &'static str,
    /// One line for `--list`.
    pub description: &'static str,
}

const TOYS: SceneInfo = SceneInfo {
    name: "toys",
    description: "bounded solids with alpha: textures, thin rods, hard shadows and a glossy ball",
};
const COURTYARD: SceneInfo = SceneInfo {
    name: "courtyard",
    description: "an opaque handheld capture among columns and walls under a sky",
};
const FOG: SceneInfo = SceneInfo {
    name: "fog",
    description: "a homogeneous half-transparent ball with a colour gradient, for numerical checks",
};

/// The scenes there are.
pub fn names() -> &'static [SceneInfo] {
    &[TOYS, COURTYARD, FOG]
}

/// An analytic scene.
#[derive(Clone, Debug)]
pub struct Scene {
    info: SceneInfo,
    content: Content,
}

#[derive(Clone, Debug)]
enum Content {
    World(World),
    Fog(Fog),
}

/// What a ray sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Scene-linear colour, not multiplied by `alpha`.
    pub color_linear: [f64; 3],
    /// Display-referred colour in `[0, 1]`, not multiplied by `alpha`: of a surface the encoded
    /// `color_linear`, of fog the mean of the encoded colours along the ray.
    pub color_srgb: [f64; 3],
    /// Opacity in `[0, 1]`.
    pub alpha: f64,
    /// Mean distance from the origin of the light that arrives, in world units; infinite where `alpha` is 0.
    pub t: f64,
}

impl Hit {
    /// Nothing.
    pub const MISS: Self =
        Self { color_linear: [0.0; 3], color_srgb: [0.0; 3], alpha: 0.0, t: f64::INFINITY };

    fn opaque(color: DVec3, t: f64) -> Self {
        Self { color_linear: color.to_array(), color_srgb: encode(color).to_array(), alpha: 1.0, t }
    }
}

/// A linear colour clamped to `[0, 1]` and encoded for display.
fn encode(color: DVec3) -> DVec3 {
    let channel = |value: f64| f64::from(srgb_from_linear(value.clamp(0.0, 1.0) as f32));
    dvec3(channel(color.x), channel(color.y), channel(color.z))
}

impl Scene {
    /// The scene of that name.
    ///
    /// # Errors
    /// If there is none; the message lists the names.
    pub fn named(name: &str) -> Result<Self> {
        let Some(&info) = names().iter().find(|info| info.name == name) else {
            let known: Vec<&str> = names().iter().map(|info| info.name).collect();
            bail!("no scene is called `{name}`; the scenes are {}", known.join(", "));
        };
        let content = match info {
            TOYS => Content::World(toys::world()),
            COURTYARD => Content::World(courtyard::world()),
            _ => Content::Fog(Fog {
                radius: 1.0,
                density: 1.5,
                colors: [dvec3(0.85, 0.30, 0.05), dvec3(0.08, 0.35, 0.80)],
                axis: dvec3(0.48, 0.36, 0.8),
            }),
        };
        Ok(Self { info, content })
    }

    /// The scene's name and description.
    pub fn info(&self) -> SceneInfo {
        self.info
    }

    /// Whether the scene has a background everywhere, rather than alpha.
    pub fn is_opaque(&self) -> bool {
        self.info == COURTYARD
    }

    /// What the ray from `origin` along `direction` (of any length but 0) sees.
    pub fn trace(&self, origin: DVec3, direction: DVec3) -> Hit {
        let Some(direction) = direction.try_normalize() else {
            return Hit::MISS;
        };
        match &self.content {
            Content::World(world) => world.trace(origin, direction),
            Content::Fog(fog) => fog.trace(origin, direction),
        }
    }
}

/// Numbers of views per split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ViewCounts {
    /// Views to train on.
    pub train: usize,
    /// Views to choose settings by.
    pub val: usize,
    /// Views to measure with.
    pub test: usize,
}

impl ViewCounts {
    /// `total` views: an eighth to test, a sixteenth to validate (at least one each), the rest to train.
    ///
    /// # Errors
    /// If there are fewer than three.
    pub fn of_total(total: usize) -> Result<Self> {
        if total < 3 {
            bail!("{total} views cannot be split into train, val and test; ask for at least 3");
        }
        let (val, test) = ((total / 16).max(1), (total / 8).max(1));
        Ok(Self { train: total - val - test, val, test })
    }

    /// The number of views in all splits.
    pub fn total(&self) -> usize {
        self.train + self.val + self.test
    }
}

/// What to generate.
#[derive(Clone, Debug)]
pub struct SceneOptions {
    /// Name of the scene.
    pub scene: String,
    /// Views per split.
    pub views: ViewCounts,
    /// Width and height of the images, in pixels.
    pub size: (u32, u32),
    /// Linear EXR with values above 1, instead of 8-bit PNG.
    pub hdr: bool,
    /// The lenses of the cameras, taken in turn; at least one.
    pub lenses: Vec<LensKind>,
    /// Sub-rays per pixel along each axis.
    pub samples: u32,
    /// Varies the camera positions.
    pub seed: u64,
    /// Asked before each view; where it was raised, nothing stays of the dataset.
    pub interrupt: Interrupt,
}

impl SceneOptions {
    /// `scene` with 100 views of 200×200 pixels and 4×4 sub-rays.
    pub fn new(scene: &str) -> Self {
        let views = ViewCounts { train: 82, val: 6, test: 12 };
        let (scene, lenses) = (scene.to_owned(), vec![LensKind::Pinhole]);
        let interrupt = Interrupt::default();
        Self { scene, views, size: (200, 200), hdr: false, lenses, samples: 4, seed: 0, interrupt }
    }

    fn check(&self) -> Result<()> {
        let (width, height) = self.size;
        if !(1..=16_384).contains(&width) || !(1..=16_384).contains(&height) {
            bail!("images of {width}x{height} pixels; each side must be within 1..=16384");
        }
        if !(1..=64).contains(&self.samples) {
            bail!("{0}x{0} samples per pixel; the number must be within 1..=64", self.samples);
        }
        if self.views.train == 0 {
            bail!("no views to train on; ask for at least one");
        }
        if self.lenses.is_empty() {
            bail!("no lens to look through; name at least one");
        }
        Ok(())
    }
}

/// What was generated.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Summary {
    /// Name of the scene.
    pub scene: &'static str,
    /// Views in all splits.
    pub views: usize,
    /// Files written.
    pub files: usize,
}

/// Renders the views of a scene into the folder `out`, which must not exist or be empty, as a dataset:
/// `transforms_{train,val,test}.json` (last), and per view an image and an EXR with colour, A and Z.
///
/// `progress` is called after each view, from any thread, with the number of views done so far.
///
/// # Errors
/// If the options do not fit the scene, the folder is in use, a file cannot be written, or the interrupt was raised. Of a
/// dataset that was begun nothing stays then.
pub fn generate(options: &SceneOptions, out: &Path, progress: &(dyn Fn(usize) + Sync)) -> Result<Summary> {
    let scene = Scene::named(&options.scene)?;
    options.check()?;
    files::write(&scene, options, out, progress)
}
