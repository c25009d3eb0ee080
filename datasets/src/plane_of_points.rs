//! The plane that points in no order lie in.
//!
//! It is that through three of them: the first by its coordinates, the one that is farthest from
//! it, and the one that is farthest from the line between the two. Such a triangle is as large as
//! the points allow, up to a factor: the plane is off by no more than a few roundings at any of
//! them, and does not depend on their order, as sums over all would.

use glam::{DMat3, DQuat, DVec3};
use std::cmp::Ordering;

/// Side of a box by its longest one below which it is rounding: points lie in a plane of two axes,
/// or on a line.
const FLAT: f64 = 1e-6;

/// Distance from a plane, by the longest side of the points' box, up to which points lie in it,
/// where it slants to the axes. Programs round coordinates to five digits (ParaView), each by
/// itself.
pub(crate) const FLATNESS: f64 = 1e-4;

/// How points lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Lie {
    /// In a plane of two axes, across this one. So do points on a line along an axis.
    Across(usize),
    /// In a plane that slants to the axes.
    Slanting(SlantingPlane),
    /// On a line that slants to the axes.
    Line,
    /// In no plane: the farthest is `off` from that of the largest triangle, by the longest side of
    /// the points' box.
    Space { off: f64 },
}

/// A plane that slants to the axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SlantingPlane {
    /// Of length 1, with its largest component positive.
    pub(crate) normal: DVec3,
    /// Product of the normal with the plane's points.
    pub(crate) height: f64,
    /// Distance of the farthest point, by the longest side of the points' box.
    pub(crate) off: f64,
}

impl SlantingPlane {
    /// The nearest place in the plane.
    pub(crate) fn project(&self, p: DVec3) -> DVec3 {
        p + self.normal * (self.height - p.dot(self.normal))
    }

    /// The axis that is nearest to the normal, and the least rotation of the normal onto it.
    pub(crate) fn turn(&self) -> (usize, DMat3) {
        let axis = self.normal.abs().max_position();
        let turn = DQuat::from_rotation_arc(self.normal, DVec3::AXES[axis]);
        (axis, DMat3::from_quat(turn))
    }
}

/// How these points lie, which are finite.
pub(crate) fn lie(points: impl Iterator<Item = DVec3> + Clone) -> Lie {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for p in points.clone() {
        (low, high) = (low.min(p), high.max(p));
    }
    // Halves, so that no difference of finite numbers overflows.
    let side = 0.5 * high - 0.5 * low;
    let longest = side.max_element();
    // z rather than the others, should the points be on a line.
    let across = (0..3).rev().find(|a| side[*a] <= FLAT * longest || !side.is_finite());
    if let Some(axis) = across {
        return Lie::Across(axis);
    }
    // In units of the box: squares of lengths neither overflow nor vanish.
    let at = |p: DVec3| (0.5 * p - 0.5 * low) / longest;
    let farthest = |distance: &dyn Fn(DVec3) -> f64| {
        let order =
            |p: &DVec3, q: &DVec3| distance(*p).total_cmp(&distance(*q)).then(by_coordinates(q, p));
        points.clone().map(at).max_by(order).unwrap_or_default()
    };
    let first = points.clone().map(at).min_by(by_coordinates).unwrap_or_default();
    let second = farthest(&|p| p.distance_squared(first));
    let along = (second - first).normalize_or_zero();
    let third = farthest(&|p| (p - first).cross(along).length_squared());
    let across = along.cross(third - first);
    if across.length() <= 2.0 * FLAT {
        return Lie::Line;
    }
    let normal = across.normalize();
    let off = points.map(|p| (at(p) - first).dot(normal).abs()).fold(0.0, f64::max) / 2.0;
    if off > FLATNESS {
        return Lie::Space { off };
    }
    let normal = if normal[normal.abs().max_position()] < 0.0 { -normal } else { normal };
    let height = normal.dot(low) + 2.0 * longest * normal.dot(first);
    Lie::Slanting(SlantingPlane { normal, height, off })
}

fn by_coordinates(p: &DVec3, q: &DVec3) -> Ordering {
    let mut order = p.x.total_cmp(&q.x);
    order = order.then(p.y.total_cmp(&q.y));
    order.then(p.z.total_cmp(&q.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points 0..1 by 0..`width` in the plane across z, turned, moved, and rounded to a step.
    fn plane(turn: DQuat, far: DVec3, width: f64, step: f64) -> Vec<[f64; 3]> {
        let at = |i: usize| {
            let (u, v) = ((i * 37 % 101) as f64 / 100.0, width * (i * 53 % 89) as f64 / 88.0);
            let p = turn * DVec3::new(u, v, 0.0) + far;
            (if step > 0.0 { (p / step).round() * step } else { p }).to_array()
        };
        (0..500).map(at).collect()
    }

    fn lie(points: &[[f64; 3]]) -> Lie {
        super::lie(points.iter().copied().map(DVec3::from))
    }

    #[test]
    fn a_slanting_plane_is_found_far_from_the_origin_narrow_and_rounded() {
        let axis = DVec3::new(0.6, -0.64, 0.48);
        for degrees in [1.0f64, 20.0, 44.9, 65.0] {
            let turn = DQuat::from_axis_angle(axis, degrees.to_radians());
            for (far, width, step, most) in [
                (DVec3::ZERO, 1.0, 0.0, 1e-14),
                (DVec3::new(300.0, -2e3, 50.0), 1.0, 0.0, 1e-11),
                (DVec3::ZERO, 1e-3, 0.0, 1e-12),
                (DVec3::ZERO, 1.0, 1e-5, 3e-5),
            ] {
                let points = plane(turn, far, width, step);
                let case = format!("{degrees} {far} {width} {step}");
                let Lie::Slanting(found) = lie(&points) else { panic!("{case}") };
                let expected = turn * DVec3::Z;
                let sine = found.normal.cross(expected).length();
                // Across a narrow plane, a rounding is a larger angle.
                assert!(sine <= most / width, "{case}: {sine}");
                assert!(found.off <= most, "{case}: {}", found.off);
                for p in points.iter().map(|p| DVec3::from(*p)) {
                    let moved = found.project(p).distance(p);
                    assert!(moved <= 2.0 * most, "{case}: {moved}");
                }
                let reversed: Vec<[f64; 3]> = points.into_iter().rev().collect();
                assert_eq!(lie(&reversed), Lie::Slanting(found), "{case}: in another order");
            }
        }
    }

    #[test]
    fn lines_planes_of_axes_and_points_in_space_are_told_apart() {
        let turn = DQuat::from_axis_angle(DVec3::X, 0.5);
        assert_eq!(lie(&plane(DQuat::IDENTITY, DVec3::ONE, 1.0, 0.0)), Lie::Across(2));
        assert_eq!(lie(&[]), Lie::Across(2));
        assert_eq!(lie(&[[1.0; 3]; 4]), Lie::Across(2));
        let line: Vec<[f64; 3]> = (0..9).map(|i| [0.1, 0.7, -0.3].map(|x| x * i as f64)).collect();
        assert_eq!(lie(&line), Lie::Line);
        let mut bent = plane(turn, DVec3::ZERO, 1.0, 0.0);
        bent[77][2] += 3e-3;
        let Lie::Space { off } = lie(&bent) else { panic!("{:?}", lie(&bent)) };
        assert!((1e-3..4e-3).contains(&off), "{off}");
    }

    #[test]
    fn sizes_at_the_ends_of_the_numbers_overflow_nowhere() {
        for scale in [1e-300, 1e300] {
            let turn = DQuat::from_axis_angle(DVec3::new(0.6, 0.8, 0.0), 0.6);
            let points = plane(turn, DVec3::ZERO, 1.0, 0.0);
            let points: Vec<[f64; 3]> = points.iter().map(|p| p.map(|x| x * scale)).collect();
            let Lie::Slanting(found) = lie(&points) else { panic!("{scale}") };
            assert!(found.off < 1e-12 && found.normal.is_normalized(), "{found:?}");
        }
    }
}
