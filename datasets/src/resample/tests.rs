use super::*;
use crate::model::{
    Attributes, Block, Cells, DataArray, Dataset, ImageData, Points, RectilinearGrid,
    StructuredGrid, UnstructuredGrid, Values,
};
use crate::testing::with_threads;
use glam::DVec3;

fn linear(p: DVec3) -> f64 {
    0.7 + 2.0 * p.x - 1.5 * p.y + 0.25 * p.z
}

/// A quarter of an annulus with radii 1 and 2 and height 1: a curvilinear grid that does not fill
/// the corners of its bounding box.
fn annulus(n: [usize; 3]) -> StructuredGrid {
    let mut points = Vec::new();
    for k in 0..n[2] {
        for j in 0..n[1] {
            for i in 0..n[0] {
                let r = 1.0 + i as f64 / (n[0] - 1) as f64;
                let angle = std::f64::consts::FRAC_PI_2 * j as f64 / (n[1] - 1) as f64;
                points.push([r * angle.cos(), r * angle.sin(), k as f64 / (n[2] - 1) as f64]);
            }
        }
    }
    let extent = [0, n[0] as i32 - 1, 0, n[1] as i32 - 1, 0, n[2] as i32 - 1];
    StructuredGrid { extent, points: Points::F64(points), attributes: Attributes::default() }
}

fn at_points(mesh: &Mesh, f: impl Fn(DVec3) -> f64) -> Vec<f64> {
    (0..mesh.num_points()).map(|i| f(mesh.point(i))).collect()
}

fn lattice_of(mesh: &Mesh, resolution: Resolution) -> Lattice {
    let (low, high) = mesh.bounds();
    Lattice::fit(low, high, mesh.typical_cell(), resolution).unwrap()
}

/// Asserts that all inside nodes have the value of `f` to `tolerance`.
fn assert_field(r: &ResampledField, tolerance: f64, f: impl Fn(DVec3) -> f64) {
    let [nx, ny, _] = r.lattice.dims;
    for (n, (&v, &m)) in r.values.iter().zip(&r.marks).enumerate() {
        let p = r.lattice.node(n % nx, n / nx % ny, n / nx / ny);
        assert_eq!(m == Mark::Inside, v.is_finite());
        assert!(
            m != Mark::Inside || (f64::from(v) - f(p)).abs() <= tolerance,
            "{v} at {p}, not {}",
            f(p)
        );
    }
}

#[test]
fn curvilinear_grids_give_linear_fields_exactly_and_a_mask() {
    let mesh = Mesh::new(&Dataset::StructuredGrid(annulus([6, 12, 4]))).unwrap();
    let values = at_points(&mesh, linear);
    let lattice = lattice_of(&mesh, Resolution::Dims([41, 41, 9]));
    let r = resample(&mesh, Samples::Points(&values), &lattice, &Options::default()).unwrap();
    assert_field(&r, 1e-6, linear);
    // The mask is the annulus except for the chords of its cells: 1 − cos(π/44) = 0.26 % of the
    // radius.
    for (n, m) in r.marks.iter().enumerate() {
        let p = lattice.node(n % 41, n / 41 % 41, n / 41 / 41);
        let radius = p.truncate().length();
        match m {
            Mark::Inside => assert!((0.995..=2.0 + 1e-6).contains(&radius), "{p}"),
            _ => assert!(!(1.0..=1.99).contains(&radius), "{p} {m:?}"),
        }
    }
    assert_eq!(r.report.inside + r.report.outside, lattice.len());
    assert_eq!((r.report.folded_cells, r.report.missed_cells, r.report.left_out_cells), (0, 0, 0));
    assert!(
        r.report.resampling_error.compared > 0 && r.report.resampling_error.max < 1e-6,
        "{:?}",
        r.report.resampling_error
    );
}

#[test]
fn the_error_falls_with_the_square_of_the_spacing() {
    let curved = |p: DVec3| (2.0 * p.x).sin() * (1.0 + p.y * p.z);
    let rms = |nodes: usize| {
        let mesh = Mesh::new(&Dataset::StructuredGrid(annulus([40, 80, 40]))).unwrap();
        let values = at_points(&mesh, curved);
        let lattice = lattice_of(&mesh, Resolution::Longest(nodes));
        resample(&mesh, Samples::Points(&values), &lattice, &Options::default())
            .unwrap()
            .report
            .resampling_error
            .rms
    };
    let (coarse, fine) = (rms(11), rms(21));
    assert!((3.0..5.5).contains(&(coarse / fine)), "{coarse} {fine}");
}

/// A cube of side 2, divided into the given cells around shared points.
fn unstructured(types: &[u8], cells: &[&[u32]], points: &[[f64; 3]]) -> UnstructuredGrid {
    let mut list = Cells::new();
    cells.iter().for_each(|c| list.push(c.iter().copied()));
    UnstructuredGrid {
        points: Points::F64(points.to_vec()),
        cells: list,
        types: types.to_vec(),
        ..Default::default()
    }
}

const CUBE: [[f64; 3]; 9] = [
    [0., 0., 0.],
    [2., 0., 0.],
    [2., 2., 0.],
    [0., 2., 0.],
    [0., 0., 2.],
    [2., 0., 2.],
    [2., 2., 2.],
    [0., 2., 2.],
    [0.9, 1.1, 1.],
];

fn cubes() -> Vec<(&'static str, UnstructuredGrid)> {
    let hexa: &[u32] = &[0, 1, 2, 3, 4, 5, 6, 7];
    let voxel: &[u32] = &[0, 1, 3, 2, 4, 5, 7, 6];
    let wedges: [&[u32]; 2] = [&[0, 1, 2, 4, 5, 6], &[0, 2, 3, 4, 6, 7]];
    let pyramids: [&[u32]; 6] = [
        &[0, 3, 7, 4, 8],
        &[1, 5, 6, 2, 8],
        &[0, 4, 5, 1, 8],
        &[3, 2, 6, 7, 8],
        &[0, 1, 2, 3, 8],
        &[4, 7, 6, 5, 8],
    ];
    let tetras: [&[u32]; 5] =
        [&[0, 1, 2, 5], &[0, 2, 3, 7], &[0, 5, 7, 4], &[2, 7, 5, 6], &[0, 2, 7, 5]];
    let mut polyhedron = unstructured(&[42], &[hexa], &CUBE);
    for f in [[0u32, 4, 7, 3], [1, 2, 6, 5], [0, 1, 5, 4], [3, 7, 6, 2], [0, 3, 2, 1], [4, 5, 6, 7]]
    {
        polyhedron.polyhedron_faces.push(f);
    }
    polyhedron.faces_of_cell = std::iter::once(0..6).collect();
    vec![
        ("hexahedron", unstructured(&[12], &[hexa], &CUBE)),
        ("voxel", unstructured(&[11], &[voxel], &CUBE)),
        ("wedges", unstructured(&[13, 13], &wedges, &CUBE)),
        ("pyramids", unstructured(&[14; 6], &pyramids, &CUBE)),
        ("tetrahedra", unstructured(&[10; 5], &tetras, &CUBE)),
        ("polyhedron", polyhedron),
    ]
}

#[test]
fn every_kind_of_cell_fills_its_space_without_gaps() {
    for (name, grid) in cubes() {
        let mesh = Mesh::new(&Dataset::UnstructuredGrid(grid)).unwrap();
        let values = at_points(&mesh, linear);
        let lattice = lattice_of(&mesh, Resolution::Dims([13, 17, 11]));
        let r = resample(&mesh, Samples::Points(&values), &lattice, &Options::default()).unwrap();
        assert_eq!(
            (r.report.inside, r.report.outside, r.report.in_gaps),
            (13 * 17 * 11, 0, 0),
            "{name}"
        );
        assert_field(&r, 2e-6, linear);
    }
}

#[test]
fn mixed_cells_beside_each_other_join() {
    // A hexahedron with a pyramid on its face x = 2 and a wedge on y = 2.
    let mut points = CUBE.to_vec();
    points.extend([[3., 1., 1.], [1., 3., 0.], [1., 3., 2.]]);
    let cells: [&[u32]; 3] = [&[0, 1, 2, 3, 4, 5, 6, 7], &[1, 5, 6, 2, 9], &[3, 2, 10, 7, 6, 11]];
    let mesh = Mesh::new(&Dataset::UnstructuredGrid(unstructured(&[12, 14, 13], &cells, &points)))
        .unwrap();
    let values = at_points(&mesh, linear);
    let lattice = lattice_of(&mesh, Resolution::Dims([31, 31, 21]));
    let r = resample(&mesh, Samples::Points(&values), &lattice, &Options::default()).unwrap();
    assert_field(&r, 2e-6, linear);
    // Volumes 8 + 4/3 + 2, in a box of 18.
    let share = r.report.inside as f64 / lattice.len() as f64;
    assert!((share - (8.0 + 4.0 / 3.0 + 2.0) / 18.0).abs() < 0.06, "{share}");
}

#[test]
fn o_grids_with_a_collapsed_axis_have_no_hole() {
    // All points of i = 0 lie on the axis: hexahedra with a collapsed face.
    let n = [5, 17, 3];
    let mut points = Vec::new();
    for k in 0..n[2] {
        for j in 0..n[1] {
            for i in 0..n[0] {
                let (r, a) = (i as f64 / 4.0, std::f64::consts::TAU * j as f64 / 16.0);
                points.push([r * a.cos(), r * a.sin(), k as f64]);
            }
        }
    }
    let grid = StructuredGrid {
        extent: [0, 4, 0, 16, 0, 2],
        points: Points::F64(points),
        attributes: Attributes::default(),
    };
    let mesh = Mesh::new(&Dataset::StructuredGrid(grid)).unwrap();
    let values = at_points(&mesh, linear);
    let lattice = lattice_of(&mesh, Resolution::Dims([21, 21, 5]));
    let r = resample(&mesh, Samples::Points(&values), &lattice, &Options::default()).unwrap();
    assert_field(&r, 2e-6, linear);
    assert_eq!(r.report.folded_cells, 2 * 16);
    for (n, m) in r.marks.iter().enumerate() {
        let p = lattice.node(n % 21, n / 21 % 21, n / 441);
        assert!(p.truncate().length() > 0.97 || *m == Mark::Inside, "{p} is {m:?}");
    }
}

#[test]
fn hidden_and_nan_cells_are_distinguished() {
    let mut image = ImageData::new([5, 3, 3], DVec3::ZERO, DVec3::ONE);
    let mut ghost = vec![0u8; 16];
    ghost[3] = 32;
    image.attributes.cell.push(DataArray::new("vtkGhostType", 1, Values::U8(ghost)));
    let mesh = Mesh::new(&Dataset::ImageData(image)).unwrap();
    assert_eq!(mesh.num_hidden(), 1);
    let mut values = at_points(&mesh, linear);
    values[5 * 3 * 2 + 5 * 2] = f64::NAN; // corner (0, 2, 2)
    let lattice = Lattice { dims: [4, 2, 2], origin: DVec3::splat(0.5), spacing: DVec3::ONE };
    let r = resample(&mesh, Samples::Points(&values), &lattice, &Options::default()).unwrap();
    let expected: Vec<Mark> = (0..16)
        .map(|i| match i {
            3 => Mark::Hidden,
            12 => Mark::NotFinite,
            _ => Mark::Inside,
        })
        .collect();
    assert_eq!(r.marks, expected);
    assert_eq!((r.report.hidden, r.report.not_finite), (1, 1));
}

#[test]
fn cells_without_a_value_are_no_neighbours_as_hidden_ones() {
    let bell = |p: DVec3| (-(p - 6.0).length_squared() / 18.0).exp();
    let is_missing = |c: usize| (c % 12) / 4 == 1 && (c / 12 % 12) > 4 && c / 144 < 7;
    let values: Vec<f64> = (0..12usize.pow(3))
        .map(|c| bell(DVec3::new((c % 12) as f64, (c / 12 % 12) as f64, (c / 144) as f64) + 0.5))
        .collect();
    let resampled = |hide: bool| {
        let mut image = ImageData::new([13; 3], DVec3::ZERO, DVec3::ONE);
        let mut values = values.clone();
        if hide {
            let ghost = (0..values.len()).map(|c| 32 * u8::from(is_missing(c))).collect();
            image.attributes.cell.push(DataArray::new("vtkGhostType", 1, Values::U8(ghost)));
        } else {
            values.iter_mut().enumerate().filter(|v| is_missing(v.0)).for_each(|v| *v.1 = f64::NAN);
        }
        let mesh = Mesh::new(&Dataset::ImageData(image)).unwrap();
        let lattice = lattice_of(&mesh, Resolution::Dims([40; 3]));
        resample(&mesh, Samples::Cells(&values), &lattice, &Options::default()).unwrap()
    };
    let (hidden, missing) = (resampled(true), resampled(false));
    for (i, (a, b)) in hidden.values.iter().zip(&missing.values).enumerate() {
        assert_eq!(a.to_bits(), b.to_bits(), "node {i}: {a} {b}");
    }
    let of = |m: &Mark| if *m == Mark::Hidden { Mark::NotFinite } else { *m };
    assert!(hidden.marks.iter().map(of).eq(missing.marks.iter().copied()));
}

#[test]
fn overlapping_blocks_fill_each_others_holes() {
    let mut holed = ImageData::new([3, 3, 3], DVec3::ZERO, DVec3::ONE);
    holed.attributes.cell.push(DataArray::new(
        "vtkGhostType",
        1,
        Values::U8(vec![0, 0, 0, 0, 0, 0, 0, 32]),
    ));
    let patch = ImageData::new([2, 2, 2], DVec3::splat(0.9), DVec3::splat(1.1));
    let block = |name: &str, d| Block { name: name.into(), data: Dataset::ImageData(d) };
    let mesh = Mesh::new(&Dataset::MultiBlock(vec![block("a", holed), block("b", patch)])).unwrap();
    let values = at_points(&mesh, linear);
    let lattice = lattice_of(&mesh, Resolution::Dims([9, 9, 9]));
    let r = resample(&mesh, Samples::Points(&values), &lattice, &Options::default()).unwrap();
    assert_eq!(r.report.inside, 729);
    assert_field(&r, 2e-6, linear);
}

#[test]
fn cell_values_are_averaged_and_the_smoothing_shows_in_the_report() {
    let mesh =
        Mesh::new(&Dataset::ImageData(ImageData::new([9, 9, 9], DVec3::ZERO, DVec3::ONE))).unwrap();
    let of_cells: Vec<f64> = (0..512).map(|c| if c % 8 < 4 { 0.0 } else { 1.0 }).collect();
    let lattice = lattice_of(&mesh, Resolution::Dims([17, 17, 17]));
    let options = Options { reconstruction: Reconstruction::Linear, ..Default::default() };
    let r = resample(&mesh, Samples::Cells(&of_cells), &lattice, &options).unwrap();
    // Cells next to the step at x = 4 have their centres half a cell from the value 1/2 there.
    assert!(
        (r.report.resampling_error.max - 0.25).abs() < 1e-6
            && r.report.resampling_error.range == 1.0,
        "{:?}",
        r.report.resampling_error
    );
    assert_eq!((r.report.resampling_error.compared, r.report.inside), (512, 17 * 17 * 17));
    assert!((r.values[8] - 0.5).abs() < 1e-7 && r.values[0] == 0.0 && r.values[16] == 1.0);
}

#[test]
fn samples_within_a_node_average_what_is_finer() {
    // Layers one unit thick alternate between 0 and 1; nodes 8 apart get their mean, or the value
    // of the layer that contains them.
    let mesh = Mesh::new(&Dataset::ImageData(ImageData::new([65, 3, 3], DVec3::ZERO, DVec3::ONE)))
        .unwrap();
    let values = at_points(&mesh, |p| if (p.x as usize).is_multiple_of(2) { 0.0 } else { 1.0 });
    let lattice = lattice_of(&mesh, Resolution::Dims([9, 2, 2]));
    let options =
        |samples_per_axis| Options { samples_per_axis, reconstruction: Reconstruction::Linear };
    let at = |samples_per_axis| {
        resample(&mesh, Samples::Points(&values), &lattice, &options(samples_per_axis)).unwrap()
    };
    let one = at(1);
    assert!(one.values.iter().all(|v| *v == 0.0));
    assert!(one.report.missed_cells > 0 && !one.report.warnings().is_empty());
    assert!(at(8).values.iter().all(|v| (*v - 0.5).abs() < 1e-6), "{:?}", at(8).values);
    assert!(resample(&mesh, Samples::Points(&values), &lattice, &options(0)).is_err());
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let run = |threads| {
        with_threads(threads, || {
            let mesh = Mesh::new(&Dataset::StructuredGrid(annulus([7, 9, 5]))).unwrap();
            let values = at_points(&mesh, |p| (3.0 * p.x).sin());
            let lattice = lattice_of(&mesh, Resolution::Longest(30));
            let r = resample(
                &mesh,
                Samples::Points(&values),
                &lattice,
                &Options { samples_per_axis: 2, ..Default::default() },
            )
            .unwrap();
            (r.values.iter().map(|v| v.to_bits()).collect::<Vec<_>>(), r.report)
        })
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn plane_data_needs_a_span() {
    let mut plane = annulus([6, 9, 2]);
    plane.extent[5] = 0;
    if let Points::F64(p) = &mut plane.points {
        p.truncate(54);
    }
    plane.attributes.point.push(DataArray::new(
        "id",
        1,
        Values::F64((0..54).map(f64::from).collect()),
    ));
    let data = Dataset::StructuredGrid(plane);
    let text = Mesh::new(&data).unwrap_err().to_string();
    assert!(text.contains("it is a plane") && text.contains("its span"), "{text}");
    let mesh = Mesh::with_plane(&data, Plane::Extrude { span: 0.5 }).unwrap();
    let (low, high) = mesh.bounds();
    assert_eq!((mesh.num_points(), mesh.num_cells(), low.z, high.z), (108, 40, -0.25, 0.25));
    let ids = mesh.gather_points(&data, |a, i| a.point[0].get(i, 0));
    assert_eq!((ids[0], ids[53], ids[54], ids[107]), (0.0, 53.0, 0.0, 53.0));
    let solid = Dataset::StructuredGrid(annulus([3, 3, 3]));
    assert!(Mesh::with_plane(&solid, Plane::Extrude { span: 1.0 }).is_err());
}

#[test]
fn broken_meshes_give_errors_or_counts() {
    // Surfaces only; one that lies in a plane could get a depth.
    let surface = unstructured(&[9, 9], &[&[0, 1, 2, 3], &[0, 1, 5, 4]], &CUBE);
    let text = Mesh::new(&Dataset::UnstructuredGrid(surface)).unwrap_err().to_string();
    assert!(text.contains("2 cells of other kinds"), "{text}");
    // A point id that does not exist, too few points, and a good cell.
    let cells: [&[u32]; 3] = [&[0, 1, 2, 99], &[0, 1, 2], &[0, 1, 2, 5]];
    let mesh =
        Mesh::new(&Dataset::UnstructuredGrid(unstructured(&[10; 3], &cells, &CUBE))).unwrap();
    assert_eq!((mesh.num_cells(), mesh.left_out()), (1, 2));
    // A point at infinity removes its cell.
    let mut points = CUBE;
    points[5][0] = f64::INFINITY;
    let cells: [&[u32]; 2] = [&[0, 1, 2, 5], &[0, 2, 3, 7]];
    let mesh =
        Mesh::new(&Dataset::UnstructuredGrid(unstructured(&[10; 2], &cells, &points))).unwrap();
    let lattice = lattice_of(&mesh, Resolution::Longest(5));
    let r = resample(&mesh, Samples::Points(&[1.0; 9]), &lattice, &Options::default()).unwrap();
    assert!(r.report.left_out_cells == 1 && r.report.inside > 0);
    assert!(resample(&mesh, Samples::Points(&[1.0; 8]), &lattice, &Options::default()).is_err());
    for bad in [
        Resolution::Dims([1, 5, 5]),
        Resolution::Spacing(-1.0),
        Resolution::Spacing(1e-300),
        Resolution::Dims([usize::MAX; 3]),
    ] {
        assert!(Lattice::fit(DVec3::ZERO, DVec3::ONE, 1.0, bad).is_err(), "{bad:?}");
    }
    assert!(Lattice::fit(DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0), 1.0, Resolution::Auto).is_err());
}

#[test]
fn lattices_fit_their_box() {
    let fit = |r| Lattice::fit(DVec3::ZERO, DVec3::new(1.0, 2.0, 4.0), 0.2, r).unwrap();
    assert_eq!(fit(Resolution::Longest(41)).dims, [11, 21, 41]);
    assert_eq!(fit(Resolution::Spacing(0.1)).dims, [11, 21, 41]);
    let odd = fit(Resolution::Spacing(0.3));
    assert_eq!(odd.dims, [4, 7, 14]);
    assert!((odd.origin - DVec3::new(0.05, 0.1, 0.05)).length() < 1e-12);
    let auto =
        |typical| Lattice::fit(DVec3::ZERO, DVec3::ONE, typical, Resolution::Auto).unwrap().dims;
    assert_eq!(
        (auto(0.02), auto(0.5), auto(1e-9), auto(f64::NAN)),
        ([101; 3], [64; 3], [256; 3], [64; 3])
    );
}

#[test]
fn revolved_planes_are_round() {
    // A plane of x from 0 to 2 and radii from 0.02 to 1: the axis is half a cell below the first
    // row, as with cell centres.
    let n = [9, 26];
    let plane = RectilinearGrid {
        extent: [0, 8, 0, 25, 0, 0],
        coordinates: [
            (0..n[0]).map(|i| 0.25 * i as f64).collect(),
            (0..n[1]).map(|j| 0.02 + 0.98 * j as f64 / 25.0).collect(),
            vec![0.0],
        ],
        attributes: Attributes::default(),
    };
    let mesh =
        Mesh::with_plane(&Dataset::RectilinearGrid(plane), Plane::Extrude { span: 1e-4 }).unwrap();
    let (low, high) = revolved_bounds(&mesh).unwrap();
    assert_eq!((low, high), (DVec3::new(0.0, -1.0, -1.0), DVec3::new(2.0, 1.0, 1.0)));
    let bell = |x: f64, r: f64| (1.0 + x) * (-4.0 * r * r).exp();
    let values = at_points(&mesh, |p| bell(p.x, p.y));
    let lattice = Lattice::fit(low, high, mesh.typical_cell(), Resolution::Longest(41)).unwrap();
    let r = revolve(&mesh, Samples::Points(&values), &lattice, &Options::default()).unwrap();
    for (i, (v, m)) in r.values.iter().zip(&r.marks).enumerate() {
        let p = lattice.node(i % 41, i / 41 % 41, i / 41 / 41);
        let radius = p.y.hypot(p.z);
        match m {
            // Steps of 0.04 in a bell with curvature up to 8 (1 + x): error 24 · 0.04² / 8.
            Mark::Inside => assert!((f64::from(*v) - bell(p.x, radius)).abs() < 5e-3, "{v} at {p}"),
            _ => assert!(radius > 0.999, "{m:?} at {p}"),
        }
    }
    assert!(
        r.report.resampling_error.compared > 300 && r.report.resampling_error.rms < 5e-3,
        "{:?}",
        r.report.resampling_error
    );
    // Radii below zero are invalid.
    let below =
        Mesh::new(&Dataset::ImageData(ImageData::new([3; 3], DVec3::splat(-1.0), DVec3::ONE)))
            .unwrap();
    assert!(revolved_bounds(&below).unwrap_err().to_string().contains("radii from 0 on"));
}

/// The cells of an axisymmetric solver are rings: their outer parts weigh more in averages. Beyond
/// the axis the flow goes on.
#[test]
fn averages_over_rings_give_the_flow_on_the_axis() {
    let (n, sigma) = (20, 3.0);
    let bell = |r: f64| (-0.5 * (r / sigma).powi(2)).exp();
    let plane = ImageData::new([11, n + 1, 1], DVec3::ZERO, DVec3::ONE);
    let mesh = Mesh::with_plane(&Dataset::ImageData(plane), Plane::Extrude { span: 1e-4 }).unwrap();
    // The integral of r exp(-r^2 / 2 s^2) is -s^2 exp(-r^2 / 2 s^2).
    let average = |r: f64| {
        let (a, b) = (r - 0.5, r + 0.5);
        2.0 * sigma * sigma * (bell(a) - bell(b)) / (b * b - a * a)
    };
    let values: Vec<f64> = (0..mesh.num_cells()).map(|c| average(mesh.cell_centre(c).y)).collect();
    let (low, high) = revolved_bounds(&mesh).unwrap();
    let lattice = Lattice::fit(low, high, 1.0, Resolution::Spacing(0.5)).unwrap();
    let r = revolve(&mesh, Samples::Cells(&values), &lattice, &Options::default()).unwrap();
    let (mut on_axis, mut worst) = (0.0f64, 0.0f64);
    for (i, v) in r.values.iter().enumerate() {
        let [nx, ny, _] = lattice.dims;
        let p = lattice.node(i % nx, i / nx % ny, i / nx / ny);
        let radius = p.y.hypot(p.z);
        if radius < 12.0 && (p.x - 5.0).abs() < 3.0 {
            let error = (f64::from(*v) - bell(radius)).abs();
            worst = worst.max(error);
            on_axis = if radius < 1.5 { on_axis.max(error) } else { on_axis };
        }
    }
    assert!(on_axis < 2e-3 && worst < 3e-3, "{on_axis:e} on the axis, {worst:e}");
}

/// The gas beyond a thin body is no neighbour of that before it.
#[test]
fn nothing_is_seen_through_a_body_on_the_axis() {
    let plane = ImageData::new([11, 10, 1], DVec3::new(0.0, 1.5, 0.0), DVec3::ONE);
    let mesh = Mesh::with_plane(&Dataset::ImageData(plane), Plane::Extrude { span: 1e-4 }).unwrap();
    let values = at_points(&mesh, |p| p.y);
    let (low, high) = revolved_bounds(&mesh).unwrap();
    let lattice = Lattice::fit(low, high, 1.0, Resolution::Spacing(0.5)).unwrap();
    let r = revolve(&mesh, Samples::Points(&values), &lattice, &Options::default()).unwrap();
    let [nx, ny, _] = lattice.dims;
    for (i, v) in r.values.iter().enumerate().filter(|(i, _)| r.marks[*i] == Mark::Inside) {
        let p = lattice.node(i % nx, i / nx % ny, i / nx / ny);
        let radius = p.y.hypot(p.z);
        if radius >= 1.5 {
            assert!((f64::from(*v) - radius).abs() < 1e-4, "{v} at {p}");
        }
    }
}

#[test]
fn the_depth_of_a_plane_says_nothing_of_the_size_of_its_cells() {
    let points = (0..121).map(|i| [0.1 * f64::from(i % 11), 0.1 * f64::from(i / 11), 0.0]);
    let grid = StructuredGrid {
        extent: [0, 10, 0, 10, 0, 0],
        points: Points::F64(points.collect()),
        attributes: Attributes::default(),
    };
    for span in [0.001, 0.1, 5.0] {
        let data = Dataset::StructuredGrid(grid.clone());
        let mesh = Mesh::with_plane(&data, Plane::Extrude { span }).unwrap();
        assert!((mesh.typical_cell() - 0.1).abs() < 1e-9, "{span}: {}", mesh.typical_cell());
    }
    // One cell has no other measure than its box.
    let mesh = Mesh::new(&Dataset::StructuredGrid(annulus([2, 2, 2]))).unwrap();
    assert!((mesh.typical_cell() - 4f64.cbrt()).abs() < 1e-9, "{}", mesh.typical_cell());
}
