//! Delaunay triangulation of points in a plane, by the crate spade.

use super::Degenerate;
use super::snap::Snapped;
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation};

/// A point with its number.
struct Vertex {
    at: Point2<f64>,
    number: u32,
}

impl HasPosition for Vertex {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.at
    }
}

/// The triangles of the places in the plane of their first two coordinates, by their numbers,
/// counterclockwise.
pub(crate) fn triangles(points: &Snapped) -> Result<Vec<[u32; 3]>, Degenerate> {
    // Integers of 40 bits are numbers of f64, and spade's predicates are exact on them.
    let vertex = |(i, p): (usize, &[i64; 3])| Vertex {
        at: Point2::new(p[0] as f64, p[1] as f64),
        number: i as u32,
    };
    let vertices = points.places.iter().enumerate().map(vertex).collect();
    let Ok(all) = DelaunayTriangulation::<Vertex>::bulk_load_stable(vertices) else {
        unreachable!("coordinates are integers of 40 bits");
    };
    let triangles: Vec<[u32; 3]> =
        all.inner_faces().map(|f| f.vertices().map(|v| v.data().number)).collect();
    if triangles.is_empty() { Err(Degenerate::Line) } else { Ok(triangles) }
}
