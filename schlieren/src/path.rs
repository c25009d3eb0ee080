//! Traces light through the test section: [`LightPaths`] turns undisturbed rays into exits.
//!
//! This module is the interface between the optics and the field. The optics creates [`Start`]s. An
//! implementation of [`LightPaths`] (line of sight, a march on the CPU, the GPU) turns them into
//! [`Exit`]s. The optics then follows each exit to the cut-off and the film. An exit stores
//! deviations from the undisturbed ray, so no value is the difference of two large numbers.

use crate::view::View;

/// The undisturbed ray of one photon.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Start {
    /// The point where the undisturbed ray crosses the plane through the view's centre
    /// perpendicular to `forward`. Components along `right` and `up`, relative to the centre.
    pub position_m: [f32; 2],
    /// Slopes of the photon's parallel beam: its direction is `forward + tilt[0] right + tilt[1]
    /// up`, normalised. Zero on the optical axis; other values come from the extent of the light
    /// source.
    pub tilt_rad: [f32; 2],
}

/// A photon behind the test section, as deviations from its undisturbed ray.
///
/// Directions are given in the photon's own frame: the view's frame turned by the smallest rotation
/// that takes `forward` to the photon's direction. For tilts below 1e-3 rad its `right` and `up`
/// equal the view's within 5e-7.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exit {
    /// Deflection along right and up: components of the unit direction in the reference medium.
    /// These are sines; below 0.01 rad they equal the angles within a relative error of 2e-5. The
    /// light leaves through a surface normal to the undisturbed ray, as through the window of a
    /// test section.
    pub deflection_rad: [f32; 2],
    /// Displacement along right and up in the plane at `exit_depth_m`.
    pub displacement_m: [f32; 2],
    /// Distance along the undisturbed ray, from the centre plane to where the photon left the
    /// field.
    pub exit_depth_m: f32,
    /// Optical path minus that of the undisturbed ray in the reference medium, between the same
    /// planes. NaN when it was not requested.
    pub opd_m: f32,
    /// Transmitted fraction of the light: 1 if free, 0 if blocked, and between when absorption or
    /// an analyser dims the light ([`crate::media`]).
    pub transmission: f32,
    /// What happened to the ray.
    pub status: Status,
}

impl Exit {
    /// A ray that nothing has deflected or dimmed.
    pub const UNDISTURBED: Exit = Exit {
        deflection_rad: [0.0; 2],
        displacement_m: [0.0; 2],
        exit_depth_m: 0.0,
        opd_m: 0.0,
        transmission: 1.0,
        status: Status::Free,
    };
}

/// What happened to a ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Status {
    /// Left the field at its back.
    #[default]
    Free,
    /// Stopped by a solid body.
    Blocked,
    /// Passed through cells without data. The march's options decide whether it was stopped there;
    /// see `transmission`.
    Masked,
    /// Left sideways or backwards because it was bent too far. Deflection and displacement are
    /// those where it left; it does not reach the film.
    Turned,
}

/// Derivatives of a photon's exit with respect to its starting position. Noise-free shadowgraphs
/// need them.
///
/// Row i, column j is the change of component i per metre of the start along j.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Jacobian {
    /// Derivative of the deflection, in rad/m.
    pub deflection_per_m: [[f32; 2]; 2],
    /// Derivative of the displacement, in m/m.
    pub displacement_per_m: [[f32; 2]; 2],
}

/// Quantities to compute along the paths. Deflection and displacement are always computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct PathQuantities {
    /// The optical path difference ([`Exit::opd_m`]).
    pub opd: bool,
}

/// The effect of skipping uniform gas; see [`crate::skip`].
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct SkipReport {
    /// Fraction of the steps that took no sample, 0 to 1.
    pub steps_part: f64,
    /// Bound on the change of any ray's deflection.
    pub bound_rad: f64,
    /// Size of the bricks in bytes.
    pub bricks_bytes: usize,
    /// Time to build the bricks, in seconds.
    pub bricks_secs: f64,
}

/// Paths that several images share.
impl<T: LightPaths + Send + ?Sized> LightPaths for std::sync::Arc<T> {
    fn trace(&self, starts: &[Start], exits: &mut [Exit]) {
        (**self).trace(starts, exits);
    }

    fn view(&self) -> &View {
        (**self).view()
    }

    fn quantities(&self) -> PathQuantities {
        (**self).quantities()
    }

    fn difference_step_m(&self) -> f64 {
        (**self).difference_step_m()
    }

    fn device_warning(&self) -> Option<String> {
        (**self).device_warning()
    }

    fn skip_report(&self) -> Option<SkipReport> {
        (**self).skip_report()
    }

    fn rays_at_once(&self) -> Option<usize> {
        (**self).rays_at_once()
    }

    fn trace_with_jacobians(
        &self,
        starts: &[Start],
        exits: &mut [Exit],
        jacobians: &mut [Jacobian],
    ) {
        (**self).trace_with_jacobians(starts, exits, jacobians);
    }

    fn trace_parallel(&self, starts: &[Start], exits: &mut [Exit]) {
        (**self).trace_parallel(starts, exits);
    }
}

/// Traces light through the test section.
pub trait LightPaths: Sync {
    /// Traces each start to the exit with the same index, on the calling thread. Successive starts
    /// should be neighbours in the image: rays are traced in packets, and packets that read the
    /// same nodes are faster. The exits do not depend on the order.
    ///
    /// # Panics
    /// If the slices differ in length.
    fn trace(&self, starts: &[Start], exits: &mut [Exit]);

    /// The view in whose frame starts and exits are given.
    fn view(&self) -> &View;

    /// The quantities that [`Exit`] will hold.
    fn quantities(&self) -> PathQuantities;

    /// How many rays to trace in one call where the caller may be cancelled: a multiple of every
    /// packet size. Rays through millions of cells take milliseconds each. `None` where rays are
    /// faster the more there are, as on a GPU.
    fn rays_at_once(&self) -> Option<usize> {
        Some(256)
    }

    /// The distance over which [`LightPaths::trace_with_jacobians`] may take differences, about
    /// half a voxel.
    fn difference_step_m(&self) -> f64;

    /// A warning for the user if the device failed and lost rays were traced again, with the cause.
    fn device_warning(&self) -> Option<String> {
        None
    }

    /// The effect of skipping uniform gas so far; `None` if skipping is off.
    fn skip_report(&self) -> Option<SkipReport> {
        None
    }

    /// As [`LightPaths::trace`], with the derivatives of each exit with respect to its start. This
    /// implementation takes central differences of four more rays per start. Implementations with
    /// smooth fields can do better.
    ///
    /// # Panics
    /// If the slices differ in length.
    fn trace_with_jacobians(
        &self,
        starts: &[Start],
        exits: &mut [Exit],
        jacobians: &mut [Jacobian],
    ) {
        assert_eq!(starts.len(), jacobians.len(), "one Jacobian per start");
        self.trace(starts, exits);
        let step_m = self.difference_step_m() as f32;
        let mut sides =
            [vec![Exit::UNDISTURBED; starts.len()], vec![Exit::UNDISTURBED; starts.len()]];
        let mut moved = starts.to_vec();
        for axis in 0..2 {
            for (side, sign) in sides.iter_mut().zip([1.0, -1.0]) {
                for (m, s) in moved.iter_mut().zip(starts) {
                    *m = *s;
                    m.position_m[axis] += sign * step_m;
                }
                self.trace(&moved, side);
            }
            for (i, j) in jacobians.iter_mut().enumerate() {
                // The actual distance between the two rays, after rounding.
                let p = starts[i].position_m[axis];
                let scale = 1.0 / ((p + step_m) - (p - step_m));
                for row in 0..2 {
                    let [plus, minus] = [&sides[0][i], &sides[1][i]];
                    j.deflection_per_m[row][axis] =
                        (plus.deflection_rad[row] - minus.deflection_rad[row]) * scale;
                    j.displacement_per_m[row][axis] =
                        (plus.displacement_m[row] - minus.displacement_m[row]) * scale;
                }
            }
        }
    }

    /// As [`LightPaths::trace`], on all threads of the current rayon pool. The result does not
    /// depend on the number of threads.
    ///
    /// # Panics
    /// If the slices differ in length.
    fn trace_parallel(&self, starts: &[Start], exits: &mut [Exit]) {
        use rayon::prelude::*;
        assert_eq!(starts.len(), exits.len(), "one exit per start");
        // A multiple of every packet size, and a few milliseconds of work.
        const CHUNK: usize = 1024;
        starts
            .par_chunks(CHUNK)
            .zip(exits.par_chunks_mut(CHUNK))
            .for_each(|(s, e)| self.trace(s, e));
    }
}
