//! Fields with known values and gradients, on cells of every type.

use super::*;
use crate::model::{
    Attributes, Cells, Dataset, ImageData, Points, StructuredGrid, UnstructuredGrid,
};
use rt_core::math::SplitMix64;

/// Rounding of f32 in differences over a cell, by the largest gradient.
const ROUNDING: f64 = 3e-6;

/// A cube of 1 with `n` points an axis; those inside are moved at random by this part of their
/// distance.
fn moved_points(n: usize, share: f64) -> Vec<[f64; 3]> {
    let mut random = SplitMix64::new(11);
    let step = 1.0 / (n - 1) as f64;
    (0..n * n * n)
        .map(|i| {
            [i % n, i / n % n, i / (n * n)].map(|k| {
                let moved = random.between(-share, share) * step;
                let inside = k > 0 && k < n - 1;
                k as f64 * step + if inside { moved } else { 0.0 }
            })
        })
        .collect()
}

/// How a hexahedron of the grid becomes cells.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Split {
    Hexahedra,
    Wedges,
    Pyramids,
    Tetrahedra,
    Polyhedra,
    /// Columns of hexahedra and of wedges in turn, whose faces match.
    Mixed,
}

const FACES: [[usize; 4]; 6] =
    [[0, 4, 7, 3], [1, 2, 6, 5], [0, 1, 5, 4], [3, 7, 6, 2], [0, 3, 2, 1], [4, 5, 6, 7]];

fn grid(n: usize, share: f64, split: Split) -> UnstructuredGrid {
    let mut points = moved_points(n, share);
    let mut g = UnstructuredGrid::default();
    let (mut cells, mut polyhedron_faces) = (Cells::new(), Cells::new());
    let id = |i: usize, j: usize, k: usize| (i + n * (j + n * k)) as u32;
    for c in 0..(n - 1).pow(3) {
        let [i, j, k] = [c % (n - 1), c / (n - 1) % (n - 1), c / (n - 1).pow(2)];
        let layer = |k| [id(i, j, k), id(i + 1, j, k), id(i + 1, j + 1, k), id(i, j + 1, k)];
        let hexa: Vec<u32> = layer(k).into_iter().chain(layer(k + 1)).collect();
        let face = |f: usize| FACES[f].map(|at| hexa[at]);
        let kind = match split {
            Split::Mixed if i % 2 == 1 => Split::Wedges,
            Split::Mixed => Split::Hexahedra,
            other => other,
        };
        match kind {
            Split::Hexahedra | Split::Mixed => {
                cells.push(hexa.iter().copied());
                g.types.push(12);
            }
            Split::Wedges => {
                // The diagonal from 0 to 2, as in every cell of the column.
                for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
                    cells.push([a, b, c, a + 4, b + 4, c + 4].map(|at: usize| hexa[at]));
                    g.types.push(13);
                }
            }
            Split::Pyramids => {
                let middle: DVec3 =
                    hexa.iter().map(|&p| DVec3::from(points[p as usize])).sum::<DVec3>() / 8.0;
                points.push(middle.to_array());
                for f in 0..6 {
                    let mut base = face(f);
                    base.reverse();
                    cells.push(base.into_iter().chain([points.len() as u32 - 1]));
                    g.types.push(14);
                }
            }
            Split::Tetrahedra => {
                for order in [[1, 2, 4], [2, 1, 4], [1, 4, 2], [4, 1, 2], [2, 4, 1], [4, 2, 1]] {
                    let corner =
                        |bits: usize| id(i + (bits & 1), j + (bits >> 1 & 1), k + (bits >> 2 & 1));
                    cells.push([0, order[0], order[0] + order[1], 7].map(corner));
                    g.types.push(10);
                }
            }
            Split::Polyhedra => {
                cells.push(hexa.iter().copied());
                g.types.push(42);
                let first = polyhedron_faces.len();
                // Any orientation and any first corner.
                for f in 0..6 {
                    let mut ring = face(f);
                    ring.rotate_left((c + f) % 4);
                    if (c + f) % 3 == 0 {
                        ring.reverse();
                    }
                    polyhedron_faces.push(ring);
                }
                g.faces_of_cell.push(first..polyhedron_faces.len());
            }
        }
    }
    UnstructuredGrid { points: Points::F64(points), cells, polyhedron_faces, ..g }
}

fn field_of(data: &Dataset, f: impl Fn(DVec3) -> f64, how: Reconstruction) -> CellField {
    let mesh = Mesh::new(data).unwrap();
    let values: Vec<f64> = (0..mesh.num_points()).map(|i| f(mesh.point(i))).collect();
    CellField::new(mesh, Samples::Points(&values), how).unwrap()
}

/// What a line meets: the cells in order with their lengths, and the integrals of the slope along
/// it and of the gradient.
#[derive(Debug, Default)]
struct Crossing {
    cells: Vec<(u32, f64)>,
    gaps: usize,
    /// How often it went round in circles.
    moved_on: usize,
    gradient: DVec3,
    end: f64,
}

/// Two points of Gauss in each cell: exact for gradients of cubic fields.
fn cross(walker: &mut CellWalker<'_>, start: DVec3, direction: DVec3) -> Crossing {
    let mut out = Crossing::default();
    let (mut at, mut slack, mut stuck) = (0.0, 0.0, 0);
    let mut farthest = f64::NEG_INFINITY;
    while let Some(entry) = walker.enter(start + direction * at, direction, f64::INFINITY, slack) {
        out.gaps += usize::from(entry.distance > 1e-9 && !out.cells.is_empty());
        at += entry.distance;
        let (mut from, mut inside) = (Beyond::Outside, Beyond::Cell(entry.cell));
        while let Beyond::Cell(cell) = inside {
            let place = start + direction * at;
            let way = walker.leave(cell, place, direction, from).filter(|_| stuck <= 100);
            let Some((length, beyond)) = way else {
                // As in schlieren's march.
                out.moved_on += 1;
                (stuck, at) = (0, at + 1e-5 * walker.size(cell));
                let near = walker.near(cell, start + direction * at);
                (from, inside) = (Beyond::Outside, near.map_or(Beyond::Outside, Beyond::Cell));
                continue;
            };
            for share in [0.211_324_865_405_187_1, 0.788_675_134_594_812_9] {
                let (_, g) = walker.sample(cell, place + direction * (share * length));
                out.gradient += g * (0.5 * length);
            }
            out.cells.push((cell, length));
            assert!(out.cells.len() < 100_000, "a line goes round in circles");
            at += length;
            slack = 1e-6 * walker.size(cell);
            let progress = at > farthest + 1e-9 * walker.size(cell);
            (stuck, farthest) = if progress { (0, at) } else { (stuck + 1, farthest) };
            (from, inside) = (inside, beyond);
        }
        out.end = at;
    }
    out
}

const SPLITS: [Split; 6] = [
    Split::Hexahedra,
    Split::Wedges,
    Split::Pyramids,
    Split::Tetrahedra,
    Split::Polyhedra,
    Split::Mixed,
];

#[test]
fn linear_and_quadratic_fields_are_exact_on_distorted_cells_of_every_type() {
    let linear = |p: DVec3| 1.0 + 2.0 * p.x - 3.0 * p.y + 0.5 * p.z;
    let linear_gradient = |_: DVec3| DVec3::new(2.0, -3.0, 0.5);
    let quadratic = |p: DVec3| p.x * p.x - 2.0 * p.y * p.z + 0.3 * p.x * p.z + p.y;
    let quadratic_gradient =
        |p: DVec3| DVec3::new(2.0 * p.x + 0.3 * p.z, 1.0 - 2.0 * p.z, 0.3 * p.x - 2.0 * p.y);
    for split in SPLITS {
        let data = Dataset::UnstructuredGrid(grid(6, 0.2, split));
        let fields = [
            (
                field_of(&data, linear, Reconstruction::Linear),
                &linear as &dyn Fn(DVec3) -> f64,
                &linear_gradient as &dyn Fn(DVec3) -> DVec3,
            ),
            (field_of(&data, linear, Reconstruction::Cubic), &linear, &linear_gradient),
            (field_of(&data, quadratic, Reconstruction::Cubic), &quadratic, &quadratic_gradient),
        ];
        for (field, value_of, gradient_of) in &fields {
            let mut random = SplitMix64::new(3);
            let (mut walker, mut seen) = (field.walker(), 0);
            for _ in 0..200 {
                let start = DVec3::new(random.unit(), random.unit(), -0.5);
                let aim = DVec3::new(random.unit(), random.unit(), 1.5);
                let direction = (aim - start).normalize();
                let crossing = cross(&mut walker, start, direction);
                let mut at = walker.enter(start, direction, 9.0, 0.0).map_or(0.0, |e| e.distance);
                for (cell, length) in crossing.cells {
                    let place = start + direction * (at + 0.4 * length);
                    let (value, gradient) = walker.sample(cell, place);
                    let wrong = (gradient - gradient_of(place)).length();
                    assert!(wrong < 20.0 * ROUNDING, "{split:?} at {place}: {gradient} {wrong}");
                    let wrong = (value - value_of(place)).abs();
                    assert!(wrong < ROUNDING, "{split:?} at {place}: {value} {wrong}");
                    at += length;
                    seen += 1;
                }
            }
            assert!(seen > 1000, "{split:?}: {seen} cells");
        }
    }
}

/// The mean of polynomials of third degree with factors for their terms is exact for the fourth.
#[test]
fn fields_of_fourth_degree_are_exact_where_their_derivatives_are_known() {
    let f = |p: DVec3| {
        let q = p - DVec3::new(0.4, 0.5, 0.45);
        q.x.powi(4) + 2.0 * q.x * q.y.powi(3) - q.z.powi(4) + q.x * q.y * q.z * (q.x - q.z) + q.y
    };
    let gradient_of = |p: DVec3| {
        let q = p - DVec3::new(0.4, 0.5, 0.45);
        DVec3::new(
            4.0 * q.x.powi(3) + 2.0 * q.y.powi(3) + q.y * q.z * (2.0 * q.x - q.z),
            6.0 * q.x * q.y.powi(2) + q.x * q.z * (q.x - q.z) + 1.0,
            -4.0 * q.z.powi(3) + q.x * q.y * (q.x - 2.0 * q.z),
        )
    };
    for split in SPLITS {
        let data = Dataset::UnstructuredGrid(grid(15, 0.2, split));
        let field = field_of(&data, f, Reconstruction::Cubic);
        let (mut walker, mut random, mut seen) = (field.walker(), SplitMix64::new(4), 0);
        for _ in 0..200 {
            // Away from the faces, where too few points determine a fourth power.
            let start = DVec3::new(random.between(0.35, 0.65), random.between(0.35, 0.65), -0.5);
            let mut z = 0.5;
            for (cell, length) in cross(&mut walker, start, DVec3::Z).cells {
                let place = start + DVec3::Z * (z + 0.4 * length);
                z += length;
                if (0.35..0.65).contains(&place.z) {
                    let (value, gradient) = walker.sample(cell, place);
                    let wrong = (value - f(place)).abs();
                    assert!(wrong < ROUNDING, "{split:?} at {place}: {value} {wrong}");
                    let wrong = (gradient - gradient_of(place)).length();
                    assert!(wrong < 40.0 * ROUNDING, "{split:?} at {place}: {gradient} {wrong}");
                    seen += 1;
                }
            }
        }
        assert!(seen > 500, "{split:?}: {seen} cells");
    }
}

#[test]
fn gradients_are_those_of_the_values() {
    let bell = |p: DVec3| (-(p - 0.45).length_squared() / 0.08).exp();
    for split in SPLITS {
        let data = Dataset::UnstructuredGrid(grid(10, 0.2, split));
        let field = field_of(&data, bell, Reconstruction::Cubic);
        // The bell is narrow, so there are cells with corners of both kinds.
        let fit = field.report().fit;
        assert!(fit.limited > 0 && fit.fitted > 0, "{split:?}: {fit:?}");
        let mut walker = field.walker();
        let mut random = SplitMix64::new(5);
        for _ in 0..300 {
            let start = DVec3::new(random.unit(), random.unit(), -0.5);
            let crossing = cross(&mut walker, start, DVec3::Z);
            let mut z = 0.5;
            for (cell, length) in crossing.cells {
                let place = start + DVec3::Z * (z + 0.37 * length);
                z += length;
                let (_, gradient) = walker.sample(cell, place);
                let h = 1e-3;
                // Differences across the kink between two tetrahedra of a fan are none.
                if length < 0.02 || matches!(split, Split::Polyhedra) {
                    continue;
                }
                let mut along = |axis: DVec3| {
                    let [a, b] = [-h, h].map(|d| walker.sample(cell, place + axis * d).0);
                    (b - a) / (2.0 * h)
                };
                let differences = DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z));
                let wrong = (gradient - differences).length();
                // Of second order in h, with the rounding of f32 by h.
                assert!(wrong < 2e-3, "{split:?} at {place}: {gradient} {differences}");
            }
        }
    }
}

#[test]
fn the_value_is_continuous_across_faces() {
    let bell = |p: DVec3| (-(p - 0.45).length_squared() / 0.08).exp();
    for split in SPLITS {
        // Lines leave through planes, or the triangles of a bent face. There the curved faces of
        // hexahedra, wedges and pyramids are somewhere else, and the difference of the polynomials
        // counts, by the distance between the two.
        let bent = !matches!(split, Split::Tetrahedra | Split::Polyhedra);
        for (share, bound) in [(0.0, 3e-6), (0.2, if bent { 2e-2 } else { 3e-6 })] {
            let data = Dataset::UnstructuredGrid(grid(10, share, split));
            let field = field_of(&data, bell, Reconstruction::Cubic);
            let mut walker = field.walker();
            let mut random = SplitMix64::new(8);
            let (mut worst, mut faces) = (0.0f64, 0);
            for _ in 0..200 {
                let start = DVec3::new(random.unit(), random.unit(), -0.5);
                let direction = DVec3::new(0.1, -0.2, 1.0).normalize();
                let crossing = cross(&mut walker, start, direction);
                let mut at = walker.enter(start, direction, 9.0, 0.0).map_or(0.0, |e| e.distance);
                for pair in crossing.cells.windows(2) {
                    at += pair[0].1;
                    let place = start + direction * at;
                    let [a, b] = [pair[0].0, pair[1].0].map(|c| walker.sample(c, place).0);
                    worst = worst.max((a - b).abs());
                    faces += 1;
                }
            }
            assert!(
                faces > 500 && worst < bound,
                "{split:?} {share}: {worst:.1e} at {faces} faces"
            );
        }
    }
}

#[test]
fn lines_through_points_edges_and_faces_cross_the_whole_cube() {
    // Of lines exactly through points of bent hexahedra, some are lost: this is for plane faces.
    for (split, share) in SPLITS.map(|s| (s, 0.0)) {
        let n = 5;
        let data = Dataset::UnstructuredGrid(grid(n, share, split));
        let field = field_of(&data, |p| p.z, Reconstruction::Linear);
        let mut walker = field.walker();
        let points = moved_points(n, share);
        let (mut lines, mut lost) = (0, 0);
        for (number, point) in points.iter().enumerate() {
            let place = DVec3::from(*point);
            // Along an axis, along a diagonal of a face and of the cube, and to another point.
            let other = DVec3::from(points[(number * 37 + 11) % points.len()]);
            for direction in
                [DVec3::Z, DVec3::NEG_X, DVec3::new(0.0, 1.0, 1.0), DVec3::ONE, other - place]
            {
                let Some(direction) = direction.try_normalize() else { continue };
                let start = place - direction * 3.0;
                let crossing = cross(&mut walker, start, direction);
                let inside: f64 = crossing.cells.iter().map(|c| c.1).sum();
                // The chord of the cube.
                let (mut near, mut far) = (0.0f64, 6.0f64);
                for a in 0..3 {
                    if direction[a] != 0.0 {
                        let (s, t) = (-start[a] / direction[a], (1.0 - start[a]) / direction[a]);
                        (near, far) = (near.max(s.min(t)), far.min(s.max(t)));
                    }
                }
                let chord = (far - near).max(0.0);
                // A line in a side of the cube, or through one of its points only, enters and
                // leaves
                // again and again, and is moved on by 1e-5 of a cell.
                let in_side = |a: usize| direction[a] == 0.0 && [0.0, 1.0].contains(&start[a]);
                let along_border = chord < 1e-9 || (0..3).any(in_side);
                let allowed = if along_border { 3 } else { 0 };
                let crosses = (inside - chord).abs() < 1e-5 && crossing.gaps == 0;
                if share == 0.0 {
                    assert!(
                        crosses && crossing.moved_on <= allowed,
                        "{split:?} through {place} along {direction}: {inside} of {chord}"
                    );
                }
                lines += 1;
                lost += usize::from((inside - chord).abs() > 1e-4);
            }
        }
        assert!(lost == 0, "{split:?} {share}: {lost} of {lines} lines are lost");
    }
}

/// Two blocks of a cube that meet at x = 0.5, with these numbers of points along y and z.
fn blocks(left: usize, right: usize, gap: f64) -> Dataset {
    let block = |low: f64, n: usize| {
        let spacing = DVec3::new(0.5 / 8.0, 1.0 / (n - 1) as f64, 1.0 / (n - 1) as f64);
        let n = n as u32;
        Dataset::ImageData(ImageData::new([9, n, n], DVec3::new(low, 0.0, 0.0), spacing))
    };
    let data = vec![block(0.0, left), block(0.5 + gap, right)];
    let named = data.into_iter().map(|data| crate::model::Block { name: String::new(), data });
    Dataset::MultiBlock(named.collect())
}

#[test]
fn a_border_of_blocks_is_no_seam() {
    let bell = |p: DVec3| (-(p - 0.5).length_squared() / 0.08).exp();
    // Points that match, points that do not, and a gap of rounding.
    for (left, right, gap) in [(17, 17, 0.0), (17, 24, 0.0), (17, 17, 1e-9)] {
        let field = field_of(&blocks(left, right, gap), bell, Reconstruction::Cubic);
        let mut walker = field.walker();
        for i in 0..60 {
            let start = DVec3::new(-1.0, 0.2 + 0.01 * f64::from(i), 0.43);
            let direction = DVec3::new(1.0, 0.05, 0.03).normalize();
            let crossing = cross(&mut walker, start, direction);
            let inside: f64 = crossing.cells.iter().map(|c| c.1).sum();
            let chord = 1.0 / direction.x;
            assert!((inside - chord).abs() < 1e-6, "{left} {right}: {inside} of {chord}");
            // What the line gains between its ends is the difference of the values there.
            let [a, b] = [1.0, 2.0].map(|t| bell(start + direction * (t / direction.x)));
            let gained = crossing.gradient.dot(direction);
            assert!((gained - (b - a)).abs() < 2e-3, "{left} {right}: {gained} {}", b - a);
        }
    }
}

#[test]
fn a_line_leaves_at_a_hole_and_enters_again() {
    let mut data = grid(9, 0.0, Split::Hexahedra);
    // The cells in the middle are away: x, y and z between 3/8 and 5/8.
    let away = |c: usize| [c % 8, c / 8 % 8, c / 64].iter().all(|k| (3..5).contains(k));
    let mut cells = Cells::new();
    (0..512).filter(|c| !away(*c)).for_each(|c| cells.push(data.cells.get(c).iter().copied()));
    data.types.truncate(cells.len());
    data.cells = cells;
    let field = field_of(&Dataset::UnstructuredGrid(data), |p| p.x, Reconstruction::Linear);
    let mut walker = field.walker();
    for y in [0.4, 0.5, 0.6, 0.63] {
        let crossing = cross(&mut walker, DVec3::new(-1.0, y, 0.51), DVec3::X);
        let inside: f64 = crossing.cells.iter().map(|c| c.1).sum();
        let through_hole = y < 0.625;
        assert_eq!(crossing.gaps, usize::from(through_hole), "at y = {y}");
        let expected = if through_hole { 0.75 } else { 1.0 };
        assert!((inside - expected).abs() < 1e-9, "at y = {y}: {inside}");
        assert!((crossing.gradient.x - expected).abs() < 1e-5, "{crossing:?}");
    }
}

#[test]
fn cells_without_volume_inverted_folded_and_not_finite_ones_are_counted() {
    let mut data = grid(4, 0.1, Split::Hexahedra);
    let Points::F64(points) = &mut data.points else { panic!("points in f64") };
    let first = points.len() as u32;
    // Beside the cube: a flat cell, one with a point at no place, and one that is inside out.
    let unit: Vec<[f64; 3]> = (0..8usize)
        .map(|i| {
            let corner = [[0, 0], [1, 0], [1, 1], [0, 1]][i % 4];
            [corner[0] as f64, corner[1] as f64, (i / 4) as f64]
        })
        .collect();
    points.extend(unit.iter().map(|p| [p[0] + 2.0, p[1], 0.0]));
    points.extend(unit.iter().map(|p| [p[0] + 4.0, p[1], if p[2] > 0.0 { f64::NAN } else { 0.0 }]));
    points.extend(unit.iter().map(|p| [p[0] + 6.0, p[1], 1.0 - p[2]]));
    // Two opposite corners of the top exchanged: the map folds.
    let mut folded = unit.clone();
    folded.swap(4, 6);
    points.extend(folded.iter().map(|p| [p[0] + 8.0, p[1], p[2]]));
    for k in 0..4 {
        data.cells.push((0..8).map(|i| first + 8 * k + i));
        data.types.push(12);
    }
    let field = field_of(&Dataset::UnstructuredGrid(data), |p| p.x, Reconstruction::Linear);
    let report = field.report();
    assert_eq!((report.cells, report.left_out, report.folded), (29, 2, 1), "{report:?}");
    let warnings = report.warnings();
    assert!(warnings.iter().any(|w| w.starts_with("2 cells left out")), "{warnings:?}");
    let mut walker = field.walker();
    // Through the one that is inside out.
    let crossing = cross(&mut walker, DVec3::new(6.3, 0.4, -1.0), DVec3::Z);
    assert!((crossing.cells.iter().map(|c| c.1).sum::<f64>() - 1.0).abs() < 1e-9);
    assert!((crossing.gradient.x - 1.0).abs() < 1e-5, "{crossing:?}");
    // Through the folded one: something finite, and an end.
    let crossing = cross(&mut walker, DVec3::new(8.3, 0.4, -1.0), DVec3::Z);
    assert!(crossing.gradient.is_finite() && !crossing.cells.is_empty());
    // And nothing where the flat cell is.
    let crossing = cross(&mut walker, DVec3::new(2.3, 0.4, -1.0), DVec3::Z);
    assert!(crossing.cells.is_empty());
}

#[test]
fn hidden_cells_are_seen_behind_faces_and_nan_cells_have_no_value() {
    let n = 5;
    let points = Points::F64(moved_points(n, 0.0));
    let mut ghost = vec![0.0; 64];
    ghost[32 + 5] = 32.0;
    let array = crate::model::DataArray::new("vtkGhostType", 1, crate::model::Values::F64(ghost));
    let attributes = Attributes { cell: vec![array], ..Attributes::default() };
    let last = n as i32 - 1;
    let extent = [0, last, 0, last, 0, last];
    let data = Dataset::StructuredGrid(StructuredGrid { extent, points, attributes });
    let mesh = Mesh::new(&data).unwrap();
    let mut values = vec![1.0; 64];
    values[40] = f64::NAN;
    let field = CellField::new(mesh, Samples::Cells(&values), Reconstruction::Cubic).unwrap();
    assert_eq!((field.report().hidden, field.report().without_value), (1, 1));
    let mut walker = field.walker();
    let at = |k: f64| k * 0.25 + 0.125;
    // Cell 37 = 1 + 4 (1 + 4 · 2) is hidden.
    let start = DVec3::new(at(1.0), at(1.0), -1.0);
    let entry = walker.enter(start, DVec3::Z, 9.0, 0.0).unwrap();
    assert!((entry.distance - 1.0).abs() < 1e-12 && entry.from == Beyond::Outside);
    let place = start + DVec3::Z * 1.3;
    assert_eq!(walker.leave(21, place, DVec3::Z, Beyond::Cell(5)).unwrap().1, Beyond::Hidden);
    let again = walker.enter(start + DVec3::Z * 1.5, DVec3::Z, 9.0, 1e-6).unwrap();
    assert!(again.from == Beyond::Hidden && (again.distance - 0.25).abs() < 1e-12, "{again:?}");
    // Cell 40 = 0 + 4 (2 + 4 · 2).
    assert!(walker.sample(40, DVec3::new(at(0.0), at(2.0), at(2.0))).0.is_nan());
    assert!(walker.sample(41, DVec3::new(at(1.0), at(2.0), at(2.0))).0.is_finite());
}

#[test]
fn where_blocks_overlap_a_line_goes_on_in_the_other() {
    let block = |low: f64| {
        let spacing = DVec3::new(0.1, 0.25, 0.25);
        Dataset::ImageData(ImageData::new([7, 5, 5], DVec3::new(low, 0.0, 0.0), spacing))
    };
    // The second begins at 0.37, in the middle of a cell of the first, which ends at 0.6.
    let data =
        [block(0.0), block(0.37)].map(|data| crate::model::Block { name: String::new(), data });
    let data = Dataset::MultiBlock(data.into());
    let field = field_of(&data, |p| p.x, Reconstruction::Linear);
    let mut walker = field.walker();
    let crossing = cross(&mut walker, DVec3::new(-1.0, 0.4, 0.3), DVec3::X);
    assert_eq!(crossing.gaps, 0, "{crossing:?}");
    assert!((crossing.gradient.x - 0.97).abs() < 1e-5, "{crossing:?}");
}

#[test]
fn nothing_to_trace_is_an_error() {
    let image = ImageData::new([3; 3], DVec3::ZERO, DVec3::ONE);
    let mesh = Mesh::new(&Dataset::ImageData(image)).unwrap();
    let few = CellField::new(mesh.clone(), Samples::Points(&[1.0]), Reconstruction::Cubic);
    assert!(matches!(few.err(), Some(ResampleError::Count { found: 1, .. })));
    let nan = [f64::NAN; 27];
    let none = CellField::new(mesh, Samples::Points(&nan), Reconstruction::Cubic);
    assert!(none.err().unwrap().to_string().contains("finite numbers"));
}
