//! The scene `toys`: coloured solids on a checkered plate, within 1.2 units of the origin.

use super::texture::{Texture, paint};
use super::world::{Light, Object, World};
use glam::{DQuat, DVec3, dvec3};

/// Height of the top of the plate.
const FLOOR: f64 = -0.5;

/// The solids and the light.
pub(super) fn world() -> World {
    let groups = vec![vec![plate(), plate_rim()], tripod(), solids()];
    let light = Light {
        sun: dvec3(0.45, -0.55, 0.9).normalize(),
        sun_color: dvec3(1.0, 0.94, 0.84) * 0.95,
        sky_color: dvec3(0.34, 0.38, 0.46),
        ground_color: dvec3(0.20, 0.18, 0.16),
    };
    World::new(groups, light)
}

fn plate() -> Object {
    let colors = [paint(0x00E8_E2D4), paint(0x0046_5A69)];
    let checker = Texture::Checker { colors, size: 0.25 };
    Object::pillar(dvec3(0.0, 0.0, FLOOR - 0.06), 0.95, 0.06, checker)
}

/// A disc below the plate, whose sectors are what cameras below the horizon see.
fn plate_rim() -> Object {
    let colors = [paint(0x00C8_7D3B), paint(0x00F0_D9A8)];
    Object::pillar(dvec3(0.0, 0.0, FLOOR - 0.12), 1.0, 0.06, Texture::Sectors { colors, count: 16.0 })
}

fn solids() -> Vec<Object> {
    let white = paint(0x00F2_EFE6);
    let beam = Texture::Checker { colors: [paint(0x00F2_B632), paint(0x0028_2B33)], size: 0.14 };
    let candy = Texture::Stripes {
        colors: [paint(0x0022_8C7A), white],
        across: dvec3(0.35, 0.35, 0.87).normalize(),
        width: 0.085,
    };
    let beach = Texture::Sectors { colors: [paint(0x002F_6FD0), white], count: 10.0 };
    let marble = Texture::Marble { colors: [paint(0x0088_5FB0), paint(0x00E5_C9F0)], frequency: 9.0 };
    let tilt = DQuat::from_rotation_x(0.9) * DQuat::from_rotation_y(0.5);
    vec![
        Object::ball(dvec3(-0.40, -0.38, FLOOR + 0.30), 0.30, Texture::Plain(paint(0x00C4_2B24))).glossy(1.0),
        Object::cuboid(dvec3(0.40, 0.36, FLOOR + 0.28), DVec3::splat(0.28), beam)
            .turned(DQuat::from_rotation_z(0.5)),
        Object::ball(dvec3(0.40, 0.36, FLOOR + 0.56 + 0.19), 0.19, beach).turned(tilt),
        Object::pillar(dvec3(-0.42, 0.42, FLOOR), 0.2, 0.85, candy),
        Object::rod([dvec3(0.20, -0.62, FLOOR + 0.11), dvec3(0.66, -0.30, FLOOR + 0.11)], 0.11, marble),
        Object::ball(dvec3(0.02, -0.72, FLOOR + 0.09), 0.09, Texture::Plain(paint(0x004C_AF50))).glossy(0.4),
        Object::ball(dvec3(-0.74, 0.08, FLOOR + 0.11), 0.11, Texture::Plain(paint(0x00E9_7F1F))),
    ]
}

/// Three thin rods that meet above the middle and carry a ball.
fn tripod() -> Vec<Object> {
    let top = dvec3(0.0, 0.0, 0.72);
    let feet = [dvec3(0.62, -0.02, FLOOR), dvec3(-0.14, -0.3, FLOOR), dvec3(-0.08, 0.5, FLOOR)];
    let metal = Texture::Plain(paint(0x003A_3F4A));
    let bands =
        Texture::Stripes { colors: [paint(0x00D8_3A4A), paint(0x00F5_F0E0)], across: DVec3::Z, width: 0.08 };
    let mut parts: Vec<Object> = feet.iter().map(|&foot| Object::rod([foot, top], 0.016, bands)).collect();
    parts.push(Object::ball(top, 0.12, Texture::Plain(paint(0x00E8_C33A))).glossy(0.8));
    parts.push(Object::rod([top, top + DVec3::Z * 0.32], 0.010, metal));
    parts
}
