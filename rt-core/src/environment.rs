//! What rays see when they leave the scene: light from all directions, and the image's background.

use crate::texture::Texture;
use glam::{Vec2, Vec3};
use std::f32::consts::PI;
use std::sync::Arc;

/// Radiance from infinitely far away, by direction. It lights surfaces (attenuated by ambient
/// occlusion). Reflected, refracted and path-traced rays see it when they leave the scene.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Environment {
    /// The same from all directions, linear RGB.
    Constant([f32; 3]),
    /// Linear in the height of the direction: `bottom` straight down, `top` straight up.
    Gradient {
        /// Radiance from below.
        bottom: [f32; 3],
        /// Radiance from above.
        top: [f32; 3],
        /// Up direction, unit length.
        up: Vec3,
    },
    /// A latitude-longitude image: texture v = 1 is `up`, u runs around it.
    Image {
        /// The image, linear.
        image: Arc<Texture>,
        /// Up direction, unit length.
        up: Vec3,
        /// Factor on the image.
        scale: f32,
    },
}

impl Environment {
    /// Radiance from unit direction `d` (pointing away from the scene).
    #[inline]
    pub fn radiance(&self, d: Vec3) -> Vec3 {
        match self {
            Environment::Constant(c) => (*c).into(),
            Environment::Gradient { bottom, top, up } => {
                let h = 0.5 + 0.5 * d.dot(*up).clamp(-1.0, 1.0);
                Vec3::from(*bottom).lerp((*top).into(), h)
            }
            Environment::Image { image, up, scale } => {
                let (e, n) = crate::math::orthonormal_basis(*up);
                // Stay half a texel away from the poles, so that a repeating texture does not mix
                // top and bottom there.
                let margin = 0.5 / image.size()[1] as f32;
                let height = 0.5 + d.dot(*up).clamp(-1.0, 1.0).asin() / PI;
                let around = 0.5 + d.dot(n).atan2(d.dot(e)) / (2.0 * PI);
                let uv = Vec2::new(around, height.clamp(margin, 1.0 - margin));
                let [r, g, b, _] = image.sample(uv);
                Vec3::new(r, g, b) * *scale
            }
        }
    }

    /// True when it emits no light.
    pub fn is_black(&self) -> bool {
        match self {
            Environment::Constant(c) => *c == [0.0; 3],
            Environment::Gradient { bottom, top, .. } => *bottom == [0.0; 3] && *top == [0.0; 3],
            Environment::Image { image, scale, .. } => *scale == 0.0 || image.is_black(),
        }
    }
}

/// Lengths of `up` that count as 1: an f32 vector that was normalised is within 1e-7, and one
/// written with four digits within 1e-4. The relative error of the radiance is no larger.
const UNIT: std::ops::RangeInclusive<f32> = 0.999..=1.001;

impl Environment {
    /// Checks the parameters; the error names the field, its value and the allowed values.
    pub(crate) fn check(&self) -> Result<(), (&'static str, String, &'static str)> {
        let light = |field, c: [f32; 3]| {
            let ok = c.iter().all(|v| v.is_finite() && *v >= 0.0);
            if ok { Ok(()) } else { Err((field, format!("{c:?}"), FINITE_LIGHT)) }
        };
        // All other directions are derived from `up` alone, so no unit vector is degenerate.
        let upright = |up: Vec3| {
            let ok = up.is_finite() && UNIT.contains(&crate::math::length(up));
            if ok { Ok(()) } else { Err(("up", up.to_string(), "of unit length: normalise it")) }
        };
        match self {
            Environment::Constant(c) => light("radiance", *c),
            Environment::Gradient { bottom, top, up } => {
                light("bottom", *bottom)?;
                light("top", *top)?;
                upright(*up)
            }
            Environment::Image { image, up, scale } => {
                upright(*up)?;
                if !(scale.is_finite() && *scale >= 0.0) {
                    return Err(("scale", scale.to_string(), "finite and not negative"));
                }
                texels("image", image)?;
                match image.negative_texel() {
                    None => Ok(()),
                    Some([x, y]) => Err(("image", texel_in_words(image, x, y), FINITE_LIGHT)),
                }
            }
        }
    }
}

const FINITE_LIGHT: &str = "finite and not negative in every channel";

/// Checks the texels of an image.
pub(crate) fn texels(
    field: &'static str,
    image: &Texture,
) -> Result<(), (&'static str, String, &'static str)> {
    match image.unusable_texel() {
        None => Ok(()),
        Some([x, y]) => {
            let rule = "finite in every channel: replace such texels, by black for example";
            Err((field, texel_in_words(image, x, y), rule))
        }
    }
}

fn texel_in_words(image: &Texture, x: usize, y: usize) -> String {
    format!("{:?} at texel ({x}, {y})", image.texels()[y * image.size()[0] + x])
}

impl Background {
    /// Checks the parameters, as [`Environment::check`].
    pub(crate) fn check(&self) -> Result<(), (&'static str, String, &'static str)> {
        let finite = |field, c: &[f32]| {
            let ok = c.iter().all(|v| v.is_finite() && *v >= 0.0);
            if ok { Ok(()) } else { Err((field, format!("{c:?}"), FINITE_LIGHT)) }
        };
        match self {
            Background::Transparent | Background::Environment => Ok(()),
            Background::Constant(c) => {
                finite("color", &c[..3])?;
                let ok = (0.0..=1.0).contains(&c[3]);
                if ok { Ok(()) } else { Err(("alpha", c[3].to_string(), "between 0 and 1")) }
            }
            Background::Gradient { bottom, top } => {
                finite("bottom", bottom)?;
                finite("top", top)
            }
        }
    }
}

/// What fills pixels that no surface covers.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub enum Background {
    /// Nothing: alpha 0, for compositing.
    #[default]
    Transparent,
    /// Linear RGBA, not premultiplied.
    Constant([f32; 4]),
    /// From the bottom row to the top row of the image, opaque.
    Gradient {
        /// Linear RGB of the bottom edge.
        bottom: [f32; 3],
        /// Linear RGB of the top edge.
        top: [f32; 3],
    },
    /// The scene's environment, opaque.
    Environment,
}

/// Cosine-weighted mean of an environment over the hemisphere around a normal, as nine spherical
/// harmonics (Ramamoorthi and Hanrahan, "An Efficient Representation for Irradiance Environment
/// Maps", 2001): exact for constant and gradient environments, within a few per cent of the mean
/// for images.
#[derive(Debug, Clone, Copy)]
pub(crate) struct IrradianceCoefficients {
    pub(crate) coefficients: [Vec3; 9],
}

impl IrradianceCoefficients {
    /// Projects `environment`, adding the isotropic radiance `ambient`. `None` when both are black.
    pub(crate) fn new(
        environment: Option<&Environment>,
        ambient: Vec3,
    ) -> Option<IrradianceCoefficients> {
        let mut c = [Vec3::ZERO; 9];
        match environment {
            Some(Environment::Constant(v)) => c[0] = (*v).into(),
            Some(Environment::Gradient { bottom, top, up }) => {
                let (bottom, top) = (Vec3::from(*bottom), Vec3::from(*top));
                c[0] = 0.5 * (bottom + top);
                // Mean of cos over the cosine-weighted hemisphere is 2/3.
                let slope = (0.5 * (top - bottom)) * (2.0 / 3.0);
                c[1] = slope * up.y;
                c[2] = slope * up.z;
                c[3] = slope * up.x;
            }
            Some(image) => c = project(image),
            None => {}
        }
        c[0] += ambient;
        (c.iter().any(|v| *v != Vec3::ZERO)).then_some(IrradianceCoefficients { coefficients: c })
    }

    /// Mean radiance for normal `n`.
    #[inline]
    pub(crate) fn for_normal(&self, n: Vec3) -> Vec3 {
        let c = &self.coefficients;
        let linear = c[0] + c[1] * n.y + c[2] * n.z + c[3] * n.x;
        let quadratic = c[4] * (n.x * n.y)
            + c[5] * (n.y * n.z)
            + c[6] * (3.0 * n.z * n.z - 1.0)
            + c[7] * (n.x * n.z)
            + c[8] * (n.x * n.x - n.y * n.y);
        (linear + quadratic).max(Vec3::ZERO)
    }
}

/// Numerical projection over 64 x 128 directions of equal solid angle per row; each basis
/// polynomial is convolved with cos/π.
fn project(environment: &Environment) -> [Vec3; 9] {
    const ROWS: usize = 64;
    let mut c = [Vec3::ZERO; 9];
    for i in 0..ROWS {
        let z = (2 * i + 1) as f32 / ROWS as f32 - 1.0;
        let r = (1.0 - z * z).sqrt();
        for j in 0..2 * ROWS {
            let (y, x) = ((j as f32 + 0.5) * PI / ROWS as f32).sin_cos();
            let d = Vec3::new(r * x, r * y, z);
            let l = environment.radiance(d) / (2 * ROWS * ROWS) as f32;
            let basis = [
                1.0,
                d.y,
                d.z,
                d.x,
                d.x * d.y,
                d.y * d.z,
                3.0 * d.z * d.z - 1.0,
                d.x * d.z,
                d.x * d.x - d.y * d.y,
            ];
            // 1 / mean square of each polynomial over the sphere, times the cosine lobe's factor
            // (1, 2/3, 1/4).
            let norm = [1.0, 3.0, 3.0, 3.0, 15.0, 15.0, 1.25, 15.0, 3.75];
            for k in 0..9 {
                let lobe = [1.0, 2.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0, 0.25, 0.25, 0.25, 0.25, 0.25][k];
                c[k] += l * (basis[k] * norm[k] * lobe);
            }
        }
    }
    c
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projection_reproduces_the_closed_form_of_a_gradient() {
        let up = Vec3::new(0.36, 0.48, 0.8);
        let g = Environment::Gradient { bottom: [0.1, 0.2, 0.3], top: [1.0, 0.8, 0.6], up };
        let exact = IrradianceCoefficients::new(Some(&g), Vec3::ZERO).unwrap();
        let numeric = IrradianceCoefficients { coefficients: project(&g) };
        for n in [Vec3::X, -Vec3::X, Vec3::Y, Vec3::Z, up, -up] {
            let (a, b) = (exact.for_normal(n), numeric.for_normal(n));
            assert!((a - b).abs().max_element() < 2e-3, "{n}: {a} {b}");
        }
    }

    #[test]
    fn quadratic_terms_match_a_direct_integral() {
        // Radiance d.z^2: the cosine-weighted mean is 1/2 along z and 1/4 across.
        let rows: Vec<[f32; 4]> = (0..256)
            .map(|i| {
                let z = (((i as f32 + 0.5) / 256.0 - 0.5) * PI).sin();
                [z * z, z * z, z * z, 1.0]
            })
            .collect();
        let image = Arc::new(Texture::from_linear(1, 256, rows).unwrap());
        let e = Environment::Image { image, up: Vec3::Z, scale: 1.0 };
        let m = IrradianceCoefficients::new(Some(&e), Vec3::ZERO).unwrap();
        assert!((m.for_normal(Vec3::Z).x - 0.5).abs() < 2e-3, "{}", m.for_normal(Vec3::Z).x);
        assert!((m.for_normal(Vec3::X).x - 0.25).abs() < 2e-3, "{}", m.for_normal(Vec3::X).x);
    }

    #[test]
    fn image_is_looked_up_by_direction() {
        let image = Arc::new(Texture::from_linear(1, 2, vec![[0.0; 4], [1.0; 4]]).unwrap());
        let e = Environment::Image { image, up: Vec3::Y, scale: 2.0 };
        assert!(e.radiance(Vec3::new(0.1, 0.9, 0.1).normalize()).x > 1.2);
        assert!(e.radiance(Vec3::new(0.1, -0.9, 0.1).normalize()).x < 0.8);
    }
}
