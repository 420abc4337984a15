//! Damaged files and masks: all of them are told, and what a training would refuse is an error.

use super::toys::{Toys, info};
use serde_json::json;
use std::fs;

impl Toys {
    /// Gives every training frame a mask `masks/<index>.png` that `mask_path` names, all of one colour.
    fn add_masks(&self, grey: u8) {
        let folder = self.path().join("m");
        fs::create_dir_all(&folder).expect("writable");
        self.edit("train", |file| {
            for (index, frame) in file["frames"].as_array_mut().expect("a list").iter_mut().enumerate() {
                frame["mask_path"] = json!(format!("m/{index}.png"));
                let mask = image::GrayImage::from_pixel(64, 64, image::Luma([grey]));
                mask.save(folder.join(format!("{index}.png"))).expect("writable");
            }
        });
    }
}

#[test]
fn masks_that_leave_nothing_to_train_on_are_an_error() {
    let toys = Toys::new();
    toys.add_masks(0);
    toys.info().expect(1, "error", &["every pixel of all", "training photos", "--invert-masks"], &[]);
    assert_eq!(info(&toys.path(), &["--invert-masks"]).of_severity("error"), [""; 0]);
}
