//! A sort-last frame: camera rays, then wave after wave of what leaves their hits.
use super::ask::Talk;
use super::boxes::Boxes;
use super::collect::Collect;
use super::owners::Owners;
use super::{Activity, FrameError, Part, RankReport, camera_wave, ghost, waves};
use crate::comm::Communicator;
use rayon::prelude::*;
use rt_core::camera::Camera;
use rt_core::distributed::{DistributedFrame, Pass, TileState};
use rt_core::frame::Frame;
use rt_core::glam::Vec3;
use rt_core::math::Aabb;
use rt_core::render::RenderOptions;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// How light finds what is in its way on other ranks.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Light {
    /// As [`Light::Ask`] or by ghost zones, whichever is estimated to be cheaper. `frames` will be rendered before the scene changes.
    Auto {
        /// Frames that share the cost of building ghost zones.
        frames: u32,
    },
    /// Ask the ranks whose bounds light rays come into: exact for every effect.
    #[default]
    Ask,
    /// Every rank also holds what is within the distance of ambient occlusion around its part, and answers alone. Exact, but only for ambient
    /// occlusion of limited distance; other scenes ask.
    Ghost,
    /// Only the rank that was hit is asked: wrong near the borders of parts, as rendering without any of this is. For comparison.
    LocalOnly,
}

/// How a frame is made.
#[derive(Clone, Debug)]
pub struct FrameOptions {
    /// Who gets the picture; `None` to make it and keep it nowhere (for measuring).
    pub root: Option<usize>,
    /// Longest wait for one message.
    pub timeout: Duration,
    /// How light crosses borders.
    pub light: Light,
    /// Messages travel while rays are traced, and finished tiles while others are not. Off, one thing after the other: for comparison.
    pub stream: bool,
    /// Use rayon's threads within a rank. Off, a rank is one thread: for many ranks in one process.
    pub parallel: bool,
    /// How boxes are built where a rank needs another structure (ghost zones).
    pub build: rt_core::bvh::BuildOptions,
}

impl Default for FrameOptions {
    fn default() -> Self {
        FrameOptions {
            root: Some(0),
            timeout: Duration::from_secs(60),
            light: Light::default(),
            stream: true,
            parallel: false,
            build: rt_core::bvh::BuildOptions::default(),
        }
    }
}

/// One rank's result of a frame.
#[derive(Clone, Debug)]
pub struct FrameOutput {
    /// The picture, on the root.
    pub frame: Option<Frame>,
    /// What it cost this rank.
    pub report: RankReport,
}

/// One rank of a group that renders a scene in parts.
pub struct DataParallel {
    part: Part,
    options: FrameOptions,
    boxes: Boxes,
    /// Why light crosses borders as it does; empty until the first frame that has such light.
    choice: Option<ghost::Choice>,
}

/// One rank's view of the frame in work.
pub(super) struct Side<'a> {
    pub(super) frame: &'a DistributedFrame<'a>,
    pub(super) part: &'a Part,
    pub(super) parallel: bool,
}

impl Side<'_> {
    /// Number in the whole of this part's primitive.
    pub(super) fn in_whole(&self, instance: u32, primitive: u32) -> u32 {
        let geometry = self.part.scene.world.instances()[instance as usize].geometry;
        self.part.kept[geometry][primitive as usize]
    }
}

impl DataParallel {
    /// Tells all ranks the bounds of all parts. All ranks must call it, and [`DataParallel::frame`] with the same arguments.
    ///
    /// # Errors
    /// [`FrameError::Ranks`] when there are not as many ranks as parts, or the transport's.
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
        let mut talk = Talk::new(comm, options.timeout);
        let all = talk.all_gather(&numbers)?;
        let vector = |w: &[u32]| Vec3::new(f32::from_bits(w[0]), f32::from_bits(w[1]), f32::from_bits(w[2]));
        let bounds: Vec<Aabb> = all.iter().map(|w| Aabb::new(vector(&w[..3]), vector(&w[3..]))).collect();
        // No ray would come into such a box: the rank would be left out without a word.
        if let Some(from) = bounds.iter().position(|b| b.min.is_nan() || b.max.is_nan()) {
            let error = talk.wrong(from, "bounds of its part", numbers.len());
            talk.abort(&error.to_string());
            return Err(error);
        }
        let boxes = Boxes::new(bounds, part.scene.world.bounds());
        Ok(DataParallel { part, options, boxes, choice: None })
    }

    /// What this rank holds.
    pub fn part(&self) -> &Part {
        &self.part
    }

    /// Renders one frame together with all other ranks.
    ///
    /// # Errors
    /// Any fault on any rank ends the frame for all.
    pub fn frame(
        &mut self,
        comm: &mut dyn Communicator,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<FrameOutput, FrameError> {
        let mut talk = Talk::new(comm, self.options.timeout);
        let result = self.render(&mut talk, camera, options);
        if let Err(error) = &result {
            talk.abort(&error.to_string());
        }
        let frame = result?;
        Ok(FrameOutput { frame, report: talk.report })
    }

    fn render(
        &mut self,
        talk: &mut Talk<'_>,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<Option<Frame>, FrameError> {
        let way = self.way_of_light(talk, camera, options)?;
        let part = &self.part;
        let frame = DistributedFrame::new(&part.scene, part.needed, camera, options)?;
        let side = Side { frame: &frame, part, parallel: self.options.parallel };
        let rim = match (&part.rim, way) {
            (Some((_, scene)), Light::Ghost) => {
                Some(DistributedFrame::new(scene, part.needed, camera, options)?)
            }
            _ => None,
        };
        talk.report.effects = frame.effects();
        talk.report.warnings = frame.warnings().to_vec();
        let media = frame.media();
        if media.contains(&false) {
            let words = "volumes that are no medium (maxima, minima, means, sums, isosurfaces) are not cut: every rank holds them whole";
            talk.report.warnings.push(words.into());
        }
        let owners = Owners::new(&frame, &self.boxes.bounds);
        let mine = owners.tiles[talk.rank()].clone();
        let mut tiles: Vec<TileState> = mine.map(|t| frame.tile(t)).collect();
        talk.spent(Activity::Render);

        let passes = frame.passes();
        for (number, &pass) in passes.iter().enumerate() {
            let local = frame.needs_only_local_light() && pass != Pass::Geometry;
            let record = frame.records_geometry(pass);
            let stream = self.options.stream;
            let wanted = camera_wave::Wanted { pass, colors: local, whole_hits: record || !local, stream };
            // Tiles of the last pass go to the root as they are finished.
            if stream && local && !record && number + 1 == passes.len() {
                let mut collect = Collect::new(talk, &side, &owners, &mut tiles, self.options.root)?;
                camera_wave::run(talk, &side, &owners, wanted, Some(&mut collect))?;
                let picture = collect.into_picture();
                for tile in &tiles {
                    talk.report.rays += tile.stats();
                }
                return Ok(picture);
            }
            let answers = camera_wave::run(talk, &side, &owners, wanted, None)?;
            let rank = talk.rank();
            let fits = |source| FrameError::Answer { rank, source };
            each(talk, side.parallel, &mut tiles, |_, tile| tile.begin(&frame, pass));
            if local {
                for (tile, answer) in tiles.iter_mut().zip(&answers) {
                    tile.select_colors(&frame, &answer.colors()).map_err(fits)?;
                    if record {
                        tile.record_geometry(&answer.met);
                    }
                }
                talk.spent(Activity::Shade);
                continue;
            }
            let media = pass != Pass::Geometry && media.contains(&true);
            let mut wave =
                waves::Wave { side: &side, boxes: &self.boxes, way, rim: rim.as_ref(), media, pass };
            wave.run(talk, &mut tiles, answers)?;
        }
        for tile in &tiles {
            talk.report.rays += tile.stats();
        }
        Collect::new(talk, &side, &owners, &mut tiles, self.options.root)?.all(talk, &owners)
    }

    /// Decides, once and on all ranks alike, how light crosses borders, and builds what that needs.
    fn way_of_light(
        &mut self,
        talk: &mut Talk<'_>,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<Light, FrameError> {
        let probe = DistributedFrame::new(&self.part.scene, self.part.needed, camera, options)?;
        let distance = probe.ambient_occlusion_only_distance().filter(|d| d.is_finite());
        let secondary = !probe.needs_only_local_light();
        drop(probe);
        let Some(distance) = distance.filter(|_| self.options.light != Light::LocalOnly) else {
            let (way, words) = match self.options.light {
                Light::LocalOnly => (Light::LocalOnly, "local geometry only: wrong near borders"),
                _ if !secondary => (Light::Ask, "no light crosses borders"),
                Light::Ask => (Light::Ask, "asked of the ranks in whose bounds rays come"),
                _ => (
                    Light::Ask,
                    "asked of the ranks in whose bounds rays come: ghost zones do for ambient occlusion of limited distance only",
                ),
            };
            talk.report.light = words.into();
            return Ok(way);
        };
        if self.choice.as_ref().is_none_or(|c| c.distance != distance) {
            self.choice =
                Some(ghost::choose(talk, &mut self.part, &self.boxes, &self.options, options, distance)?);
        }
        let choice = self.choice.as_ref();
        talk.report.light = choice.map(|c| c.words.clone()).unwrap_or_default();
        Ok(choice.map_or(Light::Ask, |c| c.way))
    }
}

/// Calls `f` with every item and its place, on several threads if wanted; each item done is a sign of life.
pub(super) fn each<T: Send>(
    talk: &mut Talk<'_>,
    parallel: bool,
    items: &mut [T],
    f: impl Fn(usize, &mut T) + Sync,
) {
    if parallel {
        talk.beside(|steps| {
            items.par_iter_mut().enumerate().for_each(|(i, item)| {
                f(i, item);
                steps.fetch_add(1, Ordering::Relaxed);
            });
        });
    } else {
        items.iter_mut().enumerate().for_each(|(i, item)| {
            f(i, item);
            talk.alive();
        });
    }
}
