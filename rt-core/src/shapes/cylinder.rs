//! Cylinders and truncated cones with flat capped or open ends, as in OpenGL's quadrics and VTK's
//! glyphs and arrows.

use super::error::{check_count, check_length};
use super::frustum::{End, Frustum};
use super::{
    Radii, Shape, ShapeError, ShapeHit, ShapeReport, ShapeSurface, any_alpha, in_range,
    outward_box, picked, rounded_point,
};
use crate::math::Aabb;
use crate::ray::Ray;
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// Cylinders between pairs of points. Two different radii make a truncated cone, a radius of 0 a
/// full cone. Open ones show their inside. `u` of a hit is the position along the axis (0 to 1);
/// `v` is 1 on a cap and 0 on the side.
#[derive(Debug, Clone)]
pub struct Cylinders {
    origin: DVec3,
    /// Start and end of cylinder i are points 2i and 2i + 1.
    points: Vec<Vec3>,
    radii: Radii,
    capped: bool,
    scalars: Option<Vec<f32>>,
    colors: Option<Vec<[f32; 4]>>,
}

impl Cylinders {
    /// Cylinder i goes from `points[2i]` to `points[2i + 1]`. The radius is common or given per
    /// point.
    pub fn new(points: Vec<Vec3>, radii: Radii, capped: bool) -> Result<Self, ShapeError> {
        check_count("cylinders", points.len() / 2)?;
        check_length(
            "cylinders",
            "points",
            "end of a cylinder",
            points.len() / 2 * 2,
            points.len(),
        )?;
        radii.check("cylinders", "point", points.len())?;
        Ok(Cylinders { origin: DVec3::ZERO, points, radii, capped, scalars: None, colors: None })
    }

    /// Puts the coordinate origin of the points at a world position.
    pub fn with_origin(self, origin: DVec3) -> Self {
        Cylinders { origin, ..self }
    }

    /// One scalar per point, interpolated along the axis, for the material's colour map.
    pub fn with_scalars(self, scalars: Vec<f32>) -> Result<Self, ShapeError> {
        check_length("cylinders", "scalars", "point", self.points.len(), scalars.len())?;
        Ok(Cylinders { scalars: Some(scalars), ..self })
    }

    /// One linear RGBA colour per point, interpolated along the axis.
    pub fn with_colors(self, colors: Vec<[f32; 4]>) -> Result<Self, ShapeError> {
        check_length("cylinders", "colors", "point", self.points.len(), colors.len())?;
        Ok(Cylinders { colors: Some(colors), ..self })
    }

    /// Counts the cylinders that are left out.
    pub fn report(&self) -> ShapeReport {
        let mut r = ShapeReport { primitives: self.num_primitives(), ..Default::default() };
        for prim in 0..self.num_primitives() {
            let c = self.cylinder(prim);
            if !(c.a.is_finite() && c.v.is_finite() && c.ra.is_finite() && c.rb.is_finite()) {
                r.non_finite += 1;
            } else if c.ra.min(c.rb) < 0.0 || c.ra.max(c.rb) == 0.0 {
                r.no_radius += 1;
            } else if c.v == DVec3::ZERO {
                r.degenerate += 1;
            } else if self.bounds(prim as u32).is_empty() {
                r.non_finite += 1;
            }
        }
        r
    }

    #[inline]
    fn cylinder(&self, prim: usize) -> Cylinder {
        let (i, j) = (2 * prim, 2 * prim + 1);
        let a = self.points[i].as_dvec3();
        Cylinder {
            a,
            v: self.points[j].as_dvec3() - a,
            ra: f64::from(self.radii.get(i)),
            rb: f64::from(self.radii.get(j)),
        }
    }

    /// The ends of the ray's interval in the solid that lie on a surface; an open end is `None`.
    #[inline]
    fn ends(&self, c: &Cylinder, ray: &Ray) -> [Option<End>; 2] {
        match c.frustum().interval(ray.origin.as_dvec3() - c.a, ray.dir.as_dvec3()) {
            Some(ends) => ends.map(|e| (self.capped || !e.on_plane).then_some(e)),
            None => [None; 2],
        }
    }
}

struct Cylinder {
    a: DVec3,
    v: DVec3,
    ra: f64,
    rb: f64,
}

impl Cylinder {
    #[inline]
    fn frustum(&self) -> Frustum {
        let vv = self.v.length_squared();
        let k = 1.0 / vv.sqrt();
        // ρ = r_a + (r_b − r_a) z/vv, times |v|.
        Frustum { v: self.v, z0: 0.0, z1: vv, w_a: self.ra * vv * k, w_z: (self.rb - self.ra) * k }
    }
}

impl Shape for Cylinders {
    fn part(&self, primitives: &[u32]) -> Option<Arc<dyn Shape>> {
        let count = self.points.len() / 2;
        let ends = || {
            let numbers = primitives.iter().map(|&p| p as usize).filter(move |&p| p < count);
            numbers.flat_map(|p| [2 * p, 2 * p + 1])
        };
        Some(Arc::new(Cylinders {
            origin: self.origin,
            points: picked(&self.points, ends()),
            radii: self.radii.part(ends()),
            capped: self.capped,
            scalars: self.scalars.as_ref().map(|s| picked(s, ends())),
            colors: self.colors.as_ref().map(|c| picked(c, ends())),
        }))
    }

    fn num_primitives(&self) -> usize {
        self.points.len() / 2
    }

    fn origin(&self) -> DVec3 {
        self.origin
    }

    fn bounds(&self, prim: u32) -> Aabb {
        let c = self.cylinder(prim as usize);
        let usable = c.ra >= 0.0 && c.rb >= 0.0 && c.ra.max(c.rb) > 0.0 && c.v != DVec3::ZERO;
        if !usable {
            return Aabb::EMPTY;
        }
        // A disc of radius r perpendicular to the unit vector e reaches r·√(1 − e_i²) along axis i.
        // The form as a sum does not cancel near 1.
        let e2 = (c.v / c.v.length()).powf(2.0);
        let disc = DVec3::new(e2.y + e2.z, e2.x + e2.z, e2.x + e2.y).map(f64::sqrt);
        let b = c.a + c.v;
        let slack = 4.0 * f64::EPSILON * (c.a.abs() + c.v.abs());
        outward_box(
            (c.a - c.ra * disc).min(b - c.rb * disc) - slack,
            (c.a + c.ra * disc).max(b + c.rb * disc) + slack,
        )
    }

    #[inline]
    fn closest(&self, prim: u32, ray: &Ray) -> Option<ShapeHit> {
        let c = self.cylinder(prim as usize);
        let end = self.ends(&c, ray).into_iter().flatten().find(|e| in_range(e.t as f32, ray))?;
        let p = ray.origin.as_dvec3() - c.a + ray.dir.as_dvec3() * end.t;
        let u = (p.dot(c.v) / c.v.length_squared()).clamp(0.0, 1.0);
        Some(ShapeHit { t: end.t as f32, u: u as f32, v: f32::from(end.on_plane) })
    }

    fn has_transparency(&self) -> bool {
        any_alpha(&self.colors)
    }

    fn surface(&self, prim: u32, hit: &ShapeHit, ray: &Ray) -> ShapeSurface {
        let c = self.cylinder(prim as usize);
        let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
        let off = |e: &End| (e.t - f64::from(hit.t)).abs();
        let end = self.ends(&c, ray).into_iter().flatten().min_by(|x, y| off(x).total_cmp(&off(y)));
        let end = end.unwrap_or(End { t: f64::from(hit.t), on_plane: hit.v == 1.0 });
        let length = c.v.length();
        let e = c.v / length;
        let q = o + d * end.t - c.a;
        let z = q.dot(e);
        let radial = q - z * e;
        let radial = radial - radial.dot(e) * e;
        let rho = radial.length();
        let outward = if rho > 0.0 { radial / rho } else { e.any_orthonormal_vector() };
        let (on_surface, normal) = if end.on_plane {
            let start = z < 0.5 * length;
            let plane = if start { c.a } else { c.a + c.v };
            (plane + radial, if start { -e } else { e })
        } else {
            let slope = (c.ra - c.rb) / length;
            let z = z.clamp(0.0, length);
            (c.a + z * e + (c.ra - slope * z) * outward, (outward + slope * e).normalize())
        };
        let (point, point_error) =
            rounded_point(on_surface, 8.0 * f64::EPSILON * (length + c.ra.max(c.rb)));
        let w = (z / length).clamp(0.0, 1.0) as f32;
        let (i, j) = (2 * prim as usize, 2 * prim as usize + 1);
        let mix = |a: f32, b: f32| a + (b - a) * w;
        ShapeSurface {
            point,
            point_error,
            normal: normal.as_vec3(),
            shading_normal: None,
            scalar: self.scalars.as_ref().map(|s| mix(s[i], s[j])),
            color: self.colors.as_ref().map(|k| std::array::from_fn(|n| mix(k[i][n], k[j][n]))),
        }
    }
}
