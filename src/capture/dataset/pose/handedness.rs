//! Files whose rotations are mirrored: determinant -1 where a rotation has +1.

use anyhow::{Result, ensure};
use glam::DAffine3;

use crate::capture::dataset::listing::{FrameEntry, Listing};
use crate::capture::dataset::notes::Notes;
use crate::capture::focus::{FocusKind, OpticalAxis, find};
use crate::support::format::few;

/// Makes one reading of all poses of a dataset's files. Where nearly all are mirrored, that is how they are meant,
/// and there are two ways to mean it: right, up, back in a left-handed world, which is kept; or right, up,
/// forward in a right-handed one, as game engines have it, whose third axis is turned round. The second is
/// taken where the third axes meet in front of the cameras. Where few are mirrored, they are left out.
pub(in crate::capture::dataset) fn settle(listings: &mut [Listing], notes: &mut Notes) -> Result<()> {
    let all: Vec<&FrameEntry> = listings.iter().flat_map(|listing| &listing.frames).collect();
    let mirrored: Vec<&&FrameEntry> = all.iter().filter(|entry| is_mirrored(entry)).collect();
    let count = all.len();
    let Some(first) = mirrored.first() else {
        return Ok(());
    };
    let majority = 10 * mirrored.len() >= 9 * count;
    ensure!(
        majority || 10 * mirrored.len() <= count,
        "{} of {count} matrices are mirrored (determinant -1), beginning with {}; expected all or \
         none, with the columns right, up, back; export the cameras by one rule",
        mirrored.len(),
        first.label
    );
    leave_out(&all, !majority, notes);
    listings.iter_mut().for_each(|listing| listing.frames.retain(|entry| is_mirrored(entry) == majority));
    if !majority {
        return Ok(());
    }
    let entries = || listings.iter().flat_map(|listing| &listing.frames);
    if meet_in_front(&entries().collect::<Vec<_>>()) {
        for entry in listings.iter_mut().flat_map(|listing| &mut listing.frames) {
            entry.world_from_camera.matrix3.z_axis *= -1.0;
        }
        notes.warn(
            "the matrices are mirrored (determinant -1) and their third columns meet in front of the cameras: \
             they are read as right, up, forward, and the third column is turned round",
        );
    } else {
        notes.warn(
            "the matrices are mirrored (determinant -1): they are read as right, up, back in a left-handed \
             world, which is kept",
        );
    }
    Ok(())
}

fn is_mirrored(entry: &FrameEntry) -> bool {
    entry.world_from_camera.matrix3.determinant() < 0.0
}

/// Names the few frames that differ from the others, and so are dropped.
fn leave_out(entries: &[&FrameEntry], mirrored: bool, notes: &mut Notes) {
    let odd: Vec<&str> =
        entries.iter().filter(|e| is_mirrored(e) == mirrored).map(|e| e.label.as_str()).collect();
    if odd.is_empty() {
        return;
    }
    let verb = if odd.len() == 1 { "is" } else { "are" };
    let handed = format!("{verb} {}mirrored", if mirrored { "" } else { "not " });
    notes.warn(format!(
        "{} of the frames {handed}, unlike the others, and left out: {}; export them again",
        odd.len(),
        few(&odd)
    ));
}

/// Whether the third columns of the poses meet in front of the cameras. Two cameras do not tell, nor do those that see
/// everything around them.
fn meet_in_front(entries: &[&FrameEntry]) -> bool {
    if entries.len() < 3 || entries.iter().any(|entry| entry.intrinsics.is_whole_sphere()) {
        return false;
    }
    let pose = |entry: &&FrameEntry| entry.world_from_camera;
    let axis = |pose: DAffine3| OpticalAxis::along(pose.translation, pose.matrix3.z_axis);
    let axes: Vec<OpticalAxis> = entries.iter().map(pose).map(axis).collect();
    let focus = find(&axes);
    let ahead = axes.iter().filter(|axis| axis.along_and_across(focus.point).0 > 0.0);
    focus.kind == FocusKind::Crossing && 10 * ahead.count() >= 8 * axes.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::dataset::transforms::{parse, parse_alone};

    /// Cameras on a circle whose third column points along `outward` times the way out.
    fn ring(count: u32, outward: f64, mirrored: impl Fn(u32) -> bool) -> Result<Listing> {
        parse(&file(count, outward, mirrored))
    }

    fn file(count: u32, outward: f64, mirrored: impl Fn(u32) -> bool) -> String {
        let frame = |index: u32| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(index) / f64::from(count)).sin_cos();
            let (bx, by) = (outward * cos, outward * sin);
            let side = if mirrored(index) { 1.0 } else { -1.0 };
            // right = side * (by, -bx, 0), up = z, back = (bx, by, 0).
            format!(
                "{{\"file_path\": \"{index}\", \"transform_matrix\": [{}, 0, {bx}, {}, {}, 0, {by}, {}, \
                 0, 1, 0, {}]}}",
                side * by,
                4.0 * cos,
                -side * bx,
                4.0 * sin,
                0.1 * f64::from(index % 3)
            )
        };
        let frames: Vec<_> = (0..count).map(frame).collect();
        format!("{{\"fl_x\": 9, \"frames\": [{}]}}", frames.join(","))
    }

    fn looks_inwards(entry: &FrameEntry) -> bool {
        let pose = entry.world_from_camera;
        pose.matrix3.z_axis.dot(pose.translation) > 3.0
    }

    fn messages(listing: Listing) -> String {
        listing.notes.finish().iter().map(|note| format!("{note}\n")).collect()
    }

    #[test]
    fn proper_rings_are_left_alone() {
        let listing = ring(12, 1.0, |_| false).expect("valid");
        assert!(listing.frames.iter().all(|entry| !is_mirrored(entry)));
        assert_eq!(messages(listing), "");
        assert_eq!(messages(ring(12, -1.0, |_| false).expect("valid")), "");
    }

    #[test]
    fn a_left_handed_world_is_kept() {
        let listing = ring(12, 1.0, |_| true).expect("valid");
        assert!(listing.frames.iter().all(is_mirrored));
        assert!(listing.frames.iter().all(looks_inwards));
        assert!(messages(listing).contains("left-handed world"));
    }

    #[test]
    fn a_forward_axis_is_turned_round() {
        let listing = ring(12, -1.0, |_| true).expect("valid");
        assert!(listing.frames.iter().all(|entry| !is_mirrored(entry)));
        assert!(listing.frames.iter().all(looks_inwards));
        assert!(messages(listing).contains("right, up, forward"));
    }

    #[test]
    fn a_few_odd_frames_are_left_out_and_many_refused() {
        let listing = ring(20, 1.0, |index| index == 7).expect("valid");
        assert_eq!(listing.frames.len(), 19);
        assert!(
            messages(listing)
                .contains("1 of the frames is mirrored, unlike the others, and left out: frame 7")
        );
        let listing = ring(20, 1.0, |index| index != 7).expect("valid");
        assert_eq!(listing.frames.len(), 19);
        let message = ring(20, 1.0, |index| index < 5).expect_err("refused").to_string();
        assert!(message.contains("5 of 20 matrices are mirrored"), "{message}");
    }

    /// Two test cameras do not tell by themselves which way they look.
    #[test]
    fn files_of_one_dataset_are_read_alike() {
        let read = |count| parse_alone(&file(count, -1.0, |_| true)).expect("valid");
        let mut listings = [read(12), read(2)];
        settle(&mut listings, &mut Notes::default()).expect("one rule");
        assert!(listings.iter().flat_map(|listing| &listing.frames).all(|entry| !is_mirrored(entry)));
        let alone = ring(2, -1.0, |_| true).expect("valid");
        assert!(alone.frames.iter().all(is_mirrored));
    }
}
