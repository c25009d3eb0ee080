//! Frames whose rays the caller traces: the shading of a tile stops where it needs what rays hit,
//! and goes on when the caller hands that over.
//!
//! [`crate::render::render`] traces every ray in one world. Here a tile asks with *wavefronts* of
//! rays: all that it can send before it needs an answer. So the answers may come from parts of the
//! scene in several places ([`Scene::part`], [`crate::bvh::World::build_part`]), and a scene may be
//! larger than the memory of one process. The same functions do the same arithmetic in the same
//! order as in [`crate::render::render`], so the image has the same bits. How answers travel is the
//! caller's affair: everything that passes here is plain data.
//!
//! For each pass of [`DeferredFrame::passes`] and each tile:
//! 1. [`TileState::begin`] generates camera rays. [`TileState::process_hits`] takes the first hit
//!    of each of [`TileState::rays`].
//! 2. If light is requested, [`TileState::apply_occlusion`] takes one bit per light ray of
//!    [`TileState::light_points`]. Where light passes through surfaces,
//!    [`TileState::process_light_hits`] takes the hits of [`TileState::light_rays`] instead, layer
//!    by layer.
//! 3. [`TileState::advance`] shades and returns whether there is another wavefront.
//!
//! [`DeferredFrame::camera_hits`], [`DeferredFrame::closest`], [`DeferredFrame::occlusion_bits`]
//! and [`DeferredFrame::light_hits`] trace rays in the frame's scene or part. Of the hits of
//! several parts the closest one counts, at equal `t` the one with the lowest instance and
//! primitive.
//!
//! ```
//! use rt_core::camera::Camera;
//! use rt_core::deferred::{DeferredFrame, OcclusionScratch, TILE_SIDE, TileState};
//! use rt_core::effects::Effects;
//! use rt_core::glam::{DVec3, Vec3};
//! use rt_core::light::Light;
//! use rt_core::mesh::TriMesh;
//! use rt_core::render::{RenderOptions, render};
//! use rt_core::scene::Scene;
//! use rt_core::bvh::{BuildOptions, World};
//!
//! // A triangle whose shadow falls on another one.
//! let corners = vec![Vec3::NEG_X, Vec3::X, Vec3::Y, Vec3::ZERO, Vec3::X * 9.0, Vec3::Y * 9.0];
//! let mut mesh = TriMesh::new(corners, vec![[0, 1, 2], [3, 4, 5]]);
//! mesh.positions[..3].iter_mut().for_each(|p| p.z = 1.0);
//! let mut scene = Scene::new(World::from_mesh(mesh, &BuildOptions::default())?);
//! scene.lights = vec![Light::directional(DVec3::new(-0.5, 0.0, 1.0))];
//! let eye = DVec3::new(0.5, 0.5, 9.0);
//! let camera = Camera::perspective(eye, DVec3::ZERO, DVec3::Y, 0.5, 1.0, [0.1, 100.0])?;
//! let options = RenderOptions::new(TILE_SIDE, TILE_SIDE);
//!
//! let frame = DeferredFrame::new(&scene, Effects::required_by(&scene), &camera, &options)?;
//! assert_eq!(frame.num_tiles(), 1);
//! let mut tile: TileState = frame.tile(0);
//! for pass in frame.passes() {
//!     tile.begin(&frame, pass);
//!     loop {
//!         let waiting: Vec<_> = tile.rays().collect();
//!         let rays: Vec<_> = waiting.iter().map(|(.., ray)| *ray).collect();
//!         let (mut found, mut hits) = (Vec::new(), vec![None; tile.num_rays()]);
//!         frame.closest(&rays, None, &mut found);
//!         for ((place, ..), hit) in waiting.iter().zip(found) {
//!             hits[*place] = hit;
//!         }
//!         tile.process_hits(&frame, &hits)?;
//!         let (mut scratch, mut bits) = (OcclusionScratch::default(), Vec::new());
//!         frame.occlusion_bits(tile.light_points(), pass, &mut scratch, &mut bits);
//!         tile.apply_occlusion(&frame, &bits)?;
//!         if !tile.advance(&frame) {
//!             break;
//!         }
//!     }
//! }
//! assert_eq!(tile.image(&frame).color, render(&scene, &camera, &options)?.frame.color);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod hits;
mod tile_state;
mod tracing;

pub use crate::surface::SurfacePoint;
pub use hits::{LightHit, LightPoint, ShadingHit};
pub use tile_state::{AnswerError, TileState};
pub use tracing::{CameraHits, OcclusionScratch};

use super::frame_context::FrameContext;
use super::tile::{TILE, TileArea};
use super::{Layers, local, volumes};
use crate::camera::Camera;
use crate::effect_plan::plan_for;
use crate::effects::Effects;
use crate::ray::Ray;
use crate::render_error::RenderError;
use crate::render_options::{Crop, RenderOptions};
use crate::scene::Scene;
use crate::volume::Volume;

/// Pixels along the side of a tile. Its slots, one per pixel, follow a Morton curve.
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

    /// The volumes of the frame, each with `ray`, which is in render space, in its object space.
    /// The parameter means the same point for all, as
    /// [`RaySegments`](crate::volume::RaySegments) and
    /// [`composite_projections`](crate::volume::composite_projections) need it.
    pub fn volumes_along(&self, ray: Ray) -> impl Iterator<Item = (&'a Volume, Ray)> {
        self.context.volumes.iter().map(move |(volume, object_from_render)| {
            (*volume, volumes::in_object_space(&ray, object_from_render))
        })
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

    /// True when colours need nothing but camera rays. [`CameraHits::colors`] then computes the
    /// colours of the hits, and [`TileState::select_colors`] takes those of the closest.
    pub fn needs_only_local_light(&self) -> bool {
        local::has_no_effect(&self.context)
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
}
