//! The settings in the form that the library uses.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How pictures are made.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// OpenGL's own lighting, per vertex, through pixel centres: the driver's picture.
    #[default]
    Match,
    /// OpenGL's lighting at every pixel.
    Phong,
    /// Lighting at every pixel with the effects that are set.
    Rich,
    /// The driver's colours times traced occlusion and shadow: for any shader.
    Enhance,
    /// Path tracing, for publication.
    Path,
}

impl Mode {
    /// All of them.
    pub const ALL: [Mode; 5] = [Mode::Match, Mode::Phong, Mode::Rich, Mode::Enhance, Mode::Path];

    /// The name in files, on command lines and in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Mode::Match => "match",
            Mode::Phong => "phong",
            Mode::Rich => "rich",
            Mode::Enhance => "enhance",
            Mode::Path => "path",
        }
    }
}

/// Which draws are traced.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Trace {
    /// What the rules take for the scene: filled, depth-tested surfaces.
    #[default]
    Scene,
    /// Every filled primitive, in painter's order where there is no depth test.
    All,
}

/// How carefully acceleration structures are built.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Quality {
    /// Fast at first, best in the background once geometry rests.
    #[default]
    Auto,
    /// Always the fast build: for geometry that changes in every frame.
    Fast,
    /// Always the best build: for still pictures with many rays.
    Best,
}

/// What rays are spent on in the modes `rich`, `enhance` and `path`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Effects {
    /// Rays to the lights.
    pub shadows: bool,
    /// Half the angle under which lights are seen, degrees; 0 for sharp shadows.
    pub light_radius_deg: f64,
    /// Rays of ambient occlusion at each point; 0 for none.
    pub ambient_occlusion_samples: u32,
    /// Their length, as part of the scene's diagonal.
    pub ambient_occlusion_radius: f64,
    /// Mirror reflection where materials ask for it.
    pub reflections: bool,
    /// Rays through glass.
    pub refraction: bool,
    /// Surfaces with opacity below 1 let light through, in the right order.
    pub transparency: bool,
    /// Longest chain of reflections and refractions, or of the path tracer's bounces.
    pub max_bounces: u32,
    /// Radius of the lens as part of the scene's diagonal; 0 for a pinhole.
    pub aperture_radius: f64,
    /// Distance of sharp focus: 0 for the nearest point of the scene to 1 for the farthest.
    pub focus: f64,
}

impl Default for Effects {
    fn default() -> Self {
        Effects {
            shadows: true,
            light_radius_deg: 0.0,
            ambient_occlusion_samples: 8,
            ambient_occlusion_radius: 0.1,
            reflections: true,
            refraction: true,
            transparency: true,
            max_bounces: 4,
            aperture_radius: 0.0,
            focus: 0.5,
        }
    }
}

/// Changes to the program's lights.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Lights {
    /// Times the program's own lights; 0 leaves them out.
    pub program: f64,
    /// Times the program's ambient light.
    pub ambient: f64,
    /// Even light from all around.
    pub sky: f64,
    /// Strength of a light of our own; 0 for none.
    pub added: f64,
    /// Where it comes from, in the viewer's axes: x right, y up, z towards the viewer.
    pub added_direction: [f64; 3],
    /// Its colour.
    pub added_color: [f64; 3],
}

impl Default for Lights {
    fn default() -> Self {
        Lights {
            program: 1.0,
            ambient: 1.0,
            sky: 0.0,
            added: 0.0,
            added_direction: [0.4, 0.8, 0.6],
            added_color: [1.0; 3],
        }
    }
}

/// What a surface is made of.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Surface {
    /// As the program says.
    #[default]
    Program,
    /// Without highlight or mirror.
    Matte,
    /// A metal of its colour.
    Metal,
    /// Glass.
    Glass,
}

/// Changes to materials; what is `None` stays as the program has it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Material {
    /// What it is made of.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surface: Option<Surface>,
    /// Colour, as `glColor` takes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub color: Option<[f64; 3]>,
    /// 0 invisible to 1 opaque.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub opacity: Option<f64>,
    /// Strength of the highlight.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub specular: Option<f64>,
    /// Exponent of the highlight.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shininess: Option<f64>,
    /// Share of mirror reflection.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mirror: Option<f64>,
    /// Roughness of a metal, 0 polished to 1 dull.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roughness: Option<f64>,
    /// Refractive index of glass.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ior: Option<f64>,
    /// Light given off, times the colour.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub emission: Option<f64>,
}

impl Material {
    /// True when it changes nothing.
    pub fn is_empty(&self) -> bool {
        *self == Material::default()
    }

    /// This, with `other` over it.
    pub fn over(&self, other: &Material) -> Material {
        Material {
            surface: other.surface.or(self.surface),
            color: other.color.or(self.color),
            opacity: other.opacity.or(self.opacity),
            specular: other.specular.or(self.specular),
            shininess: other.shininess.or(self.shininess),
            mirror: other.mirror.or(self.mirror),
            roughness: other.roughness.or(self.roughness),
            ior: other.ior.or(self.ior),
            emission: other.emission.or(self.emission),
        }
    }
}

/// Everything the library can be told, also while the program runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// False: the driver draws everything.
    pub enabled: bool,
    /// How pictures are made.
    pub mode: Mode,
    /// Which draws are traced.
    pub trace: Trace,
    /// In mode `match`: rays also where the driver draws the same picture for less.
    pub always_trace: bool,
    /// Rays through each pixel.
    pub samples: u32,
    /// How acceleration structures are built.
    pub quality: Quality,
    /// Threads that render; 0 for all cores.
    pub threads: u32,
    /// Show each frame one frame late, and trace it while the program makes the next (section
    /// 4.1.2).
    pub asynchronous: bool,
    /// What rays are spent on.
    pub effects: Effects,
    /// Changes to lights.
    pub lights: Lights,
    /// Changes to all materials.
    pub material: Material,
    /// Changes to the materials of single objects, by the key that reports and the panel show.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub objects: BTreeMap<String, Material>,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            enabled: true,
            mode: Mode::default(),
            trace: Trace::default(),
            always_trace: false,
            samples: 1,
            quality: Quality::default(),
            threads: 0,
            asynchronous: false,
            effects: Effects::default(),
            lights: Lights::default(),
            material: Material::default(),
            objects: BTreeMap::new(),
        }
    }
}

impl Settings {
    /// True when translucent surfaces are sorted by rays.
    pub fn sees_through(&self) -> bool {
        matches!(self.mode, Mode::Rich | Mode::Path) && self.effects.transparency
    }

    /// The changes to an object's material: those for all, with its own over them.
    pub fn material_of(&self, object: &str) -> Material {
        match self.objects.get(object) {
            Some(own) => self.material.over(own),
            None => self.material.clone(),
        }
    }
}
