//! The scene box in instant-ngp's terms.

use anyhow::{Result, bail, ensure};
use glam::DVec3;
use serde_json::Value;

use crate::capture::dataset::json::{Fields, REMEDY};
use crate::capture::dataset::listing::SceneBox;
use crate::capture::dataset::notes::Notes;
use crate::capture::dataset::pose::Axes;

impl SceneBox {
    /// Reads the keys of a file, if it has one of them.
    pub(in crate::capture::dataset) fn read(file: Fields, notes: &mut Notes) -> Result<Option<Self>> {
        if !file.has(&["aabb_scale", "scale", "offset", "aabb"]) {
            return Ok(None);
        }
        let asked = file.positive("aabb_scale", 1e6)?.unwrap_or(1.0);
        let aabb_scale = (asked.ceil().clamp(1.0, 128.0) as u32).next_power_of_two();
        if f64::from(aabb_scale) != asked {
            notes
                .note(format!("`aabb_scale` is {asked}; {aabb_scale} is used, a power of two from 1 to 128"));
        }
        // An explicit box is meant in world units and replaces scale and offset.
        if let Some(corners) = file.numbers("aabb")? {
            return Self::around(&corners, aabb_scale).map(Some);
        }
        let default_scale = if Axes::of(file)? == Axes::Mitsuba { 0.66 } else { 0.33 };
        let default_offset = if Axes::of(file)? == Axes::Mitsuba { 0.25 * default_scale } else { 0.5 };
        let offset = match file.get("offset") {
            Some(Value::Array(_)) => match file.numbers("offset")?.as_deref() {
                Some(&[x, y, z]) => DVec3::new(x, y, z),
                _ => bail!("`offset` must be one number or three; {REMEDY}"),
            },
            _ => DVec3::splat(file.number("offset")?.unwrap_or(default_offset)),
        };
        let scale = file.positive("scale", 1e30)?.unwrap_or(default_scale);
        ensure!(
            scale.recip().is_finite() && (offset / scale).is_finite(),
            "`scale` {scale:e} with `offset` {offset} puts the box at no finite place; {REMEDY}"
        );
        Ok(Some(Self { scale, offset, aabb_scale }))
    }

    fn around(corners: &[f64], aabb_scale: u32) -> Result<Self> {
        let &[x0, y0, z0, x1, y1, z1] = corners else {
            bail!("`aabb` must be [[x, y, z], [x, y, z]], found {} numbers; {REMEDY}", corners.len());
        };
        let (a, b) = (DVec3::new(x0, y0, z0), DVec3::new(x1, y1, z1));
        let side = (b - a).abs().max_element();
        let offset = DVec3::splat(0.5) - 0.5 * (a + b) / side;
        ensure!(side > 0.0, "`aabb` must be two different corners, found {a} twice; {REMEDY}");
        ensure!(
            side.is_finite() && side.recip().is_finite() && offset.is_finite(),
            "`aabb` must have corners in world units, found {side:e} from one to the other; {REMEDY}"
        );
        Ok(Self { scale: side.recip(), offset, aabb_scale })
    }
}
