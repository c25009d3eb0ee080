//! The tolerance asked for against the error got, for many gases, meshes, views and tolerances, as
//! the program plans its rays and warns.

use super::Context;
use super::accuracy_resample::tetrahedra;
use super::closed_form_gases::{Formula, GASES, deflections};
use super::test_section::{check_cancelled, oblique, tiles, traced};
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use datasets::model::{Attributes, DataArray, Dataset, Points, RectilinearGrid, Values};
use glam::DVec3;
use schlieren::field::Field;
use schlieren::path::{PathQuantities, Start};
use schlieren::render::TestSection;
use schlieren::scene::Scene;
use schlieren::view::{Axis as ViewAxis, View};

/// How the gas is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum MeshKind {
    /// A lattice with so many nodes per axis.
    Lattice(usize),
    /// A lattice with uneven spacing: nodes are twice as dense at one side as at the other.
    Stretched(usize),
    /// Tetrahedra over so many points per axis, moved by a wave and at random.
    Tetrahedra(usize),
}

impl MeshKind {
    fn name(self) -> String {
        match self {
            MeshKind::Lattice(n) => format!("lattice {n}³"),
            MeshKind::Stretched(n) => format!("stretched {n}³"),
            MeshKind::Tetrahedra(n) => format!("tetrahedra {n}³"),
        }
    }

    /// The gas on the mesh, between the lenses.
    fn section(self, scene: &Scene, eps: Formula) -> anyhow::Result<TestSection> {
        let named = |values: Vec<f64>| Attributes {
            point: vec![DataArray::new("n", 1, Values::F64(values))],
            ..Attributes::default()
        };
        let data = match self {
            MeshKind::Lattice(n) => {
                let h = 1.0 / (n - 1) as f64;
                let field = Field::from_fn([n; 3], [h; 3], DVec3::splat(-0.5), 1.0, eps)?;
                return Ok(TestSection::of_fields(scene, vec![field], None)?);
            }
            MeshKind::Stretched(n) => {
                let axis: Vec<f64> = (0..n)
                    .map(|i| {
                        let t = i as f64 / (n - 1) as f64;
                        (2.0 * t + t * t) / 3.0 - 0.5
                    })
                    .collect();
                let mut values = Vec::with_capacity(n * n * n);
                for &z in &axis {
                    for &y in &axis {
                        values.extend(axis.iter().map(|&x| eps(DVec3::new(x, y, z))));
                    }
                }
                let last = n as i32 - 1;
                Dataset::RectilinearGrid(RectilinearGrid {
                    extent: [0, last, 0, last, 0, last],
                    coordinates: [axis.clone(), axis.clone(), axis],
                    attributes: named(values),
                })
            }
            MeshKind::Tetrahedra(n) => {
                let mut grid = tetrahedra(n);
                if let Points::F64(points) = &grid.points {
                    grid.attributes = named(points.iter().map(|p| eps(DVec3::from(*p))).collect());
                }
                Dataset::UnstructuredGrid(grid)
            }
        };
        Ok(TestSection::of_dataset(scene, &data, None)?)
    }
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("gas", "", "name of the formula (closed_form_gases.rs)");
    record.column("mesh", "", "how its values are given, with points per axis");
    record.column("view", "", "along an axis of the lattice, or 0.6 rad off two of them");
    record.column("asked", "rad", "tolerance asked for");
    record.column("march", "", "what the plan chose");
    record.column("measured", "rad", "error of the march that the plan measured");
    record.column("lattice", "rad", "error of the lattice that the plan estimated");
    record.column("mesh_error", "rad", "error of the mesh that the plan estimated");
    record.column("warned", "", "whether a warning said that the tolerance is not kept");
    record.column("promised", "rad", "the tolerance, or with a warning the error that it names");
    record.column("got", "rad", "largest true error of all rays");
    record.column("rays", "", "rays compared");
    record.column("kept", "", "whether what was got is within what was promised");
    let meshes: &[MeshKind] = if context.quick {
        &[MeshKind::Lattice(33), MeshKind::Tetrahedra(17)]
    } else {
        &[
            MeshKind::Lattice(49),
            MeshKind::Lattice(64),
            MeshKind::Lattice(128),
            MeshKind::Stretched(64),
            MeshKind::Tetrahedra(49),
        ]
    };
    let tolerances: &[f64] =
        if context.quick { &[1e-5, 1e-7] } else { &[1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9] };
    let every = if context.quick { 5 } else { 1 };
    record.notes.push(
        "The truth is an adaptive march in f64 through the formula, without a lattice. Rays cover \
         the middle of the image, 0.9 m wide. What is promised is the tolerance, unless the \
         program warns that it cannot be kept; then it is the error that the warning names."
            .into(),
    );
    for (i, gas) in GASES.iter().enumerate().step_by(every) {
        context.report_step(format!("{} of {}: {}", i + 1, GASES.len(), gas.name))?;
        for (name, view) in [("z", View::along(ViewAxis::Z, DVec3::ZERO)), ("oblique", oblique()?)]
        {
            let starts = tiles(if context.quick { 12 } else { 24 }, 0.9);
            let truth = deflections(gas.eps, &view, &starts);
            for mesh in meshes {
                check_cancelled(context)?;
                let mut rows = of_mesh(*mesh, gas.eps, view, tolerances, &starts, &truth)?;
                for row in &mut rows {
                    *row = std::mem::take(row).with("gas", gas.name).with("view", name);
                }
                record.rows.extend(rows);
            }
        }
    }
    record.plots.push(plot(&record.rows, meshes));
    record.notes.push(describe(&record.rows));
    Ok(())
}

/// The rows of a gas on a mesh in a view.
fn of_mesh(
    mesh: MeshKind,
    eps: Formula,
    view: View,
    tolerances: &[f64],
    starts: &[Start],
    truth: &[Option<[f64; 2]>],
) -> anyhow::Result<Vec<Row>> {
    let toml = "[flow]\nfile = \"\"\nn_minus_1 = \"n\"\nreference_n_minus_1 = 0.0";
    let mut scene = Scene::from_toml(toml)?;
    let mut section = mesh.section(&scene, eps)?.with_caches();
    section.view = view;
    let mut rows = vec![];
    for &asked in tolerances {
        scene.march.tolerance_rad = asked;
        let planned = section.paths(&scene, 0, PathQuantities::default(), false, true)?;
        let exits = traced(&*planned.paths, starts);
        let (mut got, mut rays) = (0.0f64, 0u32);
        for (exit, truth) in exits.iter().zip(truth) {
            let Some(truth) = truth else { continue };
            let off = [0, 1].map(|c| f64::from(exit.deflection_rad[c]) - truth[c]);
            let off = off[0].hypot(off[1]);
            got = if off.is_nan() { f64::NAN } else { got.max(off) };
            rays += 1;
        }
        let warned = !planned.warnings.is_empty();
        let told: f64 = [planned.error_rad, planned.resolution_error_rad, planned.mesh_error_rad]
            .into_iter()
            .flatten()
            .sum();
        let promised = if warned { asked.max(told) } else { asked };
        rows.push(
            Row::new()
                .with("mesh", mesh.name())
                .with("asked", asked)
                .with("march", planned.description.as_str())
                .with("measured", planned.error_rad)
                .with("lattice", planned.resolution_error_rad)
                .with("mesh_error", planned.mesh_error_rad)
                .with("warned", if warned { "yes" } else { "no" })
                .with("promised", promised)
                .with("got", got)
                .with("rays", rays)
                .with("kept", if got <= promised { "yes" } else { "no" }),
        );
    }
    Ok(rows)
}

/// For each mesh and promise, the largest error of any gas and view.
fn plot(rows: &[Row], meshes: &[MeshKind]) -> Plot {
    let mut plot = Plot::lines(
        "Error promised against error got",
        Axis::log("error promised: the tolerance, or what a warning names", "rad"),
        Axis::log("largest error got", "rad"),
    );
    let decade = |v: f64| 10f64.powf((v.log10() * 2.0).ceil() / 2.0);
    for mesh in meshes {
        let mut points: Vec<(f64, f64)> = vec![];
        for row in rows.iter().filter(|r| r.text("mesh") == Some(&mesh.name())) {
            let Some((promised, got)) = row.number("promised").zip(row.number("got")) else {
                continue;
            };
            let x = decade(promised);
            match points.iter_mut().find(|p| p.0 == x) {
                Some(p) => p.1 = p.1.max(got),
                None => points.push((x, got)),
            }
        }
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        plot.series.push(Series::new(mesh.name(), points));
    }
    let ends = [1e-9, 1e-3].map(|v| (v, v));
    plot.series.push(Series::new("what was promised", ends.to_vec()));
    plot
}

/// How many promises were kept, mesh by mesh, and the worst that was not.
fn describe(rows: &[Row]) -> String {
    let mut names: Vec<&str> = vec![];
    for name in rows.iter().filter_map(|r| r.text("mesh")) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let words: Vec<String> = names
        .into_iter()
        .map(|mesh| {
            let of: Vec<&Row> = rows.iter().filter(|r| r.text("mesh") == Some(mesh)).collect();
            let kept = of.iter().filter(|r| r.text("kept") == Some("yes")).count();
            let warned = of.iter().filter(|r| r.text("warned") == Some("yes")).count();
            let ratio = |r: &&&Row| {
                r.number("got").unwrap_or(f64::NAN) / r.number("promised").unwrap_or(f64::NAN)
            };
            let worst = of.iter().max_by(|a, b| ratio(a).total_cmp(&ratio(b)));
            let worst = worst.map_or(String::new(), |r| {
                format!(
                    ", {:.2} of the promise at worst ({}, view {}, {:e} asked)",
                    ratio(&r),
                    r.text("gas").unwrap_or("?"),
                    r.text("view").unwrap_or("?"),
                    r.number("asked").unwrap_or(f64::NAN)
                )
            });
            format!("{mesh}: {kept} of {} kept, {warned} with a warning{worst}", of.len())
        })
        .collect();
    words.join(". ") + "."
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;

    /// The last degree of the polynomials between the points of a mesh tells too little of those
    /// beyond it where the mesh hardly resolves the flow: 1.3 times as much was got as promised.
    #[test]
    fn a_shock_steeper_than_its_tetrahedra_are_wide_is_no_worse_than_promised() {
        let gas = GASES.iter().find(|g| g.name == "steep shock").unwrap();
        let view = View::along(ViewAxis::Z, DVec3::ZERO);
        let starts = tiles(24, 0.9);
        let truth = deflections(gas.eps, &view, &starts);
        let mesh = MeshKind::Tetrahedra(49);
        for row in of_mesh(mesh, gas.eps, view, &[1e-4, 1e-8], &starts, &truth).unwrap() {
            assert_eq!(row.text("kept"), Some("yes"), "{row:?}");
            let [promised, got] = ["promised", "got"].map(|key| row.number(key).unwrap());
            assert!(promised < 2.0 * got, "{promised:e} is no bound for {got:e}");
        }
    }

    #[test]
    fn promises_are_kept_and_columns_are_explained() {
        let mut record = Record::new("accuracy-tolerance", "", 5, true, Machine::describe());
        let mut progress = |_: &str, _: Option<f64>| Ok(());
        let mut context = Context::new(true, None, &mut progress);
        run(&mut context, &mut record).unwrap();
        assert_eq!(record.rows.len(), 6 * 2 * 2 * 2);
        assert!(record.unexplained_columns().is_empty());
        for row in &record.rows {
            assert_eq!(row.text("kept"), Some("yes"), "{row:?}");
        }
    }
}
