//! A picture of the cameras of a dataset, from above and from the side: frusta, optical axes, focus and box.

mod drawing;
mod panel;

pub use drawing::Drawing;

use super::{Spread, Survey};
use crate::camera::Bounds;
use crate::camera::{Camera, Lens};
use crate::capture::dataset::Dataset;
use crate::photo::Split;
use crate::support::format::{count, length, point};
use drawing::{Anchor, Color, DrawnShape, Stroke};
use glam::{DVec2, DVec3, dvec2};
use panel::{Panel, PanelProjection};
use std::collections::{HashMap, HashSet};
use std::path::Path;

// Okabe and Ito's colours (2008), which readers with any colour vision tell apart.
const TRAIN: Color = Color::rgb(0x00, 0x72, 0xB2);
const VAL: Color = Color::rgb(0xCC, 0x79, 0xA7);
const TEST: Color = Color::rgb(0x00, 0x9E, 0x73);
const MARKED: Color = Color::rgb(0xD5, 0x5E, 0x00);
const INK: Color = Color::rgb(0x22, 0x22, 0x22);
const FAINT: Color = Color::rgb(0x77, 0x77, 0x77);
const GROUND: Color = Color::rgb(0xFF, 0xFF, 0xFF);
const CUBE: Color = Color::rgb(0xE6, 0x9F, 0x00);

const SIZE: DVec2 = dvec2(1200.0, 700.0);
const MARGIN: f64 = 20.0;
const HEADER: f64 = 64.0;
const FOOTER: f64 = 30.0;
const TITLE: f64 = 17.0;
const TEXT: f64 = 12.5;
/// Most cameras whose names are written.
const MOST_NAMES: usize = 6;
/// A marked camera that widens the picture by more is shown at its rim.
const WIDEN: f64 = 1.6;

/// Draws all views of a survey; the frames `marked` stand out.
#[must_use]
pub fn draw(dataset: &Dataset, survey: &Survey, marked: &HashSet<usize>) -> Drawing {
    let map = Map::new(dataset, survey, marked);
    let mut drawing = Drawing::new(SIZE, GROUND);
    let width = 0.5 * (SIZE.x - 3.0 * MARGIN);
    let projections = PanelProjection::above_and_beside(survey.directions.up);
    let corners = [dvec2(MARGIN, HEADER), dvec2(2.0 * MARGIN + width, HEADER)];
    let size = dvec2(width, SIZE.y - HEADER - FOOTER);
    let range = map.range(&projections, size);
    let mut shows_whole_box = false;
    for ((projection, corner), title) in
        projections.into_iter().zip(corners).zip(["from above", "from the side"])
    {
        let panel = Panel { corner, size, projection, center: range.center, scale: range.scale };
        shows_whole_box |= map.draw_panel(&panel, title, &mut drawing);
    }
    map.draw_heading(shows_whole_box, &mut drawing);
    drawing
}

struct Map<'a> {
    dataset: &'a Dataset,
    survey: &'a Survey,
    marked: &'a HashSet<usize>,
    /// The colour of each image: of the splits that list it, the last one's.
    colors: HashMap<&'a Path, Color>,
    /// Length of a frustum, in world units.
    frustum: f64,
}

/// The part of the world that is shown, the same in both panels.
struct Range {
    center: DVec3,
    /// Drawing units per world unit.
    scale: f64,
}

impl<'a> Map<'a> {
    fn new(dataset: &'a Dataset, survey: &'a Survey, marked: &'a HashSet<usize>) -> Self {
        let split = |split, color| {
            dataset.split(split).iter().map(move |&index| (dataset.frames[index].path.as_path(), color))
        };
        let colors = split(Split::Train, TRAIN)
            .chain(split(Split::Val, VAL))
            .chain(split(Split::Test, TEST))
            .collect();
        let mut map = Self { dataset, survey, marked, colors, frustum: 0.0 };
        let (low, high) = map.extent();
        let crowd = match survey.views.len() {
            0..40 => 0.07,
            40..150 => 0.05,
            _ => 0.035,
        };
        map.frustum = crowd * (high - low).max_element();
        map
    }

    fn camera(&self, frame: usize) -> &Camera {
        &self.dataset.frames[frame].camera
    }

    /// What is to be seen: the inner cube, the focus, and the cameras but for those far away that are marked.
    fn extent(&self) -> (DVec3, DVec3) {
        let bounds = &self.dataset.bounds;
        let mut low = self.survey.directions.focus;
        let mut high = low;
        let mut include = |point: DVec3| (low, high) = (low.min(point), high.max(point));
        let positions = |is_marked: bool| {
            let frames = self.survey.views.iter().filter(move |view| self.marked.contains(view) == is_marked);
            frames.map(|&frame| self.camera(frame).position())
        };
        positions(false).for_each(&mut include);
        let reach = Spread::of(positions(false).map(|p| p.distance(bounds.center))).max;
        // A box much larger than what happens in it would hide all the rest.
        if bounds.half < 3.0 * reach || self.survey.views.len() == 1 {
            include(bounds.center - bounds.half);
            include(bounds.center + bounds.half);
        }
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low).max_element());
        for position in positions(true) {
            if (position - middle).abs().max_element() <= WIDEN * half {
                (low, high) = (low.min(position), high.max(position));
            }
        }
        if low == high { (low - 1.0, high + 1.0) } else { (low, high) }
    }

    fn range(&self, projections: &[PanelProjection; 2], size: DVec2) -> Range {
        let (low, high) = self.extent();
        let center = 0.5 * (low + high);
        let corners = panel::corners(low, high);
        let wanted = projections.iter().flat_map(|projection| {
            corners
                .map(|corner| (projection.apply(corner - center).abs() + 1.3 * self.frustum) / (0.5 * size))
        });
        let widest = wanted.map(DVec2::max_element).fold(f64::MIN_POSITIVE, f64::max);
        // Room for the names and the scale.
        Range { center, scale: 0.9 / widest }
    }

    /// Returns whether some of the whole box is inside.
    fn draw_panel(&self, panel: &Panel, title: &str, drawing: &mut Drawing) -> bool {
        drawing
            .push(DrawnShape::rectangle(panel.corner, panel.size).with(Stroke::new(FAINT.faint(0.5), 1.0)));
        let shows_whole_box = self.draw_box(panel, drawing);
        let weight = (30.0 / self.survey.views.len() as f64).clamp(0.12, 0.6);
        for &frame in &self.survey.views {
            self.draw_axis(panel, frame, weight, drawing);
        }
        self.draw_focus(panel, drawing);
        let mut order = self.survey.views.clone();
        order.sort_by_key(|frame| self.marked.contains(frame));
        for &frame in &order {
            self.draw_camera(panel, frame, drawing);
        }
        self.draw_names(panel, drawing);
        panel.draw_scale(drawing);
        let at = panel.corner + dvec2(10.0, 20.0);
        drawing.text(at, &format!("{title}: {}", panel.projection.describe()), TEXT, INK, Anchor::Start);
        shows_whole_box
    }

    /// Returns whether some of the whole box is inside the panel.
    fn draw_box(&self, panel: &Panel, drawing: &mut Drawing) -> bool {
        let bounds: &Bounds = &self.dataset.bounds;
        let cube = |half: f64| panel::corners(bounds.center - half, bounds.center + half);
        let edges = |corners: [DVec3; 8]| {
            let pairs = (0..8usize).flat_map(|a| [1, 2, 4].map(|bit| (a, a | bit))).filter(|(a, b)| a != b);
            pairs.map(move |(a, b)| [corners[a], corners[b]])
        };
        let mut is_inside = false;
        if bounds.cascades > 1 {
            for edge in edges(cube(bounds.outer_half())) {
                is_inside |= panel.line(edge, Stroke::new(FAINT, 1.0).dashed(), drawing);
            }
        }
        for edge in edges(cube(bounds.half)) {
            panel.line(edge, Stroke::new(CUBE, 1.4), drawing);
        }
        is_inside
    }

    /// The optical axis, up to where it is nearest to the focus.
    fn draw_axis(&self, panel: &Panel, frame: usize, weight: f64, drawing: &mut Drawing) {
        let camera = self.camera(frame);
        let size = dvec2(f64::from(camera.width), f64::from(camera.height));
        let Some(ray) = camera.ray(0.5 * size) else { return };
        let ahead = (self.survey.directions.focus - ray.origin).dot(ray.direction);
        let along = if ahead > 0.0 { ahead } else { 4.0 * self.frustum };
        let is_marked = self.marked.contains(&frame);
        let color = self.color(frame).faint(if is_marked { 0.9 } else { weight });
        let end = ray.origin + along * ray.direction;
        panel.line([ray.origin, end], Stroke::new(color, if is_marked { 1.4 } else { 0.8 }), drawing);
    }

    fn draw_focus(&self, panel: &Panel, drawing: &mut Drawing) {
        let at = panel.place(self.survey.directions.focus);
        let arm = 8.0;
        for [dx, dy] in [[arm, 0.0], [0.0, arm]] {
            let arm = dvec2(dx, dy);
            drawing.push(DrawnShape::line([at - arm, at + arm]).with(Stroke::new(GROUND, 4.0)));
            drawing.push(DrawnShape::line([at - arm, at + arm]).with(Stroke::new(INK, 1.6)));
        }
    }

    /// A frustum, or an arrow at the rim for a camera beyond it.
    fn draw_camera(&self, panel: &Panel, frame: usize, drawing: &mut Drawing) {
        let camera = self.camera(frame);
        let is_marked = self.marked.contains(&frame);
        let stroke = Stroke::new(self.color(frame), if is_marked { 1.8 } else { 1.0 });
        let position = camera.position();
        if !panel.shows(position) {
            return panel.draw_arrow(position, stroke.color, drawing);
        }
        let has_rims = camera.lens != Lens::Equirectangular;
        if !has_rims {
            // It sees everything.
            let radius = 0.4 * self.frustum * panel.scale;
            drawing.push(
                DrawnShape::circle(panel.place(position), radius)
                    .filled(stroke.color.faint(0.18))
                    .with(stroke),
            );
        }
        let size = dvec2(f64::from(camera.width), f64::from(camera.height));
        let rims = [dvec2(0.0, 0.0), dvec2(1.0, 0.0), dvec2(1.0, 1.0), dvec2(0.0, 1.0)];
        let rays: Vec<_> =
            (rims.iter().filter(|_| has_rims)).filter_map(|rim| camera.ray(*rim * size)).collect();
        let ends: Vec<DVec3> = rays.iter().map(|ray| ray.origin + self.frustum * ray.direction).collect();
        let picture: Vec<DVec2> = ends.iter().map(|end| panel.place(*end)).collect();
        let fill = stroke.color.faint(0.18);
        if has_rims {
            drawing.push(DrawnShape::closed(picture).filled(fill).with(stroke));
        }
        for (ray, end) in rays.iter().zip(ends) {
            panel.line([ray.origin, end], stroke, drawing);
        }
        drawing.push(
            DrawnShape::circle(panel.place(position), if is_marked { 3.2 } else { 1.6 }).filled(stroke.color),
        );
    }

    /// The names of marked cameras, next to them and below each other where they would overlap.
    fn draw_names(&self, panel: &Panel, drawing: &mut Drawing) {
        let named = self.survey.views.iter().filter(|frame| self.marked.contains(frame)).take(MOST_NAMES);
        let mut taken: Vec<DVec2> = Vec::new();
        for &frame in named {
            let position = self.camera(frame).position();
            let mut name = self.dataset.frames[frame].name.rsplit('/').next().unwrap_or_default().to_owned();
            if !panel.shows(position) {
                name += &format!(" ({} away)", length(position.distance(self.survey.directions.focus)));
            }
            let camera = panel.rim(position);
            let is_right = camera.x > panel.corner.x + 0.6 * panel.size.x;
            let mut at = camera + dvec2(if is_right { -10.0 } else { 10.0 }, -8.0);
            while taken.iter().any(|other| (other.y - at.y).abs() < TEXT && (other.x - at.x).abs() < 160.0) {
                at.y += TEXT + 2.0;
            }
            taken.push(at);
            let anchor = if is_right { Anchor::End } else { Anchor::Start };
            drawing.text(at, &name, TEXT, MARKED, anchor);
        }
    }

    fn color(&self, frame: usize) -> Color {
        if self.marked.contains(&frame) {
            return MARKED;
        }
        self.colors.get(self.dataset.frames[frame].path.as_path()).copied().unwrap_or(FAINT)
    }

    fn draw_heading(&self, shows_whole_box: bool, drawing: &mut Drawing) {
        let title = format!("{} of {}", count(self.survey.views.len(), "camera"), folder_name(self.dataset));
        drawing.text(dvec2(MARGIN, 28.0), &title, TITLE, INK, Anchor::Start);
        let number =
            |color: Color| self.survey.views.iter().filter(|frame| self.color(**frame) == color).count();
        let mut x = MARGIN;
        let entries =
            [(TRAIN, "train"), (VAL, "val"), (TEST, "test"), (MARKED, "to check"), (FAINT, "unused")];
        for (color, name) in entries {
            let number = number(color);
            if number > 0 {
                let at = dvec2(x, 42.0);
                drawing.push(DrawnShape::rectangle(at, dvec2(11.0, 11.0)).filled(color));
                x = drawing.text(
                    at + dvec2(16.0, 10.0),
                    &format!("{number} {name}"),
                    TEXT,
                    INK,
                    Anchor::Start,
                ) + 18.0;
            }
        }
        let is_whole = self.dataset.bounds.cascades == 1;
        let mut lines =
            vec![(Stroke::new(CUBE, 1.4), if is_whole { "box" } else { "inner cube of the box" })];
        if !is_whole {
            let name = if shows_whole_box { "whole box" } else { "whole box, beyond the picture" };
            lines.push((Stroke::new(FAINT, 1.0).dashed(), name));
        }
        for (stroke, name) in lines {
            drawing.push(DrawnShape::line([dvec2(x, 47.0), dvec2(x + 18.0, 47.0)]).with(stroke));
            x = drawing.text(dvec2(x + 23.0, 52.0), name, TEXT, INK, Anchor::Start) + 18.0;
        }
        drawing.text(dvec2(x, 52.0), "+ focus", TEXT, INK, Anchor::Start);
        let foot = dvec2(MARGIN, SIZE.y - 10.0);
        drawing.text(foot, &self.footnote(), TEXT, FAINT, Anchor::Start);
    }

    fn footnote(&self) -> String {
        let directions = &self.survey.directions;
        let focus = if directions.meets { "the axes meet" } else { "the axes do not meet; the focus is" };
        format!(
            "{focus} at {}, {} from the cameras; the box is {} wide",
            point(directions.focus, directions.distance.median),
            directions.distance.describe(length),
            length(2.0 * self.dataset.bounds.outer_half())
        )
    }
}

/// The last part of the dataset's folder that is a name.
fn folder_name(dataset: &Dataset) -> String {
    let path = dataset.root.canonicalize().unwrap_or_else(|_| dataset.root.clone());
    path.file_name().map_or_else(|| "the dataset".to_owned(), |name| name.to_string_lossy().into_owned())
}
