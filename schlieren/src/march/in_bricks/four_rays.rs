//! Four rays in the lanes of vectors, one step of each at a time. Where a ray ends, the next one
//! takes its lane.

use super::four_samples::{axis_weights, sample, transposed};
use super::{Brick, InBricks, Progress, RayState, Stencil, UndisturbedRay};
use crate::path::{Start, Status};
use fearless_simd::prelude::*;
use fearless_simd::{Simd, f64x4, mask64x4};
use glam::DVec3;

/// One number for each of four rays.
type Lanes = [f64; 4];
/// A vector for each of four rays, by component.
type Lanes3 = [Lanes; 3];

/// What is known of four rays.
#[derive(Default)]
struct Four {
    /// Number of each ray, and what the frame knows of it; none where a lane is free.
    rays: [Option<(usize, UndisturbedRay)>; 4],
    // ---- The undisturbed rays.
    at: Lanes3,
    /// In lattice steps per metre.
    stride: Lanes3,
    /// Of unit length.
    direction: Lanes3,
    entry_m: Lanes,
    step_m: Lanes,
    steps: Lanes,
    // ---- Their states: see [`RayState`].
    samples: Lanes,
    eps_at_entry: Lanes,
    xi_m: Lanes3,
    u: Lanes3,
    path_m: Lanes,
}

/// See [`InBricks::advance_all`].
pub(super) fn advance_all<S: Simd, B: Brick>(
    simd: S,
    march: &InBricks,
    rays: &mut [(Start, RayState)],
    brick: &B,
    told: impl FnMut(usize, Progress),
) {
    match march.stencil {
        Stencil::Cell => simd.vectorize(
            #[inline(always)]
            || advance::<S, B, false>(simd, march, rays, brick, told),
        ),
        Stencil::CellAndNeighbours => simd.vectorize(
            #[inline(always)]
            || advance::<S, B, true>(simd, march, rays, brick, told),
        ),
    }
}

#[inline(always)]
fn advance<S: Simd, B: Brick, const WIDE: bool>(
    simd: S,
    march: &InBricks,
    rays: &mut [(Start, RayState)],
    brick: &B,
    mut told: impl FnMut(usize, Progress),
) {
    let mut four = Four::default();
    let mut next = 0;
    let mut known = None;
    let cells = brick.cells();
    loop {
        // ---- Free lanes take the next rays.
        for lane in 0..4 {
            while four.rays[lane].is_none() && next < rays.len() {
                let (start, state) = &mut rays[next];
                let ray = march.frame.undisturbed(start, &mut known);
                let all = march.samples(&ray);
                pass_undisturbed(march, brick, cells, &ray, all, state);
                if state.samples < all {
                    four.enter(lane, next, ray, all, state);
                } else {
                    told(next, Progress::Left(march.exit(&ray, state, Status::Free)));
                }
                next += 1;
            }
        }
        if four.rays.iter().all(Option::is_none) {
            return;
        }
        let ends = steps_until_one_ends::<S, B, WIDE>(simd, march, brick, cells, &mut four);
        for (lane, end) in ends.into_iter().enumerate() {
            let Some(end) = end else { continue };
            let Some((number, ray)) = four.rays[lane].take() else { continue };
            let state = four.state(lane);
            rays[number].1 = state;
            told(
                number,
                match end {
                    End::NeedsCell(cell) => Progress::NeedsCell(cell),
                    End::Left(status) => Progress::Left(march.exit(&ray, &state, status)),
                },
            );
        }
    }
}

/// Counts the samples that change nothing: those of a ray that nothing has bent yet, in gas that
/// bends nothing. The places of the samples are those of the lanes, to the bit.
#[inline(always)]
fn pass_undisturbed<B: Brick>(
    march: &InBricks,
    brick: &B,
    [low, end]: [[usize; 3]; 2],
    ray: &UndisturbedRay,
    all_samples: u32,
    state: &mut RayState,
) {
    let is_bent = RayState { samples: 0, ..*state } != RayState::default();
    if is_bent || all_samples == 0 {
        return;
    }
    let steps = all_samples - 2;
    let step_m = (ray.range_m[1] - ray.range_m[0]) / f64::from(steps);
    while state.samples <= steps {
        let depth_m = match state.samples {
            0 => 0.0,
            k => (f64::from(k) - 0.5) * step_m,
        };
        let cell = march.cell_at(ray.at + ray.direction * (ray.range_m[0] + depth_m));
        let is_here = (0..3).all(|c| (low[c]..end[c]).contains(&cell[c]));
        if !is_here || !brick.is_undisturbed(cell) {
            return;
        }
        state.samples += 1;
    }
}

/// Why a lane becomes free.
#[derive(Clone, Copy)]
enum End {
    NeedsCell([usize; 3]),
    Left(Status),
}

/// Steps all four rays until at least one has ended.
#[inline(always)]
fn steps_until_one_ends<S: Simd, B: Brick, const WIDE: bool>(
    simd: S,
    march: &InBricks,
    brick: &B,
    [low, end]: [[usize; 3]; 2],
    four: &mut Four,
) -> [Option<End>; 4] {
    let splat = |value: f64| f64x4::splat(simd, value);
    let load = |lanes: &Lanes| f64x4::load_array_ref(simd, lanes);
    let load3 = |v: &Lanes3| [load(&v[0]), load(&v[1]), load(&v[2])];
    let (zero, one, half) = (splat(0.0), splat(1.0), splat(0.5));
    let mut live = [0.0; 4];
    for (lane, ray) in four.rays.iter().enumerate() {
        live[lane] = f64::from(u8::from(ray.is_some()));
    }
    let is_live = load(&live).simd_eq(one);
    let [sx, sy, sz] = march.frame.spacing_m.to_array();
    let spacing_m = [splat(sx), splat(sy), splat(sz)];
    let (at_centre, stride) = (load3(&four.at), load3(&four.stride));
    let direction = load3(&four.direction);
    let (entry_m, step_m, steps) = (load(&four.entry_m), load(&four.step_m), load(&four.steps));
    let (mut samples, mut eps_at_entry) = (load(&four.samples), load(&four.eps_at_entry));
    let (mut xi_m, mut u, mut path_m) = (load3(&four.xi_m), load3(&four.u), load(&four.path_m));
    loop {
        // ---- Where the samples are: `depth_m` along the undisturbed ray, `xi_m` beside it.
        let is_first = samples.simd_eq(zero);
        let is_last = samples.simd_gt(steps);
        let rate = eps_at_entry + one;
        let mut dtau_m = is_first.select(zero, step_m / rate);
        let mut depth_m = is_first.select(zero, (samples - half) * step_m);
        let mut turned = 0;
        if is_last.any_true() {
            // tau is not depth: a ray that has gained depth goes back to its exit plane.
            let forward = rate + dot(u, direction);
            let back_m = (zero - dot(xi_m, direction)) / forward;
            dtau_m = is_last.select(back_m, dtau_m);
            depth_m = is_last.select(steps * step_m + half * back_m * rate, depth_m);
            turned = bits(is_live & is_last & !forward.simd_gt(zero));
        }
        let mut moved_m = xi_m;
        let mut at = at_centre;
        let mut is_number = is_live;
        let mut is_here = is_live;
        for c in 0..3 {
            moved_m[c] = xi_m[c] + u[c] * (dtau_m * half);
            at[c] = at_centre[c] + stride[c] * (entry_m + depth_m) + moved_m[c] / spacing_m[c];
            is_number &= at[c].simd_eq(at[c]);
        }
        let weights = [
            axis_weights::<S, WIDE>(simd, at[0], march.dims[0]),
            axis_weights::<S, WIDE>(simd, at[1], march.dims[1]),
            axis_weights::<S, WIDE>(simd, at[2], march.dims[2]),
        ];
        for c in 0..3 {
            let cell = load(&weights[c].cell);
            let is_in = cell.simd_ge(splat(low[c] as f64)) & cell.simd_lt(splat(end[c] as f64));
            is_here &= is_in;
        }
        // ---- What the samples do.
        let here = bits(is_here & is_number) & !turned;
        let mut results = [zero; 4];
        for (lane, result) in results.iter_mut().enumerate() {
            if here >> lane & 1 == 0 {
                continue;
            }
            let [x, y, z] = &weights;
            let cell = [x.cell[lane] as usize, y.cell[lane] as usize, z.cell[lane] as usize];
            if !brick.is_undisturbed(cell) {
                *result = sample::<S, B, WIDE>(simd, brick, march.dims, &weights, lane);
            }
        }
        let [eps, gx, gy, gz] = transposed(results);
        let gradient = [gx / spacing_m[0], gy / spacing_m[1], gz / spacing_m[2]];
        let is_finite = eps.is_finite()
            & gradient[0].is_finite()
            & gradient[1].is_finite()
            & gradient[2].is_finite();
        let goes_on = is_here & is_number & is_finite;
        // ---- Rays that end here keep the state before this sample.
        let kept = bits(goes_on) & !turned;
        let all = bits(is_live);
        if kept != all {
            four.store([samples, eps_at_entry, path_m], xi_m, u);
            let numbers = bits(is_number);
            let mut ends = [None; 4];
            for (lane, ended) in ends.iter_mut().enumerate() {
                let is = |mask: u64| mask >> lane & 1 == 1;
                if !is(all) || is(kept) {
                    continue;
                }
                *ended = Some(if is(turned) {
                    End::Left(Status::Turned)
                } else if is(here) || !is(numbers) {
                    End::Left(Status::Masked)
                } else {
                    let of = |c: usize| weights[c].cell[lane] as usize;
                    End::NeedsCell([of(0), of(1), of(2)])
                });
            }
            return ends;
        }
        let n = eps + one;
        let mut push = gradient;
        let mut middle = u;
        for c in 0..3 {
            push[c] = gradient[c] * (n * dtau_m);
            middle[c] = u[c] + push[c] * half;
        }
        let forward = dot(middle, direction);
        let mut across = middle;
        for c in 0..3 {
            across[c] = middle[c] - direction[c] * forward;
        }
        let across = dot(across, across);
        // (1+eps)² - w_z = eps (1+eps) + u_t² / (1+eps+w_z), without cancellation.
        let w_z = (n * n - across).max_precise(zero).sqrt();
        let longer_m = (eps * n + across / (n + w_z)) * dtau_m;
        path_m = is_first.select(path_m, path_m + longer_m);
        for c in 0..3 {
            u[c] = is_first.select(u[c], u[c] + push[c]);
            xi_m[c] = is_first.select(xi_m[c], moved_m[c] + u[c] * (dtau_m * half));
        }
        eps_at_entry = is_first.select(eps, eps_at_entry);
        samples += one;
        // The last sample is the one behind those of the steps and of the entry.
        let arrived = bits(is_live & samples.simd_gt(steps + one));
        if arrived != 0 {
            four.store([samples, eps_at_entry, path_m], xi_m, u);
            let mut ends = [None; 4];
            for (lane, ended) in ends.iter_mut().enumerate() {
                if arrived >> lane & 1 == 1 {
                    *ended = Some(End::Left(Status::Free));
                }
            }
            return ends;
        }
    }
}

impl Four {
    /// Puts a ray into a free lane.
    #[inline(always)]
    fn enter(
        &mut self,
        lane: usize,
        number: usize,
        ray: UndisturbedRay,
        all_samples: u32,
        state: &RayState,
    ) {
        let steps = f64::from(all_samples - 2);
        let set = |lanes: &mut Lanes3, v: DVec3| {
            for (c, component) in lanes.iter_mut().enumerate() {
                component[lane] = v[c];
            }
        };
        set(&mut self.at, ray.at);
        set(&mut self.stride, ray.direction);
        set(&mut self.direction, ray.beam[2]);
        set(&mut self.xi_m, state.xi_m);
        set(&mut self.u, state.u);
        self.entry_m[lane] = ray.range_m[0];
        self.step_m[lane] = (ray.range_m[1] - ray.range_m[0]) / steps;
        self.steps[lane] = steps;
        self.samples[lane] = f64::from(state.samples);
        self.eps_at_entry[lane] = state.eps_at_entry;
        self.path_m[lane] = state.path_m;
        self.rays[lane] = Some((number, ray));
    }

    #[inline(always)]
    fn store<S: Simd>(
        &mut self,
        [samples, eps_at_entry, path_m]: [f64x4<S>; 3],
        xi_m: [f64x4<S>; 3],
        u: [f64x4<S>; 3],
    ) {
        self.samples = samples.into();
        self.eps_at_entry = eps_at_entry.into();
        self.path_m = path_m.into();
        for c in 0..3 {
            self.xi_m[c] = xi_m[c].into();
            self.u[c] = u[c].into();
        }
    }

    fn state(&self, lane: usize) -> RayState {
        let of = |v: &Lanes3| DVec3::new(v[0][lane], v[1][lane], v[2][lane]);
        RayState {
            samples: self.samples[lane] as u32,
            eps_at_entry: self.eps_at_entry[lane],
            xi_m: of(&self.xi_m),
            u: of(&self.u),
            path_m: self.path_m[lane],
        }
    }
}

#[inline(always)]
fn dot<S: Simd>(a: [f64x4<S>; 3], b: [f64x4<S>; 3]) -> f64x4<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// One bit for each lane.
#[inline(always)]
fn bits<S: Simd>(mask: mask64x4<S>) -> u64 {
    mask.to_bitmask()
}
