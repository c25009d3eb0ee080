//! Terms of the physically based model in VTK 9's shaders ([`PbrForm::Vtk`]), for programs that
//! shade points themselves and must get VTK's picture.
//!
//! ```
//! use rt_core::glam::Vec3;
//! use rt_core::vtk_pbr::{fresnel, specular_isotropic};
//!
//! // Gold of roughness 0.5, seen and lit along its normal.
//! let gold = Vec3::new(1.0, 0.77, 0.34);
//! let lobe = specular_isotropic([1.0; 3], 0.5, 0.0);
//! let reflected = fresnel(gold, Vec3::ONE, 1.0) * lobe;
//! // D = 1 / (π α²) with α = 0.5², and V = 1/4.
//! let expected = 0.25 / (std::f32::consts::PI * 0.0625);
//! assert!((reflected - gold * expected).abs().max_element() < 1e-6);
//! ```
//!
//! [`PbrForm::Vtk`]: crate::material::PbrForm::Vtk

use glam::Vec3;
use std::f32::consts::PI;

/// Microfacet term D·V of VTK's `SpecularIsotropic`, per steradian, without Fresnel's factor: GGX
/// with α = `roughness`² and the height-correlated Smith term with α = `roughness`.
///
/// The cosines are those between the normal and the half vector, the viewer and the light, in 0..=1
/// and not 0. The divisor of D is at least `min_divisor`: 1e-8 since VTK 9.7, 0 before.
#[inline]
pub fn specular_isotropic([n_h, n_v, n_l]: [f32; 3], roughness: f32, min_divisor: f32) -> f32 {
    let a = roughness * roughness;
    let a2 = a * a;
    let d = (n_h * a2 - n_h) * n_h + 1.0;
    let distribution = a2 / (PI * d * d).max(min_divisor);
    let visibility = 0.5
        / (n_l * (a + n_v * (n_v - a * n_v)).max(0.0).sqrt()
            + n_v * (a + n_l * (n_l - a * n_l)).max(0.0).sqrt());
    distribution * visibility
}

/// Reflectance at a cosine between half vector and light, from those along the normal, `f0`, and at
/// grazing angles, `f90` (Schlick 1994, eq. 15).
#[inline]
pub fn fresnel(f0: Vec3, f90: Vec3, h_l: f32) -> Vec3 {
    let m = 1.0 - h_l;
    let m2 = m * m;
    f0 + (f90 - f0) * (m2 * m2 * m)
}
