//! Common shape of helium plumes and pool fires: a round source at the floor, puffs that roll up
//! into rings, and a column that necks in, breaks up and widens as it rises.

use super::flow::Flow;
use super::turbulence::{Displacement, Turbulence, Vortex, Vortices};
use glam::DVec3;
use rt_core::math::SplitMix64;
use std::f64::consts::TAU;

/// Proportions, in source radii.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shape {
    /// Radius of the source.
    pub(crate) source_radius_m: f64,
    /// Radius of the neck over that of the source.
    pub(crate) neck: f64,
    /// Height of the neck.
    pub(crate) neck_height: f64,
    /// Growth of the radius with height above the neck: 6/5 α after Morton, Taylor and Turner 1956
    /// with α = 0.1 is 0.12.
    pub(crate) growth: f64,
    /// Height at which the axis is diluted to half.
    pub(crate) half_height: f64,
    /// Heights of the rings.
    pub(crate) rings: &'static [f64],
    /// Distance that eddies carry gas, as a fraction of the local radius.
    pub(crate) displacement: f64,
}

/// A plume on the lattice of a flow; the source is at x = y = z = 0, up is z.
pub(crate) struct Plume {
    shape: Shape,
    rings: Vortices,
    turbulence: Turbulence,
    lean: [f64; 4],
    origin_m: DVec3,
    spacing_m: DVec3,
    points: usize,
}

impl Plume {
    pub(crate) fn new(flow: &Flow, shape: Shape, seed: u64) -> Plume {
        let mut random = SplitMix64::new(seed);
        let r0 = shape.source_radius_m;
        let rings = shape.rings.iter().map(|&height| {
            let z = (height + random.between(-0.1, 0.1)) * r0;
            let radius = column_radius(&shape, z);
            Vortex {
                // Cores lie at the edge of the column; the flow goes outward at the top and down at
                // the outside.
                center_m: [radius * random.between(0.95, 1.15), z],
                size_m: (0.45 + 0.12 * height) * r0.min(radius),
                turn_rad: -random.between(2.2, 3.6),
            }
        });
        let rings = Vortices(rings.collect());
        Plume {
            shape,
            rings,
            turbulence: Turbulence::new(flow, 2.0 * r0, seed),
            lean: [0, 1, 2, 3].map(|_| random.between(0.0, TAU)),
            origin_m: flow.origin_m,
            spacing_m: flow.spacing_m,
            points: flow.dims.x as usize,
        }
    }

    /// Computes the fraction of source gas along a row, 0 to 1.
    pub(crate) fn share_row(&self, d: &mut Displacement, j: u32, k: u32, share: &mut Vec<f32>) {
        let r0 = self.shape.source_radius_m;
        let height = self.spacing_m.z * k as f64 + self.origin_m.z;
        // The flow is calm at the floor and turbulent above the neck.
        let calm = (height / (0.8 * self.shape.neck_height * r0)).clamp(0.0, 1.0);
        let strength = self.shape.displacement * calm * calm;
        let size = column_radius(&self.shape, height).max(0.3 * r0) * 1.6;
        self.turbulence.displace_row(d, j, k, |_| (size, strength));
        share.clear();
        share.extend((0..self.points).map(|i| {
            let p = self.origin_m + self.spacing_m * DVec3::new(i as f64, j as f64, k as f64);
            let q = p + DVec3::new(d.rows[0][i] as f64, d.rows[1][i] as f64, d.rows[2][i] as f64);
            self.mean(q) as f32
        }));
    }

    /// Mean field, before the turbulent displacement.
    fn mean(&self, p: DVec3) -> f64 {
        let s = &self.shape;
        let r0 = s.source_radius_m;
        // The column sways; the rings are tilted and not quite round.
        let up = (p.z / r0).max(0.0);
        let [a, b, c, e] = self.lean;
        let sway = 0.06 * r0 * up.min(6.0);
        let (x, y) = (p.x - sway * (0.8 * up + a).sin(), p.y - sway * (0.9 * up + b).sin());
        let (r, angle) = (x.hypot(y), y.atan2(x));
        let uneven = r0 * (0.07 * (angle + c).cos() + 0.05 * (3.0 * angle + e).sin()) * up.min(1.0);
        let [r, z] = self.rings.origin_of([r, p.z + uneven]);
        let radius = column_radius(s, z);
        // The profile changes from a top hat at the source to a Gaussian above the neck.
        let sharpness = 2.0 + 10.0 * (-(z / (s.neck_height * r0)).max(0.0)).exp();
        let dilution = 1.0 / (1.0 + (z.max(0.0) / (s.half_height * r0)).powf(5.0 / 3.0));
        dilution * (-(r.abs() / radius).powf(sharpness)).exp()
    }
}

/// Radius of the column at a height.
fn column_radius(s: &Shape, z_m: f64) -> f64 {
    let up = (z_m / s.source_radius_m).max(0.0);
    let t = (up / s.neck_height).min(1.0);
    let necking = 1.0 - (1.0 - s.neck) * t * t * (3.0 - 2.0 * t);
    s.source_radius_m * (necking + s.growth * (up - s.neck_height).max(0.0))
}
