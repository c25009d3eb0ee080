//! Computes the coefficients of the cubic B-spline through given values at the nodes.
//!
//! The coefficients `c` satisfy `c[i-1] + 4 c[i] + c[i+1] = 6 v[i]` at every node. Two conditions
//! at the ends are missing. The spline has no knot at the second and at the last but one node: its
//! third derivative is continuous there (de Boor, "A Practical Guide to Splines", chapter IV), so
//! the spline keeps its order up to the faces of the field. (A natural spline, whose second
//! derivative vanishes at the ends, is of second order there: 5.6 % wrong in a wall layer of three
//! nodes. Mirrored ends, which are usual for images, force the gradient to zero.)
//!
//! With the equations of the nodes 0, 1 and 2, that condition is `6 c[1] = 8 v[1] - v[0] - v[2]`.
//! What remains is tridiagonal, and is solved by elimination. Three nodes give a parabola, two a
//! straight line.

/// `6 c` at the second node from the end, from the values of the last three.
fn without_knot(end: f64, second: f64, third: f64) -> f64 {
    8.0 * second - end - third
}

/// Replaces the values `v` in `line[1..=n]` by the coefficients of the spline through them.
/// `line[0]` and `line[n+1]` receive the coefficients outside.
pub(crate) fn prefilter_line(line: &mut [f64]) {
    prefilter_rows(line, 1);
}

/// [`prefilter_line`] along the second axis of a plane with rows of `row` numbers: row by row, for
/// all columns at once.
pub(crate) fn prefilter_rows(plane: &mut [f64], row: usize) {
    let n = plane.len() / row - 2;
    debug_assert!(n >= 2, "a line of a field has two nodes or more");
    let at = |i: usize| row * i..row * (i + 1);
    // The values at the two first and the two last nodes, which the coefficients replace.
    let ends = [1, 2, n - 1, n].map(|i| plane[at(i)].to_vec());
    let [first, second, last_but_one, last] = &ends;
    match n {
        2 => {}
        3 => {
            for x in 0..row {
                let (a, b, c) = (first[x], second[x], last[x]);
                let middle = without_knot(a, b, c) / 6.0;
                // The third differences vanish: a parabola.
                (plane[row + x], plane[2 * row + x]) = (a - b + middle, middle);
                plane[3 * row + x] = c - b + middle;
            }
        }
        _ => {
            let (third, last_but_two) = (plane[at(3)].to_vec(), plane[at(n - 2)].to_vec());
            for x in 0..row {
                plane[2 * row + x] = without_knot(first[x], second[x], third[x]) / 6.0;
                plane[(n - 1) * row + x] =
                    without_knot(last[x], last_but_one[x], last_but_two[x]) / 6.0;
            }
            eliminate(plane, row, n);
            // The node's equation gives the coefficient on its other side.
            outward(plane, row, [1, 2, 3], second);
            outward(plane, row, [n, n - 1, n - 2], last_but_one);
        }
    }
    if n == 2 {
        for x in 0..row {
            plane[x] = 2.0 * first[x] - last[x];
            plane[3 * row + x] = 2.0 * last[x] - first[x];
        }
    } else {
        outward(plane, row, [0, 1, 2], first);
        outward(plane, row, [n + 1, n, n - 1], last);
    }
}

/// The coefficients between the second and the last but one node, which are known.
fn eliminate(plane: &mut [f64], row: usize, n: usize) {
    // Nodes 2 to n - 3 are rows 3 to n - 2.
    let mut ratio = vec![0.0; n + 1];
    let mut pivot = 4.0;
    for i in 3..n - 1 {
        if i > 3 {
            ratio[i] = 1.0 / pivot;
            pivot = 4.0 - ratio[i];
        }
        let reciprocal = 1.0 / pivot;
        let (before, here) = plane.split_at_mut(row * i);
        for (v, c) in here[..row].iter_mut().zip(&before[row * (i - 1)..]) {
            *v = (6.0 * *v - c) * reciprocal;
        }
    }
    ratio[n - 1] = 1.0 / pivot;
    for i in (3..n - 1).rev() {
        let (here, after) = plane.split_at_mut(row * (i + 1));
        for (v, c) in here[row * i..].iter_mut().zip(&after[..row]) {
            *v -= ratio[i + 1] * c;
        }
    }
}

/// The row `to` from the value and the coefficients of its neighbour and the next one.
fn outward(plane: &mut [f64], row: usize, [to, node, next]: [usize; 3], value: &[f64]) {
    for x in 0..row {
        let (c, d) = (plane[node * row + x], plane[next * row + x]);
        plane[to * row + x] = 6.0 * value[x] - 4.0 * c - d;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Value and slope of the spline with these coefficients at node position `u`.
    fn spline(line: &[f64], u: f64) -> (f64, f64) {
        let i = u.floor().clamp(0.0, (line.len() - 4) as f64);
        let (w, d) = crate::interpolate::bspline_weights(u - i);
        let c = &line[i as usize..i as usize + 4];
        let value = (0..4).map(|k| w[k] * c[k]).sum();
        (value, (0..3).map(|k| d[k] * (c[k + 1] - c[k])).sum())
    }

    fn filtered(values: &[f64]) -> Vec<f64> {
        let mut line = vec![0.0; values.len() + 2];
        line[1..=values.len()].copy_from_slice(values);
        prefilter_line(&mut line);
        line
    }

    #[test]
    fn polynomials_that_the_nodes_determine_are_exact_to_the_faces() {
        for n in 2..12usize {
            let degree = (n - 1).min(3) as i32;
            let f = |u: f64| (0..=degree).map(|k| (0.4 * u - 1.0).powi(k) * f64::from(k + 1)).sum();
            let slope = |u: f64| -> f64 {
                (1..=degree)
                    .map(|k| 0.4 * f64::from(k * (k + 1)) * (0.4 * u - 1.0).powi(k - 1))
                    .sum()
            };
            let line = filtered(&(0..n).map(|i| f(i as f64)).collect::<Vec<f64>>());
            for step in 0..=20 {
                let u = (n - 1) as f64 * f64::from(step) / 20.0;
                let (value, gradient) = spline(&line, u);
                let expected: f64 = f(u);
                assert!((value - expected).abs() < 1e-11, "{n} nodes at {u}: {value} {expected}");
                assert!((gradient - slope(u)).abs() < 1e-11, "{n} nodes at {u}: {gradient}");
            }
        }
    }

    #[test]
    fn the_spline_goes_through_any_values() {
        for n in 2..9usize {
            let values: Vec<f64> = (0..n).map(|i| ((i * i * 7 + 3) % 11) as f64).collect();
            let line = filtered(&values);
            for (i, v) in values.iter().enumerate() {
                assert!((spline(&line, i as f64).0 - v).abs() < 1e-12, "{n} nodes, {i}");
            }
        }
    }

    #[test]
    fn a_layer_of_three_nodes_at_a_wall_has_its_slope() {
        let layer = |u: f64| (-u / 3.0).exp();
        let line = filtered(&(0..30).map(|i| layer(f64::from(i))).collect::<Vec<f64>>());
        let slope = spline(&line, 0.0).1;
        assert!((slope * -3.0 - 1.0).abs() < 6e-3, "{slope}");
    }

    #[test]
    fn rows_are_filtered_as_lines() {
        for n in 2..9usize {
            let value = |i: usize, x: usize| ((3 * i + x * x) % 7) as f64;
            let mut plane = vec![0.0; 5 * (n + 2)];
            for i in 0..n {
                (0..5).for_each(|x| plane[5 * (i + 1) + x] = value(i, x));
            }
            prefilter_rows(&mut plane, 5);
            for x in 0..5 {
                let line = filtered(&(0..n).map(|i| value(i, x)).collect::<Vec<f64>>());
                let column: Vec<f64> = plane.iter().skip(x).step_by(5).copied().collect();
                assert_eq!(column, line, "{n} nodes");
            }
        }
    }
}
