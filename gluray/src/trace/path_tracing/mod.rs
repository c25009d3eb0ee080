//! Mode `path`: renders the frame's draws with rt-core's path tracer, for publication.
//!
//! Each view becomes a scene in eye space. The first image of a scene already has all the samples
//! that the settings ask for. When a program draws the same content again, it gets the mean of all
//! images so far, so an idle window becomes smoother. Equal runs give equal images.

mod clip;
mod draw_instance;
pub(crate) mod fog;
mod lights;

use crate::capture::geometry_cache::hash;
use crate::cluster::row_share::RowShare;
use crate::host::config::Settings;
use crate::trace::view::View;
use crate::trace::whitted::{ColorImage, lens};
use crate::trace::{Prepared, Rect};
use draw_instance::DrawInstance;
use rt_core::bvh::{BuildOptions, BuildQuality, Geometry, Instance, World};
use rt_core::camera::{Camera, ThinLens};
use rt_core::environment::Environment;
use rt_core::mesh::TriMesh;
use rt_core::ray_stats::RayStats;
use rt_core::render::{Crop, RenderOptions, render};
use rt_core::scene::{Appearance, Scene};
use std::collections::HashMap;
use std::sync::Arc;

/// The smallest number of samples per pixel. Fewer give only noise.
const LEAST_SAMPLES: u32 = 16;
/// The number of samples after which an unchanged image is final.
const MOST_SAMPLES: u32 = 1 << 16;

/// State that is kept between frames.
#[derive(Default)]
pub(crate) struct PathTracer {
    /// The world of each view. The next frame reuses its acceleration structures.
    worlds: HashMap<usize, Arc<World>>,
    /// Meshes with their attributes by content, and whether the current frame uses them.
    meshes: HashMap<u128, (Arc<TriMesh>, bool)>,
    progressive: HashMap<usize, ProgressiveImage>,
}

/// The mean of a view's images since its last change.
struct ProgressiveImage {
    key: u128,
    samples: u32,
    mean: Vec<[f32; 4]>,
}

fn stats(r: &RayStats) -> Vec<(&'static str, u64)> {
    vec![
        ("primary", r.primary),
        ("shadow", r.shadow),
        ("reflection", r.reflection),
        ("refraction", r.refraction),
        ("transparency", r.transparency),
        ("path", r.path),
    ]
}

impl PathTracer {
    /// The image of view `number`.
    pub(crate) fn colors(
        &mut self,
        draws: &[Prepared<'_>],
        view: &View,
        number: usize,
        rect: Rect,
        settings: &Settings,
    ) -> ColorImage {
        let rect = rect.and(view.viewport);
        let mut warnings = Vec::new();
        let nothing = |warnings| ColorImage {
            rect: Rect::default(),
            rgba: Vec::new(),
            rays: Vec::new(),
            warnings,
        };
        if rect.is_empty() {
            return nothing(warnings);
        }
        let (scene, key) = match self.scene(draws, view, number, settings, &mut warnings) {
            Ok(made) => made,
            Err(why) => {
                warnings.push(why);
                return nothing(warnings);
            }
        };
        let camera = camera(draws, view, settings, &scene, &mut warnings);
        let samples = settings.samples.max(LEAST_SAMPLES);
        let key =
            hash(&[&key.to_ne_bytes(), format!("{rect:?} {camera:?} {settings:?}").as_bytes()]);
        let before = self.progressive.remove(&number).filter(|s| s.key == key);
        if let Some(still) = before.as_ref().filter(|s| s.samples >= MOST_SAMPLES) {
            let rgba = still.mean.clone();
            self.progressive.extend(before.map(|s| (number, s)));
            return ColorImage { rect, rgba, rays: Vec::new(), warnings };
        }
        let done = before.as_ref().map_or(0, |s| s.samples);
        // Each image of the same content uses another seed, so that the mean converges.
        let picture = u64::from(done / samples);
        let fresh = crate::cluster::paths(self, draws, view, number, rect, settings, picture);
        warnings.extend(fresh.warnings);
        warnings.dedup();
        if fresh.rgba.is_empty() {
            return nothing(warnings);
        }
        let share = samples as f32 / (done + samples) as f32;
        let mix = |(i, now): (usize, &[f32; 4])| {
            let old = before.as_ref().map_or([0.0; 4], |s| s.mean[i]);
            std::array::from_fn(|k| old[k] + (now[k] - old[k]) * share)
        };
        let mean: Vec<[f32; 4]> = fresh.rgba.iter().enumerate().map(mix).collect();
        self.progressive
            .insert(number, ProgressiveImage { key, samples: done + samples, mean: mean.clone() });
        ColorImage { rect, rgba: mean, rays: fresh.rays, warnings }
    }

    /// The rows of a row share in image number `picture` of an unchanged view. `rect` lies within
    /// the viewport.
    #[expect(clippy::too_many_arguments, reason = "what helpers are told, one by one")]
    pub(crate) fn picture(
        &mut self,
        draws: &[Prepared<'_>],
        view: &View,
        number: usize,
        rect: Rect,
        settings: &Settings,
        picture: u64,
        share: RowShare,
    ) -> ColorImage {
        let mut warnings = Vec::new();
        let nothing = |warnings| ColorImage {
            rect: Rect::default(),
            rgba: Vec::new(),
            rays: Vec::new(),
            warnings,
        };
        let (scene, _) = match self.scene(draws, view, number, settings, &mut warnings) {
            Ok(made) => made,
            Err(why) => return nothing(vec![why]),
        };
        let camera = camera(draws, view, settings, &scene, &mut warnings);
        let (vw, vh) = (view.viewport.w.cast_unsigned(), view.viewport.h.cast_unsigned());
        let top = view.viewport.y + view.viewport.h;
        let (w, h) = (rect.w as usize, rect.h as usize);
        let mut rgba = vec![[0.0; 4]; w * h];
        let mut rays: Vec<(&'static str, u64)> = Vec::new();
        // Renders one band of rows after the other, or all rows at once when the share is the whole
        // image.
        let whole = std::iter::once(0..w * h).filter(|_| share == RowShare::WHOLE);
        for part in whole.chain(share.pixels(w, h).filter(|_| share != RowShare::WHOLE)) {
            let (first, rows) = (part.start / w, part.len() / w);
            let options = RenderOptions {
                crop: Some(Crop {
                    x: (rect.x - view.viewport.x).cast_unsigned(),
                    y: (top - rect.y - (first + rows) as i32).cast_unsigned(),
                    width: rect.w.cast_unsigned(),
                    height: rows as u32,
                }),
                path_tracing: true,
                samples: settings.samples.max(LEAST_SAMPLES),
                light_rays: 1,
                max_bounces: Some(settings.effects.max_bounces),
                seed: picture,
                ..RenderOptions::new(vw, vh)
            };
            let output = match render(&scene, &camera, &options) {
                Ok(output) => output,
                Err(e) => return nothing(vec![format!("mode path: {e}")]),
            };
            // Every path ends some time, and colours that are mixed may have an alpha of one less a
            // rounding: neither is news.
            let known = |w: &String| w.contains("max_bounces") || w.contains("drawn opaque");
            let told = output.report.warnings.into_iter().filter(|w| !known(w));
            warnings.extend(told.map(|w| format!("mode path: {w}")));
            for y in 0..rows {
                let from = &output.frame.color[(rows - 1 - y) * w..][..w];
                rgba[(first + y) * w..][..w].copy_from_slice(from);
            }
            for (kind, n) in stats(&output.report.rays) {
                match rays.iter_mut().find(|(k, _)| *k == kind) {
                    Some((_, sum)) => *sum += n,
                    None => rays.push((kind, n)),
                }
            }
        }
        ColorImage { rect, rgba, rays, warnings }
    }

    fn scene(
        &mut self,
        draws: &[Prepared<'_>],
        view: &View,
        number: usize,
        settings: &Settings,
        warnings: &mut Vec<String>,
    ) -> Result<(Scene, u128), String> {
        let mut keys = Vec::new();
        let (mut geometries, mut instances) = (Vec::new(), Vec::new());
        let (mut materials, mut appearances) = (Vec::new(), Vec::new());
        for p in draws {
            let Some(DrawInstance { mesh, material, world_from_object, key }) =
                draw_instance::part(p, view, settings, warnings)
            else {
                continue;
            };
            let entry = self.meshes.entry(key).or_insert_with(|| (Arc::new(mesh), true));
            entry.1 = true;
            keys.extend(key.to_ne_bytes());
            keys.extend(format!("{material:?} {world_from_object:?}").bytes());
            instances.push(Instance { geometry: geometries.len(), world_from_object });
            geometries.push(Geometry::Mesh(entry.0.clone()));
            appearances.push(Appearance::new(materials.len()));
            materials.push(material);
        }
        let options = BuildOptions { quality: BuildQuality::Best, ..BuildOptions::default() };
        let previous = self.worlds.get(&number).cloned();
        let world = World::build_sharing(geometries, instances, &options, previous.as_deref())
            .map_err(|e| format!("mode path: {e}"))?;
        let world = Arc::new(world);
        self.worlds.insert(number, world.clone());
        let mut scene = Scene::new(world);
        scene.materials = materials;
        scene.appearances = appearances;
        let (lamps, ambient) = lights::of(draws, settings, warnings);
        keys.extend(format!("{lamps:?} {ambient:?}").bytes());
        scene.lights = lamps;
        scene.environment =
            ambient.iter().any(|v| *v > 0.0).then_some(Environment::Constant(ambient));
        // What its attributes make of the alphas is found out by making it anew.
        let scene = scene_checked(scene)?;
        Ok((scene, hash(&[&keys])))
    }

    /// Drops everything that the last frame did not use.
    pub(crate) fn frame_done(&mut self) {
        self.meshes.retain(|_, (_, used)| std::mem::take(used));
    }
}

/// The view's camera, with the lens of the settings.
fn camera(
    draws: &[Prepared<'_>],
    view: &View,
    settings: &Settings,
    scene: &Scene,
    warnings: &mut Vec<String>,
) -> Camera {
    let b = scene.world.bounds();
    let diagonal = if b.is_empty() { 1.0 } else { f64::from((b.max - b.min).length()) };
    let mut camera = view.camera;
    match lens(draws, view, settings, diagonal) {
        Ok(None) => {}
        Ok(Some([aperture_radius, focus_distance])) => {
            if let Ok(with) = camera.with_lens(ThinLens { aperture_radius, focus_distance }) {
                camera = with;
            }
        }
        Err(why) => warnings.push(why),
    }
    camera
}

fn scene_checked(scene: Scene) -> Result<Scene, String> {
    scene.check().map_err(|e| format!("mode path: {e}"))?;
    Ok(scene)
}
