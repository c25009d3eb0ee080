//! Renderers: the options of a frame and its background.

use super::Diagnostics;
use crate::anari::object::{Object, Value};
use rt_core::render::RenderOptions;
use rt_core::scene::AmbientOcclusion;
use rt_core::volume::VolumeQuality;

/// Settings for drawing one frame.
pub(crate) struct RendererSettings {
    pub(crate) options: RenderOptions,
    /// Ambient radiance, equal from all directions.
    pub(crate) ambient: Option<[f32; 3]>,
    pub(crate) occlusion: Option<AmbientOcclusion>,
    pub(crate) shadows: bool,
    pub(crate) backdrop: FrameBackground,
}

/// The background of a frame.
pub(crate) enum FrameBackground {
    /// Linear, not premultiplied.
    Color([f32; 4]),
    /// An image stretched over the frame; rows from the bottom.
    Picture { size: [usize; 2], texels: Vec<[f32; 4]> },
}

impl FrameBackground {
    /// The colour at `x`, `y` in 0..1, y upwards; linear between texels.
    pub(crate) fn at(&self, x: f32, y: f32) -> [f32; 4] {
        let (size, texels) = match self {
            FrameBackground::Color(c) => return *c,
            FrameBackground::Picture { size, texels } => (size, texels),
        };
        let split = |v: f32, n: usize| {
            let p = (v * n as f32 - 0.5).clamp(0.0, (n - 1) as f32);
            let low = p as usize;
            (low, (low + 1).min(n - 1), p - low as f32)
        };
        let ((x0, x1, fx), (y0, y1, fy)) = (split(x, size[0]), split(y, size[1]));
        let t = |x: usize, y: usize| texels[y * size[0] + x];
        let mix =
            |a: [f32; 4], b: [f32; 4], f: f32| std::array::from_fn(|c| a[c] + (b[c] - a[c]) * f);
        mix(mix(t(x0, y0), t(x1, y0), fx), mix(t(x0, y1), t(x1, y1), fx), fy)
    }
}

/// The options that `renderer` asks for.
pub(crate) fn renderer_settings(
    renderer: &Object,
    size: [u32; 2],
    diagnostics: &mut Diagnostics,
) -> RendererSettings {
    let mut options = RenderOptions::new(size[0], size[1]);
    let mut count = |name: &str, default: u32, least: u32, most: u32| {
        let Some(v) = renderer.numbers(name).map(|v| v[0]) else { return default };
        let used = v.clamp(f64::from(least), f64::from(most)) as u32;
        if f64::from(used) != v {
            diagnostics.warn(
                renderer,
                format!("`{name}` is {v}; it must be {least} to {most}: {used} is used"),
            );
        }
        used
    };
    options.samples = count("pixelSamples", 1, 1, 1 << 16);
    if renderer.numbers("maxDepth").is_some() {
        options.max_bounces = Some(count("maxDepth", 8, 0, 65535));
    }
    options.light_rays = count("lightSamples", 4, 1, 4096);
    let rays = count("ambientSamples", 0, 0, 4096);
    options.path_tracing = renderer.subtype == "pathtracer";
    let levels = renderer.f32("volumeTolerance", 0.5);
    options.volume_quality = VolumeQuality::Tolerance { levels: levels.max(1e-6) };

    let radiance = renderer.f32("ambientRadiance", 0.0);
    let color = renderer.vector("ambientColor", [1.0; 3]).map(|c| c as f32 * radiance);
    let usable = color.iter().all(|c| c.is_finite() && *c >= 0.0);
    if !usable {
        diagnostics.warn(
            renderer,
            format!("the ambient light {color:?} is not finite or negative: there is none"),
        );
    }
    let ambient = (usable && color != [0.0; 3]).then_some(color);
    let distance = f64::from(renderer.f32("ambientOcclusionDistance", f32::INFINITY));
    let occlusion = if rays == 0 || options.path_tracing {
        None
    } else if distance > 0.0 {
        Some(AmbientOcclusion { distance, rays })
    } else {
        diagnostics.warn(
            renderer,
            format!(
                "`ambientOcclusionDistance` is {distance}; it must be positive: ambient light is \
                 not dimmed"
            ),
        );
        None
    };

    let backdrop = match renderer.parameters().get("background") {
        Some(Value::Bytes(t, b)) => FrameBackground::Color(t.attribute(b)),
        Some(Value::Object(a)) => {
            let picture = a
                .with_array(|a| ([a.dims[0], a.dims[1]], a.attributes()))
                .filter(|(_, t)| !t.is_empty());
            picture.map_or(FrameBackground::Color([0.0, 0.0, 0.0, 1.0]), |(size, texels)| {
                FrameBackground::Picture { size, texels }
            })
        }
        _ => FrameBackground::Color([0.0, 0.0, 0.0, 1.0]),
    };
    RendererSettings {
        options,
        ambient,
        occlusion,
        shadows: renderer.bool("shadows", true),
        backdrop,
    }
}
