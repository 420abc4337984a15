//! Charts as SVG text: lines and points over linear or logarithmic axes, with a legend above the data.
//!
//! A picture stands alone (its ground is white) and scales with its `viewBox`. A page that inlines it may recolour
//! it by its attributes: the ground's fill is `#FFFFFF`, the grid's stroke `#E4E4E4`, that of the axes `#777777`.

mod axis;

use anyhow::{Result, anyhow, ensure};
use axis::{Reach, ratio};
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Okabe and Ito's colours (2008), which readers with any colour vision tell apart; those that show on white and on
/// black.
const PALETTE: [RGBColor; 7] = [
    RGBColor(0x00, 0x72, 0xB2),
    RGBColor(0xD5, 0x5E, 0x00),
    RGBColor(0x00, 0x9E, 0x73),
    RGBColor(0xCC, 0x79, 0xA7),
    RGBColor(0xE6, 0x9F, 0x00),
    RGBColor(0x56, 0xB4, 0xE9),
    RGBColor(0x88, 0x88, 0x88),
];
const INK: RGBColor = RGBColor(0x22, 0x22, 0x22);
const AXIS: RGBColor = RGBColor(0x77, 0x77, 0x77);
const GRID: RGBColor = RGBColor(0xE4, 0xE4, 0xE4);

/// Units per pixel: plotters draws at whole units, which are too coarse for curves.
const FINE: u32 = 4;
/// Font sizes, in pixels.
const TITLE: u32 = 15;
const TEXT: u32 = 12;
/// Mean width of a character, as a part of the font size.
pub(crate) const CHARACTER: f64 = 0.56;
/// Length of a legend's line and the spaces around it, in pixels.
const SAMPLE: u32 = 20;
const GAP: u32 = 6;
const ROW: u32 = 18;
/// Space around the picture, in pixels.
const MARGIN: u32 = 8;
/// Smallest side that leaves room for data, in pixels.
const LEAST: u32 = 120;
/// Largest side, in pixels.
const MOST: u32 = 8192;

/// How an axis maps numbers to lengths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Equal differences are equally long.
    Linear,
    /// Equal ratios are equally long; numbers that are not positive are left out.
    Log,
}

/// An axis; its range follows the data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axis {
    /// What it measures, with the unit.
    pub label: String,
    /// How it maps numbers to lengths.
    pub scale: Scale,
}

impl Axis {
    /// A linear axis.
    #[must_use]
    pub fn linear(label: &str) -> Self {
        Self { label: label.to_owned(), scale: Scale::Linear }
    }

    /// A logarithmic axis.
    #[must_use]
    pub fn log(label: &str) -> Self {
        Self { label: label.to_owned(), scale: Scale::Log }
    }
}

/// What a series looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// A line from point to point.
    Line,
    /// A dot at each point.
    Points,
    /// Both.
    LinePoints,
}

/// Points that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// x and y of each point, in the order of the line. Where one has no place on the axes, the line is interrupted.
    pub points: Vec<(f64, f64)>,
    /// What it looks like.
    pub mark: Mark,
    /// Whether its line is dashed.
    pub dashed: bool,
}

impl Series {
    /// A series with a solid line.
    #[must_use]
    pub fn new(name: &str, mark: Mark, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.to_owned(), points, mark, dashed: false }
    }

    /// The same with a dashed line.
    #[must_use]
    pub fn dashed(self) -> Self {
        Self { dashed: true, ..self }
    }
}

/// A chart.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Its heading.
    pub title: String,
    /// To the right.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// What it shows; the legend names them where there are two or more.
    pub series: Vec<Series>,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type Plot<'a, 'b> = ChartContext<'b, SVGBackend<'a>, Cartesian2d<Reach, Reach>>;

impl Chart {
    /// The picture as an `<svg>` element, `width` by `height` pixels where the page does not say otherwise.
    ///
    /// # Errors
    /// When a side is shorter than 120 pixels or longer than 8192.
    pub fn svg(&self, width: u32, height: u32) -> Result<String> {
        for side in [width, height] {
            ensure!(
                (LEAST..=MOST).contains(&side),
                "a chart is {LEAST} to {MOST} pixels wide and high, found {width}x{height}"
            );
        }
        let mut text = String::new();
        {
            let root = SVGBackend::with_string(&mut text, (width * FINE, height * FINE)).into_drawing_area();
            self.draw(&root, width)
                .map_err(|error| anyhow!("drawing the chart '{}': {error}", self.title))?;
        }
        let body = text.find('\n').map_or("", |end| &text[end + 1..]);
        Ok(format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">\n{body}",
            width * FINE,
            height * FINE,
            escaped(&self.title)
        ))
    }

    fn draw(&self, root: &Area<'_>, width: u32) -> Result<(), Box<dyn std::error::Error>> {
        root.fill(&WHITE)?;
        let mut top = MARGIN;
        if !self.title.is_empty() {
            let title = fitted(&self.title, width - 2 * MARGIN, TITLE);
            root.draw_text(&title, &style(TITLE, true), (px(MARGIN), px(top)))?;
            top += TITLE + 2 * GAP;
        }
        top = self.draw_legend(root, width, top)?;
        let x = Reach::new(self.x.scale, self.coordinates().map(|(x, _)| x), false);
        let y = Reach::new(self.y.scale, self.coordinates().map(|(_, y)| y), true);
        let widest = y.ticks().iter().map(|tick| tick.1.chars().count()).max().unwrap_or(0);
        let left = ROW + GAP + (widest as f64 * CHARACTER * f64::from(TEXT)) as u32;
        let mut plot = ChartBuilder::on(root)
            .margin_top(px(top + GAP))
            .margin_right(px(3 * MARGIN))
            .margin_bottom(px(GAP))
            .margin_left(px(GAP))
            .x_label_area_size(px(2 * ROW))
            .y_label_area_size(px(left))
            .build_cartesian_2d(x, y)?;
        plot.configure_mesh()
            .max_light_lines(0)
            .bold_line_style(GRID.stroke_width(FINE))
            .axis_style(AXIS.stroke_width(FINE))
            .label_style(style(TEXT, false))
            .axis_desc_style(style(TEXT, false))
            .set_all_tick_mark_size(px(3))
            .x_desc(clean(&self.x.label))
            .y_desc(clean(&self.y.label))
            .draw()?;
        for (series, color) in self.series.iter().zip(PALETTE.iter().cycle()) {
            self.draw_series(&mut plot, series, *color)?;
        }
        if self.coordinates().next().is_none() {
            let (x, y) = plot.plotting_area().get_pixel_range();
            let middle = (i32::midpoint(x.start, x.end), i32::midpoint(y.start, y.end));
            root.draw_text("no data", &style(TEXT, false).pos(Pos::new(HPos::Center, VPos::Center)), middle)?;
        }
        Ok(root.present()?)
    }

    /// Draws the names of the series in rows from `top` on; where they end.
    fn draw_legend(&self, root: &Area<'_>, width: u32, top: u32) -> Result<u32, Box<dyn std::error::Error>> {
        if self.series.len() < 2 {
            return Ok(top);
        }
        let (mut left, mut top) = (MARGIN, top);
        for (series, color) in self.series.iter().zip(PALETTE.iter().cycle()) {
            let name = fitted(&series.name, width - 2 * MARGIN - SAMPLE - GAP, TEXT);
            let needs = SAMPLE + GAP + text_width(&name, TEXT);
            if left > MARGIN && left + needs > width - MARGIN {
                (left, top) = (MARGIN, top + ROW);
            }
            let (x, y) = (px(left), px(top + ROW / 2));
            let ends = [(x, y), (x + px(SAMPLE), y)];
            if series.mark != Mark::Points {
                let line = color.stroke_width(2 * FINE);
                match series.dashed {
                    true => root.draw(&DashedPathElement::new(ends, px(5), px(3), line))?,
                    false => root.draw(&PathElement::new(ends, line))?,
                }
            }
            if series.mark != Mark::Line {
                root.draw(&Circle::new((x + px(SAMPLE) / 2, y), px(3), color.filled()))?;
            }
            let anchor = Pos::new(HPos::Left, VPos::Center);
            root.draw_text(&name, &style(TEXT, false).pos(anchor), (x + px(SAMPLE + GAP), y))?;
            left += needs + 3 * GAP;
        }
        Ok(top + ROW)
    }

    fn draw_series(
        &self,
        plot: &mut Plot<'_, '_>,
        series: &Series,
        color: RGBColor,
    ) -> Result<(), Box<dyn std::error::Error>> {
        let points: Vec<_> = series.points.iter().map(|&point| self.placed(point)).collect();
        let runs = points.split(Option::is_none).map(|run| run.iter().copied().flatten());
        for run in runs {
            let run: Vec<(f64, f64)> = run.collect();
            if series.mark != Mark::Line || run.len() == 1 {
                let radius = px(if series.mark == Mark::Line { 2 } else { 3 });
                plot.draw_series(run.iter().map(|&point| Circle::new(point, radius, color.filled())))?;
            }
            if series.mark != Mark::Points && run.len() > 1 {
                let line = color.stroke_width(FINE * 7 / 4);
                let run = outline(&run, |point| plot.backend_coord(point).0 / px(1));
                match series.dashed {
                    true => plot.draw_series(DashedLineSeries::new(run, px(6), px(4), line))?,
                    false => plot.draw_series(LineSeries::new(run, line))?,
                };
            }
        }
        Ok(())
    }

    /// Where all points lie on the axes.
    fn coordinates(&self) -> impl Iterator<Item = (f64, f64)> {
        self.series.iter().flat_map(|series| &series.points).filter_map(|&point| self.placed(point))
    }

    fn placed(&self, (x, y): (f64, f64)) -> Option<(f64, f64)> {
        Some((ratio(self.x.scale, x)?, ratio(self.y.scale, y)?))
    }
}

/// A line that looks the same with at most four points per column of pixels: the first, the lowest, the highest
/// and the last.
fn outline(points: &[(f64, f64)], column: impl Fn(&(f64, f64)) -> i32) -> Vec<(f64, f64)> {
    let mut kept = Vec::new();
    for group in points.chunk_by(|a, b| column(a) == column(b)) {
        let by_height = |a: &usize, b: &usize| group[*a].1.total_cmp(&group[*b].1);
        let lowest = (0..group.len()).min_by(by_height).unwrap_or(0);
        let highest = (0..group.len()).max_by(by_height).unwrap_or(0);
        let mut chosen = [0, lowest, highest, group.len() - 1];
        chosen.sort_unstable();
        let distinct = chosen.iter().enumerate().filter(|&(i, index)| i == 0 || chosen[i - 1] != *index);
        kept.extend(distinct.map(|(_, &index)| group[index]));
    }
    kept
}

fn px(pixels: u32) -> i32 {
    (pixels * FINE) as i32
}

/// Text of `size` pixels; plotters' own sizes are of another box.
fn style(size: u32, bold: bool) -> TextStyle<'static> {
    let style = if bold { FontStyle::Bold } else { FontStyle::Normal };
    FontDesc::new(FontFamily::SansSerif, f64::from(size * FINE) * 1.24, style).color(&INK)
}

fn text_width(text: &str, size: u32) -> u32 {
    (text.chars().count() as f64 * CHARACTER * f64::from(size)).ceil() as u32
}

/// The text as far as it fits into `width` pixels.
fn fitted(text: &str, width: u32, size: u32) -> String {
    let text = clean(text);
    if text_width(&text, size) <= width {
        return text;
    }
    let count = (f64::from(width) / CHARACTER / f64::from(size)) as usize;
    text.chars().take(count.saturating_sub(1)).chain(['…']).collect()
}

/// The text without the characters that XML does not allow.
fn clean(text: &str) -> String {
    text.chars().filter(|c| !c.is_control() && !matches!(c, '\u{fffe}' | '\u{ffff}')).collect()
}

/// The text between tags or in an attribute.
pub(crate) fn escaped(text: &str) -> String {
    let text = clean(text).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    text.replace('"', "&quot;")
}
