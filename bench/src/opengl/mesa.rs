//! Frames of a mesh by Mesa's software rasteriser alone: what a build or a traced frame is set against (figures 4.7 and 4.9).

use super::programs::find;
use super::{Display, Program, Session, Way, write};
use rt_core::mesh::TriMesh;
use std::sync::Arc;
use tempfile::TempDir;

/// An X server without a screen, and a program that keeps its mesh in buffers of the driver, so that its frames are the driver's.
pub struct Mesa {
    display: Display,
    programs: Vec<Program>,
    dir: TempDir,
}

impl Mesa {
    /// Those of this machine; else what is missing, each with its cure.
    pub fn find() -> Result<Mesa, Vec<String>> {
        let mut missing = Vec::new();
        let programs = [Program::Vtk, Program::Gmsh, Program::ParaView];
        let programs: Vec<Program> =
            programs.into_iter().filter(|p| p.find().map_err(|m| missing.push(m)).is_ok()).collect();
        if !programs.is_empty() {
            missing.clear();
        }
        let xvfb = find("RTSV_XVFB", "/usr/bin/Xvfb");
        if xvfb.is_none() {
            missing.push("Xvfb: install xvfb, or name it in RTSV_XVFB".to_string());
        }
        let Some(xvfb) = xvfb.filter(|_| !programs.is_empty()) else { return Err(missing) };
        let started = Display::start(&xvfb).and_then(|d| Ok((d, tempfile::tempdir()?)));
        let (display, dir) = started.map_err(|e| vec![format!("Xvfb: {e:#}")])?;
        Ok(Mesa { display, programs, dir })
    }

    /// A program that draws `mesh`, a frame whenever it is asked, and its name. The mesh fills a window of `size_px` pixels a side,
    /// and turns by some degrees from frame to frame. The error says what each program said that would not start.
    pub fn draw(&self, mesh: &Arc<TriMesh>, size_px: u32) -> anyhow::Result<(&'static str, Session)> {
        let mut faults = Vec::new();
        for &program in &self.programs {
            let data = self.dir.path().join("mesh").with_extension(program.format().extension());
            write(mesh, program.format(), &data)?;
            let dir = self.dir.path().join(program.name().replace(' ', "-"));
            let started = Session::start(program, Way::Llvmpipe, None, &self.display, &dir, &data, size_px);
            std::fs::remove_file(&data)?;
            match started {
                Ok(mut session) => {
                    // The first may still send buffers.
                    session.frames(1)?;
                    return Ok((program.name(), session));
                }
                Err(fault) => faults.push(format!("{fault:#}")),
            }
        }
        anyhow::bail!("no program draws by llvmpipe: {}", faults.join("; "))
    }
}
