//! Lines, surfaces and words on a plane, and how they are written as SVG.

use crate::support::chart::{CHARACTER, escaped};
use glam::DVec2;
use std::fmt::Write;

/// A picture made of shapes, the first at the bottom.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// Width and height in drawing units, +y down.
    size: DVec2,
    ground: Color,
    shapes: Vec<DrawnShape>,
}

/// A display-referred colour with an opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Color {
    rgb: [u8; 3],
    opacity: f64,
}

/// How a line is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stroke {
    pub(super) color: Color,
    width: f64,
    is_dashed: bool,
}

/// Which end of a text lies at its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

#[derive(Clone, Debug)]
pub(super) struct DrawnShape {
    outline: Outline,
    fill: Option<Color>,
    stroke: Option<Stroke>,
}

#[derive(Clone, Debug)]
enum Outline {
    Open(Vec<DVec2>),
    Closed(Vec<DVec2>),
    Circle(DVec2, f64),
    Text { at: DVec2, text: String, size: f64, anchor: Anchor },
}

impl Color {
    pub(super) const fn rgb(r: u8, g: u8, b: u8) -> Self {
        Self { rgb: [r, g, b], opacity: 1.0 }
    }

    pub(super) fn faint(self, opacity: f64) -> Self {
        Self { opacity, ..self }
    }

    fn attributes(self, name: &str) -> String {
        let [r, g, b] = self.rgb;
        let opacity =
            if self.opacity < 1.0 { format!(" {name}-opacity=\"{}\"", self.opacity) } else { String::new() };
        format!(" {name}=\"#{r:02x}{g:02x}{b:02x}\"{opacity}")
    }
}

impl Stroke {
    pub(super) fn new(color: Color, width: f64) -> Self {
        Self { color, width, is_dashed: false }
    }

    pub(super) fn dashed(self) -> Self {
        Self { is_dashed: true, ..self }
    }
}

impl DrawnShape {
    fn of(outline: Outline) -> Self {
        Self { outline, fill: None, stroke: None }
    }

    pub(super) fn line(points: [DVec2; 2]) -> Self {
        Self::of(Outline::Open(points.to_vec()))
    }

    pub(super) fn closed(points: Vec<DVec2>) -> Self {
        Self::of(Outline::Closed(points))
    }

    pub(super) fn rectangle(corner: DVec2, size: DVec2) -> Self {
        let (right, down) = (DVec2::new(size.x, 0.0), DVec2::new(0.0, size.y));
        Self::closed(vec![corner, corner + right, corner + size, corner + down])
    }

    pub(super) fn circle(center: DVec2, radius: f64) -> Self {
        Self::of(Outline::Circle(center, radius))
    }

    pub(super) fn filled(self, color: Color) -> Self {
        Self { fill: Some(color), ..self }
    }

    pub(super) fn with(self, stroke: Stroke) -> Self {
        Self { stroke: Some(stroke), ..self }
    }

    fn svg(&self, svg: &mut String) {
        let mut style = self.fill.map_or(" fill=\"none\"".to_owned(), |color| color.attributes("fill"));
        if let Some(stroke) = self.stroke {
            style += &stroke.color.attributes("stroke");
            style += &format!(" stroke-width=\"{}\"", stroke.width);
            if stroke.is_dashed {
                style += " stroke-dasharray=\"6 4\"";
            }
        }
        // Writing to a String cannot fail.
        let _ = match &self.outline {
            Outline::Open(points) => writeln!(svg, "<polyline points=\"{}\"{style}/>", listed(points)),
            Outline::Closed(points) => writeln!(svg, "<polygon points=\"{}\"{style}/>", listed(points)),
            Outline::Circle(at, radius) => {
                writeln!(svg, "<circle cx=\"{:.2}\" cy=\"{:.2}\" r=\"{radius}\"{style}/>", at.x, at.y)
            }
            Outline::Text { at, text, size, anchor } => {
                let anchor = match anchor {
                    Anchor::Start => "start",
                    Anchor::Middle => "middle",
                    Anchor::End => "end",
                };
                writeln!(
                    svg,
                    "<text x=\"{:.2}\" y=\"{:.2}\" font-size=\"{size}\" text-anchor=\"{anchor}\" \
                     paint-order=\"stroke\"{style}>{}</text>",
                    at.x,
                    at.y,
                    escaped(text)
                )
            }
        };
    }
}

fn listed(points: &[DVec2]) -> String {
    let points: Vec<_> = points.iter().map(|p| format!("{:.2},{:.2}", p.x, p.y)).collect();
    points.join(" ")
}

impl Drawing {
    pub(super) fn new(size: DVec2, ground: Color) -> Self {
        Self { size, ground, shapes: Vec::new() }
    }

    pub(super) fn push(&mut self, shape: DrawnShape) {
        self.shapes.push(shape);
    }

    /// Writes words with the ground around them; returns about where they end, as the font is the viewer's.
    pub(super) fn text(&mut self, at: DVec2, text: &str, size: f64, color: Color, anchor: Anchor) -> f64 {
        let outline = Outline::Text { at, text: text.to_owned(), size, anchor };
        let halo = Stroke::new(self.ground, 0.28 * size);
        self.push(DrawnShape::of(outline).filled(color).with(halo));
        at.x + CHARACTER * size * text.chars().count() as f64
    }

    /// The drawing as an SVG file.
    #[must_use]
    pub fn svg(&self) -> String {
        let (width, height) = (self.size.x, self.size.y);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
             height=\"{height}\" font-family=\"sans-serif\" stroke-linejoin=\"round\" \
             stroke-linecap=\"round\">\n<rect width=\"{width}\" height=\"{height}\"{}/>\n",
            self.ground.attributes("fill")
        );
        self.shapes.iter().for_each(|shape| shape.svg(&mut svg));
        svg + "</svg>\n"
    }
}
