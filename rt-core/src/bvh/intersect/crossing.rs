//! Decides which triangle a ray crosses where it meets an edge or a vertex, so that each crossing
//! of a surface counts once.
//!
//! The watertight test accepts a ray on an edge for both triangles. Here the ray is moved, in the
//! sheared plane of that test, by (ε, ε²) for an infinitely small ε: then it meets no edge and no
//! vertex (Edelsbrunner and Mücke, "Simulation of Simplicity", ACM Transactions on Graphics 1990).
//! The edge function of p and q becomes
//! p.x·q.y − p.y·q.x + ε·(p.y − q.y) + ε²·(q.x − p.x), and its sign is that of the first term that
//! is not zero. Two triangles that share an edge compute the same terms with opposite signs.

use super::watertight::Shear;

/// Whether a ray crosses the triangle with these corners, for a triangle that the watertight test
/// accepts. Corners and `origin` are in x, y, z.
pub(crate) fn crosses(corners: [[f32; 3]; 3], origin: [f32; 3], shear: &Shear) -> bool {
    let Shear { kx, ky, kz, sx, sy, .. } = *shear;
    // The operations of the watertight test, so that the bits are the same.
    let [a, b, c] = corners.map(|p| {
        let along = p[kz] - origin[kz];
        [(p[kx] - origin[kx]) - sx * along, (p[ky] - origin[ky]) - sy * along]
    });
    match (edge_side(c, b), edge_side(a, c), edge_side(b, a)) {
        (Some(u), Some(v), Some(w)) => u == v && v == w,
        _ => false,
    }
}

/// Whether the moved ray lies on the positive side of the edge from `p` to `q`. `None` when they
/// coincide: the triangle is seen edge-on.
fn edge_side(p: [f32; 2], q: [f32; 2]) -> Option<bool> {
    // Products of two f32 are exact in f64, and a difference is zero only when they are equal.
    let e = f64::from(p[0]) * f64::from(q[1]) - f64::from(p[1]) * f64::from(q[0]);
    if e != 0.0 {
        return Some(e > 0.0);
    }
    if p[1] != q[1] {
        return Some(p[1] > q[1]);
    }
    (p[0] != q[0]).then_some(q[0] > p[0])
}
