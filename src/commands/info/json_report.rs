//! The report as JSON.

use super::text_report::bits;
use super::{Preflight, problems};
use nerf::capture::dataset::Frame;
use nerf::capture::diagnostics::{Diagnostic, Severity};
use nerf::capture::health::{Arrangement, Spread};
use serde_json::{Value, json};

impl Preflight<'_> {
    /// Whether training can begin.
    pub(super) fn is_ok(&self) -> bool {
        self.problems.iter().all(|problem| problem.severity != Severity::Error)
    }

    pub(super) fn json(&self) -> Value {
        let Self { dataset, .. } = self;
        let bounds = &dataset.bounds;
        json!({
            "dataset": self.args.dataset.display().to_string(),
            "files": dataset.files,
            "ok": self.is_ok(),
            "dialect": dataset.dialect,
            "frames": dataset.listed,
            "found": problems::found(dataset),
            "missing": dataset.missing,
            "splits": { "train": dataset.train.len(), "val": dataset.val.len(), "test": dataset.test.len() },
            "cameras": dataset.distinct_cameras(),
            "images": self.images(),
            "optics": self.optics(),
            "box": {
                "min": bounds.min().to_array(),
                "max": bounds.max().to_array(),
                "center": bounds.center.to_array(),
                "half": bounds.half,
                "cascades": bounds.cascades,
                "source": bounds.source,
                "is_guess": bounds.is_guess,
            },
            "coverage": {
                "box": self.survey.coverage.outer(),
                "inner_cube": self.survey.coverage.inner(),
                "worst": self.names(&self.survey.coverage.worst),
            },
            "gaze": self.view_directions(),
            "photos": self.photos(),
            "depth": self.depth(),
            "memory": self.memory_json(),
            "left_out": self.memory.as_ref().map(|estimate| &estimate.left_out),
            "problems": self.problems.iter().map(|problem| self.problem(problem)).collect::<Vec<_>>(),
            "plot": self.args.plot.as_ref().map(|path| path.display().to_string()),
        })
    }

    fn images(&self) -> Value {
        let sizes = self.survey.optics.sizes.iter();
        let sizes: Vec<_> = sizes
            .map(|([width, height], count)| json!({ "width": width, "height": height, "frames": count }))
            .collect();
        let number =
            |holds: fn(&Frame) -> bool| self.dataset.frames.iter().filter(|frame| holds(frame)).count();
        json!({
            "sizes": sizes,
            "bits": bits(self.dataset.bit_depth),
            "hdr": self.dataset.is_hdr,
            "with_alpha": number(|frame| frame.has_alpha),
            "cut_out": self.dataset.is_cutout,
            "with_mask": number(|frame| frame.has_mask),
            "with_depth": number(|frame| frame.has_depth),
        })
    }

    fn optics(&self) -> Value {
        let optics = &self.survey.optics;
        let lenses =
            optics.lenses.iter().map(|(kind, count)| json!({ "model": kind.name(), "frames": count }));
        let pair = |[x, y]: &[Spread; 2]| json!({ "x": x, "y": y });
        json!({
            "lenses": lenses.collect::<Vec<_>>(),
            "focal_px": pair(&optics.focal_px),
            "fov_degrees": pair(&optics.fov_degrees),
            "principal_point_off": pair(&optics.center_off),
        })
    }

    fn view_directions(&self) -> Value {
        let directions = &self.survey.directions;
        let arrangement = match directions.arrangement {
            Arrangement::Single => json!({ "kind": "single" }),
            Arrangement::Parallel { within_degrees } => {
                json!({ "kind": "parallel", "within_degrees": within_degrees })
            }
            Arrangement::Facing { within_degrees } => {
                json!({ "kind": "facing", "within_degrees": within_degrees })
            }
            Arrangement::Around { covered_degrees, elevation_degrees } => json!({
                "kind": "around", "covered_degrees": covered_degrees, "elevation_degrees": elevation_degrees,
            }),
            Arrangement::Scattered => json!({ "kind": "scattered" }),
        };
        json!({
            "focus": directions.focus.to_array(),
            "axes_meet": directions.meets,
            "distance": directions.distance,
            "relative_miss": directions.miss,
            "seeing": directions.seeing,
            "up": directions.up.to_array(),
            "arrangement": arrangement,
        })
    }

    fn photos(&self) -> Option<Value> {
        let gallery = self.gallery.as_ref()?;
        Some(json!({
            "looked_at": gallery.looks.len(),
            "sharpness": gallery.sharpness(),
            "brightness": gallery.brightness(),
            "ignored_by_masks": gallery.ignored_part(self.dataset),
            "ignored_of_masked": gallery.ignored(self.dataset),
        }))
    }

    fn depth(&self) -> Option<Value> {
        let depth = self.depth.as_ref()?;
        Some(json!({
            "files": depth.looks.len(),
            "unusable": depth.failures.len(),
            "known": depth.known(),
            "far": depth.far(),
            "range": depth.range(),
        }))
    }

    fn memory_json(&self) -> Option<Value> {
        let estimate = self.memory.as_ref()?;
        Some(json!({
            "host_bytes": estimate.memory.host_bytes,
            "device_bytes": estimate.memory.device_bytes,
            "photo_bytes": estimate.memory.photo_bytes,
            "most_photo_bytes": estimate.most_photo_bytes,
            "device_is_host": estimate.is_cpu,
            "adapter": estimate.adapter,
        }))
    }

    fn problem(&self, problem: &Diagnostic) -> Value {
        let mut value = json!({ "severity": problem.severity, "message": problem.message });
        if !problem.frames.is_empty() {
            value["frames"] = json!(self.names(&problem.frames));
        }
        value
    }

    fn names(&self, frames: &[usize]) -> Vec<&str> {
        frames.iter().map(|&index| self.dataset.frames[index].name.as_str()).collect()
    }
}
