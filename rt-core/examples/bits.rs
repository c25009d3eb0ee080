//! Answers of the Rust library, for the Python tests to compare bit for bit.
//!
//! Reads three counts as u64 (vertices, triangles, rays), then vertices (f32), triangles (u32),
//! origins and directions (f32), all little-endian, from standard input. Writes t, u, v (f32) and
//! the triangle (u32) of each ray, one after the other.

use rt_core::glam::Vec3;
use rt_core::prelude::{BuildOptions, TriMesh, World};
use rt_core::ray::NO_HIT;
use std::io::{Read, Write};

type Fault = Box<dyn std::error::Error>;

fn main() -> Result<(), Fault> {
    let mut bytes = Vec::new();
    std::io::stdin().read_to_end(&mut bytes)?;
    let mut rest = bytes.as_slice();
    let mut counts = [0usize; 3];
    for count in &mut counts {
        let (head, tail) = rest.split_first_chunk::<8>().ok_or("three counts are needed")?;
        (*count, rest) = (usize::try_from(u64::from_le_bytes(*head))?, tail);
    }
    let mut words = rest.as_chunks::<4>().0.iter().copied();
    let mut three = || {
        let mut next = || words.next().ok_or("the numbers end early");
        Ok::<_, Fault>([next()?, next()?, next()?])
    };
    let mut rows = |n: usize| (0..n).map(|_| three()).collect::<Result<Vec<_>, Fault>>();
    let vector = |w: [[u8; 4]; 3]| Vec3::from(w.map(f32::from_le_bytes));
    let positions = rows(counts[0])?.into_iter().map(vector).collect();
    let triangles = rows(counts[1])?.into_iter().map(|w| w.map(u32::from_le_bytes)).collect();
    let (origins, directions) = (rows(counts[2])?, rows(counts[2])?);
    let world = World::from_mesh(TriMesh::new(positions, triangles), &BuildOptions::default())?;
    let mut out = Vec::new();
    for (origin, direction) in origins.into_iter().zip(directions) {
        let (origin, direction) = (vector(origin), vector(direction));
        let (ray, moved) = world.ray_from_world(origin.as_dvec3(), direction.as_dvec3());
        let hit = world.closest(&ray);
        let numbers =
            hit.map_or([f32::INFINITY, 0.0, 0.0], |h| [(f64::from(h.t) + moved) as f32, h.u, h.v]);
        numbers.iter().for_each(|n| out.extend(n.to_le_bytes()));
        out.extend(hit.map_or(NO_HIT, |h| h.prim).to_le_bytes());
    }
    std::io::stdout().write_all(&out)?;
    Ok(())
}
