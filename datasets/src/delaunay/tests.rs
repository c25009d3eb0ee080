//! Triangulations against their definition: spheres without points, volumes that add up, and
//! Euler's formula.

use super::gaps::{self, SPACINGS};
use super::predicates::{in_sphere, orientation};
use super::snap::Snapped;
use super::{Degenerate, tetrahedra, triangles};
use glam::DVec3;
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;

/// Numbers from 0 to 1, by xorshift.
pub(super) struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn points(&mut self, count: usize) -> Vec<[f64; 3]> {
        (0..count).map(|_| [self.next(), self.next(), self.next()]).collect()
    }
}

fn lattice(n: usize, step: f64, keep: impl Fn([usize; 3]) -> bool) -> Vec<[f64; 3]> {
    let all = (0..n * n * n).map(|i| [i % n, i / n % n, i / n / n]);
    all.filter(|p| keep(*p)).map(|p| p.map(|x| x as f64 * step)).collect()
}

/// Six times the volume of tetrahedra, in steps of the integers.
fn volume(s: &Snapped, t: [u32; 4]) -> i128 {
    let [a, b, c, d] = t.map(|p| s.places[p as usize].map(i128::from));
    let [u, v, w] = [b, c, d].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
    u[0] * (v[1] * w[2] - v[2] * w[1])
        + u[1] * (v[2] * w[0] - v[0] * w[2])
        + u[2] * (v[0] * w[1] - v[1] * w[0])
}

/// Checks the definition. `every`: how many points are compared with each sphere.
fn check(points: &[[f64; 3]]) -> (Snapped, Vec<[u32; 4]>) {
    let s = Snapped::new(points);
    let cells = tetrahedra(&s).unwrap();
    let place = |p: u32| s.places[p as usize];
    let mut faces: BTreeMap<[u32; 3], Vec<(usize, usize)>> = BTreeMap::new();
    let mut edges = BTreeSet::new();
    let mut used = BTreeSet::new();
    for (t, cell) in cells.iter().enumerate() {
        assert_eq!(orientation(place(cell[0]), place(cell[1]), place(cell[2]), place(cell[3])), 1);
        for i in 0..4 {
            used.insert(cell[i]);
            let mut face: Vec<u32> = (0..4).filter(|k| *k != i).map(|k| cell[k]).collect();
            face.sort_unstable();
            faces.entry([face[0], face[1], face[2]]).or_default().push((t, i));
            (0..i).for_each(|k| {
                edges.insert([cell[i].min(cell[k]), cell[i].max(cell[k])]);
            });
        }
    }
    assert_eq!(used.len(), s.len(), "every point is a corner");
    // The spheres of neighbours are empty of each other's corners: then all spheres are of all
    // points (Delaunay's lemma). Faces with one side are the hull: no point lies beyond them.
    for sides in faces.values() {
        match sides.as_slice() {
            [(a, i), (b, j)] => {
                let corners = cells[*a].map(place);
                assert!(in_sphere(corners, place(cells[*b][*j])) <= 0);
                assert_ne!((a, i), (b, j));
            }
            [(a, i)] => {
                let mut with = cells[*a].map(place);
                let beyond = s.places.iter().filter(|p| {
                    with[*i] = **p;
                    orientation(with[0], with[1], with[2], with[3]) < 0
                });
                assert_eq!(beyond.count(), 0, "a face of the hull has points beyond it");
            }
            more => panic!("a face has {} sides", more.len()),
        }
    }
    // A ball: points - edges + faces - cells = 1.
    let euler = s.len() as i64 - edges.len() as i64 + faces.len() as i64 - cells.len() as i64;
    assert_eq!(euler, 1);
    // Its volume is that of its border, by the divergence theorem.
    let inside: i128 = cells.iter().map(|t| volume(&s, *t)).sum();
    let border = faces.values().filter(|f| f.len() == 1).map(|f| {
        let (t, i) = f[0];
        let origin = [0i128; 3];
        let mut p = cells[t].map(|c| place(c).map(i128::from));
        p[i] = origin;
        let [u, v, w] = [1, 2, 3].map(|k| [0, 1, 2].map(|a| p[k][a] - p[0][a]));
        u[0] * (v[1] * w[2] - v[2] * w[1])
            + u[1] * (v[2] * w[0] - v[0] * w[2])
            + u[2] * (v[0] * w[1] - v[1] * w[0])
    });
    assert_eq!(inside, border.sum::<i128>());
    (s, cells)
}

#[test]
fn random_points_lattices_and_cylinders_are_triangulated() {
    check(&Random(7).points(2000));
    let (_, cells) = check(&lattice(8, 0.1, |_| true));
    assert!(cells.len() >= 5 * 7 * 7 * 7);
    check(&lattice(9, 1.0, |p| !(p[0] > 2 && p[0] < 6 && p[1] > 2 && p[1] < 6)));
    // Layers around a cylinder: cospherical, coplanar, and far from the origin.
    let mut around = Vec::new();
    for (i, j, k) in (0..24 * 6 * 5).map(|n| (n % 24, n / 24 % 6, n / 144)) {
        let (angle, r) = (i as f64 * TAU / 24.0, 1.0 + 0.01 * 2f64.powi(j));
        around.push([1e3 + r * angle.cos(), -5e4 + r * angle.sin(), 0.2 * k as f64]);
    }
    check(&around);
}

#[test]
fn the_corners_of_a_cube_are_five_or_six_tetrahedra_of_its_volume() {
    let (s, cells) = check(&lattice(2, 3.0, |_| true));
    assert!([5, 6].contains(&cells.len()), "{cells:?}");
    let side = 1i128 << 40;
    assert_eq!(cells.iter().map(|c| volume(&s, *c)).sum::<i128>(), 6 * side * side * side);
}

#[test]
fn the_mesh_does_not_depend_on_the_order_of_points() {
    let mut points = lattice(7, 0.3, |p| p != [3, 3, 3]);
    points.extend(Random(3).points(300));
    let cells = |points: &[[f64; 3]]| {
        let s = Snapped::new(points);
        (tetrahedra(&s).unwrap(), triangles(&s).unwrap(), s.places)
    };
    let first = cells(&points);
    points.reverse();
    points.rotate_left(100);
    assert!(first == cells(&points));
}

#[test]
fn points_on_a_line_or_a_plane_are_named() {
    let space = |p: &[[f64; 3]]| tetrahedra(&Snapped::new(p));
    let flat = |p: &[[f64; 3]]| triangles(&Snapped::new(p));
    let line: Vec<[f64; 3]> = (0..9).map(|i| [f64::from(i), 2.0 * f64::from(i), 1.0]).collect();
    assert_eq!(space(&[]), Err(Degenerate::Line));
    assert_eq!(flat(&[]), Err(Degenerate::Line));
    assert_eq!(flat(&line[..1]), Err(Degenerate::Line));
    assert_eq!(flat(&line), Err(Degenerate::Line));
    assert_eq!(space(&line), Err(Degenerate::Line));
    let mut plane = line.clone();
    plane.push([0.0, 1.0, 1.0]);
    assert_eq!(space(&plane), Err(Degenerate::Plane));
    assert_eq!(flat(&plane).unwrap().len(), 8);
    plane.push([0.0, 1.0, 5.0]);
    assert_eq!(space(&plane).unwrap().len(), 8);
}

#[test]
fn triangles_have_empty_circles_and_fill_the_hull() {
    let mut points = Random(5).points(800);
    points.iter_mut().for_each(|p| p[2] = 0.0);
    points.extend([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]);
    let s = Snapped::new(&points);
    let cells = triangles(&s).unwrap();
    // Lifted by one step, the three corners and a point are on a sphere about as on the circle:
    // compared with circles in integers instead.
    let mut area = 0i128;
    for c in &cells {
        let [a, b, c] = c.map(|p| s.places[p as usize].map(i128::from));
        area += (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        for p in s.places.iter().step_by(7).map(|p| p.map(i128::from)) {
            let [u, v, w] = [a, b, c].map(|q| [(q[0] - p[0]) as f64, (q[1] - p[1]) as f64]);
            let lift = |q: [f64; 2]| q[0] * q[0] + q[1] * q[1];
            let cross = |q: [f64; 2], r: [f64; 2]| q[0] * r[1] - q[1] * r[0];
            let terms = [lift(u) * cross(v, w), lift(v) * cross(w, u), lift(w) * cross(u, v)];
            let size: f64 = terms.iter().map(|t| t.abs()).sum();
            assert!(terms.iter().sum::<f64>() <= 1e-14 * size);
        }
    }
    assert_eq!(area, 2 << 80);
}

/// The gaps among the triangles or tetrahedra of points: cells, gaps, and the volume of gaps.
fn gaps_of(points: &[[f64; 3]], planar: bool) -> (usize, usize, f64) {
    let s = Snapped::new(points);
    let mut at = vec![DVec3::ZERO; s.len()];
    s.place_of.iter().zip(points).for_each(|(i, p)| at[*i as usize] = DVec3::from(*p));
    let volume = |t: &[u32]| {
        let p: Vec<DVec3> = t.iter().map(|i| at[*i as usize]).collect();
        let normal = (p[1] - p[0]).cross(p[2] - p[0]);
        if p.len() == 3 { 0.5 * normal.length() } else { normal.dot(p[3] - p[0]) / 6.0 }
    };
    if planar {
        let cells = triangles(&s).unwrap();
        let g = gaps::find(&at, &cells, SPACINGS);
        let sum = cells.iter().zip(&g.is_gap).filter(|c| *c.1).map(|c| volume(c.0)).sum();
        (cells.len(), g.cells, sum)
    } else {
        let cells = tetrahedra(&s).unwrap();
        let g = gaps::find(&at, &cells, SPACINGS);
        let sum = cells.iter().zip(&g.is_gap).filter(|c| *c.1).map(|c| volume(c.0)).sum();
        (cells.len(), g.cells, sum)
    }
}

/// Layers around an ellipse of half axes 1 and `b`: the first `first` thick, each next one 1.2
/// times.
fn layers(around: usize, layers: i32, b: f64, first: f64) -> Vec<[f64; 3]> {
    let mut points = Vec::new();
    for j in 0..layers {
        let off = first * (1.2f64.powi(j) - 1.0) / 0.2;
        for i in 0..around {
            let (sin, cos) = (TAU * i as f64 / around as f64).sin_cos();
            let n = DVec3::new(b * cos, sin, 0.0).normalize();
            points.push((DVec3::new(cos, b * sin, 0.0) + off * n).to_array());
        }
    }
    points
}

#[test]
fn bodies_are_gaps_in_stretched_layers_and_the_layers_are_not() {
    for (around, b, first) in [(200, 1.0, 0.03), (200, 1.0, 0.0003), (400, 0.12, 0.0002)] {
        let (_, _, area) = gaps_of(&layers(around, 30, b, first), true);
        let body = 0.5 * TAU * b;
        assert!((area / body - 1.0).abs() < 0.03, "{around} {b} {first}: {area} of {body}");
    }
}

#[test]
fn a_body_of_four_steps_is_a_gap_in_a_lattice_and_chance_makes_none() {
    let mut flat = lattice(20, 0.5, |p| p[2] == 0);
    let (_, gaps, _) = gaps_of(&flat, true);
    assert_eq!(gaps, 0);
    flat.retain(|p| !(p[0] > 3.9 && p[0] < 5.6 && p[1] > 3.9 && p[1] < 5.6));
    let (_, gaps, area) = gaps_of(&flat, true);
    assert!(gaps > 4 && area > 0.5 * 2.5 * 2.5, "{gaps} {area}");
    let mut chance = Random(11).points(30_000);
    chance.iter_mut().for_each(|p| p[2] = 0.0);
    // Where the hull is rough, and nowhere inside: of seven clouds, this one alone has a place that
    // is so empty beside one so dense, of three cells, which are closed.
    let s = Snapped::new(&chance);
    let mut at = vec![DVec3::ZERO; s.len()];
    s.place_of.iter().zip(&chance).for_each(|(i, p)| at[*i as usize] = DVec3::from(*p));
    let cells = triangles(&s).unwrap();
    let found = gaps::find(&at, &cells, SPACINGS);
    let mean_distance = 30_000f64.sqrt().recip();
    let is_inside = |cell: &[u32; 3]| {
        cell.iter().any(|p| {
            let p = at[*p as usize].truncate();
            p.min(1.0 - p).min_element() > 4.0 * mean_distance
        })
    };
    let inside = cells.iter().zip(&found.is_gap).filter(|(cell, gap)| **gap && is_inside(cell));
    assert_eq!(inside.count(), 0);
    // A body among them is found.
    let is_outside = |p: &[f64; 3]| (p[0] - 0.5).hypot(p[1] - 0.5) > 8.0 * mean_distance;
    chance.retain(is_outside);
    let (_, _, area) = gaps_of(&chance, true);
    let body = 0.5 * TAU * (8.0 * mean_distance).powi(2);
    assert!(area > 0.9 * body, "{area} of {body}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]
    #[test]
    fn few_points_on_few_integers_are_triangulated_or_degenerate(
        points in prop::collection::vec(prop::array::uniform3(0u8..4), 0..40),
    ) {
        let points: Vec<[f64; 3]> = points.iter().map(|p| p.map(f64::from)).collect();
        if tetrahedra(&Snapped::new(&points)).is_ok() {
            check(&points);
        }
    }

    #[test]
    fn any_finite_points_are_triangulated_or_degenerate(
        points in prop::collection::vec(prop::array::uniform3(-1e308f64..1e308), 0..30),
        shrink in prop::array::uniform3(prop::sample::select(vec![1.0, 1e-9, 1e-320, 0.0])),
    ) {
        let points: Vec<[f64; 3]> =
            points.iter().map(|p| [0, 1, 2].map(|a| p[a] * shrink[a])).collect();
        if tetrahedra(&Snapped::new(&points)).is_ok() {
            check(&points);
        }
        let _ = triangles(&Snapped::new(&points));
    }
}
