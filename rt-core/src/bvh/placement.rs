//! Transforms rays from render space to a geometry's local space, and hits back.

use super::layout::local_frame::LocalFrame;
use super::layout::wide::{ChildRef, Unit};
use super::turned_bounds::around_turned;
use crate::bvh::traverse::packet::PacketLimits;
use crate::math::{Aabb, max_abs};
use crate::ray::{LANES, Ray, RayBlock};
use fearless_simd::{Simd, SimdBase, SimdMask, f32x16};
use glam::{DAffine3, DMat3, DVec3, Vec3};

/// Largest components of directions that are traced without scaling.
pub(super) const ORDINARY_LENGTHS: std::ops::RangeInclusive<f32> = 1e-4..=1e4;

/// The origin of a ray more than this many radii from the geometry is first moved along the ray in
/// f64: at that distance, f32 coordinates relative to the geometry would be coarser than 4·10⁻⁶ of
/// its size.
const FAR_RADII: f64 = 64.0;

/// The transform into one instance's local space.
///
/// The leaves of the upper level hold copies: what a ray needs to enter an instance lies beside the
/// boxes that it has just passed. (Measured: rays among 20,000 instances waited an eighth of their
/// time for a placement in an array of its own.)
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Placement {
    /// Number of the entry in the upper level, set in its leaf. It comes first: there, it is the
    /// leaf's only primitive.
    number: u32,
    /// Index of the geometry.
    geometry: u32,
    /// 1 when local and render space are the same.
    identity: u32,
    /// The distance from the centre within which an origin is near, in f32 with a margin that
    /// covers its rounding.
    near_f32: f32,
    center_f32: Vec3,
    unused: [u32; 3],
    /// Sphere around the local bounds.
    radius: f64,
    center: DVec3,
    local_from_render: DAffine3,
    /// Bounds in render space: smallest and largest corner.
    bounds: [Vec3; 2],
}

/// Units of a placement in a leaf.
pub(super) const PLACEMENT_UNITS: usize = size_of::<Placement>() / size_of::<Unit>();

impl Placement {
    /// `world_origin` is the world position of render space's origin. `reach` are the local bounds
    /// of the whole geometry, `local_bounds` those of the primitives held here. `None` when the
    /// transform cannot be inverted.
    pub(crate) fn new(
        geometry: usize,
        world_from_object: &DAffine3,
        frame: &LocalFrame,
        [reach, local_bounds]: [Aabb; 2],
        world_origin: DVec3,
    ) -> Option<Placement> {
        let inverse = world_from_object.inverse();
        let det = world_from_object.matrix3.determinant();
        if !(det.is_finite() && det != 0.0 && inverse.is_finite() && world_from_object.is_finite())
        {
            return None;
        }
        // local = (inverse(render + world_origin) − center) · scale
        let local_from_render = DAffine3 {
            matrix3: inverse.matrix3 * frame.scale,
            translation: (inverse.transform_point3(world_origin) - frame.center) * frame.scale,
        };
        let identity = local_from_render.matrix3 == DMat3::IDENTITY
            && local_from_render.translation == DVec3::ZERO;
        let (center, radius) = if reach.is_empty() {
            (DVec3::ZERO, 0.0)
        } else {
            let (lo, hi) = (reach.min.as_dvec3(), reach.max.as_dvec3());
            (0.5 * (lo + hi), 0.5 * (hi - lo).length())
        };
        let bounds = if identity || local_bounds.is_empty() {
            local_bounds
        } else {
            let render_from_local = |p: Vec3| {
                let object = p.as_dvec3() / frame.scale + frame.center;
                world_from_object.transform_point3(object) - world_origin
            };
            let margin = margin(world_from_object, frame, radius);
            let mut b = Aabb::EMPTY;
            for c in local_bounds.corners() {
                let p = render_from_local(c);
                b = b.union(Aabb::new(round_down(p - margin), round_up(p + margin)));
            }
            b
        };
        let (center_f32, near_f32) = (center.as_vec3(), (0.99 * FAR_RADII * radius) as f32);
        Some(Placement {
            number: 0,
            geometry: geometry as u32,
            identity: u32::from(identity),
            near_f32,
            center_f32,
            unused: [0; 3],
            radius,
            center,
            local_from_render,
            bounds: [bounds.min, bounds.max],
        })
    }

    /// Bounds in render space that are close to the boxes of `outline`, in local space, and not
    /// only to the box around them; all that is held here lies in one of these. The other arguments
    /// are those of [`Placement::new`].
    pub(super) fn tighten(
        &mut self,
        outline: &[Aabb],
        world_from_object: &DAffine3,
        frame: &LocalFrame,
        world_origin: DVec3,
    ) {
        let render_from_local = DAffine3 {
            matrix3: world_from_object.matrix3 * (1.0 / frame.scale),
            translation: world_from_object.transform_point3(frame.center) - world_origin,
        };
        let (lo, hi) = around_turned(outline, &render_from_local);
        let margin = margin(world_from_object, frame, self.radius);
        let [min, max] = &mut self.bounds;
        *min = min.max(round_down(lo - margin));
        *max = max.min(round_up(hi + margin));
    }

    /// Writes the placement of entry `number` into a leaf of the upper level.
    pub(super) fn write(&self, number: u32, leaf: &mut [Unit]) {
        let placed: &mut [Placement] = bytemuck::cast_slice_mut(leaf);
        placed[0] = Placement { number, ..*self };
    }

    /// The placement in a leaf of the upper level, and the number of its entry.
    #[inline(always)]
    pub(super) fn of_leaf(units: &[Unit], leaf: ChildRef) -> (&Placement, u32) {
        let at = leaf.unit();
        let placed: &[Placement] = bytemuck::cast_slice(&units[at..at + PLACEMENT_UNITS]);
        (&placed[0], placed[0].number)
    }

    /// Index of the geometry.
    #[inline]
    pub(super) fn geometry(&self) -> usize {
        self.geometry as usize
    }

    /// Bounds in render space.
    pub(super) fn bounds(&self) -> Aabb {
        Aabb::new(self.bounds[0], self.bounds[1])
    }

    /// The transform from render space to local space.
    pub(crate) fn local_from_render(&self) -> DAffine3 {
        self.local_from_render
    }

    #[inline(always)]
    fn is_identity(&self) -> bool {
        self.identity != 0
    }

    /// True when this ray needs no transformation.
    #[inline]
    pub(crate) fn accepts(&self, ray: &Ray) -> bool {
        self.is_identity() && max_abs(ray.origin - self.center_f32) <= self.near_f32
    }

    /// The rays that need no transformation and no rescaling; `None` when all do.
    pub(crate) fn limits(&self) -> Option<PacketLimits> {
        let length = (*ORDINARY_LENGTHS.start(), *ORDINARY_LENGTHS.end());
        self.is_identity().then(|| PacketLimits {
            length,
            center: self.center_f32.to_array(),
            reach: self.near_f32,
        })
    }

    /// True when these rays need no transformation: local and render space agree and no origin is
    /// far away.
    #[inline(never)]
    pub(crate) fn accepts_blocks<S: Simd>(&self, simd: S, rays: &[RayBlock]) -> bool {
        if !self.is_identity() {
            return false;
        }
        simd.vectorize(
            #[inline(always)]
            || {
                let limit = f32x16::splat(simd, self.near_f32);
                let mut largest = f32x16::splat(simd, 0.0);
                for r in rays {
                    for (row, c) in [
                        (&r.ox, self.center_f32.x),
                        (&r.oy, self.center_f32.y),
                        (&r.oz, self.center_f32.z),
                    ] {
                        largest = largest
                            .max((f32x16::from_slice(simd, row) - f32x16::splat(simd, c)).abs());
                    }
                }
                largest.simd_le(limit).all_true()
            },
        )
    }

    /// Writes `ray`, limited to `t_max`, to `local` in local space. Returns how far along it its
    /// origin was moved (in units of its direction: `t` is the same in both spaces).
    ///
    /// Each number is written once and by itself. Copies of whole rays read what was just written
    /// in other pieces, and the processor waits for that: a quarter of the time of rays that enter
    /// many instances.
    #[inline(always)]
    pub(crate) fn enter(&self, ray: &Ray, t_max: f32, local: &mut Ray) -> f64 {
        local.t_min = ray.t_min;
        local.t_max = t_max;
        if self.accepts(ray) {
            local.origin = ray.origin;
            local.dir = ray.dir;
            return 0.0;
        }
        let o = self.local_from_render.transform_point3(ray.origin.as_dvec3());
        let d = self.local_from_render.transform_vector3(ray.dir.as_dvec3());
        local.origin = o.as_vec3();
        local.dir = d.as_vec3();
        if (o - self.center).abs().max_element() <= FAR_RADII * self.radius {
            return 0.0;
        }
        self.move_closer(o, d, local)
    }

    /// Moves a ray with the local origin `o` and direction `d` from afar to the geometry.
    #[cold]
    #[inline(never)]
    fn move_closer(&self, o: DVec3, d: DVec3, local: &mut Ray) -> f64 {
        let moved = distance_to_sphere(o, d, self.center, self.radius);
        if moved != 0.0 {
            local.origin = (o + d * moved).as_vec3();
            // A moved ray starts before the geometry, so that no part of it is lost when t_min is
            // negative after the move.
            local.t_min = moved_limit(local.t_min, moved).max(0.0);
            local.t_max = moved_limit(local.t_max, moved);
        }
        moved
    }

    /// [`Placement::enter`] for the rays in `lanes` of a block, each up to its `t_max`: the same
    /// bits. Writes the rays to `local`, where other lanes become inactive, and how far they were
    /// moved to `moved`. Returns the lanes that can hit something.
    #[inline(always)]
    pub(crate) fn enter_block(
        &self,
        rays: &RayBlock,
        lanes: u16,
        t_max: &[f32; LANES],
        local: &mut RayBlock,
        moved: &mut [f64; LANES],
    ) -> u16 {
        let mut far = [false; LANES];
        if self.is_identity() {
            *local = *rays;
            for lane in 0..LANES {
                let origin = Vec3::new(rays.ox[lane], rays.oy[lane], rays.oz[lane]);
                far[lane] = max_abs(origin - self.center_f32) > self.near_f32;
            }
        } else {
            // Row by row, in the order of operations of `DAffine3`.
            let DAffine3 { matrix3: m, translation: t } = self.local_from_render;
            let (c, reach) = (self.center, FAR_RADII * self.radius);
            for lane in 0..LANES {
                let o = [rays.ox[lane], rays.oy[lane], rays.oz[lane]].map(f64::from);
                let d = [rays.dx[lane], rays.dy[lane], rays.dz[lane]].map(f64::from);
                let x = m.x_axis.x * o[0] + m.y_axis.x * o[1] + m.z_axis.x * o[2] + t.x;
                let y = m.x_axis.y * o[0] + m.y_axis.y * o[1] + m.z_axis.y * o[2] + t.y;
                let z = m.x_axis.z * o[0] + m.y_axis.z * o[1] + m.z_axis.z * o[2] + t.z;
                let away = (x - c.x).abs().max((y - c.y).abs()).max((z - c.z).abs());
                far[lane] = away > reach;
                (local.ox[lane], local.oy[lane], local.oz[lane]) = (x as f32, y as f32, z as f32);
                local.dx[lane] = (m.x_axis.x * d[0] + m.y_axis.x * d[1] + m.z_axis.x * d[2]) as f32;
                local.dy[lane] = (m.x_axis.y * d[0] + m.y_axis.y * d[1] + m.z_axis.y * d[2]) as f32;
                local.dz[lane] = (m.x_axis.z * d[0] + m.y_axis.z * d[1] + m.z_axis.z * d[2]) as f32;
            }
        }
        let (mut inside, mut outside) = (0u16, 0u16);
        for lane in 0..LANES {
            let on = lanes >> lane & 1 == 1;
            local.t_min[lane] = if on { rays.t_min[lane] } else { 0.0 };
            local.t_max[lane] = if on { t_max[lane] } else { -1.0 };
            moved[lane] = 0.0;
            inside |= u16::from(local.t_max[lane] > local.t_min[lane]) << lane;
            outside |= u16::from(on & far[lane]) << lane;
        }
        // Origins far away are rare: one by one.
        while outside != 0 {
            let lane = outside.trailing_zeros() as usize & 15;
            outside &= outside - 1;
            let mut ray = Ray::UNSET;
            moved[lane] = self.enter(&rays.get(lane), t_max[lane], &mut ray);
            local.set(lane, &ray);
            inside &= !(1 << lane);
            inside |= u16::from(ray.t_max > ray.t_min) << lane;
        }
        inside
    }
}

/// How far rays may pass by what they hit, in render space: they and their directions are rounded
/// to f32 in local space, from up to 64 radii away in each axis. The error is at most 2⁻¹⁵ radii.
fn margin(world_from_object: &DAffine3, frame: &LocalFrame, radius: f64) -> DVec3 {
    let rows = world_from_object.matrix3.transpose();
    let stretch = DVec3::new(rows.x_axis.length(), rows.y_axis.length(), rows.z_axis.length());
    stretch / frame.scale * radius * (-15f64).exp2()
}

/// A limit on a moved ray: the x below it are those with `(x as f64 + moved) as f32 < t`, so that
/// the range is half-open in the numbers that callers see.
fn moved_limit(t: f32, moved: f64) -> f32 {
    if t == f32::INFINITY {
        return t;
    }
    // Sums below the midpoint between t and its predecessor round to less than t; 2⁻⁵¹ covers the
    // rounding of the sum in f64.
    let middle = 0.5 * (t as f64 + t.next_down() as f64);
    let x = middle - moved - middle.abs() * 2.0 * f64::EPSILON;
    let f = x as f32;
    if (f as f64) < x { f.next_up() } else { f }
}

/// The parameter just before the line enters the sphere, or of its closest approach when it misses;
/// at least 0.
pub(crate) fn distance_to_sphere(o: DVec3, d: DVec3, center: DVec3, radius: f64) -> f64 {
    let dd = d.length_squared();
    if dd == 0.0 {
        return 0.0;
    }
    let along = (center - o).dot(d) / dd;
    (along - 2.0 * radius / dd.sqrt()).max(0.0)
}

/// The largest f32 point not above `p` in any axis.
pub(crate) fn round_down(p: DVec3) -> Vec3 {
    let f = p.as_vec3();
    Vec3::from_array(std::array::from_fn(
        |a| if f[a] as f64 > p[a] { f[a].next_down() } else { f[a] },
    ))
}

/// The smallest f32 point not below `p` in any axis.
pub(crate) fn round_up(p: DVec3) -> Vec3 {
    let f = p.as_vec3();
    Vec3::from_array(std::array::from_fn(
        |a| if (f[a] as f64) < p[a] { f[a].next_up() } else { f[a] },
    ))
}
