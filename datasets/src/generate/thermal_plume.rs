//! The mean turbulent plume above a small heat source, which is self-similar and has a closed form.
//!
//! B. R. Morton, G. I. Taylor and J. S. Turner, "Turbulent gravitational convection from maintained
//! and instantaneous sources", Proc. R. Soc. A 234, 1956. With the buoyancy flux F = g Q / (cp T0
//! ρ0) and entrainment α, a plume with Gaussian profiles in still air of constant density has
//!
//! ```text
//! b = 6/5 α z,   w³ = 3 F z / (π b²),   g' = 2 F / (π w b²) ∝ z^(-5/3),   ρ = ρ0 (1 - g'/g · exp(-r²/b²)),
//! ```
//!
//! so the density integrated along any horizontal line is the Abel transform of a Gaussian: `√π b
//! exp(-y²/b²)` times its amplitude ([`ThermalPlume::deficit_kg_per_m2`]). Values are samples at
//! points, so that the closed form holds to the last bit of an f32: the field is smooth, and its
//! mean over a box differs by h²/b² only.

use super::flow::{Fields, Flow, FlowError, names};
use super::gas_dynamics::GAS_CONSTANT_AIR;
use glam::{DVec3, UVec3};
use std::f64::consts::PI;

/// Acceleration of gravity, m/s².
const GRAVITY: f64 = 9.806_65;
/// Heat capacity of air, J/(kg K).
const HEAT_CAPACITY: f64 = 1004.7;

/// Parameters of the plume. The default is 100 W (a person) in a room at 293.15 K and 1 atm, from
/// 0.5 to 2 m above the source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThermalPlume {
    /// Convective heat flux, W.
    pub heat_w: f64,
    /// Entrainment coefficient; 0.1 for Gaussian profiles.
    pub entrainment: f64,
    /// Temperature of the still air, K.
    pub temperature_k: f64,
    /// Pressure, Pa.
    pub pressure_pa: f64,
    /// Heights of the lowest and highest point above the source; greater than 0.
    pub heights_m: [f64; 2],
}

impl Default for ThermalPlume {
    fn default() -> Self {
        ThermalPlume {
            heat_w: 100.0,
            entrainment: 0.1,
            temperature_k: 293.15,
            pressure_pa: 101_325.0,
            heights_m: [0.5, 2.0],
        }
    }
}

impl ThermalPlume {
    /// Density of the still air, kg/m³.
    pub fn still_density(&self) -> f64 {
        self.pressure_pa / (GAS_CONSTANT_AIR * self.temperature_k)
    }

    /// Radius b at a height, where the disturbance is 1/e of that on the axis.
    pub fn radius_m(&self, z_m: f64) -> f64 {
        1.2 * self.entrainment * z_m
    }

    /// Upward velocity on the axis, m/s.
    pub fn velocity_m_per_s(&self, z_m: f64) -> f64 {
        // From d(w²b²)/dz = 2 b² g' and π/2 w g' b² = F with w ∝ z^(-1/3).
        let b = self.radius_m(z_m);
        (3.0 * self.buoyancy_flux() / PI * z_m / (b * b)).cbrt()
    }

    /// Relative density deficit on the axis: g'/g.
    pub fn lightness(&self, z_m: f64) -> f64 {
        let b = self.radius_m(z_m);
        2.0 * self.buoyancy_flux() / (PI * self.velocity_m_per_s(z_m) * b * b * GRAVITY)
    }

    /// Buoyancy flux, m⁴/s³.
    pub fn buoyancy_flux(&self) -> f64 {
        GRAVITY * self.heat_w / (HEAT_CAPACITY * self.temperature_k * self.still_density())
    }

    /// Density at height `z_m` and distance `r_m` from the axis, kg/m³.
    pub fn density(&self, r_m: f64, z_m: f64) -> f64 {
        let b = self.radius_m(z_m);
        self.still_density() * (1.0 - self.lightness(z_m) * (-(r_m / b).powi(2)).exp())
    }

    /// Density deficit integrated along a horizontal line at distance `y_m` from the axis, kg/m².
    /// Times the Gladstone-Dale constant, it is the optical path difference; the derivative of that
    /// is the deflection.
    pub fn deficit_kg_per_m2(&self, y_m: f64, z_m: f64) -> f64 {
        let b = self.radius_m(z_m);
        self.still_density() * self.lightness(z_m) * PI.sqrt() * b * (-(y_m / b).powi(2)).exp()
    }

    /// Samples the density; with [`Fields::All`] also temperature and pressure. The lattice extends
    /// to each side by three radii of the highest plane; z is up, the source is at the origin.
    pub fn flow(&self, dims: UVec3, fields: Fields) -> Result<Flow, FlowError> {
        let [bottom, top] = self.heights_m;
        let side = 3.0 * self.radius_m(top);
        let mut flow =
            Flow::over(dims, DVec3::new(-side, -side, bottom), DVec3::new(side, side, top))?;
        let wanted =
            [(names::DENSITY, "kg/m³"), (names::TEMPERATURE, "K"), (names::PRESSURE, "Pa")];
        let wanted = if fields == Fields::All { &wanted[..] } else { &wanted[..1] };
        let (origin, spacing) = (flow.origin_m, flow.spacing_m);
        flow.fill(
            wanted,
            || (),
            |(), j, k, rows| {
                let first = origin + spacing * DVec3::new(0.0, j as f64, k as f64);
                let (b, missing) =
                    (self.radius_m(first.z), self.still_density() * self.lightness(first.z));
                for i in 0..rows[0].len() {
                    let x = first.x + spacing.x * i as f64;
                    let rho = self.still_density()
                        - missing * (-(x * x + first.y * first.y) / (b * b)).exp();
                    rows[0][i] = rho as f32;
                    if let [_, temperature, pressure] = rows {
                        temperature[i] = (self.pressure_pa / (GAS_CONSTANT_AIR * rho)) as f32;
                        pressure[i] = self.pressure_pa as f32;
                    }
                }
            },
        );
        Ok(flow)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conservation_laws_hold_at_every_height() {
        let plume = ThermalPlume::default();
        let flux = |z: f64| {
            let (w, b) = (plume.velocity_m_per_s(z), plume.radius_m(z));
            // Volume flux (without π), momentum flux (without π/2).
            (w * b * b, w * w * b * b)
        };
        for z in [0.3, 1.0, 4.0] {
            let (w, b, h) = (plume.velocity_m_per_s(z), plume.radius_m(z), 1e-5 * z);
            let ((v1, m1), (v2, m2)) = (flux(z - h), flux(z + h));
            let entrained = (v2 - v1) / (2.0 * h);
            assert!(
                (entrained / (2.0 * plume.entrainment * w * b) - 1.0).abs() < 1e-8,
                "volume at {z}"
            );
            let lift = 2.0 * b * b * plume.lightness(z) * GRAVITY;
            assert!(((m2 - m1) / (2.0 * h) / lift - 1.0).abs() < 1e-8, "momentum at {z}");
        }
        // Engineering formulas for Q in W and z in m: 0.128 Q^(1/3) z^(-1/3) m/s and 0.329 Q^(2/3)
        // z^(-5/3) K on the axis (after E. Mundt, thesis, KTH Stockholm, 1996), which agree with
        // the closed form for an entrainment of about 0.093.
        let excess = plume.lightness(1.0) * plume.temperature_k;
        assert!((plume.velocity_m_per_s(1.0) / (0.128 * 100f64.cbrt()) - 1.0).abs() < 0.1);
        assert!((excess / (0.329 * 100f64.powf(2.0 / 3.0)) - 1.0).abs() < 0.15, "{excess}");
    }

    #[test]
    fn sums_along_lines_are_the_closed_form() {
        let plume = ThermalPlume::default();
        let flow = plume.flow(UVec3::new(81, 41, 5), Fields::All).unwrap();
        let rho = flow.grid(names::DENSITY).unwrap();
        for k in 0..5 {
            for j in [10, 20, 23] {
                let p = flow.position_m(0, j, k);
                let sum: f64 =
                    (0..81).map(|i| plume.still_density() - rho.at(i, j, k) as f64).sum();
                let exact = plume.deficit_kg_per_m2(p.y, p.z);
                let most = plume.deficit_kg_per_m2(0.0, p.z);
                // Densities of 1.2 as f32 have a rounding error of 6e-8 each.
                assert!(
                    (sum * flow.spacing_m.x - exact).abs()
                        < 1e-4 * most + 81.0 * 6e-8 * flow.spacing_m.x,
                    "{j} {k}"
                );
            }
        }
        assert_eq!(rho.at(40, 20, 0), plume.density(0.0, 0.5) as f32);
    }
}
