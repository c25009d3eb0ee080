//! Light through the cells of a mesh against light through the lattice to which it is resampled:
//! error of deflections, time of a ray, and time until the first one.

use super::Context;
use super::accuracy_resample::tetrahedra;
use super::test_section::{
    blob, blob_deflections, check_cancelled, error_of, fingerprint, oblique, tiles, traced,
};
use crate::clock::Clock;
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use crate::runner::{Schedule, Variant, interleave};
use datasets::model::{Attributes, Cells, DataArray, Dataset, Points, UnstructuredGrid, Values};
use glam::DVec3;
use schlieren::march::OnCells;
use schlieren::path::{LightPaths, PathQuantities};
use schlieren::render::TestSection;
use schlieren::scene::Scene;
use schlieren::view::View;

/// Largest eps of the blob: a gas.
const AMPLITUDE: f64 = 1e-5;

/// VTK's number of a hexahedron.
const VTK_HEXAHEDRON: u8 = 12;

/// How light gets through the mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Way {
    /// Through its cells, in so many steps each.
    Cells(u32),
    /// Through a lattice of so many nodes along each axis, in steps of one voxel.
    Lattice(usize),
}

impl Way {
    fn name(self) -> &'static str {
        match self {
            Way::Cells(_) => "cells",
            Way::Lattice(_) => "lattice",
        }
    }

    fn scene(self) -> anyhow::Result<Scene> {
        let of_flow = match self {
            Way::Cells(_) => "on_cells = true\n".to_owned(),
            Way::Lattice(nodes) => format!(
                "resample_nodes = {nodes}\n[march]\nmethod = \"verlet\"\ninterpolant = \
                 \"b-spline\"\nstep_voxels = 1.0\n"
            ),
        };
        Ok(Scene::from_toml(&format!(
            "[flow]\nfile = \"\"\nn_minus_1 = \"n\"\nreference_n_minus_1 = 0.0\n{of_flow}"
        ))?)
    }

    /// The section of a mesh, and its paths along a view.
    fn paths<'a>(
        self,
        section: &'a TestSection,
        scene: &Scene,
        view: View,
    ) -> anyhow::Result<Box<dyn LightPaths + 'a>> {
        let quantities = PathQuantities::default();
        Ok(match (self, &section.cells[..]) {
            (Way::Cells(steps), [gas, ..]) => Box::new(OnCells::new(gas, view, quantities, steps)),
            _ => section.paths(scene, 0, quantities, false, false)?.paths,
        })
    }
}

/// A mesh with the blob at its points.
struct MeshOfBlob {
    name: String,
    cells: usize,
    data: Dataset,
}

impl MeshOfBlob {
    fn new(name: String, mut grid: UnstructuredGrid) -> anyhow::Result<MeshOfBlob> {
        let (gaussian, _) = blob(AMPLITUDE, 3)?;
        let two_squares = 2.0 * gaussian.sigma_m.powi(2);
        let eps =
            |p: &[f64; 3]| AMPLITUDE * (-DVec3::from(*p).length_squared() / two_squares).exp();
        let Points::F64(points) = &grid.points else { anyhow::bail!("{name}: points in f64") };
        let values = Values::F64(points.iter().map(eps).collect());
        grid.attributes =
            Attributes { point: vec![DataArray::new("n", 1, values)], ..Attributes::default() };
        Ok(MeshOfBlob { name, cells: grid.types.len(), data: Dataset::UnstructuredGrid(grid) })
    }
}

/// Bent hexahedra over the points of [`tetrahedra`].
fn hexahedra(n: usize) -> UnstructuredGrid {
    let mut cells = Cells::new();
    let id = |i: usize, j: usize, k: usize| (i + n * (j + n * k)) as u32;
    for k in 0..n - 1 {
        for j in 0..n - 1 {
            for i in 0..n - 1 {
                let layer =
                    |k| [id(i, j, k), id(i + 1, j, k), id(i + 1, j + 1, k), id(i, j + 1, k)];
                cells.push(layer(k).into_iter().chain(layer(k + 1)));
            }
        }
    }
    let types = vec![VTK_HEXAHEDRON; (n - 1).pow(3)];
    UnstructuredGrid { points: tetrahedra(n).points, cells, types, ..UnstructuredGrid::default() }
}

fn explain_columns(record: &mut Record) {
    record.column("mesh", "", "kind of the cells, with points per axis");
    record.column("cells", "", "number of cells");
    record.column("way", "", "through the cells, or through a lattice");
    record.column("steps", "", "steps in each cell");
    record.column("nodes", "", "nodes per axis of the lattice");
    record.column(
        "prepare",
        "ms",
        "wall time from the data set to the paths on all threads, median over rounds",
    );
    record.column("rounds", "", "rounds; all ways took turns in them");
    record.column("ray_time", "ns", "CPU time of one thread for a ray, median over rounds");
    record.column("ray_time_low", "ns", "fastest round");
    record.column("ray_time_high", "ns", "slowest round");
    record.column("rays", "1/s", "rays a second on one core");
    record.column("cells_per_ray", "", "cells that a ray crosses");
    record.column("rms_error", "rad", "root mean square error of the deflection");
    record.column("largest_error", "rad", "largest error of the deflection");
    record.column("relative_error", "", "largest error by the largest deflection");
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    explain_columns(record);
    let (points, lattices): (&[usize], &[usize]) =
        if context.quick { (&[25], &[33]) } else { (&[33, 65], &[33, 65, 129]) };
    let mut ways: Vec<Way> = [1, 2, 4].map(Way::Cells).into();
    ways.extend(lattices.iter().map(|n| Way::Lattice(*n)));
    context.report_step("the true deflections")?;
    let (gaussian, _) = blob(AMPLITUDE, 3)?;
    let view = oblique()?;
    let starts = tiles(if context.quick { 24 } else { 64 }, 0.5);
    let truth = blob_deflections(&gaussian, &view, &starts)?;
    let scale = truth.iter().map(|t| t[0].hypot(t[1])).fold(0.0, f64::max);
    for &n in points {
        for (kind, grid) in [("hexahedra", hexahedra(n)), ("tetrahedra", tetrahedra(n))] {
            let mesh = MeshOfBlob::new(format!("{kind} {n}³"), grid)?;
            context.report_step(mesh.name.clone())?;
            let scenes = ways.iter().map(|w| w.scene()).collect::<anyhow::Result<Vec<_>>>()?;
            let section = |scene: &Scene| -> anyhow::Result<TestSection> {
                Ok(TestSection::of_dataset(scene, &mesh.data, None)?)
            };
            let mut sections = vec![];
            for scene in &scenes {
                check_cancelled(context)?;
                let mut made = section(scene)?.with_caches();
                made.view = view;
                sections.push(made);
            }
            let mut variants: Vec<Variant<'_>> = scenes
                .iter()
                .enumerate()
                .map(|(i, scene)| {
                    let section = &section;
                    Variant::new(i.to_string(), move || {
                        section(scene).map_or(0, |s| s.size_m().x.to_bits())
                    })
                })
                .collect();
            let prepared =
                interleave(&context.schedule(Schedule::all_threads(), 2.0), &mut variants)?;
            drop(variants);
            let mut paths = vec![];
            for (way, (section, scene)) in ways.iter().zip(sections.iter().zip(&scenes)) {
                paths.push(way.paths(section, scene, view)?);
            }
            let mut variants: Vec<Variant<'_>> = paths
                .iter()
                .enumerate()
                .map(|(i, p)| {
                    let starts = &starts;
                    Variant::new(i.to_string(), move || fingerprint(&traced(&**p, starts)))
                })
                .collect();
            let timed = interleave(&context.schedule(Schedule::one_thread(), 2.0), &mut variants)?;
            drop(variants);
            check_cancelled(context)?;
            for (i, way) in ways.iter().enumerate() {
                let (rms, largest) = error_of(&traced(&*paths[i], &starts), &truth);
                let secs = timed.variants[i].summary(timed.clock);
                let per_ray = |t: f64| t / starts.len() as f64;
                let (steps, nodes, crossed) = match (*way, &sections[i].cells[..]) {
                    (Way::Cells(steps), [gas, ..]) => {
                        let counted = OnCells::new(gas, view, PathQuantities::default(), steps);
                        traced(&counted, &starts);
                        let c = counted.counters();
                        (Some(steps), None, Some(c.cells_crossed as f64 / c.rays.max(1) as f64))
                    }
                    _ => (None, sections[i].grid().map(|g| g[0]), None),
                };
                record.rows.push(
                    Row::new()
                        .with("mesh", mesh.name.as_str())
                        .with("cells", mesh.cells)
                        .with("way", way.name())
                        .with("steps", steps)
                        .with("nodes", nodes)
                        .with("prepare", 1e3 * prepared.variants[i].summary(Clock::Wall).median)
                        .with("rounds", timed.variants[i].samples.len())
                        .with("ray_time", 1e9 * per_ray(secs.median))
                        .with("ray_time_low", 1e9 * per_ray(secs.low))
                        .with("ray_time_high", 1e9 * per_ray(secs.high))
                        .with("rays", 1.0 / per_ray(secs.median))
                        .with("cells_per_ray", crossed)
                        .with("rms_error", rms * scale)
                        .with("largest_error", largest * scale)
                        .with("relative_error", largest),
                );
            }
        }
    }
    record.notes.push(format!(
        "A blob of eps {AMPLITUDE:e} and sigma 0.08 m in a cube of 1 m, given at the points of \
         meshes whose inner points are moved by a wave of 0.02 m and at random by up to 0.1 of \
         their distance, seen 0.6 rad off the axes. The truth is an adaptive march in f64 through \
         the blob itself; its largest deflection is {scale:.2e} rad."
    ));
    record.plots.push(plot(&record.rows));
    Ok(())
}

/// Error against the time of a ray: a line for each mesh and way.
fn plot(rows: &[Row]) -> Plot {
    let mut plot = Plot::lines(
        "Cells and lattices: time of a ray against error",
        Axis::log("time of a ray", "ns"),
        Axis::log("largest error of the deflection", "rad"),
    );
    let mut lines: Vec<(String, Vec<(f64, f64)>)> = vec![];
    for row in rows {
        let (Some(mesh), Some(way)) = (row.text("mesh"), row.text("way")) else { continue };
        let Some(point) = row.number("ray_time").zip(row.number("largest_error")) else { continue };
        let name = format!("{mesh}, {way}");
        match lines.iter_mut().find(|l| l.0 == name) {
            Some((_, points)) => points.push(point),
            None => lines.push((name, vec![point])),
        }
    }
    plot.series = lines.into_iter().map(|(name, points)| Series::new(name, points)).collect();
    plot
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;

    #[test]
    fn both_ways_are_as_accurate_as_the_mesh_allows_and_columns_are_explained() {
        let mut record = Record::new("accuracy-cells", "", 5, true, Machine::describe());
        let mut progress = |_: &str, _: Option<f64>| Ok(());
        let mut context = Context::new(true, None, &mut progress);
        run(&mut context, &mut record).unwrap();
        assert_eq!(record.rows.len(), 2 * 4);
        assert!(record.unexplained_columns().is_empty());
        for row in &record.rows {
            let error = row.number("relative_error").unwrap();
            assert!(error < 0.1, "{row:?}");
            let crosses = row.number("cells_per_ray").is_none_or(|c| c > 8.0);
            assert!(crosses && row.number("rays").unwrap() > 0.0, "{row:?}");
        }
        assert_eq!(record.plots[0].series.len(), 4);
    }
}
