//! From rendered views to the files of frames.

use super::Job;
use super::frame_folder::FrameFolder;
use crate::cli::{Format, PictureBackground, Render};
use anyhow::Result;
use nerf::capture::image_file::{ExrPixels, Precision, write_exr, write_png_rgba8};
use nerf::field::renderer::View;
use nerf::photo::color_space::{ColorSpace, depth_srgb8, opaque_srgb8};
use serde_json::{Map, Value, json};
use std::sync::{Mutex, PoisonError};

/// How rendered views become files. Several threads may write views at the same time.
pub(super) struct Writer<'a> {
    args: &'a Render,
    color_space: ColorSpace,
    /// Depths that are white and black in depth pictures, in world units.
    depth_range: [f64; 2],
    folder: Mutex<FrameFolder>,
}

impl<'a> Writer<'a> {
    pub(super) fn new(
        args: &'a Render,
        color_space: ColorSpace,
        depth_range: [f64; 2],
        folder: FrameFolder,
    ) -> Self {
        Self { args, color_space, depth_range, folder: Mutex::new(folder) }
    }

    /// Writes the files of a view and lists them.
    pub(super) fn write(&self, job: &Job, view: &View) -> Result<()> {
        let (stem, args) = (format!("{:04}", job.index), self.args);
        let mut files = Map::new();
        if args.format.contains(&Format::Png) {
            let pixels = match args.background {
                PictureBackground::Transparent => self.color_space.straight_srgb8(&view.color),
                PictureBackground::Color(color) => opaque_srgb8(&self.color_space.over(&view.color, color)),
            };
            files.insert("png".to_owned(), self.write_png(format!("{stem}.png"), view, &pixels)?);
        }
        if args.format.contains(&Format::Exr) {
            let file = format!("{stem}.exr");
            let color = self.color_space.linear(&view.color);
            let depth = self.depth(view);
            let pixels = ExrPixels { color: &color, depth: Some(&depth) };
            let precision = if args.half { Precision::Half } else { Precision::Float };
            write_exr(&args.out.join(&file), view.width, view.height, &pixels, precision)?;
            files.insert("exr".to_owned(), json!(file));
        }
        if args.depth {
            let mut pixels = depth_srgb8(&self.depth(view), &view.color, self.depth_range.map(|z| z as f32));
            if args.far_depth.is_some() {
                let empty = pixels.iter_mut().zip(&view.depth).filter(|(_, depth)| **depth == 0.0);
                empty.for_each(|(pixel, _)| pixel[3] = u8::MAX);
            }
            files.insert("depth".to_owned(), self.write_png(format!("{stem}_depth.png"), view, &pixels)?);
        }
        let frame = json!({
            "index": job.index,
            "source": job.source,
            "width": view.width,
            "height": view.height,
            "spp": job.samples,
            "files": files,
        });
        self.folder.lock().unwrap_or_else(PoisonError::into_inner).add(job.index, frame)
    }

    /// Lists the frames that are not listed yet.
    pub(super) fn flush(&self) -> Result<()> {
        self.folder.lock().unwrap_or_else(PoisonError::into_inner).flush()
    }

    /// The depth of every pixel, where there is none as asked for.
    fn depth(&self, view: &View) -> Vec<f32> {
        let far = self.args.far_depth.unwrap_or(0.0);
        view.depth.iter().map(|&depth| if depth > 0.0 { depth } else { far }).collect()
    }

    fn write_png(&self, file: String, view: &View, pixels: &[[u8; 4]]) -> Result<Value> {
        write_png_rgba8(&self.args.out.join(&file), view.width, view.height, pixels)?;
        Ok(Value::String(file))
    }
}
