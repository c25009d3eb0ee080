//! The order of the corners of a wedge. In VTK the first triangle is seen from outside, in the
//! manuals of EnSight, CGNS and Exodus II from inside, and programs write both: the points decide.

use crate::model::Points;

/// The nodes of a wedge with its triangles turned: of a linear, a quadratic (15 nodes) or a
/// biquadratic one (18), in VTK's order.
pub(crate) const TURNED: [usize; 18] =
    [0, 2, 1, 3, 5, 4, 8, 7, 6, 11, 10, 9, 12, 14, 13, 17, 16, 15];

/// Whether the first triangle is seen from inside. Points that do not exist are not turned.
pub(crate) fn is_turned(nodes: &[u32], points: &Points) -> bool {
    let at = |k: usize| {
        let id = nodes[k] as usize;
        (id < points.len()).then(|| points.get(id))
    };
    match (at(0), at(1), at(2), at(3)) {
        (Some(a), Some(b), Some(c), Some(top)) => (b - a).cross(c - a).dot(top - a) > 0.0,
        _ => false,
    }
}
