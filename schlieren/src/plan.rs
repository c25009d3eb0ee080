//! Chooses mode, interpolant and step of a march from a tolerance in radians, with error bounds and
//! the measured error.
//!
//! The errors add up. Each has a bound that follows from the lattice alone, in one pass over it
//! ([`DerivativeBounds`]). G is the largest gradient, H the largest second and T the largest third
//! derivative (mixed ones included), and F the largest fourth derivative along an axis, all per
//! metre. L is the longest path through the field, h the spacing, and theta = G L the largest
//! deflection.
//!
//! * **Bending**, which line of sight neglects: after a path s, a ray has moved by at most G s²/2.
//!   The error of its gradient is H times that, in total `H G L³ / 6`. The path is longer by at
//!   most a fraction theta²/2, which adds `theta³ / 2`. The error of the optical path is `G² L³ /
//!   3`.
//! * **Step** (Verlet): a step of length k samples the gradient at its midpoint. Its error is
//!   `k²/24` times the gradient's second derivative along the ray, `T + H G` (the ray bends by G).
//!   Over L this is `L k² / 24 (T + H G)`. Line of sight in an oblique view takes steps of one
//!   voxel.
//! * **Interpolation**, over L: the error of the spline's derivative is about `h³/24 F` (de Boor's
//!   bound for the derivative of the complete cubic spline). For trilinear gradients it is `h²/6
//!   T`. For trilinear eps it is `h/2` times the second derivatives along the axes, plus `h²/8 T`.
//! * **Edges**: in an oblique view, deflections have a kink where rays pass an edge of the field,
//!   unless the gradient there is zero. Line of sight interpolates across the kink.
//!
//! An error of the gradient displaces the ray, which changes the gradient along the rest of its
//! path. Errors of steps and interpolants therefore grow by at most `cosh(√H L)` (Gronwall).
//!
//! These bounds assume the worst point along the whole path. Real errors are ten to a thousand
//! times smaller. [`Plan::measure`] therefore traces a few hundred rays twice, as planned and with
//! everything refined, and reports the difference as the achieved error. It also traces them
//! through an interpolant of higher order to estimate how well the lattice resolves the flow. (An
//! extrapolation from coarser lattices was used before. It says little where these do not resolve
//! what the lattice does, and lattices with an even number of nodes have no such half.)

use crate::field::Field;
use crate::interpolate::{Interpolant, Lagrange};
use crate::march::{
    BlankCells, Deviational, FieldCache, FieldInterpolant, Full, FullOfField, FullOptions, Options,
    Pefrl, Projection, Scheme, Verlet,
};
use crate::path::{Exit, LightPaths, PathQuantities, Start, Status};
use crate::view::View;
use glam::DVec3;
use mesh_error::largest_deflection;

mod mesh_error;
mod refine;

pub use crate::derivative_bounds::DerivativeBounds;

/// How light is traced through the field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Mode {
    /// Straight rays; the field is projected once.
    LineOfSight,
    /// Deviations from the straight ray, by Verlet steps in f32.
    Paraxial,
    /// Bent rays, by PEFRL steps in f64.
    Full,
}

/// The user's requirements. The plan chooses whatever is `None`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Request {
    /// Largest acceptable error of the deflection. Zero or below means as accurate as possible. If
    /// the interpolation error of the lattice is larger than this, that error sets the steps
    /// instead.
    pub tolerance_rad: f64,
    /// Direction of the light, which sets the longest path through the field. `None` means any
    /// direction.
    pub direction: Option<DVec3>,
    /// Mode to use.
    pub mode: Option<Mode>,
    /// Interpolant to use.
    pub interpolant: Option<Interpolant>,
    /// Step to use, in lattice steps.
    pub step_voxels: Option<f64>,
    /// Quantities to compute besides deflection and displacement. The optical path, if requested,
    /// may have an error of up to the tolerance times the longest path through the field. This is
    /// consistent with the tolerance, because the slope of the optical path is a deflection.
    pub quantities: PathQuantities,
    /// How cells without data treat light.
    pub blank: BlankCells,
    /// [`Options::skip_rad`], for [`Mode::Paraxial`].
    pub skip_rad: f64,
    /// [`Options::skip_opd_m`].
    pub skip_opd_m: f64,
}

/// A bound for each kind of error. Angles are in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Error of neglecting that rays bend.
    pub bending_rad: f64,
    /// Error of the interpolant.
    pub interpolation_rad: f64,
    /// Error of the step.
    pub step_rad: f64,
    /// Error of interpolating across edges.
    pub edges_rad: f64,
    /// Error of the optical path from steps and from neglecting that rays bend, in metres.
    pub path_m: f64,
    /// Largest possible deflection.
    pub deflection_rad: f64,
}

impl Bounds {
    /// Sum of all errors of a deflection.
    pub fn total_rad(&self) -> f64 {
        self.bending_rad + self.interpolation_rad + self.step_rad + self.edges_rad
    }
}

/// The chosen march, with the bounds of its error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plan {
    /// The request that this plan answers.
    pub request: Request,
    /// The mode.
    pub mode: Mode,
    /// The interpolant.
    pub interpolant: Interpolant,
    /// The longest step, in lattice steps.
    pub step_voxels: f64,
    /// Bounds of its errors, known before any ray is traced.
    pub bounds: Bounds,
    /// The largest derivatives of the field.
    pub derivative_bounds: DerivativeBounds,
}

/// Error of a plan, measured by comparing some rays with a refined march.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredError {
    /// Largest error of the deflection, from the step, the mode and the arithmetic.
    pub max_rad: f64,
    /// Root mean square of the same error.
    pub rms_rad: f64,
    /// Error of the deflection due to the field's finite lattice, estimated from the largest
    /// difference between rays through the spline and rays through polynomials of fifth degree,
    /// both of the same nodes. Infinite when the field has too few nodes for an estimate.
    pub resolution_rad: f64,
    /// Error of the deflection due to the mesh that the field was resampled from, estimated from
    /// what the last degree of the polynomials between its points adds, and those beyond would.
    /// `None` for a field that comes from no mesh.
    pub mesh_rad: Option<f64>,
    /// Number of rays compared.
    pub rays: usize,
}

impl MeasuredError {
    /// The error of the flow itself, which no march can mend: that of its lattice, if there is an
    /// estimate, and that of its mesh.
    pub fn of_flow_rad(&self) -> f64 {
        Some(self.resolution_rad).filter(|r| r.is_finite()).unwrap_or(0.0)
            + self.mesh_rad.unwrap_or(0.0)
    }

    /// The sum of all errors.
    pub fn total_rad(&self) -> f64 {
        self.max_rad + self.of_flow_rad()
    }
}

/// Shortest step that a plan chooses. Shorter steps do not improve the result on interpolated
/// fields.
const SHORTEST_STEP: f64 = 0.125;

impl Plan {
    /// Chooses the cheapest march whose bounds are within the tolerance, or the most accurate march
    /// if none is.
    pub fn new(field: &Field, request: Request) -> Plan {
        let derivative_bounds = DerivativeBounds::new(field);
        Self::from_derivative_bounds(field, request, derivative_bounds)
    }

    /// [`Plan::new`] for a field whose derivative bounds are known.
    pub fn from_derivative_bounds(
        field: &Field,
        request: Request,
        derivative_bounds: DerivativeBounds,
    ) -> Plan {
        let box_path = BoxPath::new(field, request.direction);
        let (length_m, h_m) = (box_path.longest_m, DVec3::from(field.spacing_m()).max_element());
        let r = derivative_bounds;
        let tolerance = request.tolerance_rad.max(0.0);
        let deflection_rad = r.gradient * length_m;
        // Limited to about e^50, which exceeds any tolerance but is still finite.
        let growth = (r.second.sqrt() * length_m).min(50.0).cosh();

        let bending_rad =
            r.second * r.gradient * length_m.powi(3) / 6.0 + deflection_rad.powi(3) / 2.0;
        let bending_path_m = deflection_rad.powi(2) * length_m / 3.0;
        let edges_rad = r.gradient_on_faces * box_path.edges_m(h_m);
        let steps_rad = |voxels: f64| {
            growth * length_m * (voxels * h_m).powi(2) / 24.0 * (r.third + r.second * r.gradient)
        };
        let interpolant_error_rad = |i: Interpolant| {
            let per_m = match i {
                Interpolant::BSpline => h_m.powi(3) / 24.0 * r.fourth,
                Interpolant::TrilinearGradient => h_m.powi(2) / 6.0 * r.third,
                Interpolant::Trilinear => {
                    h_m / 2.0 * r.second_along_axes + h_m.powi(2) / 8.0 * r.third
                }
            };
            growth * length_m * per_m
        };
        // The share of steps is a quarter of the tolerance. Where the interpolant's bound is more
        // than three quarters of it, the share is a third of that bound, because shorter steps
        // would only cost time. The two shares are equal at that point. Tolerance zero requests the
        // highest accuracy.
        let share = |i| {
            if tolerance > 0.0 {
                (tolerance / 4.0).max(interpolant_error_rad(i) / 3.0)
            } else {
                0.0
            }
        };

        // Strong index: deflections too large for the paraxial mode, or an index far from the
        // reference index.
        let strong = r.eps > 0.05 || deflection_rad > 0.5 && r.eps > 0.01;
        // Error of projections, which have no steps.
        let projected_rad = if box_path.oblique { steps_rad(1.0) } else { 0.0 };
        let spline = request.interpolant.unwrap_or(Interpolant::BSpline);
        let straight_is_enough = bending_rad + edges_rad <= 0.5 * tolerance
            && projected_rad <= share(spline)
            && (!request.quantities.opd || bending_path_m <= 0.5 * tolerance * length_m);
        let mode = request.mode.unwrap_or(if strong {
            Mode::Full
        } else if straight_is_enough {
            Mode::LineOfSight
        } else {
            Mode::Paraxial
        });

        // The cheapest interpolant within the tolerance. Line of sight is as fast with the spline
        // as with the trilinear interpolants.
        let interpolant = request.interpolant.unwrap_or(
            if mode == Mode::Paraxial
                && interpolant_error_rad(Interpolant::Trilinear) <= 0.5 * tolerance
            {
                Interpolant::Trilinear
            } else {
                Interpolant::BSpline
            },
        );

        // The longest step within the tolerance, found by halving from one voxel.
        let step_error_rad = |voxels: f64| match mode {
            Mode::LineOfSight => projected_rad,
            Mode::Paraxial => steps_rad(voxels),
            // PEFRL is of fourth order with a constant of about 1/5000 (Omelyan 2002, table 2),
            // times a fifth derivative. A spline does not have that derivative.
            Mode::Full => growth * length_m * (voxels * h_m).powi(3) / 200.0 * r.fourth,
        };
        // Optical paths are summed at the same positions. The error of eps there comes from its
        // second derivative along the ray.
        let path_error_m = |voxels: f64| match mode {
            Mode::LineOfSight => {
                if box_path.oblique {
                    length_m * h_m.powi(2) / 24.0 * r.second
                } else {
                    0.0
                }
            }
            Mode::Paraxial => {
                length_m * (voxels * h_m).powi(2) / 24.0 * (r.second + r.gradient.powi(2))
            }
            Mode::Full => 0.0,
        };
        let share_rad = share(interpolant);
        let good_enough = |voxels: f64| {
            let path_is =
                !request.quantities.opd || path_error_m(voxels) <= 0.25 * tolerance * length_m;
            step_error_rad(voxels) <= share_rad && (path_is || share_rad > tolerance)
        };
        let step_voxels = request.step_voxels.unwrap_or_else(|| {
            let mut step = 1.0;
            while step > SHORTEST_STEP && !good_enough(step) {
                step *= 0.5;
            }
            step
        });
        let straight = mode == Mode::LineOfSight;
        let bounds = Bounds {
            bending_rad: if straight { bending_rad } else { 0.0 },
            // Oblique projections are interpolated a second time, as maps.
            interpolation_rad: interpolant_error_rad(interpolant)
                * if straight && box_path.oblique { 2.0 } else { 1.0 },
            step_rad: step_error_rad(step_voxels),
            edges_rad: if straight { edges_rad } else { 0.0 },
            path_m: path_error_m(step_voxels) + if straight { bending_path_m } else { 0.0 },
            deflection_rad,
        };
        Plan { request, mode, interpolant, step_voxels, bounds, derivative_bounds }
    }

    /// The planned march through a field.
    pub fn paths<'a>(&self, field: &'a Field, view: View) -> Box<dyn LightPaths + 'a> {
        self.paths_with(field, view, &FieldCache::default())
    }

    /// [`Plan::paths`] that reuses what `cache` holds for this field.
    pub fn paths_with<'a>(
        &self,
        field: &'a Field,
        view: View,
        cache: &FieldCache,
    ) -> Box<dyn LightPaths + 'a> {
        let (quantities, blank) = (self.request.quantities, self.request.blank);
        match self.mode {
            Mode::LineOfSight => {
                let projection =
                    Projection { view, interpolant: self.interpolant, quantities, blank };
                Box::new(cache.line_of_sight(field, projection))
            }
            Mode::Paraxial => {
                let options = Options {
                    scheme: Scheme::Verlet,
                    step_voxels: self.step_voxels,
                    quantities,
                    blank,
                    skip_rad: self.request.skip_rad,
                    skip_opd_m: self.request.skip_opd_m,
                };
                Box::new(Deviational::with_cache(field, view, self.interpolant, options, cache))
            }
            Mode::Full => {
                let options = FullOptions {
                    step_voxels: self.step_voxels,
                    quantities,
                    blank,
                    ..FullOptions::default()
                };
                let spline = FieldInterpolant::BSpline(cache.spline(field));
                Box::new(FullOfField::new(field, spline, Pefrl, view, options))
            }
        }
    }

    /// Measures the error: traces about `rays` rays of a view as planned and with everything
    /// refined (quarter steps, splines, bending, no skipping), and compares them.
    pub fn measure(&self, field: &Field, view: View, rays: usize) -> MeasuredError {
        self.measure_with(field, view, rays, &FieldCache::default())
    }

    /// The starts of about `rays` rays that are compared.
    fn measured_starts(&self, field: &Field, view: View, rays: usize) -> Vec<Start> {
        let mut starts = sample_starts(field.size_m(), field.centre_m(), &view, rays.max(1));
        // Of a flow that is smooth but for the rounding of its values, no place is special.
        let (r, h_m) = (self.derivative_bounds, DVec3::from(field.spacing_m()).min_element());
        if r.fourth * h_m.powi(4) > ROUNDED_DIFFERENCE * r.eps {
            starts.extend(starts_around(field, r.fourth_at, &view));
        }
        starts
    }

    /// The starts of the rays that are compared, and this plan's error.
    fn sample(
        &self,
        field: &Field,
        view: View,
        rays: usize,
        cache: &FieldCache,
    ) -> (Vec<Start>, MeasuredError) {
        let starts = self.measured_starts(field, view, rays);
        let (max_rad, rms_rad, rays) = self.march_error(field, view, &starts, cache);
        let resolution_rad = self.resolution_error(field, view, &starts, cache);
        let mesh_rad = mesh_error::mesh_error(field, view, &starts);
        let mut error = MeasuredError { max_rad, rms_rad, resolution_rad, mesh_rad, rays };
        let of_flow_rad = error.of_flow_rad();
        if let Some(mesh_rad) = &mut error.mesh_rad {
            let factor = mesh_error::further_degrees(field, view, &starts, of_flow_rad);
            error.resolution_rad *= factor;
            *mesh_rad *= factor;
        }
        (starts, error)
    }

    /// [`Plan::measure`] that reuses what `cache` holds for this field.
    pub fn measure_with(
        &self,
        field: &Field,
        view: View,
        rays: usize,
        cache: &FieldCache,
    ) -> MeasuredError {
        self.sample(field, view, rays, cache).1
    }

    /// The error of the march of `paths`, which another device makes by this plan, in place of that
    /// of the CPU's.
    #[cfg(feature = "gpu")]
    pub(crate) fn measure_paths(
        &self,
        known: MeasuredError,
        paths: &dyn LightPaths,
        field: &Field,
        rays: usize,
        cache: &FieldCache,
    ) -> MeasuredError {
        let starts = self.measured_starts(field, *paths.view(), rays);
        let (max_rad, rms_rad, rays) = self.error_of_paths(paths, field, &starts, cache);
        MeasuredError { max_rad, rms_rad, rays, ..known }
    }

    /// Largest and root mean square error of the march alone, and the number of rays compared.
    fn march_error(
        &self,
        field: &Field,
        view: View,
        starts: &[Start],
        cache: &FieldCache,
    ) -> (f64, f64, usize) {
        self.error_of_paths(&*self.paths_with(field, view, cache), field, starts, cache)
    }

    /// [`Plan::march_error`] of paths that are made elsewhere by this plan.
    fn error_of_paths(
        &self,
        paths: &dyn LightPaths,
        field: &Field,
        starts: &[Start],
        cache: &FieldCache,
    ) -> (f64, f64, usize) {
        let mut planned = vec![Exit::UNDISTURBED; starts.len()];
        paths.trace_parallel(starts, &mut planned);
        let mut refined = planned.clone();
        let fine = Plan {
            mode: if self.mode == Mode::Full { Mode::Full } else { Mode::Paraxial },
            interpolant: Interpolant::BSpline,
            step_voxels: 0.25 * self.step_voxels,
            request: Request { skip_rad: 0.0, ..self.request },
            ..*self
        };
        fine.paths_with(field, *paths.view(), cache).trace_parallel(starts, &mut refined);
        compare(&planned, &refined)
    }

    /// See [`MeasuredError::resolution_rad`]. Both interpolants are traced with the same steps, in
    /// `f64`, so that nothing else differs.
    fn resolution_error(
        &self,
        field: &Field,
        view: View,
        starts: &[Start],
        cache: &FieldCache,
    ) -> f64 {
        if !Lagrange::is_of_higher_degree(field) {
            return f64::INFINITY;
        }
        let options = FullOptions {
            step_voxels: RESOLUTION_STEP,
            blank: self.request.blank,
            ..FullOptions::default()
        };
        let spline = cache.spline(field);
        let by_spline = Full::new(field, &*spline, Verlet, view, options);
        let polynomials = Lagrange::new(field);
        let by_polynomials = Full::new(field, &polynomials, Verlet, view, options);
        let [spline, polynomials] = [&by_spline as &dyn LightPaths, &by_polynomials].map(|paths| {
            let mut exits = vec![Exit::UNDISTURBED; starts.len()];
            paths.trace_parallel(starts, &mut exits);
            exits
        });
        resolution_error(compare(&spline, &polynomials).0, largest_deflection(&spline))
    }
}

/// Fourth difference of values that are rounded to f32, as a part of the largest value, at most:
/// the coefficients' sum is 16, and three axes add up.
const ROUNDED_DIFFERENCE: f64 = 32.0 * 0.5 * f32::EPSILON as f64;

/// Step of the rays that tell how well the lattice resolves the flow, in lattice steps.
const RESOLUTION_STEP: f64 = 0.3;

/// The spline's error by its difference from the polynomials. For eleven flows and three views
/// (tests/plan.rs) it is 0.4 to 3.7 times the difference where the flow is resolved. For thirty
/// gases on lattices and meshes (bench's accuracy-tolerance) it is up to 2.8 times, where nothing
/// is left but the rounding of values to f32. Beyond that, neither interpolant is near the truth:
/// across a jump from node to node, it is 1.3 to 7 times the difference, which then is more than a
/// tenth of the largest deflection.
const RESOLVED: f64 = 3.0;
const UNRESOLVED: f64 = 7.5;
const UNRESOLVED_SHARE: [f64; 2] = [0.1, 0.2];

/// The error of a lattice, from the largest difference of deflections between two interpolants and
/// the largest deflection.
fn resolution_error(difference: f64, largest: f64) -> f64 {
    let [resolved, not] = UNRESOLVED_SHARE;
    // Nothing is bent and nothing differs.
    let share = if difference > 0.0 { difference / largest } else { 0.0 };
    let blend = ((share - resolved) / (not - resolved)).clamp(0.0, 1.0);
    difference * (RESOLVED + blend * (UNRESOLVED - RESOLVED))
}

/// Largest and root mean square difference of deflection, and the number of rays compared: those
/// that are free in both.
pub(crate) fn compare(a: &[Exit], b: &[Exit]) -> (f64, f64, usize) {
    let (mut max, mut sum, mut rays) = (0.0f64, 0.0, 0);
    for (a, b) in a.iter().zip(b) {
        if a.status == Status::Free && b.status == Status::Free {
            let d: [f64; 2] =
                [0, 1].map(|c| f64::from(a.deflection_rad[c]) - f64::from(b.deflection_rad[c]));
            let d = d[0].hypot(d[1]);
            max = max.max(d);
            sum += d * d;
            rays += 1;
        }
    }
    (max, if rays > 0 { (sum / rays as f64).sqrt() } else { 0.0 }, rays)
}

/// Starts spread evenly over the image of the field, by the R2 sequence of Roberts 2018, the
/// two-dimensional analogue of the golden ratio sequence.
pub(crate) fn sample_starts(
    size_m: DVec3,
    centre_m: DVec3,
    view: &View,
    rays: usize,
) -> Vec<Start> {
    let half = [view.right, view.up].map(|axis| 0.5 * (size_m * axis.abs()).element_sum());
    let offset = [view.right, view.up].map(|axis| (centre_m - view.centre_m).dot(axis));
    (0..rays)
        .map(|i| {
            let at = [0.754_877_666_246_692_7, 0.569_840_290_998_053_3]
                .map(|a: f64| (0.5 + a * (i + 1) as f64).fract());
            let position_m = [0, 1].map(|c| (offset[c] + (2.0 * at[c] - 1.0) * half[c]) as f32);
            Start { position_m, tilt_rad: [0.0; 2] }
        })
        .collect()
}

/// Starts of rays through a node and up to two nodes beside it. The largest errors are where a flow
/// has a kink, as at the axis of a ring, and rays that are spread evenly pass it by.
fn starts_around(field: &Field, node: [usize; 3], view: &View) -> impl Iterator<Item = Start> {
    let h = DVec3::from(field.spacing_m());
    let from_centre = field.origin_m() + h * DVec3::from(node.map(|i| i as f64)) - view.centre_m;
    let step = [view.right, view.up].map(|axis| 2.0 / 3.0 * (h * axis.abs()).max_element());
    let middle = [view.right, view.up].map(|axis| from_centre.dot(axis));
    (0..49).map(move |i| {
        let offset = [i % 7, i / 7].map(|n| f64::from(n) - 3.0);
        let position_m = [0, 1].map(|c| (middle[c] + offset[c] * step[c]) as f32);
        Start { position_m, tilt_rad: [0.0; 2] }
    })
}

/// The path of light through a field's box.
struct BoxPath {
    /// Length of the longest path.
    longest_m: f64,
    /// Whether the direction is unknown or not along an axis of the lattice.
    oblique: bool,
    /// How fast paths get shorter towards an edge, in metres per metre across the light. Infinite
    /// when the direction is unknown.
    slope: f64,
}

impl BoxPath {
    fn new(field: &Field, direction: Option<DVec3>) -> BoxPath {
        let size = field.size_m();
        let d = direction.map(|d| d.normalize_or_zero().abs()).filter(|d| d.max_element() > 0.0);
        let Some(d) = d else {
            return BoxPath { longest_m: size.length(), oblique: true, slope: f64::INFINITY };
        };
        let oblique = d.max_element() < 1.0;
        // At a face whose normal makes an angle of cosine c with the light, path lengths change by
        // √(1 - c²)/c per metre. Faces parallel to the light have no edge.
        let slope = d.to_array().into_iter().filter(|c| *c > 0.0).map(|c| (1.0 - c * c).sqrt() / c);
        let slope = if oblique { slope.sum() } else { 0.0 };
        BoxPath { longest_m: (size / d).min_element().min(size.length()), oblique, slope }
    }

    /// Error of a cubic spline over nodes `h_m` apart at an edge, in metres of gas: a quarter of a
    /// step times the change of slope, at most the longest path.
    fn edges_m(&self, h_m: f64) -> f64 {
        (0.25 * h_m * self.slope).min(self.longest_m)
    }
}
