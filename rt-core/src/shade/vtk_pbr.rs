//! The physically based model in VTK 9's shaders ([`PbrForm::Vtk`]), for programs that shade
//! points themselves and must get VTK's picture.
//!
//! ```
//! use rt_core::glam::Vec3;
//! use rt_core::vtk_pbr::{Cosines, VtkPbr};
//!
//! // Gold of roughness 0.5, seen and lit along its normal.
//! let gold = Vec3::new(1.0, 0.77, 0.34);
//! let metal = VtkPbr { metallic: 1.0, roughness: 0.5, ..VtkPbr::default() };
//! let reflected = metal.brdf(gold, Cosines { n_h: 1.0, n_v: 1.0, n_l: 1.0, h_l: 1.0 });
//! // D = 1 / (π α²) with α = 0.5², and V = 1/4.
//! let expected = 0.25 / (std::f32::consts::PI * 0.0625);
//! assert!((reflected - gold * expected).abs().max_element() < 1e-6);
//! ```
//!
//! [`PbrForm::Vtk`]: crate::material::PbrForm::Vtk

use glam::Vec3;
use std::f32::consts::PI;

/// Exponent with which VTK decodes colours and encodes radiance of physically based surfaces.
pub const GAMMA: f32 = 2.2;

/// Cosines between the directions at a point, each in 0..=1 and not 0 (VTK's shader takes 10⁻⁵ at
/// least): of the normal N, the viewer V, the light L and the half vector H.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cosines {
    /// N·H.
    pub n_h: f32,
    /// N·V.
    pub n_v: f32,
    /// N·L.
    pub n_l: f32,
    /// H·L.
    pub h_l: f32,
}

impl Cosines {
    /// Of unit vectors.
    #[inline]
    pub fn new(normal: Vec3, view: Vec3, light: Vec3) -> Cosines {
        let cosine = |a: Vec3, b: Vec3| a.dot(b).clamp(1e-5, 1.0);
        let half = (view + light).normalize_or_zero();
        Cosines {
            n_h: cosine(normal, half),
            n_v: cosine(normal, view),
            n_l: cosine(normal, light),
            h_l: cosine(half, light),
        }
    }
}

/// A material of VTK's shader (`vtkPBRFunctions.glsl` and `vtkOpenGLPolyDataMapper`, without clear
/// coat and anisotropy).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VtkPbr {
    /// 0 dielectric to 1 metal.
    pub metallic: f32,
    /// 0 smooth to 1 rough.
    pub roughness: f32,
    /// Reflectance of the dielectric along the normal.
    pub base_reflectance: f32,
    /// Reflectance of the metal at grazing angles.
    pub edge_tint: Vec3,
    /// Least divisor of D: 10⁻⁸ since VTK 9.7, 0 before.
    pub min_divisor: f32,
}

impl Default for VtkPbr {
    /// The values of a new `vtkProperty`.
    fn default() -> VtkPbr {
        VtkPbr {
            metallic: 0.0,
            roughness: 0.5,
            base_reflectance: 0.04,
            edge_tint: Vec3::ONE,
            min_divisor: 0.0,
        }
    }
}

impl VtkPbr {
    /// Share of the light reflected to the viewer, per steradian and without the cosine N·L:
    /// Lambert's term, and GGX with the height-correlated Smith term and Fresnel's factor.
    #[inline]
    pub fn brdf(&self, albedo: Vec3, cosines: Cosines) -> Vec3 {
        let mix = |a: Vec3, b: Vec3, t: f32| a * (1.0 - t) + b * t;
        let f0 = mix(Vec3::splat(self.base_reflectance), albedo, self.metallic);
        let grazing = (f0.element_sum() * 50.0 * 0.33).clamp(0.0, 1.0);
        let f90 = mix(Vec3::splat(grazing), self.edge_tint, self.metallic);
        // Schlick 1994, eq. 15.
        let m = 1.0 - cosines.h_l;
        let m2 = m * m;
        let f = f0 + (f90 - f0) * (m2 * m2 * m);
        let matte = (Vec3::ONE - f) * (1.0 - self.metallic) * albedo / PI;
        matte + f * self.lobe(cosines)
    }

    /// D·V of `SpecularIsotropic`: GGX with α = `roughness`² and Smith's term with α = `roughness`.
    #[inline]
    fn lobe(&self, Cosines { n_h, n_v, n_l, .. }: Cosines) -> f32 {
        let a = self.roughness * self.roughness;
        let a2 = a * a;
        let d = (n_h * a2 - n_h) * n_h + 1.0;
        // Where a perfect mirror reflects, the shader divides 0 by 0: no light here, which no pixel
        // would hit.
        let divisor = (PI * d * d).max(self.min_divisor).max(f32::MIN_POSITIVE);
        let visibility = 0.5
            / (n_l * (a + n_v * (n_v - a * n_v)).max(0.0).sqrt()
                + n_v * (a + n_l * (n_l - a * n_l)).max(0.0).sqrt());
        a2 / divisor * visibility
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rough_metal_reflects_less_along_the_normal_than_a_smooth_one_and_has_no_diffuse_part() {
        let metal = |roughness| VtkPbr { metallic: 1.0, roughness, ..VtkPbr::default() };
        let along = Cosines::new(Vec3::Z, Vec3::Z, Vec3::Z);
        let [rough, shiny] = [0.9, 0.2].map(|r| metal(r).brdf(Vec3::splat(0.5), along));
        assert!(rough.x < shiny.x, "{rough} {shiny}");
        // D V F with N = V = L = H: 1 / (π a²) 1/4 F0.
        let a2 = 0.9_f32.powi(4);
        assert!((rough.x - 0.5 * 0.25 / (PI * a2)).abs() < 1e-5, "{rough}");
    }

    #[test]
    fn highlights_of_smooth_metals_are_bounded_since_vtk_9_7() {
        let along = Cosines::new(Vec3::Z, Vec3::Z, Vec3::Z);
        let of = |roughness, min_divisor| {
            let metal = VtkPbr { metallic: 1.0, roughness, min_divisor, ..VtkPbr::default() };
            metal.brdf(Vec3::ONE, along).x
        };
        // a2 / 1e-8 · 1/4, where π a2² is less: below a roughness of 0.087.
        for roughness in [0.01f32, 0.05, 0.08] {
            let expected = roughness.powi(4) * 1e8 * 0.25;
            let found = of(roughness, 1e-8);
            assert!((found - expected).abs() < 1e-3 * expected, "{roughness}: {found} {expected}");
            assert!(of(roughness, 0.0) > found);
        }
        assert_eq!(of(0.1, 1e-8), of(0.1, 0.0), "rougher ones are as before");
        assert_eq!([of(0.0, 0.0), of(0.0, 1e-8)], [0.0; 2], "0 / 0 is no light");
    }
}
