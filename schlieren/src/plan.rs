//! From a tolerance in radians to a march: mode, interpolant and step, with the bound that chose them and the error that was measured.
//!
//! Three errors add up. What follows bounds or estimates each from the lattice alone, in one pass over it, with G the largest gradient, H the largest
//! second derivative, F the largest fourth difference (all per metre and direction), L the longest way through the field, h the spacing:
//!
//! * **Bending** (line of sight leaves it out): a ray strays by at most G L^2/2, so its gradient is off by H times that: `H G L^3 / 6`.
//! * **Step** (Verlet): one step's error is `dt^3/24` times the second derivative of the gradient along the ray, so over L it is
//!   `L h_step^2 / 24 * T` with T the largest third derivative; Euler's is not offered.
//! * **Interpolation**: the spline's derivative is off by about `h^3/24 * F` (fourth derivative; de Boor's bound for the derivative of the complete cubic
//!   spline is h^3/24), trilinear gradients' by `h^2/6 * T`, trilinear eps' by `h/2 * H`; over L.
//!
//! All are worst cases of worst points added up along the whole path: real errors are ten to a thousand times smaller. So the plan then traces a few hundred rays
//! twice, as planned and with everything refined, and reports that difference as the achieved error.

use crate::field::Field;
use crate::interpolate::{BSpline, Interpolant};
use crate::march::{BlankCells, Deviational, Full, FullOptions, Kept, Options, Pefrl, Projection, Scheme};
use crate::path::{Exit, LightPaths, Start, Status, Wanted};
use crate::view::View;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::Arc;

/// How light is taken through the field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Mode {
    /// Straight, projected once.
    LineOfSight,
    /// Deviations from straight, Verlet in f32.
    Paraxial,
    /// PEFRL in f64.
    Full,
}

/// What a user asks for. What is `None` is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Request {
    /// Largest error of the deflection that is fine. Zero and below: as accurate as can be. A lattice that is itself coarser than this sets the steps
    /// instead.
    pub tolerance_rad: f64,
    /// Forces a mode.
    pub mode: Option<Mode>,
    /// Forces an interpolant.
    pub interpolant: Option<Interpolant>,
    /// Forces a step.
    pub step_voxels: Option<f64>,
    /// What to compute beside deflection and displacement.
    pub wanted: Wanted,
    /// What becomes of light in cells without data.
    pub blank: BlankCells,
    /// [`Options::skip_rad`], for [`Mode::Paraxial`].
    pub skip_rad: f64,
    /// [`Options::skip_opd_m`].
    pub skip_opd_m: f64,
}

/// Largest values in a field, per metre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Roughness {
    /// |grad eps|.
    pub gradient: f64,
    /// Second derivatives.
    pub second: f64,
    /// Third derivatives.
    pub third: f64,
    /// Fourth derivatives.
    pub fourth: f64,
    /// |eps|.
    pub eps: f64,
}

/// A bound for each kind of error, in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Of leaving out that rays bend.
    pub bending_rad: f64,
    /// Of the interpolant.
    pub interpolation_rad: f64,
    /// Of the step.
    pub step_rad: f64,
    /// Largest deflection that is possible.
    pub deflection_rad: f64,
}

/// The choice, and why.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plan {
    /// As asked.
    pub request: Request,
    /// The mode.
    pub mode: Mode,
    /// The interpolant.
    pub interpolant: Interpolant,
    /// The longest step, in lattice steps.
    pub step_voxels: f64,
    /// Bounds of its errors, before anything was traced.
    pub bounds: Bounds,
    /// What was found in the field.
    pub roughness: Roughness,
}

/// Error of a plan, measured by tracing some rays with everything refined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Achieved {
    /// Largest error of deflection: the step, the mode and the arithmetic.
    pub max_rad: f64,
    /// Its root mean square.
    pub rms_rad: f64,
    /// How well the field itself is resolved: the largest change of deflection when every other node is left out, divided by 8 (the spline's
    /// derivative is of third order). Infinite when the field has too few nodes to tell.
    pub resolution_rad: f64,
    /// Rays compared.
    pub rays: usize,
}

impl Roughness {
    /// One pass over the lattice, in parallel.
    pub fn of(field: &Field) -> Roughness {
        let d = field.dims();
        let eps = field.eps();
        let stride = [1, d[0], d[0] * d[1]];
        let rcp_h = field.spacing_m().map(|h| 1.0 / h);
        // Differences of order 1 to 4 along each axis. Mixed derivatives are bounded by sums of these only in the mean; the square root of
        // the three axes' squares is what is used.
        let row = |r: usize| {
            let (j, k) = (r % d[1], r / d[1]);
            let mut worst = [0.0f64; 5];
            for i in 0..d[0] {
                let o = i + r * d[0];
                let at = [i, j, k];
                let mut squares = [0.0f64; 5];
                worst[4] = worst[4].max(f64::from(eps[o]).abs());
                for c in 0..3 {
                    let v = |n: usize| f64::from(eps[o + n * stride[c]]);
                    let left = d[c] - 1 - at[c];
                    let h = rcp_h[c];
                    if left >= 1 {
                        squares[0] += ((v(1) - v(0)) * h).powi(2);
                    }
                    if left >= 2 {
                        squares[1] += ((v(2) - 2.0 * v(1) + v(0)) * h * h).powi(2);
                    }
                    if left >= 3 {
                        squares[2] += ((v(3) - 3.0 * (v(2) - v(1)) - v(0)) * h.powi(3)).powi(2);
                    }
                    if left >= 4 {
                        squares[3] += ((v(4) - 4.0 * (v(3) + v(1)) + 6.0 * v(2) + v(0)) * h.powi(4)).powi(2);
                    }
                }
                for q in 0..4 {
                    worst[q] = worst[q].max(squares[q]);
                }
            }
            worst
        };
        let worst = (0..d[1] * d[2])
            .into_par_iter()
            .map(row)
            .reduce(|| [0.0; 5], |a, b| [0, 1, 2, 3, 4].map(|q: usize| a[q].max(b[q])));
        Roughness {
            gradient: worst[0].sqrt(),
            second: worst[1].sqrt(),
            third: worst[2].sqrt(),
            fourth: worst[3].sqrt(),
            eps: worst[4],
        }
    }
}

/// Shortest step that is chosen: below it nothing gets better on interpolated fields.
const SHORTEST_STEP: f64 = 0.125;

impl Plan {
    /// Chooses the cheapest march whose bounds are within the tolerance; if none is, the most accurate.
    pub fn new(field: &Field, request: Request) -> Plan {
        let roughness = Roughness::of(field);
        Self::from_roughness(field, request, roughness)
    }

    /// [`Plan::new`] for a field whose roughness is known.
    pub fn from_roughness(field: &Field, request: Request, roughness: Roughness) -> Plan {
        let length_m = field.size_m().length();
        let h_m = DVec3::from(field.spacing_m()).max_element();
        let r = roughness;
        let tolerance = request.tolerance_rad.max(0.0);
        let bending_rad = r.second * r.gradient * length_m.powi(3) / 6.0;
        let deflection_rad = r.gradient * length_m;

        // Strong index: deflections for which "paraxial" is a courtesy, or an index far from the reference's.
        let strong = r.eps > 0.05 || deflection_rad > 0.5 && r.eps > 0.01;
        let mode = request.mode.unwrap_or(if strong {
            Mode::Full
        } else if bending_rad <= 0.5 * tolerance {
            Mode::LineOfSight
        } else {
            Mode::Paraxial
        });

        // The cheapest interpolant that is good enough. Line of sight is as fast with the spline as without.
        let of_interpolant = |i: Interpolant| match i {
            Interpolant::BSpline => length_m * h_m.powi(3) / 24.0 * r.fourth,
            Interpolant::TrilinearGradient => length_m * h_m.powi(2) / 6.0 * r.third,
            Interpolant::Trilinear => length_m * h_m / 2.0 * r.second,
        };
        let interpolant = request.interpolant.unwrap_or(
            if mode == Mode::Paraxial && of_interpolant(Interpolant::Trilinear) <= 0.5 * tolerance {
                Interpolant::Trilinear
            } else {
                Interpolant::BSpline
            },
        );

        // The longest step that is good enough, in powers of two from one voxel.
        let of_step = |voxels: f64| match mode {
            Mode::LineOfSight => 0.0,
            Mode::Paraxial => length_m * (voxels * h_m).powi(2) / 24.0 * r.third,
            // Fourth order: the constant of PEFRL is about 1/5000 (Omelyan 2002, table 2), times a fifth derivative that a spline does not have.
            Mode::Full => length_m * (voxels * h_m).powi(3) / 200.0 * r.fourth,
        };
        // A quarter of the tolerance while the interpolant's bound leaves it; where the lattice itself is off by more, a third of that bound, which is the same
        // number where the two cases meet. Shorter steps would only cost time. Zero asks for all there is.
        let share =
            if tolerance > 0.0 { (tolerance / 4.0).max(of_interpolant(interpolant) / 3.0) } else { 0.0 };
        let step_voxels = request.step_voxels.unwrap_or_else(|| {
            let mut step = 1.0;
            while step > SHORTEST_STEP && of_step(step) > share {
                step *= 0.5;
            }
            step
        });
        let bounds = Bounds {
            bending_rad: if mode == Mode::LineOfSight { bending_rad } else { 0.0 },
            interpolation_rad: of_interpolant(interpolant),
            step_rad: of_step(step_voxels),
            deflection_rad,
        };
        Plan { request, mode, interpolant, step_voxels, bounds, roughness }
    }

    /// The march as planned.
    pub fn paths<'a>(&self, field: &'a Field, view: View) -> Box<dyn LightPaths + 'a> {
        self.paths_with(field, view, &Kept::default())
    }

    /// [`Plan::paths`] with what was prepared for this field before.
    pub fn paths_with<'a>(&self, field: &'a Field, view: View, kept: &Kept) -> Box<dyn LightPaths + 'a> {
        let (wanted, blank) = (self.request.wanted, self.request.blank);
        match self.mode {
            Mode::LineOfSight => {
                let projection = Projection { view, interpolant: self.interpolant, wanted, blank };
                Box::new(kept.line_of_sight(field, projection))
            }
            Mode::Paraxial => {
                let options = Options {
                    scheme: Scheme::Verlet,
                    step_voxels: self.step_voxels,
                    wanted,
                    blank,
                    skip_rad: self.request.skip_rad,
                    skip_opd_m: self.request.skip_opd_m,
                };
                Box::new(Deviational::with_kept(field, view, self.interpolant, options, kept))
            }
            Mode::Full => {
                let options =
                    FullOptions { step_voxels: self.step_voxels, wanted, blank, ..FullOptions::default() };
                Box::new(FullSpline { field, spline: kept.spline(field), view, options })
            }
        }
    }

    /// Traces about `rays` rays of a view as planned and once more with everything refined (quarter steps, splines, bending, nothing
    /// left out), and compares.
    pub fn measure(&self, field: &Field, view: View, rays: usize) -> Achieved {
        self.measure_with(field, view, rays, &Kept::default())
    }

    /// [`Plan::measure`] with what was prepared for this field before.
    pub fn measure_with(&self, field: &Field, view: View, rays: usize, kept: &Kept) -> Achieved {
        let starts = sample_starts(field, &view, rays.max(1));
        let mut planned = vec![Exit::UNDISTURBED; starts.len()];
        self.paths_with(field, view, kept).trace_parallel(&starts, &mut planned);
        let mut refined = planned.clone();
        let fine = Plan {
            mode: if self.mode == Mode::Full { Mode::Full } else { Mode::Paraxial },
            interpolant: Interpolant::BSpline,
            step_voxels: 0.25 * self.step_voxels,
            request: Request { skip_rad: 0.0, ..self.request },
            ..*self
        };
        fine.paths_with(field, view, kept).trace_parallel(&starts, &mut refined);
        let (max_rad, rms_rad, rays) = compare(&planned, &refined);
        let resolution_rad = coarsened(field).map_or(f64::INFINITY, |coarse| {
            let mut other = planned.clone();
            fine.paths(&coarse, view).trace_parallel(&starts, &mut other);
            compare(&other, &refined).0 / 8.0
        });
        Achieved { max_rad, rms_rad, resolution_rad, rays }
    }
}

/// Largest and root mean square difference of the deflections of rays that got through in both.
fn compare(a: &[Exit], b: &[Exit]) -> (f64, f64, usize) {
    let (mut max, mut sum, mut rays) = (0.0f64, 0.0, 0);
    for (a, b) in a.iter().zip(b) {
        if a.status == Status::Free && b.status == Status::Free {
            let d: [f64; 2] = [0, 1].map(|c| f64::from(a.deflection_rad[c]) - f64::from(b.deflection_rad[c]));
            let d = d[0].hypot(d[1]);
            max = max.max(d);
            sum += d * d;
            rays += 1;
        }
    }
    (max, if rays > 0 { (sum / rays as f64).sqrt() } else { 0.0 }, rays)
}

/// Starts spread evenly over the picture of the field (the R2 sequence of Roberts 2018: the plane's golden ratio).
fn sample_starts(field: &Field, view: &View, rays: usize) -> Vec<Start> {
    let half = [view.right, view.up].map(|axis| 0.5 * (field.size_m() * axis.abs()).element_sum());
    let offset = [view.right, view.up].map(|axis| (field.centre_m() - view.centre_m).dot(axis));
    (0..rays)
        .map(|i| {
            let at = [0.754_877_666_246_692_7, 0.569_840_290_998_053_3]
                .map(|a: f64| (0.5 + a * (i + 1) as f64).fract());
            let position_m = [0, 1].map(|c| (offset[c] + (2.0 * at[c] - 1.0) * half[c]) as f32);
            Start { position_m, tilt_rad: [0.0; 2] }
        })
        .collect()
}

/// Every other node. `None` when that leaves fewer than four along an axis.
fn coarsened(field: &Field) -> Option<Field> {
    let d = field.dims();
    let half = d.map(|n| n.div_ceil(2));
    if half.iter().any(|n| *n < 4) {
        return None;
    }
    let o = |i: usize| {
        let at = [i % half[0], i / half[0] % half[1], i / (half[0] * half[1])];
        2 * at[0] + d[0] * (2 * at[1] + d[1] * 2 * at[2])
    };
    let count = half.iter().product();
    let eps = (0..count).map(|i| field.eps()[o(i)]).collect();
    let nodes = field.nodes().map(|n| (0..count).map(|i| n[o(i)]).collect());
    Field::new(half, field.spacing_m().map(|h| 2.0 * h), field.origin_m(), eps, field.n0(), nodes).ok()
}

/// [`Full`] that owns its spline.
struct FullSpline<'a> {
    field: &'a Field,
    spline: Arc<BSpline>,
    view: View,
    options: FullOptions,
}

impl LightPaths for FullSpline<'_> {
    fn trace(&self, starts: &[Start], exits: &mut [Exit]) {
        Full::new(self.field, &*self.spline, Pefrl, self.view, self.options).trace(starts, exits);
    }

    fn view(&self) -> &View {
        &self.view
    }

    fn wanted(&self) -> Wanted {
        self.options.wanted
    }

    fn difference_step_m(&self) -> f64 {
        0.5 * DVec3::from(self.field.spacing_m()).min_element()
    }
}
