//! Renders frames whose rays the caller traces, for scenes distributed over several processes.
//!
//! [`crate::render::render`] traces every ray in one world. Here the caller answers the rays, so a
//! scene may be larger than the memory of one process. *Data servers* hold parts of the scene (see
//! [`crate::bvh::World::build_part`]) and answer what rays hit. *Tile owners* own a part of the
//! image and do everything else. Rays are traced in wavefronts: all rays that a tile can send
//! before it needs an answer. The same functions do the same arithmetic in the same order as in a
//! frame of one process, so the image has the same bits.
//!
//! For each tile, its owner does the following:
//! 1. It calls [`TileState::begin`], requests the first hit of each of [`TileState::rays`], and
//!    passes the answers to [`TileState::process_hits`].
//! 2. If light is to be requested, it requests either one bit per ray of
//!    [`TileState::light_points`] ([`TileState::apply_occlusion`]) or, where light passes through
//!    surfaces, [`TileState::light_rays`] layer by layer ([`TileState::process_light_hits`]).
//! 3. It calls [`TileState::advance`], which shades and returns whether there is another wavefront.
//!
//! Data servers answer with [`DeferredFrame::camera_hits`], [`DeferredFrame::closest`],
//! [`DeferredFrame::occlusion_bits`] and [`DeferredFrame::light_hits`].

mod hits;
mod messages;
mod tile_state;
mod tracing;

pub use hits::{LightPoint, ShadingHit};
pub use tile_state::{AnswerError, TileState, VolumeRay};
pub use tracing::{CameraHits, OcclusionScratch};

use super::frame_context::FrameContext;
use super::tile::{TILE, TileArea};
use super::{Layers, local, volumes};
use crate::camera::Camera;
use crate::effects::Effects;
use crate::frame::Frame;
use crate::math::Aabb;
use crate::ray::Ray;
use crate::render::{Crop, RenderError, RenderOptions, plan_for};
use crate::scene::Scene;
use crate::volume::{RaySegments, Volume, VolumeQuality, VolumeSample, composite_projections};
use glam::{DAffine3, DVec3};

/// Pixels along the side of a tile.
pub const TILE_SIDE: u32 = TILE;

/// One pass of rays over the whole image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pass {
    /// Rays through the pixels' centres, for depth, normals and ids.
    Geometry,
    /// Colour of this sample.
    Color(u32),
}

/// A scene, or a part of one, prepared for one frame.
pub struct DeferredFrame<'a> {
    context: FrameContext<'a>,
    tiles: Vec<TileArea>,
    warnings: Vec<String>,
}

impl<'a> DeferredFrame<'a> {
    /// Checks all arguments. `needed` are the effects that the whole scene needs
    /// ([`Effects::required_by`]): a part may seem to need fewer.
    ///
    /// # Errors
    /// As [`crate::render::render`]; and [`RenderError::Unsupported`] for options that end a frame
    /// early, which no single process can decide.
    pub fn new(
        scene: &'a Scene,
        needed: Effects,
        camera: &Camera,
        options: &'a RenderOptions,
    ) -> Result<DeferredFrame<'a>, RenderError> {
        let mut plan = plan_for(scene, needed, camera, options)?;
        if scene.materials.iter().any(|m| m.maps.is_some())
            && !plan.effects.without(Effects::DEPTH_OF_FIELD).is_empty()
        {
            plan.warnings.push(
                "maps of roughness, metalness, emission and occlusion are left out where several \
                 render a frame with shadows or reflections: only bent \
                 normals travel"
                    .into(),
            );
        }
        if options.time_limit.is_some()
            || options.max_error_levels.is_some()
            || options.cancel.is_some()
        {
            return Err(RenderError::Unsupported {
                what: "stopping early (time_limit, max_error_levels, cancel)",
                with: "in a frame that several render together",
                cure: "leave these options out and give the number of samples",
            });
        }
        if camera.is_omnidirectional() {
            return Err(RenderError::Unsupported {
                what: "a panorama (omnidirectional camera)",
                with: "in a frame that several render together",
                cure: "render it in one process, or with six perspective cameras",
            });
        }
        let Crop { x: left, y: top, width, height } = options.area();
        let mut tiles = Vec::new();
        for y in (0..height).step_by(TILE as usize) {
            for x in (0..width).step_by(TILE as usize) {
                let (width, height) = (TILE.min(width - x), TILE.min(height - y));
                tiles.push(TileArea { x: left + x, y: top + y, width, height, sample: 0 });
            }
        }
        Ok(DeferredFrame {
            context: FrameContext::new(scene, camera, options, plan.effects),
            tiles,
            warnings: plan.warnings,
        })
    }

    /// Effects that run.
    pub fn effects(&self) -> Effects {
        self.context.effects
    }

    /// Warnings about requests that change nothing.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// For each volume of the frame, whether it is a medium. Media may be held in bricks;
    /// projections need whole volumes.
    pub fn media(&self) -> Vec<bool> {
        self.context.volumes.iter().map(|(volume, _)| volume.is_medium()).collect()
    }

    /// The segments of a ray, in render space, through the volumes up to `t_end`. `held` may give a
    /// brick that replaces the scene's volume.
    pub fn ray_segments<'v>(
        &'v self,
        ray: &Ray,
        t_end: f32,
        held: impl Fn(usize) -> Option<&'v Volume>,
    ) -> RaySegments<'v> {
        let place = |(i, (volume, object_from_render)): (usize, &(&'v Volume, DAffine3))| {
            (held(i).unwrap_or(volume), volumes::in_object_space(ray, object_from_render))
        };
        RaySegments::new(
            self.context.volumes.iter().enumerate().map(place).collect(),
            ray.t_min,
            t_end,
        )
    }

    /// The result of a ray that collects `mixed` in the media, after projections are composited;
    /// projections need their whole volumes here. Without projections, the result is `mixed`.
    pub fn composite_projections(
        &self,
        ray: &Ray,
        t_end: f32,
        mixed: VolumeSample,
    ) -> VolumeSample {
        if self.context.volumes.iter().all(|(volume, _)| volume.is_medium()) {
            return mixed;
        }
        let place = |(volume, object_from_render): &(&'a Volume, DAffine3)| {
            (*volume, volumes::in_object_space(ray, object_from_render))
        };
        let resolved: Vec<_> = self.context.volumes.iter().map(place).collect();
        match resolved[..] {
            [(volume, ray)] => volume.integrate(&ray, ray.t_min, t_end, self.volume_quality()),
            _ => composite_projections(&resolved, ray.t_min, t_end, self.volume_quality(), mixed),
        }
    }

    /// Accuracy of volume integration.
    pub fn volume_quality(&self) -> &VolumeQuality {
        &self.context.options.volume_quality
    }

    /// Instances of the scene, the same in every part.
    pub fn num_instances(&self) -> usize {
        self.context.instances.len()
    }

    /// Number of tiles. They are numbered row by row from the top left.
    pub fn num_tiles(&self) -> usize {
        self.tiles.len()
    }

    /// Pixels of tile `tile`.
    pub fn tile_area(&self, tile: usize) -> Crop {
        let TileArea { x, y, width, height, .. } = self.tiles[tile];
        Crop { x, y, width, height }
    }

    /// The passes of this frame, in order.
    pub fn passes(&self) -> Vec<Pass> {
        let options = self.context.options;
        let colors = if options.layers.contains(Layers::COLOR) { options.samples } else { 0 };
        let geometry = self.wants_geometry() && !self.recorded_with_color();
        geometry.then_some(Pass::Geometry).into_iter().chain((0..colors).map(Pass::Color)).collect()
    }

    /// True when colours need nothing but camera rays. Data servers then compute the colours of
    /// their own hits ([`CameraHits::colors`]), and tile owners only select among them
    /// ([`TileState::select_colors`]).
    pub fn needs_only_local_light(&self) -> bool {
        local::is_sufficient(&self.context)
    }

    /// True when [`Pass::Color`] also fills the geometry layers, from the hits passed to
    /// [`TileState::record_geometry`] or to `process_hits`.
    pub fn records_geometry(&self, pass: Pass) -> bool {
        match pass {
            Pass::Geometry => true,
            Pass::Color(sample) => {
                sample == 0 && self.wants_geometry() && self.recorded_with_color()
            }
        }
    }

    /// True when light rays pass through surfaces and are therefore traced layer by layer.
    pub fn light_passes_surfaces(&self) -> bool {
        self.context.light_passes_surfaces()
    }

    /// Number of light rays that a point may send, which is the number of bits per point in
    /// [`DeferredFrame::occlusion_bits`].
    pub fn light_rays_per_point(&self) -> u32 {
        self.context.sky_number + self.sky_rays()
    }

    /// The distance limit of ambient occlusion, when its rays are the only ones that leave a camera
    /// ray's hit.
    pub fn ambient_occlusion_only_distance(&self) -> Option<f64> {
        let alone =
            self.context.effects.without(Effects::DEPTH_OF_FIELD) == Effects::AMBIENT_OCCLUSION;
        self.context.scene.ambient_occlusion.filter(|_| alone).map(|ao| ao.distance)
    }

    fn sky_rays(&self) -> u32 {
        let ao = self.context.scene.ambient_occlusion;
        let traced = self.context.effects.contains(Effects::AMBIENT_OCCLUSION);
        ao.filter(|_| traced).map_or(0, |ao| ao.rays)
    }

    fn centered(&self) -> bool {
        self.context.options.samples <= 1 && !self.context.effects.contains(Effects::DEPTH_OF_FIELD)
    }

    fn wants_geometry(&self) -> bool {
        self.context.options.layers.intersects(Layers::GEOMETRY)
    }

    fn recorded_with_color(&self) -> bool {
        self.centered() && self.context.options.layers.contains(Layers::COLOR)
    }

    /// The sample number that a pass aims at; `None` for the pixel centres.
    fn sample_of(&self, pass: Pass) -> Option<u32> {
        match pass {
            Pass::Color(sample) if !self.centered() => Some(sample),
            _ => None,
        }
    }

    /// Bounds of the geometry of this scene or part, render space.
    pub fn own_bounds(&self) -> Aabb {
        self.context.scene.world.own_bounds()
    }

    /// For each tile, whether one of its camera rays can hit `bounds` (render space).
    pub fn tiles_overlapping(&self, bounds: Aabb) -> Vec<bool> {
        if bounds.is_empty() {
            return vec![false; self.tiles.len()];
        }
        let everywhere = vec![true; self.tiles.len()];
        if self.context.effects.contains(Effects::DEPTH_OF_FIELD) {
            return everywhere;
        }
        let matrix = self.context.camera.clip_from_world();
        let (mut lo, mut hi) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for corner in bounds.corners() {
            let world = self.context.origin + corner.as_dvec3();
            let row = |r: usize| matrix.row(r).truncate().dot(world) + matrix.row(r).w;
            let (x, y, w) = (row(0), row(1), row(3));
            // A corner to the side of or behind the eye has no position in the image.
            let reach = (world - self.eye()).length();
            let in_front =
                w.is_finite() && (w > 1e-6 * reach || self.context.camera.eye().is_none());
            if !in_front {
                return everywhere;
            }
            let size = [self.context.options.width, self.context.options.height].map(f64::from);
            let pixel = [(x / w + 1.0) * 0.5 * size[0], (1.0 - y / w) * 0.5 * size[1]];
            for a in 0..2 {
                (lo[a], hi[a]) = (lo[a].min(pixel[a]), hi[a].max(pixel[a]));
            }
        }
        // Rays may pass anywhere through their pixels, and are rounded to f32.
        let margin =
            1.0 + 1e-4 * f64::from(self.context.options.width.max(self.context.options.height));
        let meets = |t: &TileArea| {
            let (x, y) = (f64::from(t.x), f64::from(t.y));
            let right = x + f64::from(t.width) + margin;
            let below = y + f64::from(t.height) + margin;
            hi[0] >= x - margin && lo[0] <= right && hi[1] >= y - margin && lo[1] <= below
        };
        self.tiles.iter().map(meets).collect()
    }

    fn eye(&self) -> DVec3 {
        self.context.camera.eye().unwrap_or(self.context.origin)
    }

    // ---- The finished image ---------------------------------------------------------------------
    /// An image without any tile.
    pub fn blank_frame(&self) -> Frame {
        let area = self.context.options.area();
        let n = area.width as usize * area.height as usize;
        let has = |l| if self.context.options.layers.contains(l) { n } else { 0 };
        Frame {
            width: area.width,
            height: area.height,
            color: vec![[0.0; 4]; has(Layers::COLOR)],
            depth: vec![self.context.camera.background_depth() as f32; has(Layers::DEPTH)],
            distance: vec![f32::INFINITY; has(Layers::DISTANCE)],
            normal: vec![[0.0; 3]; has(Layers::NORMAL)],
            instance: vec![u32::MAX; has(Layers::IDS)],
            primitive: vec![u32::MAX; has(Layers::IDS)],
            cost: vec![0.0; has(Layers::COST)],
        }
    }

    /// Words per pixel in [`TileState::encode`].
    pub fn words_per_pixel(&self) -> usize {
        let sizes = [
            (Layers::COLOR, 4),
            (Layers::DEPTH, 1),
            (Layers::DISTANCE, 1),
            (Layers::NORMAL, 3),
            (Layers::IDS, 2),
            (Layers::COST, 1),
        ];
        sizes.iter().filter(|(l, _)| self.context.options.layers.contains(*l)).map(|(_, n)| n).sum()
    }

    /// Writes the words of [`TileState::encode`] for tile `tile` into the image. Returns false when
    /// the frame has no such tile or the length is wrong.
    #[must_use]
    pub fn decode_tile(&self, frame: &mut Frame, tile: usize, words: &[u32]) -> bool {
        let Some(t) = self.tiles.get(tile) else { return false };
        if words.len() != (t.width * t.height) as usize * self.words_per_pixel() {
            return false;
        }
        let area = self.context.options.area();
        let mut words = words.iter().copied();
        let mut next = || words.next().unwrap_or_default();
        for y in 0..t.height {
            for x in 0..t.width {
                let i =
                    (t.y - area.y + y) as usize * area.width as usize + (t.x - area.x + x) as usize;
                if let Some(c) = frame.color.get_mut(i) {
                    *c = std::array::from_fn(|_| f32::from_bits(next()));
                }
                for layer in [&mut frame.depth, &mut frame.distance] {
                    if let Some(v) = layer.get_mut(i) {
                        *v = f32::from_bits(next());
                    }
                }
                if let Some(n) = frame.normal.get_mut(i) {
                    *n = std::array::from_fn(|_| f32::from_bits(next()));
                }
                for layer in [&mut frame.instance, &mut frame.primitive] {
                    if let Some(v) = layer.get_mut(i) {
                        *v = next();
                    }
                }
                if let Some(c) = frame.cost.get_mut(i) {
                    *c = f32::from_bits(next());
                }
            }
        }
        true
    }
}
