//! The options of the bridge. They come from environment variables `RTV_*` or from a program
//! (ParaView's panel).
//!
//! An invalid option is never dropped silently: [`Options::parse`] names the variable, the value
//! and the rule.

use rt_core::bvh::{BuildQuality, Robustness};
use std::ffi::OsString;

/// The material of all surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MaterialChoice {
    /// The materials that the program's own properties give.
    #[default]
    Scene,
    /// Ideal diffuse, with the surfaces' colours.
    Matte,
    /// Metal, with the surfaces' colours as reflectance.
    Metal,
    /// Glass, tinted with the surfaces' colours.
    Glass,
    /// The scene's materials, half transparent.
    Transparent,
}

/// All options. The default looks like OpenGL: all effects are off.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Leaves all drawing to OpenGL.
    pub off: bool,
    /// Rays draw whatever they can, also where OpenGL is cheaper and gives the same picture.
    pub always_trace: bool,
    /// Threads; `None` for all.
    pub threads: Option<usize>,
    /// Samples per pixel.
    pub samples: u32,
    /// Number of frames that are averaged while nothing changes.
    pub progressive: u32,
    /// Shadows of all lights except headlights.
    pub shadows: bool,
    /// Angular radius of the lights, radians; 0 for sharp shadows.
    pub light_size_rad: f64,
    /// Ambient occlusion rays per point and sample; 0 for none.
    pub ao: u32,
    /// Maximum distance of ambient occlusion, world units; `None` for a fifth of the scene's
    /// diagonal.
    pub ao_radius: Option<f64>,
    /// Fraction of light that is ambient while ambient occlusion is on.
    pub ao_strength: f32,
    /// Physically based and metallic surfaces reflect their environment.
    pub reflections: bool,
    /// Fraction of mirror reflection added to every surface.
    pub mirror: f32,
    /// The material of all surfaces.
    pub material: MaterialChoice,
    /// Roughness of the material `metal`.
    pub roughness: f32,
    /// Refractive index of the material `glass`.
    pub ior: f32,
    /// Global illumination: light over many bounces.
    pub path_tracing: bool,
    /// Maximum number of bounces; `None` for 8 at mirrors and glass, and Russian roulette for
    /// paths.
    pub max_bounces: Option<u32>,
    /// Radius of the lens, world units; 0 for a pinhole.
    pub aperture: f64,
    /// Distance in focus, world units; `None` for the camera's focal point.
    pub focus: Option<f64>,
    /// Robustness of intersection tests at edges and vertices.
    pub robustness: Robustness,
    /// Build effort of the acceleration structure.
    pub build: BuildQuality,
    /// Radius of the spheres that replace vertices, data units; 0: they stay OpenGL's points.
    pub point_radius: f64,
    /// Radius of the tubes that replace lines and edges, data units; 0: they stay OpenGL's lines.
    pub line_radius: f64,
    /// How far corners of triangles with edges move outwards, line widths: the geometry shader of
    /// VTK 9.0 to 9.3.1 moves them by a quarter. 0: edges end at the outline.
    pub edge_reach: f64,
    /// Version of VTK, major and minor, whose shaders the image follows.
    pub vtk: (u32, u32),
    /// Seed of the random numbers.
    pub seed: u64,
    /// File to which the report is written after each frame.
    pub report: Option<String>,
    /// Suppresses warnings on stderr.
    pub quiet: bool,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            off: false,
            always_trace: false,
            threads: None,
            samples: 1,
            progressive: 1,
            shadows: false,
            light_size_rad: 0.0,
            ao: 0,
            ao_radius: None,
            ao_strength: 0.5,
            reflections: false,
            mirror: 0.0,
            material: MaterialChoice::Scene,
            roughness: 0.2,
            ior: 1.5,
            path_tracing: false,
            max_bounces: None,
            aperture: 0.0,
            focus: None,
            robustness: Robustness::Watertight,
            build: BuildQuality::Balanced,
            point_radius: 0.0,
            line_radius: 0.0,
            edge_reach: 0.25,
            vtk: (9, 1),
            seed: 0,
            report: None,
            quiet: false,
        }
    }
}

/// Name, effect and allowed values of each option: for `vtk-bridge --help`, the book, and the check
/// for misspelt names.
pub const NAMES: &[(&str, &str, &str)] = &[
    ("RTV_OFF", "leave everything to OpenGL", "0 or 1"),
    ("RTV_ALWAYS_TRACE", "trace also where OpenGL is cheaper and the picture the same", "0 or 1"),
    ("RTV_THREADS", "threads that trace", "1 to 1024; all by default"),
    ("RTV_SAMPLES", "samples per pixel", "1 to 65536"),
    ("RTV_PROGRESSIVE", "pictures averaged while nothing changes", "1 to 65536"),
    ("RTV_SHADOWS", "shadows of all lights but headlights", "0 or 1"),
    ("RTV_LIGHT_SIZE", "half angle under which lights are seen, degrees (soft shadows)", "0 to 45"),
    ("RTV_AO", "rays of ambient occlusion per point and sample", "0 to 4096"),
    ("RTV_AO_RADIUS", "how far ambient occlusion looks, world units", "positive, or auto"),
    (
        "RTV_AO_STRENGTH",
        "share of the light that is ambient while ambient occlusion is on",
        "0 to 1",
    ),
    (
        "RTV_REFLECTIONS",
        "physically based and metallic surfaces mirror their surroundings",
        "0 or 1",
    ),
    ("RTV_MIRROR", "share of mirror reflection added to every surface", "0 to 1"),
    ("RTV_MATERIAL", "what all surfaces are made of", "scene, matte, metal, glass or transparent"),
    ("RTV_ROUGHNESS", "roughness of the material metal", "0 to 1"),
    ("RTV_IOR", "refractive index of the material glass", "1 to 4"),
    ("RTV_MODE", "scivis: effects one by one; path: light over many bounces", "scivis or path"),
    ("RTV_MAX_BOUNCES", "most reflections and refractions in a row", "0 to 1000"),
    ("RTV_APERTURE", "radius of the lens, world units (depth of field)", "0 or positive"),
    (
        "RTV_FOCUS",
        "distance in focus, world units",
        "positive, or auto for the camera's focal point",
    ),
    ("RTV_ROBUSTNESS", "watertight: no ray between neighbours; fast", "watertight or fast"),
    ("RTV_BUILD", "effort of building acceleration structures", "fast, balanced or best"),
    ("RTV_POINT_RADIUS", "vertices become spheres of this radius, data units", "0 or positive"),
    ("RTV_LINE_RADIUS", "lines and edges become tubes of this radius, data units", "0 or positive"),
    (
        "RTV_EDGES",
        "how far edges of surfaces reach beyond the outline, line widths (VTK up to 9.3.1: 0.25)",
        "0 to 4",
    ),
    (
        "RTV_VTK",
        "version of VTK whose shaders the image follows",
        "as in 9.1; the host's by default",
    ),
    ("RTV_SEED", "seed of the noise", "a whole number"),
    (
        "RTV_REPORT",
        "file that tells after each frame what was traced, passed on, and what it cost",
        "a path",
    ),
    ("RTV_QUIET", "no warnings on stderr", "0 or 1"),
    ("RTV_HOME", "where `vtk-bridge install` has put things (set by `vtk-bridge env`)", "a folder"),
    (
        "RTV_VTK_INCLUDE",
        "folders with VTK's headers, for `vtk-bridge install`",
        "folders, separated by colons",
    ),
    ("RTV_LIBRARY", "the library that `vtk-bridge install` copies", "a file"),
];

/// Variables that the library does not read, or reads as arbitrary paths.
const PATHS: &[&str] = &["RTV_HOME", "RTV_VTK_INCLUDE", "RTV_LIBRARY"];

/// Variables as strings. The second value names those that are not UTF-8.
pub fn readable(variables: &[(OsString, OsString)]) -> (Vec<(String, String)>, Vec<String>) {
    let (mut texts, mut faults) = (Vec::new(), Vec::new());
    for (name, value) in variables {
        match (name.to_str(), value.to_str()) {
            (Some(name), Some(value)) => texts.push((name.to_owned(), value.to_owned())),
            (Some(name), None) if PATHS.contains(&name) => {}
            _ => {
                // In `Debug` format, which shows the invalid bytes.
                let [name, value] =
                    [name, value].map(|t| format!("{t:?}").trim_matches('"').to_owned());
                faults.push(format!(
                    "{name}={value} is not UTF-8 text: it is left out; set it anew, or unset it"
                ));
            }
        }
    }
    (texts, faults)
}

impl Options {
    /// Options from pairs of name and value. The second value lists what is invalid.
    pub fn parse(pairs: impl IntoIterator<Item = (String, String)>) -> (Options, Vec<String>) {
        let (mut options, mut faults) = (Options::default(), Vec::new());
        for (name, value) in pairs {
            if let Err(fault) = options.set(&name, &value) {
                faults.push(fault);
            }
        }
        (options, faults)
    }

    /// Sets one option by the name of its variable.
    pub fn set(&mut self, name: &str, value: &str) -> Result<(), String> {
        let Some((_, _, rule)) = NAMES.iter().find(|(n, ..)| *n == name) else {
            let near = NAMES
                .iter()
                .map(|(n, ..)| *n)
                .min_by_key(|n| distance(n, name))
                .unwrap_or("RTV_AO");
            return Err(format!("{name} is no option of vtk-bridge; did you mean {near}?"));
        };
        let value = value.trim();
        self.apply(name, value).ok_or_else(|| {
            format!("{name}={value} is not understood: it must be {rule}; it is left out")
        })
    }

    /// Whether the picture cannot be OpenGL's: an effect, or shapes that OpenGL would draw
    /// otherwise, or [`Options::always_trace`].
    pub fn need_rays(&self) -> bool {
        let effects = self.shadows
            || self.ao > 0
            || self.reflections
            || self.mirror > 0.0
            || self.path_tracing
            || self.aperture > 0.0
            || self.samples > 1
            || self.progressive > 1
            || self.material != MaterialChoice::Scene;
        self.always_trace || effects || self.point_radius > 0.0 || self.line_radius > 0.0
    }

    fn apply(&mut self, name: &str, value: &str) -> Option<()> {
        match name {
            "RTV_OFF" => self.off = switch(value)?,
            "RTV_ALWAYS_TRACE" => self.always_trace = switch(value)?,
            "RTV_THREADS" => self.threads = Some(within(value, 1, 1024)?),
            "RTV_SAMPLES" => self.samples = within(value, 1, 65536)?,
            "RTV_PROGRESSIVE" => self.progressive = within(value, 1, 65536)?,
            "RTV_SHADOWS" => self.shadows = switch(value)?,
            "RTV_LIGHT_SIZE" => self.light_size_rad = within::<f64>(value, 0.0, 45.0)?.to_radians(),
            "RTV_AO" => self.ao = within(value, 0, 4096)?,
            "RTV_AO_RADIUS" => self.ao_radius = automatic(value)?,
            "RTV_AO_STRENGTH" => self.ao_strength = within(value, 0.0, 1.0)?,
            "RTV_REFLECTIONS" => self.reflections = switch(value)?,
            "RTV_MIRROR" => self.mirror = within(value, 0.0, 1.0)?,
            "RTV_MATERIAL" => {
                self.material = match value {
                    "scene" | "default" | "none" => MaterialChoice::Scene,
                    "matte" => MaterialChoice::Matte,
                    "metal" => MaterialChoice::Metal,
                    "glass" => MaterialChoice::Glass,
                    "transparent" => MaterialChoice::Transparent,
                    _ => return None,
                }
            }
            "RTV_ROUGHNESS" => self.roughness = within(value, 0.0, 1.0)?,
            "RTV_IOR" => self.ior = within(value, 1.0, 4.0)?,
            "RTV_MODE" => {
                self.path_tracing = match value {
                    "scivis" => false,
                    "path" | "pathtracer" => true,
                    _ => return None,
                }
            }
            "RTV_MAX_BOUNCES" => self.max_bounces = Some(within(value, 0, 1000)?),
            "RTV_APERTURE" => self.aperture = within(value, 0.0, f64::MAX)?,
            "RTV_FOCUS" => self.focus = automatic(value)?,
            "RTV_ROBUSTNESS" => {
                self.robustness = *Robustness::ALL.iter().find(|r| r.name() == value)?;
            }
            "RTV_BUILD" => self.build = *BuildQuality::ALL.iter().find(|q| q.name() == value)?,
            "RTV_POINT_RADIUS" => self.point_radius = within(value, 0.0, f64::MAX)?,
            "RTV_LINE_RADIUS" => self.line_radius = within(value, 0.0, f64::MAX)?,
            "RTV_EDGES" => self.edge_reach = within(value, 0.0, 4.0)?,
            "RTV_VTK" => {
                let (major, minor) = value.split_once('.')?;
                self.vtk = (major.parse().ok()?, minor.parse().ok()?);
            }
            "RTV_SEED" => self.seed = value.parse().ok()?,
            "RTV_REPORT" => self.report = (!value.is_empty()).then(|| value.to_owned()),
            "RTV_QUIET" => self.quiet = switch(value)?,
            _ => {}
        }
        Some(())
    }
}

fn switch(value: &str) -> Option<bool> {
    match value {
        "1" | "on" | "true" | "yes" => Some(true),
        "0" | "off" | "false" | "no" | "" => Some(false),
        _ => None,
    }
}

fn within<T: std::str::FromStr + PartialOrd>(value: &str, low: T, high: T) -> Option<T> {
    value.parse().ok().filter(|v| *v >= low && *v <= high)
}

fn automatic(value: &str) -> Option<Option<f64>> {
    if value == "auto" {
        Some(None)
    } else {
        within(value, f64::MIN_POSITIVE, f64::INFINITY).map(Some)
    }
}

/// Edit distance (Levenshtein 1966), to suggest the name that a misspelt one means.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<u8> = b.bytes().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.bytes().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for j in 0..b.len() {
            let cost = diagonal + usize::from(x != b[j]);
            diagonal = row[j + 1];
            row[j + 1] = cost.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(pairs: &[(&str, &str)]) -> (Options, Vec<String>) {
        Options::parse(pairs.iter().map(|(n, v)| ((*n).to_owned(), (*v).to_owned())))
    }

    #[test]
    fn values_out_of_range_are_named_with_their_rule_and_left_out() {
        let (options, faults) =
            parse(&[("RTV_AO", "-3"), ("RTV_SAMPLES", "16"), ("RTV_IOR", "NaN")]);
        assert_eq!((options.ao, options.samples, options.ior), (0, 16, 1.5));
        assert_eq!(faults.len(), 2);
        assert!(
            faults[0].contains("RTV_AO=-3") && faults[0].contains("0 to 4096"),
            "{}",
            faults[0]
        );
    }

    #[test]
    fn a_preset_that_is_gone_is_refused_with_those_there_are() {
        let (options, faults) = parse(&[("RTV_BUILD", "fastest")]);
        assert_eq!(options.build, BuildQuality::Balanced);
        assert!(faults[0].contains("RTV_BUILD=fastest"), "{}", faults[0]);
        assert!(faults[0].contains("must be fast, balanced or best"), "{}", faults[0]);
    }

    #[test]
    fn misspelt_names_get_a_suggestion() {
        let (_, faults) = parse(&[("RTV_SHADOW", "1")]);
        assert!(faults[0].contains("did you mean RTV_SHADOWS"), "{}", faults[0]);
    }

    #[test]
    fn every_name_has_a_rule_that_some_value_obeys() {
        for (name, what, rule) in NAMES {
            assert!(!what.is_empty() && !rule.is_empty(), "{name}");
            let examples = ["1", "matte", "path", "fast", "9.4"];
            assert!(examples.iter().any(|v| Options::default().set(name, v).is_ok()), "{name}");
        }
    }

    #[test]
    fn automatic_values_can_be_written() {
        let (options, faults) = parse(&[("RTV_AO_RADIUS", "2.5"), ("RTV_FOCUS", "auto")]);
        assert_eq!((options.ao_radius, options.focus, faults.len()), (Some(2.5), None, 0));
    }
}
