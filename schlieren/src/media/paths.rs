//! Applies absorption and an analyser to the light paths of any march.

use super::{MediaIntegrals, MediaIntegrator};
use crate::path::{Exit, Jacobian, LightPaths, PathQuantities, SkipReport, Start};
use crate::view::View;
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Paths whose [`Exit::transmission`] includes absorption and an analyser. All other fields of the
/// exits keep the march's values, bit for bit.
pub struct AttenuatedPaths<'a> {
    paths: Box<dyn LightPaths + 'a>,
    integrator: MediaIntegrator<'a>,
    analyser_rad: Option<f64>,
    rays: Arc<AtomicU64>,
}

impl<'a> AttenuatedPaths<'a> {
    /// `paths` and `integrator` must belong to the same field and view. `analyser_rad` is the angle
    /// from the polariser to the analyser, counter-clockwise in the image. `rays` counts the
    /// integrated rays.
    pub fn new(
        paths: Box<dyn LightPaths + 'a>,
        integrator: MediaIntegrator<'a>,
        analyser_rad: Option<f64>,
        rays: Arc<AtomicU64>,
    ) -> AttenuatedPaths<'a> {
        AttenuatedPaths { paths, integrator, analyser_rad, rays }
    }

    /// Number of rays integrated so far.
    pub fn rays(&self) -> u64 {
        self.rays.load(Ordering::Relaxed)
    }

    fn attenuate(&self, starts: &[Start], exits: &mut [Exit]) {
        let mut integrals = vec![MediaIntegrals::default(); starts.len()];
        self.integrator.integrate(starts, None, &mut integrals);
        for (exit, c) in exits.iter_mut().zip(&integrals) {
            // Only blocked rays have 0. Absorbed light stays above 0, however weak, so that its
            // exit remains valid.
            if exit.transmission > 0.0 {
                let left = f64::from(exit.transmission) * c.transmission(self.analyser_rad);
                exit.transmission = (left as f32).max(f32::MIN_POSITIVE);
            }
        }
        self.rays.fetch_add(starts.len() as u64, Ordering::Relaxed);
    }
}

impl LightPaths for AttenuatedPaths<'_> {
    fn trace(&self, starts: &[Start], exits: &mut [Exit]) {
        self.paths.trace(starts, exits);
        self.attenuate(starts, exits);
    }

    fn view(&self) -> &View {
        self.paths.view()
    }

    fn rays_at_once(&self) -> Option<usize> {
        self.paths.rays_at_once()
    }

    fn quantities(&self) -> PathQuantities {
        self.paths.quantities()
    }

    fn difference_step_m(&self) -> f64 {
        self.paths.difference_step_m()
    }

    fn device_warning(&self) -> Option<String> {
        self.paths.device_warning()
    }

    fn skip_report(&self) -> Option<SkipReport> {
        self.paths.skip_report()
    }

    fn trace_with_jacobians(
        &self,
        starts: &[Start],
        exits: &mut [Exit],
        jacobians: &mut [Jacobian],
    ) {
        self.paths.trace_with_jacobians(starts, exits, jacobians);
        self.attenuate(starts, exits);
    }

    fn trace_parallel(&self, starts: &[Start], exits: &mut [Exit]) {
        const CHUNK: usize = 1024;
        self.paths.trace_parallel(starts, exits);
        starts
            .par_chunks(CHUNK)
            .zip(exits.par_chunks_mut(CHUNK))
            .for_each(|(s, e)| self.attenuate(s, e));
    }
}
