//! From OpenGL's primitives to triangles, split and turned as the driver does it: colours across a quad, and the flat colour of a
//! triangle, depend on it (compatibility profile specification, section 10.1; Mesa's vertex order).

use crate::enums::*;

/// True for what covers area.
pub(crate) fn is_filled(mode: u32) -> bool {
    (TRIANGLES..=POLYGON).contains(&mode)
}

/// The triangles of a primitive whose vertices are numbered `first..first + count`; the vertex that gives the flat colour comes
/// last. Incomplete primitives give nothing, as OpenGL has it. `flat` says that only that vertex' colour counts: Mesa splits quads along
/// another diagonal then.
pub(crate) fn triangulate(
    mode: u32,
    first: u32,
    count: u32,
    first_provokes: bool,
    flat: bool,
    out: &mut Vec<[u32; 3]>,
) {
    let v = |i: u32| first + i;
    // Rotates so that vertex 0 (the first) comes last; the orientation stays.
    let provoked = |t: [u32; 3]| if first_provokes { [t[1], t[2], t[0]] } else { t };
    match mode {
        TRIANGLES => out.extend((0..count / 3).map(|i| provoked([v(3 * i), v(3 * i + 1), v(3 * i + 2)]))),
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
        // Mesa's quads do not follow the provoking vertex convention: their last vertex gives the colour.
        QUADS => out.extend((0..count / 4).flat_map(|i| quad([0, 1, 2, 3].map(|k| v(4 * i + k)), flat))),
        QUAD_STRIP => out.extend((0..(count / 2).saturating_sub(1)).flat_map(|i| {
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| v(2 * i + k));
            [[c, a, d], [a, b, d]]
        })),
        // A polygon's flat colour is that of its first vertex, whatever the convention.
        POLYGON => out.extend((1..count.saturating_sub(1)).map(|i| [v(i), v(i + 1), v(0)])),
        _ => {}
    }
}

fn quad([a, b, c, d]: [u32; 4], flat: bool) -> [[u32; 3]; 2] {
    if flat { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangles(mode: u32, count: u32) -> Vec<[u32; 3]> {
        let mut out = Vec::new();
        triangulate(mode, 10, count, false, true, &mut out);
        out
    }

    /// Signed area of a triangle of a convex polygon whose corners are numbered counter-clockwise, or of a strip's zigzag.
    fn turns_left(t: [u32; 3], place: impl Fn(u32) -> [f64; 2]) -> bool {
        let [a, b, c] = t.map(|i| place(i - 10));
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0
    }

    #[test]
    fn degenerate_strips_and_incomplete_primitives_give_nothing() {
        for mode in TRIANGLES..=POLYGON {
            for count in 0..3 {
                assert_eq!(triangles(mode, count), Vec::<[u32; 3]>::new(), "mode {mode}, {count} vertices");
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
                triangulate(mode, 10, 8, first, true, &mut out);
                assert_eq!(out.len(), 6);
                let place =
                    if mode == QUAD_STRIP { |i: u32| [f64::from(i / 2), -f64::from(i % 2)] } else { zigzag };
                let turns: Vec<bool> = out.iter().map(|t| turns_left(*t, place)).collect();
                assert!(turns.iter().all(|t| *t == turns[0]), "mode {mode}: {out:?} {turns:?}");
            }
            for mode in [TRIANGLES, TRIANGLE_FAN, QUADS, POLYGON] {
                let mut out = Vec::new();
                triangulate(mode, 10, 8, first, true, &mut out);
                assert!(out.iter().all(|t| turns_left(*t, circle)), "mode {mode}: {out:?}");
            }
        }
    }

    #[test]
    fn the_provoking_vertex_comes_last() {
        assert_eq!(triangles(QUADS, 4).iter().map(|t| t[2]).collect::<Vec<_>>(), [13, 13]);
        let mut smooth = Vec::new();
        triangulate(QUADS, 0, 4, false, false, &mut smooth);
        assert_eq!(smooth, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(triangles(POLYGON, 5).iter().map(|t| t[2]).collect::<Vec<_>>(), [10, 10, 10]);
        let mut out = Vec::new();
        triangulate(TRIANGLE_STRIP, 0, 4, true, true, &mut out);
        assert_eq!(out.iter().map(|t| t[2]).collect::<Vec<_>>(), [0, 1]);
    }
}
