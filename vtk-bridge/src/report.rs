//! The report of a frame, and the file that `RTV_REPORT` names.

use rt_core::ray_stats::RayStats;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// An object that was ray traced.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TracedItem {
    /// Its name.
    pub name: String,
    /// Triangles in all copies together.
    pub triangles: usize,
    /// Cells of a volume.
    pub cells: u64,
    /// Number of copies.
    pub copies: usize,
}

/// An object that OpenGL draws.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UntracedItem {
    /// Its name.
    pub name: String,
    /// Why it is not traced.
    pub reason: String,
}

/// Milliseconds by phase.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Milliseconds {
    /// Converting arrays to geometry and colours.
    pub extract: f64,
    /// Building acceleration structures.
    pub build: f64,
    /// Tracing rays and shading.
    pub trace: f64,
    /// Converting floating point to the window's format.
    pub convert: f64,
    /// The whole frame.
    pub frame: f64,
}

/// The report of one frame of one renderer.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct FrameReport {
    /// Number of frames so far.
    pub frame: u64,
    /// Who draws where the picture is the same either way, and why; empty if nobody asked.
    pub choice: String,
    /// What was ray traced.
    pub traced: Vec<TracedItem>,
    /// What OpenGL draws, and why.
    pub passed: Vec<UntracedItem>,
    /// Effects that ran.
    pub effects: Vec<String>,
    /// Cost of each effect: time with it minus time without it.
    pub ms_by_effect: Vec<(String, f64)>,
    /// Rays by kind.
    pub rays: Vec<(String, u64)>,
    /// Time by phase.
    pub ms: Milliseconds,
    /// Number of geometries that were rebuilt.
    pub rebuilt: u32,
    /// Bytes of acceleration structures.
    pub bytes: usize,
    /// True if nothing changed and the last image was shown again.
    pub reused: bool,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// Rays traced, by kind.
pub(crate) fn rays(r: &RayStats) -> Vec<(String, u64)> {
    let all = [
        ("primary", r.primary),
        ("shadow", r.shadow),
        ("ambient occlusion", r.ambient_occlusion),
        ("reflection", r.reflection),
        ("refraction", r.refraction),
        ("transparency", r.transparency),
    ];
    all.iter().filter(|(_, n)| *n > 0).map(|(k, n)| ((*k).to_owned(), *n)).collect()
}

/// Last reports of all renderers of the process, by number.
static RENDERERS: Mutex<BTreeMap<u64, FrameReport>> = Mutex::new(BTreeMap::new());

/// Writes the reports of all renderers that drew something. Each rank of a parallel program writes
/// its own file.
pub fn write(renderer: u64, report: &FrameReport, path: &str) -> std::io::Result<()> {
    #[derive(Serialize)]
    struct ReportFile<'a> {
        program: &'static str,
        version: &'static str,
        renderers: Vec<&'a FrameReport>,
    }
    let Ok(mut all) = RENDERERS.lock() else { return Ok(()) };
    all.insert(renderer, report.clone());
    let renderers = all.values().filter(|r| !r.traced.is_empty() || !r.passed.is_empty()).collect();
    let file = ReportFile { program: "vtk-bridge", version: env!("CARGO_PKG_VERSION"), renderers };
    let text = serde_json::to_string_pretty(&file).map_err(std::io::Error::other)?;
    let path = of_rank(Path::new(path), |name| std::env::var(name).ok());
    let beside = path.with_extension(format!("tmp{}", std::process::id()));
    std::fs::write(&beside, text + "\n")?;
    std::fs::rename(&beside, &path)
}

/// Removes a renderer that was destroyed.
pub fn forget(renderer: u64) {
    if let Ok(mut all) = RENDERERS.lock() {
        all.remove(&renderer);
    }
}

/// Variables in which Open MPI and MPICH give the number of ranks.
const RANKS: [&str; 2] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE"];

fn number(variable: impl Fn(&str) -> Option<String>, names: [&str; 2]) -> Option<u32> {
    names.iter().find_map(|n| variable(n)?.parse().ok())
}

/// The number of ranks of the program that this process belongs to.
pub(crate) fn ranks() -> u32 {
    number(|name| std::env::var(name).ok(), RANKS).unwrap_or(1)
}

/// `report.json` becomes `report.rank2.json` on rank 2 of several.
fn of_rank(path: &Path, variable: impl Fn(&str) -> Option<String>) -> PathBuf {
    let rank = number(&variable, ["OMPI_COMM_WORLD_RANK", "PMI_RANK"]);
    let size = number(&variable, RANKS);
    match (rank, size) {
        (Some(rank), Some(2..)) => {
            let extension =
                path.extension().map_or(String::new(), |e| format!(".{}", e.to_string_lossy()));
            path.with_extension(format!("rank{rank}{extension}"))
        }
        _ => path.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_write_files_of_their_own() {
        let mpi = |name: &str| match name {
            "OMPI_COMM_WORLD_RANK" => Some("2".to_owned()),
            "OMPI_COMM_WORLD_SIZE" => Some("4".to_owned()),
            _ => None,
        };
        assert_eq!(of_rank(Path::new("a/report.json"), mpi), Path::new("a/report.rank2.json"));
        assert_eq!(of_rank(Path::new("a/report.json"), |_| None), Path::new("a/report.json"));
    }
}
