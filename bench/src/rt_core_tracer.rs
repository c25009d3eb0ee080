//! Implements the baselines' interface for rt-core.

use crate::baselines::{BuildCost, Tracer};
use crate::meshes::MeshScene;
use crate::{clock, memory, rays};
use glam::Vec3;
use rays::{HitBlock, LANES, RayBlock};
use rt_core::bvh::{BuildError, BuildOptions, Geometry, World};
use rt_core::mesh::TriMesh;
use std::sync::Arc;

/// Entry point of the world through which rays are traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// One ray per call.
    Single,
    /// Packets of rays with similar directions.
    Coherent,
    /// Rays in any direction, sorted internally.
    Incoherent,
}

impl Mode {
    /// Name in the tables.
    pub fn name(self) -> &'static str {
        match self {
            Mode::Single => "single rays",
            Mode::Coherent => "coherent",
            Mode::Incoherent => "incoherent",
        }
    }
}

/// A built world.
pub struct RtCoreTracer {
    /// The world.
    pub world: Arc<World>,
    options: BuildOptions,
    /// Cost of the build; the peak is the growth of the heap, without the mesh.
    pub cost: BuildCost,
    /// Render space minus the mesh's coordinates; zero unless the mesh is far from the origin.
    shift: Vec3,
}

impl RtCoreTracer {
    /// Builds on rayon's current pool.
    pub fn build(mesh: &Arc<TriMesh>, options: &BuildOptions) -> Result<RtCoreTracer, BuildError> {
        RtCoreTracer::build_scene(&MeshScene::one("", Arc::clone(mesh)), options)
    }

    /// Builds a world of `scene`, whose meshes have one origin. An instance that is turned must
    /// have its origin at zero, as [`MeshScene::corners`] has.
    pub fn build_scene(
        scene: &MeshScene,
        options: &BuildOptions,
    ) -> Result<RtCoreTracer, BuildError> {
        let meshes = &scene.meshes;
        let geometries: Vec<Geometry> = meshes.iter().cloned().map(Geometry::Mesh).collect();
        let instances = scene.instances.clone();
        let ((world, time), peak_bytes) =
            memory::peak(|| clock::measure(|| World::build(geometries, instances, options)));
        let world = world?;
        let cost = BuildCost {
            wall_secs: time.wall_secs,
            cpu_secs: time.process_cpu_secs,
            bytes: world.report().bytes as u64,
            peak_bytes: Some(peak_bytes),
        };
        let origin = meshes.first().map_or(world.origin(), |m| m.origin);
        let shift = (origin - world.origin()).as_vec3();
        Ok(RtCoreTracer { world: Arc::new(world), options: *options, cost, shift })
    }

    /// A view that sends rays through one entry point.
    pub fn view(&self, mode: Mode) -> View<'_> {
        View { ours: self, mode }
    }

    /// `rt-core, balanced, watertight`, and the instruction set when it is limited.
    pub fn name(&self) -> String {
        let o = &self.options;
        let simd = o.simd.map_or(String::new(), |s| format!(", {}", s.name()));
        format!("rt-core, {}, {}{simd}", o.quality.name(), o.robustness.name())
    }
}

/// A world with an entry point.
pub struct View<'a> {
    ours: &'a RtCoreTracer,
    mode: Mode,
}

impl View<'_> {
    /// Rays in render space: unchanged unless the mesh was shifted.
    fn shifted<T>(&self, rays: &[RayBlock], then: impl FnOnce(&[RayBlock]) -> T) -> T {
        let s = self.ours.shift;
        if s == Vec3::ZERO {
            return then(rays);
        }
        let mut moved = rays.to_vec();
        for r in &mut moved {
            for l in 0..LANES {
                (r.ox[l], r.oy[l], r.oz[l]) = (r.ox[l] + s.x, r.oy[l] + s.y, r.oz[l] + s.z);
            }
        }
        then(&moved)
    }
}

/// Assertion message: what every caller of a [`Tracer`] must provide.
const ONE_EACH: &str = "one block of answers for each of rays";

impl Tracer for View<'_> {
    fn name(&self) -> String {
        format!("{}, {}", self.ours.name(), self.mode.name())
    }

    fn closest(&self, rays: &[RayBlock], hits: &mut [HitBlock]) {
        let world = &*self.ours.world;
        self.shifted(rays, |rays| match self.mode {
            Mode::Coherent => world.closest_coherent(rays, hits).expect(ONE_EACH),
            Mode::Incoherent => world.closest_incoherent(rays, hits).expect(ONE_EACH),
            Mode::Single => {
                for (r, h) in rays.iter().zip(hits) {
                    for l in 0..LANES {
                        h.set(l, world.closest(&r.get(l)));
                    }
                }
            }
        });
    }

    fn occluded(&self, rays: &[RayBlock], masks: &mut [u16]) {
        let world = &*self.ours.world;
        self.shifted(rays, |rays| match self.mode {
            Mode::Coherent => world.occluded_coherent(rays, masks).expect(ONE_EACH),
            Mode::Incoherent => world.occluded_incoherent(rays, masks).expect(ONE_EACH),
            Mode::Single => {
                for (r, m) in rays.iter().zip(masks) {
                    *m = (0..LANES).fold(0, |m, l| m | u16::from(world.occluded(&r.get(l))) << l);
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baselines::testing;
    use rt_core::bvh::{BuildQuality, Robustness};
    use rt_core::simd::SimdLevel;

    #[test]
    fn every_mode_level_and_robustness_agrees_with_brute_force() {
        let mesh = Arc::new(testing::mesh());
        let levels = SimdLevel::available().into_iter().map(Some).chain([None]);
        for simd in levels {
            for robustness in Robustness::ALL {
                let options = BuildOptions { robustness, simd, ..Default::default() };
                let ours = RtCoreTracer::build(&mesh, &options).unwrap();
                for mode in [Mode::Single, Mode::Coherent, Mode::Incoherent] {
                    testing::agrees_with_brute_force(&ours.view(mode));
                }
            }
        }
    }

    #[test]
    fn every_quality_agrees_with_brute_force() {
        let mesh = Arc::new(testing::mesh());
        for quality in BuildQuality::ALL {
            let ours = RtCoreTracer::build(&mesh, &BuildOptions { quality, ..Default::default() })
                .unwrap();
            assert!(ours.cost.bytes > 0 && ours.cost.wall_secs > 0.0);
            testing::agrees_with_brute_force(&ours.view(Mode::Coherent));
        }
    }
}
