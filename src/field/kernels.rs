//! From a plan to kernels that run.

use super::{Link, Plan, Workspace, shared};
use crate::gpu::Gpu;
use crate::gpu::kernel::Kernel;
use crate::gpu::pass::Stage;
use crate::support::file::{writable_folder, write_atomically};
use anyhow::Result;
use std::io::Write;
use std::path::Path;

impl Plan {
    /// A kernel behind the plan's constants, its structs compared with Rust's. The folder that the environment variable
    /// NERF_DUMP_SHADERS names gets its text.
    ///
    /// # Errors
    /// As [`Kernel::new`], or when that folder cannot be written to.
    pub fn kernel(&self, gpu: &Gpu, link: &Link) -> Result<Kernel> {
        let source = self.source(link)?;
        if let Some(folder) = std::env::var_os("NERF_DUMP_SHADERS") {
            let path = Path::new(&folder).join(format!("{}.wgsl", link.label().replace(' ', "_")));
            writable_folder(Path::new(&folder))?;
            write_atomically(&path, |file| Ok(file.write_all(source.text().as_bytes())?))?;
        }
        Kernel::new(gpu, &source, shared::LAYOUTS)
    }

    /// A kernel over a count that the device knows, one of [`dispatch`], bound to what it uses.
    pub(crate) fn stage(&self, gpu: &Gpu, workspace: &Workspace, link: &Link, over: usize) -> Result<Stage> {
        workspace.stage(workspace.bind(gpu, &self.kernel(gpu, link)?, &[])?, over)
    }
}
