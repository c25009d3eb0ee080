//! Traces light through gases by marching deviations in `f32`, sixteen rays at a time, with Verlet,
//! or with Euler for comparison with the dissertation.

use super::field_cache::FieldCache;
use super::field_interpolant::FieldInterpolant;
use super::frame::{BlankCells, Frame};
use super::kernel_ray::{KernelOutput, KernelRay};
use super::packet::{
    Complete, CompleteEuler, DeflectionInGas, KernelFeatures, Nodes, Packet, PacketConstants,
    PathInGas, Skip, Steps, Work, march,
};
use crate::at_level;
use crate::field::Field;
use crate::interpolate::{BSpline, Interpolant, Interpolate, Interpolate16, LANES};
use crate::path::{Exit, LightPaths, PathQuantities, SkipReport, Start};
use crate::skip::Bricks;
use crate::view::View;
use fearless_simd::{Level, Simd};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// The scheme that steps deviations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Scheme {
    /// Position Verlet: second order, symplectic, one sample per step. The default.
    #[default]
    Verlet,
    /// Explicit Euler, first order: equations 5.7 and 5.8 of the dissertation, but in deviations
    /// and thus without its loss of digits.
    Euler,
}

/// Options of a march.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// The scheme that steps deviations.
    pub scheme: Scheme,
    /// Longest step, in lattice steps. 1 is right for nearly all fields: with shorter steps, the
    /// interpolant dominates the error.
    pub step_voxels: f64,
    /// Quantities to compute besides deflection and displacement.
    pub quantities: PathQuantities,
    /// How light is treated in cells without data.
    pub blank: BlankCells,
    /// Skip bricks as long as the bounds on the lost deflection of a ray add up to less than this.
    /// With zero, nothing is skipped and no ray's exit depends on any other ray. Otherwise rays
    /// that are in flight together skip the same bricks, so that they agree with the same rays
    /// traced in another order within twice this bound.
    pub skip_rad: f64,
    /// The largest error of the optical path difference from skipping one stretch of eight steps.
    /// Applies when that quantity is wanted.
    pub skip_opd_m: f64,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            scheme: Scheme::Verlet,
            step_voxels: 1.0,
            quantities: PathQuantities::default(),
            blank: BlankCells::Opaque,
            skip_rad: 0.0,
            skip_opd_m: 0.0,
        }
    }
}

/// Counts of the work of tracing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Rays traced.
    pub rays: u64,
    /// Number of these that crossed the field.
    pub rays_in_field: u64,
    /// Ray-steps that took a sample, counted in whole packets including unused lanes.
    pub ray_steps: u64,
    /// Ray-steps that were skipped.
    pub ray_steps_skipped: u64,
    /// The largest bound on the deflection that any ray lost by skipping, in 1e-15 rad, rounded up.
    pub skipped_femtorad: u64,
}

/// Light paths through a field of weak index, computed as deviations from straight rays.
pub struct Deviational<'a> {
    field: &'a Field,
    frame: Frame,
    options: Options,
    field_interpolant: FieldInterpolant<'a>,
    bricks: Option<Bricks>,
    level: Level,
    rays: AtomicU64,
    rays_in_field: AtomicU64,
    sampled: AtomicU64,
    skipped: AtomicU64,
    skipped_femtorad: AtomicU64,
}

impl<'a> Deviational<'a> {
    /// Computes the interpolant, and bricks if they may be skipped.
    pub fn new(
        field: &'a Field,
        view: View,
        interpolant: Interpolant,
        options: Options,
    ) -> Deviational<'a> {
        Self::with_level(field, view, interpolant, options, Level::new())
    }

    /// [`Deviational::new`] limited to an instruction set, for tests and measurements.
    pub fn with_level(
        field: &'a Field,
        view: View,
        interpolant: Interpolant,
        options: Options,
        level: Level,
    ) -> Deviational<'a> {
        let interpolant = FieldInterpolant::new(field, interpolant);
        Self::build(field, view, interpolant, options, level, || Arc::new(BSpline::new(field)))
    }

    /// [`Deviational::new`] with the spline through this field from a cache.
    pub fn with_cache(
        field: &'a Field,
        view: View,
        interpolant: Interpolant,
        options: Options,
        cache: &FieldCache,
    ) -> Deviational<'a> {
        let interpolant = FieldInterpolant::with_cache(field, interpolant, cache);
        Self::build(field, view, interpolant, options, Level::new(), || cache.spline(field))
    }

    /// [`Deviational::new`] on the calling thread alone, which waits for no other thread.
    #[cfg(feature = "gpu")]
    pub(crate) fn on_this_thread(
        field: &'a Field,
        view: View,
        interpolant: Interpolant,
        options: Options,
    ) -> Deviational<'a> {
        debug_assert!(options.skip_rad == 0.0, "bricks are made by all threads");
        let interpolant = FieldInterpolant::on_this_thread(field, interpolant);
        let spline = || Arc::new(BSpline::on_this_thread(field));
        Self::build(field, view, interpolant, options, Level::new(), spline)
    }

    /// `spline` is used for the bounds of bricks, if there is no other.
    fn build(
        field: &'a Field,
        view: View,
        field_interpolant: FieldInterpolant<'a>,
        options: Options,
        level: Level,
        spline: impl FnOnce() -> Arc<BSpline>,
    ) -> Deviational<'a> {
        let bricks = (options.skip_rad > 0.0).then(|| match &field_interpolant {
            FieldInterpolant::BSpline(s) => Bricks::new(field, s),
            _ => Bricks::new(field, &spline()),
        });
        Deviational {
            field,
            frame: Frame::new(field, view),
            options,
            field_interpolant,
            bricks,
            level,
            rays: AtomicU64::new(0),
            rays_in_field: AtomicU64::new(0),
            sampled: AtomicU64::new(0),
            skipped: AtomicU64::new(0),
            skipped_femtorad: AtomicU64::new(0),
        }
    }

    /// The work of all tracing so far.
    pub fn counters(&self) -> Counters {
        let read = |c: &AtomicU64| c.load(Ordering::Relaxed);
        Counters {
            rays: read(&self.rays),
            rays_in_field: read(&self.rays_in_field),
            ray_steps: read(&self.sampled) * LANES as u64,
            ray_steps_skipped: read(&self.skipped) * LANES as u64,
            skipped_femtorad: read(&self.skipped_femtorad),
        }
    }

    /// The bricks, when they may be skipped.
    pub fn bricks(&self) -> Option<&Bricks> {
        self.bricks.as_ref()
    }

    /// Memory in bytes, without the field.
    pub fn memory_bytes(&self) -> usize {
        let interpolant = self.interpolate().memory_bytes();
        interpolant + self.bricks.as_ref().map_or(0, Bricks::memory_bytes)
    }

    /// The interpolant in `f64`, for the reference integrators.
    pub fn interpolate(&self) -> &dyn Interpolate {
        self.field_interpolant.as_dyn()
    }

    /// Selects the kernel with only the features that this march needs.
    #[inline(always)]
    fn run<S: Simd, I: Interpolate16>(
        &self,
        simd: S,
        field: I,
        starts: &[Start],
        exits: &mut [Exit],
    ) {
        let plain = self.field.nodes().is_none() && self.bricks.is_none();
        match (self.options.scheme, plain) {
            (Scheme::Verlet, true) if self.options.quantities.opd => {
                self.all(simd, field, starts, exits, PathInGas);
            }
            (Scheme::Verlet, true) => self.all(simd, field, starts, exits, DeflectionInGas),
            // Three kernels an interpolant and instruction set, not twelve: each is a second of
            // compiling. The path costs a tenth of a step.
            (Scheme::Verlet, false) => self.all(simd, field, starts, exits, Complete),
            (Scheme::Euler, _) => self.all(simd, field, starts, exits, CompleteEuler),
        }
    }

    /// Traces all rays, in groups of packets that are in flight together.
    #[inline(always)]
    fn all<S: Simd, I: Interpolate16, E: KernelFeatures>(
        &self,
        simd: S,
        field: I,
        starts: &[Start],
        exits: &mut [Exit],
        effects: E,
    ) {
        const IN_FLIGHT: usize = 2;
        let h = (self.frame.spacing_m / self.frame.unit_m).to_array();
        let constants = PacketConstants {
            h2: h.map(|h| (h * h) as f32),
            rcp_h2: h.map(|h| (1.0 / (h * h)) as f32),
            nodes: self.field.nodes().map(|kinds| Nodes { kinds, dims: self.field.dims() }),
            skip: self.bricks.as_ref().map(|bricks| Skip {
                bricks,
                unit_m: self.frame.unit_m as f32,
                tolerance_rad: self.options.skip_rad as f32,
                tolerance_opd_m: if self.options.quantities.opd {
                    self.options.skip_opd_m as f32
                } else {
                    f32::INFINITY
                },
            }),
            survives: match self.options.blank {
                BlankCells::Opaque => 0,
                BlankCells::Continued => 1,
            },
        };
        let mut known = None;
        let mut work = Work::default();
        let mut in_field = 0;
        let mut skipped_rad = 0.0f32;
        for (starts, exits) in
            starts.chunks(IN_FLIGHT * LANES).zip(exits.chunks_mut(IN_FLIGHT * LANES))
        {
            let mut packets = [const { Packet::EMPTY }; IN_FLIGHT];
            let mut rays = [KernelRay::default(); IN_FLIGHT * LANES];
            for (ray, start) in rays.iter_mut().zip(starts) {
                *ray = KernelRay::new(&self.frame, start, &mut known);
            }
            let mut steps = Steps { shortest: u32::MAX, longest: 0 };
            for (i, ray) in rays.iter_mut().enumerate().filter(|(_, r)| r.meets_field()) {
                in_field += 1;
                let (p, l) = (&mut packets[i / LANES], i % LANES);
                let of_ray = ray.steps(self.options.step_voxels);
                steps.shortest = steps.shortest.min(of_ray);
                steps.longest = steps.longest.max(of_ray);
                p.steps[l] = of_ray as f32;
                let entry = ray.entry(&self.frame, of_ray);
                for c in 0..3 {
                    p.middle[c][l] = entry.middle[c];
                    p.xi[c][l] = entry.xi[c];
                    p.stride[c][l] = entry.stride[c];
                    p.along[c][l] = entry.along[c];
                }
                p.dt[l] = entry.dt;
            }
            if steps.longest > 0 {
                let done = march(simd, field, &constants, &mut packets, steps, effects);
                work.sampled += done.sampled;
                work.skipped += done.skipped;
            }
            for (i, exit) in exits.iter_mut().enumerate() {
                let (p, l) = (&packets[i / LANES], i % LANES);
                skipped_rad = skipped_rad.max(p.skipped_rad[l]);
                let output = KernelOutput {
                    v: [0, 1, 2].map(|c| p.v[c][l]),
                    xi: [0, 1, 2].map(|c| p.xi[c][l]),
                    opd: self.options.quantities.opd.then_some(p.opd[l]),
                    worst_node: p.worst_node[l],
                    turned: false,
                };
                *exit = rays[i].exit(&self.frame, self.field.n0(), self.options.blank, &output);
            }
        }
        self.rays.fetch_add(starts.len() as u64, Ordering::Relaxed);
        self.rays_in_field.fetch_add(in_field, Ordering::Relaxed);
        self.sampled.fetch_add(work.sampled, Ordering::Relaxed);
        self.skipped.fetch_add(work.skipped, Ordering::Relaxed);
        self.skipped_femtorad
            .fetch_max((f64::from(skipped_rad) * 1e15).ceil() as u64, Ordering::Relaxed);
    }
}

impl LightPaths for Deviational<'_> {
    fn trace(&self, starts: &[Start], exits: &mut [Exit]) {
        assert_eq!(starts.len(), exits.len(), "one exit per start");
        match &self.field_interpolant {
            FieldInterpolant::BSpline(s) => {
                let rows = s.rows();
                at_level!(self.level, simd => self.run(simd, rows, starts, exits));
            }
            FieldInterpolant::Trilinear(s) => {
                let rows = s.rows();
                at_level!(self.level, simd => self.run(simd, rows, starts, exits));
            }
            FieldInterpolant::TrilinearGradient(s) => {
                let rows = s.rows();
                at_level!(self.level, simd => self.run(simd, rows, starts, exits));
            }
        }
    }

    fn view(&self) -> &View {
        &self.frame.view
    }

    fn quantities(&self) -> PathQuantities {
        self.options.quantities
    }

    fn difference_step_m(&self) -> f64 {
        0.5 * self.frame.spacing_m.min_element()
    }

    fn skip_report(&self) -> Option<SkipReport> {
        let bricks = self.bricks.as_ref()?;
        let c = self.counters();
        Some(SkipReport {
            steps_part: c.ray_steps_skipped as f64
                / (c.ray_steps + c.ray_steps_skipped).max(1) as f64,
            bound_rad: c.skipped_femtorad as f64 * 1e-15,
            bricks_bytes: bricks.memory_bytes(),
            bricks_secs: bricks.build_time().as_secs_f64(),
        })
    }
}
