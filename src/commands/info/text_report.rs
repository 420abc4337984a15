//! The report for people, as text.

use super::{Preflight, problems};
use nerf::capture::dataset::Frame;
use nerf::capture::diagnostics::Severity;
use nerf::capture::health::{Arrangement, Spread, ViewDirections};
use nerf::photo::BitDepth;
use nerf::run::Estimate;
use nerf::support::format::{bytes, count, length, percent, plural, point, short};

/// Width of the headings at the left.
const MARGIN: usize = 10;
/// Width of enumerations.
const WIDTH: usize = 110;

impl Preflight<'_> {
    pub(super) fn text(&self) -> String {
        let sections = [
            ("dataset", self.about_dataset()),
            ("frames", self.about_frames()),
            ("images", self.about_images()),
            ("cameras", self.about_cameras()),
            ("box", self.about_box()),
            ("coverage", self.about_coverage()),
            ("views", about_view_directions(&self.survey.directions, self.survey.views.len())),
            ("photos", self.about_photos()),
            ("masks", self.about_masks()),
            ("depth", self.about_depth()),
            ("memory", self.memory.as_ref().map_or_else(Vec::new, about_memory)),
            ("left out", self.about_left_out()),
        ];
        let mut text = String::new();
        for (heading, lines) in sections {
            for (number, line) in lines.into_iter().enumerate() {
                let heading = if number == 0 { heading } else { "" };
                text += &format!("{heading:MARGIN$}{line}\n");
            }
        }
        text.push('\n');
        for problem in &self.problems {
            text += &format!("{:MARGIN$}{}\n", name(problem.severity), problem.message);
        }
        text + &self.verdict()
    }

    fn about_dataset(&self) -> Vec<String> {
        let names = self.dataset.files.iter().filter_map(|path| path.file_name());
        let names: Vec<_> = names.map(|name| name.to_string_lossy()).collect();
        vec![format!("{}: {}; {}", self.args.dataset.display(), names.join(", "), self.dataset.dialect)]
    }

    fn about_frames(&self) -> Vec<String> {
        let dataset = self.dataset;
        // Of the listed frames; damage may also be that of masks.
        let [there, lost] = if dataset.damaged.is_empty() {
            ["found", "missing"]
        } else {
            ["usable", "missing or unreadable"]
        };
        let mut listed = format!("{} listed, {} {there}", dataset.listed, problems::found(dataset));
        if !dataset.missing.is_empty() {
            listed += &format!(", {} {lost}", dataset.missing.len());
        }
        let same = !dataset.val.is_empty() && dataset.val == dataset.test;
        vec![format!(
            "{listed}; {} to train on, {} to validate, {} to test{}",
            dataset.train.len(),
            dataset.val.len(),
            dataset.test.len(),
            if same { " (the same)" } else { "" }
        )]
    }

    fn about_images(&self) -> Vec<String> {
        let dataset = self.dataset;
        let sizes: Vec<String> = (self.survey.optics.sizes.iter().take(4))
            .map(|([width, height], frames)| match self.survey.optics.sizes.len() {
                1 => format!("{width}x{height}"),
                _ => format!("{width}x{height} ({})", count(*frames, "frame")),
            })
            .collect();
        let more = if self.survey.optics.sizes.len() > sizes.len() { ", …" } else { "" };
        let number = |holds: fn(&Frame) -> bool| dataset.frames.iter().filter(|frame| holds(frame)).count();
        let alpha = match (number(|frame| frame.has_alpha), dataset.is_cutout) {
            (0, _) => "opaque".to_owned(),
            (frames, true) => format!("cut out by alpha in {}", count(frames, "frame")),
            (frames, false) => format!("alpha in {}, opaque in the first", count(frames, "frame")),
        };
        let beside = [("masks", number(|frame| frame.has_mask)), ("depth", number(|frame| frame.has_depth))];
        let beside = beside.map(|(what, frames)| match frames {
            0 => format!("no {what}"),
            frames if frames == dataset.frames.len() => format!("{what} for all"),
            frames => format!("{what} for {}", count(frames, "frame")),
        });
        vec![format!(
            "{}{more} pixels, {}; {alpha}; {}",
            sizes.join(", "),
            bits(dataset.bit_depth),
            beside.join(", ")
        )]
    }

    fn about_cameras(&self) -> Vec<String> {
        let optics = &self.survey.optics;
        let lenses = match &optics.lenses[..] {
            [(kind, _)] => format!("{} lens", kind.name()),
            several => {
                let each = several.iter().map(|(kind, frames)| format!("{} ({frames})", kind.name()));
                format!("lenses: {}", each.collect::<Vec<_>>().join(", "))
            }
        };
        let sets = count(self.dataset.distinct_cameras(), "set");
        let pixels = |value: f64| format!("{value:.1}");
        let degrees = |value: f64| format!("{value:.1}°");
        let [fx, fy] = optics.focal_px.map(|focal| focal.describe(pixels));
        let focal = if fx == fy { format!("{fx} px") } else { format!("{fx} px in x, {fy} px in y") };
        let [x, y] = optics.fov_degrees.map(|fov| fov.describe(degrees));
        vec![
            format!("{sets} of intrinsics; {lenses}; principal point {}", center(&optics.center_off)),
            format!("focal length {focal}"),
            format!("field of view {x} across, {y} down"),
        ]
    }

    fn about_box(&self) -> Vec<String> {
        let bounds = &self.dataset.bounds;
        let cubes = match bounds.cascades {
            1 => "one cube".to_owned(),
            cascades => format!("inner cube {} wide, {cascades} cascades", length(2.0 * bounds.half)),
        };
        vec![
            format!(
                "{} to {}, {} wide",
                point(bounds.min(), bounds.half),
                point(bounds.max(), bounds.half),
                length(2.0 * bounds.outer_half())
            ),
            format!("{cubes}; {}", bounds.source),
        ]
    }

    fn about_coverage(&self) -> Vec<String> {
        let coverage = &self.survey.coverage;
        let (outer, inner) = (coverage.outer(), coverage.inner());
        let mut line = format!("{} of the pictures look into the box", outer.describe(percent));
        if self.dataset.bounds.cascades > 1 {
            line += &format!(", {} into its inner cube", inner.describe(percent));
        }
        if self.dataset.bounds.is_guess {
            line += "; whether what they show lies in it is not known";
        }
        let mut lines = vec![line];
        if outer.min < 0.5 * outer.median {
            lines.push(format!("least in {}", self.names_in_text(&coverage.worst)));
        }
        lines
    }

    fn about_photos(&self) -> Vec<String> {
        let Some(gallery) = &self.gallery else { return Vec::new() };
        let relative = |value: f64, spread: &Spread| value / spread.median.max(f64::MIN_POSITIVE);
        let (sharpness, brightness) = (gallery.sharpness(), gallery.brightness());
        let stops = |value: f64| format!("{:+.1}", relative(value, &brightness).log2());
        let mut line = format!("{} decoded", gallery.looks.len());
        if sharpness.max > 0.0 {
            let [least, most] = [sharpness.min, sharpness.max].map(|value| relative(value, &sharpness));
            line += &format!("; sharpness {least:.1} to {most:.1} times the median");
        }
        if brightness.max > 0.0 {
            let [least, most] = [brightness.min, brightness.max].map(stops);
            line += &format!("; brightness {least} to {most} stops from the median");
        }
        match gallery.black() {
            0 => {}
            black if black == gallery.looks.len() => line += "; all are black",
            black => {
                let are = plural(black as u64, "is", "are");
                line += &format!(" of those that are not black; {black} {are}");
            }
        }
        vec![line]
    }

    fn about_masks(&self) -> Vec<String> {
        let masked = self.dataset.frames.iter().any(|frame| frame.has_mask);
        let Some(gallery) = self.gallery.as_ref().filter(|_| masked) else { return Vec::new() };
        let part = percent(gallery.ignored_part(self.dataset).unwrap_or(0.0));
        let each = gallery.ignored(self.dataset).describe(percent);
        vec![format!("ignore {part} of all pixels; {each} of a photo with a mask")]
    }

    fn about_depth(&self) -> Vec<String> {
        let Some(depth) = self.depth.as_ref().filter(|depth| !depth.looks.is_empty()) else {
            return Vec::new();
        };
        let mut line = format!(
            "{} read; known in {} of the pixels, {}",
            count(depth.looks.len(), "file"),
            percent(depth.known()),
            depth.range().describe(length)
        );
        if depth.far() > 0.0 {
            line += &format!("; {} of the values stand for far away, unknown", percent(depth.far()));
        }
        vec![line]
    }

    fn about_left_out(&self) -> Vec<String> {
        let parts = self.memory.iter().flat_map(|estimate| &estimate.left_out);
        let mut lines: Vec<String> = Vec::new();
        for part in parts {
            match lines.last_mut() {
                Some(line) if line.len() + part.len() < WIDTH => *line += &format!(", {part}"),
                _ => lines.push(part.clone()),
            }
        }
        lines
    }

    fn names_in_text(&self, frames: &[usize]) -> String {
        frames.iter().map(|&index| self.dataset.frames[index].name.as_str()).collect::<Vec<_>>().join(", ")
    }

    fn verdict(&self) -> String {
        let number = |severity| self.problems.iter().filter(|problem| problem.severity == severity).count();
        let (errors, warnings) = (number(Severity::Error), number(Severity::Warning));
        match (errors, warnings) {
            (0, 0) => "ready to train; nothing looks wrong".to_owned(),
            (0, warnings) => format!("training can begin; {}", count(warnings, "warning")),
            (errors, 0) => format!("training would fail; {}", count(errors, "error")),
            (errors, warnings) => {
                format!("training would fail; {}, {}", count(errors, "error"), count(warnings, "warning"))
            }
        }
    }
}

/// How finely pixels are stored.
pub(super) fn bits(depth: BitDepth) -> &'static str {
    match depth {
        BitDepth::Eight => "8-bit sRGB",
        BitDepth::Sixteen => "16-bit sRGB",
        BitDepth::Float => "scene-linear float",
    }
}

fn name(severity: Severity) -> &'static str {
    match severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
        Severity::Note => "note",
    }
}

/// Where principal points lie.
fn center([x, y]: &[Spread; 2]) -> String {
    let most = [x.min, x.max, y.min, y.max].into_iter().fold(0.0, |most: f64, off| most.max(off.abs()));
    if most < 5e-4 {
        return "in the middle".to_owned();
    }
    let side = |off: f64, before: &str, after: &str| {
        let way = if off < 0.0 { before } else { after };
        format!("{:.1} % {way}", 100.0 * off.abs())
    };
    let typical = format!("{}, {}", side(x.median, "left", "right"), side(y.median, "above", "below"));
    match x.max - x.min < 5e-4 && y.max - y.min < 5e-4 {
        true => format!("{typical} of the middle"),
        false => format!("typically {typical} of the middle, at most {}", percent(most)),
    }
}

fn about_view_directions(directions: &ViewDirections, views: usize) -> Vec<String> {
    let focus = point(directions.focus, directions.distance.median);
    if views == 1 {
        return vec![format!(
            "a single camera; taken for what it looks at: {focus}, {} away",
            length(directions.distance.median)
        )];
    }
    let focus = match directions.meets {
        true => format!("the optical axes meet near {focus}"),
        false => format!("the optical axes do not meet; taken for the focus: {focus}"),
    };
    let mut lines =
        vec![focus, format!("distance of the cameras from it {}", directions.distance.describe(length))];
    lines.push(format!(
        "{} of the cameras see it; their axes pass it at {} of the distance, at worst {}",
        percent(directions.seeing),
        percent(directions.miss.median),
        percent(directions.miss.max)
    ));
    lines.push(match directions.arrangement {
        Arrangement::Single => "a single camera".to_owned(),
        Arrangement::Parallel { within_degrees } => {
            format!("all look the same way, within {within_degrees:.1}°")
        }
        Arrangement::Facing { within_degrees } => {
            format!("all look from one side, within {within_degrees:.0}° of their mean")
        }
        Arrangement::Around { covered_degrees, elevation_degrees: [low, high] } => {
            format!("seen from {covered_degrees:.0}° around and {low:.0}° to {high:.0}° above")
        }
        Arrangement::Scattered => "they look outwards or past each other".to_owned(),
    });
    lines
}

fn about_memory(estimate: &Estimate) -> Vec<String> {
    let Estimate { memory, adapter, is_cpu, most_photo_bytes, finest, .. } = estimate;
    let device = match (adapter, is_cpu) {
        (Some(name), true) => format!("{name}, whose memory is the host's"),
        (Some(name), false) => name.clone(),
        (None, _) => "a GPU".to_owned(),
    };
    let room = most_photo_bytes.map_or_else(String::new, |most| {
        format!("; room for {} times as many", short(most as f64 / memory.photo_bytes.max(1) as f64))
    });
    vec![
        format!("{} on {device}", bytes(memory.device_bytes)),
        format!("of which the photos take {}{room}", bytes(memory.photo_bytes)),
        format!("{} on the host besides, while loading", bytes(memory.host_bytes)),
        format!("the finest level of the grid has {finest} cells along an axis"),
    ]
}
