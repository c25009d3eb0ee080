//! Frames of a mesh by Mesa's software rasteriser alone: the baseline for a build or a ray traced
//! frame (figures 4.7 and 4.9).

use super::programs::find;
use super::{Backend, Cost, Display, Drawing, Program, Session, write};
use crate::clock::Sample;
use crate::record::Row;
use crate::stats::Summary;
use rt_core::mesh::TriMesh;
use std::sync::Arc;
use tempfile::TempDir;

/// An X server without a screen, and a program that keeps its mesh in buffers of the driver, so
/// that its frame time is the driver's.
pub struct Mesa {
    display: Display,
    programs: Vec<Program>,
    dir: TempDir,
}

impl Mesa {
    /// Finds the server and the programs on this machine. The error lists what is missing, each
    /// with its cure.
    pub fn find() -> Result<Mesa, Vec<String>> {
        let mut missing = Vec::new();
        let programs = [Program::Vtk, Program::Gmsh, Program::ParaView];
        let programs: Vec<Program> = programs
            .into_iter()
            .filter(|p| p.find().map_err(|m| missing.push(m)).is_ok())
            .collect();
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

    /// Starts a program that draws `mesh`, filling a window of `size_px` pixels a side and turning
    /// by some degrees from frame to frame. The error contains the messages of all programs that
    /// did not start.
    pub fn draw(&self, mesh: &Arc<TriMesh>, size_px: u32) -> anyhow::Result<MesaFrames> {
        let mut faults = Vec::new();
        for &program in &self.programs {
            let data = self.dir.path().join("mesh").with_extension(program.format().extension());
            write(mesh, program.format(), &data)?;
            let dir = self.dir.path().join(program.name().replace(' ', "-"));
            let drawing = Drawing { data: &data, size_px, view: None };
            let started =
                Session::start(program, Backend::Llvmpipe, None, &self.display, &dir, drawing);
            std::fs::remove_file(&data)?;
            match started {
                Ok(mut session) => {
                    // The first frame may still upload buffers.
                    session.frames(1)?;
                    return Ok(MesaFrames { program: program.name(), session, costs: Vec::new() });
                }
                Err(fault) => faults.push(format!("{fault:#}")),
            }
        }
        anyhow::bail!("no program draws by llvmpipe: {}", faults.join("; "))
    }
}

/// A program that draws a mesh with llvmpipe, one frame per request, and the cost of its frames.
pub struct MesaFrames {
    program: &'static str,
    session: Session,
    costs: Vec<Cost>,
}

impl MesaFrames {
    /// Name of the renderer, for notes.
    pub fn name(&self) -> String {
        format!("llvmpipe ({})", self.program)
    }

    /// Draws `count` more frames.
    pub fn take(&mut self, count: usize) -> anyhow::Result<()> {
        for _ in 0..count {
            self.costs.push(self.session.frames(1)?);
        }
        Ok(())
    }

    /// Draws one more frame and returns its cost.
    pub fn frame(&mut self) -> anyhow::Result<Sample> {
        let cost = self.session.frames(1)?;
        let (wall_secs, process_cpu_secs) = (cost.wall_secs, cost.cpu_secs);
        Ok(Sample { wall_secs, process_cpu_secs, ..Sample::default() })
    }

    /// Ends the program without a row, for callers that keep the frame times themselves.
    pub fn close(self) -> anyhow::Result<()> {
        self.session.end().map(drop)
    }

    /// Ends the program. Adds to `row` the columns `time`, `time_low`, `time_high` and `cpu` of a
    /// frame; `per_second` is the number of their units in a second.
    pub fn end(self, row: Row, per_second: f64) -> anyhow::Result<Row> {
        self.session.end()?;
        let of =
            |f: &dyn Fn(&Cost) -> f64| Summary::of(&self.costs.iter().map(f).collect::<Vec<_>>());
        let (Some(wall), Some(cpu)) = (of(&|c| c.wall_secs), of(&|c| c.cpu_secs)) else {
            return Ok(row);
        };
        Ok(row
            .with("time", wall.median * per_second)
            .with("time_low", wall.low * per_second)
            .with("time_high", wall.high * per_second)
            .with("cpu", cpu.median * per_second))
    }
}
