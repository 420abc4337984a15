//! Closed-form intersections of rays with solids centred on the origin of their local space.

use glam::DVec3;

/// A solid in its local space; lengths in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Shape {
    /// A ball.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// A box with faces along the axes.
    Cuboid {
        /// Half of each edge.
        half: DVec3,
    },
    /// A capped cylinder along z.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Half of the height.
        half: f64,
    },
    /// A cylinder along z with half-spheres as ends.
    Capsule {
        /// Radius.
        radius: f64,
        /// Half of the height without the ends.
        half: f64,
    },
}

/// Where a ray meets a surface, in the ray's space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Surface {
    /// Distance along the ray, in lengths of its direction.
    pub t: f64,
    /// Unit normal, pointing out of the solid.
    pub normal: DVec3,
}

impl Shape {
    /// The radius of the smallest ball about the origin that holds the solid.
    pub(super) fn bounding_radius(&self) -> f64 {
        match *self {
            Self::Sphere { radius } => radius,
            Self::Cuboid { half } => half.length(),
            Self::Cylinder { radius, half } => radius.hypot(half),
            Self::Capsule { radius, half } => radius + half,
        }
    }

    /// The first crossing of the surface with `t > 0`, from outside or inside; `direction` has unit length.
    pub(super) fn intersect(&self, origin: DVec3, direction: DVec3) -> Option<Surface> {
        match *self {
            Self::Sphere { radius } => sphere(origin, direction, DVec3::ZERO, radius),
            Self::Cuboid { half } => cuboid(origin, direction, half),
            Self::Cylinder { radius, half } => cylinder(origin, direction, radius, half),
            Self::Capsule { radius, half } => capsule(origin, direction, radius, half),
        }
    }
}

/// The entry and exit `(t0, t1)` of a line in a ball, `t0 <= t1`; `direction` has unit length.
pub(super) fn ball_span(origin: DVec3, direction: DVec3, radius: f64) -> Option<(f64, f64)> {
    let middle = -origin.dot(direction);
    // The point closest to the centre, rather than `b² - c`, keeps distant grazing rays exact.
    let square = radius * radius - (origin + middle * direction).length_squared();
    (square > 0.0).then(|| (middle - square.sqrt(), middle + square.sqrt()))
}

fn first_ahead(span: (f64, f64)) -> Option<f64> {
    [span.0, span.1].into_iter().find(|&t| t > 0.0)
}

fn nearer(a: Option<Surface>, b: Option<Surface>) -> Option<Surface> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if a.t <= b.t { a } else { b }),
        (a, b) => a.or(b),
    }
}

fn sphere(origin: DVec3, direction: DVec3, center: DVec3, radius: f64) -> Option<Surface> {
    let local = origin - center;
    let t = first_ahead(ball_span(local, direction, radius)?)?;
    let normal = (local + t * direction) / radius;
    Some(Surface { t, normal })
}

/// The slab method: the line is in the box while it is between all three pairs of faces.
fn cuboid(origin: DVec3, direction: DVec3, half: DVec3) -> Option<Surface> {
    // A component of 0 becomes one too small to matter, which keeps infinities and NaN away.
    let inverse = DVec3::select(direction.cmpeq(DVec3::ZERO), DVec3::splat(1e-200), direction).recip();
    let middle = -origin * inverse;
    let reach = half * inverse.abs();
    let (near, far) = (middle - reach, middle + reach);
    let (enter, leave) = (near.max_element(), far.min_element());
    if enter >= leave || leave <= 0.0 {
        return None;
    }
    let (t, bounds, side) = if enter > 0.0 { (enter, near, -1.0) } else { (leave, far, 1.0) };
    let axis = (0..3).find(|&axis| bounds[axis] == t)?;
    let normal = DVec3::AXES[axis] * (side * direction[axis].signum());
    Some(Surface { t, normal })
}

/// The crossings of a line with the infinite cylinder about z.
fn tube_span(origin: DVec3, direction: DVec3, radius: f64) -> Option<(f64, f64)> {
    let (o, d) = (origin.truncate(), direction.truncate());
    let speed = d.length();
    if speed < 1e-12 {
        return None;
    }
    let unit = d / speed;
    let middle = -o.dot(unit);
    let square = radius * radius - (o + middle * unit).length_squared();
    (square > 0.0).then(|| {
        let half = square.sqrt();
        ((middle - half) / speed, (middle + half) / speed)
    })
}

/// The first point ahead on the wall of the cylinder about z between `-half` and `half`.
fn wall(origin: DVec3, direction: DVec3, radius: f64, half: f64) -> Option<Surface> {
    let span = tube_span(origin, direction, radius)?;
    let on_wall = |t: &f64| *t > 0.0 && (origin.z + t * direction.z).abs() <= half;
    let t = [span.0, span.1].into_iter().find(on_wall)?;
    let point = origin + t * direction;
    let normal = point.truncate().extend(0.0) / radius;
    Some(Surface { t, normal })
}

fn cylinder(origin: DVec3, direction: DVec3, radius: f64, half: f64) -> Option<Surface> {
    let cap = |side: f64| {
        let t = (side * half - origin.z) / direction.z;
        let point = origin + t * direction;
        let inside = t > 0.0 && t.is_finite() && point.truncate().length_squared() <= radius * radius;
        let normal = DVec3::Z * side;
        inside.then_some(Surface { t, normal })
    };
    let caps = nearer(cap(1.0), cap(-1.0));
    nearer(wall(origin, direction, radius, half), caps)
}

fn capsule(origin: DVec3, direction: DVec3, radius: f64, half: f64) -> Option<Surface> {
    let end = |side: f64| {
        let center = DVec3::Z * side * half;
        let span = ball_span(origin - center, direction, radius)?;
        // Only the outer half of the ball is surface.
        let outer = |t: &f64| *t > 0.0 && side * (origin.z + t * direction.z) > half;
        let t = [span.0, span.1].into_iter().find(outer)?;
        let normal = (origin + t * direction - center) / radius;
        Some(Surface { t, normal })
    };
    nearer(wall(origin, direction, radius, half), nearer(end(1.0), end(-1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPES: [Shape; 4] = [
        Shape::Sphere { radius: 0.7 },
        Shape::Cuboid { half: DVec3::new(0.3, 0.5, 0.6) },
        Shape::Cylinder { radius: 0.4, half: 0.5 },
        Shape::Capsule { radius: 0.3, half: 0.5 },
    ];

    /// Signed distance to the surface, negative inside: written independently of the intersections.
    fn distance(shape: &Shape, p: DVec3) -> f64 {
        match *shape {
            Shape::Sphere { radius } => p.length() - radius,
            Shape::Cuboid { half } => (p.abs() - half).max_element(),
            Shape::Cylinder { radius, half } => (p.truncate().length() - radius).max(p.z.abs() - half),
            Shape::Capsule { radius, half } => (p - DVec3::Z * p.z.clamp(-half, half)).length() - radius,
        }
    }

    fn directions() -> impl Iterator<Item = DVec3> {
        (0..500).map(|i| {
            let z = 1.0 - (i as f64 + 0.5) / 250.0;
            let (sin, cos) = (2.399_963 * i as f64).sin_cos();
            DVec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z)
        })
    }

    #[test]
    fn hits_lie_on_the_surface_and_nothing_lies_before_them() {
        for shape in SHAPES {
            for (i, from) in directions().enumerate() {
                let target = 0.6 * directions().nth((i * 7) % 500).unwrap_or(DVec3::X);
                let origin = 3.0 * from;
                let direction = (target - origin).normalize();
                let hit = shape.intersect(origin, direction);
                let end = hit.map_or(6.0, |hit| hit.t);
                let clear = (0..400).all(|k| {
                    let t = end * (k as f64 / 400.0);
                    distance(&shape, origin + t * direction) > -1e-9
                });
                assert!(clear, "{shape:?} from {origin} along {direction}");
                let Some(Surface { t, normal }) = hit else { continue };
                let point = origin + t * direction;
                assert!(distance(&shape, point).abs() < 1e-9, "{shape:?} at {point}");
                assert!((normal.length() - 1.0).abs() < 1e-9 && normal.dot(direction) < 1e-9);
                assert!(distance(&shape, point + 1e-4 * normal) > 0.0);
            }
        }
    }

    #[test]
    fn rays_from_inside_leave_through_the_surface() {
        for shape in SHAPES {
            for direction in directions().chain(DVec3::AXES) {
                let hit = shape.intersect(DVec3::new(0.01, 0.02, 0.03), direction).expect("closed surface");
                let point = DVec3::new(0.01, 0.02, 0.03) + hit.t * direction;
                assert!(distance(&shape, point).abs() < 1e-9, "{shape:?}");
            }
        }
    }

    #[test]
    fn rays_along_an_axis_hit_at_known_distances() {
        let along = |axis: DVec3| SHAPES.map(|s| s.intersect(-3.0 * axis, axis).map(|hit| hit.t));
        let close = |got: [Option<f64>; 4], want: [f64; 4]| {
            got.iter().zip(want).all(|(g, w)| g.is_some_and(|g| (g - w).abs() < 1e-12))
        };
        assert!(close(along(DVec3::X), [2.3, 2.7, 2.6, 2.7]));
        assert!(close(along(DVec3::Z), [2.3, 2.4, 2.5, 2.2]));
        let missed = SHAPES.map(|s| s.intersect(DVec3::new(0.0, 2.0, -3.0), DVec3::Z));
        assert_eq!(missed, [None; 4]);
    }
}
