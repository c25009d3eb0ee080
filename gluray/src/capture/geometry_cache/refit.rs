//! Refits moved geometry: the same triangles at other positions, as when a program animates time
//! steps or a deformation. Its structure is the earlier one with recomputed boxes, which costs a
//! sixth of a build, including the copy. This is done as long as rays stay nearly as fast.

use super::Geometry;
use rt_core::bvh::{self, BuildOptions, Instance, World};
use rt_core::glam::DAffine3;
use rt_core::mesh::TriMesh;
use std::sync::Arc;
use std::time::Instant;

/// The growth of the expected cost of a ray, relative to the tree when it was built, up to which
/// moved triangles keep the tree. At 1.6 packets take a quarter longer, at 1.9 a third
/// (`RefitReport::cost_growth`). A build takes as long as two frames.
const MOST_GROWTH: f64 = 1.8;

/// The structure of `mesh`, refitted from that of `before`. `None` when there is none or when it
/// would be too slow.
pub(super) fn structure(before: &Geometry, mesh: &Arc<TriMesh>) -> Option<Arc<World>> {
    let old = before.structure_now()?;
    let start = Instant::now();
    // The program may draw the earlier geometry again, so that keeps its own structure.
    let geometry = bvh::Geometry::Mesh(before.mesh.clone());
    let instance = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
    let mut world =
        World::build_sharing(vec![geometry], vec![instance], &BuildOptions::default(), Some(&old))
            .ok()?;
    let report = world.refit(0, mesh.clone()).ok()?;
    crate::host::report::span("builds", "refit", 0, start.elapsed());
    (report.absent == 0 && report.cost_growth <= MOST_GROWTH).then(|| Arc::new(world))
}

#[cfg(test)]
mod tests {
    use crate::capture::geometry_cache::{BuildCounts, GeometryCache};
    use crate::capture::primitives::PrimitiveRun;
    use crate::capture::primitives::QuadSplit;
    use crate::enums::TRIANGLES;
    use rt_core::glam::Vec3;
    use rt_core::ray::Ray;

    /// A sheet of 2 x 60 x 60 triangles with a wave in it.
    fn sheet(phase: f32, scattered: bool) -> Vec<[f32; 3]> {
        let mut out = Vec::new();
        for i in 0..60_u32 * 60 {
            let (x, y) = match scattered {
                true => ((i * 7919 % 61) as f32, (i * 104_729 % 59) as f32),
                false => ((i % 60) as f32, (i / 60) as f32),
            };
            let at = |dx: f32, dy: f32| [x + dx, y + dy, ((x + dx) * 0.3 + phase).sin()];
            out.extend([at(0., 0.), at(1., 0.), at(0., 1.), at(1., 0.), at(1., 1.), at(0., 1.)]);
        }
        out
    }

    #[test]
    fn triangles_that_move_a_little_keep_their_tree_and_those_that_scatter_get_a_new_one() {
        let mut cache = GeometryCache::default();
        let runs = [PrimitiveRun { mode: TRIANGLES, count: 3, times: 7200 }];
        let mut made = BuildCounts::default();
        let mut frame = |phase: f32, scattered: bool| {
            let g = cache.of_runs(&sheet(phase, scattered), &runs, &QuadSplit::default());
            let world = g.world(&mut made).expect("a mesh that can be built");
            let (origin, toward) = (Vec3::new(20.3, 30.6, 50.0), -Vec3::Z);
            let hit = world
                .closest(&world.ray_from_world(origin.as_dvec3(), toward.as_dvec3()).0)
                .expect("the sheet");
            cache.frame_done(|_| false);
            (hit, made)
        };
        let (_, first) = frame(0.0, false);
        assert_eq!(first, BuildCounts { built: 1, refitted: 0, triangles: 7200 });
        let (moved, second) = frame(0.2, false);
        assert_eq!(second, BuildCounts { built: 1, refitted: 1, triangles: 8400 });
        let (_, back) = frame(0.0, false);
        assert_eq!(back, second, "what was before kept its own tree");
        let (_, third) = frame(0.2, true);
        assert_eq!(third, BuildCounts { built: 2, refitted: 1, triangles: 15_600 });
        let mut fresh = GeometryCache::default();
        let g = fresh.of_runs(&sheet(0.2, false), &runs, &QuadSplit::default());
        let world = g.world(&mut BuildCounts::default()).expect("a mesh that can be built");
        let ray: Ray =
            world.ray_from_world(Vec3::new(20.3, 30.6, 50.0).as_dvec3(), -Vec3::Z.as_dvec3()).0;
        assert_eq!(world.closest(&ray), Some(moved));
    }
}
