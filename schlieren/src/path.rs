//! The boundary between optics and field: a photon goes in undisturbed and comes out with its
//! deviation.
//!
//! Optics makes [`Start`]s, one of the implementations of [`LightPaths`] (line of sight, a march on
//! the CPU, the GPU) turns them into [`Exit`]s, and optics takes them on to the cut-off and the
//! film. Nothing here is the difference of two large numbers.

use crate::view::View;

/// The undisturbed ray of one photon.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Start {
    /// Where the undisturbed ray crosses the plane through the view's centre perpendicular to
    /// `forward`: along `right` and `up`, from the centre.
    pub position_m: [f32; 2],
    /// Slopes of the photon's parallel beam: its direction is `forward + tilt[0] right + tilt[1]
    /// up`, normalised. Zero on the optical axis; other values come from the extent of the light
    /// source.
    pub tilt_rad: [f32; 2],
}

/// The same photon behind the test section, as deviations from its undisturbed ray.
///
/// Directions are given in the photon's own frame: the view's frame turned by the smallest rotation
/// that takes `forward` to the photon's direction. For tilts below 1e-3 rad its `right` and `up`
/// equal the view's within 5e-7.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exit {
    /// Deflection along right and up: the components of the unit direction in the reference medium
    /// (sines; they equal the angles within 2e-5 relative below 0.01 rad). The light leaves through
    /// a surface normal to the undisturbed ray, as through the window of a test section.
    pub deflection_rad: [f32; 2],
    /// Displacement along right and up in the plane at `exit_depth_m`.
    pub displacement_m: [f32; 2],
    /// Distance along the undisturbed ray, from where it crosses the centre plane to where it left
    /// the field.
    pub exit_depth_m: f32,
    /// Optical path minus that of the undisturbed ray in the reference medium, between the same
    /// planes. NaN when it was not asked for.
    pub opd_m: f32,
    /// 1 free; 0 blocked; between when absorption or an analyser dims the light ([`crate::media`]).
    pub transmission: f32,
    /// What happened to the ray.
    pub status: Status,
}

impl Exit {
    /// A ray that met nothing at all.
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
    /// Went through cells without data (and was stopped there, or not, as the march was told; see
    /// `transmission`).
    Masked,
    /// Was bent so far that it left sideways or backwards; its deflection and displacement are
    /// those where it left, and it does not reach the film.
    Turned,
}

/// How a photon's exit changes with its starting position: what a shadowgraph without noise needs.
///
/// Row i, column j: change of component i per metre of the start along j.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Jacobian {
    /// Of the deflection, in rad/m.
    pub deflection_per_m: [[f32; 2]; 2],
    /// Of the displacement, in m/m.
    pub displacement_per_m: [[f32; 2]; 2],
}

/// What the caller wants to be computed along the paths. Deflection and displacement always are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct PathQuantities {
    /// The optical path difference ([`Exit::opd_m`]).
    pub opd: bool,
}

/// What leaving out even gas came to; see [`crate::skip`].
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct SkipReport {
    /// Part of the steps that took no sample, 0 to 1.
    pub steps_part: f64,
    /// Bound on what that changed any ray's deflection by.
    pub bound_rad: f64,
    /// Bytes that the bricks take.
    pub bricks_bytes: usize,
    /// Time it took to build them.
    pub bricks_secs: f64,
}

/// Paths that several pictures share.
impl<T: LightPaths + Send + ?Sized> LightPaths for std::sync::Arc<T> {
    fn trace(&self, starts: &[Start], exits: &mut [Exit]) {
        (**self).trace(starts, exits);
    }

    fn view(&self) -> &View {
        (**self).view()
    }

    fn wanted(&self) -> PathQuantities {
        (**self).wanted()
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

/// Something that takes light through the test section.
pub trait LightPaths: Sync {
    /// Traces each start to the exit of the same number, on the calling thread. Neighbouring starts
    /// should be neighbours in the picture: rays are taken in packets, and those that look at the
    /// same nodes are faster. No exit depends on it.
    ///
    /// # Panics
    /// If the slices differ in length.
    fn trace(&self, starts: &[Start], exits: &mut [Exit]);

    /// The view in whose frame starts and exits are given.
    fn view(&self) -> &View;

    /// What [`Exit`] will hold.
    fn wanted(&self) -> PathQuantities;

    /// The distance over which [`LightPaths::trace_with_jacobians`] may take differences: half a
    /// voxel or so.
    fn difference_step_m(&self) -> f64;

    /// What failed on the way and was made up for, with its cause, for who looks at the result.
    fn device_warning(&self) -> Option<String> {
        None
    }

    /// What leaving out even gas came to so far; `None` where nothing is to be left out.
    fn skip_report(&self) -> Option<SkipReport> {
        None
    }

    /// [`LightPaths::trace`], and how each exit changes with its start. This implementation takes
    /// central differences of four more rays each; implementations with smooth fields do better.
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
                // The distance that was really taken, after rounding.
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

    /// [`LightPaths::trace`] on all threads of the current rayon pool. The result does not depend
    /// on their number.
    ///
    /// # Panics
    /// If the slices differ in length.
    fn trace_parallel(&self, starts: &[Start], exits: &mut [Exit]) {
        use rayon::prelude::*;
        assert_eq!(starts.len(), exits.len(), "one exit per start");
        // A multiple of every packet size; a few milliseconds of work.
        const CHUNK: usize = 1024;
        starts
            .par_chunks(CHUNK)
            .zip(exits.par_chunks_mut(CHUNK))
            .for_each(|(s, e)| self.trace(s, e));
    }
}
