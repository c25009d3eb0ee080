//! One renderer of the program: what it draws in this frame, what is cached from earlier frames,
//! and the image.
//!
//! A frame consists of [`Bridge::begin`], one call for each object to draw, and [`Bridge::render`]
//! (thesis section 3.2.2: one frame per render event). The bridge caches acceleration structures by
//! the key of their arrays, colours by their own key, and the whole image while nothing changes.

mod error;

pub use error::BridgeError;

use crate::assemble::{Assembled, assemble};
use crate::colors::{self, MeshColors};
use crate::geometry::{self, GeometrySet};
use crate::input::{Color, SceneLight, Surface, View};
use crate::lights;
use crate::options::Options;
use crate::report::{FrameReport, TracedItem, UntracedItem};
use crate::window_image::WindowImage;
use rt_core::bvh::{BuildOptions, Geometry, World};
use rt_core::camera::{Camera, ThinLens};
use rt_core::effects::Effects;
use rt_core::glam::{DAffine3, DMat4};
use rt_core::render::{RenderOptions, Renderer};
use rt_core::scene::{AmbientOcclusion, Scene};
use rt_core::texture::Texture;
use std::collections::{HashMap, HashSet};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;
use std::time::Instant;

/// A cache entry with the frame that last used it.
struct CacheEntry<T> {
    value: T,
    frame: u64,
}

/// A surface of this frame with all references resolved.
pub(crate) struct FrameSurface {
    pub(crate) built: Arc<GeometrySet>,
    pub(crate) color: Option<MeshColors>,
    pub(crate) texture: Option<Arc<Texture>>,
    pub(crate) maps: Option<crate::materials::PbrTextures>,
    pub(crate) property: crate::input::Property,
    pub(crate) back: Option<crate::input::Property>,
    pub(crate) world_from_data: DAffine3,
    /// Matrix and colour of each copy; `None` without copies.
    pub(crate) glyphs: Option<Vec<(DAffine3, Option<[u8; 4]>)>>,
}

/// Result of [`Bridge::add_surface`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AddOutcome {
    /// It will be ray traced.
    Traced,
    /// It has nothing that can be ray traced, for this reason.
    Nothing(&'static str),
}

/// Renders the surfaces, volumes and lights of one renderer; see the module's page.
#[derive(Default)]
pub struct Bridge {
    options: Options,
    frame: u64,
    surfaces: Vec<FrameSurface>,
    lights: Vec<SceneLight>,
    /// Hash of everything that was added this frame.
    content: DefaultHasher,
    geometries: HashMap<u64, CacheEntry<Arc<GeometrySet>>>,
    colors: HashMap<(u64, u64), CacheEntry<Option<MeshColors>>>,
    textures: HashMap<u64, CacheEntry<Option<Arc<Texture>>>>,
    volume_cache: crate::volumes::VolumeCache,
    world: Option<(Arc<World>, Vec<rt_core::bvh::Instance>, BuildOptions)>,
    renderer: Renderer,
    pool: Option<(usize, rayon::ThreadPool)>,
    picture: WindowImage,
    /// Hash of what the image shows, and the number of frames averaged in it.
    shown: Option<(u64, u32)>,
    warned: HashSet<String>,
    /// Warnings that were not read yet.
    fresh_warnings: Vec<String>,
    pub(crate) report: FrameReport,
    /// Milliseconds by effect, for each set of effects that was measured.
    costs: HashMap<Vec<&'static str>, Vec<(String, f64)>>,
}

impl Bridge {
    /// A bridge with nothing in it.
    pub fn new() -> Bridge {
        Bridge::default()
    }

    /// Begins a frame with nothing to draw.
    pub fn begin(&mut self, options: &Options) {
        if self.options != *options {
            (self.options, self.shown) = (options.clone(), None);
        }
        self.frame += 1;
        self.surfaces.clear();
        self.volume_cache.begin();
        self.lights.clear();
        self.content = DefaultHasher::new();
        self.report = FrameReport { frame: self.frame, ..FrameReport::default() };
    }

    /// The options of this frame.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Adds a surface. Values that are not finite are repaired or left out, and reported.
    pub fn add_surface(&mut self, surface: &Surface<'_>) -> AddOutcome {
        let start = Instant::now();
        let Some(place) = affine(surface.world_from_data) else {
            self.warn(format!(
                "{}: its matrix is singular or not affine; it is not drawn",
                surface.name
            ));
            return AddOutcome::Nothing("singular matrix");
        };
        let key = surface.shape.key;
        let frame = self.frame;
        let built = match self.geometries.get_mut(&key).filter(|_| key != 0) {
            Some(kept) => {
                kept.frame = frame;
                Arc::clone(&kept.value)
            }
            None => {
                let built = Arc::new(self.in_pool(|| geometry::build(&surface.shape)));
                self.report.rebuilt += 1;
                if key != 0 {
                    self.geometries.insert(key, CacheEntry { value: Arc::clone(&built), frame });
                }
                built
            }
        };
        if built.skipped > 0 {
            self.warn(format!(
                "{}: {} triangles have a point that is not a number or does not exist; they are \
                 left out",
                surface.name, built.skipped
            ));
        }
        if built.mesh.is_none() && built.spheres.is_none() && built.tubes.is_none() {
            return AddOutcome::Nothing("no polygons");
        }
        let color = self.color(surface, &built);
        let texture = self.texture(surface.texture.as_ref());
        let maps = surface
            .maps
            .as_ref()
            .map(|maps| crate::materials::pbr_textures(maps, |image| self.texture(image)));
        let glyphs = surface.glyphs.as_ref().map(|g| {
            let places = g.matrices.iter().enumerate().filter_map(|(i, m)| {
                let local = affine(DMat4::from_cols_array(m).transpose())?;
                Some((place * local, g.rgba.get(i).copied()))
            });
            places.collect::<Vec<_>>()
        });
        self.hash_surface(surface);
        let count = glyphs.as_ref().map_or(1, Vec::len);
        self.report.traced.push(TracedItem {
            name: surface.name.to_owned(),
            triangles: built.mesh.as_ref().map_or(0, |m| m.mesh.indices.len()) * count,
            cells: 0,
            copies: count,
        });
        self.surfaces.push(FrameSurface {
            built,
            color,
            texture,
            maps,
            property: surface.property,
            back: surface.back,
            world_from_data: place,
            glyphs,
        });
        self.report.ms.extract += ms(start);
        AddOutcome::Traced
    }

    /// Adds a volume. If rt-core cannot draw it, the reason is returned.
    pub fn add_volume(&mut self, volume: &crate::input::Volume<'_>) -> Result<(), String> {
        let start = Instant::now();
        if self.options.path_tracing {
            return Err("a volume: RTV_MODE=path knows none".to_owned());
        }
        let place = affine(volume.world_from_data)
            .ok_or("a volume whose matrix is singular or not affine")?;
        let (mut volume_cache, mut content) =
            (std::mem::take(&mut self.volume_cache), self.content.clone());
        if volume.key == 0 {
            self.frame.hash(&mut content);
        }
        let added = self.in_pool(|| volume_cache.add(volume, place, &mut content));
        (self.volume_cache, self.content) = (volume_cache, content);
        let (cells, warning) = added?;
        if let Some(warning) = warning {
            self.warn(format!("{}: {warning}", volume.name));
        }
        self.report.traced.push(TracedItem {
            name: volume.name.to_owned(),
            triangles: 0,
            cells,
            copies: 1,
        });
        self.report.ms.extract += ms(start);
        Ok(())
    }

    /// Whether the scalars of this key are cached, so that the caller need not pass them again.
    pub fn has_volume(&self, key: u64) -> bool {
        self.volume_cache.has(key)
    }

    /// Whether colours of these keys are cached, so that the caller need not pass their arrays
    /// again.
    pub fn has_colors(&self, shape_key: u64, color_key: u64) -> bool {
        shape_key != 0 && color_key != 0 && self.colors.contains_key(&(shape_key, color_key))
    }

    fn texture(&mut self, image: Option<&crate::input::Image<'_>>) -> Option<Arc<Texture>> {
        let (image, frame) = (image?, self.frame);
        let kept = self
            .textures
            .entry(image.key)
            .or_insert_with(|| CacheEntry { value: colors::texture(image).map(Arc::new), frame });
        kept.frame = frame;
        kept.value.clone()
    }

    fn color(&mut self, surface: &Surface<'_>, built: &GeometrySet) -> Option<MeshColors> {
        let mesh = built.mesh.as_ref()?;
        let key = match surface.color {
            Color::Material => return None,
            Color::Values { key, .. } | Color::Mapped { key, .. } => (surface.shape.key, key),
        };
        let frame = self.frame;
        if let Some(kept) = self.colors.get_mut(&key).filter(|_| key.0 != 0 && key.1 != 0) {
            kept.frame = frame;
            return kept.value.clone();
        }
        let resolved =
            self.in_pool(|| colors::resolve(&surface.color, mesh, surface.shape.points.len()));
        let value = resolved.unwrap_or_else(|fault| {
            self.warn(format!("{}: {fault}", surface.name));
            None
        });
        self.colors.insert(key, CacheEntry { value: value.clone(), frame });
        value
    }

    fn hash_surface(&mut self, s: &Surface<'_>) {
        let h = &mut self.content;
        let color_key = match s.color {
            Color::Material => 0,
            Color::Values { key, .. } | Color::Mapped { key, .. } => key,
        };
        // A key of 0 means that nothing is known: such a frame never equals another.
        let unknown = s.shape.key == 0 || (color_key == 0 && !matches!(s.color, Color::Material));
        if unknown {
            self.frame.hash(h);
        }
        (s.shape.key, color_key, s.texture.map(|t| t.key)).hash(h);
        // The text of the numbers is as unique as the numbers.
        format!("{:?}{:?}{:?}", s.property, s.back, s.world_from_data).hash(h);
        if let Some(m) = &s.maps {
            [m.material, m.normal, m.emissive].map(|i| i.map(|i| i.key)).hash(h);
            format!("{:?}{:?}{:?}", m.normal_scale, m.occlusion_strength, m.emissive_factor)
                .hash(h);
        }
        if let Some(g) = &s.glyphs {
            g.rgba.hash(h);
            g.matrices.iter().flatten().for_each(|v| v.to_bits().hash(h));
        }
    }

    /// Adds a light.
    pub fn add_light(&mut self, light: SceneLight) {
        format!("{light:?}").hash(&mut self.content);
        self.lights.push(light);
    }

    /// Records for the report something that OpenGL draws, and why.
    pub fn report_untraced(&mut self, name: &str, reason: &str) {
        self.report.passed.push(UntracedItem { name: name.to_owned(), reason: reason.to_owned() });
    }

    /// The number of surfaces added this frame.
    pub fn num_surfaces(&self) -> usize {
        self.surfaces.len()
    }

    /// Adds a warning to the report. [`Bridge::take_warnings`] returns each text only once.
    pub fn warn(&mut self, text: String) {
        self.report.warnings.push(text.clone());
        if self.warned.insert(text.clone()) {
            self.fresh_warnings.push(text);
        }
    }

    /// Returns the warnings since the last call.
    pub fn take_warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.fresh_warnings)
    }

    /// The report of this frame.
    pub fn report(&self) -> &FrameReport {
        &self.report
    }

    /// Renders what was added. The image stays valid until the next call.
    pub fn render(&mut self, view: &View) -> Result<&WindowImage, BridgeError> {
        self.make_pool()?;
        let frame = self.frame;
        self.geometries.retain(|_, k| k.frame == frame);
        self.colors.retain(|_, k| k.frame == frame);
        self.textures.retain(|_, k| k.frame == frame);
        self.volume_cache.forget_unused();

        // ---- Nothing changed: reuse the image or refine it.
        format!("{view:?}").hash(&mut self.content);
        let content = self.content.finish();
        let mut mean_of = 0;
        if let Some((shown, frames)) = self.shown
            && shown == content
        {
            if frames >= self.options.progressive || view.interactive {
                self.report.reused = true;
                return Ok(&self.picture);
            }
            mean_of = frames;
        }
        let result = self.draw(view, mean_of);
        self.shown = result.is_ok().then_some((content, mean_of + 1));
        result?;
        Ok(&self.picture)
    }

    fn draw(&mut self, view: &View, mean_of: u32) -> Result<(), BridgeError> {
        let options = self.options.clone();
        let shadows = options.shadows || view.shadows;
        let headlight_only = matches!(self.lights.as_slice(), [only] if only.headlight);
        let start = Instant::now();
        let Assembled { geometries, instances, appearances, materials, encodings, mut edges } =
            assemble(&self.surfaces, &options, headlight_only, self.lights.is_empty());
        let world = self.world(geometries, instances)?;
        self.report.ms.build += ms(start);
        self.report.bytes = world.report().bytes;

        // ---- The scene.
        let start = Instant::now();
        let mut scene = Scene::new(Arc::clone(&world));
        scene.appearances = appearances;
        scene.lights = lights::lights(&self.lights, shadows, &options);
        if options.ao > 0 || crate::assemble::any_ambient(&materials) {
            scene.lights.push(rt_core::light::Light::ambient([1.0; 3]));
        }
        scene.materials = materials;
        scene.volumes = self.volume_cache.placed().to_vec();
        if !scene.volumes.is_empty()
            && encodings.iter().any(|e| *e != crate::materials::Encoding::Direct)
        {
            self.warn(
                "volumes in front of physically based surfaces: these encode their colours (power \
                 1/2.2), and what the volume adds there is encoded with them"
                    .to_owned(),
            );
        }
        if options.ao > 0 && !options.path_tracing {
            let automatic = 0.2 * world.bounds().extent().as_dvec3().length();
            let distance = options.ao_radius.unwrap_or(if automatic > 0.0 {
                automatic
            } else {
                f64::INFINITY
            });
            scene.ambient_occlusion = Some(AmbientOcclusion { distance, rays: options.ao });
        }
        let camera = self.camera(view, &options)?;

        // ---- Which of the requested effects the scene needs.
        let needed = Effects::required_by(&scene) | Effects::required_by_camera(&camera);
        let mirrors = Effects::REFLECTION | Effects::GLOSSY_REFLECTION;
        let effects = if crate::assemble::wants_reflections(&options) {
            needed
        } else {
            needed.without(mirrors)
        };
        if effects.intersects(mirrors | Effects::REFRACTION) || options.path_tracing {
            scene.background = WindowImage::gradient_background(view);
        }
        let secondary =
            mirrors | Effects::REFRACTION | Effects::SHADOWS | Effects::AMBIENT_OCCLUSION;
        if effects.intersects(secondary) && crate::report::ranks() > 1 {
            self.warn(
                "several ranks: shadows, ambient occlusion, mirrors and glass see only the data of \
                 their own rank; run on one rank for the \
                 whole"
                    .to_owned(),
            );
        }
        if shadows && !effects.contains(Effects::SHADOWS) {
            self.warn(
                "shadows change no pixel: the only lights are headlights, whose shadows are left \
                 out; add a light (vtkLight, vtkLightKit, \
                 ParaView's light kit)"
                    .to_owned(),
            );
        }
        let mut render = RenderOptions::new(view.width, view.height);
        render.samples =
            if view.interactive { 1 } else { options.samples.max(view.samples).max(1) };
        render.path_tracing = options.path_tracing;
        render.max_bounces = options.max_bounces;
        render.seed = options.seed.wrapping_add(u64::from(mean_of) << 32);
        render.effects = Some(effects);
        let lines = crate::assemble::lit_lines(&scene, &mut edges, &encodings);
        let inputs = RenderInputs {
            scene: &scene,
            lines: lines.as_ref(),
            camera: &camera,
            options: render,
            averaged: options.progressive > 1,
            encodings: &encodings,
            edges: &edges,
        };

        // ---- Trace the rays and convert the image for the window.
        let (mut renderer, mut picture) =
            (std::mem::take(&mut self.renderer), std::mem::take(&mut self.picture));
        let outcome = self.in_pool(|| picture.draw(&mut renderer, &inputs, view, mean_of));
        (self.renderer, self.picture) = (renderer, picture);
        let outcome = outcome?;
        self.report.ms.trace += outcome.trace_ms;
        self.report.ms.convert += outcome.convert_ms;
        self.report.effects = effects.names().map(str::to_owned).collect();
        self.report.rays = crate::report::rays(&outcome.rays);
        for w in outcome.warnings {
            // The effects were not requested one by one, so missing reflections are deliberate, and
            // other effects may not be in view. Interpolating an alpha of 1 at all corners gives
            // slightly less than 1 inside.
            let of_no_use = ["left out", "drawn opaque", "changed no pixel of this picture"];
            if !of_no_use.iter().any(|t| w.contains(t)) {
                self.warn(w);
            }
        }
        if self.options.report.is_some() {
            self.measure_effects(&inputs, effects);
        }
        self.report.ms.frame = self.report.ms.extract + self.report.ms.build + ms(start);
        Ok(())
    }

    /// Measures the cost of each effect: renders the same image without it, once for each set of
    /// effects.
    fn measure_effects(&mut self, inputs: &RenderInputs<'_>, effects: Effects) {
        let names: Vec<&'static str> = effects.names().collect();
        if !self.costs.contains_key(&names) {
            let mut renderer = Renderer::new();
            let mut time = |e: Effects| {
                let options = RenderOptions { effects: Some(e), ..inputs.options.clone() };
                let start = Instant::now();
                let ok =
                    self.in_pool(|| renderer.render(inputs.scene, inputs.camera, &options)).is_ok();
                ok.then(|| ms(start))
            };
            let whole = time(effects);
            let costs = Effects::ALL.iter().filter(|(e, _)| effects.contains(*e)).filter_map(
                |(e, name)| {
                    let without = effects.without(*e);
                    // Soft shadows count as shadows.
                    let without = if *e == Effects::SHADOWS {
                        without.without(Effects::SOFT_SHADOWS)
                    } else {
                        without
                    };
                    Some(((*name).to_owned(), (whole? - time(without)?).max(0.0)))
                },
            );
            let costs = costs.collect();
            self.costs.insert(names.clone(), costs);
        }
        self.report.ms_by_effect = self.costs.get(&names).cloned().unwrap_or_default();
    }

    fn camera(&mut self, view: &View, options: &Options) -> Result<Camera, BridgeError> {
        let camera = Camera::from_matrix(view.clip_from_world)?;
        // Elsewhere it is where the rays come from.
        let viewer = view.viewer.filter(|_| camera.eye().is_none());
        let camera = camera.with_viewer(viewer);
        let focus = options.focus.or(view.lens.map(|l| l.focus_distance));
        let aperture = if options.aperture > 0.0 { options.aperture } else { 0.0 };
        let Some(focus_distance) = focus.filter(|_| aperture > 0.0) else { return Ok(camera) };
        match camera.with_lens(ThinLens { aperture_radius: aperture, focus_distance }) {
            Ok(camera) => Ok(camera),
            Err(e) => {
                self.warn(format!("depth of field is left out: {e}"));
                Ok(camera)
            }
        }
    }

    /// The world of these instances: the existing one, or a new one that shares as many trees as
    /// possible.
    fn world(
        &mut self,
        geometries: Vec<Geometry>,
        instances: Vec<rt_core::bvh::Instance>,
    ) -> Result<Arc<World>, BridgeError> {
        let build = BuildOptions {
            quality: self.options.build,
            robustness: self.options.robustness,
            ..BuildOptions::default()
        };
        if let Some((world, placed, options)) = &self.world
            && *placed == instances
            && *options == build
            && same_geometries(world.geometries(), &geometries)
        {
            return Ok(Arc::clone(world));
        }
        let mut previous = self.world.take().map(|(w, ..)| w);
        let shares =
            |w: &Arc<World>| geometries.iter().any(|g| w.geometries().iter().any(|h| same(g, h)));
        if !previous.as_ref().is_some_and(shares) {
            // Nothing can be shared. Free the old trees first, so that both sets are never in
            // memory.
            previous = None;
        }
        let list = instances.clone();
        let built =
            self.in_pool(|| World::build_sharing(geometries, list, &build, previous.as_deref()));
        let world = Arc::new(built?);
        self.world = Some((Arc::clone(&world), instances, build));
        Ok(world)
    }

    fn make_pool(&mut self) -> Result<(), BridgeError> {
        let Some(threads) = self.options.threads else {
            self.pool = None;
            return Ok(());
        };
        if self.pool.as_ref().is_none_or(|(n, _)| *n != threads) {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let pool = pool.map_err(|e| BridgeError::Threads { threads, reason: e.to_string() })?;
            self.pool = Some((threads, pool));
        }
        Ok(())
    }

    fn in_pool<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match &self.pool {
            Some((_, pool)) => pool.install(work),
            None => work(),
        }
    }
}

/// All inputs of an image.
pub(crate) struct RenderInputs<'a> {
    pub(crate) scene: &'a Scene,
    /// See [`crate::assemble::lit_lines`].
    pub(crate) lines: Option<&'a Scene>,
    pub(crate) camera: &'a Camera,
    pub(crate) options: RenderOptions,
    /// Later images will be averaged with this one.
    pub(crate) averaged: bool,
    /// One per instance.
    pub(crate) encodings: &'a [crate::materials::Encoding],
    /// One per instance, or empty.
    pub(crate) edges: &'a [Option<crate::edges::Edges>],
}

fn same(a: &Geometry, b: &Geometry) -> bool {
    match (a, b) {
        (Geometry::Mesh(a), Geometry::Mesh(b)) => Arc::ptr_eq(a, b),
        (Geometry::Shape(a), Geometry::Shape(b)) => {
            std::ptr::addr_eq(Arc::as_ptr(a), Arc::as_ptr(b))
        }
        _ => false,
    }
}

fn same_geometries(a: &[Geometry], b: &[Geometry]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b))
}

/// `m` as an invertible affine map.
fn affine(m: DMat4) -> Option<DAffine3> {
    let row = m.row(3);
    let scaled = DAffine3::from_mat4(m * row.w.recip());
    let det = scaled.matrix3.determinant();
    let ok = row.truncate() == rt_core::glam::DVec3::ZERO && row.w != 0.0;
    (ok && scaled.is_finite() && det != 0.0 && det.is_finite()).then_some(scaled)
}

pub(crate) fn ms(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}
