//! Converts points and cells to geometry that rays can hit, and keeps the data needed to colour it
//! later.

mod back_faces;
mod clip;
mod points_and_lines;
mod triangulate;
mod vertices;

use crate::input::{PerItem, Shape};
use rt_core::bvh::Geometry;
use rt_core::glam::{Vec2, Vec3};
use rt_core::mesh::{Attribute, TriMesh};
use std::ops::Range;
use std::sync::Arc;

pub use clip::{ClipMap, ClipVertex};

/// The geometry of one [`Shape`]. [`crate::colors`] adds colours to it.
#[derive(Clone)]
pub struct GeometrySet {
    /// Triangles of polygons and strips, if there are any.
    pub mesh: Option<PolygonMesh>,
    /// Spheres of vertices.
    pub spheres: Option<Arc<rt_core::shapes::Spheres>>,
    /// Tubes of lines or edges.
    pub tubes: Option<Arc<rt_core::shapes::Tubes>>,
    /// Back faces of the triangles, if they look different.
    pub back_faces: Option<Arc<dyn rt_core::shapes::Shape>>,
    /// Triangles that cannot be drawn (a NaN point, a point number that does not exist).
    pub skipped: usize,
}

/// Triangles and their source cells.
#[derive(Clone)]
pub struct PolygonMesh {
    /// The mesh, without colours.
    pub mesh: Arc<TriMesh>,
    /// Cell number of each triangle.
    pub cells: CellOfTriangle,
    /// Which sides of each triangle are edges of its polygon (bit i: from corner i to the next);
    /// `None` when all are.
    pub edges: Option<Arc<Vec<u8>>>,
    /// Set when clipping planes made new vertices and triangles.
    pub clip_map: Option<Arc<ClipMap>>,
}

impl PolygonMesh {
    /// The mesh in rt-core's form.
    pub fn geometry(&self) -> Geometry {
        Geometry::Mesh(Arc::clone(&self.mesh))
    }
}

/// The cell that each triangle belongs to.
#[derive(Clone)]
pub enum CellOfTriangle {
    /// Triangle i is cell `first + i`: all polygons are triangles, and a list is not needed.
    Consecutive {
        /// Number of the first polygon.
        first: u32,
    },
    /// By triangle.
    List(Arc<Vec<u32>>),
}

impl CellOfTriangle {
    /// Cell of triangle `i`.
    #[inline]
    pub fn at(&self, i: usize) -> usize {
        match self {
            CellOfTriangle::Consecutive { first } => *first as usize + i,
            CellOfTriangle::List(list) => list[i] as usize,
        }
    }
}

/// The range of cell numbers in `vtkPolyData` for each kind of cell.
fn cell_numbers(shape: &Shape<'_>) -> [Range<usize>; 4] {
    let mut start = 0;
    [shape.verts, shape.lines, shape.polys, shape.strips].map(|cells| {
        let range = start..start + cells.len();
        start = range.end;
        range
    })
}

/// Builds all geometry that `shape` requests.
pub fn build(shape: &Shape<'_>) -> GeometrySet {
    let [_, _, polys, strips] = cell_numbers(shape);
    let mut built =
        GeometrySet { mesh: None, spheres: None, tubes: None, back_faces: None, skipped: 0 };
    points_and_lines::add(shape, &mut built);
    if shape.edges_only {
        return built;
    }
    let (indices, cells) = triangulate::triangles(shape, polys.start, strips.start);
    if indices.is_empty() {
        return built;
    }
    let (origin, positions) = vertices::relative(&shape.points);
    let points = positions.len();
    let mut mesh = TriMesh { origin, positions, indices, ..TriMesh::default() };
    mesh.normals = shape.normals.and_then(|normals| match normals {
        PerItem::Point(n) => {
            (n.len() == points).then(|| Attribute::per_vertex(vertices::vectors(n)))
        }
        PerItem::Cell(n) => (n.len() >= strips.end).then(|| {
            let of = |i| n.get(cells.at(i)).map_or(Vec3::ZERO, |v| Vec3::from(*v));
            Attribute::per_face((0..mesh.indices.len()).map(of).collect())
        }),
    });
    mesh.texcoords = shape
        .texcoords
        .filter(|t| t.len() == points)
        .map(|t| t.iter().map(|v| Vec2::from(*v)).collect());
    let tangent = |t: &[f32; 3]| Vec3::from(*t).extend(1.0);
    mesh.tangents =
        shape.tangents.filter(|t| t.len() == points).map(|t| t.iter().map(tangent).collect());
    let (mesh, clip_map) = if shape.clip_planes.is_empty() {
        (mesh, None)
    } else {
        let (mesh, clip_map) = clip::clip(&mesh, shape.clip_planes);
        (mesh, Some(Arc::new(clip_map)))
    };
    built.skipped = (0..mesh.indices.len()).filter(|&i| !mesh.is_renderable(i)).count();
    let edges = match cells {
        CellOfTriangle::Consecutive { .. } => None,
        CellOfTriangle::List(_) => Some(Arc::new(triangulate::edges(shape))),
    };
    let mesh = Arc::new(mesh);
    built.back_faces = shape
        .has_back_faces
        .then(|| Arc::new(back_faces::BackFaces::of(Arc::clone(&mesh))) as Arc<_>);
    built.mesh = Some(PolygonMesh { mesh, cells, edges, clip_map });
    built
}
