//! Tubes: polylines with a radius at every point, drawn as round, joined, untessellated solids
//! (streamlines, field lines, fibres).
//!
//! Each segment is one primitive, a [rounded cone](super::rounded_cone). Neighbours share the
//! sphere at their joint, so the union has no gaps. The parts of a segment's surface inside its
//! neighbours are not reported, so a polyline is one solid: a ray through a bend has one entry and
//! one exit, also for transparent tubes and rays that start inside. Different polylines, and a
//! polyline that crosses itself, interpenetrate.
//!
//! Memory: 20 bytes a point with radii and scalars, 4 bytes a segment.

use super::error::{check_count, check_length};
use super::rounded_cone::{Part, RoundedCone};
use super::{
    Radii, Shape, ShapeError, ShapeHit, ShapePart, ShapeReport, ShapeSurface, any_alpha, in_range,
    outward_box, picked, rounded_point,
};
use crate::math::Aabb;
use crate::ray::Ray;
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// Polylines as tubes. `u` of a hit runs from 0 at a segment's first point to 1 at its second,
/// linearly along the cone and constant on the round ends; `v` is 0.
///
/// ```
/// use rt_core::{glam::Vec3, ray::Ray, shapes::{Radii, Shape, Tubes}};
/// // Two polylines, of three points and of two.
/// let points = vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Z * 9.0, Vec3::Z * 8.0];
/// let tubes = Tubes::new(points, &[0, 3, 5], Radii::Common(0.25)).unwrap();
/// assert_eq!(tubes.num_primitives(), 3);
/// let hit = tubes.closest(0, &Ray::new(Vec3::new(0.5, 0.0, -2.0), Vec3::Z)).unwrap();
/// assert_eq!((hit.t, hit.u), (1.75, 0.5));
/// ```
#[derive(Debug, Clone)]
pub struct Tubes {
    origin: DVec3,
    points: Vec<Vec3>,
    radii: Radii,
    scalars: Option<Vec<f32>>,
    colors: Option<Vec<[f32; 4]>>,
    /// First point of each segment; its second is the next one.
    segments: Vec<u32>,
    single_points: usize,
}

/// Number of neighbours on each side that are tested for containing a hit: enough for segments down
/// to 1/32 of the radius. For shorter ones, a transparent bend may show an inner surface.
const NEIGHBOURS: usize = 32;

impl Tubes {
    /// Tubes around polylines: line i uses the points `offsets[i]..offsets[i + 1]` (as VTK's cell
    /// arrays do), so `offsets` starts at 0 and ends at `points.len()`. Radii are common or one per
    /// point, and vary linearly.
    pub fn new(points: Vec<Vec3>, offsets: &[u32], radii: Radii) -> Result<Self, ShapeError> {
        check_count("tubes", points.len())?;
        radii.check("tubes", "point", points.len())?;
        let bad = |index: usize, value: u32| {
            Err(ShapeError::Offsets { index, value: value as usize, points: points.len() })
        };
        match (offsets.first(), offsets.last()) {
            (Some(0), Some(&last)) if last as usize == points.len() => {}
            (Some(0), Some(&last)) => return bad(offsets.len() - 1, last),
            (Some(&first), _) => return bad(0, first),
            (None, _) if points.is_empty() => {}
            (None, _) => return bad(0, 0),
        }
        if let Some(i) = (1..offsets.len()).find(|&i| offsets[i] < offsets[i - 1]) {
            return bad(i, offsets[i]);
        }
        let lines = || offsets.windows(2).map(|w| w[0]..w[1]);
        let mut segments = Vec::with_capacity(lines().map(|l| l.len().saturating_sub(1)).sum());
        segments.extend(lines().flat_map(|l| l.start..l.end.saturating_sub(1).max(l.start)));
        let single_points = lines().filter(|l| l.len() == 1).count();
        Ok(Tubes {
            origin: DVec3::ZERO,
            points,
            radii,
            scalars: None,
            colors: None,
            segments,
            single_points,
        })
    }

    /// Tubes around f64 world positions, stored relative to their centre: see
    /// [`super::relative_positions`].
    pub fn from_f64_points(
        points: &[DVec3],
        offsets: &[u32],
        radii: Radii,
    ) -> Result<Self, ShapeError> {
        let (origin, points) = super::relative_positions(points);
        Ok(Tubes::new(points, offsets, radii)?.with_origin(origin))
    }

    /// Puts the coordinate origin of the points at a world position.
    pub fn with_origin(self, origin: DVec3) -> Self {
        Tubes { origin, ..self }
    }

    /// One scalar per point, interpolated along the axis, for the material's colour map.
    pub fn with_scalars(self, scalars: Vec<f32>) -> Result<Self, ShapeError> {
        check_length("tubes", "scalars", "point", self.points.len(), scalars.len())?;
        Ok(Tubes { scalars: Some(scalars), ..self })
    }

    /// One linear RGBA colour per point, interpolated along the axis.
    pub fn with_colors(self, colors: Vec<[f32; 4]>) -> Result<Self, ShapeError> {
        check_length("tubes", "colors", "point", self.points.len(), colors.len())?;
        Ok(Tubes { colors: Some(colors), ..self })
    }

    /// Counts segments that are left out, or drawn as a single sphere, and polylines of one point.
    pub fn report(&self) -> ShapeReport {
        let mut r = ShapeReport {
            primitives: self.segments.len(),
            degenerate: self.single_points,
            ..Default::default()
        };
        for prim in 0..self.segments.len() {
            let i = self.segments[prim] as usize;
            let (ra, rb) = (self.radii.get(i), self.radii.get(i + 1));
            let finite = [self.points[i], self.points[i + 1]].iter().all(|p| p.is_finite());
            if !(finite && ra.is_finite() && rb.is_finite()) {
                r.non_finite += 1;
            } else if ra.min(rb) < 0.0 || ra.max(rb) == 0.0 {
                r.no_radius += 1;
            } else if self.bounds(prim as u32).is_empty() {
                r.non_finite += 1;
            } else if self.cone(prim).is_sphere() {
                r.degenerate += 1;
            }
        }
        r
    }

    #[inline]
    fn cone(&self, prim: usize) -> RoundedCone {
        let i = self.segments[prim] as usize;
        let a = self.points[i].as_dvec3();
        RoundedCone {
            a,
            v: self.points[i + 1].as_dvec3() - a,
            ra: f64::from(self.radii.get(i)),
            rb: f64::from(self.radii.get(i + 1)),
        }
    }

    #[inline]
    fn is_renderable(&self, prim: usize) -> bool {
        let i = self.segments[prim] as usize;
        let (ra, rb) = (self.radii.get(i), self.radii.get(i + 1));
        let finite = self.points[i].is_finite() && self.points[i + 1].is_finite();
        finite && ra >= 0.0 && rb >= 0.0 && ra.max(rb) > 0.0 && ra.max(rb) < f32::INFINITY
    }

    /// The renderable segment that ends where `prim` begins (`step` −1) or begins where it ends
    /// (+1).
    #[inline]
    fn neighbour(&self, prim: usize, step: isize) -> Option<usize> {
        let other = prim.checked_add_signed(step)?;
        let joined = *self.segments.get(other)? as isize == self.segments[prim] as isize + step;
        (joined && self.is_renderable(other)).then_some(other)
    }

    /// Whether the surface point `p` of segment `prim` is inside the rest of its polyline.
    fn is_hidden(&self, prim: usize, p: DVec3, rounding: f64) -> bool {
        let own = self.cone(prim);
        let reach = 2.0 * own.ra.max(own.rb);
        // Inside by a margin, so that where two segments' surfaces cross, rounding cannot make each
        // hide the other.
        let margin = 1e-9 * own.ra.max(own.rb) + rounding;
        for step in [-1, 1] {
            let (mut at, mut walked) = (prim, 0.0);
            for _ in 0..NEIGHBOURS {
                let Some(next) = self.neighbour(at, step) else { break };
                let cone = self.cone(next);
                if cone.nearest(p).distance < -margin {
                    return true;
                }
                walked += cone.v.length();
                if walked > reach {
                    break;
                }
                at = next;
            }
        }
        false
    }

    /// The first intersection that is on the polyline's outside, in f64 and as reported.
    #[inline]
    fn first(&self, prim: usize, ray: &Ray) -> Option<(f64, f32)> {
        let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
        let ends = self.cone(prim).interval(o, d)?;
        for (t, part) in ends {
            let reported = t as f32;
            if !in_range(reported, ray) {
                continue;
            }
            // The sphere at a joint belongs to the segment that ends there; otherwise it would be
            // reported twice.
            if part == Part::Start && self.neighbour(prim, -1).is_some() {
                continue;
            }
            let step = d * t;
            if self.is_hidden(prim, o + step, 4.0 * f64::EPSILON * (o.length() + step.length())) {
                continue;
            }
            return Some((t, reported));
        }
        None
    }
}

impl Shape for Tubes {
    fn num_primitives(&self) -> usize {
        self.segments.len()
    }

    fn origin(&self) -> DVec3 {
        self.origin
    }

    fn bounds(&self, prim: u32) -> Aabb {
        let prim = prim as usize;
        if !self.is_renderable(prim) {
            return Aabb::EMPTY;
        }
        let c = self.cone(prim);
        let b = c.a + c.v;
        outward_box((c.a - c.ra).min(b - c.rb), (c.a + c.ra).max(b + c.rb))
    }

    #[inline]
    fn closest(&self, prim: u32, ray: &Ray) -> Option<ShapeHit> {
        let (t, reported) = self.first(prim as usize, ray)?;
        let p = ray.origin.as_dvec3() + ray.dir.as_dvec3() * t;
        Some(ShapeHit { t: reported, u: self.cone(prim as usize).nearest(p).along as f32, v: 0.0 })
    }

    fn occluded(&self, prim: u32, ray: &Ray) -> bool {
        self.first(prim as usize, ray).is_some()
    }

    fn has_transparency(&self) -> bool {
        any_alpha(&self.colors)
    }

    /// Also holds those segments of the same line that may hide parts of the requested ones.
    fn part(&self, primitives: &[u32]) -> Option<Arc<dyn Shape>> {
        let (mut points, mut segments, mut local) = (Vec::new(), Vec::new(), Vec::new());
        let asked = primitives.iter().map(|&p| p as usize).filter(|&p| p < self.segments.len());
        let mut asked = asked.peekable();
        while let Some(first) = asked.next() {
            // ---- A run of segments without gap, and the primitives asked for in it.
            let start = first.saturating_sub(NEIGHBOURS);
            let mut run = vec![first];
            let mut end = (first + NEIGHBOURS + 1).min(self.segments.len());
            while let Some(next) = asked.next_if(|&next| next.saturating_sub(NEIGHBOURS) <= end) {
                run.push(next);
                end = (next + NEIGHBOURS + 1).min(self.segments.len());
            }
            local.extend(run.iter().map(|p| (p - start + segments.len()) as u32));
            let (low, high) = (self.segments[start], self.segments[end - 1] + 1);
            let shift = points.len();
            segments.extend(self.segments[start..end].iter().map(|s| s - low + shift as u32));
            points.extend(low as usize..=high as usize);
        }
        let numbers = || points.iter().copied();
        let tubes = Tubes {
            origin: self.origin,
            points: picked(&self.points, numbers()),
            radii: self.radii.part(numbers()),
            scalars: self.scalars.as_ref().map(|s| picked(s, numbers())),
            colors: self.colors.as_ref().map(|c| picked(c, numbers())),
            segments,
            single_points: 0,
        };
        Some(Arc::new(ShapePart::new(Arc::new(tubes), local)))
    }

    fn surface(&self, prim: u32, hit: &ShapeHit, ray: &Ray) -> ShapeSurface {
        let cone = self.cone(prim as usize);
        let (o, d, t) = (ray.origin.as_dvec3(), ray.dir.as_dvec3(), f64::from(hit.t));
        let t = match cone.interval(o, d) {
            Some([(near, _), (far, _)]) if (near - t).abs() <= (far - t).abs() => near,
            Some([_, (far, _)]) => far,
            None => t,
        };
        let p = o + d * t;
        let n = cone.nearest(p);
        let extent = cone.v.length() + cone.ra.max(cone.rb);
        let (point, point_error) =
            rounded_point(p - n.distance * n.normal, 8.0 * f64::EPSILON * extent);
        let i = self.segments[prim as usize] as usize;
        let w = n.along as f32;
        let mix = |a: f32, b: f32| a + (b - a) * w;
        ShapeSurface {
            point,
            point_error,
            normal: n.normal.as_vec3(),
            shading_normal: None,
            scalar: self.scalars.as_ref().map(|s| mix(s[i], s[i + 1])),
            color: self.colors.as_ref().map(|c| std::array::from_fn(|k| mix(c[i][k], c[i + 1][k]))),
        }
    }
}
