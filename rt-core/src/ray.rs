//! Rays, hits, and blocks of 16 of them.
//!
//! All coordinates here are in *render space*: world coordinates minus
//! [`crate::bvh::World::origin`], in f32.

use glam::Vec3;

/// The primitive id of a block lane without a hit.
pub const NO_HIT: u32 = u32::MAX;

/// Number of lanes of a [`RayBlock`].
pub const LANES: usize = 16;

/// A ray. Hits are reported for `t_min <= t < t_max`. `dir` need not have unit length; `t` is in
/// units of its length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Start point.
    pub origin: Vec3,
    /// Direction; any non-zero length, components may be ±0.
    pub dir: Vec3,
    /// Smallest parameter that counts as a hit (inclusive), at least 0.
    pub t_min: f32,
    /// Largest parameter (exclusive); infinity for no limit.
    pub t_max: f32,
}

impl Ray {
    /// A ray without a limit, starting at `origin`.
    pub fn new(origin: Vec3, dir: Vec3) -> Self {
        Ray { origin, dir, t_min: 0.0, t_max: f32::INFINITY }
    }

    /// The same ray limited to `t < t_max`.
    pub fn with_t_max(self, t_max: f32) -> Self {
        Ray { t_max, ..self }
    }

    /// The point at parameter `t`. The rounding of `t` moves it off the surface: to start a
    /// secondary ray, use the point and its error bound from the hit primitive instead.
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.dir * t
    }

    /// A ray whose numbers are written before it is traced. It meets nothing.
    pub(crate) const UNSET: Ray =
        Ray { origin: Vec3::ZERO, dir: Vec3::ZERO, t_min: 0.0, t_max: 0.0 };

    /// Whether the ray can hit anything: false for an empty range or NaN. Such rays are answered
    /// with "no hit" without traversal.
    #[inline]
    pub fn is_valid(&self) -> bool {
        self.origin.is_finite()
            && self.dir.is_finite()
            && self.dir != Vec3::ZERO
            && self.t_min < self.t_max
    }
}

/// The closest intersection of a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Ray parameter, in units of the ray's direction.
    pub t: f32,
    /// First surface coordinate: on triangles the weight of the second vertex.
    pub u: f32,
    /// Second surface coordinate: on triangles the weight of the third vertex.
    pub v: f32,
    /// Primitive within the geometry: the index into `TriMesh::indices`, a sphere, a tube segment,
    /// a cell.
    pub prim: u32,
    /// Index of the instance in the world.
    pub instance: u32,
}

/// Sixteen rays, one array per component (structure of arrays). A lane with `t_max < t_min` is
/// inactive.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
#[allow(missing_docs, reason = "the names are those of Ray")]
pub struct RayBlock {
    pub ox: [f32; LANES],
    pub oy: [f32; LANES],
    pub oz: [f32; LANES],
    pub dx: [f32; LANES],
    pub dy: [f32; LANES],
    pub dz: [f32; LANES],
    pub t_min: [f32; LANES],
    pub t_max: [f32; LANES],
}

impl RayBlock {
    /// All lanes inactive.
    pub const INACTIVE: RayBlock = RayBlock {
        ox: [0.0; LANES],
        oy: [0.0; LANES],
        oz: [0.0; LANES],
        dx: [0.0; LANES],
        dy: [0.0; LANES],
        dz: [1.0; LANES],
        t_min: [0.0; LANES],
        t_max: [-1.0; LANES],
    };

    /// Writes `ray` into lane `lane`.
    #[inline]
    pub fn set(&mut self, lane: usize, ray: &Ray) {
        [self.ox[lane], self.oy[lane], self.oz[lane]] = ray.origin.to_array();
        [self.dx[lane], self.dy[lane], self.dz[lane]] = ray.dir.to_array();
        self.t_min[lane] = ray.t_min;
        self.t_max[lane] = ray.t_max;
    }

    /// The lanes that hold a ray that can hit anything.
    #[inline]
    pub(crate) fn active_lanes(&self) -> u16 {
        (0..LANES).fold(0, |m, lane| m | (self.get(lane).is_valid() as u16) << lane)
    }

    /// The ray in lane `lane`.
    #[inline]
    pub fn get(&self, lane: usize) -> Ray {
        Ray {
            origin: Vec3::new(self.ox[lane], self.oy[lane], self.oz[lane]),
            dir: Vec3::new(self.dx[lane], self.dy[lane], self.dz[lane]),
            t_min: self.t_min[lane],
            t_max: self.t_max[lane],
        }
    }

    /// Packs rays into blocks in order. The last block is filled up with inactive lanes.
    pub fn from_rays(rays: &[Ray]) -> Vec<RayBlock> {
        rays.chunks(LANES)
            .map(|chunk| {
                let mut b = RayBlock::INACTIVE;
                for (lane, r) in chunk.iter().enumerate() {
                    b.set(lane, r);
                }
                b
            })
            .collect()
    }
}

/// The closest hits of a [`RayBlock`]. Lanes without a hit have `prim == NO_HIT` and `t` infinite.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
#[allow(missing_docs, reason = "the names are those of Hit")]
pub struct HitBlock {
    pub t: [f32; LANES],
    pub u: [f32; LANES],
    pub v: [f32; LANES],
    pub prim: [u32; LANES],
    pub instance: [u32; LANES],
}

impl HitBlock {
    /// A block without hits.
    pub const MISS: HitBlock = HitBlock {
        t: [f32::INFINITY; LANES],
        u: [0.0; LANES],
        v: [0.0; LANES],
        prim: [NO_HIT; LANES],
        instance: [NO_HIT; LANES],
    };

    /// The hit in lane `lane`, if any.
    #[inline]
    pub fn get(&self, lane: usize) -> Option<Hit> {
        (self.prim[lane] != NO_HIT).then(|| Hit {
            t: self.t[lane],
            u: self.u[lane],
            v: self.v[lane],
            prim: self.prim[lane],
            instance: self.instance[lane],
        })
    }

    /// Writes a hit or a miss into lane `lane`.
    #[inline]
    pub fn set(&mut self, lane: usize, hit: Option<Hit>) {
        let h =
            hit.unwrap_or(Hit { t: f32::INFINITY, u: 0.0, v: 0.0, prim: NO_HIT, instance: NO_HIT });
        self.t[lane] = h.t;
        self.u[lane] = h.u;
        self.v[lane] = h.v;
        self.prim[lane] = h.prim;
        self.instance[lane] = h.instance;
    }
}
