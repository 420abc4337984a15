//! Whether the colour of views piles up at the border of the scene's box, because what they show lies beyond it.

use crate::camera::{Bounds, Camera};
use crate::field::renderer::View;
use glam::DVec2;

/// What is shown farther out than this part of the box is at its border.
const BORDER: f64 = 0.95;
/// Above this share of what is shown, the box is probably too small.
pub(super) const MUCH: f64 = 0.3;
/// Where the box reaches so many times as far as the camera, parallax would hardly tell how much farther things are.
const FAR: f64 = 16.0;

/// The opacity at the border, and all of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct BorderWeight {
    at_border: f64,
    all: f64,
}

impl BorderWeight {
    /// Adds the pixels of a view. A pixel's opacity counts at its mean depth.
    pub(super) fn add(&mut self, view: &View, camera: &Camera, bounds: &Bounds) {
        let reach = bounds.outer_half();
        let out = |place: glam::DVec3| (place - bounds.center).abs().max_element();
        let is_far = reach > FAR * out(camera.position());
        for (pixel, (&z, color)) in view.depth.iter().zip(&view.color).enumerate() {
            let [x, y] = [pixel % view.width as usize, pixel / view.width as usize];
            let place = camera.point(DVec2::new(x as f64 + 0.5, y as f64 + 0.5), f64::from(z));
            let is_there = !is_far && z > 0.0 && place.is_some_and(|place| out(place) > BORDER * reach);
            self.at_border += if is_there { f64::from(color[3]) } else { 0.0 };
            self.all += f64::from(color[3]);
        }
    }

    /// The part of what is shown that is at the border; 0 where nothing is shown.
    pub(super) fn share(&self) -> f64 {
        if self.all > 0.0 { self.at_border / self.all } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Lens;
    use glam::{DAffine3, DVec3};

    #[test]
    fn what_lies_at_the_border_is_counted() {
        let camera = Camera {
            width: 4,
            height: 1,
            focal_px: DVec2::splat(100.0),
            center_px: DVec2::new(2.0, 0.5),
            lens: Lens::Pinhole,
            world_from_camera: DAffine3::from_translation(DVec3::new(0.0, 0.0, 0.5)),
        };
        // It looks along -z, to the border 4.5 away, at two pixels of which one is half transparent.
        let color = [1.0, 0.5, 1.0, 0.0].map(|alpha| [0.0, 0.0, 0.0, alpha]).to_vec();
        let view = View { width: 4, height: 1, color, depth: vec![4.45, 4.4, 2.0, 0.0] };
        let bounds =
            |half| Bounds { center: DVec3::ZERO, half, cascades: 2, source: String::new(), is_guess: true };
        let share = |half| {
            let mut weight = BorderWeight::default();
            weight.add(&view, &camera, &bounds(half));
            weight.share()
        };
        assert_eq!((share(2.0), share(4.0)), (0.6, 0.0));
        assert_eq!(BorderWeight::default().share(), 0.0);
        let far = View { depth: vec![38.5; 4], ..view.clone() };
        let mut weight = BorderWeight::default();
        weight.add(&far, &camera, &bounds(19.5));
        assert_eq!(weight.share(), 0.0, "a box so large is large enough");
    }
}
