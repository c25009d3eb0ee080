//! A point of a Bézier surface with both tangents, for `GL_AUTO_NORMAL`, by de Casteljau's
//! algorithm, which has the tangents before its last step.
//!
//! While the net of control points is more than two points wide in both directions, four neighbours
//! are combined into one, first along `u` and then along `v`. A surface with different orders is
//! reduced to two lines of points. It continues as curves: of the points between the lines, and of
//! their differences. The order of the operations is Mesa's, as in [`super::bernstein`].

/// A point of the surface, and its derivatives up to a positive factor. Both orders are at least 2.
pub(super) fn point_and_tangents<const N: usize>(
    points: &[[f32; N]],
    orders: [usize; 2],
    at: [f32; 2],
) -> [[f32; N]; 3] {
    let mut net = points.to_vec();
    let ([mut rows, mut columns], [u, v]) = (orders, at);
    let across = columns;
    let (along_u, along_v) = (mix(u), mix(v));
    while rows.min(columns) > 2 {
        for i in 0..rows - 1 {
            for j in 0..columns - 1 {
                let [here, below] = [i * across + j, (i + 1) * across + j];
                net[here] =
                    along_v(along_u(net[here], net[below]), along_u(net[here + 1], net[below + 1]));
            }
        }
        (rows, columns) = (rows - 1, columns - 1);
    }
    let line = |row: bool, k: usize| -> Vec<[f32; N]> {
        if row {
            net[k * across..][..columns].to_vec()
        } else {
            (0..rows).map(|i| net[i * across + k]).collect()
        }
    };
    if rows == columns {
        let [a, b, c, d] = [net[0], net[1], net[across], net[across + 1]];
        let point = along_u(along_v(a, b), along_v(c, d));
        return [point, along_v(less(c, a), less(d, b)), along_u(less(b, a), less(d, c))];
    }
    let narrow_in_u = rows == 2;
    let (first, second) = (line(narrow_in_u, 0), line(narrow_in_u, 1));
    let pairs = || first.iter().zip(&second);
    let differences = pairs().map(|(a, b)| less(*b, *a)).collect();
    if narrow_in_u {
        let (point, dv) = last_two(pairs().map(|(a, b)| along_u(*a, *b)).collect(), v);
        [point, last_two(differences, v).0, dv]
    } else {
        let (point, du) = last_two(pairs().map(|(a, b)| along_v(*a, *b)).collect(), u);
        [point, du, last_two(differences, u).0]
    }
}

/// The end of de Casteljau's algorithm for a curve: its point, and the difference of the two points
/// between which it lies.
fn last_two<const N: usize>(mut points: Vec<[f32; N]>, t: f32) -> ([f32; N], [f32; N]) {
    let between = mix(t);
    for left in (2..points.len()).rev() {
        for i in 0..left {
            points[i] = between(points[i], points[i + 1]);
        }
    }
    (between(points[0], points[1]), less(points[1], points[0]))
}

fn mix<const N: usize>(t: f32) -> impl Fn([f32; N], [f32; N]) -> [f32; N] {
    let s = 1.0 - t;
    move |a, b| std::array::from_fn(|k| s * a[k] + t * b[k])
}

fn less<const N: usize>(a: [f32; N], b: [f32; N]) -> [f32; N] {
    std::array::from_fn(|k| a[k] - b[k])
}

/// The unit normal from a point and the tangents. For a rational surface, whose fourth value is w,
/// by the quotient rule. Zero when the tangents are parallel.
pub(super) fn normal([point, du, dv]: [[f32; 4]; 3], rational: bool) -> [f32; 3] {
    let tangent = |d: [f32; 4]| -> [f32; 3] {
        std::array::from_fn(|k| if rational { d[k] * point[3] - d[3] * point[k] } else { d[k] })
    };
    let ([a, b, c], [x, y, z]) = (tangent(du), tangent(dv));
    let n = [b * z - c * y, c * x - a * z, a * y - b * x];
    let square = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
    if square == 0.0 {
        return n;
    }
    let scale = 1.0 / square.sqrt();
    n.map(|v| v * scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::evaluators::bernstein;

    #[test]
    fn points_are_those_of_bernstein_s_sums_and_tangents_their_derivatives() {
        for orders in [[2, 2], [2, 3], [3, 2], [2, 7], [7, 2], [4, 4], [3, 6], [6, 3], [5, 4]] {
            let points: Vec<[f32; 2]> = (0..orders[0] * orders[1])
                .map(|i| [(i * 31 % 17) as f32 / 8.0, (i * 7 % 11) as f32 / 5.0])
                .collect();
            let at = [0.3, 0.6];
            let place =
                |du: f32, dv: f32| bernstein::surface(&points, orders, [at[0] + du, at[1] + dv]);
            let [point, du, dv] = point_and_tangents(&points, orders, at);
            let h = 1e-2;
            // Difference quotients, over the degrees that the tangents leave out.
            let slope = |a: [f32; 2], b: [f32; 2], order: usize| {
                less(a, b).map(|d| d / (2.0 * h) / (order - 1) as f32)
            };
            let (right_u, right_v) = (
                slope(place(h, 0.0), place(-h, 0.0), orders[0]),
                slope(place(0.0, h), place(0.0, -h), orders[1]),
            );
            for k in 0..2 {
                assert!((point[k] - place(0.0, 0.0)[k]).abs() < 1e-5, "{orders:?}");
                assert!((du[k] - right_u[k]).abs() < 5e-3, "{orders:?}: {du:?} {right_u:?}");
                assert!((dv[k] - right_v[k]).abs() < 5e-3, "{orders:?}: {dv:?} {right_v:?}");
            }
        }
    }

    #[test]
    fn normals_of_rational_surfaces_do_not_depend_on_the_weight_of_the_whole() {
        let tangents = [[0.5, 0.25, 0.5, 1.0], [1.0, 0.0, 0.25, 0.5], [0.0, 1.0, -0.5, -0.25]];
        let twice = tangents.map(|v| v.map(|x| 2.0 * x));
        let (a, b) = (normal(tangents, true), normal(twice, true));
        assert!((0..3).all(|k| (a[k] - b[k]).abs() < 1e-6), "{a:?} {b:?}");
        assert_eq!(
            normal([[0.0; 4], [1.0, 0.0, 0.0, 0.0], [0.0, 2.0, 0.0, 0.0]], false),
            [0.0, 0.0, 1.0]
        );
        assert_eq!(normal([[0.0; 4], [1.0, 0.0, 0.0, 0.0], [2.0, 0.0, 0.0, 0.0]], false), [0.0; 3]);
    }
}
