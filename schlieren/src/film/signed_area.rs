//! Shares of a small triangle in pixels by the signed areas beside its edges.
//!
//! To the right of an edge that goes up, each row of pixels gains as much area as the edge is high
//! there, to the right of one that goes down it loses as much. What remains is inside. So a walk
//! along three edges gives the areas in all pixels, without cutting polygons. (Rasterizers of fonts
//! work so: FreeType's `ftgrays`, after R. Levien's libart.)

/// Most columns and rows of pixels around the triangle. Where light is bent by less than a pixel
/// from one ray to the next, it has two or three.
const MOST: usize = 3;

/// Least area in pixels. Sums of signed areas are exact to about 1e-16 of a pixel, so shares are to
/// 1e-13 of the triangle.
const LEAST_AREA: f64 = 1e-3;

/// Calls `add` with each pixel of a film of this size that has a part of the triangle, and its
/// share of `area`, the triangle's. Returns false, and calls nothing, for a triangle that is too
/// large or has too little area.
pub(super) fn small_triangle_in_pixels(
    points: &[[f64; 2]; 3],
    area: f64,
    size: [u32; 2],
    mut add: impl FnMut([u32; 2], f64),
) -> bool {
    let [p, q, r] = points;
    let low = [0, 1].map(|axis| p[axis].min(q[axis]).min(r[axis]).floor());
    let high = [0, 1].map(|axis| p[axis].max(q[axis]).max(r[axis]).ceil());
    let most = MOST as f64;
    let is_small = high[0] - low[0] <= most && high[1] - low[1] <= most && area >= LEAST_AREA;
    if !is_small {
        return false;
    }
    // Exact: the difference to a smaller integer nearby.
    let local = points.map(|point| [point[0] - low[0], point[1] - low[1]]);
    let mut gains = [[0.0; MOST + 2]; MOST];
    add_edge(&mut gains, local[0], local[1]);
    add_edge(&mut gains, local[1], local[2]);
    add_edge(&mut gains, local[2], local[0]);
    for (row, gains) in gains.iter().enumerate() {
        let y = low[1] + row as f64;
        let mut signed_area = 0.0;
        for (column, gain) in gains[..MOST].iter().enumerate() {
            signed_area += gain;
            let share = f64::abs(signed_area) / area;
            let x = low[0] + column as f64;
            let on_film = x >= 0.0 && y >= 0.0 && x < f64::from(size[0]) && y < f64::from(size[1]);
            // Less is what rounding leaves beside the triangle.
            if on_film && share > 1e-12 {
                add([x as u32, y as u32], share);
            }
        }
    }
    true
}

/// Adds what pixels to the right of an edge gain over those to their left, row by row.
#[inline(always)]
fn add_edge(gains: &mut [[f64; MOST + 2]; MOST], from: [f64; 2], to: [f64; 2]) {
    if from[1] == to[1] {
        return;
    }
    let (first, last, sign) = if from[1] < to[1] { (from, to, 1.0) } else { (to, from, -1.0) };
    let slope = (last[0] - first[0]) / (last[1] - first[1]);
    let [mut x, mut y] = first;
    while y < last[1] {
        let row = (y as usize).min(MOST - 1);
        let next_y = (row as f64 + 1.0).min(last[1]);
        let at_next = first[0] + (next_y - first[1]) * slope;
        let next_x = if next_y == last[1] { last[0] } else { at_next.clamp(0.0, MOST as f64) };
        add_part(&mut gains[row], x.min(next_x), x.max(next_x), sign * (next_y - y));
        [x, y] = [next_x, next_y];
    }
}

/// Adds the part of an edge within a row: from column `left` to `right`, `height` high.
#[inline(always)]
fn add_part(gains: &mut [f64; MOST + 2], left: f64, right: f64, height: f64) {
    let mut column = (left as usize).min(MOST);
    if right <= column as f64 + 1.0 {
        let beside = height * (0.5 * (left + right) - column as f64);
        gains[column] += height - beside;
        gains[column + 1] += beside;
        return;
    }
    let per_column = height / (right - left);
    let mut begin = left;
    while begin < right && column < MOST {
        let end = (column as f64 + 1.0).min(right);
        let height = per_column * (end - begin);
        let beside = height * (0.5 * (begin + end) - column as f64);
        gains[column] += height - beside;
        gains[column + 1] += beside;
        begin = end;
        column += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::super::polygon_area::{polygon_in_pixels, triangle_area};
    use super::*;
    use proptest::prelude::*;

    fn corner() -> impl Strategy<Value = [f64; 2]> {
        // Also on the edges of pixels and beyond the film's.
        let on_edges = prop_oneof![(-1..=5).prop_map(f64::from), -1.0..5.0];
        [on_edges.clone(), on_edges]
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            max_global_rejects: 20_000,
            ..ProptestConfig::with_cases(4000)
        })]

        #[test]
        fn signed_areas_and_cut_polygons_give_the_same_shares(
            a in corner(),
            span in prop::array::uniform2(prop::array::uniform2(-2.0_f64..2.0)),
            rounded in any::<bool>(),
        ) {
            let near = |d: [f64; 2]| {
                let at = [a[0] + d[0], a[1] + d[1]];
                if rounded { at.map(f64::round) } else { at }
            };
            let points = [a, near(span[0]), near(span[1])];
            let (area, size) = (triangle_area(&points), [4, 3]);
            let mut sums = [[0.0_f64; 12]; 2];
            let place = |[x, y]: [u32; 2]| (4 * y + x) as usize;
            let add = |pixel, share| sums[0][place(pixel)] += share;
            prop_assume!(small_triangle_in_pixels(&points, area, size, add));
            polygon_in_pixels(&points, area, size, |pixel, share| sums[1][place(pixel)] += share);
            for (signed, cut) in sums[0].iter().zip(&sums[1]) {
                prop_assert!((signed - cut).abs() < 2e-12, "{points:?}: {signed} {cut}");
            }
        }
    }

    #[test]
    fn long_and_thin_triangles_are_left_to_others() {
        let never = |_: [u32; 2], _: f64| panic!("a share");
        let long = [[0.0, 0.0], [3.5, 0.0], [0.0, 1.0]];
        let thin = [[0.0, 0.0], [1.0, 1.0], [1.0, 1.0001]];
        let lost = [[f64::NAN, 0.0], [1.0, 0.0], [0.0, 1.0]];
        for points in [long, thin, lost] {
            assert!(!small_triangle_in_pixels(&points, triangle_area(&points), [9, 9], never));
        }
    }
}
