//! Integrates along sixteen rays at a time, straight or bent as in gases.
//!
//! The parameter of the path is the depth z along the undisturbed ray, not tau, so that the last
//! step ends in the exit plane. With s the transverse slope and primes for derivatives by z, the
//! exact ray equation is `s' = (1 + s²) (∇ₜ eps - s ∂eps/∂z) / (1 + eps)`, and a step of path is
//! `√(1 + s²) dz`. As in the packets of [`crate::march`], the state is in the lattice's axes, which
//! needs no rotations.

use super::integrator::{MediaIntegrator, Sums};
use crate::field::Node;
use crate::interpolate::{Interpolate16, LANES, Row, TrilinearRows};
use crate::march::{Frame, KernelRay};
use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x16, i32x16};

/// Sixteen rays with their state. Lengths are in units of [`Frame::unit_m`], unless the name ends
/// with `_m`.
pub(super) struct Packet {
    /// Steps from entry to exit. Each ray has its own number, because its integrals must not depend
    /// on its neighbours.
    steps: Row,
    longest: u32,
    middle: [Row; 3],
    stride: [Row; 3],
    along: [Row; 3],
    /// A step of depth.
    dz: Row,
    dz_m: [f64; LANES],
    /// Number of steps, with a fraction, after which a ray reaches its end; at most `steps`.
    end: [f64; LANES],
    xi: [Row; 3],
    /// Slope, in lattice steps per unit of depth.
    v: [Row; 3],
    stopped: [bool; LANES],
    pub(super) integrals: [Sums; LANES],
}

impl Packet {
    pub(super) fn new() -> Packet {
        Packet {
            steps: [0.0; LANES],
            longest: 0,
            middle: [[0.0; LANES]; 3],
            stride: [[0.0; LANES]; 3],
            along: [[0.0; LANES]; 3],
            dz: [0.0; LANES],
            dz_m: [0.0; LANES],
            end: [f64::INFINITY; LANES],
            xi: [[0.0; LANES]; 3],
            v: [[0.0; LANES]; 3],
            stopped: [true; LANES],
            integrals: [Sums::default(); LANES],
        }
    }

    /// Sets lane `l` to a ray that crosses the field.
    pub(super) fn set(
        &mut self,
        l: usize,
        ray: &mut KernelRay,
        frame: &Frame,
        steps: u32,
        end_m: f64,
    ) {
        let [near_m, far_m] = ray.range_m();
        let entry = ray.entry(frame, steps);
        self.steps[l] = steps as f32;
        self.longest = self.longest.max(steps);
        for c in 0..3 {
            self.middle[c][l] = entry.middle[c];
            self.stride[c][l] = entry.stride[c];
            self.along[c][l] = entry.along[c];
            self.xi[c][l] = entry.xi[c];
        }
        self.dz[l] = entry.dt;
        self.dz_m[l] = (far_m - near_m) / f64::from(steps);
        self.end[l] = ((end_m - near_m) / self.dz_m[l]).min(f64::from(steps));
        self.stopped[l] = self.end[l] <= 0.0;
    }
}

/// A property. Its lattice coordinates are those of the field times `scale` plus `offset`.
struct PropertyOnLattice<'a> {
    rows: TrilinearRows<'a>,
    scale: [f32; 3],
    offset: [f32; 3],
}

/// The volumes that are sampled along the rays, shared by all packets.
pub(super) struct SampledProperties<'a> {
    /// The field eps; `None` for straight rays.
    eps: Option<TrilinearRows<'a>>,
    /// Absorption, emission, rotation.
    properties: [Option<PropertyOnLattice<'a>>; 3],
    /// Kinds of the field's nodes, its dimensions, and whether each kind ends a ray.
    nodes: Option<(&'a [Node], [usize; 3], [bool; 3])>,
    h2: [f32; 3],
    rcp_h2: [f32; 3],
}

impl<'a> SampledProperties<'a> {
    pub(super) fn new(
        integrator: &'a MediaIntegrator<'_>,
        eps: Option<TrilinearRows<'a>>,
    ) -> SampledProperties<'a> {
        let field = integrator.field;
        let spacing_m = integrator.frame.spacing_m;
        let h = (spacing_m / integrator.frame.unit_m).to_array();
        let properties = integrator.wanted.map(|v| {
            v.map(|v| {
                let scale = (spacing_m / v.spacing_m).as_vec3().to_array();
                let offset = ((field.origin_m() - v.origin_m) / v.spacing_m).as_vec3().to_array();
                PropertyOnLattice { rows: v.values.rows(), scale, offset }
            })
        });
        let stops = [Node::Gas, Node::Blank, Node::Solid].map(|n| integrator.stops(n as u8));
        SampledProperties {
            eps,
            properties,
            nodes: field.nodes().map(|kinds| (kinds, field.dims(), stops)),
            h2: h.map(|h| (h * h) as f32),
            rcp_h2: h.map(|h| (1.0 / (h * h)) as f32),
        }
    }
}

/// Integrates along a packet's rays from entry to exit.
#[inline(never)]
pub(super) fn integrate16<S: Simd>(simd: S, sampled: &SampledProperties<'_>, p: &mut Packet) {
    simd.vectorize(
        #[inline(always)]
        || {
            let middle = f32x16::from_slice(simd, &p.steps) * 0.5;
            for k in 0..p.longest {
                let number = f32x16::splat(simd, k as f32 + 0.5) - middle;
                let mut at = [number; 3];
                for c in 0..3 {
                    let straight = number.mul_add(
                        f32x16::from_slice(simd, &p.stride[c]),
                        f32x16::from_slice(simd, &p.middle[c]),
                    );
                    at[c] = straight + f32x16::from_slice(simd, &p.xi[c]);
                }
                let mut stretch = [1.0; LANES];
                if let Some(eps) = &sampled.eps {
                    stretch = bend(simd, eps, sampled, p, &mut at);
                }
                gather(simd, sampled, p, &at, f64::from(k), &stretch);
            }
        },
    );
}

/// One leapfrog step: moves `at` to the middle of the step and the ray to its end. Returns the path
/// length per depth.
#[inline(always)]
fn bend<S: Simd>(
    simd: S,
    eps: &TrilinearRows<'_>,
    sampled: &SampledProperties<'_>,
    p: &mut Packet,
    at: &mut [f32x16<S>; 3],
) -> Row {
    let dz = f32x16::from_slice(simd, &p.dz);
    let half = dz * 0.5;
    let one = f32x16::splat(simd, 1.0);
    let mut v = [dz; 3];
    let mut square = dz * 0.0;
    for c in 0..3 {
        v[c] = f32x16::from_slice(simd, &p.v[c]);
        at[c] = half.mul_add(v[c], at[c]);
        square = (v[c] * sampled.h2[c]).mul_add(v[c], square);
    }
    let here = eps.sample16(simd, at);

    // The gradient along the ray and across it.
    let mut along = [dz; 3];
    let mut g_z = dz * 0.0;
    for c in 0..3 {
        along[c] = f32x16::from_slice(simd, &p.along[c]);
        g_z = (here.gradient[c] * sampled.rcp_h2[c]).mul_add(along[c], g_z);
    }
    let push = dz * (square + one) / (here.eps + one);
    let mut middle = dz * 0.0;
    for c in 0..3 {
        let across = (here.gradient[c] - along[c] * g_z) * sampled.rcp_h2[c];
        let new = push.mul_add(across - v[c] * g_z, v[c]);
        let mean = (v[c] + new) * 0.5;
        middle = (mean * sampled.h2[c]).mul_add(mean, middle);
        let xi = f32x16::from_slice(simd, &p.xi[c]);
        half.mul_add(v[c] + new, xi).store_slice(&mut p.xi[c]);
        new.store_slice(&mut p.v[c]);
    }
    (middle + one).sqrt().into()
}

/// Samples the properties and adds a step of path to the sums.
#[inline(always)]
fn gather<S: Simd>(
    simd: S,
    sampled: &SampledProperties<'_>,
    p: &mut Packet,
    at: &[f32x16<S>; 3],
    step: f64,
    stretch: &Row,
) {
    if let Some((kinds, dims, stops)) = sampled.nodes {
        let mut near = [i32x16::splat(simd, 0); 3];
        for c in 0..3 {
            let last = f32x16::splat(simd, (dims[c] - 1) as f32);
            let inside = at[c].max(f32x16::splat(simd, 0.0)).min(last);
            near[c] = (inside + f32x16::splat(simd, 0.5)).to_int::<i32x16<S>>();
        }
        let row = dims[0] as i32;
        let o: [i32; LANES] = (near[0] + near[1] * row + near[2] * (row * dims[1] as i32)).into();
        for l in 0..LANES {
            p.stopped[l] |= stops[kinds[o[l] as u32 as usize] as usize];
        }
    }
    let mut values: [Row; 3] = [[0.0; LANES]; 3];
    for (row, property) in values.iter_mut().zip(&sampled.properties) {
        if let Some(PropertyOnLattice { rows, scale, offset }) = property {
            let mut there = *at;
            for c in 0..3 {
                there[c] =
                    at[c].mul_add(f32x16::splat(simd, scale[c]), f32x16::splat(simd, offset[c]));
            }
            *row = rows.sample16(simd, &there).eps.into();
        }
    }
    for l in 0..LANES {
        if !p.stopped[l] {
            let part = (p.end[l] - step).min(1.0);
            let length_m = p.dz_m[l] * f64::from(stretch[l]) * part;
            p.integrals[l].add([values[0][l], values[1][l], values[2][l]], length_m);
            p.stopped[l] = part < 1.0;
        }
    }
}
