//! Several samples per pixel: the mean of views that are shifted by parts of a pixel.

use super::renderer::{Renderer, View};
use crate::camera::Camera;
use anyhow::Result;
use glam::DVec2;

/// Where the opacity of a view is below this, it has no depth.
const LEAST_OPACITY: f32 = 1e-3;

impl Renderer {
    /// Renders what `camera` sees with `samples` in each pixel, stratified: of as many rows and columns of a pixel each has
    /// one. Colour and opacity are means over them, depth is that over what is opaque. One sample is [`Renderer::render`].
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn render_sampled(&mut self, camera: &Camera, samples: u32) -> Result<View> {
        if samples <= 1 {
            return self.render(camera);
        }
        let mut mean: Option<Mean> = None;
        for offset in offsets(samples) {
            let view = self.render(&camera.shifted(offset))?;
            mean.get_or_insert_with(|| Mean::of_none(&view)).add(&view, samples as f32);
        }
        mean.map_or_else(|| self.render(camera), |mean| Ok(mean.view()))
    }
}

/// The mean of views, so far.
struct Mean {
    /// Its depth is a sum over opacities.
    sum: View,
    /// The opacities of what had a depth.
    weights: Vec<f32>,
}

impl Mean {
    fn of_none(like: &View) -> Self {
        let count = like.depth.len();
        let sum = View { color: vec![[0.0; 4]; count], depth: vec![0.0; count], ..*like };
        Self { sum, weights: vec![0.0; count] }
    }

    /// Adds one of `count` views.
    fn add(&mut self, view: &View, count: f32) {
        for (sum, one) in self.sum.color.iter_mut().flatten().zip(view.color.iter().flatten()) {
            *sum += one / count;
        }
        let pixels = self.sum.depth.iter_mut().zip(&mut self.weights).zip(view.depth.iter().zip(&view.color));
        for ((sum, weight), (&depth, &[.., opacity])) in pixels.filter(|(_, (depth, _))| **depth > 0.0) {
            *sum += opacity * depth;
            *weight += opacity;
        }
    }

    fn view(mut self) -> View {
        let pixels = self.sum.depth.iter_mut().zip(&self.weights).zip(&self.sum.color);
        for ((depth, &weight), &[.., opacity]) in pixels {
            *depth = if opacity < LEAST_OPACITY || weight <= 0.0 { 0.0 } else { *depth / weight };
        }
        self.sum
    }
}

/// Where in a pixel so many samples lie, from its centre: Hammersley's points, with ranks for their second coordinates.
fn offsets(count: u32) -> Vec<DVec2> {
    let mut order: Vec<u32> = (0..count).collect();
    order.sort_by_key(|index| index.reverse_bits());
    let place = |number: usize| (number as f64 + 0.5) / f64::from(count) - 0.5;
    order.iter().enumerate().map(|(rank, &index)| DVec2::new(place(index as usize), place(rank))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_stratified_around_the_centre() {
        assert_eq!(offsets(1), [DVec2::ZERO]);
        for count in [2, 3, 4, 9, 16] {
            let all = offsets(count);
            assert!(all.iter().sum::<DVec2>().length() < 1e-12, "{count}");
            for axis in 0..2 {
                let mut strata: Vec<_> =
                    all.iter().map(|at| ((at[axis] + 0.5) * f64::from(count)) as u32).collect();
                strata.sort_unstable();
                assert_eq!(strata, (0..count).collect::<Vec<_>>());
            }
        }
        // A quarter each, of four.
        let quadrants: std::collections::BTreeSet<_> =
            offsets(4).iter().map(|at| (at.x > 0.0, at.y > 0.0)).collect();
        assert_eq!(quadrants.len(), 4);
    }

    #[test]
    fn depth_is_the_mean_of_what_is_opaque() {
        let view = |opacity: f32, depth: f32| View {
            width: 1,
            height: 1,
            color: vec![[opacity, 0.0, 0.0, opacity]],
            depth: vec![depth],
        };
        let mean = |views: &[View]| {
            let mut mean = Mean::of_none(&views[0]);
            views.iter().for_each(|view| mean.add(view, views.len() as f32));
            mean.view()
        };
        assert_eq!(mean(&[view(1.0, 2.0), view(0.0, 0.0)]), view(0.5, 2.0));
        assert_eq!(mean(&[view(0.75, 2.0), view(0.25, 4.0)]), view(0.5, 2.5));
        assert_eq!(mean(&[view(0.0, 0.0), view(0.0, 0.0)]), view(0.0, 0.0));
    }
}
