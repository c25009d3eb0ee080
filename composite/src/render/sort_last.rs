//! A sort-last frame: camera rays, then bounce after bounce of secondary rays.
use super::options::{FrameOptions, FrameOutput, SecondaryRayPolicy};
use super::rank_bounds::RankBounds;
use super::rank_frame::{RankFrame, each};
use super::request_reply::RankChannel;
use super::tile_collector::TileCollector;
use super::tile_owners::TileOwners;
use super::{
    Activity, FrameError, Part, RankScene, distributed, ghost, primary_rays, secondary_rays,
};
use crate::comm::Communicator;
use rt_core::bvh::World;
use rt_core::camera::Camera;
use rt_core::deferred::{DeferredFrame, Pass, TileState};
use rt_core::effects::Effects;
use rt_core::frame::Frame;
use rt_core::glam::Vec3;
use rt_core::math::Aabb;
use rt_core::render::{RenderError, RenderOptions};
use rt_core::scene::Scene;
use std::sync::Arc;

/// One rank of a group that renders a scene in parts.
pub struct DataParallel {
    part: Part,
    options: FrameOptions,
    rank_bounds: RankBounds,
    /// The chosen policy and its reason; `None` until the first frame with secondary light rays.
    decision: Option<ghost::Decision>,
}

impl DataParallel {
    /// Exchanges the bounds of all parts. All ranks must call it, and [`DataParallel::frame`] with
    /// the same arguments.
    ///
    /// # Errors
    /// [`FrameError::Ranks`] when the numbers of ranks and parts differ, or errors of the
    /// transport.
    pub fn new(
        comm: &mut dyn Communicator,
        part: Part,
        options: FrameOptions,
    ) -> Result<DataParallel, FrameError> {
        let (rank, ranks) = (comm.rank(), comm.size());
        if (part.parts, part.rank) != (ranks, rank) {
            return Err(FrameError::Ranks { parts: part.parts, ranks });
        }
        let own = part.scene.world.own_bounds();
        let numbers: Vec<u32> =
            [own.min, own.max].iter().flat_map(|v| v.to_array().map(f32::to_bits)).collect();
        let mut channel = RankChannel::new(comm, options.timeout);
        let all = channel.all_gather(&numbers)?;
        let vector =
            |w: &[u32]| Vec3::new(f32::from_bits(w[0]), f32::from_bits(w[1]), f32::from_bits(w[2]));
        let bounds: Vec<Aabb> =
            all.iter().map(|w| Aabb::new(vector(&w[..3]), vector(&w[3..]))).collect();
        // No ray enters a box with NaN, so the rank would be silently left out.
        if let Some(from) = bounds.iter().position(|b| b.min.is_nan() || b.max.is_nan()) {
            let error = channel.message_error(from, "bounds of its part", numbers.len());
            channel.abort(&error.to_string());
            return Err(error);
        }
        let rank_bounds = RankBounds::new(bounds, part.scene.world.bounds());
        Ok(DataParallel { part, options, rank_bounds, decision: None })
    }

    /// One rank of a group that renders the sum of what its ranks have: nobody needs the whole. All
    /// ranks must call it, each with its own [`RankScene`]. Their parts may overlap in space.
    ///
    /// # Errors
    /// [`FrameError::Contradiction`] and [`FrameError::RankScene`] on every rank, when ranks give
    /// different settings or one gives something unusable: the communicator can still be used then.
    /// Otherwise errors of messages and of the transport, after which it cannot.
    pub fn distributed(
        comm: &mut dyn Communicator,
        scene: RankScene,
        options: FrameOptions,
    ) -> Result<DataParallel, FrameError> {
        DataParallel::agreed(comm, scene, options, None)
    }

    fn agreed(
        comm: &mut dyn Communicator,
        scene: RankScene,
        options: FrameOptions,
        previous: Option<&World>,
    ) -> Result<DataParallel, FrameError> {
        let mut channel = RankChannel::new(comm, options.timeout);
        let part = distributed::assemble(&mut channel, scene, previous);
        if let Err(error) = part.as_ref()
            && !error.is_agreed()
        {
            channel.abort(&error.to_string());
        }
        DataParallel::new(comm, part?, options)
    }

    /// Replaces what this rank has, for the next time step. All ranks must call it, also those that
    /// have the same as before. Trees over geometries that are the same (the same [`Arc`]) are used
    /// again where their local space has not changed. After an error that leaves the communicator
    /// usable, the earlier scene can still be rendered.
    ///
    /// [`Arc`]: std::sync::Arc
    ///
    /// # Errors
    /// As [`DataParallel::distributed`].
    pub fn replace(
        &mut self,
        comm: &mut dyn Communicator,
        scene: RankScene,
    ) -> Result<(), FrameError> {
        let world = self.part.scene.world.clone();
        *self = DataParallel::agreed(comm, scene, self.options.clone(), Some(&world))?;
        Ok(())
    }

    /// The part that this rank holds.
    pub fn part(&self) -> &Part {
        &self.part
    }

    /// Renders one frame together with all other ranks.
    ///
    /// # Errors
    /// [`FrameError::Contradiction`] on every rank when ranks have another camera or other options;
    /// the communicator can still be used then. Any other fault on any rank ends the frame for all.
    pub fn frame(
        &mut self,
        comm: &mut dyn Communicator,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<FrameOutput, FrameError> {
        let mut channel = RankChannel::new(comm, self.options.timeout);
        let result = self
            .agree_on_view(&mut channel, camera, options)
            .and_then(|()| self.render(&mut channel, camera, options));
        if let Err(error) = &result
            && !error.is_agreed()
        {
            channel.abort(&error.to_string());
        }
        let frame = result?;
        Ok(FrameOutput { frame, report: channel.report })
    }

    /// Compares what must be the same on all ranks.
    fn agree_on_view(
        &self,
        channel: &mut RankChannel<'_>,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<(), FrameError> {
        // Points, one per pixel, as the digest of their bits. Whether a frame is cancelled is no
        // setting.
        let bits = |points: &Option<Arc<Vec<[f64; 2]>>>| {
            let numbers = points.iter().flat_map(|p| p.as_flattened());
            numbers.fold(0, |state, n| crate::codec::mix(state, n.to_bits()))
        };
        let points = [bits(&options.points), bits(&options.shading_points)];
        let render =
            RenderOptions { points: None, shading_points: None, cancel: None, ..options.clone() };
        let FrameOptions { root, secondary_rays, stream, .. } = &self.options;
        let settings: [distributed::Setting<'_>; 6] = [
            ("camera", camera),
            ("render options", &render),
            ("points of the image", &points),
            ("root of the frame", root),
            ("secondary rays", secondary_rays),
            ("streaming", stream),
        ];
        distributed::agree_on(channel, &settings)
    }

    fn render(
        &mut self,
        channel: &mut RankChannel<'_>,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<Option<Frame>, FrameError> {
        let policy = self.secondary_ray_policy(channel, camera, options)?;
        let part = &self.part;
        let frame = DeferredFrame::new(&part.scene, part.needed, camera, options)?;
        let parallel = self.options.parallel;
        let side = RankFrame { frame: &frame, part, camera, options, parallel };
        let ghost_layer = match (&part.ghost_layer, policy) {
            (Some((_, scene)), SecondaryRayPolicy::GhostZones) => {
                Some(DeferredFrame::new(scene, part.needed, camera, options)?)
            }
            _ => None,
        };
        channel.report.effects = frame.effects();
        channel.report.warnings = frame.warnings().to_vec();
        let volumes = frame.effects().contains(Effects::VOLUMES);
        let volumes = if volumes { &part.scene.volumes[..] } else { &[] };
        let media = volumes.iter().any(|placed| placed.volume.is_medium());
        if volumes.iter().any(|placed| !placed.volume.is_medium()) {
            let words = "volumes that are no medium (maxima, minima, means, sums, isosurfaces) are \
                         not cut: every rank holds them whole";
            channel.report.warnings.push(words.into());
        }
        let owners = TileOwners::new(&side, &self.rank_bounds.bounds);
        let mine = owners.tiles[channel.rank()].clone();
        let mut tiles: Vec<TileState> = mine.map(|t| frame.tile(t)).collect();
        channel.record_span(Activity::Render);

        let passes = frame.passes();
        for (number, &pass) in passes.iter().enumerate() {
            let local = frame.needs_only_local_light() && pass != Pass::Geometry;
            let record = frame.records_geometry(pass);
            let stream = self.options.stream;
            let wanted = primary_rays::PrimaryPass {
                pass,
                colors: local,
                hit_details: record || !local,
                stream,
            };
            // Tiles of the last pass go to the root as they are finished.
            if stream && local && !record && number + 1 == passes.len() {
                let mut collect =
                    TileCollector::new(channel, &side, &owners, &mut tiles, self.options.root)?;
                primary_rays::run(channel, &side, &owners, wanted, Some(&mut collect))?;
                let picture = collect.into_picture();
                readable(&part.scene)?;
                for tile in &tiles {
                    channel.report.rays += tile.stats();
                }
                return Ok(picture);
            }
            let answers = primary_rays::run(channel, &side, &owners, wanted, None)?;
            let rank = channel.rank();
            let fits = |source| FrameError::Answer { rank, source };
            each(channel, side.parallel, &mut tiles, |_, tile| tile.begin(&frame, pass));
            if local {
                for (tile, answer) in tiles.iter_mut().zip(&answers) {
                    tile.select_colors(&frame, &answer.colors()).map_err(fits)?;
                    if record {
                        tile.record_geometry(&answer.hits);
                    }
                }
                channel.record_span(Activity::Shade);
                continue;
            }
            let media = pass != Pass::Geometry && media;
            let mut wave = secondary_rays::SecondaryRays {
                side: &side,
                rank_bounds: &self.rank_bounds,
                policy,
                ghost_layer: ghost_layer.as_ref(),
                media,
                pass,
            };
            wave.run(channel, &mut tiles, answers)?;
        }
        // Before this rank's tiles are sent, so that no rank takes the frame for right.
        readable(&part.scene)?;
        for tile in &tiles {
            channel.report.rays += tile.stats();
        }
        TileCollector::new(channel, &side, &owners, &mut tiles, self.options.root)?
            .all(channel, &owners)
    }

    /// Chooses, once and identically on all ranks, how light crosses borders, and builds what that
    /// needs.
    fn secondary_ray_policy(
        &mut self,
        channel: &mut RankChannel<'_>,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<SecondaryRayPolicy, FrameError> {
        let probe = DeferredFrame::new(&self.part.scene, self.part.needed, camera, options)?;
        // Whether rays of ambient occlusion are the only ones that leave a camera ray's hit.
        let alone = probe.effects().without(Effects::DEPTH_OF_FIELD) == Effects::AMBIENT_OCCLUSION;
        let ambient_occlusion = self.part.scene.ambient_occlusion.filter(|_| alone);
        let distance = ambient_occlusion.map(|ao| ao.distance).filter(|d| d.is_finite());
        let secondary = !probe.needs_only_local_light();
        drop(probe);
        let Some(distance) =
            distance.filter(|_| self.options.secondary_rays != SecondaryRayPolicy::LocalOnly)
        else {
            let (policy, words) = match self.options.secondary_rays {
                SecondaryRayPolicy::LocalOnly => {
                    (SecondaryRayPolicy::LocalOnly, "local geometry only: wrong near borders")
                }
                _ if !secondary => (SecondaryRayPolicy::Forward, "no light crosses borders"),
                SecondaryRayPolicy::Forward => {
                    (SecondaryRayPolicy::Forward, "asked of the ranks in whose bounds rays come")
                }
                _ => (
                    SecondaryRayPolicy::Forward,
                    "asked of the ranks in whose bounds rays come: ghost zones do for ambient \
                     occlusion of limited distance only",
                ),
            };
            channel.report.secondary_rays = words.into();
            return Ok(policy);
        };
        if self.decision.as_ref().is_none_or(|c| c.distance != distance) {
            self.decision = Some(ghost::choose(
                channel,
                &mut self.part,
                &self.rank_bounds,
                &self.options,
                options,
                distance,
            )?);
        }
        let decision = self.decision.as_ref();
        channel.report.secondary_rays = decision.map(|c| c.reason.clone()).unwrap_or_default();
        Ok(decision.map_or(SecondaryRayPolicy::Forward, |c| c.policy))
    }
}

/// Whether all shapes and volumes of a rank could read their data.
fn readable(scene: &Scene) -> Result<(), FrameError> {
    match RenderError::unreadable(scene) {
        Some(error) => Err(error.into()),
        None => Ok(()),
    }
}
