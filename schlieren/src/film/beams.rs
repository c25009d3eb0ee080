//! Exposes a film without noise: a lattice of rays divides the beam into square cells, and the
//! energy of each cell goes to the area where its corners land.
//!
//! If the corners of a cell land on half of its original area, the film is twice as bright there.
//! The image is `I = Σ 1/|det J|` over all sheets of light, where J is the derivative of the
//! landing position. Here J is a finite difference over a cell, and the result is averaged over
//! pixels. Energy is conserved exactly, folded cells (caustics) add up, and no mapping has to be
//! inverted. A shadowgraph takes one ray per pixel instead of hundreds.
//!
//! Each cell is split into two triangles, whose energy is distributed to pixels by exact areas. A
//! triangle is dropped if one of its corners does not arrive, so the shadow of a body is up to one
//! cell too large.

use super::photons::Exposure;
use super::polygon_area::{polygon_in_pixels, triangle_area};
use super::signed_area::small_triangle_in_pixels;
use super::{Film, Framing, Tally, quantize, trace_unless_cancelled};
use crate::optics::PlaneVector;
use crate::path::{Exit, Start, Status};
use crate::technique::Photon;
use rayon::prelude::*;
use rt_core::sampler::Sampler;
use std::sync::atomic::{AtomicBool, Ordering};

/// Number of points that sample the source when there is no closed form.
const SOURCE_POINTS: u32 = 64;

/// The landing point of a cell's corner.
#[derive(Clone, Copy)]
struct Corner {
    /// Position in pixels; NaN if the ray did not arrive.
    at_px: [f64; 2],
    energy: [f32; 3],
}

const LOST: Corner = Corner { at_px: [f64::NAN; 2], energy: [0.0; 3] };

/// Exposes `film` with `per_side` × `per_side` cells per pixel and returns counts of triangles.
/// `progress` receives numbers of traced rays. Returns `None` when `cancel` was set.
/// `film.to_pixels(1.0)` is the image.
pub fn expose_beams<const C: usize>(
    exposure: &Exposure<'_>,
    film: &Film<C>,
    per_side: u32,
    cancel: &AtomicBool,
    progress: &(dyn Fn(u64) + Sync),
) -> Option<Tally> {
    let framing = *film.framing();
    let (k, margin) = (f64::from(per_side), exposure.margin_px);
    let columns = ((framing.width + 2 * margin) * per_side + 1) as usize;
    let rows = ((framing.height + 2 * margin) * per_side + 1) as usize;
    let position_px = |i: usize| i as f64 / k - f64::from(margin);
    let source_points = source_points(exposure);

    // A row of cells needs only two rows of corners. To trace in parallel, the cells are divided
    // into bands, each with its own corners.
    const BAND: usize = 16;
    let bands: Vec<usize> = (0..rows - 1).step_by(BAND).collect();
    let tallies: Vec<Tally> = bands
        .par_iter()
        .map(|&first| {
            let mut tally = Tally::default();
            if cancel.load(Ordering::Relaxed) {
                return tally;
            }
            let last = (first + BAND).min(rows - 1);
            let row_of = |row: usize| {
                let y = position_px(row);
                corners(exposure, film, &source_points, columns, y, &position_px, cancel)
            };
            let Some(mut above) = row_of(first) else { return tally };
            for row in first..last {
                let Some(below) = row_of(row + 1) else { return tally };
                for c in 0..columns - 1 {
                    let [a, b, d, e] = [above[c], above[c + 1], below[c], below[c + 1]];
                    // The diagonal alternates so that no direction is preferred.
                    let halves = if (row + c) % 2 == 0 {
                        [[a, b, d], [b, e, d]]
                    } else {
                        [[a, b, e], [a, e, d]]
                    };
                    for t in halves {
                        tally.sent += 1;
                        if t.iter().all(|p| p.at_px[0].is_finite()) {
                            tally.landed += 1;
                            tally.on_film += u64::from(deposit(film, t, 0.5 / (k * k)));
                        }
                    }
                }
                above = below;
            }
            progress(((last - first) * columns) as u64);
            tally
        })
        .collect();
    if cancel.load(Ordering::Relaxed) {
        return None;
    }
    let mut all = Tally::default();
    tallies.iter().for_each(|t| all.add(t));
    Some(all)
}

/// The start of the ray through a corner of the cells that divide the beam. Column 0 and row 0 are
/// the left and the top of the margin.
#[cfg(feature = "gpu")]
pub(crate) fn corner_of_cells(
    exposure: &Exposure<'_>,
    framing: &super::Framing,
    column_and_row: [usize; 2],
    per_side: u32,
) -> Start {
    let margin = f64::from(exposure.margin_px);
    let [x, y] = column_and_row.map(|i| i as f64 / f64::from(per_side) - margin);
    framing.start_at(x, y)
}

/// Points that sample the source; none when there is a closed form.
fn source_points(exposure: &Exposure<'_>) -> Vec<PlaneVector> {
    if !exposure.technique.needs_source_points() {
        return Vec::new();
    }
    let image = exposure.technique.optics().source_image();
    let point =
        |i| image.point_m(Sampler::new(exposure.sampling, exposure.seed, 0, 0, i).square(0));
    (0..SOURCE_POINTS).map(point).collect()
}

/// A row of corners at height `y` in pixels; `None` when `cancel` was set.
fn corners<const C: usize>(
    exposure: &Exposure<'_>,
    film: &Film<C>,
    source_points: &[PlaneVector],
    columns: usize,
    y: f64,
    position_px: &impl Fn(usize) -> f64,
    cancel: &AtomicBool,
) -> Option<Vec<Corner>> {
    let (framing, technique) = (film.framing(), exposure.technique);
    let starts: Vec<Start> = (0..columns).map(|i| framing.start_at(position_px(i), y)).collect();
    let mut exits = vec![Exit::UNDISTURBED; columns];
    if !trace_unless_cancelled(exposure.paths, &starts, &mut exits, cancel) {
        return None;
    }
    let corner = |(i, (start, exit)): (usize, (&Start, &Exit))| {
        let stopped = exit.status == Status::Turned || exit.transmission <= 0.0;
        if stopped || exposure.solids.is_some_and(|s| s.block(exposure.paths.view(), start)) {
            return LOST;
        }
        let shift_m = technique.optics().film_shift_m(start, exit);
        let of = |image_point_m| {
            technique.attenuated_energy(&Photon { start, exit, image_point_m, shift_m })
        };
        let mut energy = [0.0f32; 3];
        match source_points {
            [] => energy = of([0.0; 2]),
            points => points.iter().for_each(|&p| {
                let e = of(p);
                (0..3).for_each(|c| energy[c] += e[c] / points.len() as f32);
            }),
        }
        let shift = if technique.samples_from_film() { [0.0; 2] } else { shift_m.map(f64::from) };
        // The lattice is exact and the shift is small, so areas keep the relative accuracy of the
        // shift.
        let at_px = [position_px(i) + shift[0] / framing.pixel_m, y - shift[1] / framing.pixel_m];
        Corner { at_px, energy }
    };
    Some(starts.iter().zip(&exits).enumerate().map(corner).collect())
}

/// Distributes the energy of a triangle: `area_px` is its original area, and its energy per pixel
/// is the mean of its corners'. Returns whether any part falls on the film.
fn deposit<const C: usize>(film: &Film<C>, t: [Corner; 3], area_px: f64) -> bool {
    let Framing { width, height, .. } = *film.framing();
    let energy: [f64; C] = std::array::from_fn(|c| {
        t.iter().map(|p| f64::from(p.energy[c])).sum::<f64>() / 3.0 * area_px
    });
    let points = t.map(|p| p.at_px);
    let area = triangle_area(&points);
    let mut any = false;
    let mut add_share = |[x, y]: [u32; 2], share: f64| {
        let shared = energy.map(|e| quantize((e * share) as f32));
        film.add(y as usize * width as usize + x as usize, shared, 0);
        any = true;
    };
    // A triangle in a focus has no area, so all of its energy goes to one pixel.
    if area < 1e-9 {
        point_in_pixels(&points, [width, height], add_share);
    } else if !small_triangle_in_pixels(&points, area, [width, height], &mut add_share) {
        polygon_in_pixels(&points, area, [width, height], add_share);
    }
    any
}

/// All of a triangle without area in the pixel of its middle.
fn point_in_pixels(points: &[[f64; 2]; 3], size: [u32; 2], mut add: impl FnMut([u32; 2], f64)) {
    let middle = [0, 1].map(|i| ((points[0][i] + points[1][i] + points[2][i]) / 3.0).floor());
    if [0, 1].iter().all(|&i| (0.0..f64::from(size[i])).contains(&middle[i])) {
        add(middle.map(|m| m as u32), 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(x: f64, y: f64) -> Corner {
        Corner { at_px: [x, y], energy: [1.0; 3] }
    }

    #[test]
    fn a_triangle_over_many_pixels_gives_each_its_area() {
        let film = Film::<1>::new(Framing::fitted(4, 4, [1.0, 1.0]), false);
        // The two halves of the square 0..3 x 0..3, with opposite orientations, which count alike.
        assert!(deposit(&film, [corner(0.0, 0.0), corner(3.0, 0.0), corner(0.0, 3.0)], 4.5));
        assert!(deposit(&film, [corner(3.0, 3.0), corner(3.0, 0.0), corner(0.0, 3.0)], 4.5));
        let f = film.to_pixels(1.0);
        for y in 0..4 {
            for x in 0..4 {
                let expected = if x < 3 && y < 3 { 1.0 } else { 0.0 };
                assert!((f[y * 4 + x][0] - expected).abs() < 1e-6, "{x} {y}: {}", f[y * 4 + x][0]);
            }
        }
    }

    #[test]
    fn a_point_focus_keeps_all_its_energy() {
        let film = Film::<1>::new(Framing::fitted(4, 4, [1.0, 1.0]), false);
        assert!(deposit(&film, [corner(2.5, 1.5); 3], 0.5));
        assert_eq!(film.to_pixels(1.0)[4 + 2], [0.5]);
        assert!(!deposit(&film, [corner(-2.5, 1.5); 3], 0.5), "beside the film");
    }

    #[test]
    fn triangles_half_outside_leave_only_their_inside() {
        let film = Film::<1>::new(Framing::fitted(2, 2, [1.0, 1.0]), false);
        deposit(&film, [corner(-2.0, 0.0), corner(2.0, 0.0), corner(0.0, 2.0)], 4.0);
        let sum: f32 = film.to_pixels(1.0).iter().map(|e| e[0]).sum();
        assert!((sum - 2.0).abs() < 1e-6, "{sum}");
    }
}
