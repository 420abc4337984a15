//! Drawings as pixels.

use super::drawing::{Anchor, Color, DASH, Drawing, Outline, Shape, Stroke};
use anyhow::{Context, Result};
use glam::DVec2;
use tiny_skia::{FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, StrokeDash, Transform};
use ttf_parser::{Face, OutlineBuilder};

/// A drawing in pixels.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// sRGB with straight alpha, row by row from the top.
    pub pixels: Vec<[u8; 4]>,
}

impl Drawing {
    /// The drawing with `scale` pixels per unit.
    ///
    /// # Errors
    /// When there is no memory for so many.
    pub fn pixels(&self, scale: f32) -> Result<Picture> {
        let [width, height] = [self.size.x, self.size.y].map(|side| (side as f32 * scale).ceil() as u32);
        let mut pixmap = Pixmap::new(width, height).context("the picture is too large")?;
        pixmap.fill(color(self.ground));
        let face = Face::parse(notosans::REGULAR_TTF, 0).context("reading the font")?;
        for shape in &self.shapes {
            shape.paint(&face, Transform::from_scale(scale, scale), &mut pixmap);
        }
        let straight = |pixel: &tiny_skia::PremultipliedColorU8| {
            let color = pixel.demultiply();
            [color.red(), color.green(), color.blue(), color.alpha()]
        };
        Ok(Picture { width, height, pixels: pixmap.pixels().iter().map(straight).collect() })
    }
}

fn color(color: Color) -> tiny_skia::Color {
    let [r, g, b] = color.rgb;
    tiny_skia::Color::from_rgba8(r, g, b, (color.opacity * 255.0).round() as u8)
}

fn paint(of: Color) -> Paint<'static> {
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color(color(of));
    paint
}

impl Shape {
    fn paint(&self, face: &Face<'_>, transform: Transform, pixmap: &mut Pixmap) {
        let Some(path) = self.outline.path(face) else { return };
        let is_text = matches!(self.outline, Outline::Text { .. });
        let stroke = |pixmap: &mut Pixmap| {
            if let Some(stroke) = self.stroke {
                pixmap.stroke_path(&path, &paint(stroke.color), &stroke.pen(), transform, None);
            }
        };
        // The halo of a text lies below it.
        if is_text {
            stroke(pixmap);
        }
        if let Some(fill) = self.fill {
            pixmap.fill_path(&path, &paint(fill), FillRule::Winding, transform, None);
        }
        if !is_text {
            stroke(pixmap);
        }
    }
}

impl Stroke {
    fn pen(&self) -> tiny_skia::Stroke {
        let dash = self.is_dashed.then(|| StrokeDash::new(DASH.map(|length| length as f32).to_vec(), 0.0));
        tiny_skia::Stroke {
            width: self.width as f32,
            line_cap: LineCap::Round,
            line_join: LineJoin::Round,
            dash: dash.flatten(),
            ..tiny_skia::Stroke::default()
        }
    }
}

impl Outline {
    fn path(&self, face: &Face<'_>) -> Option<Path> {
        let mut builder = PathBuilder::new();
        match self {
            Self::Open(points) | Self::Closed(points) => {
                let mut points = points.iter();
                let first = points.next()?;
                builder.move_to(first.x as f32, first.y as f32);
                points.for_each(|point| builder.line_to(point.x as f32, point.y as f32));
                if matches!(self, Self::Closed(_)) {
                    builder.close();
                }
            }
            Self::Circle(at, radius) => builder.push_circle(at.x as f32, at.y as f32, *radius as f32),
            Self::Text { at, text, size, anchor } => {
                let width = width(face, text, *size);
                let offset = match anchor {
                    Anchor::Start => 0.0,
                    Anchor::Middle => 0.5 * width,
                    Anchor::End => width,
                };
                letters(face, text, *size, *at - DVec2::new(offset, 0.0), &mut builder);
            }
        }
        builder.finish()
    }
}

/// Width of a text in the font of the drawings; an estimate should the font be broken.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    let estimate = 0.56 * size * text.chars().count() as f64;
    Face::parse(notosans::REGULAR_TTF, 0).map_or(estimate, |face| width(&face, text, size))
}

fn width(face: &Face<'_>, text: &str, size: f64) -> f64 {
    let scale = size / f64::from(face.units_per_em());
    let advance = |letter| face.glyph_hor_advance(face.glyph_index(letter).unwrap_or_default()).unwrap_or(0);
    text.chars().map(|letter| f64::from(advance(letter)) * scale).sum()
}

fn letters(face: &Face<'_>, text: &str, size: f64, at: DVec2, builder: &mut PathBuilder) {
    let scale = (size / f64::from(face.units_per_em())) as f32;
    let mut pen = Pen { x: at.x as f32, y: at.y as f32, scale, builder };
    for letter in text.chars() {
        let glyph = face.glyph_index(letter).unwrap_or_default();
        face.outline_glyph(glyph, &mut pen);
        pen.x += f32::from(face.glyph_hor_advance(glyph).unwrap_or(0)) * scale;
    }
}

/// Draws glyphs, whose y axis points up.
struct Pen<'a> {
    x: f32,
    y: f32,
    scale: f32,
    builder: &'a mut PathBuilder,
}

impl Pen<'_> {
    fn at(&self, x: f32, y: f32) -> (f32, f32) {
        (self.x + self.scale * x, self.y - self.scale * y)
    }
}

impl OutlineBuilder for Pen<'_> {
    fn move_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.builder.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.builder.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let ((x1, y1), (x, y)) = (self.at(x1, y1), self.at(x, y));
        self.builder.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let ((x1, y1), (x2, y2), (x, y)) = (self.at(x1, y1), self.at(x2, y2), self.at(x, y));
        self.builder.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.builder.close();
    }
}
