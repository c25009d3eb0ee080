//! Fresnel equations and the GGX microfacet model.

use glam::Vec3;

/// Share of unpolarised light that a smooth dielectric interface reflects (Fresnel 1823). `cos_i`
/// is the cosine on the incident side, `eta` the incident index over the transmitted one. Returns 1
/// beyond the critical angle.
#[inline]
pub(crate) fn fresnel_dielectric(cos_i: f32, eta: f32) -> f32 {
    let cos_i = cos_i.clamp(0.0, 1.0);
    let sin2_t = eta * eta * (1.0 - cos_i * cos_i);
    if sin2_t >= 1.0 {
        return 1.0;
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    // Relative index transmitted over incident is 1/eta.
    let parallel = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let perpendicular = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

/// Direction of the refracted ray for unit direction `dir` and unit normal `n` against it; `None`
/// at total internal reflection.
#[inline]
pub(crate) fn refract(dir: Vec3, n: Vec3, eta: f32) -> Option<Vec3> {
    let cos_i = -dir.dot(n);
    let sin2_t = eta * eta * (1.0 - cos_i * cos_i);
    if sin2_t >= 1.0 {
        return None;
    }
    Some((dir * eta + n * (eta * cos_i - (1.0 - sin2_t).sqrt())).normalize_or_zero())
}

/// Reflectance towards grazing angles from the reflectance `f0` at normal incidence (Schlick 1994,
/// eq. 15).
#[inline]
pub(crate) fn schlick(f0: Vec3, cos: f32) -> Vec3 {
    let m = (1.0 - cos).clamp(0.0, 1.0);
    let m2 = m * m;
    f0 + (Vec3::ONE - f0) * (m2 * m2 * m)
}

/// D·V of GGX with the height-correlated Smith term (Walter et al. 2007; Heitz 2014): the
/// microfacet BRDF without Fresnel.
#[inline]
pub(crate) fn ggx(n: Vec3, v: Vec3, l: Vec3, alpha: f32) -> f32 {
    let h = (v + l).normalize_or_zero();
    let (nh, nv, nl) = (n.dot(h), n.dot(v).max(1e-4), n.dot(l));
    if nl <= 0.0 || nh <= 0.0 {
        return 0.0;
    }
    let a2 = alpha * alpha;
    // 1 - nh² from the cross product keeps its accuracy for narrow lobes.
    let sin2 = n.cross(h).length_squared();
    let d = a2 / (std::f32::consts::PI * (nh * nh * a2 + sin2).powi(2));
    let g = nl * (nv * nv * (1.0 - a2) + a2).sqrt() + nv * (nl * nl * (1.0 - a2) + a2).sqrt();
    d * 0.5 / g
}

/// A microfacet normal visible from `v`, around +z (Dupuy and Benyoub, "Sampling Visible GGX
/// Normals with Spherical Caps", 2023).
#[inline]
pub(crate) fn sample_visible_normal(v: Vec3, alpha: f32, [a, b]: [f32; 2]) -> Vec3 {
    let s = Vec3::new(v.x * alpha, v.y * alpha, v.z).normalize_or_zero();
    let z = (1.0 - b) * (1.0 + s.z) - s.z;
    let r = (1.0 - z * z).clamp(0.0, 1.0).sqrt();
    let (sin, cos) = (std::f32::consts::TAU * a).sin_cos();
    let h = Vec3::new(r * cos, r * sin, z) + s;
    Vec3::new(h.x * alpha, h.y * alpha, h.z.max(0.0)).normalize_or_zero()
}

/// G2/G1: what is left of Fresnel's weight when the normal came from [`sample_visible_normal`].
#[inline]
pub(crate) fn masking_ratio(nv: f32, nl: f32, alpha: f32) -> f32 {
    if nl <= 0.0 || nv <= 0.0 {
        return 0.0;
    }
    let a2 = alpha * alpha;
    let v = (nv * nv * (1.0 - a2) + a2).sqrt();
    let l = (nl * nl * (1.0 - a2) + a2).sqrt();
    // G2 = 2 nl nv / (nl V + nv L), G1 = 2 nv / (nv + V).
    nl * (nv + v) / (nl * v + nv * l)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glass_reflects_four_per_cent_head_on_and_all_beyond_the_critical_angle() {
        assert!((fresnel_dielectric(1.0, 1.0 / 1.5) - 0.04).abs() < 1e-6);
        assert!((fresnel_dielectric(1.0, 1.5) - 0.04).abs() < 1e-6);
        let critical = (1.0f32 / 1.5).asin();
        assert!(fresnel_dielectric((critical + 1e-3).cos(), 1.5) == 1.0);
        assert!(fresnel_dielectric((critical - 1e-2).cos(), 1.5) < 0.9);
    }

    #[test]
    fn brewster_angle_reflects_half_of_the_perpendicular_share() {
        // At Brewster's angle the parallel part is 0: R = rs²/2 with rs = (1-n²)/(1+n²).
        let n = 1.33f32;
        let rs = (1.0 - n * n) / (1.0 + n * n);
        assert!((fresnel_dielectric(n.atan().cos(), 1.0 / n) - 0.5 * rs * rs).abs() < 1e-6);
    }

    #[test]
    fn refraction_follows_snell() {
        for (deg, eta) in [(10.0f32, 1.0 / 1.5), (60.0, 1.0 / 1.33), (35.0, 1.5)] {
            let (s, c) = deg.to_radians().sin_cos();
            let t = refract(Vec3::new(s, 0.0, -c), Vec3::Z, eta).unwrap();
            assert!((t.x - s * eta).abs() < 1e-6 && t.z < 0.0, "{deg}");
        }
        assert!(refract(Vec3::new(0.8, 0.0, -0.6), Vec3::Z, 1.5).is_none());
    }

    #[test]
    fn ggx_lobe_integrates_to_at_most_one() {
        // White furnace of a single lobe: sampled weight and direct integral agree, and lose a
        // little to shadowing.
        let v = Vec3::new(0.6, 0.0, 0.8);
        for alpha in [0.1f32, 0.4, 0.8] {
            let n = 256;
            let (mut sampled, mut integral) = (0.0f64, 0.0f64);
            for i in 0..n * n {
                let u = [
                    (i % n) as f32 / n as f32 + 0.5 / n as f32,
                    (i / n) as f32 / n as f32 + 0.5 / n as f32,
                ];
                let h = sample_visible_normal(v, alpha, u);
                let l = h * (2.0 * h.dot(v)) - v;
                sampled += masking_ratio(v.z, l.z, alpha) as f64;
                let d = crate::sampler::cosine_hemisphere(u);
                integral += (ggx(Vec3::Z, v, d, alpha) * std::f32::consts::PI) as f64;
            }
            let (sampled, integral) = (sampled / (n * n) as f64, integral / (n * n) as f64);
            assert!((sampled - integral).abs() < 0.01, "alpha {alpha}: {sampled} {integral}");
            assert!(sampled <= 1.0 && sampled > 0.4, "alpha {alpha}: {sampled}");
        }
    }
}
