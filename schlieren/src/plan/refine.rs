//! Refines a plan until its measured error is within the tolerance.

use super::{MeasuredError, Mode, Plan, Request, SHORTEST_STEP};
use crate::field::Field;
use crate::interpolate::Interpolant;
use crate::march::FieldCache;
use crate::view::View;

/// Part of the lattice's and the mesh's own error below which a march's error does not show.
const HIDDEN: f64 = 0.1;

/// Ratio of errors above which half the step did not help: it would be 1/4 by Verlet's order.
const STALLED: f64 = 0.7;

impl Plan {
    /// Measures the error like [`Plan::measure_with`]. While the sum is above the tolerance,
    /// refines what the request leaves open: straight rays become bent ones, the interpolant
    /// becomes the spline, and steps become half as long. Where that no longer helps, single
    /// precision becomes the full march in `f64`.
    ///
    /// Returns the first plan that is within the tolerance, or the most accurate one. Also stops at
    /// a tenth of the lattice's own error ([`MeasuredError::resolution_rad`]) or the mesh's,
    /// because a better march would not show. A tolerance of zero or below is as accurate as
    /// possible already.
    pub fn within_tolerance(
        self,
        field: &Field,
        view: View,
        rays: usize,
        cache: &FieldCache,
    ) -> (Plan, MeasuredError) {
        let (starts, planned) = self.sample(field, view, rays, cache);
        let mut best = (self, planned);
        let tolerance = self.request.tolerance_rad;
        if tolerance <= 0.0 {
            return best;
        }
        // What the flow's own error leaves of the tolerance.
        let of_flow_rad = planned.of_flow_rad();
        let goal = (tolerance - of_flow_rad).max(HIDDEN * of_flow_rad);
        let (mut plan, mut error, mut stalled) = (self, planned.max_rad, false);
        while error > goal {
            let Some(next) = plan.refined(field, stalled) else { break };
            let measured = next.march_error(field, view, &starts, cache);
            stalled = next.step_voxels < plan.step_voxels && measured.0 > STALLED * error;
            (plan, error) = (next, measured.0);
            if error < best.1.max_rad {
                let (max_rad, rms_rad, rays) = measured;
                best = (plan, MeasuredError { max_rad, rms_rad, rays, ..best.1 });
            }
        }
        best
    }

    /// The next more accurate plan that the request allows; `None` if there is none.
    fn refined(&self, field: &Field, stalled: bool) -> Option<Plan> {
        let asked = self.request;
        let with = |mode, interpolant, step_voxels| {
            let forced = Request {
                mode: Some(mode),
                interpolant: asked.interpolant.or(interpolant),
                step_voxels: asked.step_voxels.or(step_voxels),
                ..asked
            };
            let plan = Plan::from_derivative_bounds(field, forced, self.derivative_bounds);
            Some(Plan { request: asked, ..plan })
        };
        let bends_freely = asked.mode.is_none();
        let spline = Some(Interpolant::BSpline);
        match self.mode {
            Mode::LineOfSight if bends_freely => with(Mode::Paraxial, None, None),
            Mode::LineOfSight => None,
            Mode::Paraxial | Mode::Full => {
                let halved = 0.5 * self.step_voxels;
                let can_halve = asked.step_voxels.is_none() && halved >= SHORTEST_STEP;
                if asked.interpolant.is_none() && self.interpolant != Interpolant::BSpline {
                    with(self.mode, spline, Some(self.step_voxels))
                } else if can_halve && !stalled {
                    with(self.mode, Some(self.interpolant), Some(halved))
                } else if self.mode == Mode::Paraxial
                    && bends_freely
                    && asked.interpolant.is_none_or(|i| i == Interpolant::BSpline)
                {
                    // Its order is higher, so its step is chosen anew.
                    with(Mode::Full, spline, None)
                } else {
                    None
                }
            }
        }
    }
}
