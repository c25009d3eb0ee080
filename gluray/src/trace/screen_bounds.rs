//! Computes which pixels a draw may cover: its bounding box on the screen, clipped to the part in
//! front of the viewer.

use super::Rect;
use crate::capture::draw::Draw;
use crate::state::snapshot::Snapshot;
use rt_core::glam::{DMat4, DVec3, DVec4};
use rt_core::math::Aabb;

/// The pixels that a draw may cover: its box on the screen, within viewport and scissor.
pub(super) fn screen_bounds(draw: &Draw, clip: DMat4) -> Rect {
    let s = &*draw.state;
    let [x, y, w, h] = s.viewport;
    let mut rect = Rect { x, y, w, h };
    if let Some([x, y, w, h]) = s.scissor {
        rect = rect.and(Rect { x, y, w, h });
    }
    let b = draw.geometry.bounds();
    if b.is_empty() {
        return Rect::default();
    }
    rect.and(box_on_screen(b, clip, s))
}

/// The pixels that a box may cover, beyond the viewport as well.
pub(super) fn box_on_screen(b: Aabb, clip: DMat4, s: &Snapshot) -> Rect {
    let [x, y, w, h] = s.viewport;
    let corners: [DVec4; 8] = std::array::from_fn(|corner| {
        let pick = |k: usize| if corner >> k & 1 == 0 { b.min[k] } else { b.max[k] };
        clip * DVec3::new(f64::from(pick(0)), f64::from(pick(1)), f64::from(pick(2))).extend(1.0)
    });
    if corners.iter().any(|c| !c.is_finite()) {
        return Rect { x, y, w, h };
    }
    match on_screen(&corners, s.depth_clamp) {
        None => Rect::default(),
        Some([lo, hi]) => {
            let pixel = |ndc: f64, at: i32, size: i32| {
                (f64::from(at) + (ndc + 1.0) * 0.5 * f64::from(size)).clamp(-1e9, 1e9)
            };
            let (x0, y0) =
                (pixel(lo[0], x, w).floor() as i32 - 1, pixel(lo[1], y, h).floor() as i32 - 1);
            let (x1, y1) =
                (pixel(hi[0], x, w).ceil() as i32 + 1, pixel(hi[1], y, h).ceil() as i32 + 1);
            Rect { x: x0, y: y0, w: x1.saturating_sub(x0), h: y1.saturating_sub(y0) }
        }
    }
}

/// The bounds of a box in normalised device coordinates. `corners` are its clip coordinates (bit k
/// of the index selects the greater end of axis k). Returns `None` when the whole box is outside
/// one plane of the view volume. The part behind the viewer is cut off. Otherwise every pixel would
/// be searched for all draws around the viewer.
fn on_screen(corners: &[DVec4; 8], depth_clamp: bool) -> Option<[[f64; 2]; 2]> {
    // Tolerance for rounding. Each fragment makes the exact test.
    const SLACK: f64 = 1e-4;
    let size = corners.iter().map(|c| c.abs().max_element()).fold(0.0, f64::max);
    let near = |c: &DVec4| if depth_clamp { c.w } else { c.z + c.w * (1.0 + SLACK) } + SLACK * size;
    let beyond = |height: &dyn Fn(&DVec4) -> f64| corners.iter().all(|c| height(c) < 0.0);
    let room = 1.0 + SLACK;
    let outside = beyond(&|c| near(c) - SLACK * size * 0.5)
        || beyond(&|c| c.w * room + SLACK * size)
        || !depth_clamp && beyond(&|c| c.w * room - c.z + SLACK * size)
        || (0..2).any(|k| {
            beyond(&|c| c.w * room + c[k] + SLACK * size)
                || beyond(&|c| c.w * room - c[k] + SLACK * size)
        });
    if outside {
        return None;
    }
    let (mut lo, mut hi) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let mut all = false;
    let mut take = |c: DVec4| {
        // A point in the plane of the eye may project anywhere.
        all |= c.w <= 1e-9 * size;
        for k in 0..2 {
            lo[k] = lo[k].min(c[k] / c.w);
            hi[k] = hi[k].max(c[k] / c.w);
        }
    };
    for i in 0..8_usize {
        let (a, ha) = (corners[i], near(&corners[i]));
        if ha >= 0.0 {
            take(a);
        }
        for k in 0..3 {
            let j = i | 1 << k;
            let (b, hb) = (corners[j], near(&corners[j]));
            if j != i && (ha < 0.0) != (hb < 0.0) {
                take(a + (b - a) * (ha / (ha - hb)));
            }
        }
    }
    Some(if all { [[-1.0; 2], [1.0; 2]] } else { [lo, hi] })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The clip coordinates of a box under a frustum of 90 degrees from 1 to 100.
    fn corners(lo: [f64; 3], hi: [f64; 3]) -> [DVec4; 8] {
        std::array::from_fn(|i| {
            let p: [f64; 3] = std::array::from_fn(|k| if i >> k & 1 == 0 { lo[k] } else { hi[k] });
            DVec4::new(p[0], p[1], -(101.0 / 99.0) * p[2] - 200.0 / 99.0, -p[2])
        })
    }

    #[test]
    fn what_is_around_the_viewer_covers_no_more_than_its_part_in_front() {
        let b = on_screen(&corners([-1.0, -1.0, -10.0], [1.0, 1.0, -5.0]), false)
            .expect("before the viewer");
        assert!((b[0][0] + 0.2).abs() < 1e-9 && (b[1][1] - 0.2).abs() < 1e-9, "{b:?}");
        // A box from behind the viewer to in front of it, on the right side.
        let b = on_screen(&corners([0.5, -0.1, -10.0], [0.6, 0.1, 10.0]), false)
            .expect("partly before");
        assert!((b[0][0] - 0.05).abs() < 1e-9, "{b:?}");
        assert!(b[1][0] > 0.599 && b[1][0] < 0.65 && b[1][1] < 0.11, "{b:?}");
        for (lo, hi) in [
            ([-1.0, -1.0, 2.0], [1.0, 1.0, 9.0]),
            ([-1.0, -1.0, -300.0], [1.0, 1.0, -200.0]),
            ([20.0, -1.0, -10.0], [30.0, 1.0, -2.0]),
            ([-1.0, 20.0, -10.0], [1.0, 30.0, -2.0]),
        ] {
            assert_eq!(on_screen(&corners(lo, hi), false), None, "{lo:?} {hi:?}");
        }
        assert!(
            on_screen(&corners([-1.0, -1.0, -300.0], [1.0, 1.0, -200.0]), true).is_some(),
            "depth clamp"
        );
        assert_eq!(
            on_screen(&corners([-1.0, -1.0, -0.5], [1.0, 1.0, 0.5]), true),
            Some([[-1.0; 2], [1.0; 2]])
        );
    }
}
