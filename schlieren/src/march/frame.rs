//! Finds where undisturbed rays enter and leave the field.

use crate::field::{Field, Node};
use crate::path::{Start, Status};
use crate::view::View;
use glam::DVec3;

/// How light is treated in cells without data ([`Node::Blank`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum BlankCells {
    /// Light stops: the image is dark there.
    #[default]
    Opaque,
    /// Light goes on through values continued from the gas around them. Exits still have
    /// [`Status::Masked`].
    Continued,
}

impl BlankCells {
    /// Transmission and status of a ray, from the worst node it encountered.
    pub(crate) fn outcome(self, worst_node: u8) -> (f32, Status) {
        match (worst_node, self) {
            (m, _) if m == Node::Gas as u8 => (1.0, Status::Free),
            (m, _) if m == Node::Solid as u8 => (0.0, Status::Blocked),
            (_, BlankCells::Opaque) => (0.0, Status::Masked),
            (_, BlankCells::Continued) => (1.0, Status::Masked),
        }
    }
}

/// Converts a view's rays to lattice coordinates.
#[derive(Debug, Clone)]
pub(crate) struct Frame {
    pub(crate) view: View,
    pub(crate) spacing_m: DVec3,
    pub(crate) last: DVec3,
    /// The view's centre in lattice coordinates.
    pub(crate) centre: DVec3,
    /// Length unit of the kernels: a power of two near the largest spacing, so that fields of any
    /// size use numbers of the same magnitude.
    pub(crate) unit_m: f64,
}

/// One undisturbed ray.
#[derive(Debug, Clone, Copy)]
pub(crate) struct UndisturbedRay {
    /// Right, up and direction of its beam.
    pub(crate) beam: [DVec3; 3],
    /// Where it crosses the centre plane, in lattice coordinates.
    pub(crate) at: DVec3,
    /// Its direction in lattice steps per metre.
    pub(crate) direction: DVec3,
    /// Distances in metres from `at` to where it enters and leaves the field; equal when it misses
    /// it.
    pub(crate) range_m: [f64; 2],
}

impl Frame {
    pub(crate) fn new(field: &Field, view: View) -> Frame {
        Frame::of_lattice(field.dims(), field.spacing_m(), field.origin_m(), view)
    }

    pub(crate) fn of_lattice(
        dims: [usize; 3],
        spacing_m: [f64; 3],
        origin_m: DVec3,
        view: View,
    ) -> Frame {
        let spacing_m = DVec3::from(spacing_m);
        Frame {
            view,
            spacing_m,
            last: DVec3::from(dims.map(|nodes| (nodes - 1) as f64)),
            centre: (view.centre_m - origin_m) / spacing_m,
            unit_m: Frame::unit_of(spacing_m),
        }
    }

    /// See [`Frame::unit_m`].
    pub(crate) fn unit_of(spacing_m: DVec3) -> f64 {
        spacing_m.max_element().log2().round().exp2()
    }

    /// The undisturbed ray of a start. `known` caches the last beam and its tilt, because
    /// neighbours mostly share them.
    pub(crate) fn undisturbed(
        &self,
        start: &Start,
        known: &mut Option<([f32; 2], [DVec3; 3])>,
    ) -> UndisturbedRay {
        let beam = match known {
            Some((tilt, beam)) if *tilt == start.tilt_rad => *beam,
            _ => {
                let beam = self.view.beam(start.tilt_rad);
                *known = Some((start.tilt_rad, beam));
                beam
            }
        };
        let [x, y] = start.position_m.map(f64::from);
        let at = self.centre + (self.view.right * x + self.view.up * y) / self.spacing_m;
        let direction = beam[2] / self.spacing_m;
        UndisturbedRay { beam, at, direction, range_m: clip(at, direction, self.last) }
    }

    /// Lattice steps per metre along a direction.
    pub(crate) fn lattice_speed_per_m(&self, direction: DVec3) -> f64 {
        (direction / self.spacing_m).length()
    }
}

/// The interval of `s` in which the line `at + s direction` is in the box from 0 to `last`, faces
/// included: `[s, s]` when there is none. Directions may have zeros.
pub(crate) fn clip(at: DVec3, direction: DVec3, last: DVec3) -> [f64; 2] {
    let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
    for c in 0..3 {
        if direction[c] == 0.0 {
            // Parallel to these faces, the line is between them or not. Written so that NaN is
            // outside.
            if !(at[c] >= 0.0 && at[c] <= last[c]) {
                return [0.0; 2];
            }
            continue;
        }
        let (a, b) = ((0.0 - at[c]) / direction[c], (last[c] - at[c]) / direction[c]);
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    if near < far && near.is_finite() && far.is_finite() { [near, far] } else { [0.0; 2] }
}
