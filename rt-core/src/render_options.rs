//! What to compute and when to stop.

use crate::effects::Effects;
use crate::frame::Layers;
use crate::render_error::RenderError;
use crate::sampler::Sampling;
use crate::volume::VolumeQuality;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// A part of the image, in pixels from the top left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Crop {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// Options of a frame. `RenderOptions { samples: 16, ..RenderOptions::new(640, 480) }`.
#[derive(Debug, Clone)]
pub struct RenderOptions {
    /// Pixels per row of the whole image.
    pub width: u32,
    /// Rows of the whole image.
    pub height: u32,
    /// Renders only this part (its pixels equal those of the whole image, bit for bit). The frame
    /// has the size of the part.
    pub crop: Option<Crop>,
    /// Points of the image plane, in normalized device coordinates (y upwards), that the pixels'
    /// rays go through instead of their centres: one per pixel of the whole image, row by row from
    /// the top. The image is then a list of samples of another image. 4 x 4 pixels are traced
    /// together, so points should lie near each other there. Needs `samples` of 1.
    pub points: Option<Arc<Vec<[f64; 2]>>>,
    /// Points, as `points`, at which triangles are lit, as rasterizers light all samples of a pixel
    /// at its centre: each where the ray through the point meets its plane, also beyond its sides.
    /// Only frames without effects have it; in others surfaces are lit where they are hit.
    pub shading_points: Option<Arc<Vec<[f64; 2]>>>,
    /// What to compute.
    pub layers: Layers,
    /// Effects that may run. `None`: those that scene and camera need. The report has a warning for
    /// a named effect that changes no pixel.
    pub effects: Option<Effects>,
    /// Path tracing: light over many bounces, instead of ambient light and ambient occlusion.
    pub path_tracing: bool,
    /// Samples per pixel, at most. One sample goes through the pixel's centre, several are spread
    /// over its square (box filter).
    pub samples: u32,
    /// Shadow rays per sample to each light that has a size.
    pub light_rays: u32,
    /// How samples are distributed.
    pub sampling: Sampling,
    /// Another seed gives other noise.
    pub seed: u64,
    /// Limit on consecutive reflections, refractions and diffuse bounces; transparent layers do not
    /// count. Light from longer paths is missing from the image:
    /// [`RayStats::cut_at_max_bounces`](crate::ray_stats::RayStats::cut_at_max_bounces) counts
    /// these paths, and a warning reports them. `None`: 8 for mirrors and glass; no limit for path
    /// tracing, where Russian roulette ends paths and keeps the mean correct.
    pub max_bounces: Option<u32>,
    /// Mirror, glass and transparency rays are not sent when less than this share of them reaches
    /// the pixel. For each, at most this times the incoming radiance is missing (linear, 1 =
    /// white);
    /// [`RayStats::cut_at_min_contribution`](crate::ray_stats::RayStats::cut_at_min_contribution)
    /// counts them. Of the light that comes through translucent layers, less than this share is
    /// missing, and less than this radiance of each ray. 0 sends every ray. Path tracing leaves
    /// nothing out.
    pub min_contribution: f32,
    /// Depth, distance, normal and ids belong to the first surface of at least this opacity: 0 for
    /// any surface that is not invisible, 1 for opaque surfaces only, as in OpenGL's depth buffer.
    pub depth_min_opacity: f32,
    /// Accuracy of direct volume rendering.
    pub volume_quality: VolumeQuality,
    /// Stop when this much time has passed. The first sample of every pixel is always finished.
    pub time_limit: Option<Duration>,
    /// Stop when the standard error of a pixel (root mean square over the image, luminance) is
    /// estimated below this, in 8-bit grey levels of linear light (1 = 1/255 of white). The
    /// estimate assumes independent samples, so low-discrepancy samples have a smaller error than
    /// it says. It is checked from 4 samples on.
    pub max_error_levels: Option<f32>,
    /// Set to true to stop as soon as the current tiles are finished.
    pub cancel: Option<Arc<AtomicBool>>,
}

impl RenderOptions {
    /// The colour layer of an image of `width` x `height`, one sample per pixel, with the effects
    /// that the scene needs.
    pub fn new(width: u32, height: u32) -> RenderOptions {
        RenderOptions {
            width,
            height,
            crop: None,
            points: None,
            shading_points: None,
            layers: Layers::COLOR,
            effects: None,
            path_tracing: false,
            samples: 1,
            light_rays: 4,
            sampling: Sampling::Sobol,
            seed: 0,
            max_bounces: None,
            min_contribution: 1.0 / 1024.0,
            depth_min_opacity: 0.0,
            volume_quality: VolumeQuality::default(),
            time_limit: None,
            max_error_levels: None,
            cancel: None,
        }
    }

    /// The part to render: the crop, or the whole image.
    pub fn area(&self) -> Crop {
        self.crop.unwrap_or(Crop { x: 0, y: 0, width: self.width, height: self.height })
    }

    /// Warnings about limits and thresholds that have no effect.
    pub(super) fn warnings(&self) -> Vec<String> {
        let mut out = Vec::new();
        if self.depth_min_opacity != 0.0 && !self.layers.intersects(Layers::GEOMETRY) {
            out.push(format!(
                "depth_min_opacity {} changes nothing: no layer of depth, distance, normals or ids \
                 is asked for",
                self.depth_min_opacity
            ));
        }
        if self.max_error_levels.is_some() && self.samples <= 4 {
            out.push(format!(
                "max_error_levels changes nothing: it is looked at from 4 samples on, and \
                 `samples` is {}; raise `samples`",
                self.samples
            ));
        }
        if self.time_limit.is_some() && self.samples == 1 {
            out.push(
                "time_limit changes nothing: the first sample is always finished, and `samples` is \
                 1; raise `samples`, or use \
                 `cancel`"
                    .into(),
            );
        }
        out
    }

    /// Checks every number.
    pub fn check(&self) -> Result<(), RenderError> {
        let error = |field, value: String, rule| Err(RenderError::Option { field, value, rule });
        const MOST: u32 = 1 << 16;
        for (field, v) in [("width", self.width), ("height", self.height)] {
            if v == 0 || v > MOST {
                return error(field, v.to_string(), "between 1 and 65536 pixels");
            }
        }
        if let Some(c) = self.crop {
            let inside = |start: u32, n: u32, all: u32| {
                n > 0 && start.checked_add(n).is_some_and(|end| end <= all)
            };
            if !inside(c.x, c.width, self.width) || !inside(c.y, c.height, self.height) {
                return error("crop", format!("{c:?}"), "at least one pixel, inside the picture");
            }
        }
        for points in [&self.points, &self.shading_points].into_iter().flatten() {
            if points.len() != self.width as usize * self.height as usize {
                let count = points.len().to_string();
                return error("points", count, "as many as the image has pixels");
            }
            if self.samples != 1 {
                let samples = self.samples.to_string();
                return error("samples", samples, "1 where `points` are given");
            }
            if let Some(p) = points.iter().find(|p| !p.iter().all(|v| v.is_finite())) {
                return error("points", format!("{p:?}"), "finite");
            }
        }
        if self.layers.is_empty() {
            return error("layers", "none".into(), "at least one layer");
        }
        for (field, v) in [("samples", self.samples), ("light_rays", self.light_rays)] {
            if v == 0 {
                return error(field, "0".into(), "at least 1");
            }
        }
        // The counter stops at 65535.
        if let Some(most) = self.max_bounces
            && most > u32::from(u16::MAX)
        {
            return error(
                "max_bounces",
                most.to_string(),
                "at most 65535; leave it out for the default",
            );
        }
        for (field, v) in [
            ("min_contribution", self.min_contribution),
            ("depth_min_opacity", self.depth_min_opacity),
        ] {
            if !(0.0..=1.0).contains(&v) {
                return error(field, v.to_string(), "between 0 and 1");
            }
        }
        if let Some(e) = self.max_error_levels
            && !(e > 0.0 && e.is_finite())
        {
            return error(
                "max_error_levels",
                e.to_string(),
                "positive and finite (8-bit grey levels); leave it out for no limit",
            );
        }
        Ok(())
    }
}
