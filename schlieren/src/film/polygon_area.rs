//! Shares of a triangle in pixels by cutting it: of any size, also where it is so thin that its
//! area is small against the rounding of its coordinates.

/// Calls `add` with each pixel of a film of this size that has a part of the triangle, and its
/// share of `area`, the triangle's.
pub(super) fn polygon_in_pixels(
    points: &[[f64; 2]; 3],
    area: f64,
    size: [u32; 2],
    mut add: impl FnMut([u32; 2], f64),
) {
    // Where the triangle ends at the edge of a pixel, it has no area beyond.
    let bounds = |axis: usize| {
        let low = points.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min).floor();
        let high = points.iter().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max).ceil();
        (low.max(0.0) as u32)..(high.clamp(0.0, f64::from(size[axis])) as u32)
    };
    let triangle = Polygon::new(points);
    for y in bounds(1) {
        let mut row = triangle;
        row.clip(1, f64::from(y), 1.0);
        row.clip(1, f64::from(y) + 1.0, -1.0);
        for x in bounds(0) {
            let mut cell = row;
            cell.clip(0, f64::from(x), 1.0);
            cell.clip(0, f64::from(x) + 1.0, -1.0);
            let share = polygon_area(cell.points()) / area;
            if share > 0.0 {
                add([x, y], share);
            }
        }
    }
}

/// Area of a triangle of either orientation.
pub(super) fn triangle_area(points: &[[f64; 2]; 3]) -> f64 {
    polygon_area(points)
}

/// A convex polygon. A triangle clipped by four lines has at most seven corners.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [[f64; 2]; 8],
    len: usize,
}

impl Polygon {
    fn new(points: &[[f64; 2]; 3]) -> Polygon {
        let mut corners = [[0.0; 2]; 8];
        corners[..3].copy_from_slice(points);
        Polygon { corners, len: 3 }
    }

    fn points(&self) -> &[[f64; 2]] {
        &self.corners[..self.len]
    }

    /// Clips by a line across `axis` (Sutherland and Hodgman 1974): keeps the part above `limit`
    /// for `side` = 1, the part below for -1. Most clips of a large triangle's row keep all of it
    /// or nothing, and end at the first two questions.
    #[inline(always)]
    fn clip(&mut self, axis: usize, limit: f64, side: f64) {
        let len = self.len.min(8);
        let mut distance = [0.0; 8];
        let mut outside = 0u32;
        for (i, p) in self.points().iter().enumerate() {
            distance[i & 7] = side * (p[axis] - limit);
            outside |= u32::from(distance[i & 7] < 0.0) << i;
        }
        if outside == 0 {
            return;
        }
        if outside == (1 << len) - 1 {
            self.len = 0;
            return;
        }
        let mut out = Polygon { corners: [[0.0; 2]; 8], len: 0 };
        for i in 0..len {
            let next = if i + 1 == len { 0 } else { i + 1 };
            let (p, q) = (self.corners[i], self.corners[next]);
            let (p_outside, q_outside) = (outside >> i & 1, outside >> next & 1);
            if p_outside == 0 {
                out.push(p);
            }
            if p_outside != q_outside {
                let t = distance[i] / (distance[i] - distance[next]);
                let mut cut = [p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])];
                cut[axis] = limit;
                out.push(cut);
            }
        }
        *self = out;
    }

    fn push(&mut self, p: [f64; 2]) {
        // Rounding cannot make a ninth corner of a convex polygon.
        if self.len < self.corners.len() {
            self.corners[self.len] = p;
            self.len += 1;
        }
    }
}

/// Area of a polygon of either orientation. Coordinates are relative to the first corner to avoid
/// cancellation far from the origin.
fn polygon_area(points: &[[f64; 2]]) -> f64 {
    let Some((o, rest)) = points.split_first() else { return 0.0 };
    let twice =
        |w: &[[f64; 2]]| (w[0][0] - o[0]) * (w[1][1] - o[1]) - (w[1][0] - o[0]) * (w[0][1] - o[1]);
    0.5 * rest.windows(2).map(twice).sum::<f64>().abs()
}
