//! Converts OpenGL's primitives to triangles, split and rotated as in the driver. The colours
//! across a quad and the flat colour of a triangle depend on it (compatibility profile
//! specification, section 10.1; Mesa's vertex order).

use crate::enums::*;

/// Primitives of one kind and size that follow one another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct PrimitiveRun {
    pub(crate) mode: u32,
    pub(crate) count: u32,
    pub(crate) times: u32,
}

/// True for primitives that cover an area.
pub(crate) fn is_filled(mode: u32) -> bool {
    (TRIANGLES..=POLYGON).contains(&mode)
}

/// How primitives become triangles.
///
/// OpenGL does not specify the diagonal along which a quad is split, and Mesa uses either. It
/// splits from the second vertex to the fourth when the quads are flat, indexed, or in a display
/// list, when lines are smoothed and polygons offset ([`Snapshot::turns_quads`]), and when it must
/// clip any vertex of the up to 4096 that it draws at once. Otherwise it splits from the first to
/// the third. Colours and non-planar quads show the difference.
///
/// [`Snapshot::turns_quads`]: crate::state::snapshot::Snapshot::turns_quads
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
pub(crate) struct QuadSplit {
    /// The convention for the vertex of the flat colour.
    pub(crate) first_provokes: bool,
    /// All quads are split from the second vertex to the fourth.
    pub(crate) all_turned: bool,
    /// The vertex ranges (first, end) of these quads.
    pub(crate) turned: Vec<[u32; 2]>,
}

impl QuadSplit {
    fn turns(&self, vertex: u32) -> bool {
        self.all_turned || self.turned.iter().any(|[first, end]| (*first..*end).contains(&vertex))
    }

    /// Finds the clipped quads. `outside` returns whether any vertex of a range is clipped. The
    /// driver draws `first..end` as one draw of quads.
    pub(crate) fn find_clipped_quads(
        &mut self,
        first: u32,
        end: u32,
        outside: impl Fn(u32, u32) -> bool,
    ) {
        // With more quads, geometry would be rebuilt for a difference that is too small to see.
        const MOST: u32 = 1 << 16;
        const AT_ONCE: u32 = 4096;
        if self.all_turned || end - first > MOST {
            return;
        }
        for from in (first..end).step_by(AT_ONCE as usize) {
            let to = end.min(from + AT_ONCE);
            if outside(from, to) {
                self.turned.push([from, to]);
            }
        }
    }
}

/// The number of triangles of a primitive.
pub(crate) fn triangles_of(mode: u32, count: u32) -> u32 {
    match mode {
        TRIANGLES => count / 3,
        QUADS => count / 4 * 2,
        QUAD_STRIP => (count / 2).saturating_sub(1) * 2,
        TRIANGLE_STRIP | TRIANGLE_FAN | POLYGON => count.saturating_sub(2),
        _ => 0,
    }
}

/// The triangles of a primitive whose vertices are numbered `first..first + count`. The vertex that
/// gives the flat colour comes last. Incomplete primitives give nothing, as in OpenGL.
pub(crate) fn triangulate(
    mode: u32,
    first: u32,
    count: u32,
    split: &QuadSplit,
    out: &mut Vec<[u32; 3]>,
) {
    let v = |i: u32| first + i;
    let first_provokes = split.first_provokes;
    // Rotates so that vertex 0 (the first) comes last. The orientation stays.
    let provoked = |t: [u32; 3]| if first_provokes { [t[1], t[2], t[0]] } else { t };
    match mode {
        TRIANGLES => {
            out.extend((0..count / 3).map(|i| provoked([v(3 * i), v(3 * i + 1), v(3 * i + 2)])))
        }
        TRIANGLE_STRIP => {
            out.extend((0..count.saturating_sub(2)).map(|i| match (i % 2 == 0, first_provokes) {
                (true, _) => provoked([v(i), v(i + 1), v(i + 2)]),
                (false, false) => [v(i + 1), v(i), v(i + 2)],
                (false, true) => [v(i + 2), v(i + 1), v(i)],
            }))
        }
        TRIANGLE_FAN => out.extend((1..count.saturating_sub(1)).map(|i| match first_provokes {
            false => [v(0), v(i), v(i + 1)],
            true => [v(i + 1), v(0), v(i)],
        })),
        // Mesa's quads do not follow the provoking vertex convention: their last vertex gives the
        // colour.
        QUADS => out.extend(
            (0..count / 4)
                .flat_map(|i| quad([0, 1, 2, 3].map(|k| v(4 * i + k)), split.turns(v(4 * i)))),
        ),
        QUAD_STRIP => out.extend((0..(count / 2).saturating_sub(1)).flat_map(|i| {
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| v(2 * i + k));
            [[c, a, d], [a, b, d]]
        })),
        // The first vertex of a polygon gives its flat colour, whatever the convention.
        POLYGON => out.extend((1..count.saturating_sub(1)).map(|i| [v(i), v(i + 1), v(0)])),
        _ => {}
    }
}

fn quad([a, b, c, d]: [u32; 4], turned: bool) -> [[u32; 3]; 2] {
    if turned { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split(first_provokes: bool, all_turned: bool) -> QuadSplit {
        QuadSplit { first_provokes, all_turned, turned: Vec::new() }
    }

    #[test]
    fn quads_that_are_clipped_are_split_the_other_way_with_all_that_are_drawn_at_once() {
        let mut s = QuadSplit::default();
        s.find_clipped_quads(8, 8 + 3 * 4096, |from, to| (from..to).contains(&5000));
        assert_eq!(s.turned, [[8 + 4096, 8 + 2 * 4096]]);
        let mut out = Vec::new();
        triangulate(QUADS, 0, 4 * 4096, &s, &mut out);
        assert_eq!(out[2 * 1025..2 * 1025 + 2], [[4100, 4101, 4102], [4100, 4102, 4103]]);
        assert_eq!(out[2 * 1026..2 * 1026 + 2], [[4104, 4105, 4107], [4105, 4106, 4107]]);
    }

    fn triangles(mode: u32, count: u32) -> Vec<[u32; 3]> {
        let mut out = Vec::new();
        triangulate(mode, 10, count, &split(false, true), &mut out);
        out
    }

    /// Signed area of a triangle of a convex polygon whose corners are numbered counter-clockwise,
    /// or of a strip's zigzag.
    fn turns_left(t: [u32; 3], place: impl Fn(u32) -> [f64; 2]) -> bool {
        let [a, b, c] = t.map(|i| place(i - 10));
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0
    }

    #[test]
    fn degenerate_strips_and_incomplete_primitives_give_nothing() {
        for mode in LINES..=POLYGON {
            for count in 0..20 {
                assert_eq!(triangles(mode, count).len(), triangles_of(mode, count) as usize);
            }
        }
        for mode in TRIANGLES..=POLYGON {
            for count in 0..3 {
                assert_eq!(
                    triangles(mode, count),
                    Vec::<[u32; 3]>::new(),
                    "mode {mode}, {count} vertices"
                );
            }
        }
        assert_eq!(triangles(QUADS, 7).len(), 2);
        assert_eq!(triangles(QUAD_STRIP, 5).len(), 2);
        assert_eq!(triangles(TRIANGLES, 5).len(), 1);
        assert_eq!(triangles(LINES, 6).len(), 0);
    }

    #[test]
    fn all_triangles_turn_as_their_primitive_does_under_both_conventions() {
        let zigzag = |i: u32| [f64::from(i / 2), f64::from(1 - i % 2)];
        let circle = |i: u32| [(f64::from(i) * 0.7).cos(), (f64::from(i) * 0.7).sin()];
        for first in [false, true] {
            for mode in [TRIANGLE_STRIP, QUAD_STRIP] {
                let mut out = Vec::new();
                triangulate(mode, 10, 8, &split(first, true), &mut out);
                assert_eq!(out.len(), 6);
                let place = if mode == QUAD_STRIP {
                    |i: u32| [f64::from(i / 2), -f64::from(i % 2)]
                } else {
                    zigzag
                };
                let turns: Vec<bool> = out.iter().map(|t| turns_left(*t, place)).collect();
                assert!(turns.iter().all(|t| *t == turns[0]), "mode {mode}: {out:?} {turns:?}");
            }
            for mode in [TRIANGLES, TRIANGLE_FAN, QUADS, POLYGON] {
                let mut out = Vec::new();
                triangulate(mode, 10, 8, &split(first, true), &mut out);
                assert!(out.iter().all(|t| turns_left(*t, circle)), "mode {mode}: {out:?}");
            }
        }
    }

    #[test]
    fn the_provoking_vertex_comes_last() {
        assert_eq!(triangles(QUADS, 4).iter().map(|t| t[2]).collect::<Vec<_>>(), [13, 13]);
        let mut smooth = Vec::new();
        triangulate(QUADS, 0, 4, &split(false, false), &mut smooth);
        assert_eq!(smooth, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(triangles(POLYGON, 5).iter().map(|t| t[2]).collect::<Vec<_>>(), [10, 10, 10]);
        let mut out = Vec::new();
        triangulate(TRIANGLE_STRIP, 0, 4, &split(true, true), &mut out);
        assert_eq!(out.iter().map(|t| t[2]).collect::<Vec<_>>(), [0, 1]);
    }
}
