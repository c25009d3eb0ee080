//! A wedge in a supersonic stream: exact plane shocks, and the exact expansion behind its shoulder.
//!
//! The wedge lies along x with its edge at the origin, symmetric about y = 0 and the same at all z.
//! Its surface is inclined at `half_angle` for `length_m`; then it is parallel to the stream.
//! Between shock and shoulder, the gas is uniform
//! ([`theta_beta_m`](super::gas_dynamics::theta_beta_m)); the fan of Mach lines from the shoulder
//! is the centred wave of Prandtl and Meyer. The lattice ends before the fan reaches and bends the
//! shock, so the whole flow is exact. Values are cell averages.

use super::cell_average::{LayeredFlow, Scratch, average_row};
use super::flow::{Fields, Flow, FlowError, names};
use super::gas_dynamics::theta_beta_m::{Branch, ObliqueShock, oblique_shock};
use super::gas_dynamics::{FreeStream, GAMMA_AIR, isentropic, prandtl_meyer};
use glam::{DVec3, UVec3};
use rt_core::mesh::TriMesh;
use std::f64::consts::FRAC_PI_2;

/// Parameters of the flow. The default is a wedge of 10 degrees at Mach 2 in a tunnel with a
/// reservoir at 200 kPa and 300 K.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wedge {
    /// Air far upstream.
    pub stream: FreeStream,
    /// Half of the angle at the edge.
    pub half_angle_rad: f64,
    /// Length from edge to shoulder, along x.
    pub length_m: f64,
    /// Extent along z, the line of sight through a wind tunnel's window.
    pub span_m: f64,
}

impl Default for Wedge {
    fn default() -> Self {
        Wedge {
            stream: FreeStream::from_reservoir(2.0, 2e5, 300.0),
            half_angle_rad: 10f64.to_radians(),
            length_m: 0.05,
            span_m: 0.1,
        }
    }
}

impl Wedge {
    /// The shock: angle, jump and Mach number behind it.
    pub fn shock(&self) -> Result<ObliqueShock, FlowError> {
        Ok(oblique_shock(GAMMA_AIR, self.stream.mach, self.half_angle_rad, Branch::Weak)?)
    }

    /// Computes density (with [`Fields::All`] also temperature, pressure and the gas fraction). The
    /// lattice reaches from 0.2 lengths before the edge to at most 1.6 lengths behind it, and as
    /// far up and down as the shock.
    pub fn flow(&self, dims: UVec3, fields: Fields) -> Result<Flow, FlowError> {
        let wave = Wave::new(self)?;
        let l = self.length_m;
        let end = (1.6 * l).min(0.98 * wave.undisturbed_until_m);
        let top = end * wave.shock.shock_rad.tan() * 1.02;
        let low = DVec3::new(-0.2 * l, -top, -0.5 * self.span_m);
        let mut flow = Flow::over(dims, low, DVec3::new(end, top, 0.5 * self.span_m))?;
        fill_gas(&mut flow, &wave, fields);
        flow.body = Some(self.body(end));
        Ok(flow)
    }

    /// The wedge as a prism that ends at `end_m`.
    fn body(&self, end_m: f64) -> TriMesh {
        let (l, z) = (self.length_m.min(end_m), 0.5 * self.span_m);
        let h = l * self.half_angle_rad.tan();
        let mut outline = vec![[0.0, 0.0], [l, -h]];
        if end_m > l {
            outline.extend([[end_m, -h], [end_m, h]]);
        }
        outline.push([l, h]);
        let n = outline.len() as u32;
        let points: Vec<DVec3> = [-z, z]
            .iter()
            .flat_map(|&z| outline.iter().map(move |p| DVec3::new(p[0], p[1], z)))
            .collect();
        let mut triangles: Vec<[u32; 3]> =
            (2..n).flat_map(|i| [[0, i, i - 1], [n, n + i - 1, n + i]]).collect();
        for i in 0..n {
            let (a, b) = (i, (i + 1) % n);
            triangles.extend([[a, b, n + b], [a, n + b, n + a]]);
        }
        TriMesh::from_f64_positions(&points, triangles)
    }
}

/// Fills in cell averages of the density; with [`Fields::All`] also of temperature, pressure and
/// gas fraction.
pub(crate) fn fill_gas<F: LayeredFlow>(flow: &mut Flow, layers: &F, fields: Fields) {
    let (origin, spacing, n) = (flow.origin_m, flow.spacing_m, flow.dims.x as usize);
    let all = [
        (names::DENSITY, "kg/m³"),
        (names::TEMPERATURE, "K"),
        (names::PRESSURE, "Pa"),
        (names::GAS_FRACTION, "1"),
    ];
    let wanted = if fields == Fields::All { &all[..] } else { &all[..1] };
    let scratch = || (Scratch::default(), [const { Vec::new() }; 3]);
    flow.fill(wanted, scratch, |(scratch, spare), j, k, rows| {
        let first = origin + spacing * DVec3::new(0.0, j as f64, k as f64);
        let [temperature, pressure, gas] = spare;
        if let [density, temperature, pressure, gas] = rows {
            average_row(
                layers,
                first,
                spacing,
                n,
                scratch,
                &mut [density, temperature, pressure, gas],
            );
        } else {
            for v in [&mut *temperature, &mut *pressure, &mut *gas] {
                v.resize(n, 0.0);
            }
            average_row(
                layers,
                first,
                spacing,
                n,
                scratch,
                &mut [&mut *rows[0], temperature, pressure, gas],
            );
        }
    });
}

/// The exact solution.
struct Wave {
    stream: FreeStream,
    shock: ObliqueShock,
    half_angle_rad: f64,
    /// Position of the shoulder.
    shoulder_m: [f64; 2],
    /// Angles of the first and last Mach line of the fan.
    fan_rad: [f64; 2],
    /// Prandtl-Meyer angle before the fan.
    turn_before_rad: f64,
    /// Position where the fan meets the shock.
    undisturbed_until_m: f64,
    /// Density, temperature and pressure: in the free stream, behind the shock, behind the fan.
    states: [[f64; 3]; 3],
    /// Total (stagnation) values behind the shock.
    total: [f64; 3],
}

impl Wave {
    fn new(wedge: &Wedge) -> Result<Wave, FlowError> {
        let shock = wedge.shock()?;
        let s = wedge.stream;
        let before = shock.mach_behind;
        let free = [s.density(), s.temperature_k, s.pressure_pa];
        let ratios = [shock.jump.density, shock.jump.temperature, shock.jump.pressure];
        let behind = [0, 1, 2].map(|c| free[c] * ratios[c]);
        // Close to detachment, the flow behind the shock is subsonic, and the closed form does not
        // cover the shoulder.
        let turn_before_rad = prandtl_meyer::angle_rad(GAMMA_AIR, before)?;
        let after = prandtl_meyer::mach(GAMMA_AIR, turn_before_rad + wedge.half_angle_rad)?;
        let fan_rad = [wedge.half_angle_rad + (1.0 / before).asin(), (1.0 / after).asin()];
        let total = [0, 1, 2].map(|c| behind[c] / ratios_at(before)[c]);
        let (l, h) = (wedge.length_m, wedge.length_m * wedge.half_angle_rad.tan());
        let (fan, front) = (fan_rad[0].tan(), shock.shock_rad.tan());
        // The first Mach line is steeper than the shock (the flow component normal to a shock is
        // subsonic behind it), so they meet.
        let undisturbed_until_m =
            if fan_rad[0] < FRAC_PI_2 { (l * fan - h) / (fan - front) } else { l };
        Ok(Wave {
            stream: s,
            shock,
            half_angle_rad: wedge.half_angle_rad,
            shoulder_m: [l, h],
            fan_rad,
            turn_before_rad,
            undisturbed_until_m,
            states: [free, behind, [0, 1, 2].map(|c| total[c] * ratios_at(after)[c])],
            total,
        })
    }

    /// Position at height `r` of the line from the shoulder at `angle`.
    fn line_x_m(&self, angle: f64, r: f64) -> f64 {
        self.shoulder_m[0] + (r - self.shoulder_m[1]) / angle.tan()
    }

    /// Mach number on the Mach line at `angle`: with ω the angle from the line where M = 1,
    /// M² = 1 + k² tan²(ω / k), k² = (γ+1)/(γ-1).
    fn fan_mach(&self, angle: f64) -> f64 {
        let k = ((GAMMA_AIR + 1.0) / (GAMMA_AIR - 1.0)).sqrt();
        let omega = self.half_angle_rad + self.turn_before_rad + FRAC_PI_2 - angle;
        (1.0 + (k * (omega / k).tan()).powi(2)).sqrt()
    }
}

/// Density, temperature and pressure over their total (stagnation) values.
fn ratios_at(mach: f64) -> [f64; 3] {
    [isentropic::density, isentropic::temperature, isentropic::pressure].map(|f| f(GAMMA_AIR, mach))
}

impl LayeredFlow for Wave {
    const QUANTITIES: usize = 3;

    fn r_m(&self, y_m: f64, _: f64) -> f64 {
        y_m.abs()
    }

    fn jumps_m(&self, r: f64) -> [f64; 4] {
        let front = r / self.shock.shock_rad.tan();
        if r < self.shoulder_m[1] {
            [front, r / self.half_angle_rad.tan(), f64::NAN, f64::NAN]
        } else {
            // The fan's ends are kinks, and its apex nearly a jump.
            [front, self.line_x_m(self.fan_rad[0], r), self.line_x_m(self.fan_rad[1], r), f64::NAN]
        }
    }

    fn at(&self, x: f64, r: f64, out: &mut [f64]) -> bool {
        let [xs, ys] = self.shoulder_m;
        let state = if x < r / self.shock.shock_rad.tan() {
            debug_assert!(self.stream.mach > 1.0);
            self.states[0]
        } else if r < ys {
            self.states[1]
        } else {
            let angle = (r - ys).atan2(x - xs);
            if angle > self.fan_rad[0] {
                self.states[1]
            } else if angle < self.fan_rad[1] {
                self.states[2]
            } else {
                let ratios = ratios_at(self.fan_mach(angle));
                [0, 1, 2].map(|c| self.total[c] * ratios[c])
            }
        };
        out.copy_from_slice(&state);
        // Inside the wedge.
        !(x > 0.0 && r < ys.min(x * self.half_angle_rad.tan()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{open_or_flipped_edges, volume, with_threads};

    const DIMS: UVec3 = UVec3::new(91, 81, 4);

    #[test]
    fn mean_of_a_column_tells_where_the_shock_is_to_a_hundredth_of_a_cell() {
        let wedge = Wedge::default();
        let shock = wedge.shock().unwrap();
        let flow = wedge.flow(DIMS, Fields::Density).unwrap();
        let density = flow.grid(names::DENSITY).unwrap();
        let (free, behind) = (wedge.stream.density(), wedge.stream.density() * shock.jump.density);
        // Along rows above the shoulder and before the fan, the excess is (behind - free) times the
        // length behind the shock.
        for j in (50..78).step_by(3) {
            let y = flow.position_m(0, j, 0).y;
            let front = y / shock.shock_rad.tan();
            let last = (((front + 0.004 - flow.origin_m.x) / flow.spacing_m.x) as u32)
                .min(flow.dims.x - 1);
            let mass: f64 = (0..=last).map(|i| density.at(i, j, 1) as f64 - free).sum::<f64>()
                * flow.spacing_m.x;
            let end = flow.position_m(last, 0, 0).x + 0.5 * flow.spacing_m.x;
            let found = end - mass / (behind - free);
            assert!((found - front).abs() < 0.01 * flow.spacing_m.x, "row {j}: {found} {front}");
        }
    }

    #[test]
    fn fan_joins_both_uniform_states_and_obeys_the_isentropic_law() {
        let wave = Wave::new(&Wedge::default()).unwrap();
        let [head, tail] = wave.fan_rad;
        for (angle, state) in [(head, wave.states[1]), (tail, wave.states[2])] {
            let ratios = ratios_at(wave.fan_mach(angle));
            for c in 0..3 {
                assert!((ratios[c] * wave.total[c] / state[c] - 1.0).abs() < 1e-12, "{angle} {c}");
            }
        }
        let exponent = (wave.states[2][2] / wave.states[1][2]).ln()
            / (wave.states[2][0] / wave.states[1][0]).ln();
        assert!((exponent - 1.4).abs() < 1e-12);
        // Apart from the loss in the shock, the pressure behind the shoulder is near that of the
        // free stream.
        assert!((wave.states[2][2] / wave.states[0][2] - 1.0).abs() < 0.05);
    }

    #[test]
    fn solid_is_nan_and_its_body_is_closed() {
        let wedge = Wedge::default();
        let flow = wedge.flow(DIMS, Fields::All).unwrap();
        let body = flow.body.as_ref().unwrap();
        assert_eq!(open_or_flipped_edges(&body.indices), 0);
        assert!(volume(body) > 0.0);
        let (density, gas) =
            (flow.field(names::DENSITY).unwrap(), flow.field(names::GAS_FRACTION).unwrap());
        for (d, g) in density.values.iter().zip(&gas.values) {
            assert_eq!(d.is_nan(), *g == 0.0);
        }
        // Volume of the solid within the boxes, from the fractions and from the body (whose ends
        // lie in the middle of boxes).
        let cell = flow.spacing_m.x * flow.spacing_m.y;
        let mut solid = 0.0;
        for i in 0..flow.dims.x as usize {
            let weight = if i as u32 == flow.dims.x - 1 { 0.5 } else { 1.0 };
            for j in 0..flow.dims.y as usize {
                solid += weight * (1.0 - gas.values[j * flow.dims.x as usize + i] as f64) * cell;
            }
        }
        let area = volume(body) / wedge.span_m;
        assert!((solid / area - 1.0).abs() < 0.01, "{solid} {area}");
        // p = rho R T also holds for means in uniform regions.
        let at = flow.grid(names::PRESSURE).unwrap().index(2, 40, 1);
        let of = |name| flow.field(name).unwrap().values[at] as f64;
        let gas_constant = of(names::PRESSURE) / of(names::DENSITY) / of(names::TEMPERATURE);
        assert!((gas_constant - 287.05).abs() < 0.01, "{gas_constant}");
    }

    #[test]
    fn same_bits_on_1_2_7_threads() {
        let bits = |threads| {
            with_threads(threads, || {
                let flow = Wedge::default().flow(UVec3::new(20, 21, 9), Fields::All).unwrap();
                flow.fields.iter().map(|f| crate::testing::crc32_f32(&f.values)).collect::<Vec<_>>()
            })
        };
        assert!(bits(1) == bits(2) && bits(1) == bits(7));
    }

    #[test]
    fn detached_wedge_is_an_error_with_the_limit() {
        let blunt = Wedge { half_angle_rad: 0.5, ..Default::default() };
        assert!(blunt.flow(DIMS, Fields::All).unwrap_err().to_string().contains("22.97"));
    }
}
