//! Painting on the filter, and tracing points of the image to it.

use super::{MAX_POINTS, MAX_STROKES, RefusedChange, Session, chain, refused};
use crate::cutoff::Rgb;
use crate::cutoff::painted::Stroke;
use crate::optics::PlaneVector;
use crate::scene::{CutoffSpec, TechniqueSpec};
use crate::serve::deflection_map::DeflectionMap;
use crate::serve::filter_plane::{as_painting, half_side_m, traced};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A request to paint.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Paint {
    /// What the points refer to.
    pub on: Canvas,
    /// Points along the stroke: on the filter in metres from the axis, on the image 0..=1 from its
    /// upper left corner.
    pub points: Vec<[f64; 2]>,
    /// Radius of the brush on the filter.
    pub radius_m: f64,
    /// Linear transmission of the paint.
    pub rgb: Rgb,
}

/// The surface that is painted on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Canvas {
    /// The filter itself.
    Filter,
    /// The image; each point is traced to the filter.
    #[serde(rename = "picture")]
    Image,
}

/// The result of painting.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PaintOutcome {
    /// The scene's new generation.
    pub generation: u64,
    /// Number of strokes added.
    pub added: usize,
    /// Number of points without light, which have no position on the filter.
    pub dark: usize,
    /// A note for the user.
    pub note: Option<String>,
}

impl Session {
    /// Paints on the filter. The first stroke turns the cut-off into a painting.
    pub fn paint(&self, paint: &Paint) -> Result<PaintOutcome, RefusedChange> {
        let finite = paint.points.iter().flatten().all(|c| c.is_finite() && c.abs() < 1e3);
        let brush = paint.radius_m > 0.0 && paint.radius_m < 1e3;
        if !(finite && brush) {
            return Err(refused("a stroke needs finite points and a brush larger than 0 m"));
        }
        if !paint.rgb.iter().all(|c| (0.0..=1.0).contains(c)) {
            return Err(refused("a filter's transmissions are 0 to 1"));
        }
        if paint.points.len() > MAX_POINTS {
            return Err(refused(format!(
                "{} points are more than {MAX_POINTS}; split the stroke",
                paint.points.len()
            )));
        }
        let mut shared = self.lock();
        let TechniqueSpec::Schlieren { cutoff } = shared.scene.technique.clone() else {
            return Err(refused(
                "only schlieren has a filter; select technique schlieren to paint",
            ));
        };

        // The points on the filter.
        let traced_view = shared.frame.as_ref().and_then(|f| f.traced.clone());
        let (points_m, dark) = match paint.on {
            Canvas::Filter => (paint.points.clone(), 0),
            Canvas::Image => {
                let Some(view) = &traced_view else {
                    return Err(refused("the image is not rendered yet; paint when it is shown"));
                };
                let f2 = shared.scene.optics().schlieren_focal_length_m;
                let on_filter = |p: &[f64; 2]| traced(view, f2, *p).map(|t| t.1.map(f64::from));
                let points_m: Vec<[f64; 2]> = paint.points.iter().filter_map(on_filter).collect();
                let dark = paint.points.len() - points_m.len();
                (points_m, dark)
            }
        };

        // Adds the strokes to a painting.
        let half_m = half_side_m(&shared.scene, traced_view.as_deref());
        let (mut painting, same) = as_painting(&shared.scene, &cutoff, half_m, [0.0; 3])
            .map_err(|e| refused(chain(&e)))?;
        let strokes = strokes(&points_m, paint);
        let added = strokes.len();
        painting.strokes.extend(strokes);
        if painting.strokes.len() > MAX_STROKES {
            return Err(refused(format!(
                "the painting would have more than {MAX_STROKES} strokes; start a new one"
            )));
        }
        let mut scene = shared.scene.clone();
        // Keeps the source: the default slit of a knife must not become a painting's default disc.
        scene.light.source = scene.effective().light.source;
        scene.technique = TechniqueSpec::Schlieren { cutoff: CutoffSpec::Painted(painting) };
        self.check_scene(&scene)?;
        if added > 0 {
            shared.scene = scene;
            self.changed(&mut shared);
        }
        let note = (!same && added > 0).then(|| {
            format!(
                "a {} filter cannot be painted over; the painting starts on black",
                cutoff.name()
            )
        });
        Ok(PaintOutcome { generation: shared.generation, added, dark, note })
    }

    /// Deflection, and point on the filter, of the light at a point of the image; `None` without
    /// light.
    pub fn trace(&self, at: [f64; 2]) -> Result<Option<(PlaneVector, PlaneVector)>, RefusedChange> {
        if !at.iter().all(|c| (0.0..=1.0).contains(c)) {
            return Err(refused("points on the image are 0 to 1 from its upper left corner"));
        }
        let shared = self.lock();
        let view: Option<Arc<DeflectionMap>> = shared.frame.as_ref().and_then(|f| f.traced.clone());
        let view = view.ok_or_else(|| refused("the image is not rendered yet"))?;
        let f2 = shared.scene.optics().schlieren_focal_length_m;
        Ok(traced(&view, f2, at))
    }
}

/// Strokes through points on the filter. Points of a stroke on the image that are farther apart on
/// the filter than the brush is wide are not joined, because across a shock there is nothing
/// between them. Points that almost repeat the last one add nothing.
pub(super) fn strokes(points_m: &[[f64; 2]], paint: &Paint) -> Vec<Stroke> {
    let distance = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let mut strokes: Vec<Stroke> = Vec::new();
    let mut last: Option<[f64; 2]> = None;
    for &to_m in points_m {
        let joined =
            |l: &[f64; 2]| paint.on == Canvas::Filter || distance(*l, to_m) <= 2.0 * paint.radius_m;
        if last.is_some_and(|l| distance(l, to_m) < 0.05 * paint.radius_m) {
            continue;
        }
        let from_m = last.filter(joined).unwrap_or(to_m);
        strokes.push(Stroke { from_m, to_m, radius_m: paint.radius_m, rgb: paint.rgb });
        last = Some(to_m);
    }
    strokes
}
