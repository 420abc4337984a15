//! Measuring test views for the page.

use super::pictures::{Pair, Pictures};
use super::test_views::TestViews;
use crate::capture::dataset::spread_order;
use crate::run::{Compared, Evaluator, Observer};
use crate::support::interrupt::Interrupted;
use anyhow::Result;

impl TestViews {
    /// Renders and scores frames, and keeps pictures of a few. It takes about `limit` seconds at most: what it comes to
    /// by then, or until the device's interrupt is raised, is evenly spaced.
    ///
    /// # Errors
    /// When a photo cannot be read, the device was lost, or a picture cannot be made.
    pub fn measure(
        evaluator: &mut Evaluator<'_>,
        indices: &[usize],
        limit: Option<f64>,
        observer: &mut dyn Observer,
    ) -> Result<Self> {
        let mut views = Self::default();
        let mut order = spread_order(indices.len());
        // Where only one fits it is one from the middle: the first of a capture is often easier than the others.
        order.rotate_left(1.min(indices.len()));
        let spread: Vec<usize> = order.iter().map(|&position| indices[position]).collect();
        let mut reached = 0;
        let measured = evaluator.each(&spread, limit, observer, |number, compared| {
            reached = number + 1;
            let Compared { score, size, rendered, photo, ignored, depth, unit } = &compared;
            let pair = Pair { size: *size, rendered, photo, ignored, depth, unit: *unit };
            views.add(order[number], score.for_page(), || Pictures::new(&pair))
        });
        match measured {
            Err(error) if Interrupted::is_cause_of(&error) => {}
            measured => reached = measured?,
        }
        views.left_out = indices.len() - reached;
        Ok(views)
    }
}
