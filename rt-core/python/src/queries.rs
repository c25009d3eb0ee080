//! Questions about many rays or points at once.

use crate::normals::{unit_normal, write_normals};
use crate::parts::{POINTS, for_each, length_of, length_of_points, map, part_size};
use crate::rays::{FirstFault, Rays, Real, row};
use crate::work::{Stop, run};
use crate::world::{Corners, World};
use numpy::{
    Element, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyReadwriteArray1, PyReadwriteArray2,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rt_core::glam::Vec3;
use rt_core::ray::{Hit, HitBlock, LANES, NO_HIT, RayBlock};

/// Meshes whose arrays are borrowed before it is known which are hit, in calls of fewer rays.
const BORROWED_AT_ONCE: usize = 16;

pub(crate) type Any<'py> = Bound<'py, PyAny>;

/// The arrays of a call's rays.
pub(crate) struct RayArrays<'py, T: Element> {
    origins: PyReadonlyArray2<'py, T>,
    directions: PyReadonlyArray2<'py, T>,
    t_max: Option<PyReadonlyArray1<'py, T>>,
    t_min: f64,
}

impl<'py, T: Real> RayArrays<'py, T> {
    pub(crate) fn new(
        origins: &Any<'py>,
        directions: &Any<'py>,
        t_min: f64,
        t_max: Option<&Any<'py>>,
    ) -> PyResult<Self> {
        let rows = |a: &Any<'py>| PyResult::Ok(a.cast::<PyArray2<T>>()?.try_readonly()?);
        let numbers = |a: &Any<'py>| PyResult::Ok(a.cast::<PyArray1<T>>()?.try_readonly()?);
        Ok(RayArrays {
            origins: rows(origins)?,
            directions: rows(directions)?,
            t_max: t_max.map(numbers).transpose()?,
            t_min,
        })
    }

    pub(crate) fn rays(&self) -> PyResult<Rays<'_, T>> {
        let (origins, directions) = (self.origins.as_slice()?, self.directions.as_slice()?);
        let t_max = self.t_max.as_ref().map_or(Ok(&[][..]), |t| t.as_slice())?;
        let rays = origins.len() / 3;
        let sound = origins.len() == 3 * rays
            && directions.len() == origins.len()
            && (self.t_max.is_none() || t_max.len() == rays);
        if !sound {
            return Err(PyValueError::new_err("arrays of rays differ in their numbers of rows"));
        }
        Ok(Rays { origins, directions, t_min: self.t_min, t_max })
    }
}

/// One pair of neighbours in this many is looked at.
const BETWEEN_PAIRS: usize = 8;

/// Whether neighbouring rays go nearly the same way, so that packets pay. Answers do not depend on
/// it.
fn are_coherent(blocks: &[RayBlock]) -> bool {
    let similar = |first: usize, b: &RayBlock| {
        let [a, b] = [first, first + 1].map(|lane| b.get(lane).dir);
        a.dot(b) > 0.99 * (a.length_squared() * b.length_squared()).sqrt()
    };
    let pairs = blocks.iter().flat_map(|b| (0..LANES).step_by(BETWEEN_PAIRS).map(move |i| (i, b)));
    let count = pairs.clone().count();
    8 * pairs.filter(|(i, b)| similar(*i, b)).count() >= 7 * count
}

/// A thread's part of the rays.
pub(crate) struct Chunk {
    pub(crate) blocks: Vec<RayBlock>,
    coherent: bool,
}

impl Chunk {
    /// The rays from number `first` on; their origins' ways along them go to `moved`.
    pub(crate) fn of<T: Real>(
        world: &World,
        rays: &Rays<'_, T>,
        first: usize,
        count: usize,
        moved: &mut Vec<f64>,
        fault: &FirstFault,
    ) -> Chunk {
        let space = world.world.render_space();
        let mut blocks = vec![RayBlock::INACTIVE; count.div_ceil(LANES)];
        moved.clear();
        for i in 0..count {
            let Some((ray, way)) = rays.get(&space, first + i) else {
                // It meets nothing, and its call ends with an error.
                fault.note(first + i);
                moved.push(0.0);
                continue;
            };
            blocks[i / LANES].set(i % LANES, &ray);
            moved.push(way);
        }
        Chunk { coherent: are_coherent(&blocks), blocks }
    }

    fn closest(&self, world: &World, hits: &mut [HitBlock]) {
        let world = &world.world;
        let traced = match self.coherent {
            true => world.closest_coherent(&self.blocks, hits),
            false => world.closest_incoherent(&self.blocks, hits),
        };
        debug_assert!(traced.is_ok(), "as many blocks of hits as of rays");
    }

    fn occluded(&self, world: &World, masks: &mut [u16]) {
        let world = &world.world;
        let traced = match self.coherent {
            true => world.occluded_coherent(&self.blocks, masks),
            false => world.occluded_incoherent(&self.blocks, masks),
        };
        debug_assert!(traced.is_ok(), "as many masks as blocks of rays");
    }
}

/// An array that answers are written to, or a refusal.
fn answers<'a, T: Element>(
    array: &'a mut PyReadwriteArray1<'_, T>,
    rows: usize,
) -> PyResult<&'a mut [T]> {
    let slice = array.as_slice_mut()?;
    if slice.len() == rows {
        return Ok(slice);
    }
    Err(PyValueError::new_err(format!("{} answers for {rows} questions", slice.len())))
}

fn answers2<'a, T: Element>(
    array: &'a mut PyReadwriteArray2<'_, T>,
    rows: usize,
    columns: usize,
) -> PyResult<&'a mut [T]> {
    let slice = array.as_slice_mut()?;
    if slice.len() == rows * columns {
        return Ok(slice);
    }
    Err(PyValueError::new_err(format!("{} answers for {rows} questions", slice.len())))
}

impl World {
    /// The number of a hit's triangle among those of all meshes.
    pub(crate) fn number(&self, hit: &Hit) -> u32 {
        self.firsts[hit.instance as usize] + hit.prim
    }

    pub(crate) fn cast_rays<T: Real>(
        &self,
        py: Python<'_>,
        arrays: &RayArrays<'_, T>,
        out: (&Any<'_>, &Any<'_>, &Any<'_>, &Any<'_>),
        threads: usize,
    ) -> PyResult<()> {
        let rays = arrays.rays()?;
        let rows = rays.len();
        let mut t = out.0.cast::<PyArray1<T>>()?.try_readwrite()?;
        let mut primitive = out.1.cast::<PyArray1<u32>>()?.try_readwrite()?;
        let mut uv = out.2.cast::<PyArray2<f32>>()?.try_readwrite()?;
        let mut normal = out.3.cast::<PyArray2<f32>>()?.try_readwrite()?;
        let (t, primitive) = (answers(&mut t, rows)?, answers(&mut primitive, rows)?);
        let uv = answers2(&mut uv, rows, 2)?;
        // No rows where no normals are wanted.
        let wanted = normal.as_slice()?.len().min(1) * rows;
        let normal = answers2(&mut normal, wanted, 3)?;
        // To borrow the arrays of very many meshes takes longer than the rays of a short call.
        let at_once = self.num_meshes() <= rows.max(BORROWED_AT_ONCE);
        let borrowed = if at_once { self.borrow(py, 0..self.num_meshes())? } else { Vec::new() };
        let corners: Vec<Corners<'_>> =
            borrowed.iter().map(|b| b.corners()).collect::<PyResult<_>>()?;
        let fault = FirstFault::none();
        let work = |stop: &Stop| {
            let size = part_size(rows);
            let parts = t.chunks_mut(size).zip(primitive.chunks_mut(size));
            let parts = parts.zip(uv.as_chunks_mut::<2>().0.chunks_mut(size));
            // No rows where no normals are wanted.
            let normals = normal.as_chunks_mut::<3>().0.chunks_mut(size).map(Some);
            let normals = normals.chain(std::iter::repeat_with(|| None));
            let parts = parts.zip(normals).enumerate().collect();
            let scratch = || (Vec::new(), Vec::new());
            let trace = |(moved, hits): &mut (Vec<f64>, Vec<HitBlock>), (k, part)| {
                if stop.is_asked() {
                    return;
                }
                let (((t, primitive), uv), normal): (((&mut [T], &mut [u32]), _), _) = part;
                let (uv, normal): (&mut [[f32; 2]], Option<&mut [[f32; 3]]>) = (uv, normal);
                let chunk = Chunk::of(self, &rays, k * size, t.len(), moved, &fault);
                hits.resize(chunk.blocks.len(), HitBlock::MISS);
                chunk.closest(self, hits);
                for i in 0..t.len() {
                    let Some(hit) = hits[i / LANES].get(i % LANES) else {
                        t[i] = T::nearest(f64::INFINITY);
                        (primitive[i], uv[i]) = (NO_HIT, [0.0; 2]);
                        continue;
                    };
                    t[i] = T::nearest(f64::from(hit.t) + moved[i]);
                    primitive[i] = self.number(&hit);
                    uv[i] = [hit.u, hit.v];
                }
                if let Some(normal) = normal.filter(|_| at_once) {
                    write_normals(&corners, hits, normal);
                }
            };
            for_each(parts, scratch, trace);
        };
        run(py, threads, length_of(rows), work)?;
        if let Some(i) = fault.get() {
            return Err(rays.error(i));
        }
        if wanted > 0 && !at_once {
            self.normals_of_hit_meshes(py, primitive, normal.as_chunks_mut().0, threads)?;
        }
        Ok(())
    }

    /// Writes the normals of triangles by their numbers among those of all meshes, and borrows only
    /// the arrays of meshes that are hit.
    fn normals_of_hit_meshes(
        &self,
        py: Python<'_>,
        primitives: &[u32],
        normals: &mut [[f32; 3]],
        threads: usize,
    ) -> PyResult<()> {
        let mesh_of = |primitive: u32| self.firsts.partition_point(|first| *first <= primitive) - 1;
        let hit = |primitive: &&u32| **primitive != NO_HIT;
        let mut meshes: Vec<usize> = primitives.iter().filter(hit).map(|p| mesh_of(*p)).collect();
        meshes.sort_unstable();
        meshes.dedup();
        let borrowed = self.borrow(py, meshes.iter().copied())?;
        let corners: Vec<Corners<'_>> =
            borrowed.iter().map(|b| b.corners()).collect::<PyResult<_>>()?;
        let size = part_size(normals.len());
        let work = |_: &Stop| {
            let parts = normals.chunks_mut(size).zip(primitives.chunks(size)).collect();
            for_each(
                parts,
                || (),
                |(), (normals, primitives): (&mut [[f32; 3]], &[u32])| {
                    for (normal, primitive) in normals.iter_mut().zip(primitives) {
                        let found = (*primitive != NO_HIT).then(|| {
                            let mesh = mesh_of(*primitive);
                            let at = meshes.binary_search(&mesh).ok()?;
                            corners[at].triangle(primitive - self.firsts[mesh])
                        });
                        *normal = unit_normal(found.flatten().unwrap_or_default());
                    }
                },
            );
        };
        run(py, threads, length_of(primitives.len()), work)
    }

    pub(crate) fn occluded_rays<T: Real>(
        &self,
        py: Python<'_>,
        arrays: &RayArrays<'_, T>,
        out: &Any<'_>,
        threads: usize,
    ) -> PyResult<()> {
        let rays = arrays.rays()?;
        let mut out = out.cast::<PyArray1<bool>>()?.try_readwrite()?;
        let out = answers(&mut out, rays.len())?;
        let (fault, size) = (FirstFault::none(), part_size(rays.len()));
        let work = |stop: &Stop| {
            let trace = |(moved, masks): &mut (Vec<f64>, Vec<u16>),
                         (k, out): (usize, &mut [bool])| {
                if stop.is_asked() {
                    return;
                }
                let chunk = Chunk::of(self, &rays, k * size, out.len(), moved, &fault);
                masks.resize(chunk.blocks.len(), 0);
                chunk.occluded(self, masks);
                for (i, o) in out.iter_mut().enumerate() {
                    *o = masks[i / LANES] >> (i % LANES) & 1 == 1;
                }
            };
            let parts = out.chunks_mut(size).enumerate().collect();
            for_each(parts, || (Vec::new(), Vec::new()), trace);
        };
        run(py, threads, length_of(rays.len()), work)?;
        fault.get().map_or(Ok(()), |i| Err(rays.error(i)))
    }

    pub(crate) fn count_rays<T: Real>(
        &self,
        py: Python<'_>,
        arrays: &RayArrays<'_, T>,
        out: &Any<'_>,
        threads: usize,
    ) -> PyResult<()> {
        let rays = arrays.rays()?;
        let mut out = out.cast::<PyArray1<u32>>()?.try_readwrite()?;
        let out = answers(&mut out, rays.len())?;
        let (fault, size) = (FirstFault::none(), part_size(rays.len()));
        let work = |stop: &Stop| {
            let trace = |(moved, counts): &mut (Vec<f64>, Vec<[u32; LANES]>),
                         (k, out): (usize, &mut [u32])| {
                if stop.is_asked() {
                    return;
                }
                let chunk = Chunk::of(self, &rays, k * size, out.len(), moved, &fault);
                counts.resize(chunk.blocks.len(), [0; LANES]);
                let traced = self.world.count_hits_of_blocks(&chunk.blocks, counts);
                debug_assert!(traced.is_ok(), "as many blocks of counts as of rays");
                out.copy_from_slice(&counts.as_flattened()[..out.len()]);
            };
            let parts = out.chunks_mut(size).enumerate().collect();
            for_each(parts, || (Vec::new(), Vec::new()), trace);
        };
        run(py, threads, length_of(rays.len()), work)?;
        fault.get().map_or(Ok(()), |i| Err(rays.error(i)))
    }

    /// Whether a mesh encloses each point.
    pub(crate) fn enclosed_points<T: Real>(
        &self,
        py: Python<'_>,
        points: &Any<'_>,
        threads: usize,
    ) -> PyResult<Vec<bool>> {
        let points = points.cast::<PyArray2<T>>()?.try_readonly()?;
        let points = points.as_slice()?;
        let mut inside = vec![false; points.len() / 3];
        let (fault, size) = (FirstFault::none(), part_size(points.len() / 3));
        let work = |stop: &Stop| {
            let look = |places: &mut Vec<Vec3>, (k, inside): (usize, &mut [bool])| {
                if stop.is_asked() {
                    return;
                }
                places.clear();
                places.extend((0..inside.len()).map(|i| {
                    let point = row(points, k * size + i);
                    if !point.is_finite() {
                        fault.note(k * size + i);
                    }
                    self.world.render_from_world(point)
                }));
                let looked = self.world.encloses(places, inside);
                debug_assert!(looked.is_ok(), "as many answers as points");
            };
            for_each(inside.chunks_mut(size).enumerate().collect(), Vec::new, look);
        };
        run(py, threads, length_of(points.len() / 3), work)?;
        fault.get().map_or(Ok(inside), |i| Err(not_finite(points, i)))
    }

    pub(crate) fn points<T: Real, A: Send>(
        &self,
        py: Python<'_>,
        points: &Any<'_>,
        threads: usize,
        answer: impl Fn(Vec3) -> A + Sync,
    ) -> PyResult<Vec<Option<A>>> {
        let points = points.cast::<PyArray2<T>>()?.try_readonly()?;
        let points = points.as_slice()?;
        let rows = points.len() / 3;
        let fault = FirstFault::none();
        let work = |stop: &Stop| {
            let one = |i: usize| {
                let point = row(points, i);
                if !point.is_finite() {
                    fault.note(i);
                }
                (!stop.is_asked()).then(|| answer(self.world.render_from_world(point)))
            };
            let part = |k: usize| {
                let rows = k * POINTS..rows.min((k + 1) * POINTS);
                rows.map(one).collect::<Vec<_>>()
            };
            map(rows.div_ceil(POINTS), part).into_iter().flatten().collect::<Vec<_>>()
        };
        let found = run(py, threads, length_of_points(rows), work)?;
        fault.get().map_or(Ok(found), |i| Err(not_finite(points, i)))
    }
}

/// The error that names point `i`.
fn not_finite<T: Real>(points: &[T], i: usize) -> PyErr {
    let p = row(points, i);
    let numbers = format!("[{:?}, {:?}, {:?}]", p.x, p.y, p.z);
    PyValueError::new_err(format!("points[{i}] is {numbers}; give finite numbers"))
}

/// Points, distances, primitives, and u, v in turns.
pub(crate) type Closest<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<f32>>,
);
