//! Converts a [`Start`] into the input of a kernel and the kernel's output into an [`Exit`], in
//! `f64`. The kernels of the CPU and of the GPU share it.

use super::frame::{BlankCells, Frame};
use crate::path::{Exit, Start, Status};
use glam::DVec3;

/// The undisturbed ray of a start, with the rounding errors of its kernel input.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct KernelRay {
    beam: [DVec3; 3],
    exit_depth_m: f64,
    length_m: f64,
    /// The middle of its chord through the field, in lattice coordinates.
    middle: DVec3,
    /// Error of rounding `middle` to f32.
    rest: DVec3,
    /// From entry to exit in lattice coordinates.
    chord: DVec3,
    /// The exact step divided by its f32 value. Every step of a ray is wrong by this factor, which
    /// is corrected at the end.
    scale: f64,
}

/// A kernel's input for one ray. Lengths are in units of [`Frame::unit_m`].
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct KernelInput {
    /// The middle of the undisturbed ray's chord through the field, in lattice coordinates.
    /// Positions are relative to it, because this halves the largest product and with it the
    /// rounding.
    pub(crate) middle: [f32; 3],
    /// Error of rounding `middle` to f32. The deviation starts with it, and [`KernelRay::exit`]
    /// subtracts it again.
    pub(crate) xi: [f32; 3],
    /// A step along the undisturbed ray, in lattice coordinates.
    pub(crate) stride: [f32; 3],
    /// The direction times the spacing: projects lattice components of deviations onto the ray.
    pub(crate) along: [f32; 3],
    /// Length of a step along the path.
    pub(crate) dt: f32,
}

/// A kernel's output for one ray.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct KernelOutput {
    /// Rate of the deviation along the lattice's axes.
    pub(crate) v: [f32; 3],
    /// The deviation, in lattice steps.
    pub(crate) xi: [f32; 3],
    /// Optical path difference; `None` when it was not computed.
    pub(crate) opd: Option<f32>,
    /// The worst [`crate::field::Node`] that the ray encountered.
    pub(crate) worst_node: u8,
    /// Whether the ray never reaches its exit plane. `xi` then also has the way back from that
    /// plane.
    pub(crate) turned: bool,
}

impl KernelRay {
    /// The undisturbed ray of a start. `known` is as for [`Frame::undisturbed`].
    pub(crate) fn new(
        frame: &Frame,
        start: &Start,
        known: &mut Option<([f32; 2], [DVec3; 3])>,
    ) -> KernelRay {
        let ray = frame.undisturbed(start, known);
        let length_m = ray.range_m[1] - ray.range_m[0];
        KernelRay {
            beam: ray.beam,
            exit_depth_m: ray.range_m[1],
            length_m,
            middle: ray.at + ray.direction * (0.5 * (ray.range_m[0] + ray.range_m[1])),
            rest: DVec3::ZERO,
            chord: ray.direction * length_m,
            scale: 1.0,
        }
    }

    /// Distances along the ray, from where it crosses the centre plane, to where it enters and
    /// leaves the field.
    pub(crate) fn range_m(&self) -> [f64; 2] {
        [self.exit_depth_m - self.length_m, self.exit_depth_m]
    }

    /// Whether the ray crosses the field.
    pub(crate) fn meets_field(&self) -> bool {
        self.length_m > 0.0
    }

    /// Number of steps that the ray needs, 0 when it misses the field. Each ray has its own number,
    /// because its exit must not depend on its neighbours.
    pub(crate) fn steps(&self, step_voxels: f64) -> u32 {
        if self.meets_field() { steps_of(self.chord.length() / step_voxels).max(1) } else { 0 }
    }

    /// The kernel input of a ray that crosses the field and takes this many steps.
    pub(crate) fn entry(&mut self, frame: &Frame, steps: u32) -> KernelInput {
        let h = frame.spacing_m / frame.unit_m;
        let mut e = KernelInput::default();
        for c in 0..3 {
            e.middle[c] = self.middle[c] as f32;
            self.rest[c] = self.middle[c] - f64::from(e.middle[c]);
            e.xi[c] = self.rest[c] as f32;
            e.stride[c] = (self.chord[c] / f64::from(steps)) as f32;
            e.along[c] = (self.beam[2][c] * h[c]) as f32;
        }
        let dt = self.length_m / f64::from(steps) / frame.unit_m;
        e.dt = dt as f32;
        self.scale = dt / f64::from(e.dt);
        e
    }

    /// Converts the kernel's output into an exit.
    pub(crate) fn exit(
        &self,
        frame: &Frame,
        n0: f64,
        blank: BlankCells,
        output: &KernelOutput,
    ) -> Exit {
        let [right, up, _] = self.beam;
        let h = frame.spacing_m / frame.unit_m;
        let u = DVec3::from([0, 1, 2].map(|c| f64::from(output.v[c]) * h[c])) * self.scale;
        let xi = if self.meets_field() {
            let xi = [0, 1, 2]
                .map(|c| (f64::from(output.xi[c]) - f64::from(self.rest[c] as f32)) * h[c]);
            DVec3::from(xi) * (self.scale * self.scale * frame.unit_m)
        } else {
            DVec3::ZERO
        };
        let (mut transmission, mut status) = blank.outcome(output.worst_node);
        let mut exit_depth_m = self.exit_depth_m;
        if output.turned {
            transmission = 0.0;
            status = if status == Status::Free { Status::Turned } else { status };
            exit_depth_m += xi.dot(self.beam[2]);
        }
        let opd_m = |opd: f32| (f64::from(opd) * self.scale * frame.unit_m * n0) as f32;
        Exit {
            deflection_rad: [u.dot(right) as f32, u.dot(up) as f32],
            displacement_m: [xi.dot(right) as f32, xi.dot(up) as f32],
            exit_depth_m: exit_depth_m as f32,
            opd_m: output.opd.map_or(f32::NAN, opd_m),
            transmission,
            status,
        }
    }
}

/// Number of whole steps for a length in steps. A tiny excess over a whole number is rounding and
/// adds no step.
pub(super) fn steps_of(steps: f64) -> u32 {
    (steps * (1.0 - 1e-12)).ceil() as u32
}
