//! The ray sets on which all tracers are timed.
//!
//! The rays are generated once, by a deterministic rule from one set of hits, and stored. Every
//! tracer gets the same bits in the same order. Rays are stored in blocks of 16 as a structure of
//! arrays. Pixels are in Morton order, so 16 primary rays cover 4 x 4 pixels and 256 cover 16 x 16.
//! Hit points are computed in f64 from the hit triangle, so secondary rays do not depend on the
//! tracer that found it.

use glam::{DVec3, Vec3};
use rt_core::math::Aabb;
pub use rt_core::ray::{HitBlock, LANES, NO_HIT, RayBlock};

/// One ray in f64, before it is rounded into a block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray64 {
    /// Origin.
    pub origin: DVec3,
    /// Direction.
    pub direction: DVec3,
    /// Maximum distance of a hit.
    pub t_max: f64,
}

/// A list of rays in blocks.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RaySet {
    /// Number of rays, without empty lanes.
    pub len: usize,
    /// The rays; only the last block has empty lanes.
    pub blocks: Vec<RayBlock>,
}

impl RaySet {
    /// Rounds rays to f32 and packs them. Empty lanes repeat a ray's numbers, with `t_max` -1.
    pub fn pack(rays: impl IntoIterator<Item = Ray64>) -> RaySet {
        let mut set = RaySet::default();
        for r in rays {
            let lane = set.len % LANES;
            let (o, d) = (r.origin.as_vec3(), r.direction.as_vec3());
            if lane == 0 {
                let s = |x: f32| [x; LANES];
                let (ox, oy, oz, dx, dy, dz) = (s(o.x), s(o.y), s(o.z), s(d.x), s(d.y), s(d.z));
                set.blocks.push(RayBlock { ox, oy, oz, dx, dy, dz, t_min: s(0.0), t_max: s(-1.0) });
            }
            let last = set.blocks.len() - 1;
            let b = &mut set.blocks[last];
            (b.ox[lane], b.oy[lane], b.oz[lane]) = (o.x, o.y, o.z);
            (b.dx[lane], b.dy[lane], b.dz[lane]) = (d.x, d.y, d.z);
            b.t_max[lane] = r.t_max as f32;
            set.len += 1;
        }
        set
    }

    /// About `limit` of the rays, spread evenly: every n-th run of 1024 rays is kept, so that
    /// neighbours stay together. All rays if there are fewer.
    pub fn thinned(self, limit: usize) -> RaySet {
        const RUN: usize = 64;
        let step = self.len.div_ceil(limit.max(1)).max(1);
        if step == 1 {
            return self;
        }
        let kept: Vec<RayBlock> =
            self.blocks.chunks(RUN).step_by(step).flatten().copied().collect();
        // The last block, which may have empty lanes, is left out unless its run is kept whole.
        let whole: Vec<RayBlock> = kept.into_iter().filter(|b| b.t_max[LANES - 1] >= 0.0).collect();
        RaySet { len: whole.len() * LANES, blocks: whole }
    }

    /// Origin and direction of ray `i` after rounding.
    pub fn ray(&self, i: usize) -> (Vec3, Vec3) {
        let (b, l) = (&self.blocks[i / LANES], i % LANES);
        (Vec3::new(b.ox[l], b.oy[l], b.oz[l]), Vec3::new(b.dx[l], b.dy[l], b.dz[l]))
    }
}

/// A square pinhole view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Name in the tables.
    pub name: &'static str,
    /// Eye, in the mesh's coordinates.
    pub eye: DVec3,
    /// Unit vectors: right, up, forward.
    pub axes: [DVec3; 3],
    /// Tangent of half the field of view.
    pub tan_half_fov: f64,
    /// Half the diagonal of the mesh's bounds: the unit of distances.
    pub radius: f64,
}

impl View {
    /// Everything in `bounds`, filling a field of view of 30 degrees.
    pub fn orbit(bounds: Aabb) -> View {
        let (center, radius) = center_and_radius(bounds);
        let distance = radius / (15f64.to_radians()).sin();
        View::looking(
            "orbit",
            center,
            DVec3::new(1.0, 0.7, 1.3).normalize() * distance,
            DVec3::ZERO,
            radius,
        )
    }

    /// Close to the surface, so that nearly every pixel shows it.
    pub fn close(bounds: Aabb) -> View {
        let (center, radius) = center_and_radius(bounds);
        let eye = DVec3::new(0.9, 0.5, 1.0).normalize() * radius * 1.15;
        View::looking("close", center, eye, DVec3::new(0.1, 0.12, 0.05) * radius, radius)
    }

    fn looking(name: &'static str, center: DVec3, eye: DVec3, target: DVec3, radius: f64) -> View {
        let forward = (target - eye).normalize();
        let right = forward.cross(DVec3::Y).normalize();
        let up = right.cross(forward);
        let tan_half_fov = 15f64.to_radians().tan();
        View { name, eye: center + eye, axes: [right, up, forward], tan_half_fov, radius }
    }

    /// Position of the point light: above the viewer's right shoulder.
    pub fn light(&self) -> DVec3 {
        self.eye + self.axes[0] * self.radius * 0.5 + self.axes[1] * self.radius * 0.7
    }

    /// One ray through the centre of each of `size` x `size` pixels, in Morton order. `size` is a
    /// power of two.
    pub fn primary(&self, size: u32) -> RaySet {
        assert!(
            size.is_power_of_two() && size <= 1 << 15,
            "Morton order needs a power of two, not {size}"
        );
        let [right, up, forward] = self.axes;
        RaySet::pack((0..size * size).map(|i| {
            let (x, y) = morton(i);
            let sx = ((f64::from(x) + 0.5) / f64::from(size) * 2.0 - 1.0) * self.tan_half_fov;
            let sy = (1.0 - (f64::from(y) + 0.5) / f64::from(size) * 2.0) * self.tan_half_fov;
            let direction = (forward + right * sx + up * sy).normalize();
            Ray64 { origin: self.eye, direction, t_max: f64::INFINITY }
        }))
    }
}

/// A point on the surface, in f64, with the geometric normal on the side the ray came from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// The point, moved off the surface by 2e-5 of the mesh's radius so that no tracer's own offset
    /// rule matters.
    pub origin: DVec3,
    /// Unit normal.
    pub normal: DVec3,
}

/// The points that rays hit, from the instances and triangle numbers that a tracer found, which
/// `corners` turns into triangles. Rays without a hit give no point.
pub fn surface_points(
    corners: impl Fn(u32, u32) -> [DVec3; 3],
    rays: &RaySet,
    hits: &[HitBlock],
    radius: f64,
) -> Vec<SurfacePoint> {
    let mut points = vec![];
    for i in 0..rays.len {
        let prim = hits[i / LANES].prim[i % LANES];
        if prim == NO_HIT {
            continue;
        }
        let (o, d) = rays.ray(i);
        let (o, d) = (o.as_dvec3(), d.as_dvec3());
        let [a, b, c] = corners(hits[i / LANES].instance[i % LANES], prim);
        let mut normal = (b - a).cross(c - a).normalize_or_zero();
        if normal == DVec3::ZERO {
            continue;
        }
        if normal.dot(d) > 0.0 {
            normal = -normal;
        }
        // Distance to the triangle's plane. Edge-on, where that is 0/0, the stored distance is
        // used.
        let (height, slope) = (normal.dot(a - o), normal.dot(d));
        let t = if slope.abs() > 1e-9 {
            height / slope
        } else {
            f64::from(hits[i / LANES].t[i % LANES])
        };
        points.push(SurfacePoint { origin: o + d * t + normal * (radius * 2e-5), normal });
    }
    points
}

/// One shadow ray per point, from the point to the light.
pub fn shadow(points: &[SurfacePoint], light: DVec3) -> RaySet {
    RaySet::pack(points.iter().map(|p| {
        let to_light = light - p.origin;
        let t_max = to_light.length();
        Ray64 { origin: p.origin, direction: to_light / t_max, t_max }
    }))
}

/// The same shadow rays from the light to the points: one common origin, which packets can use.
pub fn shadow_from_light(points: &[SurfacePoint], light: DVec3) -> RaySet {
    RaySet::pack(points.iter().map(|p| {
        let to_point = p.origin - light;
        let distance = to_point.length();
        // The ray ends just before the point, so that its own surface does not count.
        Ray64 { origin: light, direction: to_point / distance, t_max: distance * (1.0 - 1e-5) }
    }))
}

/// Eight cosine-weighted rays of unlimited length per point into the hemisphere above it,
/// stratified 4 x 2.
pub fn ambient_occlusion(points: &[SurfacePoint]) -> RaySet {
    RaySet::pack(points.iter().enumerate().flat_map(|(i, p)| {
        let (tx, ty) = p.normal.any_orthonormal_pair();
        let seed = hash(i as u32);
        let p = *p;
        (0..8u32).map(move |k| {
            let a = (f64::from(k & 3) + unit(seed ^ (2 * k + 1))) / 4.0;
            let b = (f64::from(k >> 2) + unit(seed ^ (2 * k + 2).wrapping_mul(0x9e37_79b9))) / 2.0;
            let (sin, cos) = (a * std::f64::consts::TAU).sin_cos();
            let direction = (tx * cos + ty * sin) * b.sqrt() + p.normal * (1.0 - b).sqrt();
            Ray64 { origin: p.origin, direction, t_max: f64::INFINITY }
        })
    }))
}

/// Incoherent rays: from random positions inside the mesh's bounds in random directions.
pub fn incoherent(bounds: Aabb, count: usize) -> RaySet {
    let (lo, hi) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    RaySet::pack((0..count as u32).map(|i| {
        let r = |k: u32| unit(hash(i).wrapping_add(k.wrapping_mul(0x9e37_79b9)));
        let origin = lo + (hi - lo) * DVec3::new(r(1), r(2), r(3));
        let z = 2.0 * r(4) - 1.0;
        let (sin, cos) = (r(5) * std::f64::consts::TAU).sin_cos();
        let s = (1.0 - z * z).sqrt();
        Ray64 { origin, direction: DVec3::new(s * cos, s * sin, z), t_max: f64::INFINITY }
    }))
}

fn center_and_radius(b: Aabb) -> (DVec3, f64) {
    let (lo, hi) = (b.min.as_dvec3(), b.max.as_dvec3());
    ((lo + hi) * 0.5, (hi - lo).length() * 0.5)
}

/// Even and odd bits of an index: x and y along a Z-order curve.
fn morton(i: u32) -> (u32, u32) {
    let even = |x: u32| {
        let x = x & 0x5555_5555;
        let x = (x | x >> 1) & 0x3333_3333;
        let x = (x | x >> 2) & 0x0f0f_0f0f;
        let x = (x | x >> 4) & 0x00ff_00ff;
        (x | x >> 8) & 0xffff
    };
    (even(i), even(i >> 1))
}

/// A 32-bit hash (Wellons, "Prospecting for hash functions", lowbias32).
fn hash(x: u32) -> u32 {
    let x = (x ^ x >> 16).wrapping_mul(0x7feb_352d);
    let x = (x ^ x >> 15).wrapping_mul(0x846c_a68b);
    x ^ x >> 16
}

/// A number in 0..1 from a seed.
fn unit(seed: u32) -> f64 {
    f64::from(hash(seed)) / 4_294_967_296.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::mesh::TriMesh;

    fn square() -> TriMesh {
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let positions = corners.map(|[x, y]| Vec3::new(x, y, 0.25 * x)).to_vec();
        TriMesh::new(positions, vec![[0, 1, 2], [0, 2, 3]])
    }

    #[test]
    fn sixteen_primary_rays_are_a_square_of_pixels() {
        let view = View::orbit(square().bounds());
        let rays = view.primary(32);
        assert_eq!((rays.len, rays.blocks.len()), (1024, 64));
        let pixel = |i: usize| {
            let d = rays.ray(i).1.as_dvec3();
            let [right, up, forward] = view.axes;
            let (x, y) = (d.dot(right) / d.dot(forward), d.dot(up) / d.dot(forward));
            let index = |s: f64| ((s / view.tan_half_fov + 1.0) * 16.0).floor() as i32;
            (index(x), index(-y))
        };
        let first: Vec<(i32, i32)> = (0..16).map(pixel).collect();
        assert!(first.iter().all(|p| (0..4).contains(&p.0) && (0..4).contains(&p.1)), "{first:?}");
        assert_eq!(pixel(1023), (31, 31));
    }

    #[test]
    fn empty_lanes_are_marked_and_not_counted() {
        let ray = Ray64 { origin: DVec3::X, direction: DVec3::Y, t_max: 5.0 };
        let set = RaySet::pack(vec![ray; 18]);
        assert_eq!((set.len, set.blocks.len()), (18, 2));
        assert_eq!(set.blocks[1].t_max[..3], [5.0, 5.0, -1.0]);
        assert_eq!(RaySet::pack(vec![]), RaySet::default());
    }

    #[test]
    fn thinning_keeps_neighbours_and_whole_blocks() {
        let ray = |i: usize| Ray64 { origin: DVec3::X * i as f64, direction: DVec3::Y, t_max: 1.0 };
        let set = RaySet::pack((0..10_000).map(ray));
        let thin = set.clone().thinned(3000);
        assert!(
            (2000..=4096).contains(&thin.len) && thin.len.is_multiple_of(LANES),
            "{}",
            thin.len
        );
        assert_eq!(thin.ray(1023).0.x, 1023.0);
        assert_eq!(thin.ray(1024).0.x, 4096.0);
        assert_eq!(set.clone().thinned(10_000), set);
    }

    #[test]
    fn secondary_rays_start_off_the_surface_on_the_side_of_the_viewer() {
        let mesh = square();
        let (origin, direction) = (DVec3::new(0.3, 0.2, 4.0), DVec3::NEG_Z);
        let rays = RaySet::pack([Ray64 { origin, direction, t_max: 9.0 }]);
        let mut hits = [HitBlock::MISS];
        hits[0].prim[0] = 0;
        let points = surface_points(
            |_, prim| mesh.triangle(prim as usize).map(|p| p.as_dvec3()),
            &rays,
            &hits,
            1.0,
        );
        let p = points[0];
        // The plane is z = x/4; the hit is at (0.3, 0.2, 0.075).
        let height = (p.origin.z - 0.25 * p.origin.x) / (1.0f64 + 0.0625).sqrt();
        assert!((height - 2e-5).abs() < 1e-9, "{height}");
        assert!(p.normal.z > 0.0 && (p.normal.length() - 1.0).abs() < 1e-12);
        let light = DVec3::new(0.0, 0.0, 10.0);
        let (o, d) = shadow(&points, light).ray(0);
        assert!((o + d * 10.0 - light.as_vec3()).length() < 0.2);
        let (o, d) = shadow_from_light(&points, light).ray(0);
        assert!(o == light.as_vec3() && d.z < 0.0);
        let ao = ambient_occlusion(&points);
        assert_eq!(ao.len, 8);
        assert!((0..8).all(|i| ao.ray(i).1.as_dvec3().dot(p.normal) > 0.0));
    }

    #[test]
    fn rays_are_the_same_every_time() {
        assert_eq!(incoherent(square().bounds(), 100), incoherent(square().bounds(), 100));
    }
}
