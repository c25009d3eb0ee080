//! The rules of the rasterizer: which pixel centres a triangle covers, and how steep it is.

/// The window coordinates of a corner in units of 1/256 pixel, as the driver's rasterizer snaps
/// them.
pub(crate) fn snapped(c: &[f32; 4], viewport: [i32; 4]) -> [i64; 2] {
    let [vx, vy, vw, vh] = viewport.map(|v| v as f32);
    let inverse = 1.0 / c[3];
    let x = c[0] * inverse * (0.5 * vw) + (0.5 * vw + vx);
    let y = c[1] * inverse * (0.5 * vh) + (0.5 * vh + vy);
    // At most two million pixels away, so that products of differences fit into 64 bits.
    [x, y].map(|v| (v * 256.0).round().clamp(-5e8, 5e8) as i64)
}

/// True when the triangle covers the pixel's centre. A centre on an edge belongs to the triangle
/// above the edge or to the right of it.
pub(crate) fn covers(c: &[[f32; 4]; 3], viewport: [i32; 4], x: i32, y: i32) -> bool {
    let p = c.each_ref().map(|v| snapped(v, viewport));
    let (cx, cy) = (i64::from(x) * 256 + 128, i64::from(y) * 256 + 128);
    let edge = |a: [i64; 2], b: [i64; 2], x: i64, y: i64| {
        (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])
    };
    let area = edge(p[0], p[1], p[2][0], p[2][1]);
    if area == 0 {
        return false;
    }
    let p = if area > 0 { p } else { [p[0], p[2], p[1]] };
    (0..3).all(|i| {
        let (a, b) = (p[i], p[(i + 1) % 3]);
        let e = edge(a, b, cx, cy);
        // In a counter-clockwise triangle, a downward edge has the interior at larger x, and an
        // edge to the right has it above.
        let inclusive = b[1] < a[1] || (b[1] == a[1] && b[0] > a[0]);
        e > 0 || (e == 0 && inclusive)
    })
}

/// The window depth of a corner, rounded as a driver rounds it: the quotient to `f32`, then the
/// viewport transform to `f32` (Mesa's draw module with a fused multiply and add).
pub(crate) fn corner_depth(z: f32, w: f32, [near, far]: [f64; 2]) -> f32 {
    (f64::from(z * (1.0 / w)) * ((far - near) * 0.5) + (far + near) * 0.5) as f32
}

/// The depth of a triangle parallel to the screen: that of its corners, where all three are equal.
/// Interpolation in `f64` misses the driver's depth by a step, which decides depth tests between
/// surfaces and lines in one plane.
pub(crate) fn level_depth(c: &[[f32; 4]; 3], range: [f64; 2]) -> Option<f32> {
    let [a, b, c] = c.map(|v| corner_depth(v[2], v[3], range));
    (a == b && b == c).then_some(a)
}

/// The greater of |dz/dx| and |dz/dy| in window coordinates, for polygon offset.
pub(crate) fn steepness(c: &[[f32; 4]; 3], viewport: [i32; 4], depth_scale: f64) -> f64 {
    let [dx, dy] = gradient(c, viewport, depth_scale);
    dx.abs().max(dy.abs())
}

/// The change of depth per pixel in x and in y.
pub(crate) fn gradient(c: &[[f32; 4]; 3], viewport: [i32; 4], depth_scale: f64) -> [f64; 2] {
    let w = c.map(|v| {
        let i = 1.0 / f64::from(v[3]);
        let half = |size: i32| f64::from(size) * 0.5;
        [
            f64::from(v[0]) * i * half(viewport[2]),
            f64::from(v[1]) * i * half(viewport[3]),
            f64::from(v[2]) * i * 0.5 * depth_scale,
        ]
    });
    let d = |a: usize, k: usize| w[a][k] - w[0][k];
    let det = d(1, 0) * d(2, 1) - d(2, 0) * d(1, 1);
    if det == 0.0 {
        return [0.0; 2];
    }
    let dx = (d(1, 2) * d(2, 1) - d(2, 2) * d(1, 1)) / det;
    let dy = (d(2, 2) * d(1, 0) - d(1, 2) * d(2, 0)) / det;
    [dx, dy]
}

/// The terms by which VTK's shaders offset depths. The first is the length of the depth gradient.
/// Those shaders start from the depth at the pixel's centre and write it for all samples. The
/// second number is its difference from the depth at the sample.
pub(crate) fn polygon_offset([dx, dy]: [f64; 2], sample_place: [f32; 2]) -> [f64; 2] {
    let [x, y] = sample_place.map(f64::from);
    [(dx * dx + dy * dy).sqrt(), -(dx * x + dy * y)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_triangles_of_a_square_cover_each_pixel_once_and_the_far_edges_not_at_all() {
        let viewport = [0, 0, 4, 4];
        // Corners on pixel centres: (0.5, 0.5) to (2.5, 2.5) of a 4 x 4 window.
        let at = |x: f32, y: f32| [x / 2.0 - 1.0, y / 2.0 - 1.0, 0.0, 1.0];
        let [a, b, c, d] = [at(0.5, 0.5), at(2.5, 0.5), at(2.5, 2.5), at(0.5, 2.5)];
        for (first, second) in [([a, b, c], [a, c, d]), ([c, b, a], [d, a, c])] {
            for y in 0..4 {
                for x in 0..4 {
                    let n = u32::from(covers(&first, viewport, x, y))
                        + u32::from(covers(&second, viewport, x, y));
                    assert_eq!(n, u32::from(x < 2 && y < 2), "pixel ({x}, {y})");
                }
            }
        }
    }

    #[test]
    fn steepness_is_that_of_the_plane() {
        let viewport = [0, 0, 100, 50];
        // z_window rises by 0.1 per 50 pixels in x, falls by 0.4 per 25 in y.
        let c = [[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.2, 1.0], [0.0, 1.0, -0.8, 1.0]];
        assert!((steepness(&c, viewport, 1.0) - 0.4 / 25.0).abs() < 1e-9);
        let [length, shift] = polygon_offset(gradient(&c, viewport, 1.0), [0.25, -0.5]);
        assert!((length - (0.1_f64 / 50.0).hypot(0.4 / 25.0)).abs() < 1e-9);
        assert!((shift + 0.25 * 0.1 / 50.0 + 0.5 * 0.4 / 25.0).abs() < 1e-9, "{shift}");
    }
}
