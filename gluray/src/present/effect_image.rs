//! Draws images for which the nearest surface of each pixel is not enough: mode `path`, and `rich`
//! with mirrors, glass, translucency, a lens or several samples.
//!
//! Depths are still those of the rasterizer's fragments, so that the driver's lines and text
//! intersect the same surfaces as in every mode. Colours are premultiplied and composited over the
//! framebuffer.

use crate::capture::draw::{Draw, Shading, TexturedDraw};
use crate::capture::geometry_cache::BuildCounts;
use crate::cluster;
use crate::host::config::{Mode, Settings};
use crate::present::framebuffer_pass::CompositeMode;
use crate::state::snapshot::Fog;
use crate::trace::path_tracing::{PathTracer, fog};
use crate::trace::thread_pool;
use crate::trace::view::{View, views};
use crate::trace::whitted::{self, ColorImage};
use crate::trace::{Layer, Prepared, Rect, UNCOVERED};
use std::borrow::Cow;
use std::sync::atomic::Ordering::Relaxed;

/// True when the mode may need such images.
pub(crate) fn is_needed(settings: &Settings) -> bool {
    match settings.mode {
        Mode::Path | Mode::Rich => true,
        Mode::Enhance => settings.samples > 1,
        Mode::Match | Mode::Phong => false,
    }
}

/// True when the mode's own rays smooth silhouettes as well as `samples` per pixel do. Then all
/// samples of a pixel get one colour.
pub(crate) fn has_samples_for(settings: &Settings, samples: u32) -> bool {
    settings.mode == Mode::Path || is_needed(settings) && settings.samples > samples
}

/// The settings with at least `samples` rays per pixel.
pub(crate) fn with_samples(settings: &Settings, samples: u32) -> Cow<'_, Settings> {
    match settings.samples < samples {
        true => Cow::Owned(Settings { samples, ..settings.clone() }),
        false => Cow::Borrowed(settings),
    }
}

/// The image of one view of a frame.
pub(crate) enum ViewImage {
    /// Only the nearest surfaces are needed.
    Surfaces(Layer, Vec<(&'static str, u64)>),
    /// Colours to composite over the framebuffer, with the depths of opaque surfaces and of all
    /// surfaces.
    Over { colors: ColorImage, opaque: Layer, all: Layer },
}

/// A colour in the framebuffer's format.
pub(crate) fn bytes(c: [f32; 4]) -> [u8; 4] {
    c.map(|v| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
}

/// Depths without colours.
fn depths(draws: &[Prepared<'_>], settings: &Settings) -> Layer {
    // Shading is not needed, so the cheapest mode is used.
    let cheap = Settings { mode: Mode::Match, ..settings.clone() };
    cluster::nearest(draws, &cheap).0
}

impl ViewImage {
    /// The rays that were traced for the image, by kind.
    pub(crate) fn rays(&self) -> &[(&'static str, u64)] {
        match self {
            ViewImage::Surfaces(_, rays) => rays,
            ViewImage::Over { colors, .. } => &colors.rays,
        }
    }

    /// What is drawn into the framebuffer, in this order, with the depth function `func`.
    pub(crate) fn layers(self, func: u32) -> Vec<(Layer, CompositeMode)> {
        match self {
            ViewImage::Surfaces(layer, _) => vec![(layer, CompositeMode::Surface(func))],
            ViewImage::Over { colors, opaque, all } => {
                let [solid, fringe] = split(&colors, &opaque, &all);
                vec![(solid, CompositeMode::Over(func)), (fringe, CompositeMode::Fringe(func))]
            }
        }
    }
}

/// The images of a frame, and what they cost.
#[derive(Default)]
pub(crate) struct EffectImages {
    pub(crate) images: Vec<ViewImage>,
    /// The number of primary rays.
    pub(crate) primary: u64,
    pub(crate) structures: BuildCounts,
    pub(crate) warnings: Vec<String>,
}

/// Traces the pending draws, view by view.
pub(crate) fn trace(
    pending: &[TexturedDraw],
    settings: &Settings,
    background: [f32; 3],
    path_tracer: &mut PathTracer,
) -> EffectImages {
    let groups = views(pending.iter().map(|(d, _)| d));
    let mut made = EffectImages::default();
    thread_pool::on_pool(|| {
        let EffectImages { images, primary, structures, warnings } = &mut made;
        for (number, (view, members)) in groups.iter().enumerate() {
            let ready: Vec<Prepared<'_>> = members
                .iter()
                .filter_map(|i| Prepared::new(&pending[*i].0, pending[*i].1.clone(), structures))
                .collect();
            if ready.is_empty() {
                continue;
            }
            images.push(make(&ready, view, number, settings, background, path_tracer, warnings));
            *primary += ready.iter().map(|p| p.rays.load(Relaxed)).sum::<u64>();
        }
    });
    made
}

/// The visibility of draws that the driver has drawn, and what it cost.
#[derive(Default)]
pub(crate) struct Darkening {
    /// Factors for the driver's image, view by view.
    pub(crate) layers: Vec<Layer>,
    /// Primary rays, shadow rays and rays of ambient occlusion.
    pub(crate) rays: [u64; 3],
    pub(crate) structures: BuildCounts,
}

/// Traces the visibility of draws by which the driver's image of them is multiplied.
pub(crate) fn trace_darkening(draws: &[Draw], settings: &Settings) -> Darkening {
    let groups = views(draws.iter());
    let mut made = Darkening::default();
    thread_pool::on_pool(|| {
        let Darkening { layers, rays, structures } = &mut made;
        for (_, members) in &groups {
            let ready: Vec<Prepared<'_>> = members
                .iter()
                .filter_map(|i| Prepared::new(&draws[*i], None, structures))
                .collect();
            let (mut layer, extra) = cluster::nearest(&ready, settings);
            // The driver's own depth may be nearer by some rounding errors.
            layer
                .depth
                .iter_mut()
                .filter(|d| **d < 1.5)
                .for_each(|d| *d = (*d - DEPTH_ROUNDINGS).max(0.0));
            rays[0] += ready.iter().map(|p| p.rays.load(Relaxed)).sum::<u64>();
            (rays[1], rays[2]) = (rays[1] + extra[0], rays[2] + extra[1]);
            layers.push(layer);
        }
    });
    made
}

/// Sixteen steps of a 24-bit depth buffer.
const DEPTH_ROUNDINGS: f32 = 1e-6;

fn make(
    ready: &[Prepared<'_>],
    view: &View,
    number: usize,
    settings: &Settings,
    background: [f32; 3],
    path_tracer: &mut PathTracer,
    warnings: &mut Vec<String>,
) -> ViewImage {
    if settings.mode != Mode::Path && !whitted::is_needed(ready, settings) {
        let (layer, extra) = cluster::nearest(ready, settings);
        return ViewImage::Surfaces(
            layer,
            vec![("shadow", extra[0]), ("ambient occlusion", extra[1])],
        );
    }
    let all = depths(ready, settings);
    let mut colors = match settings.mode {
        Mode::Path => path_tracer.colors(ready, view, number, all.rect, settings),
        _ => cluster::whitted(ready, view, all.rect, settings, background),
    };
    warnings.append(&mut colors.warnings);
    if settings.mode == Mode::Path {
        fogged(&mut colors, ready, view, &all, settings);
    }
    let clear: Vec<bool> =
        ready.iter().map(|p| p.draw.state.blend && whitted::is_clear(p, settings)).collect();
    let opaque = match clear.contains(&true) {
        false => Layer {
            rect: all.rect,
            color: Vec::new(),
            depth: all.depth.clone(),
            covered: all.covered,
        },
        true => {
            // Blended surfaces write no depth, as programs have it.
            let mut depth = vec![UNCOVERED; all.depth.len()];
            for (p, _) in ready.iter().zip(&clear).filter(|(_, clear)| !**clear) {
                let one = depths(std::slice::from_ref(p), settings);
                merge(&mut depth, all.rect, &one);
            }
            Layer { rect: all.rect, color: Vec::new(), depth, covered: 0 }
        }
    };
    ViewImage::Over { colors, opaque, all }
}

/// Applies each draw's fog to a path-traced image.
fn fogged(
    colors: &mut ColorImage,
    ready: &[Prepared<'_>],
    view: &View,
    all: &Layer,
    settings: &Settings,
) {
    let mut done: Vec<(Fog, [f64; 2])> = Vec::new();
    for p in ready {
        let s = &p.draw.state;
        let Some(fog) = s.fog.filter(|_| matches!(p.draw.shading, Shading::Fixed)) else {
            continue;
        };
        let this = (fog, s.depth_range);
        if done.contains(&this) {
            continue;
        }
        done.push(this);
        let has =
            |p: &Prepared<'_>| p.draw.state.fog == Some(fog) && p.draw.state.depth_range == this.1;
        if ready.iter().all(has) {
            return fog::over(colors, view, &fog, this.1, all, all);
        }
        let mut depth = vec![UNCOVERED; all.depth.len()];
        for p in ready.iter().filter(|p| has(p)) {
            merge(&mut depth, all.rect, &depths(std::slice::from_ref(p), settings));
        }
        let surfaces = Layer { rect: all.rect, color: Vec::new(), depth, covered: 0 };
        fog::over(colors, view, &fog, this.1, &surfaces, all);
    }
}

/// Keeps the nearer depth at every pixel.
fn merge(depth: &mut [f32], rect: Rect, one: &Layer) {
    for y in 0..one.rect.h {
        for x in 0..one.rect.w {
            let from = (y * one.rect.w + x) as usize;
            let to = ((y + one.rect.y - rect.y) * rect.w + x + one.rect.x - rect.x) as usize;
            depth[to] = depth[to].min(one.depth[from]);
        }
    }
}

/// Splits the image into pixels with an opaque surface at their centre, and pixels that have colour
/// without one.
fn split(colors: &ColorImage, opaque: &Layer, all: &Layer) -> [Layer; 2] {
    let rect = colors.rect;
    let n = colors.rgba.len();
    let blank = || Layer { rect, color: vec![[0; 4]; n], depth: vec![UNCOVERED; n], covered: 0 };
    let (mut solid, mut fringe) = (blank(), blank());
    let at = |layer: &Layer, x: i32, y: i32| {
        let (x, y) = (x - layer.rect.x, y - layer.rect.y);
        let inside = (0..layer.rect.w).contains(&x) && (0..layer.rect.h).contains(&y);
        if inside { layer.depth[(y * layer.rect.w + x) as usize] } else { UNCOVERED }
    };
    for i in 0..n {
        if colors.rgba[i][3] <= 0.0 && colors.rgba[i][..3] == [0.0; 3] {
            continue;
        }
        let (x, y) = (rect.x + i as i32 % rect.w, rect.y + i as i32 / rect.w);
        let depth = at(opaque, x, y);
        let (layer, depth) = if depth < 1.5 {
            (&mut solid, depth)
        } else {
            // A silhouette has the depth of the surface beside it; a blurred one that is far from
            // any is before everything.
            let mut near = UNCOVERED;
            for dy in -1..=1 {
                for dx in -1..=1 {
                    near = near.min(at(all, x + dx, y + dy));
                }
            }
            (&mut fringe, if near < 1.5 { near } else { 0.0 })
        };
        (layer.color[i], layer.depth[i]) = (bytes(colors.rgba[i]), depth);
        layer.covered += 1;
    }
    [solid, fringe]
}
