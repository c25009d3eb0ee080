//! The calls of the Python packages, made from Rust: what the way through Python costs.

use anyhow::Context as _;
use rayon::prelude::*;
use rt_core::bvh::World;
use rt_core::glam::{DVec3, Vec3};
use rt_core::mesh::TriMesh;
use rt_core::prelude::{BuildOptions, Ray};
use rt_core::ray::{HitBlock, LANES, NO_HIT, RayBlock};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Rays that a thread takes at a time.
const CHUNK: usize = 1024;

/// What the program in Python asks.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Question {
    /// To take this mesh from now on.
    Mesh { vertices: PathBuf, triangles: PathBuf },
    /// How long the first hits of these rays take.
    First(Rays),
}

/// Rays of a call, and for how long to repeat it.
#[derive(Deserialize)]
pub(super) struct Rays {
    origins: PathBuf,
    directions: PathBuf,
    from: Form,
    turn_seconds: f64,
    long_seconds: f64,
}

/// How the program in Rust has its rays.
#[derive(Deserialize, Clone, Copy, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
enum Form {
    /// As Python has them: the call makes blocks, and arrays of t, primitive, uv and normal.
    Arrays,
    /// In blocks: the call is the traversal alone.
    Blocks,
}

#[derive(Serialize)]
pub(super) struct Answer {
    seconds: f64,
    found: usize,
}

/// The answers of a call.
#[derive(Default)]
struct Hits {
    t: Vec<f32>,
    primitive: Vec<u32>,
    uv: Vec<[f32; 2]>,
    normal: Vec<[f32; 3]>,
}

/// The mesh and the rays that were asked for last.
#[derive(Default)]
pub(super) struct FromRust {
    mesh: Option<(Arc<TriMesh>, World)>,
    rays: Option<((PathBuf, PathBuf), Vec<Ray>)>,
}

impl FromRust {
    pub(super) fn answer(&mut self, question: Question) -> anyhow::Result<Answer> {
        match question {
            Question::Mesh { vertices, triangles } => {
                let positions = rows::<f32>(&vertices)?.into_iter().map(Vec3::from).collect();
                let mesh = Arc::new(TriMesh::new(positions, rows::<u32>(&triangles)?));
                let world = World::from_mesh(mesh.clone(), &BuildOptions::default())?;
                (self.mesh, self.rays) = (Some((mesh, world)), None);
                Ok(Answer { seconds: 0.0, found: 0 })
            }
            Question::First(of) => {
                let files = (of.origins.clone(), of.directions.clone());
                if self.rays.as_ref().is_none_or(|(known, _)| *known != files) {
                    let pairs = rows::<f32>(&of.origins)?.into_iter().zip(rows(&of.directions)?);
                    let rays = pairs.map(|(o, d): (_, [f32; 3])| Ray::new(o.into(), d.into()));
                    self.rays = Some((files, rays.collect()));
                }
                let (mesh, world) = self.mesh.as_ref().context("rays before a mesh")?;
                let rays = &self.rays.as_ref().context("no rays")?.1;
                Ok(match of.from {
                    Form::Arrays => turn(&of, || {
                        let hits = first_hits(mesh, world, rays);
                        hits.primitive.par_iter().filter(|p| **p != NO_HIT).count()
                    }),
                    Form::Blocks => {
                        let blocks = RayBlock::from_rays(rays);
                        let mut hits = vec![HitBlock::MISS; blocks.len()];
                        turn(&of, || traverse(world, &blocks, &mut hits))
                    }
                })
            }
        }
    }
}

/// The seconds of one call, by the rule of the program in Python.
fn turn(of: &Rays, mut call: impl FnMut() -> usize) -> Answer {
    let start = Instant::now();
    let mut found = call();
    let first = start.elapsed().as_secs_f64();
    if first > of.long_seconds {
        return Answer { seconds: first, found };
    }
    let (start, mut calls) = (Instant::now(), 0);
    loop {
        found = call();
        calls += 1;
        let seconds = start.elapsed().as_secs_f64();
        if seconds > of.turn_seconds {
            return Answer { seconds: seconds / f64::from(calls), found };
        }
    }
}

fn traverse(world: &World, blocks: &[RayBlock], hits: &mut [HitBlock]) -> usize {
    let pairs = blocks.par_chunks(CHUNK / LANES).zip(hits.par_chunks_mut(CHUNK / LANES));
    let count = pairs.map(|(blocks, hits)| {
        let traced = world.closest_incoherent(blocks, hits);
        debug_assert!(traced.is_ok(), "as many blocks of hits as of rays");
        hits.iter().flat_map(|h| h.prim).filter(|p| *p != NO_HIT).count()
    });
    count.sum()
}

/// The answers of `Scene.cast`, computed as a program in Rust would.
fn first_hits(mesh: &TriMesh, world: &World, rays: &[Ray]) -> Hits {
    let n = rays.len();
    let mut all = Hits {
        t: vec![0.0; n],
        primitive: vec![0; n],
        uv: vec![[0.0; 2]; n],
        normal: vec![[0.0; 3]; n],
    };
    let parts = all.t.par_chunks_mut(CHUNK).zip(all.primitive.par_chunks_mut(CHUNK));
    let parts = parts.zip(all.uv.par_chunks_mut(CHUNK)).zip(all.normal.par_chunks_mut(CHUNK));
    parts.zip(rays.par_chunks(CHUNK)).for_each(|((((t, primitive), uv), normal), rays)| {
        let blocks = RayBlock::from_rays(rays);
        let mut hits = vec![HitBlock::MISS; blocks.len()];
        let traced = world.closest_incoherent(&blocks, &mut hits);
        debug_assert!(traced.is_ok(), "as many blocks of hits as of rays");
        for i in 0..rays.len() {
            let hit = hits[i / LANES].get(i % LANES);
            t[i] = hit.map_or(f32::INFINITY, |h| h.t);
            primitive[i] = hit.map_or(NO_HIT, |h| h.prim);
            uv[i] = hit.map_or([0.0; 2], |h| [h.u, h.v]);
            normal[i] = hit.map_or([0.0; 3], |h| {
                let [a, b, c] = mesh.triangle(h.prim as usize).map(|p: Vec3| p.as_dvec3());
                let normal: DVec3 = (b - a).cross(c - a).normalize_or_zero();
                normal.as_vec3().to_array()
            });
        }
    });
    all
}

/// A number of four bytes.
trait Number: Sized {
    fn of(bytes: [u8; 4]) -> Self;
}

impl Number for f32 {
    fn of(bytes: [u8; 4]) -> f32 {
        f32::from_ne_bytes(bytes)
    }
}

impl Number for u32 {
    fn of(bytes: [u8; 4]) -> u32 {
        u32::from_ne_bytes(bytes)
    }
}

/// The rows of three numbers in a file of numbers alone.
fn rows<T: Number>(path: &Path) -> anyhow::Result<Vec<[T; 3]>> {
    let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
    let (rows, rest) = bytes.as_chunks::<12>();
    anyhow::ensure!(rest.is_empty(), "{}: {} bytes are no rows", path.display(), bytes.len());
    let number = |row: &[u8; 12], k: usize| T::of([0, 1, 2, 3].map(|b| row[4 * k + b]));
    Ok(rows.iter().map(|row| [0, 1, 2].map(|k| number(row, k))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_of_a_call_find_the_same_hits() {
        let folder = tempfile::tempdir().unwrap();
        let keep = |name: &str, numbers: &[[f32; 3]]| {
            let bytes: Vec<u8> =
                numbers.as_flattened().iter().flat_map(|n| n.to_ne_bytes()).collect();
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            path
        };
        let vertices = keep("v", &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        // 0, 1 and 2 as integers.
        let triangles = keep("t", &[[0, 1, 2].map(f32::from_bits)]);
        let mut rust = FromRust::default();
        rust.answer(Question::Mesh { vertices, triangles }).unwrap();
        let origins: Vec<_> = (0..50).map(|i| [0.04 * i as f32, 0.1, 1.0]).collect();
        let origins = keep("o", &origins);
        let directions = keep("d", &[[0.0, 0.0, -1.0]; 50]);
        for from in [Form::Arrays, Form::Blocks] {
            let rays = Rays {
                origins: origins.clone(),
                directions: directions.clone(),
                from,
                turn_seconds: 0.0,
                long_seconds: 1.0,
            };
            let answer = rust.answer(Question::First(rays)).unwrap();
            assert_eq!(answer.found, 23);
            assert!(answer.seconds > 0.0);
        }
        assert!(rows::<f32>(&keep("short", &[])).unwrap().is_empty());
    }
}
