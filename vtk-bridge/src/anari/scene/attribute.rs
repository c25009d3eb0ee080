//! Attributes: named values on geometries, read by materials and samplers.
//!
//! An attribute comes from the instance, or else from the geometry: per corner of a face, per
//! vertex, per primitive or one value for the whole geometry (ANARI 1.0, section "Geometry"). An
//! attribute that is not set is (0, 0, 0, 1).

use crate::anari::object::{Object, Value};
use rt_core::glam::{DAffine3, DMat3, DVec3};
use std::sync::Arc;

/// Names of the attributes that geometries and instances carry.
pub(crate) const SLOTS: &[&str] =
    &["color", "attribute0", "attribute1", "attribute2", "attribute3"];

/// The source of an attribute.
#[derive(Clone)]
pub(crate) enum Source {
    /// The same value everywhere.
    Uniform([f32; 4]),
    /// One value per primitive of the ANARI geometry.
    Primitive(Arc<Vec<[f32; 4]>>),
    /// One value per vertex, interpolated.
    Vertex(Arc<Vec<[f32; 4]>>),
    /// One value per corner of each primitive, interpolated.
    FaceVarying(Arc<Vec<[f32; 4]>>),
    /// The hit point itself, before or after the instance's transform.
    Position { world: bool },
    /// The shading normal, before or after the instance's transform.
    Normal { world: bool },
}

/// Maps the renderer's primitives to vertices and primitives of the ANARI geometry.
#[derive(Default)]
pub(crate) struct Topology {
    /// Vertices of each primitive of the renderer; one, two or three are used. Empty if there are
    /// no vertices.
    pub(crate) vertices: Vec<[u32; 3]>,
    /// Element indices of the arrays `faceVarying.*`.
    pub(crate) corners: Vec<[u32; 3]>,
    /// ANARI's index of each primitive.
    pub(crate) numbers: Numbers,
    /// Whether vertex 3t + k of the renderer's mesh is corner k of triangle t; otherwise the mesh
    /// has ANARI's vertices.
    pub(crate) unshared: bool,
}

/// ANARI's indices of the renderer's primitives.
#[derive(Default)]
pub(crate) enum Numbers {
    /// The same indices.
    #[default]
    Same,
    /// Indexed by the renderer's primitive.
    Listed(Vec<u32>),
    /// One index for all primitives.
    All(u32),
}

impl Topology {
    pub(crate) fn number(&self, primitive: u32) -> u32 {
        match &self.numbers {
            Numbers::Same => primitive,
            Numbers::Listed(list) => list.get(primitive as usize).copied().unwrap_or(u32::MAX),
            Numbers::All(n) => *n,
        }
    }
}

/// A point on a geometry, with the data that attributes need.
pub(crate) struct HitPoint<'a> {
    pub(crate) topology: &'a Topology,
    /// Index of the renderer's primitive.
    pub(crate) primitive: u32,
    /// Weights of its vertices.
    pub(crate) weights: [f32; 3],
    /// Position in object space.
    pub(crate) point: DVec3,
    /// Unit normal in object space.
    pub(crate) normal: DVec3,
    pub(crate) world_from_object: &'a DAffine3,
}

impl Source {
    /// Finds the attribute `name` of `geometry`; the instance may replace it.
    pub(crate) fn of(name: &str, geometry: &Object, instance: Option<&Object>) -> Option<Source> {
        match name {
            "worldPosition" | "objectPosition" => {
                return Some(Source::Position { world: name.starts_with('w') });
            }
            "worldNormal" | "objectNormal" => {
                return Some(Source::Normal { world: name.starts_with('w') });
            }
            slot if SLOTS.contains(&slot) => {}
            _ => return None,
        }
        let uniform = |o: &Object| match o.parameters().get(name) {
            Some(Value::Bytes(t, b)) => Some(t.attribute(b)),
            _ => None,
        };
        if let Some(v) = instance.and_then(uniform) {
            return Some(Source::Uniform(v));
        }
        let array = |prefix: &str| {
            let values =
                geometry.object(&format!("{prefix}.{name}"))?.with_array(|a| a.attributes())?;
            (!values.is_empty()).then(|| Arc::new(values))
        };
        Some(if let Some(v) = array("faceVarying") {
            Source::FaceVarying(v)
        } else if let Some(v) = array("vertex") {
            Source::Vertex(v)
        } else if let Some(v) = array("primitive") {
            Source::Primitive(v)
        } else {
            Source::Uniform(uniform(geometry).unwrap_or([0.0, 0.0, 0.0, 1.0]))
        })
    }

    /// The value at a point; elements past the end of an array are (0, 0, 0, 1).
    pub(crate) fn at(&self, p: &HitPoint<'_>) -> [f32; 4] {
        let get =
            |v: &[[f32; 4]], i: u32| v.get(i as usize).copied().unwrap_or([0.0, 0.0, 0.0, 1.0]);
        let mix = |v: &[[f32; 4]], ids: &[[u32; 3]]| {
            let Some(ids) = ids.get(p.primitive as usize) else { return [0.0, 0.0, 0.0, 1.0] };
            let mut sum = [0f32; 4];
            for (id, w) in ids.iter().zip(p.weights).filter(|(_, w)| *w != 0.0) {
                let value = get(v, *id);
                (0..4).for_each(|c| sum[c] += w * value[c]);
            }
            sum
        };
        let vector = |v: DVec3| [v.x as f32, v.y as f32, v.z as f32, 1.0];
        match self {
            Source::Uniform(v) => *v,
            Source::Primitive(v) => get(v, p.topology.number(p.primitive)),
            Source::Vertex(v) => mix(v, &p.topology.vertices),
            Source::FaceVarying(v) => mix(v, &p.topology.corners),
            Source::Position { world: false } => vector(p.point),
            Source::Position { world: true } => {
                vector(p.world_from_object.transform_point3(p.point))
            }
            Source::Normal { world: false } => vector(p.normal),
            Source::Normal { world: true } => {
                let m: DMat3 = p.world_from_object.matrix3.inverse().transpose();
                vector((m * p.normal).normalize_or_zero())
            }
        }
    }

    /// How the renderer must evaluate the attribute to be exact everywhere.
    pub(crate) fn domain(&self) -> Domain {
        match self {
            Source::Uniform(_) => Domain::Constant,
            Source::Primitive(_) => Domain::Face,
            Source::Vertex(_) | Source::FaceVarying(_) | Source::Position { .. } => Domain::Linear,
            Source::Normal { .. } => Domain::Hit,
        }
    }
}

/// How a value varies over a geometry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Domain {
    /// Constant on the whole geometry.
    Constant,
    /// Constant on each primitive.
    Face,
    /// Linear between vertices.
    Linear,
    /// A texture at coordinates that are linear between vertices.
    Texture,
    /// Arbitrary: must be computed at every hit.
    Hit,
}
