//! Light through the cells of meshes, without a lattice, against closed forms and references.

mod bells;
mod common;
mod program;

use bells::{BLOB, cell_averages, hexahedra, options, stretched, tetrahedra};
use common::{grid, oblique};
use datasets::model::{Attributes, Cells, DataArray, Dataset, Points, UnstructuredGrid, Values};
use glam::DVec3;
use schlieren::analytic::Gaussian;
use schlieren::gas_on_cells::GasOnCells;
use schlieren::input::{Options, Reference, Role, cells_from_dataset};
use schlieren::march::{DormandPrince, Medium as _, OnCells, Ray};
use schlieren::path::{Exit, LightPaths, PathQuantities, Start, Status};
use schlieren::render::{Control, Layers, TestSection, render};
use schlieren::scene::Scene;
use schlieren::view::{Axis, View};

const OPD: PathQuantities = PathQuantities { opd: true };

/// The reference index is 1, as in the closed forms.
fn absolute() -> Options {
    Options { reference: Reference::Given { n_minus_1: 0.0 }, ..options() }
}

fn gas(data: &Dataset, options: &Options) -> GasOnCells {
    cells_from_dataset(data, options).expect("the mesh has cells").0
}

fn traced(gas: &GasOnCells, view: View, starts: &[Start]) -> Vec<Exit> {
    let mut exits = vec![Exit::UNDISTURBED; starts.len()];
    OnCells::new(gas, view, OPD, 1).trace_parallel(starts, &mut exits);
    exits
}

/// The same data with all values of `eps` times `factor`.
fn times(mut data: Dataset, factor: f64) -> Dataset {
    let attributes = data.attributes_mut().expect("one mesh");
    for array in attributes.point.iter_mut().chain(&mut attributes.cell) {
        let values = (0..array.tuples()).map(|i| factor * array.get(i, 0)).collect();
        array.values = Values::F64(values);
    }
    data
}

/// Largest error of deflections along z by the largest deflection, and that of the optical path.
fn errors(gas: &GasOnCells) -> [f64; 2] {
    let view = View::along(Axis::Z, DVec3::ZERO);
    let starts = grid(160, 0.96);
    let exits = traced(gas, view, &starts);
    let (mut worst, mut largest) = ([0.0f64; 2], [0.0f64; 2]);
    for (start, exit) in starts.iter().zip(&exits) {
        assert_eq!(exit.status, Status::Free, "{start:?}");
        let [x, y] = start.position_m.map(f64::from);
        let truth = BLOB.deflection_rad(x, y, 0.5);
        let error: [f64; 2] = [0, 1].map(|c| f64::from(exit.deflection_rad[c]) - truth[c]);
        let path = BLOB.path_difference_m(x, y, 0.5);
        worst[0] = worst[0].max(error[0].hypot(error[1]));
        worst[1] = worst[1].max((f64::from(exit.opd_m) - path).abs());
        largest[0] = largest[0].max(truth[0].hypot(truth[1]));
        largest[1] = largest[1].max(path);
    }
    [worst[0] / largest[0], worst[1] / largest[1]]
}

#[test]
fn meshes_give_the_deflections_of_a_bell() {
    for (name, data, bound) in [
        ("hexahedra, 65³ points", hexahedra(65), 2e-3),
        ("cells, 64³ averages", cell_averages(64), 2e-3),
        ("stretched structured grid, 40³ points", stretched(40), 2e-3),
        // Moved so far that some are inside out.
        ("irregular tetrahedra, 31³ points", tetrahedra(31), 2e-3),
    ] {
        let [deflection, path] = errors(&gas(&data, &absolute()));
        println!("{name}: deflection {deflection:.2e}, optical path {path:.2e}");
        assert!(deflection <= bound && path <= 2e-3, "{name}: {deflection:.2e} {path:.2e}");
    }
}

/// n − 1 of 3e-4, that of air, from none to all: rays bend, so the reference is an integrator.
#[test]
fn deflections_of_usual_flows_are_within_a_microradian() {
    let bell = Gaussian { amplitude: 3e-4, ..BLOB };
    let view = oblique();
    for (name, data) in [
        ("hexahedra", hexahedra(65)),
        ("cells", cell_averages(64)),
        ("stretched", stretched(40)),
        ("tetrahedra", tetrahedra(31)),
    ] {
        let gas = gas(&times(data, 30.0), &absolute());
        let starts = grid(24, 0.5);
        let mut worst = 0.0f64;
        for (start, exit) in starts.iter().zip(traced(&gas, view, &starts)) {
            let [x, y] = start.position_m.map(f64::from);
            let at = view.right * x + view.up * y;
            // Where the line is in the cube of 1 m around the origin.
            let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
            for a in 0..3 {
                let ends = [-0.5, 0.5].map(|side| (side - at[a]) / view.forward[a]);
                (near, far) = (near.max(ends[0].min(ends[1])), far.min(ends[0].max(ends[1])));
            }
            let ray = Ray::inside(&bell, at + view.forward * near, view.forward);
            let integrator = DormandPrince { tolerance: 1e-13, longest_step_m: 0.05 };
            let end = integrator.run(&bell, &ray, far - near).expect("a smooth medium").ray;
            let truth = [end.u.dot(view.right), end.u.dot(view.up)];
            let error: [f64; 2] = [0, 1].map(|c| f64::from(exit.deflection_rad[c]) - truth[c]);
            worst = worst.max(error[0].hypot(error[1]));
        }
        println!("{name}: {worst:.2e} rad");
        assert!(worst <= 1e-6, "{name}: {worst:.2e} rad");
    }
}

/// A cube of 1 m of hexahedra with points moved by `f`, and eps of `eps` at its points.
fn cube(n: usize, moved: impl Fn(DVec3) -> DVec3, eps: impl Fn(DVec3) -> f64) -> UnstructuredGrid {
    let Dataset::UnstructuredGrid(mut grid) = hexahedra(n) else { panic!("hexahedra") };
    let Points::F64(points) = &mut grid.points else { panic!("points in f64") };
    for p in points.iter_mut() {
        *p = moved(DVec3::from(*p)).to_array();
    }
    let values = points.iter().map(|p| eps(DVec3::from(*p))).collect();
    grid.attributes = Attributes {
        point: vec![DataArray::new("eps", 1, Values::F64(values))],
        ..Default::default()
    };
    grid
}

#[test]
fn linear_and_quadratic_fields_bend_light_as_they_should_on_bent_cells() {
    let wave = |p: DVec3| {
        let inside = (0.5 - p.abs().max_element()).max(0.0);
        p + 0.3 * inside * DVec3::new((7.0 * p.y).sin(), (9.0 * p.z).cos(), (8.0 * p.x).sin())
    };
    let starts = grid(50, 0.9);
    let view = View::along(Axis::Z, DVec3::ZERO);
    type Value = fn(DVec3) -> f64;
    type Slope = fn(f64, f64) -> [f64; 2];
    let fields: [(&str, Value, Slope); 2] = [
        ("linear", |p| 1e-5 * (p.x - 2.0 * p.y), |_, _| [1e-5, -2e-5]),
        (
            "quadratic",
            |p| 1e-5 * (p.x * p.x + p.x * p.y - p.y * p.z),
            |x, y| [1e-5 * (2.0 * x + y), 1e-5 * x],
        ),
    ];
    for (name, eps, slope) in fields {
        let data = Dataset::UnstructuredGrid(cube(17, wave, eps));
        let gas = gas(&data, &absolute());
        let mut worst = 0.0f64;
        for (start, exit) in starts.iter().zip(traced(&gas, view, &starts)) {
            let [x, y] = start.position_m.map(f64::from);
            let truth = slope(x, y);
            for c in 0..2 {
                worst = worst.max((f64::from(exit.deflection_rad[c]) - truth[c]).abs());
            }
        }
        println!("{name}: {worst:.1e} rad of 2e-5");
        // Rounding of polynomials in f32, and bending of order eps².
        assert!(worst < 2e-10, "{name}: {worst:.1e}");
    }
}

#[test]
fn the_exits_are_the_same_bits_for_any_number_of_threads_and_order() {
    let gas = gas(&tetrahedra(13), &absolute());
    let starts = grid(40, 1.1);
    let of = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| traced(&gas, oblique(), &starts))
    };
    let bits = |exits: &[Exit]| -> Vec<[u32; 6]> {
        let of = |e: &Exit| {
            let ([a, b], [c, d]) = (e.deflection_rad, e.displacement_m);
            [a, b, c, d, e.opd_m, e.transmission].map(f32::to_bits)
        };
        exits.iter().map(of).collect()
    };
    let one = bits(&of(1));
    assert_eq!(one, bits(&of(3)));
    // One by one, backwards, without what other rays left prepared.
    let alone: Vec<Exit> = starts
        .iter()
        .rev()
        .map(|s| common::trace(&OnCells::new(&gas, oblique(), OPD, 1), &[*s])[0])
        .collect();
    let mut alone = bits(&alone);
    alone.reverse();
    assert_eq!(one, alone);
}

/// The cube without its cells within 0.2 of the axis along y.
fn with_hole() -> Dataset {
    let mut grid = cube(21, |p| p, |p| 1e-5 * p.x);
    let Points::F64(points) = &grid.points else { panic!("points in f64") };
    let mut cells = Cells::new();
    for cell in grid.cells.iter() {
        let sum: DVec3 = cell.iter().map(|&i| DVec3::from(points[i as usize])).sum();
        let middle = sum / 8.0;
        if middle.x.abs() > 0.2 || middle.z.abs() > 0.2 {
            cells.push(cell.iter().copied());
        }
    }
    grid.types.truncate(cells.len());
    grid.cells = cells;
    Dataset::UnstructuredGrid(grid)
}

#[test]
fn a_hole_is_what_its_role_says_and_rays_enter_again_behind_it() {
    let starts =
        [-0.31, -0.1, 0.0, 0.17, 0.33].map(|x| Start { position_m: [x, 0.05], tilt_rad: [0.0; 2] });
    let through = [false, true, true, true, false];
    for (role, status) in
        [(Role::Blank, Status::Masked), (Role::Solid, Status::Blocked), (Role::Gas, Status::Free)]
    {
        let gas = gas(&with_hole(), &Options { outside: role.into(), ..absolute() });
        let exits = traced(&gas, View::along(Axis::Z, DVec3::ZERO), &starts);
        for (exit, through) in exits.iter().zip(through) {
            let expected = if through { status } else { Status::Free };
            assert_eq!(exit.status, expected, "{role:?} {exit:?}");
            if exit.status == Status::Free {
                // 0.4 of the way is through the hole.
                let length = if through { 0.6 } else { 1.0 };
                let error = f64::from(exit.deflection_rad[0]) - 1e-5 * length;
                assert!(error.abs() < 1e-10, "{exit:?}");
            }
        }
    }
}

#[test]
fn rays_that_miss_the_mesh_are_undisturbed_and_the_box_counts_as_outside() {
    // A ball's worth of the cube: the corners of the box are outside the mesh.
    let round = |p: DVec3| p * (p.abs().max_element() / p.length().max(1e-12));
    let data = Dataset::UnstructuredGrid(cube(13, round, |_| 1e-5));
    let view = View::along(Axis::Z, DVec3::ZERO);
    let start = |x: f32, y: f32| Start { position_m: [x, y], tilt_rad: [0.0; 2] };
    let starts = [start(0.0, 0.0), start(0.3, 0.0), start(0.45, 0.45), start(0.6, 0.0)];
    let of = |outside: Role| {
        let gas = gas(&data, &Options { outside: outside.into(), ..absolute() });
        traced(&gas, view, &starts).iter().map(|e| e.status).collect::<Vec<_>>()
    };
    use Status::{Free, Masked};
    assert_eq!(of(Role::Gas), [Free; 4]);
    assert_eq!(of(Role::Blank), [Free, Masked, Masked, Free]);
    let (_, report) = cells_from_dataset(&data, &absolute()).unwrap();
    let warned = report.warnings.iter().any(|w| w.contains("--outside"));
    assert!(warned, "{:?}", report.warnings);
}

#[test]
fn pictures_of_cells_and_of_a_fine_lattice_agree() {
    let data = hexahedra(33);
    let picture = |more: &str| {
        let text = format!(
            "[flow]\nfile = \"\"\nn_minus_1 = \"eps\"\n{more}\n[film]\nsize = [48, 48]\n\
             [technique]\nkind = \"schlieren\"\n[sampling]\nmethod = \"beams\"\n"
        );
        let scene = Scene::from_toml(&text).unwrap();
        let section = TestSection::of_dataset(&scene, &data, None).unwrap();
        render(&scene, &section, Layers::ALL, &Control::default()).unwrap()
    };
    let (cells, lattice) = (picture("on_cells = true"), picture("resample_nodes = 97"));
    let worst = cells
        .pixels
        .iter()
        .zip(&lattice.pixels)
        .map(|(a, b)| (a[0] - b[0]).abs())
        .fold(0.0, f32::max);
    assert!(worst < 0.01, "{worst}");
    assert!(cells.report.march.starts_with("verlet on cells"), "{}", cells.report.march);
    let work = cells.report.cells.expect("counters of cells");
    // Some of the rays are beside the mesh.
    assert!(work.rays > 2000 && work.cells_crossed > 10 * work.rays, "{work:?}");
    assert!(work.moved_on < work.rays / 100, "{work:?}");
    assert!(lattice.report.cells.is_none());
    assert!(cells.report.deflection_error_rad.is_some_and(|e| e < 1e-7));
}

/// Steps that are finer than the mesh's own error shows would only take longer: four times as long
/// on a coarse mesh.
#[test]
fn steps_in_cells_are_no_finer_than_the_mesh_shows() {
    let toml = "[flow]\nfile = \"\"\nn_minus_1 = \"n\"\non_cells = true\n[march]\ntolerance_rad = ";
    for (points, tolerance) in [(9, "1e-9"), (65, "1e-12")] {
        let scene = Scene::from_toml(&format!("{toml}{tolerance}\n")).unwrap();
        let gas = gas(&times(hexahedra(points), 30.0), &absolute());
        let section = TestSection::of_cells(&scene, vec![gas], None).unwrap();
        let planned = section.paths(&scene, 0, OPD, false, true).unwrap();
        let of_march = planned.error_rad.unwrap();
        let of_mesh = planned.mesh_error_rad.unwrap();
        let told = format!("{points}: {}, {of_march:e}, {of_mesh:e}", planned.description);
        assert!(planned.description.contains("one step"), "{told}");
        // A warning names what cannot be had.
        assert!(planned.warnings.iter().any(|w| w.contains("mesh")), "{:?}", planned.warnings);
        assert!(of_march <= 0.1 * of_mesh, "{told}");
    }
}

#[test]
fn what_a_lattice_has_is_refused_on_cells() {
    let data = hexahedra(9);
    for options in [
        Options { smoothing_nodes: 1.0, ..options() },
        Options { samples_per_axis: 2, ..options() },
        Options { depth: Some(schlieren::input::Depth::Revolve), ..options() },
        Options { resolution: datasets::resample::Resolution::Longest(33), ..options() },
        Options { bounds: Some([DVec3::ZERO, DVec3::ONE]), ..options() },
    ] {
        let message = cells_from_dataset(&data, &options).err().unwrap().to_string();
        assert!(message.contains("cells themselves"), "{message}");
    }
}

/// BLOB as a medium is used through the trait.
#[test]
fn the_bell_of_the_meshes_is_the_one_of_the_closed_form() {
    let Dataset::UnstructuredGrid(grid) = hexahedra(5) else { panic!("hexahedra") };
    let eps = &grid.attributes.point[0];
    assert_eq!(eps.get(62, 0), BLOB.sample(DVec3::ZERO).0);
}

#[test]
fn the_program_traces_on_cells_and_says_what_it_did() {
    use program::{schlieren, text};
    let folder = tempfile::tempdir().unwrap();
    let [file, png] = ["mesh.vtu", "image.png"].map(|n| folder.path().join(n));
    let options = datasets::write::VtkOptions::default();
    datasets::write::write_vtk(&file, &tetrahedra(9), options).unwrap();
    let [file, png] = [&file, &png].map(|p| p.to_str().unwrap());
    let render = ["render", file, "--n-minus-1", "eps", "--size", "32x32", "--on-cells"];
    let run = |more: &[&str]| schlieren(&[&render[..], more].concat());

    let output = run(&["-o", png, "--json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(json["grid"].is_null(), "{json}");
    let cells = &json["cells"];
    assert_eq!((&cells["cells"], &cells["left_out"]), (&3072.into(), &0.into()), "{cells}");
    let moved_on = cells["work"]["moved_on"].as_u64().unwrap();
    assert!(moved_on < cells["work"]["rays"].as_u64().unwrap() / 100, "{cells}");
    let crossed = cells["work"]["cells_crossed"].as_u64().unwrap();
    assert!(crossed > 5 * cells["work"]["rays"].as_u64().unwrap(), "{cells}");
    assert!(json["march"].as_str().unwrap().contains("cells"), "{json}");

    let mut refused = vec![&["--resample", "64"][..], &["--smoothing", "1"], &["--revolve"]];
    if cfg!(feature = "gpu") {
        refused.push(&["--device", "gpu"]);
    }
    for more in refused {
        let output = run(&[more, &["-o", png]].concat());
        let message = text(&output.stderr);
        assert!(!output.status.success(), "{more:?}: {message}");
        assert!(message.contains(more[0]) && message.contains("--on-cells"), "{message}");
    }
    let scene = text(&run(&["--print-scene"]).stdout);
    assert!(scene.contains("on_cells = true"), "{scene}");
    let info = text(&schlieren(&["info", file]).stdout);
    assert!(info.contains("--on-cells traces it through the 3072 cells"), "{info}");
}

#[test]
fn bos_and_its_background_are_made_on_cells() {
    let data = hexahedra(9);
    let text = "[flow]\nfile = \"\"\nn_minus_1 = \"eps\"\non_cells = true\n[film]\n\
                size = [24, 24]\n[technique]\nkind = \"bos\"\n";
    let scene = Scene::from_toml(text).unwrap();
    let mut section = TestSection::of_dataset(&scene, &data, None).unwrap();
    let picture = |section: &TestSection| {
        render(&scene, section, Layers { map: true, ..Layers::NONE }, &Control::default()).unwrap()
    };
    let with = picture(&section).map.unwrap();
    let (_, cells) = section.take_flow().unwrap();
    let without = picture(&section).map.unwrap();
    assert!(with.largest_deflection_rad > 1e-5 && without.largest_deflection_rad == 0.0);
    section.cells = cells;
    assert_eq!(picture(&section).map.unwrap(), with);
}
