//! Fields and volumes.

use super::Diagnostics;
use crate::anari::data_type::DataType;
use crate::anari::object::{Object, Value};
use rt_core::colormap::ColorMap;
use rt_core::glam::{DVec3, UVec3};
use rt_core::grid::Grid;
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{Interpolation, Volume, VolumeOptions};
use std::sync::Arc;

/// Converts the field's grid; `None`, with a diagnostic, if it cannot be used.
pub(crate) fn grid_of(field: &Object, diagnostics: &mut Diagnostics) -> Option<Arc<Grid>> {
    if !field.known {
        return None;
    }
    let data = field.object("data").and_then(|a| a.with_array(|a| (a.dims, a.scalars())));
    let Some((dims, values)) = data else {
        diagnostics
            .error(field, "`data` is not set; set it to a three-dimensional array and commit");
        return None;
    };
    let origin = DVec3::from_array(field.vector("origin", [0.0; 3]));
    let spacing = DVec3::from_array(field.vector("spacing", [1.0; 3]));
    match Grid::new(UVec3::from_array(dims.map(|d| d as u32)), origin, spacing, values) {
        Ok(grid) => Some(Arc::new(grid)),
        Err(e) => {
            diagnostics.error(field, e);
            None
        }
    }
}

/// Whether the field takes the value of the nearest grid point everywhere.
pub(crate) fn is_nearest(field: &Object) -> bool {
    field.text("filter").as_deref() == Some("nearest")
}

/// Converts the volume's medium; `None`, with a diagnostic, if it cannot be used.
pub(crate) fn volume_of(volume: &Object, diagnostics: &mut Diagnostics) -> Option<Arc<Volume>> {
    if !volume.known || !volume.bool("visible", true) {
        return None;
    }
    let Some(field) = volume.object("value") else {
        diagnostics.error(volume, "`value` is not set; set it to a spatial field and commit");
        return None;
    };
    let grid = grid_of(&field, diagnostics)?;
    let [low, high] = volume.vector("valueRange", [0.0, 1.0]).map(|v| v as f32);
    let parameters = volume.parameters();
    let colors = match parameters.get("color") {
        Some(Value::Object(a)) => a.with_array(|a| a.attributes()).filter(|c| !c.is_empty()),
        Some(Value::Bytes(t, b)) => Some(vec![color(*t, b)]),
        _ => None,
    };
    let mut colors = colors.unwrap_or_else(|| vec![[1.0; 4]]);
    let opacities = match parameters.get("opacity") {
        Some(Value::Object(a)) => a.with_array(|a| a.scalars()).filter(|o| !o.is_empty()),
        Some(Value::Bytes(t, b)) => Some(vec![t.attribute(b)[0]]),
        _ => None,
    };
    let opacities = opacities.unwrap_or_else(|| vec![1.0]);
    let mut bad = 0;
    for v in colors.iter_mut().flatten().filter(|v| !(v.is_finite() && **v >= 0.0)) {
        bad += 1;
        *v = 0.0;
    }
    if bad > 0 {
        diagnostics.warn(
            volume,
            format!("{bad} components of `color` are NaN, infinite or negative; they count as 0"),
        );
    }
    // Opacity and the colours' alpha are multiplied. Both are linear between their own points, so
    // their product is sampled at the points of both.
    let points: Vec<[f32; 2]> = knots(opacities.len(), colors.len())
        .into_iter()
        .map(|x| {
            let alpha = at(&colors, x, |c| c[3]);
            let opacity = (at(&opacities, x, |o| *o) * alpha).clamp(0.0, 1.0);
            [low + (high - low) * x, if opacity.is_nan() { 0.0 } else { opacity }]
        })
        .collect();
    let unit = volume.f32("unitDistance", 1.0);
    let transfer =
        TransferFunction::from_opacity(ColorMap::new(colors, [low, high]), &points, unit);
    let interpolation =
        if is_nearest(&field) { Interpolation::Nearest } else { Interpolation::Linear };
    let options = VolumeOptions { interpolation, ..VolumeOptions::default() };
    let made = transfer
        .map_err(|e| e.to_string())
        .and_then(|t| Volume::new(grid, t, options).map_err(|e| e.to_string()));
    match made {
        Ok(volume) => Some(Arc::new(volume)),
        Err(e) => {
            diagnostics.error(volume, e);
            None
        }
    }
}

fn color(t: DataType, bytes: &[u8]) -> [f32; 4] {
    t.attribute(bytes)
}

/// The union of the point positions, 0..=1, of two evenly spaced lists.
fn knots(a: usize, b: usize) -> Vec<f32> {
    let of = |n: usize| (0..n).map(move |i| if n == 1 { 0.0 } else { i as f32 / (n - 1) as f32 });
    let mut all: Vec<f32> = of(a).chain(of(b)).collect();
    all.sort_unstable_by(f32::total_cmp);
    all.dedup();
    all
}

/// A list of values, evenly spaced over 0..=1.
fn at<T>(list: &[T], x: f32, value: impl Fn(&T) -> f32) -> f32 {
    let p = x * (list.len() - 1) as f32;
    let i = (p as usize).min(list.len() - 1);
    let (a, b) = (value(&list[i]), value(&list[(i + 1).min(list.len() - 1)]));
    a + (b - a) * (p - i as f32)
}
