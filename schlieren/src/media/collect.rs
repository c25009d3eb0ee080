//! Integrates the properties of media along many rays, with the kernel for the integrator's
//! [`Bend`](super::Bend).
use super::integrator::{BendField, MediaIntegrator};
use super::paraxial::{Packet, SampledProperties, integrate16};
use super::{MediaIntegrals, full};
use crate::at_level;
use crate::interpolate::LANES;
use crate::march::KernelRay;
use crate::path::Start;

impl MediaIntegrator<'_> {
    /// Integrates along each start's ray, from where it enters the field to where it leaves the
    /// field, hits a solid or opaque node, or reaches its end in `ends_m`. The ends (for example,
    /// of the bodies in the flow) are distances along the undisturbed ray from the plane through
    /// the view's centre.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn integrate(&self, starts: &[Start], ends_m: Option<&[f64]>, out: &mut [MediaIntegrals]) {
        assert_eq!(starts.len(), out.len(), "one result per start");
        assert!(ends_m.is_none_or(|e| e.len() == starts.len()), "one end per start");
        let end_m = |i: usize| ends_m.map_or(f64::INFINITY, |e| e[i]);
        let rows = match &self.bend_field {
            BendField::Full(spline) => {
                let mut known = None;
                for (i, (start, to)) in starts.iter().zip(out).enumerate() {
                    *to = full::integrate(self, spline, start, end_m(i), &mut known);
                }
                return;
            }
            BendField::Paraxial(trilinear) => Some(trilinear.rows()),
            BendField::Straight => None,
        };
        let sampled = SampledProperties::new(self, rows);
        let mut known = None;
        for (chunk, (starts, out)) in starts.chunks(LANES).zip(out.chunks_mut(LANES)).enumerate() {
            let mut packet = Packet::new();
            let mut any = false;
            for (l, start) in starts.iter().enumerate() {
                let mut ray = KernelRay::new(&self.frame, start, &mut known);
                if ray.meets_field() {
                    let steps = ray.steps(self.step_voxels);
                    packet.set(l, &mut ray, &self.frame, steps, end_m(chunk * LANES + l));
                    any = true;
                }
            }
            if any {
                at_level!(self.level, simd => integrate16(simd, &sampled, &mut packet));
            }
            for (l, to) in out.iter_mut().enumerate() {
                *to = packet.integrals[l].rounded();
            }
        }
    }

    /// [`MediaIntegrator::integrate`] on all threads of the current rayon pool. The result does not
    /// depend on their number.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn integrate_parallel(
        &self,
        starts: &[Start],
        ends_m: Option<&[f64]>,
        out: &mut [MediaIntegrals],
    ) {
        use rayon::prelude::*;
        assert_eq!(starts.len(), out.len(), "one result per start");
        // A multiple of the packet size, and a few milliseconds of work.
        const CHUNK: usize = 1024;
        starts.par_chunks(CHUNK).zip(out.par_chunks_mut(CHUNK)).enumerate().for_each(
            |(i, (s, o))| {
                self.integrate(s, ends_m.map(|e| &e[i * CHUNK..i * CHUNK + s.len()]), o);
            },
        );
    }
}
