//! Traces the deflection map, with one ray through the centre of every pixel, for comparison with
//! measurements and other programs.

use crate::film::{Framing, trace_parallel_unless_cancelled};
use crate::optics::Optics;
use crate::path::{Exit, LightPaths, Status};
use std::sync::atomic::AtomicBool;

/// Results of the rays through the pixels' centres, row by row from the top.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Map {
    /// Deflection along right and up; 0 where no light arrives.
    pub deflection_rad: Vec<[f32; 2]>,
    /// Shift of the ray in the plane of focus: where it seems to come from, or for BOS, where a ray
    /// from the camera hits the background, minus where it would without a flow.
    pub displacement_m: Vec<[f32; 2]>,
    /// For BOS, how far the dot that is at the pixel without a flow seems to move, along right and
    /// up: what correlating the image with the undisturbed one finds, with its sign. NaN where the
    /// dot is not seen. Empty for other techniques.
    pub apparent_m: Vec<[f32; 2]>,
    /// Optical path difference in the plane of focus, in waves; empty unless wanted.
    pub waves: Vec<f32>,
    /// Transmission: 1 for free rays, 0 for blocked ones.
    pub transmission: Vec<f32>,
    /// Magnitude of the largest deflection.
    pub largest_deflection_rad: f64,
    /// Magnitude of the largest displacement, where rays leave the field.
    pub largest_displacement_m: f64,
    /// Number of pixels whose ray does not arrive.
    pub dark: usize,
}

/// Traces the map. `blocked` returns whether a body blocks a start's ray. `None` when `cancel` was
/// set.
pub(crate) fn map(
    paths: &dyn LightPaths,
    optics: &Optics,
    framing: &Framing,
    wavelength_m: f64,
    n0: f64,
    blocked: impl Fn(&crate::path::Start) -> bool,
    cancel: &AtomicBool,
) -> Option<Map> {
    let starts = framing.pixel_centers();
    let mut exits = vec![Exit::UNDISTURBED; starts.len()];
    let whole = trace_parallel_unless_cancelled(paths, &starts, &mut exits, cancel, &|_| ());
    if !whole {
        return None;
    }
    let mut map = Map::default();
    for (start, exit) in starts.iter().zip(&exits) {
        let [dx, dy] = exit.deflection_rad;
        let dark = exit.status == Status::Turned
            || exit.transmission <= 0.0
            || !(dx.is_finite() && dy.is_finite())
            || blocked(start);
        map.dark += usize::from(dark);
        map.transmission.push(if dark { 0.0 } else { exit.transmission });
        map.deflection_rad.push(if dark { [0.0; 2] } else { exit.deflection_rad });
        map.displacement_m.push(if dark { [0.0; 2] } else { optics.film_shift_m(start, exit) });
        if paths.quantities().opd {
            let path_m = f64::from(optics.film_path_difference_m(exit, n0 as f32));
            map.waves.push(if dark { 0.0 } else { (path_m / wavelength_m) as f32 });
        }
        if !dark {
            let size = |v: [f32; 2]| f64::from(v[0]).hypot(f64::from(v[1]));
            map.largest_deflection_rad = map.largest_deflection_rad.max(size(exit.deflection_rad));
            map.largest_displacement_m = map.largest_displacement_m.max(size(exit.displacement_m));
        }
    }
    Some(map)
}
