//! The enabled maps of evaluators, as the driver has them, and their values at a point.

use super::{bernstein, casteljau};
use crate::driver::gl;
use crate::enums::*;

/// The number of parameters of a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum MapKind {
    /// `GL_MAP1_…`: curves.
    Curve,
    /// `GL_MAP2_…`: surfaces.
    Surface,
}

/// One map. Its control points have four values. The program has set the first `size`.
#[derive(Debug, Clone, PartialEq)]
struct ControlPointMap {
    points: Vec<[f32; 4]>,
    size: usize,
    /// The numbers of points in `u` and in `v`; 1 in `v` for a curve.
    orders: [usize; 2],
    /// The start of the domain, and one over its length, in `u` and in `v`.
    first: [f32; 2],
    scale: [f32; 2],
}

/// An evaluated vertex. Attributes without a map are the current ones.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct EvaluatedVertex {
    pub(crate) position: [f32; 4],
    pub(crate) normal: Option<[f32; 3]>,
    pub(crate) color: Option<[f32; 4]>,
    pub(crate) tex: Option<[f32; 4]>,
}

/// The enabled maps of one kind.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct EvaluatorMaps {
    vertex: Option<ControlPointMap>,
    auto_normal: bool,
    normal: Option<ControlPointMap>,
    color: Option<ControlPointMap>,
    tex: Option<ControlPointMap>,
}

/// The targets in the order of OpenGL's numbers, from `GL_MAP1_COLOR_4` and `GL_MAP2_COLOR_4` on.
const COLOR_4: u32 = 0;
const NORMAL: u32 = 2;
const TEXTURE_COORD_1: u32 = 3;
const VERTEX_3: u32 = 7;
const VERTEX_4: u32 = 8;

impl ControlPointMap {
    /// The driver's map with `size` values per point.
    fn query(kind: MapKind, target: u32, size: usize) -> ControlPointMap {
        let (orders, values) = gl::map_points(target, size, kind == MapKind::Surface);
        let domain = gl::map_domain(target);
        let four = |v: &[f32]| std::array::from_fn(|k| v.get(k).copied().unwrap_or(0.0));
        let points = values.chunks_exact(size).map(four).collect();
        let mut map = ControlPointMap { points, size, orders, first: [0.0; 2], scale: [0.0; 2] };
        for k in 0..if kind == MapKind::Surface { 2 } else { 1 } {
            map.first[k] = domain[2 * k];
            map.scale[k] = 1.0 / (domain[2 * k + 1] - domain[2 * k]);
        }
        map
    }

    fn inner(&self, at: [f32; 2]) -> [f32; 2] {
        std::array::from_fn(|k| (at[k] - self.first[k]) * self.scale[k])
    }

    fn at(&self, at: [f32; 2]) -> [f32; 4] {
        self.filled(bernstein::surface(&self.points, self.orders, self.inner(at)))
    }

    /// Values that the program did not set are 0, 0, 0, 1.
    fn filled(&self, v: [f32; 4]) -> [f32; 4] {
        const REST: [f32; 4] = [0.0, 0.0, 0.0, 1.0];
        std::array::from_fn(|k| if k < self.size { v[k] } else { REST[k] })
    }
}

impl EvaluatorMaps {
    /// Asks the driver.
    pub(crate) fn query(kind: MapKind) -> EvaluatorMaps {
        let first = if kind == MapKind::Curve { MAP1_COLOR_4 } else { MAP2_COLOR_4 };
        // The last enabled one has precedence.
        let one_of = |targets: std::ops::RangeInclusive<u32>, least: usize| {
            let from = *targets.start();
            let on = targets.rev().find(|t| gl::is_enabled(first + t))?;
            Some(ControlPointMap::query(kind, first + on, least + (on - from) as usize))
        };
        EvaluatorMaps {
            vertex: one_of(VERTEX_3..=VERTEX_4, 3),
            auto_normal: kind == MapKind::Surface && gl::is_enabled(AUTO_NORMAL),
            normal: one_of(NORMAL..=NORMAL, 3),
            color: one_of(COLOR_4..=COLOR_4, 4),
            tex: one_of(TEXTURE_COORD_1..=TEXTURE_COORD_1 + 3, 1),
        }
    }

    /// True when evaluation gives vertices.
    pub(crate) fn has_vertices(&self) -> bool {
        self.vertex.is_some()
    }

    /// True when evaluation gives colours.
    pub(crate) fn has_colors(&self) -> bool {
        self.color.is_some()
    }

    /// The reason why evaluation is left to the driver, if any.
    pub(crate) fn unsupported(&self) -> Option<&'static str> {
        let map = self.vertex.as_ref().filter(|_| self.auto_normal)?;
        if map.orders.contains(&1) {
            return Some("automatic normals of a surface that has no tangents");
        }
        // Only recent versions of Mesa orient them as the specification says.
        let turned = map.scale[0] < 0.0 || map.scale[1] < 0.0;
        turned.then_some("automatic normals over a domain that runs backwards")
    }

    /// The vertex at a point of the domain. `None` without a map of vertices: then nothing is
    /// drawn.
    pub(crate) fn at(&self, at: [f32; 2]) -> Option<EvaluatedVertex> {
        let map = self.vertex.as_ref()?;
        let of = |m: &Option<ControlPointMap>| m.as_ref().map(|m| m.at(at));
        let mut out = EvaluatedVertex {
            color: of(&self.color),
            tex: of(&self.tex),
            ..EvaluatedVertex::default()
        };
        if self.auto_normal && self.unsupported().is_none() {
            let found = casteljau::point_and_tangents(&map.points, map.orders, map.inner(at));
            out.position = map.filled(found[0]);
            out.normal = Some(casteljau::normal(found, map.size == 4));
        } else {
            out.position = map.at(at);
            out.normal = of(&self.normal).map(|[x, y, z, _]| [x, y, z]);
        }
        Some(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(points: &[[f32; 4]], orders: [usize; 2], size: usize) -> Option<ControlPointMap> {
        Some(ControlPointMap {
            points: points.to_vec(),
            size,
            orders,
            first: [1.0, 2.0],
            scale: [0.5, 0.25],
        })
    }

    #[test]
    fn domains_are_mapped_and_what_no_map_gives_stays_current() {
        let corners = [
            [0.0, 0.0, 0.0, 0.0],
            [0.0, 4.0, 0.0, 0.0],
            [2.0, 0.0, 0.0, 0.0],
            [2.0, 4.0, 1.0, 0.0],
        ];
        let mut maps = EvaluatorMaps {
            vertex: map(&corners, [2, 2], 3),
            tex: map(&corners, [2, 2], 2),
            ..EvaluatorMaps::default()
        };
        let found = maps.at([2.0, 4.0]).unwrap();
        assert_eq!(found.position, [1.0, 2.0, 0.25, 1.0]);
        assert_eq!(found.tex, Some([1.0, 2.0, 0.0, 1.0]));
        assert_eq!((found.color, found.normal), (None, None));
        maps.auto_normal = true;
        let n = maps.at([1.0, 2.0]).unwrap().normal.unwrap();
        assert_eq!(n, [0.0, 0.0, 1.0]);
        maps.vertex = None;
        assert_eq!(maps.at([2.0, 4.0]), None);
    }

    #[test]
    fn automatic_normals_that_drivers_do_not_agree_on_are_told_by_name() {
        let points = [[0.0; 4]; 4];
        let mut maps = EvaluatorMaps {
            vertex: map(&points, [2, 2], 3),
            auto_normal: true,
            ..EvaluatorMaps::default()
        };
        assert_eq!(maps.unsupported(), None);
        maps.vertex.as_mut().unwrap().scale[1] = -0.25;
        assert!(maps.unsupported().unwrap().contains("backwards"));
        maps.vertex = map(&points, [4, 1], 3);
        assert!(maps.unsupported().unwrap().contains("no tangents"));
        maps.auto_normal = false;
        assert_eq!(maps.unsupported(), None);
    }
}
