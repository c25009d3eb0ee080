//! Triangulates polygons: fans for convex ones, ear clipping for the others.
//!
//! Sources: Newell's normal (Sutherland, Sproull and Schumacker 1974, p. 15); ear clipping
//! (Meisters 1975; O'Rourke, "Computational Geometry in C", 1998, section 1.4).

use glam::{DVec2, DVec3};

/// Largest number of corners for ear clipping, whose time grows with their square. Larger polygons
/// are divided as fans, which [`super::SurfaceReport::fanned_polygons`] counts.
pub const MAX_EAR_CORNERS: usize = 4096;

/// How a polygon was divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Division {
    /// Exact: the triangles cover the polygon once.
    Exact,
    /// A fan over a polygon that is not convex and could not be clipped (self-intersecting, or too
    /// many corners).
    Fanned,
    /// Fewer than three corners: no triangles.
    Nothing,
}

/// Calls `emit` with the corner numbers of each triangle. Orientation is kept. Polygons with
/// non-finite corners are divided as fans.
pub fn triangulate(corners: &[DVec3], mut emit: impl FnMut([usize; 3])) -> Division {
    let n = corners.len();
    match n {
        0..=2 => return Division::Nothing,
        3 => {
            emit([0, 1, 2]);
            return Division::Exact;
        }
        _ => {}
    }
    let normal = newell_normal(corners);
    let flat = project(corners, normal);
    let turn = |a: usize, b: usize, c: usize| (flat[b] - flat[a]).perp_dot(flat[c] - flat[b]);

    // Convex: all turns have the same sign. (A star polygon that winds twice also passes and
    // becomes a fan.)
    let convex = (0..n).all(|i| turn(i, (i + 1) % n, (i + 2) % n) >= 0.0);
    if n == 4 {
        // Choose the diagonal that lies inside, or the shorter one when both do, so that thin quads
        // keep their shape.
        let first = turn(0, 1, 2) > 0.0 && turn(2, 3, 0) > 0.0;
        let second = turn(1, 2, 3) > 0.0 && turn(3, 0, 1) > 0.0;
        let shorter =
            corners[1].distance_squared(corners[3]) < corners[0].distance_squared(corners[2]);
        let [a, b] = if second && (!first || shorter) {
            [[0, 1, 3], [1, 2, 3]]
        } else {
            [[0, 1, 2], [0, 2, 3]]
        };
        emit(a);
        emit(b);
        return if first || second || convex { Division::Exact } else { Division::Fanned };
    }
    if convex || n > MAX_EAR_CORNERS {
        (1..n - 1).for_each(|i| emit([0, i, i + 1]));
        return if convex { Division::Exact } else { Division::Fanned };
    }
    clip_ears(&flat, emit)
}

/// Cuts off one ear after another. A ring without ears (self-intersecting) is finished as a fan.
fn clip_ears(flat: &[DVec2], mut emit: impl FnMut([usize; 3])) -> Division {
    let mut ring: Vec<usize> = (0..flat.len()).collect();
    let turn = |a: usize, b: usize, c: usize| (flat[b] - flat[a]).perp_dot(flat[c] - flat[b]);
    let mut at = 0;
    let mut misses = 0;
    while ring.len() > 3 {
        let m = ring.len();
        at %= m;
        let [a, b, c] = [ring[(at + m - 1) % m], ring[at], ring[(at + 1) % m]];
        let t = turn(a, b, c);
        // A corner without area (a repeated or collinear point) can always be cut. Its triangle is
        // degenerate, but emitting it keeps shared edges watertight.
        let is_ear = t == 0.0
            || t > 0.0
                && !ring.iter().any(|&p| {
                    let q = flat[p];
                    q != flat[a]
                        && q != flat[b]
                        && q != flat[c]
                        && inside(flat[a], flat[b], flat[c], q)
                });
        if is_ear {
            emit([a, b, c]);
            ring.remove(at);
            misses = 0;
            at = at.max(1) - 1; // neighbours changed: look at the one before again
        } else {
            at += 1;
            misses += 1;
            if misses > m {
                (1..m - 1).for_each(|i| emit([ring[0], ring[i], ring[i + 1]]));
                return Division::Fanned;
            }
        }
    }
    emit([ring[0], ring[1], ring[2]]);
    Division::Exact
}

fn inside(a: DVec2, b: DVec2, c: DVec2, p: DVec2) -> bool {
    let side = |s: DVec2, e: DVec2| (e - s).perp_dot(p - s);
    side(a, b) >= 0.0 && side(b, c) >= 0.0 && side(c, a) >= 0.0
}

/// Normal of a polygon that may be non-planar; its length is twice the projected area.
pub fn newell_normal(corners: &[DVec3]) -> DVec3 {
    // Relative to the first corner, to avoid cancellation for polygons far from the origin.
    let o = corners.first().copied().unwrap_or_default();
    (0..corners.len()).map(|i| (corners[i] - o).cross(corners[(i + 1) % corners.len()] - o)).sum()
}

/// Drops the axis in which the normal is largest and keeps the orientation.
fn project(corners: &[DVec3], normal: DVec3) -> Vec<DVec2> {
    let n = normal.abs();
    let o = corners[0];
    let axes = |p: DVec3| {
        let p = p - o;
        if n.x >= n.y && n.x >= n.z {
            if normal.x < 0.0 { DVec2::new(p.z, p.y) } else { DVec2::new(p.y, p.z) }
        } else if n.y >= n.z {
            if normal.y < 0.0 { DVec2::new(p.x, p.z) } else { DVec2::new(p.z, p.x) }
        } else if normal.z < 0.0 {
            DVec2::new(p.y, p.x)
        } else {
            DVec2::new(p.x, p.y)
        }
    };
    corners.iter().map(|&p| axes(p)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn areas(points: &[[f64; 3]]) -> (Vec<f64>, f64, Division) {
        let p: Vec<DVec3> = points.iter().map(|&p| DVec3::from(p)).collect();
        let normal = newell_normal(&p);
        let mut list = Vec::new();
        let division = triangulate(&p, |[a, b, c]| {
            list.push(0.5 * (p[b] - p[a]).cross(p[c] - p[a]).dot(normal.normalize()));
        });
        (list, 0.5 * normal.length(), division)
    }

    #[test]
    fn concave_polygons_are_covered_once_in_every_orientation() {
        // An L, a comb and an arrow head, forwards and backwards, in three planes.
        let shapes: [&[[f64; 2]]; 3] = [
            &[[0., 0.], [3., 0.], [3., 1.], [1., 1.], [1., 3.], [0., 3.]],
            &[
                [0., 0.],
                [5., 0.],
                [5., 3.],
                [4., 3.],
                [4., 1.],
                [3., 1.],
                [3., 3.],
                [2., 3.],
                [2., 1.],
                [1., 1.],
                [1., 3.],
                [0., 3.],
            ],
            &[[0., 0.], [2., 1.], [0., 2.], [0.5, 1.]],
        ];
        for shape in shapes {
            for reverse in [false, true] {
                for plane in 0..3 {
                    let mut p: Vec<[f64; 3]> = shape
                        .iter()
                        .map(|&[x, y]| {
                            let mut q = [0.0; 3];
                            (q[plane], q[(plane + 1) % 3], q[(plane + 2) % 3]) =
                                (x + 1e6, y, 0.3 * x);
                            q
                        })
                        .collect();
                    if reverse {
                        p.reverse();
                    }
                    let (list, whole, division) = areas(&p);
                    assert_eq!(division, Division::Exact);
                    assert_eq!(list.len(), p.len() - 2);
                    assert!(list.iter().all(|&a| a >= 0.0), "a triangle is turned over: {list:?}");
                    assert!((list.iter().sum::<f64>() - whole).abs() < 1e-9 * whole);
                }
            }
        }
    }

    #[test]
    fn bow_tie_is_reported_not_looped_forever() {
        let (list, _, division) =
            areas(&[[0., 0., 0.], [2., 2., 0.], [2., 0., 0.], [0., 3., 0.], [-1., 1., 0.]]);
        assert_eq!(list.len(), 3);
        // Either answer is right for a polygon that crosses itself; the loop must end.
        let _ = division;
    }

    #[test]
    fn repeated_corners_do_not_stop_the_clipping() {
        let l = [
            [0., 0., 0.],
            [3., 0., 0.],
            [3., 0., 0.],
            [3., 1., 0.],
            [1., 1., 0.],
            [1., 1., 0.],
            [1., 3., 0.],
            [0., 3., 0.],
        ];
        let (list, whole, _) = areas(&l);
        assert!((list.iter().sum::<f64>() - whole).abs() < 1e-12);
    }
}
