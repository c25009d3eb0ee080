//! One lattice of which ranks have bricks.

use super::{Group, PictureError};
use crate::blueprint::{Domain, Lattice};
use rt_core::glam::{DVec3, UVec3};

/// How far the first point of a brick may lie from a point of the lattice, distances of points.
/// Simulations compute origins as `low + i * h` or sum up lengths: both differ by a few roundings
/// of a coordinate, and this is far above them up to 2^31 points.
const OFF_LATTICE: f64 = 1e-3;

/// The lattice, and this rank's bricks of it.
pub(super) struct Bricks<'a> {
    /// Points per axis.
    pub(super) dims: UVec3,
    pub(super) origin: DVec3,
    pub(super) spacing: DVec3,
    pub(super) of_cells: bool,
    /// The first point of each brick in the whole, and the brick.
    pub(super) bricks: Vec<(UVec3, Lattice<'a>)>,
}

/// What a rank tells of a brick.
const NUMBERS: usize = 10;

/// Finds the lattice of which all ranks have bricks.
pub(super) fn agreed<'a>(
    group: &mut Group<'_>,
    domains: Result<Vec<Domain<'_, 'a>>, String>,
    topology: Option<&str>,
    array: &str,
) -> Result<Bricks<'a>, PictureError> {
    let mine = domains.and_then(|domains| {
        let all: Result<Vec<_>, _> =
            domains.iter().map(|domain| Lattice::of(domain, topology, array)).collect();
        let all = all.map_err(|e| e.to_string())?.into_iter().flatten();
        Ok(all.filter(|l| l.dims.iter().all(|n| *n > 0)).collect::<Vec<_>>())
    });
    let told = mine.as_ref().map(|all| all.iter().flat_map(numbers_of).collect::<Vec<u8>>());
    let mut all: Vec<(usize, [f64; NUMBERS])> = Vec::new();
    for (rank, bytes) in group.agree(&told.map_err(String::clone))?.iter().enumerate() {
        let numbers = bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b));
        let numbers: Vec<f64> = numbers.collect();
        all.extend(numbers.as_chunks().0.iter().map(|n| (rank, *n)));
    }
    let Some((_, first)) = all.first() else {
        return Err(contradiction(format!("no rank has points with `{array}`")));
    };
    let (spacing, of_cells) = (DVec3::new(first[6], first[7], first[8]), first[9]);
    let origin = all.iter().fold(DVec3::INFINITY, |low, (_, n)| low.min(vector(n, 3)));
    let mut dims = [0_u64; 3];
    for (rank, n) in &all {
        if vector(n, 6) != spacing {
            let found = vector(n, 6);
            let reason =
                format!("distances of points are {found} on rank {rank}, {spacing} on others");
            return Err(contradiction(reason));
        }
        if n[9] != of_cells {
            let reason = format!("`{array}` belongs to points on some ranks, to cells on others");
            return Err(contradiction(reason));
        }
        let steps = (vector(n, 3) - origin) / spacing;
        let off = (steps - steps.round()).abs();
        let on_lattice = off.max_element() <= OFF_LATTICE;
        if !on_lattice || steps.max_element() > f64::from(u32::MAX) {
            let place = vector(n, 3);
            let reason = format!(
                "a domain of rank {rank} begins at {place}, which is no whole number of steps of \
                 {spacing} from {origin}"
            );
            return Err(contradiction(reason));
        }
        for axis in 0..3 {
            dims[axis] =
                dims[axis].max((steps[axis].round() as u64).saturating_add(n[axis] as u64));
        }
    }
    if let Some(points) = dims.iter().find(|n| **n > u64::from(u32::MAX)) {
        return Err(contradiction(format!("{points} points along one axis are too many")));
    }
    let first_of = |lattice: &Lattice<'_>| {
        let steps = ((lattice.origin - origin) / spacing).round();
        UVec3::new(steps.x as u32, steps.y as u32, steps.z as u32)
    };
    let bricks = mine.unwrap_or_default().into_iter().map(|l| (first_of(&l), l)).collect();
    let dims = UVec3::from(dims.map(|n| n as u32));
    Ok(Bricks { dims, origin, spacing, of_cells: of_cells != 0.0, bricks })
}

fn contradiction(reason: String) -> PictureError {
    PictureError::Contradiction { reason }
}

fn vector(n: &[f64; NUMBERS], first: usize) -> DVec3 {
    DVec3::new(n[first], n[first + 1], n[first + 2])
}

fn numbers_of(lattice: &Lattice<'_>) -> Vec<u8> {
    let dims = lattice.dims.map(|n| n as f64);
    let [origin, spacing] = [lattice.origin, lattice.spacing].map(|v| v.to_array());
    let numbers = [&dims[..], &origin, &spacing, &[f64::from(u8::from(lattice.of_cells))]].concat();
    numbers.iter().flat_map(|v| v.to_le_bytes()).collect()
}
