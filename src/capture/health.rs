//! What is healthy or wrong about a dataset, seen from its cameras and pixels before anything is trained.
//!
//! [`Survey`] looks at cameras and scene box, [`gallery::Look`] at one photo and [`gallery::Gallery`] at all of them,
//! and [`map`] draws the cameras. Every [`Diagnostic`] says what is wrong, how it was seen, and what to do.

mod axis_convention;
mod coverage;
pub mod depth;
pub mod gallery;
pub mod map;
mod optics;
pub mod parallax;
mod poses;
mod roll;
mod spread;
mod view_directions;

use crate::capture::diagnostics::{Diagnostic, Severity};
pub use coverage::Coverage;
pub use optics::Optics;
pub use spread::Spread;
pub use view_directions::{Arrangement, ViewDirections};

use crate::camera::Camera;
use crate::capture::dataset::Dataset;
use crate::capture::focus::{Focus, OpticalAxis, find};
use gallery::Gallery;
use glam::DVec3;

/// What the cameras of a dataset show.
#[derive(Clone, Debug)]
pub struct Survey {
    /// Indices of the frames that were looked at: one per image, where several splits list it.
    pub views: Vec<usize>,
    /// Where the cameras look.
    pub directions: ViewDirections,
    /// How much of the scene box they see.
    pub coverage: Coverage,
    /// Focal lengths, sizes and lenses.
    pub optics: Optics,
    /// Pairs of frames with different images and the same pose.
    pub same_pose: Vec<[usize; 2]>,
    /// What looks wrong, worst first.
    pub findings: Vec<Diagnostic>,
}

impl Survey {
    /// Looks at all frames of a dataset, of which there is at least one.
    #[must_use]
    pub fn of(dataset: &Dataset) -> Self {
        let scene = CameraSet::new(dataset);
        let directions = ViewDirections::of(&scene);
        let coverage = Coverage::of(&scene);
        let optics = Optics::of(&scene);
        let misread = axis_convention::examine(&scene, &directions);
        let mut findings = directions.findings(&scene);
        // Where all poses are read the wrong way, single ones tell nothing.
        if misread.as_ref().is_none_or(|finding| finding.severity > Severity::Warning) {
            findings.extend(poses::outliers(&scene, &directions));
            findings.extend(coverage.findings(&scene));
        }
        findings.extend(misread);
        findings.extend(optics.findings(&scene));
        findings.sort_by_key(|finding| finding.severity);
        let same_pose = poses::repeated(&scene);
        Self { views: scene.views, directions, coverage, optics, same_pose, findings }
    }

    /// What stands out among the photos, of those that were looked at.
    #[must_use]
    pub fn findings_with(&self, gallery: Option<&Gallery>, dataset: &Dataset) -> Vec<Diagnostic> {
        let Some(gallery) = gallery else {
            return poses::about_repeated(dataset, &self.same_pose, None).into_iter().collect();
        };
        let (differing, alike) =
            self.same_pose.iter().partition::<Vec<[usize; 2]>, _>(|&&pair| gallery.differ(pair));
        let mut findings = gallery.findings(dataset);
        findings.extend(poses::about_repeated(dataset, &differing, Some(true)));
        findings.extend(poses::about_repeated(dataset, &alike, Some(false)));
        findings
    }
}

/// The dataset as its examinations see it.
struct CameraSet<'a> {
    dataset: &'a Dataset,
    /// Indices of the frames, each image once.
    views: Vec<usize>,
    /// One per view.
    axes: Vec<OpticalAxis>,
    focus: Focus,
}

impl<'a> CameraSet<'a> {
    fn new(dataset: &'a Dataset) -> Self {
        let views = dataset.distinct_images();
        let axes: Vec<OpticalAxis> =
            views.iter().map(|&index| OpticalAxis::of(&dataset.frames[index].camera)).collect();
        let focus = find(&axes);
        Self { dataset, views, axes, focus }
    }

    fn cameras(&self) -> impl Iterator<Item = &'a Camera> {
        self.views.iter().map(|&index| &self.dataset.frames[index].camera)
    }

    fn count(&self) -> usize {
        self.views.len()
    }

    /// Largest distance of a camera from the middle of all, in world units.
    fn extent(&self) -> f64 {
        let mean = self.axes.iter().map(|axis| axis.origin).sum::<DVec3>() / self.count() as f64;
        self.axes.iter().map(|axis| axis.origin.distance(mean)).fold(0.0, f64::max)
    }

    /// Whether all cameras are at one place, but for what single precision cannot tell.
    fn is_one_place(&self) -> bool {
        self.extent() <= 3e-7 * self.focus.point.length().max(1e-2)
    }

    /// The views for which something holds.
    fn which(&self, holds: impl Fn(usize) -> bool) -> Vec<usize> {
        (0..self.count()).filter(|&view| holds(view)).map(|view| self.views[view]).collect()
    }

    /// The names of frames, the first few of many.
    fn names(&self, frames: &[usize]) -> String {
        names(self.dataset, frames)
    }
}

/// `a.png, b.png, c.png and 4 more`.
fn names(dataset: &Dataset, frames: &[usize]) -> String {
    const MOST: usize = 3;
    let shown = if frames.len() == MOST + 1 { MOST + 1 } else { MOST };
    let named: Vec<_> = frames.iter().take(shown).map(|&index| dataset.frames[index].name.as_str()).collect();
    match frames.len().saturating_sub(shown) {
        0 => named.join(", "),
        more => format!("{} and {more} more", named.join(", ")),
    }
}
