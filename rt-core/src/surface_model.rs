//! Reflection models: what share of the light from one direction a surface sends into another.

/// Highlight of [`SurfaceModel::Phong`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum PhongForm {
    /// (N·H)^s with the half vector H: fixed-function OpenGL (Blinn 1977).
    #[default]
    HalfVector,
    /// (R·V)^s with the mirrored light direction R: VTK (Phong 1975).
    Mirrored,
    /// (max(R·V, 10⁻⁵))^s: VTK since 9.3. Exponents below 1 light also what R·V leaves dark.
    MirroredAboveZero,
    /// (N·L)^s, for any viewing direction: VTK's shader where a headlight is the only light.
    TowardsLight,
}

/// Formula of [`SurfaceModel::Pbr`] for lights.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub enum PbrForm {
    /// glTF 2.0, appendix B: the matte layer receives the light that the coat transmits at the
    /// viewing angle.
    #[default]
    Gltf,
    /// VTK 9's shader: the matte layer gets 1 - F at the half vector, and F includes the metal's
    /// colour; shadowing and masking use α = roughness, but the distribution uses α = roughness²;
    /// reflectance at grazing angles is min(1, 49.5·F₀). See [`crate::vtk_pbr`].
    Vtk {
        /// Least divisor of the distribution term, which bounds the highlights of nearly smooth
        /// surfaces: 10⁻⁸ since VTK 9.7, 0 before.
        min_divisor: f32,
        /// The only light is a headlight. VTK's shader then lights each point along the ray that
        /// sees it, whatever direction the light has.
        headlight: bool,
    },
}

/// The reflection model of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum SurfaceModel {
    /// The colour without lighting: pre-lit vertex colours, annotations.
    Unlit,
    /// Ideal diffuse.
    Matte,
    /// OpenGL's and VTK's model: coefficients times the colour, plus a highlight, plus an optional
    /// mirror.
    Phong {
        /// Times colour times ambient light.
        ambient: f32,
        /// Times colour times light times cosine.
        diffuse: f32,
        /// Highlight colour; black for none.
        specular: [f32; 3],
        /// The highlight is this colour times the surface's, as where a texture multiplies the lit
        /// colour (OpenGL's `GL_MODULATE`, actors' textures in VTK).
        tinted: bool,
        /// Exponent of the highlight.
        shininess: f32,
        /// Form of the highlight.
        highlight: PhongForm,
        /// Share of mirror reflection added, 0..=1; 0 sends no rays.
        mirror: f32,
    },
    /// A metal: the colour is its reflectance at normal incidence (Schlick 1994 towards grazing).
    Metal {
        /// 0 for a mirror, 1 for very rough (GGX α = roughness²).
        roughness: f32,
    },
    /// Glass, water: Fresnel reflection and refraction at a smooth interface.
    Dielectric {
        /// Refractive index inside over outside.
        ior: f32,
        /// Absorption per world unit inside, by channel: transmittance over length s is
        /// exp(-absorption s).
        absorption: [f32; 3],
    },
    /// Base colour, metallic, roughness (glTF 2.0's metallic-roughness model).
    Pbr {
        /// 0 dielectric to 1 metal.
        metallic: f32,
        /// 0 mirror to 1 rough (GGX α = roughness²).
        roughness: f32,
        /// Reflectance at normal incidence of the dielectric part; 0.04 for common plastics, 0 for
        /// none (sends no rays).
        specular: f32,
        /// Formula for lights; rays to other surfaces use glTF's.
        form: PbrForm,
    },
}
