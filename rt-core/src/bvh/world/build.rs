//! Builds worlds.

use super::World;
use super::compact_members::build_members;
use crate::bvh::blas::Blas;
use crate::bvh::build::{OneAtATime, Progress, Stopped, UNWATCHED, build_in_parallel};
use crate::bvh::error::BuildError;
use crate::bvh::geometry::{Geometry, Instance, SliceFacts, Sources};
use crate::bvh::layout::wide::Unit;
use crate::bvh::mesh_group::{
    GroupChoice, GroupInput, KnownTree, KnownTrees, build_group, choose_members,
};
use crate::bvh::options::{BuildOptions, BuildReport, Storage};
use crate::bvh::partition::{GlobalLayout, blas_of};
use crate::bvh::top_level::{TopLevel, build_top_level, choose_origin};
use crate::mesh::{MeshSlices, TriMesh};
use crate::simd::SimdLevel;
use glam::DAffine3;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

impl World {
    /// Builds the acceleration structures.
    pub fn build(
        geometries: Vec<Geometry>,
        instances: Vec<Instance>,
        options: &BuildOptions,
    ) -> Result<World, BuildError> {
        World::build_sharing(geometries, instances, options, None)
    }

    /// As [`World::build`], but reuses the acceleration structure of every geometry that `previous`
    /// also has (the same [`Arc`], at any index). When one of five hundred meshes changes, the
    /// trees of the others are copied, which takes a small part of the time of building them. When
    /// only transforms change, nothing is copied. If the options differ from those of `previous`,
    /// everything is rebuilt. The hits equal those of a world built from scratch (after a
    /// [`World::refit`] of `previous`: those of the refitted world).
    pub fn build_sharing(
        geometries: Vec<Geometry>,
        instances: Vec<Instance>,
        options: &BuildOptions,
        previous: Option<&World>,
    ) -> Result<World, BuildError> {
        let request = BuildRequest::new(options, &UNWATCHED);
        BuildRequest { previous, ..request }.build(geometries, instances)
    }

    /// As [`World::build_sharing`], but tells `watch` how far the build has come, from 0 to 1: the
    /// share of primitives in finished parts of trees. When it answers [`ControlFlow::Break`], the
    /// build stops, and nothing is left of it.
    ///
    /// It is asked at the start, at the end, and in between by each thread for every 65,536
    /// primitives or fewer, on the threads of the pool but never by two at once. So it should
    /// return at once; to stop a build from elsewhere, let it look at a flag.
    ///
    /// ```
    /// use rt_core::bvh::BuildError;
    /// use rt_core::prelude::*;
    /// use std::ops::ControlFlow;
    /// use std::sync::atomic::{AtomicBool, Ordering};
    ///
    /// let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    /// let mesh = Geometry::Mesh(TriMesh::new(corners, vec![[0, 1, 2]]).into());
    /// let placed = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
    /// let closed = AtomicBool::new(false); // set when the user closes the window
    /// let mut shown = 0.0;
    /// let watch = |done| {
    ///     shown = done;
    ///     if closed.load(Ordering::Relaxed) {
    ///         return ControlFlow::Break(());
    ///     }
    ///     ControlFlow::Continue(())
    /// };
    /// let options = BuildOptions::default();
    /// let built = World::build_watched(vec![mesh.clone()], vec![placed], &options, None, watch);
    /// assert!(built.is_ok() && shown == 1.0);
    ///
    /// let stop = |_| ControlFlow::Break(());
    /// let stopped = World::build_watched(vec![mesh], vec![placed], &options, None, stop);
    /// assert!(matches!(stopped, Err(BuildError::Cancelled)));
    /// ```
    ///
    /// # Errors
    /// As [`World::build`], and [`BuildError::Cancelled`] when `watch` stopped the build.
    pub fn build_watched(
        geometries: Vec<Geometry>,
        instances: Vec<Instance>,
        options: &BuildOptions,
        previous: Option<&World>,
        watch: impl FnMut(f64) -> ControlFlow<()> + Send,
    ) -> Result<World, BuildError> {
        let primitives: usize = geometries.iter().map(Geometry::num_primitives).sum();
        let watch = OneAtATime::new(watch);
        let progress = &Progress::watched_by(&watch, primitives + instances.len());
        let request = BuildRequest::new(options, progress);
        BuildRequest { previous, ..request }.build(geometries, instances)
    }

    /// A world of one mesh, without a transform.
    pub fn from_mesh(
        mesh: impl Into<Arc<TriMesh>>,
        options: &BuildOptions,
    ) -> Result<World, BuildError> {
        let instance = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
        World::build(vec![Geometry::Mesh(mesh.into())], vec![instance], options)
    }

    /// A world of meshes in arrays that the caller keeps: nothing is copied but what the leaves
    /// hold, the corners of the triangles. Hits equal those of a world from [`TriMesh`]es, bit for
    /// bit. Once built, the world does not need the arrays: they may change or go.
    ///
    /// Such a world has no attributes and makes no images: a scene of it is refused. A refit needs
    /// the arrays again: [`World::refit_slices`].
    ///
    /// ```
    /// use rt_core::mesh::MeshSlices;
    /// use rt_core::prelude::*;
    ///
    /// let mut corners = vec![0., 0., 0., 1., 0., 0., 0., 1., 0.];
    /// let placed = [0.0, 5.0].map(|z| Instance {
    ///     geometry: 0,
    ///     world_from_object: DAffine3::from_translation(DVec3::Z * z),
    /// });
    /// let mesh = MeshSlices::new(&corners, &[0, 1, 2]);
    /// let world = World::from_slices(&[mesh], placed.to_vec(), &BuildOptions::default())?;
    /// corners.clear();
    /// let down = Ray::new(Vec3::new(0.2, 0.2, 9.0), Vec3::NEG_Z);
    /// assert_eq!(world.closest(&down).map(|hit| hit.instance), Some(1));
    /// # Ok::<(), rt_core::bvh::BuildError>(())
    /// ```
    ///
    /// # Errors
    /// As [`World::build`]; [`MeshSlices::check`] tells what can be wrong with a mesh.
    pub fn from_slices(
        meshes: &[MeshSlices<'_>],
        instances: Vec<Instance>,
        options: &BuildOptions,
    ) -> Result<World, BuildError> {
        World::from_slices_with(&UNWATCHED, meshes, instances, options)
    }

    /// As [`World::from_slices`]; tells `watch` how far it is and stops when told so, as
    /// [`World::build_watched`] does.
    ///
    /// ```
    /// use rt_core::bvh::BuildError;
    /// use rt_core::mesh::MeshSlices;
    /// use rt_core::prelude::*;
    /// use std::ops::ControlFlow;
    ///
    /// let corners = [0., 0., 0., 1., 0., 0., 0., 1., 0.];
    /// let mesh = MeshSlices::new(&corners, &[0, 1, 2]);
    /// let placed = vec![Instance { geometry: 0, world_from_object: DAffine3::IDENTITY }];
    /// let stop = |_| ControlFlow::Break(());
    /// let options = BuildOptions::default();
    /// let stopped = World::from_slices_watched(&[mesh], placed, &options, stop);
    /// assert!(matches!(stopped, Err(BuildError::Cancelled)));
    /// ```
    ///
    /// # Errors
    /// As [`World::from_slices`], and [`BuildError::Cancelled`] when `watch` stopped the build.
    pub fn from_slices_watched(
        meshes: &[MeshSlices<'_>],
        instances: Vec<Instance>,
        options: &BuildOptions,
        watch: impl FnMut(f64) -> ControlFlow<()> + Send,
    ) -> Result<World, BuildError> {
        let triangles: usize = meshes.iter().map(MeshSlices::num_triangles).sum();
        let watch = OneAtATime::new(watch);
        let progress = Progress::watched_by(&watch, triangles + instances.len());
        World::from_slices_with(&progress, meshes, instances, options)
    }

    fn from_slices_with(
        progress: &Progress<'_>,
        meshes: &[MeshSlices<'_>],
        instances: Vec<Instance>,
        options: &BuildOptions,
    ) -> Result<World, BuildError> {
        let facts = |m: &MeshSlices<'_>| Geometry::Slices(Arc::new(SliceFacts::of(m.triangles())));
        let request = BuildRequest::new(options, progress);
        BuildRequest { slices: meshes, ..request }
            .build(meshes.iter().map(facts).collect(), instances)
    }

    fn trees_by_address(&self) -> KnownTrees<'_> {
        let mut members = vec![None; self.geometries.len()];
        for (k, m) in self.group.iter().flat_map(|g| g.members.iter().enumerate()) {
            members[m.geometry] = Some(k);
        }
        let known = |(geometry, blas)| KnownTree { geometry, member: members[geometry], blas };
        let addresses = self.geometries.iter().map(Geometry::address);
        addresses.zip(self.blas.iter().enumerate().map(known)).collect()
    }
}

/// How a world is built.
#[derive(Clone, Copy)]
pub(in crate::bvh) struct BuildRequest<'a> {
    pub(in crate::bvh) options: &'a BuildOptions,
    /// The choices of the world that this becomes a part of.
    pub(in crate::bvh) whole: Option<&'a GlobalLayout>,
    /// A world to take trees from, for geometries that both have.
    pub(in crate::bvh) previous: Option<&'a World>,
    /// The arrays of geometries that are slices.
    pub(in crate::bvh) slices: &'a [MeshSlices<'a>],
    pub(in crate::bvh) progress: &'a Progress<'a>,
}

impl<'a> BuildRequest<'a> {
    pub(in crate::bvh) fn new(options: &'a BuildOptions, progress: &'a Progress<'a>) -> Self {
        BuildRequest { options, whole: None, previous: None, slices: &[], progress }
    }

    pub(in crate::bvh) fn build(
        self,
        geometries: Vec<Geometry>,
        instances: Vec<Instance>,
    ) -> Result<World, BuildError> {
        let BuildRequest { options, whole, previous, slices, progress } = self;
        let start = Instant::now();
        let mut phases = Vec::new();
        let level = SimdLevel::resolve(options.simd)?;
        for (i, inst) in instances.iter().enumerate() {
            if inst.geometry >= geometries.len() {
                let count = geometries.len();
                return Err(BuildError::NoSuchGeometry {
                    instance: i,
                    geometry: inst.geometry,
                    count,
                });
            }
        }
        let sources = Sources { geometries: &geometries, slices };
        (0..geometries.len()).try_for_each(|i| sources.check(i))?;
        progress.check()?;
        let previous = previous.filter(|w| w.options == *options);
        let known = previous.map(World::trees_by_address);
        let earlier = previous.and_then(|w| w.group.as_ref());
        let choice = match whole {
            None => choose_members(&geometries, &instances),
            Some(whole) => whole.group.as_ref().map(GroupChoice::of_layout),
        };

        // ---- Geometries with a tree of their own.
        let build_alone = |i: usize| {
            let g = &geometries[i];
            let given = whole.map(|w| w.geometries[i]);
            let old = known.as_ref().and_then(|k| k.get(&g.address()));
            let old = old.and_then(|old| Blas::as_part_of(old.blas, given));
            let shared = match (old, g) {
                (Some(old), Geometry::Mesh(_) | Geometry::Slices(_)) if old.bvh().is_some() => old,
                (Some(old), Geometry::Shape(s)) => Blas::with_shape(&old, s),
                _ => return Ok(Arc::new(blas_of(i, sources, options, whole, progress)?)),
            };
            progress.advance(g.num_primitives())?;
            Ok(shared)
        };
        let mut blas: Vec<Option<Arc<Blas>>> = vec![None; geometries.len()];
        let members = choice.iter().flat_map(|c| &c.instances);
        let members: Vec<usize> = members.map(|&i| instances[i as usize].geometry).collect();
        build_missing(&geometries, &mut blas, &members, build_alone)?;

        // ---- The meshes that share one tree, in render space.
        let origin = whole.map_or_else(
            || {
                let space_of = |g: usize| blas[g].as_ref().map(|b| (b.frame, b.bounds()));
                choose_origin(&instances, space_of, choice.as_ref())
            },
            |whole| whole.origin,
        );
        let mut notes = Vec::new();
        let layout = whole.and_then(|whole| whole.group.as_ref());
        let build_group_of = |choice: &GroupChoice| {
            let input = GroupInput {
                sources,
                instances: &instances,
                members: &choice.instances,
                frame: layout.map_or_else(|| choice.frame(origin), |l| l.frame),
                origin,
                reach: layout.map(|l| l.reach),
                options,
                progress,
            };
            match options.storage {
                Storage::Plain => build_group(&input, known.as_ref(), earlier, &mut notes)
                    .map(|built| built.map(|(group, blas)| (Some(group), blas))),
                Storage::Compact => {
                    build_members(&input, known.as_ref()).map(|blas| Some((None, blas)))
                }
            }
        };
        let group = choice.as_ref().map(build_group_of).transpose()?.flatten();
        let group = group.and_then(|(group, of_members)| {
            for (&geometry, b) in members.iter().zip(of_members) {
                blas[geometry] = Some(b);
            }
            group
        });
        // Without a group, its members get trees of their own.
        build_missing(&geometries, &mut blas, &[], build_alone)?;
        let blas: Vec<Arc<Blas>> = blas.into_iter().flatten().collect();
        phases.push(("geometries", start.elapsed()));

        let of_geometry = |(i, b): (usize, &Arc<Blas>)| {
            b.notes.iter().map(|n| format!("geometry {i}: {n}")).collect::<Vec<_>>()
        };
        notes.extend(blas.iter().enumerate().flat_map(of_geometry));
        let TopLevel { placements, tlas, bounds, only, few } =
            build_top_level(&instances, &blas, group.as_deref(), origin, &mut notes, progress)?;
        progress.finish()?;
        phases.push(("instances", start.elapsed() - phases[0].1));
        let group_tree = group.as_ref().map(|g| &g.bvh);
        let trees = || blas.iter().filter_map(|b| b.bvh()).chain(group_tree);
        let report = BuildReport {
            total: start.elapsed(),
            phases,
            depth: trees().map(|t| t.depth).max().unwrap_or(0),
            primitives: blas.iter().map(|b| b.primitives).sum(),
            skipped: blas.iter().map(|b| b.skipped).sum(),
            bytes: (tlas.units.len() + trees().map(|t| t.units.len()).sum::<usize>())
                * size_of::<Unit>(),
            notes,
        };
        Ok(World {
            geometries,
            instances,
            origin,
            bounds: whole.map_or(bounds, |w| w.bounds),
            report,
            blas,
            placements,
            group_is_impossible: choice.is_some() && group.is_none(),
            group,
            tlas,
            only,
            few,
            options: *options,
            robustness: options.robustness,
            level,
        })
    }
}

/// Builds the structures that are missing in `blas`, but for those of the geometries in `except`.
fn build_missing(
    geometries: &[Geometry],
    blas: &mut [Option<Arc<Blas>>],
    except: &[usize],
    build: impl Fn(usize) -> Result<Arc<Blas>, Stopped> + Sync,
) -> Result<(), Stopped> {
    let mut wanted: Vec<bool> = blas.iter().map(Option::is_none).collect();
    except.iter().for_each(|&i| wanted[i] = false);
    let missing: Vec<usize> = (0..blas.len()).filter(|&i| wanted[i]).collect();
    let sizes: Vec<usize> = missing.iter().map(|&i| geometries[i].num_primitives()).collect();
    let built = build_in_parallel(&sizes, |k| build(missing[k]));
    for (i, b) in missing.into_iter().zip(built) {
        blas[i] = Some(b?);
    }
    Ok(())
}
