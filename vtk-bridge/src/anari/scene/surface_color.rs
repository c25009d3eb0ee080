//! The colour of a surface at a hit, for cases that the renderer's meshes cannot represent: shapes,
//! blocks of texels, thresholds and products.

use super::attribute::{HitPoint, Source, Topology};
use super::sampler::Sampler;
use rt_core::glam::{DAffine3, DVec3, Vec3};
use rt_core::math::Aabb;
use rt_core::mesh::{PerElement, TriMesh};
use rt_core::ray::Ray;
use rt_core::shapes::{Shape, ShapeHit, ShapeSurface};
use std::sync::Arc;

/// An input of a material.
#[derive(Clone)]
pub(crate) enum Input {
    Constant([f32; 4]),
    Attribute(Source),
    Sampler(Sampler),
}

impl Input {
    pub(crate) fn at(&self, p: &HitPoint<'_>) -> [f32; 4] {
        match self {
            Input::Constant(v) => *v,
            Input::Attribute(source) => source.at(p),
            Input::Sampler(sampler) => sampler.at(p),
        }
    }
}

/// How alpha is interpreted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum AlphaMode {
    Opaque,
    Blend,
    Mask { cutoff: f32 },
}

/// Colour and opacity of a material.
#[derive(Clone)]
pub(crate) struct SurfaceColor {
    pub(crate) color: Input,
    pub(crate) opacity: Input,
    pub(crate) mode: AlphaMode,
}

impl SurfaceColor {
    pub(crate) fn at(&self, p: &HitPoint<'_>) -> [f32; 4] {
        let color = self.color.at(p);
        self.finish(color, || self.opacity.at(p)[0])
    }

    pub(crate) fn finish(&self, color: [f32; 4], opacity: impl FnOnce() -> f32) -> [f32; 4] {
        let [r, g, b, a] = color;
        let alpha = match self.mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Blend => (a * opacity()).clamp(0.0, 1.0),
            AlphaMode::Mask { cutoff } => {
                if a * opacity() < cutoff {
                    0.0
                } else {
                    1.0
                }
            }
        };
        // NaN from a program's array would spread over whole pixels.
        [r, g, b, alpha].map(|v| if v.is_finite() { v.max(0.0) } else { 0.0 })
    }
}

/// How hits on a shape map to vertices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Weights {
    /// The first vertex alone.
    First,
    /// `u` interpolates from the first to the second vertex.
    Along,
    /// `u` and `v` are the weights of the second and third vertex.
    Corners,
}

impl Weights {
    /// Weights of the vertices at a hit with the parameters `u` and `v`.
    pub(crate) fn of(self, [u, v]: [f32; 2]) -> [f32; 3] {
        match self {
            Weights::First => [1.0, 0.0, 0.0],
            Weights::Along => [1.0 - u, u, 0.0],
            Weights::Corners => [1.0 - u - v, u, v],
        }
    }
}

/// A shape whose colour is computed at each hit.
pub(crate) struct ColoredShape {
    pub(crate) shape: Arc<dyn Shape>,
    pub(crate) weights: Weights,
    pub(crate) topology: Arc<Topology>,
    pub(crate) surface_color: SurfaceColor,
    pub(crate) world_from_object: DAffine3,
}

impl Shape for ColoredShape {
    fn num_primitives(&self) -> usize {
        self.shape.num_primitives()
    }

    fn origin(&self) -> DVec3 {
        self.shape.origin()
    }

    fn bounds(&self, prim: u32) -> Aabb {
        self.shape.bounds(prim)
    }

    fn closest(&self, prim: u32, ray: &Ray) -> Option<ShapeHit> {
        self.shape.closest(prim, ray)
    }

    fn occluded(&self, prim: u32, ray: &Ray) -> bool {
        self.shape.occluded(prim, ray)
    }

    fn surface(&self, prim: u32, hit: &ShapeHit, ray: &Ray) -> ShapeSurface {
        let surface = self.shape.surface(prim, hit, ray);
        // Samplers and attributes see the smooth normal, as they do on meshes.
        let normal = surface.shading_normal.and_then(Vec3::try_normalize).unwrap_or(surface.normal);
        let weights = self.weights.of([hit.u, hit.v]);
        let place = HitPoint {
            topology: &self.topology,
            primitive: prim,
            weights,
            point: self.shape.origin() + surface.point.as_dvec3(),
            normal: normal.as_dvec3(),
            world_from_object: &self.world_from_object,
        };
        ShapeSurface { color: Some(self.surface_color.at(&place)), ..surface }
    }

    fn has_transparency(&self) -> bool {
        self.surface_color.mode != AlphaMode::Opaque
    }

    fn tree_of(&self) -> Option<Arc<dyn Shape>> {
        Some(self.shape.clone())
    }
}

/// Triangles as a shape, for surface colours that meshes cannot represent.
pub(crate) struct TriangleShape(pub(crate) Arc<TriMesh>);

impl TriangleShape {
    fn corners(&self, prim: u32) -> Option<[Vec3; 3]> {
        let [a, b, c] = *self.0.indices.get(prim as usize)?;
        let p = |i: u32| self.0.positions.get(i as usize).copied();
        Some([p(a)?, p(b)?, p(c)?])
    }

    /// Returns the distance and the weights of the second and third corner, in f64 from f32 input.
    /// The products of the edge functions are exact to 2⁻⁵³, so neighbours along an edge agree for
    /// all but the rarest rays.
    fn meet(&self, prim: u32, ray: &Ray) -> Option<(f64, f64, f64)> {
        let o = ray.origin.as_dvec3();
        let [a, b, c] = self.corners(prim)?.map(|p| p.as_dvec3() - o);
        let d = ray.dir.as_dvec3();
        // Signed volumes against the ray: all three have the same sign if the ray passes between
        // the edges (Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", 2013, section
        // 3, without the shear).
        let (u, v, w) = (d.dot(c.cross(b)), d.dot(a.cross(c)), d.dot(b.cross(a)));
        let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
        let sum = u + v + w;
        if !inside || sum == 0.0 || !sum.is_finite() {
            return None;
        }
        let normal = (b - a).cross(c - a);
        let t = a.dot(normal) / d.dot(normal);
        t.is_finite().then_some((t, v / sum, w / sum))
    }
}

impl Shape for TriangleShape {
    fn num_primitives(&self) -> usize {
        self.0.indices.len()
    }

    fn origin(&self) -> DVec3 {
        self.0.origin
    }

    fn bounds(&self, prim: u32) -> Aabb {
        let Some(corners) = self.corners(prim) else { return Aabb::EMPTY };
        if corners.iter().any(|p| !p.is_finite()) {
            return Aabb::EMPTY;
        }
        // Expanded by one floating-point step, because a ray may hit a triangle that is flat along
        // an axis with a rounding error.
        let b = Aabb::from_points(&corners);
        let (down, up) = (|v: f32| v.next_down(), |v: f32| v.next_up());
        Aabb::new(
            Vec3::new(down(b.min.x), down(b.min.y), down(b.min.z)),
            Vec3::new(up(b.max.x), up(b.max.y), up(b.max.z)),
        )
    }

    fn closest(&self, prim: u32, ray: &Ray) -> Option<ShapeHit> {
        let (t, u, v) = self.meet(prim, ray)?;
        let t = t as f32;
        (t >= ray.t_min && t < ray.t_max).then_some(ShapeHit { t, u: u as f32, v: v as f32 })
    }

    fn surface(&self, prim: u32, hit: &ShapeHit, ray: &Ray) -> ShapeSurface {
        let (u, v) =
            self.meet(prim, ray).map_or((f64::from(hit.u), f64::from(hit.v)), |(_, u, v)| (u, v));
        let corners = self.corners(prim).unwrap_or_default();
        let [a, b, c] = corners.map(|p| p.as_dvec3());
        let point = a * (1.0 - u - v) + b * u + c * v;
        let flat = (b - a).cross(c - a).normalize_or(-ray.dir.as_dvec3().normalize());
        let vertex_normals = self.0.normals.as_ref().filter(|n| n.per == PerElement::Vertex);
        let shading = vertex_normals.map(|n| {
            let id = self.0.indices[prim as usize];
            let at = |k: usize| n.values[id[k] as usize].as_dvec3();
            let mixed = at(0) * (1.0 - u - v) + at(1) * u + at(2) * v;
            // On the side of the flat one, which decides what is outside.
            if mixed.dot(flat) < 0.0 { -mixed } else { mixed }
        });
        let size = corners.iter().fold(0f64, |m, p| m.max(f64::from(p.abs().max_element())));
        let rounded = point.as_vec3();
        // Half an ulp of each coordinate plus a few roundings of the weights in f64.
        let point_error = (1.8 * 2f64.powi(-24) * size + f64::from(f32::MIN_POSITIVE)) as f32;
        ShapeSurface {
            point: rounded,
            point_error,
            normal: flat.as_vec3(),
            shading_normal: shading.map(|n| n.as_vec3()),
            scalar: None,
            color: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::mesh::Attribute;

    #[test]
    fn triangles_with_smooth_normals_keep_the_normal_of_the_triangle_for_rays() {
        // Rays that start along a smooth normal would start on the wrong side of the triangle.
        let smooth = Vec3::new(0.8, 0.0, -0.6);
        let mut mesh = TriMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
        mesh.normals = Some(Attribute { per: PerElement::Vertex, values: vec![smooth; 3] });
        let shape = TriangleShape(Arc::new(mesh));
        let ray = Ray::new(Vec3::new(0.25, 0.25, -2.0), Vec3::Z);
        let hit = shape.closest(0, &ray).expect("a hit");
        let surface = shape.surface(0, &hit, &ray);
        assert_eq!(surface.normal, Vec3::Z);
        let shading = surface.shading_normal.expect("the mesh has normals");
        assert!((shading + smooth).length() < 1e-6, "{shading} is on the outside");
    }
}
