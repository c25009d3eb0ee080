//! Materials, lights and background. All images use the same lighting, so they differ only by their
//! effects.
//!
//! The key light is above the viewer's right shoulder, a weak headlight fills the shadows, and
//! ambient light is a quarter of white. All lights move with the camera, so every visible surface
//! is lit.

use super::subject::{FieldValues, PartColoring, Subject, VolumeField};
use anyhow::Context as _;
use datasets::colormaps;
use glam::{DVec3, Vec3};
use rt_core::bvh::BuildOptions;
use rt_core::camera::{Camera, ThinLens};
use rt_core::colormap::ColorMap;
use rt_core::effects::Effects;
use rt_core::environment::{Background, Environment};
use rt_core::light::{Light, LightKind};
use rt_core::material::{Material, SurfaceModel};
use rt_core::scene::{AmbientOcclusion, Scene, SceneBuilder};
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{Volume, VolumeOptions};

/// Appearance of the subject and its surroundings.
#[derive(Debug, Clone, PartialEq)]
pub struct RenderStyle {
    /// The effects to show. Effects that a file requires (opacity, glass) are always shown.
    pub effects: Effects,
    /// Colour map of scalars: one of [`colormaps::NAMES`].
    pub colors: String,
    /// Scalars at the ends of the colour map; `None` for the range of the data.
    pub range: Option<[f32; 2]>,
    /// What fills uncovered pixels.
    pub background: Background,
    /// If true, only parts with [`PartColoring::Glass`] refract; otherwise refraction turns
    /// everything into glass.
    pub glass_parts_only: bool,
    /// Range of ambient occlusion, in radii of the subject.
    pub occlusion_radii: f64,
    /// Transfer function of a volume: scalars, and the opacity of a path of one tenth of its
    /// diagonal, linear in between. `None` for a ramp over the range of the colours.
    pub opacity: Option<Vec<[f32; 2]>>,
}

impl Default for RenderStyle {
    fn default() -> RenderStyle {
        RenderStyle {
            effects: Effects::NONE,
            colors: colormaps::NAMES[0].into(),
            range: None,
            background: BACKDROP,
            glass_parts_only: false,
            occlusion_radii: 0.3,
            opacity: None,
        }
    }
}

/// A pale gradient, darker at the bottom.
const BACKDROP: Background =
    Background::Gradient { bottom: [0.42, 0.45, 0.50], top: [0.86, 0.89, 0.93] };

/// Names of backgrounds, the default first.
pub const BACKGROUNDS: [(&str, Background); 4] = [
    ("gradient", BACKDROP),
    ("white", Background::Constant([1.0; 4])),
    ("black", Background::Constant([0.0, 0.0, 0.0, 1.0])),
    ("transparent", Background::Transparent),
];

/// Angular radius of the key light when its shadows are soft, radians.
const KEY_SIZE_RAD: f64 = 0.06;
/// Aperture of the lens as a fraction of the distance to the subject.
const APERTURE: f64 = 0.012;

/// Opacity at the upper end of a volume's default ramp, and the path length for opacities as a
/// fraction of the volume's diagonal. Smooth fields become neither faint nor opaque.
const RAMP_OPACITY: f32 = 0.5;
const OPACITY_STRETCH: f64 = 0.1;

/// Effects by their names on the command line; messages use the first name.
const NAMES: [(Effects, &[&str]); 10] = [
    (Effects::SHADOWS, &["shadows", "shadow"]),
    (Effects::SOFT_SHADOWS, &["soft-shadows"]),
    (Effects::AMBIENT_OCCLUSION, &["ao", "ambient-occlusion"]),
    (Effects::REFLECTION, &["reflections", "reflection"]),
    (Effects::GLOSSY_REFLECTION, &["glossy-reflections", "glossy-reflection", "glossy"]),
    (Effects::REFRACTION, &["refraction"]),
    (Effects::TRANSPARENCY, &["transparency"]),
    (Effects::DEPTH_OF_FIELD, &["depth-of-field", "dof"]),
    (Effects::VOLUMES, &["volumes", "volume"]),
    (Effects::PATH_TRACING, &["path-tracing"]),
];

/// Parses a list of effects, separated by commas; `none` and the empty string are the empty set.
///
/// ```
/// use bench::image::style::parse_effects;
/// use rt_core::effects::Effects;
/// assert_eq!(parse_effects("shadows, ao"), Ok(Effects::SHADOWS | Effects::AMBIENT_OCCLUSION));
/// assert!(parse_effects("shadow,caustics").unwrap_err().contains("path-tracing"));
/// ```
pub fn parse_effects(list: &str) -> Result<Effects, String> {
    let mut all = Effects::NONE;
    for name in list.split(',').map(str::trim).filter(|w| !w.is_empty() && *w != "none") {
        let simple = name.to_ascii_lowercase().replace([' ', '_'], "-");
        let found = NAMES.iter().find(|(_, names)| names.contains(&simple.as_str()));
        let Some((effect, _)) = found else {
            let known: Vec<&str> = NAMES.iter().map(|(_, n)| n[0]).collect();
            return Err(format!(
                "there is no effect `{name}`; there are: {}, none",
                known.join(", ")
            ));
        };
        all = all | *effect;
    }
    Ok(all)
}

impl RenderStyle {
    fn has(&self, effects: Effects) -> bool {
        self.effects.intersects(effects)
    }

    /// Builds the scene of the subject with lights and background.
    pub fn scene(&self, subject: Subject, build: &BuildOptions) -> anyhow::Result<Scene> {
        let mut builder = SceneBuilder::new();
        builder.build_options = *build;
        let range = self.range.or(subject.scalar_range).unwrap_or([0.0, 1.0]);
        if let Some(field) = &subject.volume {
            builder.volume(self.volume(field)?);
        }
        for part in subject.parts {
            let material = match part.coloring {
                PartColoring::Glass(c) => glass(c),
                PartColoring::Scalars => {
                    self.with_effects(plain([0.8; 3])).colored_by_scalars(self.color_map(range)?)
                }
                PartColoring::Color(c) => self.with_effects(plain(c)),
                PartColoring::FileMaterial(m) if self.has(MATERIAL_EFFECTS) => Material {
                    color_source: m.color_source.clone(),
                    ..self.with_effects(plain(m.color))
                },
                PartColoring::FileMaterial(m) => m,
            };
            let material = builder.material(material);
            let geometry = builder.geometry(part.geometry);
            let appearance = rt_core::scene::Appearance::new(material);
            builder.instance(geometry, glam::DAffine3::IDENTITY, appearance);
        }
        builder.background = self.background;
        let mirrors = Effects::REFLECTION | Effects::GLOSSY_REFLECTION | Effects::REFRACTION;
        let surrounded = self.has(mirrors | Effects::PATH_TRACING);
        for light in
            self.lights().into_iter().filter(|l| !(surrounded && l.kind == LightKind::Ambient))
        {
            builder.light(light);
        }
        if surrounded {
            // A gradient environment for mirrors to reflect; it replaces the ambient light.
            let up = subject.up.as_vec3().try_normalize().unwrap_or(Vec3::Z);
            // Surroundings seen through glass are as bright as those next to it.
            let (bottom, top) = match self.background {
                Background::Gradient { bottom, top } if self.has(Effects::REFRACTION) => {
                    (bottom, top)
                }
                _ => ([0.10, 0.10, 0.11], [0.42, 0.45, 0.5]),
            };
            builder.environment = Some(Environment::Gradient { bottom, top, up });
        }
        Ok(builder.build()?)
    }

    fn color_map(&self, range: [f32; 2]) -> anyhow::Result<ColorMap> {
        colormaps::by_name(&self.colors, range).with_context(|| {
            format!("no colour map `{}`; there are: {}", self.colors, colormaps::NAMES.join(", "))
        })
    }

    fn volume(&self, field: &VolumeField) -> anyhow::Result<Volume> {
        let [lo, hi] = self.range.unwrap_or(field.range);
        let ramp = vec![[lo, 0.0], [hi, RAMP_OPACITY]];
        let [low, high] = field.corners();
        let stretch = OPACITY_STRETCH * (high - low).length();
        let opacity = self.opacity.as_ref().unwrap_or(&ramp);
        let transfer =
            TransferFunction::from_opacity(self.color_map([lo, hi])?, opacity, stretch as f32)?;
        let options = VolumeOptions::default();
        Ok(match &field.values {
            FieldValues::Grid(grid) => Volume::new(grid.clone(), transfer, options)?,
            FieldValues::Stored { volume, memory } => {
                Volume::stored(volume.clone(), *memory, transfer, options)?
            }
        })
    }

    fn lights(&self) -> Vec<Light> {
        let shadows = self.has(Effects::SHADOWS | Effects::SOFT_SHADOWS | Effects::PATH_TRACING);
        let mut key =
            Light::directional(DVec3::new(0.5, 0.75, 0.6)).with_color([0.72; 3]).in_camera_frame();
        if self.has(Effects::SOFT_SHADOWS | Effects::PATH_TRACING) {
            key = key.with_size(KEY_SIZE_RAD).expect("a light with a size");
        }
        let key = if shadows { key } else { key.without_shadows() };
        vec![key, Light::headlight().with_color([0.16; 3]), Light::ambient([0.27; 3])]
    }

    /// A material with the requested effects.
    fn with_effects(&self, mut m: Material) -> Material {
        if self.has(Effects::REFRACTION) && !self.glass_parts_only {
            m = glass(m.color);
        } else if self.has(Effects::GLOSSY_REFLECTION) {
            m.model = SurfaceModel::Pbr {
                metallic: 0.0,
                roughness: 0.3,
                specular: 0.3,
                form: Default::default(),
            };
        } else if self.has(Effects::REFLECTION)
            && let SurfaceModel::Phong { mirror, .. } = &mut m.model
        {
            *mirror = 0.25;
        }
        if self.has(Effects::TRANSPARENCY) {
            m.opacity = 0.45;
        }
        m
    }

    /// Sets the lengths that depend on the subject's radius (half the diagonal of its bounds, world
    /// units).
    pub(super) fn scale_to_subject(&self, scene: &mut Scene, radius: f64) {
        if self.has(Effects::AMBIENT_OCCLUSION) {
            let distance = (self.occlusion_radii * radius).max(f64::MIN_POSITIVE);
            scene.ambient_occlusion = Some(AmbientOcclusion { distance, rays: 4 });
        }
        for m in &mut scene.materials {
            if let SurfaceModel::Dielectric { absorption, .. } = &mut m.model
                && self.has(Effects::REFRACTION)
            {
                *absorption = absorption.map(|a| a * (1.0 / radius) as f32);
            }
        }
    }

    /// The camera, with a lens when depth of field is requested.
    pub(super) fn lens(&self, camera: Camera, focus_distance: f64) -> anyhow::Result<Camera> {
        if !self.has(Effects::DEPTH_OF_FIELD) {
            return Ok(camera);
        }
        Ok(camera
            .with_lens(ThinLens { aperture_radius: APERTURE * focus_distance, focus_distance })?)
    }
}

/// Effects that override a file's materials.
const MATERIAL_EFFECTS: Effects = Effects::REFLECTION
    .union(Effects::GLOSSY_REFLECTION)
    .union(Effects::REFRACTION)
    .union(Effects::TRANSPARENCY);

/// Glass with absorption over a length of 1.
fn glass(color: [f32; 3]) -> Material {
    let absorption = color.map(|c| -c.clamp(0.02, 0.999).ln());
    Material { model: SurfaceModel::Dielectric { ior: 1.5, absorption }, ..Material::matte(color) }
}

/// A plain material with a weak gloss that shows the shape.
fn plain(color: [f32; 3]) -> Material {
    Material::phong(color, 0.12, 40.0)
}
