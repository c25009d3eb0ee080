//! Delaunay triangulation of points in space, by inserting one after the other: A. Bowyer,
//! "Computing Dirichlet tessellations", and D. F. Watson, "Computing the n-dimensional Delaunay
//! tessellation", The Computer Journal 24, 1981.

use super::Degenerate;
use super::predicates::{Place, orientation};
use super::snap::Snapped;
use super::tetrahedra::Tetrahedra;

/// The tetrahedra of the places, by their numbers, with the order of VTK.
pub(crate) fn tetrahedra(points: &Snapped) -> Result<Vec<[u32; 4]>, Degenerate> {
    let places = &points.places;
    let first = first_tetrahedron(places)?;
    let mut all = Tetrahedra::of_one(first, places.len());
    for point in insertion_order(places.len()) {
        if !first.contains(&point) {
            all.insert(places, point);
        }
    }
    Ok(all.finite().collect())
}

/// Four points that are not in a plane, with orientation 1.
fn first_tetrahedron(places: &[Place]) -> Result<[u32; 4], Degenerate> {
    let [a, b] = match places {
        [a, .., b] => [*a, *b],
        _ => return Err(Degenerate::Line),
    };
    let on_line = |c: Place| {
        let u = [0, 1, 2].map(|k| i128::from(b[k] - a[k]));
        let v = [0, 1, 2].map(|k| i128::from(c[k] - a[k]));
        (0..3).all(|k| u[k] * v[(k + 1) % 3] == u[(k + 1) % 3] * v[k])
    };
    let c = places.iter().position(|c| !on_line(*c)).ok_or(Degenerate::Line)?;
    let side = |d: Place| orientation(a, b, places[c], d);
    let d = places.iter().position(|d| side(*d) != 0).ok_or(Degenerate::Plane)?;
    let last = places.len() as u32 - 1;
    let (c, d, sign) = (c as u32, d as u32, side(places[d]));
    Ok(if sign > 0 { [0, last, c, d] } else { [last, 0, c, d] })
}

/// Rounds of points, each about twice as many as all before, and along the Hilbert curve in each:
/// the biased randomized insertion order of N. Amenta, S. Choi and G. Rote (2003). Along the curve
/// alone, points on surfaces can take quadratic time.
fn insertion_order(count: usize) -> Vec<u32> {
    let round = |i: u32| hash(i).trailing_zeros().min(20);
    (0..=20).rev().flat_map(|r| (0..count as u32).filter(move |i| round(*i) == r)).collect()
}

/// A number that looks random: the finalizer of MurmurHash3.
fn hash(i: u32) -> u32 {
    let mut h = i ^ 0x9e37_79b9;
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}
