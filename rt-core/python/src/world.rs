//! The class that holds a world, and building it.

use crate::work::{Length, run};
use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rt_core::bvh::{BuildError, Robustness, Storage};
use rt_core::glam::{DAffine3, DVec3};
use rt_core::mesh::MeshSlices;
use rt_core::prelude::{BuildOptions, Instance};
use std::ops::ControlFlow;

/// Builds of at least this size look for Ctrl-C.
const MANY_TRIANGLES: usize = 1 << 15;

/// Positions relative to an origin, triangles, and the origin.
pub(crate) type MeshArrays<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<u32>>, [f64; 3]);

/// One mesh: the arrays that it was built from. The tree has its own copy of the corners; normals
/// come from these.
pub(crate) struct Mesh {
    positions: Py<PyArray2<f32>>,
    triangles: Py<PyArray2<u32>>,
}

/// A tree of meshes, and the arrays that it was built from.
#[pyclass(frozen, module = "rt_core._rt_core")]
pub(crate) struct World {
    pub(crate) world: rt_core::bvh::World,
    meshes: Vec<Mesh>,
    /// For each mesh the number of triangles in those before it, and the number of all.
    pub(crate) firsts: Vec<u32>,
}

/// The arrays of a mesh while a call reads them.
pub(crate) struct Borrowed<'py> {
    positions: PyReadonlyArray2<'py, f32>,
    triangles: PyReadonlyArray2<'py, u32>,
}

/// The same as slices.
#[derive(Clone, Copy)]
pub(crate) struct Corners<'a> {
    positions: &'a [[f32; 3]],
    triangles: &'a [[u32; 3]],
}

impl Borrowed<'_> {
    pub(crate) fn corners(&self) -> PyResult<Corners<'_>> {
        Ok(Corners {
            positions: self.positions.as_slice()?.as_chunks().0,
            triangles: self.triangles.as_slice()?.as_chunks().0,
        })
    }
}

impl Corners<'_> {
    /// The corners of a triangle; `None` of arrays that were changed since the build.
    #[inline]
    pub(crate) fn triangle(&self, triangle: u32) -> Option<[[f32; 3]; 3]> {
        let ids = self.triangles.get(triangle as usize)?;
        let [a, b, c] = ids.map(|k| self.positions.get(k as usize));
        Some([*a?, *b?, *c?])
    }
}

impl World {
    pub(crate) fn num_meshes(&self) -> usize {
        self.meshes.len()
    }

    /// The arrays of some meshes.
    pub(crate) fn borrow<'py>(
        &self,
        py: Python<'py>,
        meshes: impl Iterator<Item = usize>,
    ) -> PyResult<Vec<Borrowed<'py>>> {
        let borrow = |mesh: usize| {
            let mesh = &self.meshes[mesh];
            Ok(Borrowed {
                positions: mesh.positions.bind(py).try_readonly()?,
                triangles: mesh.triangles.bind(py).try_readonly()?,
            })
        };
        meshes.map(borrow).collect()
    }
}

impl World {
    /// Builds the tree of `meshes`.
    pub(crate) fn build(
        py: Python<'_>,
        meshes: Vec<MeshArrays<'_>>,
        quality: &str,
        robustness: &str,
        storage: &str,
        threads: usize,
    ) -> PyResult<World> {
        let quality = quality.parse().map_err(|e| PyValueError::new_err(format!("{e}")))?;
        let robustness = Robustness::ALL.into_iter().find(|r| r.name() == robustness);
        let robustness = robustness.ok_or_else(|| {
            let names = Robustness::ALL.map(Robustness::name).join(" or ");
            PyValueError::new_err(format!("there is no such robustness; give {names}"))
        })?;
        let storage = Storage::ALL.into_iter().find(|s| s.name() == storage);
        let storage = storage.ok_or_else(|| {
            let names = Storage::ALL.map(Storage::name).join(" or ");
            PyValueError::new_err(format!("there is no such storage; give {names}"))
        })?;
        let options = BuildOptions { quality, robustness, storage, ..BuildOptions::default() };
        let mut arrays = Vec::with_capacity(meshes.len());
        for (p, t, origin) in &meshes {
            let mesh = Borrowed { positions: p.try_readonly()?, triangles: t.try_readonly()? };
            arrays.push((mesh, *origin));
        }
        let slices = arrays.iter().map(|(arrays, origin)| {
            let (p, t) = (arrays.positions.as_slice()?, arrays.triangles.as_slice()?);
            PyResult::Ok(MeshSlices { origin: DVec3::from(*origin), ..MeshSlices::new(p, t) })
        });
        let slices: Vec<MeshSlices<'_>> = slices.collect::<PyResult<_>>()?;
        let placed = |geometry| Instance { geometry, world_from_object: DAffine3::IDENTITY };
        let instances = (0..slices.len()).map(placed).collect();
        let mut firsts = vec![0u32];
        for mesh in &slices {
            let next = u32::try_from(mesh.num_triangles())
                .ok()
                .and_then(|n| firsts[firsts.len() - 1].checked_add(n));
            firsts.push(next.ok_or_else(|| {
                PyValueError::new_err("meshes have 2**32 triangles or more; make several scenes")
            })?);
        }
        let many = firsts[firsts.len() - 1] as usize >= MANY_TRIANGLES;
        let length = if many { Length::Long } else { Length::Short };
        let build = |stop: &crate::work::Stop| {
            let watch = |_| {
                if stop.is_asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            rt_core::bvh::World::from_slices_watched(&slices, instances, &options, watch)
        };
        let world = run(py, threads, length, build)?.map_err(|e| match e {
            BuildError::Mesh { .. } => PyValueError::new_err(e.to_string()),
            e => PyRuntimeError::new_err(e.to_string()),
        })?;
        let kept =
            |(p, t, _): MeshArrays<'_>| Mesh { positions: p.unbind(), triangles: t.unbind() };
        drop(slices);
        drop(arrays);
        Ok(World { world, meshes: meshes.into_iter().map(kept).collect(), firsts })
    }
}
