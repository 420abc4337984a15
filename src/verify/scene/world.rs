//! A set of solids under a sun and a sky: the nearest surface along a ray, shaded with exact shadows.

use super::Hit;
use super::shape::{Shape, Surface};
use super::texture::Texture;
use glam::{DMat3, DQuat, DVec3};

/// How far above a surface its shadow rays start, in world units.
const SHADOW_BIAS: f64 = 1e-6;

/// What a surface does with light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Material {
    /// Diffuse albedo, or the emitted colour of a glowing surface.
    pub texture: Texture,
    /// Strength of the view-dependent highlight; 0 is matte.
    pub gloss: f64,
    /// Whether the texture is emitted light, which neither receives nor casts shadows.
    pub glows: bool,
}

/// A solid in the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct Object {
    shape: Shape,
    material: Material,
    world_from_local: DMat3,
    local_from_world: DMat3,
    bounds: Ball,
}

/// A ball that holds something; tested before what it holds.
#[derive(Clone, Copy, Debug)]
struct Ball {
    center: DVec3,
    radius: f64,
}

/// The light of a world; colours are linear radiance of a white diffuse surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Light {
    /// Unit vector towards the sun.
    pub sun: DVec3,
    /// Colour of the sun, on a surface facing it.
    pub sun_color: DVec3,
    /// Colour of the sky, on a surface facing up.
    pub sky_color: DVec3,
    /// Colour of the light from below, on a surface facing down.
    pub ground_color: DVec3,
}

/// Solids and their light.
#[derive(Clone, Debug)]
pub(super) struct World {
    groups: Vec<Cluster>,
    light: Light,
}

/// Solids that lie close together.
#[derive(Clone, Debug)]
struct Cluster {
    objects: Vec<Object>,
    bounds: Ball,
}

impl Ball {
    /// Whether the line meets the ball at some `t` within `0..limit`; may be wrong on the safe side.
    fn reached(&self, origin: DVec3, direction: DVec3, limit: f64) -> bool {
        let offset = origin - self.center;
        let middle = -offset.dot(direction);
        middle > -self.radius
            && middle - self.radius < limit
            && (offset + middle * direction).length_squared() <= self.radius * self.radius
    }
}

impl Object {
    /// A solid centred on `center`, its local axes along the world's.
    pub(super) fn new(shape: Shape, center: DVec3, texture: Texture) -> Self {
        let material = Material { texture, gloss: 0.0, glows: false };
        let bounds = Ball { center, radius: shape.bounding_radius() * (1.0 + 1e-9) };
        let unturned = DMat3::IDENTITY;
        Self { shape, material, world_from_local: unturned, local_from_world: unturned, bounds }
    }

    /// A ball.
    pub(super) fn ball(center: DVec3, radius: f64, texture: Texture) -> Self {
        Self::new(Shape::Sphere { radius }, center, texture)
    }

    /// A box.
    pub(super) fn cuboid(center: DVec3, half: DVec3, texture: Texture) -> Self {
        Self::new(Shape::Cuboid { half }, center, texture)
    }

    /// An upright cylinder standing on `foot`.
    pub(super) fn pillar(foot: DVec3, radius: f64, height: f64, texture: Texture) -> Self {
        let half = 0.5 * height;
        Self::new(Shape::Cylinder { radius, half }, foot + DVec3::Z * half, texture)
    }

    /// A rod with round ends from `a` to `b`.
    pub(super) fn rod([a, b]: [DVec3; 2], radius: f64, texture: Texture) -> Self {
        let half = 0.5 * (b - a).length();
        let axis = (b - a).normalize_or(DVec3::Z);
        Self::new(Shape::Capsule { radius, half }, a.midpoint(b), texture)
            .turned(DQuat::from_rotation_arc(DVec3::Z, axis))
    }

    /// The solid turned about its centre.
    pub(super) fn turned(self, rotation: DQuat) -> Self {
        let world_from_local = DMat3::from_quat(rotation) * self.world_from_local;
        Self { world_from_local, local_from_world: world_from_local.transpose(), ..self }
    }

    /// The solid with a highlight.
    pub(super) fn glossy(mut self, gloss: f64) -> Self {
        self.material.gloss = gloss;
        self
    }

    /// The solid as a light-emitting surface.
    pub(super) fn glowing(mut self) -> Self {
        self.material.glows = true;
        self
    }

    /// The first surface ahead within `limit`, its normal in local space.
    fn intersect(&self, origin: DVec3, direction: DVec3, limit: f64) -> Option<Surface> {
        if !self.bounds.reached(origin, direction, limit) {
            return None;
        }
        let offset = self.local_from_world * (origin - self.bounds.center);
        let surface = self.shape.intersect(offset, self.local_from_world * direction)?;
        (surface.t < limit).then_some(surface)
    }
}

impl Cluster {
    fn new(objects: Vec<Object>) -> Self {
        let count = objects.len().max(1) as f64;
        let center = objects.iter().map(|object| object.bounds.center).sum::<DVec3>() / count;
        let reach = |object: &Object| object.bounds.center.distance(center) + object.bounds.radius;
        let radius = objects.iter().map(reach).fold(0.0, f64::max) * (1.0 + 1e-9);
        Self { objects, bounds: Ball { center, radius } }
    }
}

impl World {
    /// A world of groups of objects; grouping only saves time.
    pub(super) fn new(groups: Vec<Vec<Object>>, light: Light) -> Self {
        Self { groups: groups.into_iter().map(Cluster::new).collect(), light }
    }

    /// What a ray sees; `direction` has unit length.
    pub(super) fn trace(&self, origin: DVec3, direction: DVec3) -> Hit {
        let mut nearest = None;
        let mut t = f64::INFINITY;
        for group in &self.groups {
            if !group.bounds.reached(origin, direction, t) {
                continue;
            }
            for object in &group.objects {
                if let Some(surface) = object.intersect(origin, direction, t) {
                    t = surface.t;
                    nearest = Some((object, surface.normal));
                }
            }
        }
        let Some((object, local_normal)) = nearest else {
            return Hit::MISS;
        };
        let point = origin + t * direction;
        let local_point = object.local_from_world * (point - object.bounds.center);
        let base = object.material.texture.color(local_point, local_normal);
        if object.material.glows {
            return Hit::opaque(base, t);
        }
        let normal = object.world_from_local * local_normal;
        Hit::opaque(self.shade(base, object.material.gloss, (point, normal, direction)), t)
    }

    /// `albedo (ambient + sun max(n·l, 0) V) + gloss (sun V (n·h)^90 + F sky(r))`, where V is 1 in the sun and
    /// 0 in the shadow, h the half vector, r the mirrored ray and F Schlick's `0.04 + 0.96 (1 - n·v)^5`.
    fn shade(&self, albedo: DVec3, gloss: f64, (point, normal, direction): (DVec3, DVec3, DVec3)) -> DVec3 {
        let light = &self.light;
        let ambient = |up: f64| light.ground_color.lerp(light.sky_color, 0.5 + 0.5 * up);
        let facing = normal.dot(light.sun);
        let sunlit = facing > 0.0 && !self.shadowed(point + SHADOW_BIAS * normal);
        let sun = if sunlit { light.sun_color } else { DVec3::ZERO };
        let mut color = albedo * (ambient(normal.z) + sun * facing.max(0.0));
        if gloss > 0.0 {
            let half = (light.sun - direction).normalize_or(normal);
            let fresnel = 0.04 + 0.96 * (1.0 + normal.dot(direction)).clamp(0.0, 1.0).powi(5);
            let mirrored = direction.reflect(normal).z.clamp(-1.0, 1.0);
            color += gloss * (4.0 * sun * normal.dot(half).max(0.0).powi(90) + fresnel * ambient(mirrored));
        }
        color
    }

    fn shadowed(&self, point: DVec3) -> bool {
        let sun = self.light.sun;
        let mut groups = self.groups.iter().filter(|group| group.bounds.reached(point, sun, f64::INFINITY));
        groups.any(|group| {
            let mut casting = group.objects.iter().filter(|object| !object.material.glows);
            casting.any(|object| object.intersect(point, sun, f64::INFINITY).is_some())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIGHT: Light = Light {
        sun: DVec3::Z,
        sun_color: DVec3::splat(0.75),
        sky_color: DVec3::splat(0.25),
        ground_color: DVec3::ZERO,
    };
    const WHITE: Texture = Texture::Plain(DVec3::ONE);

    fn floor() -> Object {
        Object::cuboid(DVec3::new(0.0, 0.0, -1.0), DVec3::new(5.0, 5.0, 1.0), WHITE)
    }

    #[test]
    fn shadows_end_where_the_caster_does() {
        let world = World::new(vec![vec![floor()], vec![Object::ball(DVec3::Z * 2.0, 1.0, WHITE)]], LIGHT);
        let at = |x: f64| world.trace(DVec3::new(x, 0.0, 0.5), -DVec3::Z).color_linear[0];
        // In the sun 0.25 + 0.75, in the shadow 0.25; the shadow of the ball ends at x = 1.
        assert!((at(0.999) - 0.25).abs() < 1e-12 && (at(1.001) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn turned_objects_are_turned() {
        let rod = Object::rod([-DVec3::X, DVec3::X], 0.1, WHITE);
        let world = World::new(vec![vec![rod]], LIGHT);
        let hit = world.trace(DVec3::new(0.9, 0.0, 3.0), -DVec3::Z);
        assert!((hit.t - 2.9).abs() < 1e-12);
        assert_eq!(world.trace(DVec3::new(1.2, 0.0, 3.0), -DVec3::Z), Hit::MISS);
    }

    #[test]
    fn the_highlight_depends_on_the_view() {
        let world = World::new(vec![vec![floor().glossy(1.0)]], LIGHT);
        let slanted = DVec3::new(1.0, 0.0, -1.0).normalize();
        let straight = world.trace(DVec3::Z, -DVec3::Z).color_linear[0];
        assert!(straight > 3.0 && world.trace(DVec3::Z, slanted).color_linear[0] < 1.1);
    }
}
