//! A part of the picture that shows the world from one side.

use super::drawing::{Anchor, Color, Drawing, DrawnShape, Stroke};
use super::{FAINT, INK, TEXT};
use crate::support::format::length;
use glam::{DVec2, DVec3, dvec2};

/// How the world is seen: which directions are to the right and up.
#[derive(Clone, Copy, Debug)]
pub(super) struct PanelProjection {
    right: DVec3,
    up: DVec3,
}

/// A direction this near to an axis of the world is drawn as that axis.
const NEARLY_AN_AXIS: f64 = 0.8;

impl PanelProjection {
    /// From above and from the side, for a world where `up` points up.
    pub(super) fn above_and_beside(up: DVec3) -> [Self; 2] {
        let axis = DVec3::AXES.into_iter().find(|axis| axis.dot(up).abs() > NEARLY_AN_AXIS);
        let up = axis.map_or(up, |axis| axis * axis.dot(up).signum());
        let right = match axis {
            Some(DVec3::X) => DVec3::Y,
            Some(_) => DVec3::X,
            None => up.any_orthonormal_vector(),
        };
        [Self { right, up: up.cross(right) }, Self { right, up }]
    }

    /// To the right and upwards, in world units.
    pub(super) fn apply(&self, offset: DVec3) -> DVec2 {
        dvec2(offset.dot(self.right), offset.dot(self.up))
    }

    /// What is to the right and what is up.
    pub(super) fn describe(&self) -> String {
        let name = |direction: DVec3| {
            let axis = (DVec3::AXES.into_iter().zip(["x", "y", "z"]))
                .find(|(axis, _)| axis.dot(direction).abs() > 0.999);
            axis.map(
                |(axis, name)| if axis.dot(direction) > 0.0 { name.to_owned() } else { format!("-{name}") },
            )
        };
        match (name(self.right), name(self.up)) {
            (Some(right), Some(up)) => format!("{right} to the right, {up} up"),
            _ => "along the level of the cameras".to_owned(),
        }
    }
}

/// A panel, in drawing units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Panel {
    pub(super) corner: DVec2,
    pub(super) size: DVec2,
    pub(super) projection: PanelProjection,
    /// The point of the world in its middle.
    pub(super) center: DVec3,
    /// Drawing units per world unit.
    pub(super) scale: f64,
}

/// Space between the rim and what is drawn at it.
const RIM: f64 = 12.0;

impl Panel {
    fn middle(&self) -> DVec2 {
        self.corner + 0.5 * self.size
    }

    /// Where a point of the world is drawn.
    pub(super) fn place(&self, world: DVec3) -> DVec2 {
        let DVec2 { x, y } = self.scale * self.projection.apply(world - self.center);
        self.middle() + dvec2(x, -y)
    }

    /// Whether a point of the world is inside.
    pub(super) fn shows(&self, world: DVec3) -> bool {
        let off = (self.place(world) - self.middle()).abs();
        off.cmple(0.5 * self.size).all()
    }

    /// Where a point is drawn, or the place at the rim that leads to it.
    pub(super) fn rim(&self, world: DVec3) -> DVec2 {
        let off = self.place(world) - self.middle();
        let over = (off.abs() / (0.5 * self.size - RIM)).max_element();
        self.middle() + off / over.max(1.0)
    }

    /// Draws the part of a line between points of the world that is inside; returns whether there is any.
    pub(super) fn line(&self, ends: [DVec3; 2], stroke: Stroke, drawing: &mut Drawing) -> bool {
        let [from, to] = ends.map(|end| self.place(end));
        // Liang and Barsky (1984).
        let mut part = [0.0, 1.0];
        let (low, high) = (self.corner, self.corner + self.size);
        for axis in 0..2 {
            let (start, step) = (from[axis], to[axis] - from[axis]);
            for (distance, step) in [(start - low[axis], -step), (high[axis] - start, step)] {
                if step == 0.0 && distance < 0.0 {
                    return false;
                }
                if step < 0.0 {
                    part[0] = f64::max(part[0], distance / step);
                } else if step > 0.0 {
                    part[1] = f64::min(part[1], distance / step);
                }
            }
        }
        let is_inside = part[0] < part[1];
        if is_inside {
            drawing.push(DrawnShape::line(part.map(|at| from + at * (to - from))).with(stroke));
        }
        is_inside
    }

    /// An arrow at the rim towards a point beyond it.
    pub(super) fn draw_arrow(&self, world: DVec3, color: Color, drawing: &mut Drawing) {
        let tip = self.rim(world);
        let along = (tip - self.middle()).normalize_or(DVec2::X);
        let across = along.perp();
        let back = tip - 16.0 * along;
        drawing.push(DrawnShape::closed(vec![tip, back + 6.0 * across, back - 6.0 * across]).filled(color));
    }

    /// A bar of a round length, at the lower left.
    pub(super) fn draw_scale(&self, drawing: &mut Drawing) {
        let most = 0.25 * self.size.x / self.scale;
        let power = 10f64.powf(most.log10().floor());
        let round =
            [5.0, 2.0, 1.0].into_iter().map(|digit| digit * power).find(|&l| l <= most).unwrap_or(power);
        let from = self.corner + dvec2(12.0, self.size.y - 14.0);
        let to = from + dvec2(self.scale * round, 0.0);
        let tick = dvec2(0.0, 4.0);
        for line in [[from, to], [from - tick, from + tick], [to - tick, to + tick]] {
            drawing.push(DrawnShape::line(line).with(Stroke::new(INK, 1.4)));
        }
        let unit = if round == 1.0 { "world unit" } else { "world units" };
        let name = format!("{} {unit}", plain(round));
        drawing.text(0.5 * (from + to) - dvec2(0.0, 8.0), &name, TEXT, FAINT, Anchor::Middle);
    }
}

/// A round number without needless zeros.
fn plain(value: f64) -> String {
    if (0.001..1e5).contains(&value) { format!("{value}") } else { length(value) }
}

/// The corners of a box between two of them; bit 0, 1 and 2 of the index choose along x, y and z.
pub(super) fn corners(low: DVec3, high: DVec3) -> [DVec3; 8] {
    std::array::from_fn(|index| {
        let choose = |axis: usize| if index >> axis & 1 == 0 { low[axis] } else { high[axis] };
        DVec3::new(choose(0), choose(1), choose(2))
    })
}
