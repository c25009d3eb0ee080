//! Batches of earlier frames, which may be repeated vertex by vertex.

use super::VertexRecorder;
use super::attribute_stream::same_bits;
use crate::capture::draw::{Attributes, Values};
use crate::capture::geometry_cache::Geometry;
use crate::capture::primitives::PrimitiveRun;
use crate::capture::primitives::QuadSplit;
use crate::state::material::Materials;
use rt_core::mesh::TriMesh;
use std::sync::Arc;

/// A batch of an earlier frame, which may be repeated vertex by vertex.
pub(super) struct EarlierBatch {
    geometry: Arc<Geometry>,
    pub(super) mesh: Arc<TriMesh>,
    runs: Vec<PrimitiveRun>,
    kind: QuadSplit,
    frame: u64,
    /// Its normals, once nobody else needs them, and the version of their attributes.
    normals: Option<(Vec<[f32; 3]>, u64)>,
    /// The other attributes of that version, if they are the same for all vertices.
    constants: Option<ConstantAttributes>,
}

/// Attributes that are the same for all vertices of a batch.
#[derive(Clone, PartialEq)]
pub(super) struct ConstantAttributes {
    version: u64,
    /// The normal of batches with only one.
    normal: Option<[u32; 3]>,
    color: [u32; 4],
    tex: [u32; 4],
    materials: Materials,
}

impl VertexRecorder {
    /// The normals vary: they are compared with those of the earlier batch, or all are stored.
    #[cold]
    pub(super) fn vary_normals(&mut self) {
        let expected = self.expected.as_ref().and_then(|mesh| {
            let first = mesh.positions.first()?.to_array().map(f32::to_bits);
            let e = self.earlier.get_mut(&first)?;
            let (values, version) = e.normals.take()?;
            (values.len() == mesh.positions.len()).then_some((values, version))
        });
        let Some((mut values, version)) = expected else { return self.normals.vary(self.flushed) };
        let (before, constant) = (&mut values[..self.flushed], self.normals.constant);
        self.changed = !before.iter().all(|v| same_bits(&[*v], &[constant]));
        before.fill(constant);
        self.kept = Some(version);
        self.normals.values = values;
        self.normals.varying = true;
    }

    /// The geometry of the batch, if it repeats an earlier one completely.
    pub(crate) fn take_followed_geometry(&mut self, kind: &QuadSplit) -> Option<Arc<Geometry>> {
        let mesh = self.expected.as_ref()?;
        let first = mesh.positions[0].to_array().map(f32::to_bits);
        let e = self.earlier.get_mut(&first)?;
        let whole = self.count == mesh.positions.len() && Arc::ptr_eq(&e.mesh, mesh);
        if !whole || e.kind != *kind || e.runs != self.runs {
            return None;
        }
        e.frame = self.frame;
        self.expected = None;
        Some(e.geometry.clone())
    }

    /// Remembers the batch, because it may be repeated.
    pub(crate) fn remember_batch(&mut self, geometry: &Arc<Geometry>, kind: &QuadSplit) {
        const WORTH_FOLLOWING: usize = 1000;
        if self.positions.len() >= WORTH_FOLLOWING {
            let (geometry, mesh) = (geometry.clone(), geometry.mesh.clone());
            let (runs, kind, frame) = (self.runs.clone(), kind.clone(), self.frame);
            let e =
                EarlierBatch { geometry, mesh, runs, kind, frame, normals: None, constants: None };
            self.earlier.insert(self.positions[0].map(f32::to_bits), e);
        }
    }

    /// Ends a frame: batches that were not repeated are no longer expected.
    pub(crate) fn frame_done(&mut self) {
        const KEPT_FRAMES: u64 = 3;
        self.frame += 1;
        let now = self.frame;
        self.earlier.retain(|_, e| now - e.frame <= KEPT_FRAMES);
    }

    fn earlier(&mut self, geometry: &Arc<Geometry>) -> Option<&mut EarlierBatch> {
        let first = geometry.mesh.positions.first()?.to_array().map(f32::to_bits);
        self.earlier.get_mut(&first).filter(|e| Arc::ptr_eq(&e.geometry, geometry))
    }

    /// Takes attributes that are no longer needed. Their memory is reused, and the next batch is
    /// compared with the normals.
    pub(crate) fn recycle(&mut self, a: Attributes, geometry: &Arc<Geometry>) {
        let version = a.version;
        let mut normals = a.normals;
        if let Values::PerVertex(v) = &mut normals
            && version != 0
            && let Some(e) = self.earlier(geometry)
            && v.len() == e.mesh.positions.len()
        {
            let old = e.normals.replace((std::mem::take(v), version));
            normals = old.map_or(Values::Constant([0.0; 3]), |(v, _)| Values::PerVertex(v));
        }
        self.normals.recycle(normals);
        self.colors.recycle(a.colors);
        self.tex.recycle(a.tex);
    }

    /// The version of the attributes of a batch that may be repeated: the former version if they
    /// equal those of the previous frame. 0 for others.
    pub(super) fn version(&mut self, geometry: &Arc<Geometry>) -> u64 {
        let one = self.normals.constant.map(f32::to_bits);
        let mut constants = ConstantAttributes {
            version: self.versions + 1,
            normal: (!self.normals.varying).then_some(one),
            color: self.colors.constant.map(f32::to_bits),
            tex: self.tex.constant.map(f32::to_bits),
            materials: self.materials.first().copied().unwrap_or_default(),
        };
        let (kept, changed, varying) = (self.kept, self.changed, self.normals.varying);
        let plain = !self.more && self.materials.len() == 1;
        let Some(e) = self.earlier(geometry) else { return 0 };
        let before = e.constants.take();
        let mut version = constants.version;
        if plain {
            if let Some(before) = before {
                let unchanged =
                    if varying { kept == Some(before.version) && !changed } else { true };
                constants.version = before.version;
                if unchanged && constants == before {
                    version = before.version;
                }
                constants.version = version;
            }
            e.constants = Some(constants);
        }
        self.versions = self.versions.max(version);
        version
    }
}
