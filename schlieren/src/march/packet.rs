//! The march kernels: trace packets of sixteen rays in `f32`, several packets in flight at once.
//!
//! The state of a ray is the deviation of its position in lattice steps, `xi`, the deviation of its
//! rate along the lattice's axes, `v`, and the optical path difference. All are zero at the start.
//! The position on the undisturbed ray is computed anew for each step from the step's number.
//! Rounding is thus relative to the deviation and not to the position, and a gas of eps = 1e-8 is
//! traced as accurately as one of 1e-3.
//!
//! In the lattice's own axes a step needs no rotations: with lattice spacing h (in units of the
//! longest) and gradient g per lattice step, `dv_i/dtau = (1 + eps) g_i / h_i^2` and `dxi_i/dtau =
//! v_i`.
//!
//! A ray's exit does not depend on the other rays of its packet. Each takes its own number of
//! steps. A ray that has arrived or was stopped *rests*: its step of tau is zero from then on, so
//! that further steps of the packet do not change it. (If stopped rays went on until all were
//! stopped, the neighbours would decide whether a ray that crosses a blank cell first and a body
//! later is masked or blocked.) The one exception is skipping bricks, which the rays in flight
//! decide together.

use crate::field::Node;
use crate::interpolate::{Interpolate16, LANES, Row, Samples};
use crate::skip::Bricks;
use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x16, i32x16};

/// Rays of one packet with their state. Lengths are in units of [`super::Frame::unit_m`].
#[derive(Clone)]
#[repr(C, align(64))]
pub(super) struct Packet {
    /// The middle of the undisturbed ray's chord through the field, in lattice coordinates.
    /// Positions are relative to it, because this halves the largest product and with it the
    /// rounding.
    pub(super) middle: [Row; 3],
    /// A step along the undisturbed ray, in lattice coordinates.
    pub(super) stride: [Row; 3],
    /// The direction times the spacing: projects lattice components of `xi` and `v` onto the ray.
    pub(super) along: [Row; 3],
    /// A step of tau; before the march, a step of path. A ray enters with a rate of 1 + eps, and
    /// deviations are relative to a ray that keeps this rate. Zero for rays that miss the field and
    /// for rays at rest.
    pub(super) dt: Row,
    /// Steps from entry to exit. Zero for rays that miss the field.
    pub(super) steps: Row,
    /// The value of eps where the ray enters.
    pub(super) eps_at_entry: Row,
    /// Initially the error of rounding `middle` to f32, which [`super::Deviational`] subtracts
    /// again at the end.
    pub(super) xi: [Row; 3],
    pub(super) v: [Row; 3],
    /// Accumulated rounding error of `v` (Kahan 1965), for interpolants that are accurate enough
    /// ([`Interpolate16::COMPENSATE_SUMS`]).
    pub(super) v_rest: [Row; 3],
    pub(super) opd: Row,
    /// Accumulated rounding error of `opd`.
    pub(super) opd_rest: Row,
    /// Bound on the deflection that was lost by skipping.
    pub(super) skipped_rad: Row,
    /// The worst [`Node`] encountered.
    pub(super) worst_node: [u8; LANES],
}

impl Packet {
    pub(super) const EMPTY: Packet = Packet {
        middle: [[0.0; LANES]; 3],
        stride: [[0.0; LANES]; 3],
        along: [[0.0; LANES]; 3],
        dt: [0.0; LANES],
        steps: [0.0; LANES],
        eps_at_entry: [0.0; LANES],
        xi: [[0.0; LANES]; 3],
        v: [[0.0; LANES]; 3],
        v_rest: [[0.0; LANES]; 3],
        opd: [0.0; LANES],
        opd_rest: [0.0; LANES],
        skipped_rad: [0.0; LANES],
        worst_node: [0; LANES],
    };
}

/// Constants shared by all packets.
#[derive(Clone, Copy)]
pub(super) struct PacketConstants<'a> {
    /// Spacing squared, and its reciprocal.
    pub(super) h2: [f32; 3],
    pub(super) rcp_h2: [f32; 3],
    /// The kinds of the nodes, unless all are gas.
    pub(super) nodes: Option<Nodes<'a>>,
    pub(super) skip: Option<Skip<'a>>,
    /// The worst kind of node that a ray can pass. A ray that encounters a worse one rests there.
    pub(super) survives: u8,
}

/// Kinds of the nodes, in which rays look up their nearest node.
#[derive(Clone, Copy)]
pub(super) struct Nodes<'a> {
    pub(super) kinds: &'a [Node],
    pub(super) dims: [usize; 3],
}

/// Bricks, and the tolerances for skipping them.
#[derive(Clone, Copy)]
pub(super) struct Skip<'a> {
    pub(super) bricks: &'a Bricks,
    /// The kernel's unit of length in metres.
    pub(super) unit_m: f32,
    /// Largest error of the deflection in rad, over the whole ray.
    pub(super) tolerance_rad: f32,
    /// Largest error of the path in metres, for each skipped stretch.
    pub(super) tolerance_opd_m: f32,
}

/// The features that a kernel is compiled with.
pub(super) trait KernelFeatures: Copy {
    /// The optical path difference.
    const OPD: bool;
    /// Blank or solid nodes.
    const NODES: bool;
    /// Skipping of bricks.
    const SKIP: bool;
    /// The dissertation's explicit Euler (equations 5.7 and 5.8) in place of Verlet.
    const EULER: bool;
}

/// Verlet in gas without skipping, for the deflection alone.
#[derive(Clone, Copy)]
pub(super) struct DeflectionInGas;

impl KernelFeatures for DeflectionInGas {
    const OPD: bool = false;
    const NODES: bool = false;
    const SKIP: bool = false;
    const EULER: bool = false;
}

/// Verlet in gas without skipping, for the deflection and the path.
#[derive(Clone, Copy)]
pub(super) struct PathInGas;

impl KernelFeatures for PathInGas {
    const OPD: bool = true;
    const NODES: bool = false;
    const SKIP: bool = false;
    const EULER: bool = false;
}

/// Verlet with all features.
#[derive(Clone, Copy)]
pub(super) struct Complete;

impl KernelFeatures for Complete {
    const OPD: bool = true;
    const NODES: bool = true;
    const SKIP: bool = true;
    const EULER: bool = false;
}

/// Euler, which skips nothing.
#[derive(Clone, Copy)]
pub(super) struct CompleteEuler;

impl KernelFeatures for CompleteEuler {
    const OPD: bool = true;
    const NODES: bool = true;
    const SKIP: bool = false;
    const EULER: bool = true;
}

/// Work done: packet-steps that took a sample, and those that were skipped.
#[derive(Clone, Copy, Default)]
pub(super) struct Work {
    pub(super) sampled: u64,
    pub(super) skipped: u64,
}

/// Number of steps that are skipped at once where a brick allows it.
const STRIDE: u32 = 8;

/// Marches all packets from entry to exit, in flight together.
#[inline(never)]
pub(super) fn march<S: Simd, I: Interpolate16, E: KernelFeatures, const P: usize>(
    simd: S,
    field: I,
    constants: &PacketConstants<'_>,
    packets: &mut [Packet; P],
    steps: Steps,
    _: E,
) -> Work {
    simd.vectorize(
        #[inline(always)]
        || march_body::<S, I, E, P>(simd, field, constants, packets, steps),
    )
}

#[inline(always)]
fn march_body<S: Simd, I: Interpolate16, E: KernelFeatures, const P: usize>(
    simd: S,
    field: I,
    constants: &PacketConstants<'_>,
    packets: &mut [Packet; P],
    steps: Steps,
) -> Work {
    let mut work = Work::default();
    let mut k = 0;
    let mut entering = true;
    // There are two iterations more than steps: one samples the entry, one ends in the exit plane.
    // They are in the same loop, so that there is one copy of the sampling code.
    while k <= steps.longest {
        // Skips whole bricks when all rays in flight may.
        if E::SKIP
            && !entering
            && k % STRIDE == 0
            && k + STRIDE <= steps.shortest
            && skip_steps::<S, I, E, P>(simd, constants, packets, k as f32)
        {
            k += STRIDE;
            work.skipped += u64::from(STRIDE) * P as u64;
            continue;
        }
        for p in packets.iter_mut() {
            let dt = f32x16::from_slice(simd, &p.dt);
            let of_ray = f32x16::from_slice(simd, &p.steps);
            // Step numbers are relative to the middle of the chord, where they are exact in f32.
            let middle = of_ray * 0.5;
            let number =
                f32x16::splat(simd, if E::EULER { k as f32 } else { k as f32 + 0.5 }) - middle;
            let mut s = Step { number, move_by: dt, dt };
            let mut arriving = None;
            if entering {
                let zero = dt * 0.0;
                s = Step { number: zero - middle, move_by: zero, dt: zero };
            } else if k >= steps.shortest {
                // Some rays arrive in this step; the others take a regular one.
                let now = of_ray.simd_eq(k as f32) & dt.simd_gt(0.0);
                let last = last_step::<S, E>(simd, p, middle);
                s.number = now.select(last.number, s.number);
                s.move_by = now.select(last.move_by, s.move_by);
                s.dt = now.select(last.dt, s.dt);
                arriving = Some(now);
            }
            let eps = step::<S, I, E>(simd, field, constants, p, s);
            if entering {
                eps.store_slice(&mut p.eps_at_entry);
                (dt / (eps + f32x16::splat(simd, 1.0))).store_slice(&mut p.dt);
                if E::NODES {
                    // The line above set a nonzero step again for rays that enter through a body.
                    rest_where_stopped(constants, p);
                }
            } else if let Some(now) = arriving {
                // Rays that were stopped in this last step do not drift.
                let going = f32x16::from_slice(simd, &p.dt).simd_gt(0.0);
                let half = going.select(s.dt * 0.5, dt * 0.0);
                drift(simd, p, now.select(half, dt * 0.0));
                for l in 0..LANES {
                    if p.steps[l] == k as f32 {
                        rest(p, l);
                    }
                }
            }
        }
        work.sampled += P as u64;
        k += u32::from(!entering);
        entering = false;
        if E::NODES && packets.iter().all(|p| p.dt == [0.0; LANES]) {
            return work;
        }
    }
    work
}

/// Numbers of steps from entry to exit of the rays in flight that cross the field.
#[derive(Clone, Copy)]
pub(super) struct Steps {
    /// The smallest number of any ray.
    pub(super) shortest: u32,
    /// The largest number of any ray.
    pub(super) longest: u32,
}

/// Puts a ray to rest that has arrived or was stopped. Its compensation terms are below the last
/// digit and are cleared, so that later steps of the packet do not add them.
#[inline(always)]
fn rest(p: &mut Packet, l: usize) {
    p.dt[l] = 0.0;
    p.opd_rest[l] = 0.0;
    for c in 0..3 {
        p.v_rest[c][l] = 0.0;
    }
}

#[inline(always)]
fn rest_where_stopped(constants: &PacketConstants<'_>, p: &mut Packet) {
    for l in 0..LANES {
        if p.worst_node[l] > constants.survives {
            rest(p, l);
        }
    }
}

/// xi += dt v
#[inline(always)]
fn drift<S: Simd>(simd: S, p: &mut Packet, dt: f32x16<S>) {
    for c in 0..3 {
        let xi = f32x16::from_slice(simd, &p.xi[c]);
        let v = f32x16::from_slice(simd, &p.v[c]);
        dt.mul_add(v, xi).store_slice(&mut p.xi[c]);
    }
}

/// Parameters of a step.
#[derive(Clone, Copy)]
struct Step<S: Simd> {
    /// Steps along the undisturbed ray from its middle to where the sample is taken.
    number: f32x16<S>,
    /// Tau over which positions drift from the end of the last step to this sample.
    move_by: f32x16<S>,
    /// Tau over which the sample acts.
    dt: f32x16<S>,
}

/// One step. With Verlet, positions are at the middle of the last step and drift to the middle of
/// this one (in the first step the rate is still zero). With Euler, they are at the start of the
/// step and drift to its end after the sample.
#[inline(always)]
fn step<S: Simd, I: Interpolate16, E: KernelFeatures>(
    simd: S,
    field: I,
    constants: &PacketConstants<'_>,
    p: &mut Packet,
    mut s: Step<S>,
) -> f32x16<S> {
    let mut at = [s.number; 3];
    for c in 0..3 {
        let xi = f32x16::from_slice(simd, &p.xi[c]);
        let v = f32x16::from_slice(simd, &p.v[c]);
        let moved = s.move_by.mul_add(v, xi);
        moved.store_slice(&mut p.xi[c]);
        let straight = s.number.mul_add(
            f32x16::from_slice(simd, &p.stride[c]),
            f32x16::from_slice(simd, &p.middle[c]),
        );
        at[c] = straight + if E::EULER { xi } else { moved };
    }
    if E::NODES {
        look_up_nodes(simd, constants, p, &at);
        let going = f32x16::from_slice(simd, &p.dt).simd_gt(0.0);
        s.dt = going.select(s.dt, s.dt * 0.0);
    }
    let here = field.sample16(simd, &at);
    kick::<S, I, E>(simd, constants, p, &here, s.dt);
    here.eps
}

/// The step that ends in the exit plane. tau is not depth: a ray that gained `zeta` in depth has
/// passed its exit plane by as much. One step back brings it there; the caller does the second half
/// of its drift.
#[inline(always)]
fn last_step<S: Simd, E: KernelFeatures>(simd: S, p: &Packet, middle: f32x16<S>) -> Step<S> {
    let whole = f32x16::from_slice(simd, &p.dt);
    // With Verlet, positions still lack the second half of the last step.
    let missing = if E::EULER { whole * 0.0 } else { whole * 0.5 };
    let mut zeta = f32x16::splat(simd, 0.0);
    let mut u_z = zeta;
    for c in 0..3 {
        let along = f32x16::from_slice(simd, &p.along[c]);
        zeta = along.mul_add(f32x16::from_slice(simd, &p.xi[c]), zeta);
        u_z = along.mul_add(f32x16::from_slice(simd, &p.v[c]), u_z);
    }
    zeta = missing.mul_add(u_z, zeta);
    let rate = u_z + f32x16::from_slice(simd, &p.eps_at_entry) + f32x16::splat(simd, 1.0);
    let dt = -zeta / rate;
    // Rays that miss the field have steps of length zero.
    let steps = (whole.simd_gt(0.0)).select(dt / whole, dt * 0.0);
    Step {
        number: steps.mul_add(f32x16::splat(simd, 0.5), middle),
        move_by: missing + dt * 0.5,
        dt,
    }
}

/// v += dt (1 + eps) g / h^2. Also adds to the optical path, with the mean of v before and after.
#[inline(always)]
fn kick<S: Simd, I: Interpolate16, E: KernelFeatures>(
    simd: S,
    constants: &PacketConstants<'_>,
    p: &mut Packet,
    here: &Samples<S>,
    dt: f32x16<S>,
) {
    let eps = here.eps;
    let push = dt.mul_add(eps, dt);
    let mut middle = [eps; 3];
    for c in 0..3 {
        let v = f32x16::from_slice(simd, &p.v[c]);
        let push = push * constants.rcp_h2[c];
        if E::OPD {
            middle[c] = if E::EULER { v } else { (push * 0.5).mul_add(here.gradient[c], v) };
        }
        if I::COMPENSATE_SUMS {
            let term = push.mul_sub(here.gradient[c], f32x16::from_slice(simd, &p.v_rest[c]));
            let new = v + term;
            ((new - v) - term).store_slice(&mut p.v_rest[c]);
            new.store_slice(&mut p.v[c]);
        } else {
            push.mul_add(here.gradient[c], v).store_slice(&mut p.v[c]);
        }
    }
    if E::OPD {
        // (1+eps)^2 - w_z = eps (1 + eps) + u_t^2 / (1 + eps + w_z): all terms are small, and none
        // is a difference.
        let mut square = middle[0] * 0.0;
        let mut u_z = square;
        for c in 0..3 {
            square = (middle[c] * constants.h2[c]).mul_add(middle[c], square);
            u_z = middle[c].mul_add(f32x16::from_slice(simd, &p.along[c]), u_z);
        }
        let transverse = square - u_z * u_z;
        let twice =
            eps + u_z + f32x16::from_slice(simd, &p.eps_at_entry) + f32x16::splat(simd, 2.0);
        let more = eps.mul_add(eps, eps) + transverse / twice;
        // A phase of thousands of radians needs more digits than a plain sum of hundreds of terms
        // keeps.
        let sum = f32x16::from_slice(simd, &p.opd);
        let term = dt.mul_sub(more, f32x16::from_slice(simd, &p.opd_rest));
        let new = sum + term;
        ((new - sum) - term).store_slice(&mut p.opd_rest);
        new.store_slice(&mut p.opd);
    }
}

/// Looks up the nearest node's kind for each moving ray, and puts to rest the rays that it stops.
#[inline(always)]
fn look_up_nodes<S: Simd>(
    simd: S,
    constants: &PacketConstants<'_>,
    p: &mut Packet,
    at: &[f32x16<S>; 3],
) {
    let Some(nodes) = constants.nodes else { return };
    let mut near = [i32x16::splat(simd, 0); 3];
    for c in 0..3 {
        let last = f32x16::splat(simd, (nodes.dims[c] - 1) as f32);
        let inside = at[c].max(f32x16::splat(simd, 0.0)).min(last);
        near[c] = (inside + f32x16::splat(simd, 0.5)).to_int::<i32x16<S>>();
    }
    let row = nodes.dims[0] as i32;
    let o = near[0] + near[1] * row + near[2] * (row * nodes.dims[1] as i32);
    let o: [i32; LANES] = o.into();
    for l in 0..LANES {
        if p.dt[l] > 0.0 {
            p.worst_node[l] = p.worst_node[l].max(nodes.kinds[o[l] as u32 as usize] as u8);
        }
    }
    rest_where_stopped(constants, p);
}

/// Moves all packets over [`STRIDE`] steps without a sample, if the bricks there bound the error of
/// this. Returns whether it did.
#[inline(always)]
fn skip_steps<S: Simd, I: Interpolate16, E: KernelFeatures, const P: usize>(
    simd: S,
    constants: &PacketConstants<'_>,
    packets: &mut [Packet; P],
    first: f32,
) -> bool {
    let Some(skip) = constants.skip else { return false };
    let number = f32x16::splat(simd, first + 0.5 * STRIDE as f32);
    let mut bounds = [([0.0f32; LANES], [0.0f32; LANES]); P];
    for (p, (angle, mean)) in packets.iter().zip(&mut bounds) {
        let mut at: [Row; 3] = [[0.0; LANES]; 3];
        for c in 0..3 {
            let number = number - f32x16::from_slice(simd, &p.steps) * 0.5;
            let straight = number.mul_add(
                f32x16::from_slice(simd, &p.stride[c]),
                f32x16::from_slice(simd, &p.middle[c]),
            );
            at[c] = (straight + f32x16::from_slice(simd, &p.xi[c])).into();
        }
        for l in 0..LANES {
            let brick = skip.bricks.around([at[0][l], at[1][l], at[2][l]]);
            let chord_m = p.dt[l] * (STRIDE as f32 * skip.unit_m);
            angle[l] = p.skipped_rad[l] + brick.max_gradient_per_m * chord_m;
            mean[l] = brick.mean_eps;
            // A ray at rest is no longer in that brick.
            let stops = E::NODES && brick.has_nodes && p.dt[l] > 0.0;
            let vague = E::OPD && brick.half_range_eps * chord_m > skip.tolerance_opd_m;
            if angle[l] > skip.tolerance_rad || stops || vague {
                return false;
            }
        }
    }
    for (p, (angle, mean)) in packets.iter_mut().zip(&bounds) {
        p.skipped_rad = *angle;
        let dt = f32x16::from_slice(simd, &p.dt) * STRIDE as f32;
        drift(simd, p, dt);
        if E::OPD {
            let here = Samples { eps: f32x16::from_slice(simd, mean), gradient: [dt * 0.0; 3] };
            kick::<S, I, E>(simd, constants, p, &here, dt);
        }
    }
    true
}
