//! The scene `courtyard`: a group on a pedestal between columns and brick walls, under a painted sky.
//!
//! The sky is a dome of radius 12 about the origin, so that every pixel is opaque and has a depth.

use super::texture::{Texture, paint};
use super::world::{Light, Object, World};
use glam::{DQuat, DVec3, dvec2, dvec3};

/// Radius of the sky.
const DOME: f64 = 12.0;

/// The solids and the light.
pub(super) fn world() -> World {
    let sun = dvec3(-0.5, -0.62, 0.75).normalize();
    let mut groups = vec![middle(), surroundings(sun)];
    groups.extend(columns());
    groups.push(walls());
    let light = Light {
        sun,
        sun_color: dvec3(1.0, 0.92, 0.78) * 1.05,
        sky_color: dvec3(0.30, 0.36, 0.46),
        ground_color: dvec3(0.22, 0.19, 0.16),
    };
    World::new(groups, light)
}

fn surroundings(sun: DVec3) -> Vec<Object> {
    let sky = Texture::Sky { colors: [dvec3(0.62, 0.70, 0.78), dvec3(0.12, 0.26, 0.58)], sun };
    let paving = Texture::Bricks {
        colors: [paint(0x00A8_9B86), paint(0x00D6_C9AE)],
        joint: paint(0x006B_6358),
        size: dvec2(0.5, 0.5),
        shift: 0.5,
    };
    vec![
        Object::ball(DVec3::ZERO, DOME, sky).glowing(),
        Object::cuboid(dvec3(0.0, 0.0, -0.1), dvec3(DOME, DOME, 0.1), paving),
    ]
}

fn walls() -> Vec<Object> {
    let brick = |from: u32, to: u32| Texture::Bricks {
        colors: [paint(from), paint(to)],
        joint: paint(0x00CF_C4B0),
        size: dvec2(0.5, 0.22),
        shift: 0.5,
    };
    let red = brick(0x008E_4A35, 0x00BF_7452);
    let ochre = brick(0x00A8_8145, 0x00D9_B878);
    let wall = |x: f64, y: f64, turn: f64, height: f64, texture: Texture| {
        Object::cuboid(dvec3(x, y, 0.5 * height), dvec3(5.2, 0.15, 0.5 * height), texture)
            .turned(DQuat::from_rotation_z(turn))
    };
    let quarter = std::f64::consts::FRAC_PI_2;
    vec![
        wall(0.0, 5.2, 0.0, 2.4, red),
        wall(0.0, -5.2, 0.0, 1.6, ochre),
        wall(5.2, 0.0, quarter, 2.0, ochre),
        wall(-5.2, 0.0, quarter, 2.4, red),
    ]
}

/// A column with base and capital in each corner and in the middle of two sides.
fn columns() -> Vec<Vec<Object>> {
    let stone = Texture::Marble { colors: [paint(0x00B9_B2A4), paint(0x00EB_E6DA)], frequency: 5.0 };
    let banded =
        Texture::Stripes { colors: [paint(0x002E_6E7E), paint(0x00E4_DCC8)], across: DVec3::Z, width: 0.3 };
    let places = [(4.0, 4.0), (-4.0, 4.0), (-4.0, -4.0), (4.0, -4.0), (0.0, 4.4), (4.4, 0.0)];
    let column = |(i, (x, y)): (usize, (f64, f64))| {
        let shaft = if i % 2 == 0 { stone } else { banded };
        vec![
            Object::cuboid(dvec3(x, y, 0.12), dvec3(0.36, 0.36, 0.12), stone),
            Object::pillar(dvec3(x, y, 0.24), 0.24, 2.5, shaft),
            Object::cuboid(dvec3(x, y, 2.84), dvec3(0.34, 0.34, 0.10), stone),
        ]
    };
    places.into_iter().enumerate().map(column).collect()
}

fn middle() -> Vec<Object> {
    let marble = Texture::Marble { colors: [paint(0x009A_A5A0), paint(0x00F0_EFE8)], frequency: 7.0 };
    let wood =
        Texture::Stripes { colors: [paint(0x008A_5A2C), paint(0x00B9_8248)], across: DVec3::Y, width: 0.07 };
    let barrel =
        Texture::Stripes { colors: [paint(0x002C_5C8F), paint(0x00E3_E6E8)], across: DVec3::Z, width: 0.14 };
    let crate_face = Texture::Checker { colors: [paint(0x00D2_9A3A), paint(0x0054_3A22)], size: 0.2 };
    let ball = Texture::Sectors { colors: [paint(0x00C8_3232), paint(0x00F4_F0E6)], count: 8.0 };
    let iron = Texture::Plain(paint(0x0030_343A));
    let lamp = dvec3(-0.75, 0.75, 0.0);
    vec![
        Object::pillar(DVec3::ZERO, 0.62, 0.14, marble),
        Object::pillar(dvec3(0.0, 0.0, 0.14), 0.26, 0.52, marble),
        Object::cuboid(dvec3(0.0, 0.0, 0.70), dvec3(0.36, 0.36, 0.04), marble),
        Object::ball(dvec3(0.0, 0.0, 1.05), 0.31, Texture::Plain(paint(0x0017_8A6E))).glossy(1.0),
        Object::cuboid(dvec3(0.85, -0.70, 0.25), DVec3::splat(0.25), crate_face)
            .turned(DQuat::from_rotation_z(0.35)),
        Object::ball(dvec3(0.83, -0.68, 0.67), 0.17, ball).turned(DQuat::from_rotation_x(0.8)),
        Object::pillar(dvec3(0.80, 0.78, 0.0), 0.24, 0.62, barrel),
        Object::cuboid(dvec3(-0.85, -0.75, 0.34), dvec3(0.48, 0.19, 0.03), wood)
            .turned(DQuat::from_rotation_z(-0.7)),
        Object::ball(dvec3(-0.28, -1.08, 0.15), 0.15, Texture::Plain(paint(0x00E0_8A20))),
        Object::rod([dvec3(-0.58, -0.98, 0.05), dvec3(-0.58, -0.98, 0.30)], 0.05, iron),
        Object::rod([dvec3(-1.02, -0.62, 0.05), dvec3(-1.02, -0.62, 0.30)], 0.05, iron),
        Object::rod([lamp, lamp + DVec3::Z * 1.7], 0.025, iron),
        Object::ball(lamp + DVec3::Z * 1.8, 0.12, Texture::Plain(dvec3(1.6, 1.35, 0.8))).glowing(),
    ]
}
