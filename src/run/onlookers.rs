//! How many cameras have a place in their picture: what hangs right before one camera is seen by few others.

use crate::camera::Camera;
use crate::capture::dataset::{Dataset, evenly_spaced};
use glam::DVec3;

/// So many cameras are asked, evenly spaced among all.
const ASKED: usize = 64;

/// A place has few onlookers if fewer than this share of those that have the focus in their picture see it.
const FEW: f64 = 0.125;

/// What is farther away than so many times the focus is behind what a camera looks at.
const REACH: f64 = 1.5;

/// The cameras of a dataset around their focus.
#[derive(Clone, Debug)]
pub struct Onlookers {
    focus: DVec3,
    cameras: Vec<Camera>,
    /// So many cameras are no longer few.
    enough: usize,
}

impl Onlookers {
    /// Those of a dataset, of which 64 are asked at most; `None` where the optical axes do not cross in one point.
    #[must_use]
    pub fn of(dataset: &Dataset) -> Option<Self> {
        let cameras: Vec<_> =
            dataset.distinct_images().into_iter().map(|index| dataset.frames[index].camera.clone()).collect();
        Some(Self::around(dataset.focus()?, &cameras))
    }

    /// `cameras` that look at `focus`, in world space.
    #[must_use]
    pub fn around(focus: DVec3, cameras: &[Camera]) -> Self {
        let numbers: Vec<usize> = (0..cameras.len()).collect();
        let asked = evenly_spaced(&numbers, ASKED).into_iter().map(|number| cameras[number].clone());
        let mut onlookers = Self { focus, cameras: asked.collect(), enough: 0 };
        let around = onlookers.cameras.iter().filter(|camera| camera.has_in_picture(focus)).count();
        // Its own camera says nothing for a place, where there are others.
        onlookers.enough = ((FEW * around as f64).ceil() as usize).max(2).min(around);
        onlookers
    }

    /// From a camera to the focus, in world units.
    #[must_use]
    pub fn distance(&self, camera: &Camera) -> f64 {
        camera.position().distance(self.focus)
    }

    /// Whether fewer cameras look at a place than an eighth of those that have the focus in their picture, or only one:
    /// they have it there too, and no farther away than 1.5 times the focus, since cameras on the other side look at
    /// what is in between. What is in between otherwise is not asked for.
    #[must_use]
    pub fn are_few(&self, place: DVec3) -> bool {
        let looks = |camera: &&Camera| {
            let is_in_reach = camera.position().distance(place) <= REACH * self.distance(camera);
            is_in_reach && camera.has_in_picture(place)
        };
        self.cameras.iter().filter(looks).take(self.enough).count() < self.enough
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Lens;
    use glam::{DAffine3, DVec2};

    /// `count` cameras on a circle of radius 4 in the plane y = 0 that look at its middle, 100 pixels wide, 53 degrees.
    fn circle(count: usize) -> Vec<Camera> {
        let pose = |number: usize| {
            let angle = std::f64::consts::TAU * number as f64 / count as f64;
            DAffine3::from_rotation_y(angle) * DAffine3::from_translation(DVec3::new(0.0, 0.0, 4.0))
        };
        let camera = |number| Camera {
            world_from_camera: pose(number),
            focal_px: DVec2::splat(100.0),
            center_px: DVec2::splat(50.0),
            width: 100,
            height: 100,
            lens: Lens::Pinhole,
        };
        (0..count).map(camera).collect()
    }

    #[test]
    fn what_hangs_before_one_camera_has_few_onlookers() {
        for count in [4, 8, 12, 1000] {
            let cameras = circle(count);
            let onlookers = Onlookers::around(DVec3::ZERO, &cameras);
            assert!((onlookers.distance(&cameras[3]) - 4.0).abs() < 1e-12);
            assert!(!onlookers.are_few(DVec3::ZERO));
            // A table that all look down on reaches far towards the cameras; the other half still sees its rim.
            assert!(!onlookers.are_few(DVec3::new(1.5, 0.0, 0.0)));
            assert!(onlookers.are_few(cameras[0].position() * 0.9), "a tenth of the way from a camera");
            assert!(onlookers.are_few(DVec3::new(0.0, 50.0, 0.0)), "nobody looks there");
        }
    }

    /// As many as there are of a training run on few photos, which are the ones that end in fog.
    #[test]
    fn of_few_cameras_one_is_few() {
        let cameras = circle(5);
        let onlookers = Onlookers::around(DVec3::ZERO, &cameras);
        assert!(cameras.iter().all(|camera| onlookers.are_few(camera.position() * 0.9)));
    }

    #[test]
    fn a_single_camera_is_enough_where_there_is_no_other() {
        let one = circle(1);
        let onlookers = Onlookers::around(DVec3::ZERO, &one);
        assert!(!onlookers.are_few(one[0].position() * 0.9));
        let nobody = Onlookers::around(DVec3::ZERO, &[]);
        assert!(!nobody.are_few(DVec3::ZERO), "an eighth of none is none");
    }
}
