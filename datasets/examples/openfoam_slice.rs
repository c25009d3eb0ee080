//! Converts the two OpenFOAM cases of `datasets/openfoam` to files for schlieren images:
//!
//! * `openfoam_slice slice internal.vtu cone20_mach3/slice.vts`: the cells that foamToVTK writes as
//!   a lattice, with density and temperature only, compressed;
//! * `openfoam_slice revolve slice.vts 128 cone.vti`, `openfoam_slice extrude slice.vts 128
//!   wedge.vti`: the whole flow.

use datasets::generate::swept_slice::{Slice, Sweep};
use datasets::model::{
    Attributes, DataArray, Dataset, Points, StructuredGrid, UnstructuredGrid, Values,
};
use datasets::read::open;
use datasets::write::{VtkOptions, write_vtk};
use glam::{DVec2, UVec3};

type Failure = Box<dyn std::error::Error>;

/// Cells along x of the three blocks, and across, as in both blockMeshDicts.
const BLOCKS: [usize; 3] = [20, 100, 100];
const ACROSS: usize = 120;
const X_M: [f64; 4] = [-0.010, 0.0, 0.050, 0.100];
const TOP_M: f64 = 0.060;

fn main() -> Result<(), Failure> {
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    let text =
        |a| <&str>::try_from(a).map_err(|e| format!("argument {a:?} is no text ({e}): use UTF-8"));
    let arguments: Vec<&str> =
        arguments.iter().map(|a| text(a.as_os_str())).collect::<Result<_, _>>()?;
    let options = VtkOptions { compress: true, ..Default::default() };
    match arguments.as_slice() {
        ["slice", from, to] => {
            let Dataset::UnstructuredGrid(cells) = dataset(from)? else {
                return Err("not a .vtu of cells".into());
            };
            write_vtk(to, &slice(&cells)?, options)?;
        }
        [how @ ("revolve" | "extrude"), from, points, to] => {
            let slice = Slice::from_dataset(&dataset(from)?)?;
            let n: u32 = points.parse()?;
            let sweep =
                if *how == "revolve" { Sweep::Revolve } else { Sweep::Extrude { span_m: 0.05 } };
            write_vtk(to, &slice.flow(sweep, UVec3::splat(n))?.into_dataset(), options)?;
        }
        _ => {
            return Err(
                "usage: openfoam_slice slice IN.vtu OUT.vts | revolve|extrude IN.vts POINTS \
                 OUT.vti"
                    .into(),
            );
        }
    }
    Ok(())
}

fn dataset(path: &str) -> Result<Dataset, Failure> {
    Ok(open(path)?.dataset()?.clone())
}

/// blockMesh numbers cells by block, then across, x fastest. The positions of the cells are checked
/// against this order.
fn slice(cells: &UnstructuredGrid) -> Result<Dataset, Failure> {
    let nx: usize = BLOCKS.iter().sum();
    // A plane mesh has two layers of points at constant z; an axisymmetric one is a wedge, whose
    // points have their radius.
    let depth = cells.points.get(0).z.abs();
    let plane = (0..cells.points.len()).all(|p| (cells.points.get(p).z.abs() - depth).abs() < 1e-7);
    let middle = |c: usize| {
        let ids = cells.cells.get(c);
        let sum: DVec2 = ids
            .iter()
            .map(|&p| cells.points.get(p as usize))
            .map(|p| DVec2::new(p.x, if plane { p.y } else { p.y.hypot(p.z) }))
            .sum();
        sum / ids.len() as f64
    };
    // The body's height, from the lowest cells above the afterbody, whose centres are half a cell
    // above it.
    let flat = middle(ACROSS * (BLOCKS[0] + BLOCKS[1])).y;
    let half_cell = (TOP_M - flat) / (2 * ACROSS - 1) as f64;
    let height = flat - half_cell;
    let point = |i: usize, j: usize| {
        let (mut block, mut first) = (0, 0);
        while block < 2 && i > first + BLOCKS[block] {
            first += BLOCKS[block];
            block += 1;
        }
        let x =
            X_M[block] + (X_M[block + 1] - X_M[block]) * (i - first) as f64 / BLOCKS[block] as f64;
        let low = height * (x / X_M[2]).clamp(0.0, 1.0);
        [x as f32, (low + (TOP_M - low) * j as f64 / ACROSS as f64) as f32, 0.0]
    };
    let mut order = vec![0; nx * ACROSS];
    let (mut first, mut cell) = (0, 0);
    for n in BLOCKS {
        for j in 0..ACROSS {
            for i in first..first + n {
                order[j * nx + i] = cell;
                let corners =
                    [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)].map(|(i, j)| point(i, j));
                let expected =
                    corners.map(|p| DVec2::new(p[0] as f64, p[1] as f64)).iter().sum::<DVec2>()
                        / 4.0;
                // The centres of collapsed cells at the axis differ more.
                let tolerance = if j == 0 { 2e-4 } else { 1e-5 };
                if middle(cell).distance(expected) > tolerance {
                    return Err(format!(
                        "cell {cell} is at {}, not at {expected}: not this mesh",
                        middle(cell)
                    )
                    .into());
                }
                cell += 1;
            }
        }
        first += n;
    }
    let mut attributes = Attributes::default();
    for (from, name) in [("rho", "density"), ("T", "temperature")] {
        let array = cells.attributes.cell_array(from).ok_or(format!("no cell array {from}"))?;
        let values = order.iter().map(|&c| array.get(c, 0) as f32).collect();
        attributes.cell.push(DataArray::new(name, 1, Values::F32(values)));
    }
    let points = (0..(nx + 1) * (ACROSS + 1)).map(|n| point(n % (nx + 1), n / (nx + 1))).collect();
    let extent = [0, nx as i32, 0, ACROSS as i32, 0, 0];
    Ok(Dataset::StructuredGrid(StructuredGrid { extent, points: Points::F32(points), attributes }))
}
