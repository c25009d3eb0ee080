//! Geometries: converts arrays to the renderer's meshes and shapes, and records which vertices
//! belong to each primitive.

use super::Diagnostics;
use super::attribute::{Numbers, Topology};
use super::surface_color::{TriangleShape, Weights};
use super::volume::{grid_of, is_nearest};
use crate::anari::object::{Object, Value};
use rt_core::bvh::Geometry;
use rt_core::glam::{DVec3, Vec3, Vec4};
use rt_core::mesh::{Attribute, TriMesh};
use rt_core::ray::Ray;
use rt_core::shapes::{
    Cylinders, Isosurface, Radii, Shape, ShapeHit, ShapeSurface, Spheres, Tubes,
};
use std::sync::{Arc, OnceLock};

/// A geometry without its appearance.
pub(crate) struct Part {
    pub(crate) body: Body,
    pub(crate) topology: Arc<Topology>,
    /// The mesh as a shape, made only when a surface colour needs it. It is always the same shape,
    /// so that appearances share its tree.
    triangles: OnceLock<Arc<dyn Shape>>,
}

pub(crate) enum Body {
    Mesh(Arc<TriMesh>),
    Shape(Arc<dyn Shape>, Weights),
}

/// The parts of a geometry object.
#[derive(Default)]
pub(crate) struct CompiledGeometry {
    /// Usually one element; an isosurface has one per isovalue.
    pub(crate) parts: Vec<Part>,
    /// Bounds in object space.
    pub(crate) bounds: Option<[DVec3; 2]>,
}

impl Part {
    fn new(body: Body, topology: Topology) -> Part {
        Part { body, topology: topology.into(), triangles: OnceLock::new() }
    }

    /// Whether it consists of triangles.
    pub(crate) fn is_mesh(&self) -> bool {
        matches!(self.body, Body::Mesh(_))
    }

    /// Returns the geometry as a shape.
    pub(crate) fn as_shape(&self) -> (Arc<dyn Shape>, Weights) {
        match &self.body {
            Body::Mesh(mesh) => {
                let shape = self.triangles.get_or_init(|| Arc::new(TriangleShape(mesh.clone())));
                (shape.clone(), Weights::Corners)
            }
            Body::Shape(shape, weights) => (shape.clone(), *weights),
        }
    }

    pub(crate) fn geometry(&self) -> Geometry {
        match &self.body {
            Body::Mesh(mesh) => Geometry::Mesh(mesh.clone()),
            Body::Shape(shape, _) => Geometry::Shape(shape.clone()),
        }
    }
}

/// Parameters that do not change the shape. [`super::surface`] handles what depends on them.
pub(crate) fn is_appearance_parameter(name: &str) -> bool {
    let last = name.rsplit('.').next().unwrap_or(name);
    name == "name" || last == "color" || last.starts_with("attribute")
}

/// Converts the geometry for the renderer. Faults are recorded as diagnostics, and unusable parts
/// are left out.
pub(crate) fn compile_geometry(
    geometry: &Object,
    diagnostics: &mut Diagnostics,
) -> CompiledGeometry {
    let part = match geometry.subtype.as_str() {
        "triangle" => polygons::<3>(geometry, diagnostics),
        "quad" => polygons::<4>(geometry, diagnostics),
        "sphere" => spheres(geometry, diagnostics),
        "cylinder" | "cone" => cylinders(geometry, diagnostics),
        "curve" => curve(geometry, diagnostics),
        "isosurface" => return isosurfaces(geometry, diagnostics),
        _ => None,
    };
    let Some(part) = part else { return CompiledGeometry::default() };
    let bounds = match &part.body {
        Body::Mesh(m) => {
            let b = m.bounds();
            (!b.is_empty()).then(|| [m.origin + b.min.as_dvec3(), m.origin + b.max.as_dvec3()])
        }
        Body::Shape(s, _) => shape_bounds(s.as_ref()),
    };
    CompiledGeometry { parts: vec![part], bounds }
}

fn shape_bounds(shape: &dyn Shape) -> Option<[DVec3; 2]> {
    let boxes = (0..shape.num_primitives() as u32)
        .map(|i| shape.bounds(i))
        .filter(|b| !b.is_empty() && b.min.is_finite() && b.max.is_finite());
    let all = boxes.reduce(|a, b| a.union(b))?;
    Some([shape.origin() + all.min.as_dvec3(), shape.origin() + all.max.as_dvec3()])
}

// ---- Arrays -------------------------------------------------------------------------------------
fn positions(geometry: &Object, diagnostics: &mut Diagnostics) -> Option<Vec<Vec3>> {
    let found = geometry.object("vertex.position").and_then(|a| a.with_array(|a| a.vectors()));
    if found.is_none() {
        diagnostics.error(
            geometry,
            "`vertex.position` is not set, so it has no shape; set it to an array of FLOAT32_VEC3 \
             and commit",
        );
    }
    let points: Vec<Vec3> = found?.into_iter().map(Vec3::from).collect();
    let bad = points.iter().filter(|p| !p.is_finite()).count();
    if bad > 0 {
        diagnostics.warn(
            geometry,
            format!(
                "{bad} of {} vertices are NaN or infinite; what uses them is left out",
                points.len()
            ),
        );
    }
    Some(points)
}

/// Vertices of each primitive, without primitives that refer past the end, and the ANARI indices of
/// the remaining ones.
fn elements<const N: usize>(
    geometry: &Object,
    vertices: usize,
    diagnostics: &mut Diagnostics,
) -> (Vec<[u32; N]>, Numbers) {
    let listed =
        geometry.object("primitive.index").and_then(|a| a.with_array(|a| a.indices::<N>()));
    let all = listed.unwrap_or_else(|| {
        let one = |i: usize| std::array::from_fn(|k| (i * N + k) as u32);
        (0..vertices / N).map(one).collect()
    });
    let fits = |e: &[u32; N]| e.iter().all(|&v| (v as usize) < vertices);
    if all.iter().all(fits) {
        return (all, Numbers::Same);
    }
    let total = all.len();
    let kept: Vec<(u32, [u32; N])> = (0..).zip(all).filter(|(_, e)| fits(e)).collect();
    diagnostics.warn(
        geometry,
        format!(
            "{} of {total} primitives name vertices past the last one \
                                        ({vertices} vertices); they are left \
                                        out",
            total - kept.len()
        ),
    );
    let (numbers, elements) = kept.into_iter().unzip();
    (elements, Numbers::Listed(numbers))
}

/// Radii by `index`, from an array or from the parameter `radius`.
fn radii(geometry: &Object, array: &str, default: f32) -> impl Fn(u32) -> f32 + use<> {
    let listed = geometry.object(array).and_then(|a| a.with_array(|a| a.scalars()));
    // A radius past the end of its array counts as missing. The renderer counts and leaves out
    // primitives without a radius.
    move |i| listed.as_ref().map_or(default, |r| r.get(i as usize).copied().unwrap_or(0.0))
}

// ---- Triangles and quads ------------------------------------------------------------------------
fn polygons<const N: usize>(geometry: &Object, diagnostics: &mut Diagnostics) -> Option<Part> {
    let points = positions(geometry, diagnostics)?;
    let (faces, numbers) = elements::<N>(geometry, points.len(), diagnostics);
    let number = |i: usize| match &numbers {
        Numbers::Listed(l) => l[i],
        _ => i as u32,
    };
    // A quad is split into the triangles (0, 1, 3) and (2, 3, 1), as in Embree: the diagonal goes
    // from corner 1 to corner 3.
    let cuts: &[[usize; 3]] = if N == 3 { &[[0, 1, 2]] } else { &[[0, 1, 3], [2, 3, 1]] };
    let mut topology = Topology::default();
    let mut owners = Vec::new();
    for (i, face) in faces.iter().enumerate() {
        for cut in cuts {
            topology.vertices.push(cut.map(|k| face[k]));
            topology.corners.push(cut.map(|k| number(i) * N as u32 + k as u32));
            owners.push(number(i));
        }
    }
    if N == 4 || matches!(numbers, Numbers::Listed(_)) {
        topology.numbers = Numbers::Listed(owners);
    }
    topology.unshared = geometry.parameters().keys().any(|k| k.starts_with("faceVarying."));
    if !topology.unshared {
        topology.corners = Vec::new();
    }

    // Shading normals; per corner takes precedence over per vertex.
    let normals = |name: &str| geometry.object(name).and_then(|a| a.with_array(|a| a.vectors()));
    let (of_corners, of_vertices) = (normals("faceVarying.normal"), normals("vertex.normal"));
    let expected = if topology.unshared { topology.vertices.len() * 3 } else { points.len() };
    let pick =
        |list: &[[f32; 3]], id: u32| list.get(id as usize).map_or(Vec3::ZERO, |n| Vec3::from(*n));
    let values: Option<Vec<Vec3>> = match (&of_corners, &of_vertices) {
        (Some(list), _) => {
            Some(topology.corners.iter().flatten().map(|&c| pick(list, c)).collect())
        }
        (None, Some(list)) if topology.unshared => {
            Some(topology.vertices.iter().flatten().map(|&v| pick(list, v)).collect())
        }
        (None, Some(list)) => Some((0..points.len() as u32).map(|v| pick(list, v)).collect()),
        (None, None) => None,
    };
    for (name, list, needed) in [
        ("faceVarying.normal", &of_corners, faces.len() * N),
        ("vertex.normal", &of_vertices, points.len()),
    ] {
        if let Some(list) = list.as_ref().filter(|l| l.len() < needed) {
            diagnostics.warn(
                geometry,
                format!(
                    "`{name}` has {} elements, {needed} are needed; without the others faces are \
                     flat",
                    list.len()
                ),
            );
        }
    }

    let mut mesh = if topology.unshared {
        let corners = topology.vertices.iter().flatten().map(|&v| points[v as usize]).collect();
        let indices =
            (0..topology.vertices.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        TriMesh::new(corners, indices)
    } else {
        TriMesh::new(points, topology.vertices.clone())
    };
    mesh.tangents = tangents(geometry, &topology, mesh.positions.len());
    mesh.normals = values.filter(|v| v.len() == expected).map(Attribute::per_vertex);
    Some(Part::new(Body::Mesh(mesh.into()), topology))
}

/// Tangents of a mesh's vertices; per corner takes precedence over per vertex. Missing tangents are
/// 0, and normal maps have no effect there.
fn tangents(geometry: &Object, topology: &Topology, vertices: usize) -> Option<Vec<Vec4>> {
    let list = |name: &str| geometry.object(name).and_then(|a| a.with_array(|a| a.attributes()));
    let at =
        |list: &[[f32; 4]], i: u32| list.get(i as usize).map_or(Vec4::ZERO, |t| Vec4::from(*t));
    if let Some(of_corners) = list("faceVarying.tangent") {
        return Some(topology.corners.iter().flatten().map(|&c| at(&of_corners, c)).collect());
    }
    let of_vertices = list("vertex.tangent")?;
    Some(if topology.unshared {
        topology.vertices.iter().flatten().map(|&v| at(&of_vertices, v)).collect()
    } else {
        (0..vertices as u32).map(|v| at(&of_vertices, v)).collect()
    })
}

// ---- Spheres, curves, cylinders and cones -------------------------------------------------------
/// Reports what a shape leaves out, and wraps it.
fn shape_part(
    geometry: &Object,
    shape: Result<Arc<dyn Shape>, rt_core::shapes::ShapeError>,
    weights: Weights,
    topology: Topology,
    diagnostics: &mut Diagnostics,
) -> Option<Part> {
    match shape {
        Ok(shape) => Some(Part::new(Body::Shape(shape, weights), topology)),
        Err(e) => {
            diagnostics.error(geometry, e);
            None
        }
    }
}

fn spheres(geometry: &Object, diagnostics: &mut Diagnostics) -> Option<Part> {
    let points = positions(geometry, diagnostics)?;
    let (spheres, numbers) = elements::<1>(geometry, points.len(), diagnostics);
    let radius = radii(geometry, "vertex.radius", geometry.f32("radius", 1.0));
    let centers = spheres.iter().map(|[v]| points[*v as usize]).collect();
    let each = spheres.iter().map(|[v]| radius(*v)).collect();
    let topology = Topology {
        vertices: spheres.iter().map(|[v]| [*v; 3]).collect(),
        numbers,
        ..Topology::default()
    };
    let shape = Spheres::new(centers, Radii::Each(each)).map(|s| Arc::new(s) as Arc<dyn Shape>);
    shape_part(geometry, shape, Weights::First, topology, diagnostics)
}

fn cylinders(geometry: &Object, diagnostics: &mut Diagnostics) -> Option<Part> {
    let points = positions(geometry, diagnostics)?;
    let (pairs, numbers) = elements::<2>(geometry, points.len(), diagnostics);
    let common = geometry.f32("radius", 1.0);
    let ends: Vec<[f32; 2]> = if geometry.subtype == "cone" {
        let radius = radii(geometry, "vertex.radius", 1.0);
        pairs.iter().map(|p| p.map(&radius)).collect()
    } else {
        let radius = radii(geometry, "primitive.radius", common);
        let number = |i: usize| match &numbers {
            Numbers::Listed(l) => l[i],
            _ => i as u32,
        };
        (0..pairs.len()).map(|i| [radius(number(i)); 2]).collect()
    };
    let points = pairs.iter().flatten().map(|v| points[*v as usize]).collect();
    let caps = geometry.text("caps").unwrap_or_default();
    let all =
        [matches!(caps.as_str(), "first" | "both"), matches!(caps.as_str(), "second" | "both")];
    let listed = geometry.object("vertex.cap").and_then(|a| a.with_array(|a| a.scalars()));
    let closed: Vec<[bool; 2]> = pairs
        .iter()
        .map(|pair| match &listed {
            Some(l) => pair.map(|v| l.get(v as usize).is_some_and(|c| *c != 0.0)),
            None => all,
        })
        .collect();
    let any = closed.iter().flatten().any(|c| *c);
    let mixed = any && closed.iter().flatten().any(|c| !*c);
    let each = Radii::Each(ends.into_iter().flatten().collect());
    let shape = Cylinders::new(points, each, any).map(|solid| {
        if mixed { Arc::new(HalfOpen { solid, closed }) as Arc<dyn Shape> } else { Arc::new(solid) }
    });
    let vertices = pairs.iter().map(|[a, b]| [*a, *b, *b]).collect();
    let topology = Topology { vertices, numbers, ..Topology::default() };
    shape_part(geometry, shape, Weights::Along, topology, diagnostics)
}

/// Cylinders with some open ends. Hits on the missing caps are skipped.
struct HalfOpen {
    solid: Cylinders,
    closed: Vec<[bool; 2]>,
}

impl Shape for HalfOpen {
    fn num_primitives(&self) -> usize {
        self.solid.num_primitives()
    }

    fn bounds(&self, prim: u32) -> rt_core::math::Aabb {
        self.solid.bounds(prim)
    }

    fn closest(&self, prim: u32, ray: &Ray) -> Option<ShapeHit> {
        let mut ray = *ray;
        // A ray crosses the two caps at most once each.
        for _ in 0..3 {
            let hit = self.solid.closest(prim, &ray)?;
            let [first, second] = self.closed[prim as usize];
            let on_missing_cap = hit.v == 1.0 && !(if hit.u < 0.5 { first } else { second });
            if !on_missing_cap {
                return Some(hit);
            }
            ray.t_min = hit.t.next_up();
        }
        None
    }

    fn surface(&self, prim: u32, hit: &ShapeHit, ray: &Ray) -> ShapeSurface {
        self.solid.surface(prim, hit, ray)
    }
}

fn curve(geometry: &Object, diagnostics: &mut Diagnostics) -> Option<Part> {
    let points = positions(geometry, diagnostics)?;
    let radius = radii(geometry, "vertex.radius", geometry.f32("radius", 1.0));
    let listed =
        geometry.object("primitive.index").and_then(|a| a.with_array(|a| a.indices::<1>()));
    let total = listed.as_ref().map_or(points.len().saturating_sub(1), Vec::len);
    let all = listed.unwrap_or_else(|| (0..total as u32).map(|i| [i]).collect());
    // Sorts segments by their vertices, so that chains are found whatever the input order.
    let mut segments: Vec<(u32, u32)> = (0..)
        .zip(&all)
        .map(|(number, [v])| (*v, number))
        .filter(|(v, _)| (*v as usize) + 1 < points.len())
        .collect();
    if segments.len() < total {
        diagnostics.warn(
            geometry,
            format!(
                "{} of {total} segments name vertices past the last one ({} vertices); they are \
                 left out",
                total - segments.len(),
                points.len()
            ),
        );
    }
    segments.sort_unstable();
    let (mut chain, mut each, mut offsets) = (Vec::new(), Vec::new(), vec![0u32]);
    let (mut vertices, mut numbers) = (Vec::new(), Vec::new());
    let mut push = |v: u32, chain: &mut Vec<Vec3>| {
        chain.push(points[v as usize]);
        each.push(radius(v));
    };
    for (i, &(v, number)) in segments.iter().enumerate() {
        if i == 0 || segments[i - 1].0 + 1 != v {
            if i > 0 {
                offsets.push(chain.len() as u32);
            }
            push(v, &mut chain);
        }
        push(v + 1, &mut chain);
        vertices.push([v, v + 1, v + 1]);
        numbers.push(number);
    }
    if !chain.is_empty() {
        offsets.push(chain.len() as u32);
    }
    let topology = Topology { vertices, numbers: Numbers::Listed(numbers), ..Topology::default() };
    let shape =
        Tubes::new(chain, &offsets, Radii::Each(each)).map(|s| Arc::new(s) as Arc<dyn Shape>);
    shape_part(geometry, shape, Weights::Along, topology, diagnostics)
}

fn isosurfaces(geometry: &Object, diagnostics: &mut Diagnostics) -> CompiledGeometry {
    let mut out = CompiledGeometry::default();
    let Some(field) = geometry.object("field") else {
        diagnostics.error(geometry, "`field` is not set, so it has no shape");
        return out;
    };
    let Some(grid) = grid_of(&field, diagnostics) else { return out };
    if is_nearest(&field) {
        diagnostics.warn(
            geometry,
            "its field's `filter` is \"nearest\", which has no isosurfaces: it is interpolated \
             linearly",
        );
    }
    let isovalues: Vec<f32> = match geometry.parameters().get("isovalue") {
        Some(Value::Object(a)) => a.with_array(|a| a.scalars()).unwrap_or_default(),
        Some(Value::Bytes(t, b)) => vec![t.attribute(b)[0]],
        _ => {
            diagnostics.error(geometry, "`isovalue` is not set, so it has no shape");
            return out;
        }
    };
    for (number, isovalue) in (0..).zip(isovalues) {
        match Isosurface::new(grid.clone(), &[isovalue], &Default::default()) {
            Ok(shape) => {
                if shape.report().isovalues_out_of_range > 0 {
                    diagnostics.warn(
                        geometry,
                        format!(
                            "isovalue {isovalue} is outside of the field's range {:?}: nothing to \
                             draw",
                            grid.range()
                        ),
                    );
                }
                let topology = Topology { numbers: Numbers::All(number), ..Topology::default() };
                out.bounds = union(out.bounds, shape_bounds(&shape));
                out.parts.push(Part::new(Body::Shape(Arc::new(shape), Weights::First), topology));
            }
            Err(e) => diagnostics.error(geometry, e),
        }
    }
    out
}

/// The smallest box that contains both.
pub(crate) fn union(a: Option<[DVec3; 2]>, b: Option<[DVec3; 2]>) -> Option<[DVec3; 2]> {
    match (a, b) {
        (Some(a), Some(b)) => Some([a[0].min(b[0]), a[1].max(b[1])]),
        (a, b) => a.or(b),
    }
}
