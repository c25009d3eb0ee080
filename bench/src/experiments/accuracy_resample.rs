//! Error of deflections against the lattice to which an unstructured mesh is resampled, and the
//! time of resampling and of a ray, for a blob whose deflections are known.

use super::Context;
use super::test_section::{
    blob, blob_deflections, check_cancelled, error_of, fingerprint, oblique, tiles, traced,
};
use crate::clock::Clock;
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use crate::runner::{Schedule, Variant, interleave};
use anyhow::ensure;
use datasets::model::{Attributes, Cells, Dataset, Points, UnstructuredGrid};
use datasets::resample::{Lattice, Mesh, Options, Reconstruction, Resolution, Samples, resample};
use glam::DVec3;
use rt_core::math::SplitMix64;
use schlieren::field::Field;
use schlieren::interpolate::Interpolant;
use schlieren::march::{BlankCells, LineOfSight};
use schlieren::path::PathQuantities;
use schlieren::view::View;
use std::f64::consts::{PI, TAU};

/// Largest eps of the blob: a gas.
const AMPLITUDE: f64 = 1e-5;

/// The row of lattices that are sampled from the closed form, without a mesh.
const NO_MESH: &str = "none";

/// The ways to compute the value of a node, with its samples per axis.
const WAYS: [(Reconstruction, usize); 3] =
    [(Reconstruction::Cubic, 1), (Reconstruction::Linear, 1), (Reconstruction::Linear, 2)];

/// VTK's number of a tetrahedron.
const VTK_TETRA: u8 = 10;

/// A way to make a lattice.
struct Case<'a> {
    /// Points per axis of the mesh; `None` for the closed form.
    mesh: Option<(usize, &'a Mesh, &'a [f64])>,
    lattice: Lattice,
    reconstruction: Reconstruction,
    samples_per_axis: usize,
    auto: bool,
}

impl Case<'_> {
    fn mesh_name(&self) -> String {
        self.mesh.map_or(NO_MESH.into(), |m| format!("{0}³", m.0))
    }

    fn nodes(&self) -> usize {
        self.lattice.dims[0]
    }

    /// The field on the lattice, and the error that the resampling reports, as part of the range.
    fn field(&self) -> anyhow::Result<(Field, Option<f64>)> {
        let Some((_, mesh, values)) = self.mesh else {
            return Ok((blob(AMPLITUDE, self.nodes())?.1, None));
        };
        let Lattice { dims, origin, spacing } = self.lattice;
        let Case { samples_per_axis, reconstruction, .. } = *self;
        let options = Options { samples_per_axis, reconstruction };
        let on = resample(mesh, Samples::Points(values), &self.lattice, &options)?;
        ensure!(
            on.report.inside == self.lattice.len(),
            "{} of {} nodes are outside the mesh",
            self.lattice.len() - on.report.inside,
            self.lattice.len()
        );
        let reported = on.report.resampling_error.rms / on.report.resampling_error.range;
        Ok((Field::new(dims, spacing.to_array(), origin, on.values, 1.0, None)?, Some(reported)))
    }
}

fn explain_columns(record: &mut Record) {
    record.column("mesh", "", "points of the mesh of tetrahedra; `none` for the closed form");
    record.column("cells", "", "tetrahedra");
    record.column("reconstruction", "", "how values between the points of the mesh are computed");
    record.column("samples_per_axis", "", "samples per axis and node of the lattice");
    record.column("nodes", "", "nodes per axis of the lattice");
    record.column("auto", "", "whether this is the lattice of the default resolution");
    record.column("time", "ms", "wall time of the resampling on all threads, median over rounds");
    record.column("time_low", "ms", "fastest round");
    record.column("time_high", "ms", "slowest round");
    record.column("rounds", "", "rounds; all lattices took turns in them");
    record.column("ray_time", "ns", "CPU time of one thread for a ray, median over rounds");
    record.column("rms_error", "rad", "root mean square error of the deflection");
    record.column("largest_error", "rad", "largest error of the deflection");
    record.column("relative_error", "", "rms error by the largest deflection");
    record.column(
        "reported",
        "",
        "error that the resampling reports: the lattice against the values of the mesh, rms, as \
         part of their range",
    );
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    explain_columns(record);
    let (meshes, lattices): (&[usize], &[usize]) = if context.quick {
        (&[17, 33], &[17, 25, 33, 49])
    } else {
        (&[33, 65], &[17, 25, 33, 41, 49, 65, 81, 97, 129])
    };
    compare(context, record, meshes, lattices)
}

fn compare(
    context: &mut Context<'_>,
    record: &mut Record,
    meshes: &[usize],
    lattices: &[usize],
) -> anyhow::Result<()> {
    let (gaussian, _) = blob(AMPLITUDE, 3)?;
    let eps = |p: DVec3| AMPLITUDE * (-0.5 * p.length_squared() / gaussian.sigma_m.powi(2)).exp();
    context.report_step("making the meshes")?;
    let mut made = vec![];
    for &points in meshes {
        let mesh = Mesh::new(&Dataset::UnstructuredGrid(tetrahedra(points)))?;
        let values: Vec<f64> = (0..mesh.num_points()).map(|i| eps(mesh.point(i))).collect();
        made.push((points, mesh, values));
    }
    let fit = |typical_cell: f64, resolution| {
        Lattice::fit(DVec3::splat(-0.5), DVec3::splat(0.5), typical_cell, resolution)
    };
    let mut cases: Vec<Case<'_>> = vec![];
    for &n in lattices {
        let lattice = fit(1.0, Resolution::Longest(n))?;
        let reconstruction = Reconstruction::default();
        cases.push(Case { mesh: None, lattice, reconstruction, samples_per_axis: 1, auto: false });
    }
    for (points, mesh, values) in &made {
        let mesh_of = Some((*points, mesh, values.as_slice()));
        let auto = fit(mesh.typical_cell(), Resolution::Auto)?;
        let mut all = vec![(auto, true)];
        for &n in lattices {
            let lattice = fit(1.0, Resolution::Longest(n))?;
            if lattice.dims != auto.dims {
                all.push((lattice, false));
            }
        }
        all.sort_by_key(|l| l.0.dims);
        for (reconstruction, samples_per_axis) in WAYS {
            for &(lattice, auto) in &all {
                cases.push(Case { mesh: mesh_of, lattice, reconstruction, samples_per_axis, auto });
            }
        }
    }

    context.report_step("the true deflections")?;
    let view = oblique()?;
    let starts = tiles(if context.quick { 32 } else { 64 }, 0.5);
    let truth = blob_deflections(&gaussian, &view, &starts)?;
    let scale = truth.iter().map(|t| t[0].hypot(t[1])).fold(0.0, f64::max);
    record.notes.push(format!(
        "A blob of eps {AMPLITUDE:e} and sigma 0.08 m in a cube of 1 m, given at the points of \
         meshes of tetrahedra, whose inner points are moved by a wave of 0.02 m and at random by up \
         to 0.1 of their distance. Deflections are those of line of sight with the cubic B-spline, seen 0.6 rad \
         off the axes; the truth is an adaptive march in f64 through the blob itself, its largest \
         deflection is {scale:.2e} rad."
    ));
    context.report_step(format!("{} lattices in turns", cases.len()))?;
    let mut resampled = vec![];
    for case in &cases {
        check_cancelled(context)?;
        resampled.push(case.field()?);
    }
    let mut variants: Vec<Variant<'_>> = cases
        .iter()
        .enumerate()
        .map(|(i, case)| {
            // The first value of the error stands for all: it depends on every node near a point.
            Variant::new(i.to_string(), move || {
                case.field().map_or(0, |f| f.1.map_or(0, f64::to_bits))
            })
        })
        .collect();
    let times = interleave(&context.schedule(Schedule::all_threads(), 4.0), &mut variants)?;
    drop(variants);
    check_cancelled(context)?;
    let paths: Vec<LineOfSight> =
        resampled.iter().map(|(field, _)| line_of_sight(field, view)).collect();
    let mut variants: Vec<Variant<'_>> = paths
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let starts = &starts;
            Variant::new(i.to_string(), move || fingerprint(&traced(p, starts)))
        })
        .collect();
    let rays = interleave(&context.schedule(Schedule::one_thread(), 2.0), &mut variants)?;
    drop(variants);

    for (i, (case, (_, reported))) in cases.iter().zip(&resampled).enumerate() {
        let (rms, largest) = error_of(&traced(&paths[i], &starts), &truth);
        // What is timed without a mesh is not a resampling.
        let time = Some(times.variants[i].summary(Clock::Wall)).filter(|_| case.mesh.is_some());
        let ray_secs = rays.variants[i].summary(rays.clock).median / starts.len() as f64;
        record.rows.push(
            Row::new()
                .with("mesh", case.mesh_name())
                .with("cells", case.mesh.map(|m| m.1.num_cells()))
                .with("reconstruction", case.reconstruction.name())
                .with("samples_per_axis", case.samples_per_axis)
                .with("nodes", case.nodes())
                .with("auto", if case.auto { "yes" } else { "no" })
                .with("time", time.map(|t| t.median * 1e3))
                .with("time_low", time.map(|t| t.low * 1e3))
                .with("time_high", time.map(|t| t.high * 1e3))
                .with("rounds", times.variants[i].samples.len())
                .with("ray_time", ray_secs * 1e9)
                .with("rms_error", rms * scale)
                .with("largest_error", largest * scale)
                .with("relative_error", rms)
                .with("reported", *reported),
        );
    }
    plots(record);
    record.notes.push(describe(&record.rows));
    Ok(())
}

fn line_of_sight(field: &Field, view: View) -> LineOfSight {
    let wanted = PathQuantities::default();
    LineOfSight::new(field, view, Interpolant::BSpline, wanted, BlankCells::Opaque)
}

/// The names of the meshes, in the order of the rows.
fn mesh_names(rows: &[Row]) -> Vec<&str> {
    let mut names: Vec<&str> = vec![];
    for name in rows.iter().filter_map(|r| r.text("mesh")) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

fn plots(record: &mut Record) {
    let mut by_nodes = Plot::lines(
        "Nodes of the lattice against error",
        Axis::log("nodes per axis", ""),
        Axis::log("rms error of the deflection", "rad"),
    );
    let mut by_time = Plot::lines(
        "Time of the resampling against error",
        Axis::log("time", "ms"),
        Axis::log("rms error of the deflection", "rad"),
    );
    for mesh in mesh_names(&record.rows) {
        for (reconstruction, samples) in WAYS {
            let of = |r: &&Row| {
                r.text("mesh") == Some(mesh)
                    && r.text("reconstruction") == Some(reconstruction.name())
                    && r.number("samples_per_axis") == Some(samples as f64)
            };
            let points = |x: &str| -> Vec<(f64, f64)> {
                let rows = record.rows.iter().filter(of);
                rows.filter_map(|r| r.number(x).zip(r.number("rms_error"))).collect()
            };
            let name = match (mesh, samples) {
                (NO_MESH, _) => "closed form".to_owned(),
                (mesh, 1) => format!("mesh of {mesh} points, {}", reconstruction.name()),
                (mesh, _) => format!(
                    "mesh of {mesh} points, {}, {samples}³ samples per node",
                    reconstruction.name()
                ),
            };
            for (plot, x) in [(&mut by_nodes, "nodes"), (&mut by_time, "time")] {
                let points = points(x);
                if !points.is_empty() {
                    plot.series.push(Series::new(name.clone(), points));
                }
            }
        }
    }
    record.plots.extend([by_nodes, by_time]);
}

/// The error of the default resolution beside the least of any lattice, mesh by mesh.
fn describe(rows: &[Row]) -> String {
    let words: Vec<String> = mesh_names(rows)
        .into_iter()
        .filter(|m| *m != NO_MESH)
        .filter_map(|mesh| {
            let of = |r: &&Row| {
                let cubic = Some(Reconstruction::Cubic.name());
                r.text("mesh") == Some(mesh) && r.text("reconstruction") == cubic
            };
            let auto = rows.iter().filter(of).find(|r| r.text("auto") == Some("yes"))?;
            let error = |r: &Row| r.number("relative_error");
            let best = rows.iter().filter(of).min_by(|a, b| {
                error(a).unwrap_or(f64::NAN).total_cmp(&error(b).unwrap_or(f64::NAN))
            })?;
            Some(format!(
                "mesh of {mesh} points: {} nodes per axis, {:.1e} in {:.0} ms; the best lattice \
                 has {} nodes, {:.1e} in {:.0} ms",
                auto.number("nodes")?,
                error(auto)?,
                auto.number("time")?,
                best.number("nodes")?,
                error(best)?,
                best.number("time")?
            ))
        })
        .collect();
    format!("The default resolution, rms error by the largest deflection: {}.", words.join(". "))
}

/// A cube of 1 m around the origin of tetrahedra over `points`³ points. Inner points are moved by a
/// wave of 0.02 m and at random by up to 0.1 of their distance along each axis, which turns no
/// tetrahedron inside out.
pub(super) fn tetrahedra(points: usize) -> UnstructuredGrid {
    let mut random = SplitMix64::new(3);
    let spacing = 1.0 / (points - 1) as f64;
    let mut places = vec![];
    for k in 0..points {
        for j in 0..points {
            for i in 0..points {
                let even = DVec3::new(i as f64, j as f64, k as f64) * spacing - 0.5;
                // No layer of points stays level, so that no lattice has its nodes on them.
                let wave =
                    |along: f64, across: f64| 0.02 * (PI * along).cos() * (TAU * across).sin();
                let mut moved = even
                    + DVec3::new(
                        wave(even.x, even.y + 0.1),
                        wave(even.y, even.z + 0.3),
                        wave(even.z, even.x + 0.2),
                    );
                for (axis, c) in [i, j, k].into_iter().enumerate() {
                    if c > 0 && c + 1 < points {
                        moved[axis] += random.between(-0.1, 0.1) * spacing;
                    } else {
                        moved[axis] = even[axis];
                    }
                }
                places.push(moved.to_array());
            }
        }
    }
    // Each cube is divided into six tetrahedra around its diagonal, one for each order of the axes
    // (Kuhn 1960). Odd orders are mirrored.
    const ORDERS: [([usize; 3], bool); 6] = [
        ([0, 1, 2], true),
        ([1, 2, 0], true),
        ([2, 0, 1], true),
        ([0, 2, 1], false),
        ([2, 1, 0], false),
        ([1, 0, 2], false),
    ];
    let stride = [1, points, points * points];
    let mut ids = vec![];
    for k in 0..points - 1 {
        for j in 0..points - 1 {
            for i in 0..points - 1 {
                let first = i + j * stride[1] + k * stride[2];
                for (order, even) in ORDERS {
                    let a = first + stride[order[0]];
                    let b = a + stride[order[1]];
                    let last = b + stride[order[2]];
                    let [a, b] = if even { [a, b] } else { [b, a] };
                    ids.extend([first, a, b, last].map(|id| id as u32));
                }
            }
        }
    }
    let cells = Cells::uniform(4, ids);
    UnstructuredGrid {
        points: Points::F64(places),
        types: vec![VTK_TETRA; cells.len()],
        cells,
        attributes: Attributes::default(),
        ..Default::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;

    #[test]
    fn tetrahedra_fill_the_cube_and_none_is_inside_out() {
        let grid = tetrahedra(9);
        let Points::F64(points) = &grid.points else { panic!("points in f64") };
        let at = |id: u32| DVec3::from(points[id as usize]);
        let volumes: Vec<f64> = grid
            .cells
            .iter()
            .map(|c| {
                let [a, b, d] = [1, 2, 3].map(|i| at(c[i]) - at(c[0]));
                a.cross(b).dot(d) / 6.0
            })
            .collect();
        assert_eq!(volumes.len(), 6 * 8 * 8 * 8);
        assert!(volumes.iter().all(|v| *v > 0.0));
        assert!((volumes.iter().sum::<f64>() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_finer_lattice_helps_until_the_mesh_decides() {
        let mut record = Record::new("accuracy-resample", "", 5, true, Machine::describe());
        explain_columns(&mut record);
        let mut progress = |_: &str, _: Option<f64>| Ok(());
        let mut context = Context::new(true, None, &mut progress);
        compare(&mut context, &mut record, &[17, 25], &[13, 33]).unwrap();
        let by = |reconstruction: &str, mesh: &str, nodes: f64| {
            let of = |r: &&Row| {
                r.text("mesh") == Some(mesh)
                    && r.text("reconstruction") == Some(reconstruction)
                    && r.number("nodes") == Some(nodes)
                    && r.number("samples_per_axis") == Some(1.0)
            };
            record.rows.iter().find(of).and_then(|r| r.number("relative_error")).unwrap()
        };
        let error = |mesh: &str, nodes: f64| by("cubic", mesh, nodes);
        assert!(error(NO_MESH, 33.0) < 0.1 * error(NO_MESH, 13.0));
        for mesh in ["17³", "25³"] {
            assert!(error(mesh, 33.0) < error(mesh, 13.0), "{mesh}");
            assert!(error(mesh, 33.0) < 0.7 * by("linear", mesh, 33.0), "{mesh}");
        }
        // The lattice of 33 nodes resolves the blob better than either mesh, and the finer mesh
        // better than the coarser one.
        assert!(error(NO_MESH, 33.0) < 0.3 * error("25³", 33.0));
        assert!(error("25³", 33.0) < error("17³", 33.0));
        let autos = record.rows.iter().filter(|r| r.text("auto") == Some("yes")).count();
        assert_eq!(autos, 6, "one for each mesh and way");
        assert!(record.notes.iter().any(|n| n.contains("mesh of 25³ points: ")));
        assert!(record.unexplained_columns().is_empty());
    }
}
