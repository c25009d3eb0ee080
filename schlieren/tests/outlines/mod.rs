//! Small flows whose meshes end at bodies and at open borders: planes, and the same with cells
//! along their span.
#![allow(dead_code, reason = "each test binary uses its part")]

use datasets::model::{
    Attributes, DataArray, Dataset, Points, UnstructuredGrid, Values, WALL_POINTS,
};
use datasets::resample::Resolution;
use glam::DVec3;
use schlieren::input::{Depth, Medium, Options, Outside, cells_from_dataset, from_dataset};
use schlieren::march::OnCells;
use schlieren::path::{Exit, LightPaths, PathQuantities, Start, Status};
use schlieren::plan::{Plan, Request};
use schlieren::view::View;

/// A flow in a plane: quads, with density and perhaps velocity at their points.
#[derive(Clone, Default)]
pub(crate) struct Plane {
    pub(crate) points: Vec<[f64; 2]>,
    quads: Vec<[u32; 4]>,
}

impl Plane {
    /// Adds `n` cells along u and v from 0 to 1, whose corners `place` says. Places that are equal
    /// to the last bit are one point.
    pub(crate) fn with_block(
        mut self,
        [nu, nv]: [usize; 2],
        place: impl Fn(f64, f64) -> [f64; 2],
    ) -> Plane {
        let mut ids = Vec::new();
        for j in 0..=nv {
            for i in 0..=nu {
                let p = place(i as f64 / nu as f64, j as f64 / nv as f64).map(|x| x + 0.0);
                let known = self.points.iter().position(|q| *q == p);
                ids.push(known.unwrap_or(self.points.len()) as u32);
                if known.is_none() {
                    self.points.push(p);
                }
            }
        }
        for j in 0..nv {
            for i in 0..nu {
                let first = i + (nu + 1) * j;
                let mut quad = [first, first + 1, first + nu + 2, first + nu + 1].map(|k| ids[k]);
                let [a, b, _, d] = quad.map(|id| self.points[id as usize]);
                if (b[0] - a[0]) * (d[1] - a[1]) < (b[1] - a[1]) * (d[0] - a[0]) {
                    quad.reverse();
                }
                self.quads.push(quad);
            }
        }
        self
    }

    /// Cells around a cylinder of radius 0.5 at the origin, over angles from `first` on, in turns.
    /// The outer border has radius 2, or is a square of that half side.
    pub(crate) fn around_cylinder(self, [first, turns]: [f64; 2], square: bool) -> Plane {
        let n = (64.0 * turns).round() as usize;
        self.with_block([n, 12], |u, v| {
            // The ends of a whole turn are the same place, bit for bit.
            let step = (u * n as f64).round() as usize % (if turns == 1.0 { n } else { n + 1 });
            let angle = std::f64::consts::TAU * (first + step as f64 / 64.0);
            let (sin, cos) = angle.sin_cos();
            let [sin, cos] = [sin, cos].map(|x| if x.abs() < 1e-12 { 0.0 } else { x });
            let outer = if square { 2.0 / sin.abs().max(cos.abs()) } else { 2.0 };
            let r = 0.5 + (outer - 0.5) * v;
            [r * cos, r * sin]
        })
    }

    /// The density: one that bends light in the gas, by itself the same everywhere along the span.
    fn density(&self, copies: usize) -> DataArray {
        let of = |p: &[f64; 2]| 1.2 + 0.01 * p[0] + 0.004 * p[1];
        let one: Vec<f64> = self.points.iter().map(of).collect();
        DataArray::new("rho", 1, Values::F64(one.repeat(copies)))
    }

    fn attributes(&self, copies: usize, velocity: Option<&Velocity<'_>>) -> Attributes {
        let mut point = vec![self.density(copies)];
        if let Some(velocity) = velocity {
            let one: Vec<f64> = self.points.iter().flat_map(|p| with_zero(velocity(*p))).collect();
            point.push(DataArray::new("U", 3, Values::F64(one.repeat(copies))));
        }
        Attributes { point, ..Attributes::default() }
    }

    /// As data in a plane.
    pub(crate) fn flat(&self, velocity: Option<&Velocity<'_>>) -> Dataset {
        let mut grid = UnstructuredGrid {
            points: Points::F64(self.points.iter().map(|p| with_zero(*p)).collect()),
            attributes: self.attributes(1, velocity),
            ..Default::default()
        };
        for quad in &self.quads {
            grid.types.push(9);
            grid.cells.push(*quad);
        }
        Dataset::UnstructuredGrid(grid)
    }

    /// As hexahedra, `layers` of them over a span of 1.
    pub(crate) fn thick(&self, layers: usize, velocity: Option<&Velocity<'_>>) -> UnstructuredGrid {
        let count = self.points.len();
        let place = |k: usize, p: &[f64; 2]| [p[0], p[1], k as f64 / layers as f64 - 0.5];
        let layer = |k: usize| self.points.iter().map(move |p| place(k, p));
        let mut grid = UnstructuredGrid {
            points: Points::F64((0..=layers).flat_map(layer).collect()),
            attributes: self.attributes(layers + 1, velocity),
            ..Default::default()
        };
        for k in 0..layers {
            for quad in &self.quads {
                let below = quad.map(|id| id + (k * count) as u32);
                grid.types.push(12);
                grid.cells.push(below.into_iter().chain(below.map(|id| id + count as u32)));
            }
        }
        grid
    }

    /// [`Plane::thick`] with a list of the points of walls, as the reader of OpenFOAM makes it.
    pub(crate) fn with_list(&self, layers: usize, is_wall: impl Fn([f64; 2]) -> bool) -> Dataset {
        let mut grid = self.thick(layers, None);
        let count = self.points.len();
        let of_wall = (0..count * (layers + 1)).filter(|i| is_wall(self.points[i % count]));
        let list = Values::U32(of_wall.map(|i| i as u32).collect());
        grid.attributes.field.push(DataArray::new(WALL_POINTS, 1, list));
        Dataset::UnstructuredGrid(grid)
    }
}

pub(crate) type Velocity<'a> = dyn Fn([f64; 2]) -> [f64; 2] + 'a;

fn with_zero([x, y]: [f64; 2]) -> [f64; 3] {
    [x, y, 0.0]
}

/// Hides those cells whose middle is so, as solvers do with bodies in a lattice.
pub(crate) fn hide(grid: &mut UnstructuredGrid, is_hidden: impl Fn([f64; 2]) -> bool) {
    let middle = |ids: &[u32]| {
        let sum = ids.iter().fold([0.0; 2], |s, &i| {
            let p = grid.points.get(i as usize);
            [s[0] + p.x, s[1] + p.y]
        });
        sum.map(|x| x / ids.len() as f64)
    };
    let ghost: Vec<u8> =
        grid.cells.iter().map(|ids| 32 * u8::from(is_hidden(middle(ids)))).collect();
    grid.attributes.cell.push(DataArray::new("vtkGhostType", 1, Values::U8(ghost)));
}

/// Options for density, with a span of 1 where the data is flat.
pub(crate) fn options(data: &Dataset, outside: Outside) -> Options {
    let flat = matches!(data, Dataset::UnstructuredGrid(g) if g.types.contains(&9));
    let depth = flat.then_some(Depth::Span(1.0));
    Options { outside, depth, ..Options::new(Medium::density("rho")) }
}

/// What becomes of light along `direction` through places of the plane z = 0: on the cells, and in
/// a lattice.
pub(crate) fn statuses(
    data: &Dataset,
    options: &Options,
    direction: DVec3,
    places: &[[f64; 2]],
) -> [Vec<Status>; 2] {
    let (gas, _) = cells_from_dataset(data, options).expect("the mesh has cells");
    let up = if direction.y.abs() > 0.9 { DVec3::Z } else { DVec3::Y };
    let view = View::new(direction, up, gas.centre_m()).unwrap();
    let start = |[x, y]: &[f64; 2]| {
        // Along the ray to the plane through the view's centre.
        let at = DVec3::new(*x, *y, 0.0) - gas.centre_m();
        let position_m = [view.right, view.up].map(|axis| axis.dot(at) as f32);
        Start { position_m, tilt_rad: [0.0; 2] }
    };
    let starts: Vec<Start> = places.iter().map(start).collect();
    let mut exits = vec![Exit::UNDISTURBED; starts.len()];
    OnCells::new(&gas, view, PathQuantities::default(), 1).trace_parallel(&starts, &mut exits);
    let on_cells = exits.iter().map(|e| e.status).collect();
    let options = Options { resolution: Resolution::Longest(81), ..options.clone() };
    [on_cells, in_lattice(data, &options, view, &starts)]
}

/// What becomes of light in a lattice.
pub(crate) fn in_lattice(
    data: &Dataset,
    options: &Options,
    view: View,
    starts: &[Start],
) -> Vec<Status> {
    let field = from_dataset(data, options).expect("the mesh has cells").field;
    let request = Request { direction: Some(view.forward), ..Request::default() };
    let mut exits = vec![Exit::UNDISTURBED; starts.len()];
    Plan::new(&field, request).paths(&field, view).trace_parallel(starts, &mut exits);
    exits.iter().map(|e| e.status).collect()
}
