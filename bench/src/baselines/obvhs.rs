//! obvhs' compressed wide BVH (Ylitie et al. 2017), one ray at a time.
//!
//! The triangles are stored in leaf order, as in the crate's own benchmark. obvhs returns distance
//! and triangle but no barycentric coordinates. None are computed here, which favours obvhs. Its
//! vector width is fixed at compile time (SSE in a default build), whereas Embree and rt-core
//! choose theirs at run time.

use super::{BaselineError, BuildCost, Tracer, require_clean};
use crate::clock;
use crate::rays::{HitBlock, LANES, NO_HIT, RayBlock};
use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::{Ray, RayHit};
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;
use rt_core::mesh::TriMesh;

/// The build presets of obvhs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preset {
    /// `fastest_build`.
    Fastest,
    /// `very_fast_build`.
    VeryFast,
    /// `fast_build`.
    Fast,
    /// `medium_build`.
    Medium,
    /// `slow_build`.
    Slow,
    /// `very_slow_build`.
    VerySlow,
}

impl Preset {
    /// All presets, from fastest to best.
    pub const ALL: [Preset; 6] = [
        Preset::Fastest,
        Preset::VeryFast,
        Preset::Fast,
        Preset::Medium,
        Preset::Slow,
        Preset::VerySlow,
    ];

    /// Name in the tables.
    pub fn name(self) -> &'static str {
        match self {
            Preset::Fastest => "fastest",
            Preset::VeryFast => "very fast",
            Preset::Fast => "fast",
            Preset::Medium => "medium",
            Preset::Slow => "slow",
            Preset::VerySlow => "very slow",
        }
    }

    fn params(self) -> BvhBuildParams {
        match self {
            Preset::Fastest => BvhBuildParams::fastest_build(),
            Preset::VeryFast => BvhBuildParams::very_fast_build(),
            Preset::Fast => BvhBuildParams::fast_build(),
            Preset::Medium => BvhBuildParams::medium_build(),
            Preset::Slow => BvhBuildParams::slow_build(),
            Preset::VerySlow => BvhBuildParams::very_slow_build(),
        }
    }
}

/// A built structure.
pub struct Obvhs {
    preset: Preset,
    bvh: CwBvh,
    /// The triangles, in leaf order.
    triangles: Vec<RtTriangle>,
    /// Cost of the build; obvhs reports no peak.
    pub cost: BuildCost,
}

impl Obvhs {
    /// Builds on rayon's current pool.
    pub fn build(mesh: &TriMesh, preset: Preset) -> Result<Obvhs, BaselineError> {
        require_clean(mesh)?;
        let corners = |i: usize| {
            let [v0, v1, v2] = mesh.triangle(i).map(Vec3A::from);
            Triangle { v0, v1, v2 }
        };
        let input: Vec<Triangle> = (0..mesh.num_triangles()).map(corners).collect();
        let ((bvh, triangles), time) = clock::measure(|| {
            let bvh = build_cwbvh_from_tris(&input, preset.params(), &mut Default::default());
            let leaf_order =
                bvh.primitive_indices.iter().map(|&i| RtTriangle::from(&input[i as usize]));
            let triangles: Vec<RtTriangle> = leaf_order.collect();
            (bvh, triangles)
        });
        let bytes = size_of_val(&bvh.nodes[..])
            + size_of_val(&bvh.primitive_indices[..])
            + size_of_val(&triangles[..]);
        let cost = BuildCost {
            wall_secs: time.wall_secs,
            cpu_secs: time.process_cpu_secs,
            bytes: bytes as u64,
            peak_bytes: None,
        };
        Ok(Obvhs { preset, bvh, triangles, cost })
    }
}

fn ray(r: &RayBlock, l: usize) -> Ray {
    let origin = Vec3A::new(r.ox[l], r.oy[l], r.oz[l]);
    Ray::new(origin, Vec3A::new(r.dx[l], r.dy[l], r.dz[l]), r.t_min[l], r.t_max[l])
}

impl Tracer for Obvhs {
    fn name(&self) -> String {
        format!("obvhs CWBVH, {}", self.preset.name())
    }

    fn closest(&self, rays: &[RayBlock], hits: &mut [HitBlock]) {
        for (r, h) in rays.iter().zip(hits) {
            for l in 0..LANES {
                h.prim[l] = NO_HIT;
                if r.t_max[l] < 0.0 {
                    continue;
                }
                let mut hit = RayHit::none();
                if self
                    .bvh
                    .ray_traverse(ray(r, l), &mut hit, |ray, i| self.triangles[i].intersect(ray))
                {
                    h.t[l] = hit.t;
                    h.prim[l] = self.bvh.primitive_indices[hit.primitive_id as usize];
                }
            }
        }
    }

    fn occluded(&self, rays: &[RayBlock], masks: &mut [u16]) {
        for (r, m) in rays.iter().zip(masks) {
            *m = 0;
            for l in (0..LANES).filter(|&l| r.t_max[l] >= 0.0) {
                let miss = self
                    .bvh
                    .ray_traverse_miss(ray(r, l), |ray, i| self.triangles[i].intersect(ray));
                *m |= u16::from(!miss) << l;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baselines::testing;
    use glam::Vec3;

    #[test]
    fn every_preset_agrees_with_brute_force() {
        let mesh = testing::mesh();
        for preset in Preset::ALL {
            let peer = Obvhs::build(&mesh, preset).unwrap();
            assert!(peer.cost.bytes > mesh.num_triangles() as u64 * 64, "{:?}", peer.cost);
            testing::agrees_with_brute_force(&peer);
        }
    }

    #[test]
    fn a_mesh_with_a_nan_vertex_is_refused() {
        let mesh = TriMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::NAN], vec![[0, 1, 2]]);
        assert_eq!(Obvhs::build(&mesh, Preset::Fast).err(), Some(BaselineError::Mesh { count: 1 }));
    }
}
