//! Spheres: particles, glyphs, atoms.
//!
//! The quadratic is solved in f64 from f32 input. The discriminant is r²·d² − |d × oc|², which does
//! not subtract two large squares (Haines, Günther and Akenine-Möller, "Precision Improvements for
//! Ray/Sphere Intersection", Ray Tracing Gems ch. 7, eq. 5, which goes back to Hearn and Baker).
//! The second root follows from the product of the roots. Products of f32 coordinates are exact in
//! f64, so a sphere a million radii away is hit to 10⁻¹⁰ of its radius.

use super::error::{check_count, check_length};
use super::{
    Radii, Shape, ShapeError, ShapeHit, ShapeReport, ShapeSurface, any_alpha, in_range,
    outward_box, picked, rounded_point,
};
use crate::math::Aabb;
use crate::ray::Ray;
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// Many spheres. A ray that starts inside a sphere hits its far side. `u` and `v` of a hit are 0.
#[derive(Debug, Clone)]
pub struct Spheres {
    origin: DVec3,
    centers: Vec<Vec3>,
    radii: Radii,
    scalars: Option<Vec<f32>>,
    colors: Option<Vec<[f32; 4]>>,
}

impl Spheres {
    /// Spheres around `centers`, which are relative to the origin (zero unless
    /// [`Spheres::with_origin`] moves it).
    pub fn new(centers: Vec<Vec3>, radii: Radii) -> Result<Self, ShapeError> {
        check_count("spheres", centers.len())?;
        radii.check("spheres", "sphere", centers.len())?;
        Ok(Spheres { origin: DVec3::ZERO, centers, radii, scalars: None, colors: None })
    }

    /// Spheres around f64 world positions, stored relative to their middle: see
    /// [`super::relative_positions`].
    pub fn from_f64_centers(centers: &[DVec3], radii: Radii) -> Result<Self, ShapeError> {
        let (origin, centers) = super::relative_positions(centers);
        Ok(Spheres::new(centers, radii)?.with_origin(origin))
    }

    /// Puts the coordinate origin of the centres at a world position.
    pub fn with_origin(self, origin: DVec3) -> Self {
        Spheres { origin, ..self }
    }

    /// One scalar per sphere, for the material's colour map.
    pub fn with_scalars(self, scalars: Vec<f32>) -> Result<Self, ShapeError> {
        check_length("spheres", "scalars", "sphere", self.centers.len(), scalars.len())?;
        Ok(Spheres { scalars: Some(scalars), ..self })
    }

    /// One linear RGBA colour per sphere.
    pub fn with_colors(self, colors: Vec<[f32; 4]>) -> Result<Self, ShapeError> {
        check_length("spheres", "colors", "sphere", self.centers.len(), colors.len())?;
        Ok(Spheres { colors: Some(colors), ..self })
    }

    /// Counts the spheres that cannot be rendered.
    pub fn report(&self) -> ShapeReport {
        let mut r = ShapeReport { primitives: self.centers.len(), ..Default::default() };
        for (i, c) in self.centers.iter().enumerate() {
            let radius = self.radii.get(i);
            if !(c.is_finite() && radius.is_finite()) {
                r.non_finite += 1;
            } else if radius <= 0.0 {
                r.no_radius += 1;
            } else if self.bounds(i as u32).is_empty() {
                r.non_finite += 1;
            }
        }
        r
    }

    /// Both roots in f64, the nearer first.
    #[inline]
    fn roots(&self, prim: u32, ray: &Ray) -> Option<(f64, f64)> {
        let d = ray.dir.as_dvec3();
        let oc = self.centers[prim as usize].as_dvec3() - ray.origin.as_dvec3();
        ray_sphere(oc, d, d.length_squared(), f64::from(self.radii.get(prim as usize)))
    }
}

impl Shape for Spheres {
    fn num_primitives(&self) -> usize {
        self.centers.len()
    }

    fn origin(&self) -> DVec3 {
        self.origin
    }

    fn bounds(&self, prim: u32) -> Aabb {
        let (c, r) = (self.centers[prim as usize].as_dvec3(), self.radii.get(prim as usize));
        if r > 0.0 { outward_box(c - f64::from(r), c + f64::from(r)) } else { Aabb::EMPTY }
    }

    #[inline]
    fn closest(&self, prim: u32, ray: &Ray) -> Option<ShapeHit> {
        let (near, far) = self.roots(prim, ray)?;
        let (near, far) = (near as f32, far as f32);
        let t = if in_range(near, ray) { near } else { far };
        in_range(t, ray).then_some(ShapeHit { t, u: 0.0, v: 0.0 })
    }

    fn has_transparency(&self) -> bool {
        any_alpha(&self.colors)
    }

    fn part(&self, primitives: &[u32]) -> Option<Arc<dyn Shape>> {
        let numbers = || primitives.iter().map(|&p| p as usize).filter(|&p| p < self.centers.len());
        Some(Arc::new(Spheres {
            origin: self.origin,
            centers: picked(&self.centers, numbers()),
            radii: self.radii.part(numbers()),
            scalars: self.scalars.as_ref().map(|s| picked(s, numbers())),
            colors: self.colors.as_ref().map(|c| picked(c, numbers())),
        }))
    }

    fn surface(&self, prim: u32, hit: &ShapeHit, ray: &Ray) -> ShapeSurface {
        let i = prim as usize;
        let (o, d, t) = (ray.origin.as_dvec3(), ray.dir.as_dvec3(), f64::from(hit.t));
        let (center, radius) = (self.centers[i].as_dvec3(), f64::from(self.radii.get(i)));
        // Solves for the root in f64 again: the rounding of `hit.t` would tilt the normal of a
        // small sphere far away.
        let t = match self.roots(prim, ray) {
            Some((near, far)) => {
                if (near - t).abs() <= (far - t).abs() {
                    near
                } else {
                    far
                }
            }
            None => t,
        };
        let normal = (o + d * t - center).normalize_or(-d.normalize());
        let (point, point_error) =
            rounded_point(center + radius * normal, 4.0 * f64::EPSILON * radius);
        ShapeSurface {
            point,
            point_error,
            normal: normal.as_vec3(),
            shading_normal: None,
            scalar: self.scalars.as_ref().map(|s| s[i]),
            color: self.colors.as_ref().map(|c| c[i]),
        }
    }
}

/// Parameters at which the line `t·d` intersects the sphere of radius `r` around `oc`, the nearer
/// first. `dd` is d·d.
#[inline]
pub(super) fn ray_sphere(oc: DVec3, d: DVec3, dd: f64, r: f64) -> Option<(f64, f64)> {
    // The squared distance of centre and line is |d × oc|²/d², so no square of the distance
    // travelled is subtracted.
    let discriminant = r * r * dd - d.cross(oc).length_squared();
    if discriminant.is_nan() || discriminant < 0.0 {
        return None;
    }
    let b = d.dot(oc);
    let q = b + discriminant.sqrt().copysign(b);
    if q == 0.0 {
        return Some((0.0, 0.0)); // starts on the sphere, tangent to it
    }
    let (large, small) = (q / dd, (oc.length_squared() - r * r) / q);
    Some(if b >= 0.0 { (small, large) } else { (large, small) })
}
