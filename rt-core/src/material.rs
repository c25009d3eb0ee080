//! How surfaces look: colour, reflection model, opacity and sides.

use crate::colormap::ColorMap;
use crate::environment::texels;
use crate::material_maps::MaterialMaps;
pub use crate::surface_model::{PbrForm, PhongForm, SurfaceModel};
use crate::texture::Texture;
use std::sync::Arc;

/// Where a surface's colour comes from.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub enum ColorSource {
    /// The geometry's own colours if it has any (per vertex, per triangle, per primitive), else
    /// [`Material::color`].
    #[default]
    Attribute,
    /// [`Material::color`] even on geometry with colours.
    Constant,
    /// The geometry's scalars, interpolated first and colour-mapped afterwards (thesis section
    /// 3.2.5), so that the map stays sharp inside large triangles.
    Scalars(Arc<ColorMap>),
    /// A texture at the mesh's texture coordinates, times [`Material::color`].
    Texture(Arc<Texture>),
}

/// How the numbers of a geometry's own colours, and of colour maps, become linear RGB.
///
/// ```
/// use rt_core::material::{ColorTransfer, Material};
/// use rt_core::vtk_pbr::GAMMA;
/// let color_transfer = ColorTransfer::Power { factor: 1.0, exponent: GAMMA };
/// let decoded = Material { color_transfer, ..Material::pbr([1.0; 3], 0.0, 0.5) };
/// assert_ne!(decoded, Material::pbr([1.0; 3], 0.0, 0.5));
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub enum ColorTransfer {
    /// They are linear RGB.
    #[default]
    Linear,
    /// (`factor` · c)^`exponent` for each number c of the colour at a point, after interpolation;
    /// VTK decodes colours of its physically based surfaces with an exponent of 2.2.
    Power {
        /// Finite and not negative.
        factor: f32,
        /// Finite and positive.
        exponent: f32,
    },
}

impl ColorTransfer {
    /// Linear RGB of a colour; opacity stays.
    #[inline]
    pub(crate) fn apply(self, color: [f32; 4]) -> [f32; 4] {
        let ColorTransfer::Power { factor, exponent } = self else { return color };
        let [r, g, b, alpha] = color;
        let [r, g, b] = [r, g, b].map(|c| {
            let scaled = (factor * c).max(0.0);
            if exponent == 1.0 { scaled } else { scaled.powf(exponent) }
        });
        [r, g, b, alpha]
    }
}

/// Which sides of a surface are drawn and lit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Sides {
    /// Both; the geometric orientation turns the normal towards the viewer
    /// (GL_LIGHT_MODEL_TWO_SIDE).
    #[default]
    Both,
    /// Both; the shading normal is turned towards the viewer by its own direction (VTK).
    BothByNormal,
    /// Both are drawn and lit with the outward normal (OpenGL's one-sided lighting: backs are
    /// dark).
    LitOutside,
    /// Only the outside; rays pass through backs (GL_CULL_FACE, GL_BACK).
    FrontOnly,
    /// Only the inside; rays pass through fronts (GL_CULL_FACE, GL_FRONT).
    BackOnly,
}

/// A material.
#[derive(Debug, Clone)]
pub struct Material {
    /// Reflection model.
    pub model: SurfaceModel,
    /// Linear RGB.
    pub color: [f32; 3],
    /// What replaces or modulates `color`.
    pub color_source: ColorSource,
    /// Of the geometry's colours ([`ColorSource::Attribute`], [`ColorSource::Scalars`]); `color`
    /// and textures are linear RGB.
    pub color_transfer: ColorTransfer,
    /// 1 opaque to 0 invisible; times the alpha of the colour source.
    pub opacity: f32,
    /// Emitted radiance, linear RGB.
    pub emission: [f32; 3],
    /// Sides drawn.
    pub sides: Sides,
    /// Use the geometric normal even where shading normals exist (GL_FLAT).
    pub flat: bool,
    /// Parameters that vary over the surface, besides the colour; `None` for none.
    pub maps: Option<Arc<dyn MaterialMaps>>,
}

/// Maps are equal when they are the same object.
impl PartialEq for Material {
    fn eq(&self, o: &Material) -> bool {
        let same = match (&self.maps, &o.maps) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (a, b) => a.is_none() && b.is_none(),
        };
        let key = |m: &Material| (m.model, m.color, m.opacity, m.emission, m.sides, m.flat);
        same && key(self) == key(o)
            && self.color_source == o.color_source
            && self.color_transfer == o.color_transfer
    }
}

impl Material {
    fn new(model: SurfaceModel, color: [f32; 3]) -> Material {
        Material {
            model,
            color,
            color_source: ColorSource::Attribute,
            color_transfer: ColorTransfer::Linear,
            opacity: 1.0,
            emission: [0.0; 3],
            sides: Sides::Both,
            flat: false,
            maps: None,
        }
    }

    /// Ideal diffuse.
    pub fn matte(color: [f32; 3]) -> Material {
        Material::new(SurfaceModel::Matte, color)
    }

    /// The colour without lighting.
    pub fn unlit(color: [f32; 3]) -> Material {
        Material::new(SurfaceModel::Unlit, color)
    }

    /// OpenGL-like: full ambient and diffuse, a white highlight of strength `specular`.
    pub fn phong(color: [f32; 3], specular: f32, shininess: f32) -> Material {
        let model = SurfaceModel::Phong {
            ambient: 1.0,
            diffuse: 1.0,
            specular: [specular; 3],
            tinted: false,
            shininess,
            highlight: PhongForm::HalfVector,
            mirror: 0.0,
        };
        Material::new(model, color)
    }

    /// A metal with reflectance `color`.
    pub fn metal(color: [f32; 3], roughness: f32) -> Material {
        Material::new(SurfaceModel::Metal { roughness }, color)
    }

    /// Clear glass of refractive index `ior`.
    pub fn dielectric(ior: f32) -> Material {
        Material::new(SurfaceModel::Dielectric { ior, absorption: [0.0; 3] }, [1.0; 3])
    }

    /// Metallic-roughness.
    pub fn pbr(color: [f32; 3], metallic: f32, roughness: f32) -> Material {
        Material::new(
            SurfaceModel::Pbr { metallic, roughness, specular: 0.04, form: PbrForm::Gltf },
            color,
        )
    }

    /// The same material with another opacity.
    #[must_use]
    pub fn with_opacity(self, opacity: f32) -> Material {
        Material { opacity, ..self }
    }

    /// The same material coloured by scalars.
    #[must_use]
    pub fn colored_by_scalars(self, map: impl Into<Arc<ColorMap>>) -> Material {
        Material { color_source: ColorSource::Scalars(map.into()), ..self }
    }

    /// The same material with a texture.
    #[must_use]
    pub fn textured(self, texture: impl Into<Arc<Texture>>) -> Material {
        Material { color_source: ColorSource::Texture(texture.into()), ..self }
    }

    /// The same material with emission.
    #[must_use]
    pub fn with_emission(self, emission: [f32; 3]) -> Material {
        Material { emission, ..self }
    }

    /// The same material with other sides drawn.
    #[must_use]
    pub fn with_sides(self, sides: Sides) -> Material {
        Material { sides, ..self }
    }

    /// The same material with maps.
    #[must_use]
    pub fn with_maps(self, maps: impl Into<Arc<dyn MaterialMaps>>) -> Material {
        Material { maps: Some(maps.into()), ..self }
    }

    /// Whether one side is culled.
    pub(crate) fn culls(&self) -> bool {
        matches!(self.sides, Sides::FrontOnly | Sides::BackOnly)
    }

    /// Roughness of the reflection rays that it sends: `None` for no such rays.
    pub(crate) fn reflection_roughness(&self) -> Option<f32> {
        match self.model {
            SurfaceModel::Phong { mirror, .. } if mirror > 0.0 => Some(0.0),
            SurfaceModel::Metal { roughness } => Some(roughness),
            SurfaceModel::Pbr { metallic, roughness, specular, .. }
                if metallic > 0.0 || specular > 0.0 =>
            {
                Some(roughness)
            }
            _ => None,
        }
    }

    /// Checks the parameters; the error names the field.
    pub(crate) fn check(&self) -> Result<(), (&'static str, String, &'static str)> {
        let unit = |field, v: f32| {
            if (0.0..=1.0).contains(&v) {
                Ok(())
            } else {
                Err((field, v.to_string(), "between 0 and 1"))
            }
        };
        let light = |field, v: [f32; 3]| {
            if v.iter().all(|x| x.is_finite() && *x >= 0.0) {
                Ok(())
            } else {
                Err((field, format!("{v:?}"), "finite and not negative in every channel"))
            }
        };
        match &self.color_source {
            ColorSource::Attribute | ColorSource::Constant => {}
            ColorSource::Scalars(map) => map.check()?,
            ColorSource::Texture(texture) => texels("texture", texture)?,
        }
        if let ColorTransfer::Power { factor, exponent } = self.color_transfer {
            light("color transfer's factor", [factor; 3])?;
            if !(exponent > 0.0 && exponent.is_finite()) {
                let field = "color transfer's exponent";
                return Err((field, exponent.to_string(), "finite and positive"));
            }
        }
        unit("opacity", self.opacity)?;
        light("color", self.color)?;
        light("emission", self.emission)?;
        match self.model {
            SurfaceModel::Unlit | SurfaceModel::Matte => Ok(()),
            SurfaceModel::Phong { ambient, diffuse, specular, shininess, mirror, .. } => {
                light("ambient", [ambient; 3])?;
                light("diffuse", [diffuse; 3])?;
                light("specular", specular)?;
                light("shininess", [shininess; 3])?;
                unit("mirror", mirror)
            }
            SurfaceModel::Metal { roughness } => unit("roughness", roughness),
            SurfaceModel::Dielectric { ior, absorption } => {
                light("absorption", absorption)?;
                if ior.is_finite() && ior > 0.0 {
                    Ok(())
                } else {
                    Err(("ior", ior.to_string(), "finite and positive"))
                }
            }
            SurfaceModel::Pbr { metallic, roughness, specular, .. } => {
                unit("metallic", metallic)?;
                unit("roughness", roughness)?;
                unit("specular", specular)
            }
        }
    }
}
