//! Uniform lattices of cells in which some are hidden or have no value: bodies end at the faces of
//! cells, and the values beside them are as accurate as without them.

mod outlines;

use datasets::model::{DataArray, Dataset, ImageData, Values};
use glam::DVec3;
use outlines::in_lattice;
use schlieren::field::Node;
use schlieren::input::{
    Medium, Options, Quantity, Reference, Role, cells_from_dataset, from_dataset,
};
use schlieren::march::OnCells;
use schlieren::path::Status::{Free, Masked};
use schlieren::path::{Exit, LightPaths, PathQuantities, Start};
use schlieren::view::View;

/// Cells along each axis, and their size.
const N: usize = 16;
const STEP: f64 = 0.125;

/// Columns of cells along z that are none of the flow: a block, and one cell.
fn is_missing([x, y, _]: [usize; 3]) -> bool {
    ((5..9).contains(&x) && (4..10).contains(&y)) || (x, y) == (12, 12)
}

fn cell(c: usize) -> [usize; 3] {
    [c % N, c / N % N, c / (N * N)]
}

/// How a file says which cells are missing.
#[derive(Debug, Clone, Copy)]
enum Said {
    NotANumber,
    HiddenWithCellValues,
    HiddenWithPointValues,
}

fn flow(said: Said) -> Dataset {
    let mut image = ImageData::new([N as u32 + 1; 3], DVec3::ZERO, DVec3::splat(STEP));
    let value = |x: usize| 1.2 + 0.01 * x as f64;
    let cells = 0..N.pow(3);
    let of_cell = |c: usize| match (is_missing(cell(c)), said) {
        (true, Said::NotANumber) => f64::NAN,
        _ => value(cell(c)[0]),
    };
    let hidden = |c: usize| 32 * u8::from(is_missing(cell(c)));
    let attributes = &mut image.attributes;
    match said {
        Said::HiddenWithPointValues => {
            let of_point = (0..(N + 1).pow(3)).map(|p| value(p % (N + 1))).collect();
            attributes.point.push(DataArray::new("rho", 1, Values::F64(of_point)));
        }
        _ => {
            let values = Values::F64(cells.clone().map(of_cell).collect());
            attributes.cell.push(DataArray::new("rho", 1, values));
        }
    }
    if !matches!(said, Said::NotANumber) {
        let ghost = Values::U8(cells.map(hidden).collect());
        attributes.cell.push(DataArray::new("vtkGhostType", 1, ghost));
    }
    Dataset::ImageData(image)
}

#[test]
fn bodies_of_missing_cells_end_at_the_faces_of_the_cells() {
    // A hundredth of a cell on either side of each face, along x and along y.
    let near = 0.01;
    let faces = [(5.0, 1.0), (9.0, -1.0), (12.0, 1.0), (13.0, -1.0)];
    let mut places = Vec::new();
    for (face, inwards) in faces {
        let other = if face > 10.0 { 12.4 } else { 6.3 };
        for side in [-near, near] {
            places.push(([face + side * inwards, other], side > 0.0));
        }
    }
    for (face, inwards) in [(4.0, 1.0), (10.0, -1.0), (12.0, 1.0), (13.0, -1.0)] {
        let other = if face > 11.0 { 12.6 } else { 7.3 };
        for side in [-near, near] {
            places.push(([other, face + side * inwards], side > 0.0));
        }
    }
    let expected: Vec<_> = places.iter().map(|p| if p.1 { Masked } else { Free }).collect();
    for said in [Said::NotANumber, Said::HiddenWithCellValues, Said::HiddenWithPointValues] {
        let data = flow(said);
        let options = Options { hidden: Role::Blank, ..Options::new(Medium::density("rho")) };
        let (gas, _) = cells_from_dataset(&data, &options).unwrap();
        let view = View::new(DVec3::Z, DVec3::Y, gas.centre_m()).unwrap();
        let start = |([x, y], _): &([f64; 2], bool)| {
            let at = DVec3::new(*x, *y, 0.0) * STEP - gas.centre_m();
            let position_m = [view.right, view.up].map(|axis| axis.dot(at) as f32);
            Start { position_m, tilt_rad: [0.0; 2] }
        };
        let starts: Vec<Start> = places.iter().map(start).collect();
        let mut exits = vec![Exit::UNDISTURBED; starts.len()];
        OnCells::new(&gas, view, PathQuantities::default(), 1).trace_parallel(&starts, &mut exits);
        let on_cells: Vec<_> = exits.iter().map(|e| e.status).collect();
        assert_eq!(on_cells, expected, "{said:?}, on cells");
        assert_eq!(in_lattice(&data, &options, view, &starts), expected, "{said:?}, in a lattice");
        let warnings = from_dataset(&data, &options).unwrap().report.warnings.join("\n");
        assert!(warnings.contains("half a cell at each side"), "{warnings}");
    }
}

#[test]
fn one_missing_cell_does_not_make_averages_values_at_centres() {
    let n = 24;
    let bell = |x: f64| (-0.5 * (x / 5.0).powi(2)).exp();
    // Of a cell, by Gauss's formula with three places.
    let average = |i: usize| {
        let middle = i as f64 + 0.5 - 12.0;
        let off = 0.5 * 0.6f64.sqrt();
        (5.0 * (bell(middle - off) + bell(middle + off)) + 8.0 * bell(middle)) / 18.0
    };
    let at = |c: usize| [c % n, c / n % n, c / (n * n)];
    let values: Vec<f64> = (0..n.pow(3))
        .map(|c| match c {
            0 => f64::NAN,
            _ => 1e-4 * at(c).map(average).iter().product::<f64>(),
        })
        .collect();
    let mut image = ImageData::new([n as u32 + 1; 3], DVec3::ZERO, DVec3::ONE);
    image.attributes.cell.push(DataArray::new("n", 1, Values::F64(values)));
    let options = Options {
        reference: Reference::Given { n_minus_1: 0.0 },
        ..Options::new(Medium::NMinus1(Quantity::array("n")))
    };
    let field = from_dataset(&Dataset::ImageData(image), &options).unwrap().field;
    assert_eq!((field.dims(), field.count(Node::Blank)), ([n; 3], 1));
    let truth = |c: usize| at(c).map(|i| bell(i as f64 + 0.5 - 12.0)).iter().product::<f64>();
    let error = (1..n.pow(3)).map(|c| (f64::from(field.eps()[c]) / 1e-4 - truth(c)).abs());
    let error = error.fold(0.0, f64::max);
    // Averages as they are differ by 5e-3.
    assert!(error < 5e-4, "{error}");
}
