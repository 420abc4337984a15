//! How far away lies what the test views show: the scale of their depth pictures, and where the opacity is.

use super::colormap::{VIRIDIS, gradient};
use super::curves::SIZE;
use super::pictures::nearness;
use super::test_views::TestViews;
use crate::run::depths::{Bin, Depths, NEAR};
use crate::support::chart::{Axis, Chart, Mark, Series};
use crate::support::format::percent;
use anyhow::Result;
use maud::{Markup, PreEscaped, html};

/// Depths that the scale names, the farthest first.
const TICKS: [(f64, &str); 5] = [(f64::INFINITY, "∞"), (2.0, "2"), (1.0, "1"), (0.5, "½"), (0.0, "0")];

/// What the colours of the depth pictures mean.
pub(super) fn scale(views: &TestViews) -> Markup {
    html! {
        p.scale {
            "Depth, "
            @if views.depths().is_some() {
                "where 1 is the distance from the camera to the point that all cameras look at"
            } @else {
                "where 1 is the view's median depth, since the optical axes do not cross in one point"
            }
            " (in world units it is said below each): "
            span.bar.ticks {
                i style=(format!("background: {}", gradient(&VIRIDIS))) {}
                @for (depth, name) in TICKS { b style=(format!("left: {:.0}%", 100.0 * nearness(depth))) { (name) } }
            }
            " black: nothing there"
        }
    }
}

/// The opacity by distance and the near share, or why they are not known.
pub(super) fn section(views: &TestViews) -> Result<Markup> {
    let depths = views.depths().filter(|depths| !depths.distribution().is_empty());
    let Some(depths) = depths else {
        let is_told = views.depths().is_some();
        return Ok(html! {
            p.remark {
                "How the opacity is spread over distances is not told: "
                @if is_told { "no pixel shows anything." } @else {
                    "the optical axes do not cross in one point, so there is no distance to compare with."
                }
            }
        });
    };
    let [width, height] = SIZE;
    let svg = chart(&depths).svg(width, height)?;
    Ok(html! {
        div.charts.beside {
            figure { (PreEscaped(svg)) }
            p.remark {
                "Where the opacity of the test views' pixels is, by its distance from the camera: 1 is the point that all \
                cameras look at, and each pixel counts at its mean depth. "
                @if let Some(share) = depths.near_share() {
                    strong { (percent(share)) }
                    " of all pixels show a surface nearer than half the way there (the near share). Much opacity there, \
                    where nothing of the scene is, is fog: the photos are painted right in front of their cameras."
                }
            }
        }
    })
}

/// The share of the opacity in each bin, as steps, and half the way to the focus.
fn chart(depths: &Depths) -> Chart {
    let bins = depths.distribution();
    let steps = |bin: &Bin| bin.distances.map(|distance| (distance, 100.0 * bin.share));
    let highest = bins.iter().map(|bin| 100.0 * bin.share).fold(0.0, f64::max);
    let ends = |at: Option<f64>| at.map(|distance| (distance, 0.0));
    let first = ends(bins.first().map(|bin| bin.distances[0]));
    let last = ends(bins.last().map(|bin| bin.distances[1]));
    let points = first.into_iter().chain(bins.iter().flat_map(steps)).chain(last).collect();
    Chart {
        title: "Opacity by distance".to_owned(),
        x: Axis::log("distance, 1 = what the cameras look at"),
        y: Axis::linear("% of all opacity"),
        series: vec![
            Series::new("opacity", Mark::Line, points),
            Series::new("half the way", Mark::Line, vec![(NEAR, 0.0), (NEAR, highest)]).dashed(),
        ],
    }
}
