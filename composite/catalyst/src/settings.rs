//! What to make of each time step: a file in TOML, which the user writes.

use rt_core::glam::DVec3;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Most pixels along a side.
const LARGEST_SIDE: u32 = 1 << 14;
/// Most samples of a pixel.
const MOST_SAMPLES: u32 = 1 << 10;

/// The whole file.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Nothing is said on the standard error but errors.
    pub quiet: bool,
    /// Longest wait for another rank that gives no sign of life, seconds.
    pub timeout_secs: Option<f64>,
    /// Whether a rank uses all processors that it may; without it, one of many ranks uses one, and
    /// a rank alone all.
    pub threads: Option<bool>,
    /// Ray traced pictures.
    pub picture: Vec<Picture>,
    /// Photographs of light that the density of a gas bends.
    pub photograph: Vec<Photograph>,
}

/// Which files a picture becomes, of what, and when.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Picture {
    /// The file: `.png`, or `.exr` with depths; `{step}` and `{time}` are replaced.
    pub file: String,
    /// Calls from one picture to the next, which is made at the first: 1 for all.
    pub every: u64,
    /// The channel; without it, the first.
    pub channel: Option<String>,
    /// The topology; without it, the first of each domain.
    pub topology: Option<String>,
    /// What is drawn.
    pub show: Show,
    /// The array that gives the colours, as `pressure`, `velocity` (its length) or `velocity:x`.
    pub array: Option<String>,
    /// The values of the first and the last colour; without them, those of each step.
    pub range: Option<[f32; 2]>,
    /// `viridis`, `cool-warm` or `grey`.
    pub colors: String,
    /// The values of isosurfaces.
    pub isovalues: Vec<f64>,
    /// The array that colours isosurfaces; without it, their values do.
    pub color_array: Option<String>,
    /// A point of a slice; without it, the middle of everything.
    pub slice_point: Option<[f64; 3]>,
    /// The normal of a slice; without it, y.
    pub slice_normal: Option<[f64; 3]>,
    /// Opacity of surfaces; of volumes, at the largest value, over a sixteenth of their radius.
    pub opacity: f32,
    /// Pixels per row, and rows.
    pub size: [u32; 2],
    /// Samples of a pixel.
    pub samples: u32,
    /// Direction from the middle of everything to the eye.
    pub from: [f64; 3],
    /// What is up.
    pub up: [f64; 3],
    /// 1 shows everything; 2 half of it.
    pub zoom: f64,
    /// The middle of the picture; without it, that of everything at each step.
    pub middle: Option<[f64; 3]>,
    /// Radius of a ball around it that fits the picture; without it, that of everything.
    pub radius: Option<f64>,
    /// Shadows of a lamp and ambient occlusion; else a headlight.
    pub shadows: bool,
    /// Linear RGB.
    pub background: [f32; 3],
}

/// What a picture shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Show {
    /// The outer surface of the cells.
    Surface,
    /// Where the array has the isovalues.
    Isosurface,
    /// A plane through the cells.
    Slice,
    /// The array as a medium, clear at its lowest value.
    Volume,
}

/// A photograph of a gas.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Photograph {
    /// The file: `.png` or `.exr`; `{step}` and `{time}` are replaced.
    pub file: String,
    /// Calls from one photograph to the next, which is made at the first: 1 for all.
    pub every: u64,
    /// The channel; without it, the first.
    pub channel: Option<String>,
    /// The topology; without it, the first of each domain.
    pub topology: Option<String>,
    /// The array of densities.
    pub array: String,
    /// kg/m³ of one unit of that array.
    pub density_unit: f64,
    /// Metres of one unit of coordinates.
    pub length_unit: f64,
    /// K of the law of Gladstone and Dale, n = 1 + K rho, m³/kg.
    pub gladstone_dale: f64,
    /// Density of the gas outside, kg/m³.
    pub reference_density: f64,
    /// The bench.
    pub technique: Technique,
    /// How densities between points are found.
    pub interpolant: Between,
    /// Longest step of a ray, in distances of points.
    pub step_voxels: f64,
    /// Pixels per row, and rows.
    pub size: [u32; 2],
    /// Direction of the light, towards the film.
    pub direction: [f64; 3],
    /// What is up in the picture.
    pub up: [f64; 3],
    /// Schlieren: deflections in this direction brighten the picture, degrees counter-clockwise
    /// from its right.
    pub knife_deg: f64,
    /// Schlieren: width of the slit, metres.
    pub slit_width: f64,
    /// Schlieren: focal length of both lenses, metres.
    pub focal_length: f64,
    /// Schlieren: fraction of the slit's image that is left open.
    pub open_fraction: f64,
    /// Shadowgraph: distance of the plane in focus from the centre of the gas, metres.
    pub focus: f64,
}

/// How light becomes a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Technique {
    /// A slit, and a knife's edge in the cut-off plane.
    Schlieren,
    /// No cut-off.
    Shadowgraph,
}

/// Densities between points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Between {
    /// Gradients by central differences; ranks need a layer of their neighbours' points.
    TrilinearGradient,
    /// The gradient of linear interpolation.
    Trilinear,
}

impl Default for Picture {
    /// What is made without a file of settings: the outer surface, from a little above.
    fn default() -> Self {
        Picture {
            file: "rtsv-{step}.png".into(),
            every: 1,
            channel: None,
            topology: None,
            show: Show::Surface,
            array: None,
            range: None,
            colors: "cool-warm".into(),
            isovalues: Vec::new(),
            color_array: None,
            slice_point: None,
            slice_normal: None,
            opacity: 1.0,
            size: [1024, 768],
            samples: 4,
            from: [0.5, -1.0, 0.5],
            up: [0.0, 0.0, 1.0],
            zoom: 1.0,
            middle: None,
            radius: None,
            shadows: true,
            background: [1.0; 3],
        }
    }
}

impl Default for Photograph {
    /// Air, seen along z through a bench with a vertical knife's edge.
    fn default() -> Self {
        Photograph {
            file: "rtsv-schlieren-{step}.png".into(),
            every: 1,
            channel: None,
            topology: None,
            array: "density".into(),
            density_unit: 1.0,
            length_unit: 1.0,
            gladstone_dale: 2.26e-4,
            reference_density: 1.2,
            technique: Technique::Schlieren,
            interpolant: Between::TrilinearGradient,
            step_voxels: 1.0,
            size: [512, 512],
            direction: [0.0, 0.0, 1.0],
            up: [0.0, 1.0, 0.0],
            knife_deg: 0.0,
            slit_width: 1e-3,
            focal_length: 1.5,
            open_fraction: 0.5,
            focus: 0.0,
        }
    }
}

/// Why the settings cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SettingsError {
    /// The file cannot be read.
    #[error("{}: {source}", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// It is no TOML, or has keys or values that do not exist.
    #[error("{}: {reason}", file.display())]
    Syntax {
        /// The file.
        file: PathBuf,
        /// Place and cause.
        reason: String,
    },
    /// A value that cannot be.
    #[error("{}: {place}{key} is {value}; {rule}", file.display())]
    Value {
        /// The file.
        file: PathBuf,
        /// Which picture or photograph, counted from 1; empty for a key of the whole.
        place: String,
        /// The key.
        key: &'static str,
        /// Its value.
        value: String,
        /// What it should be.
        rule: String,
    },
}

/// The first key with a value that cannot be, the value, and the rule.
type Fault = (&'static str, String, String);

impl Settings {
    /// Without a file: the surface of the first channel at each call.
    pub fn without_file() -> Settings {
        Settings { picture: vec![Picture::default()], ..Settings::default() }
    }

    /// Reads the file.
    ///
    /// # Errors
    /// [`SettingsError`] names the file, the key and the value.
    pub fn read(file: &Path) -> Result<Settings, SettingsError> {
        let text = std::fs::read_to_string(file)
            .map_err(|source| SettingsError::Io { file: file.into(), source })?;
        Settings::parse(&text, file)
    }

    /// Reads the text of `file`.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn parse(text: &str, file: &Path) -> Result<Settings, SettingsError> {
        let settings: Settings = toml::from_str(text).map_err(|e| SettingsError::Syntax {
            file: file.into(),
            reason: e.to_string().trim_end().replace('\n', " "),
        })?;
        let fault = |place: String, (key, value, rule): Fault| SettingsError::Value {
            file: file.into(),
            place,
            key,
            value,
            rule,
        };
        if let Some(secs) = settings.timeout_secs.filter(|s| !(*s > 0.0 && *s <= 1e6)) {
            let rule = "give seconds, more than 0".to_owned();
            return Err(fault(String::new(), ("timeout_secs", secs.to_string(), rule)));
        }
        for (number, picture) in settings.picture.iter().enumerate() {
            let place = || format!("picture number {}: ", number + 1);
            picture.check().map_err(|f| fault(place(), f))?;
        }
        for (number, photograph) in settings.photograph.iter().enumerate() {
            let place = || format!("photograph number {}: ", number + 1);
            photograph.check().map_err(|f| fault(place(), f))?;
        }
        Ok(settings)
    }
}

impl Picture {
    /// The array whose values give the colours.
    pub fn coloring_array(&self) -> Option<&str> {
        self.color_array.as_deref().or(self.array.as_deref())
    }

    /// Whether there are such values.
    pub fn is_colored(&self) -> bool {
        self.coloring_array().is_some()
    }

    fn check(&self) -> Result<(), Fault> {
        check_file(&self.file, self.every, self.size)?;
        check_axes(("from", self.from), ("up", self.up))?;
        let fault = |key, value: String, rule: &str| Err((key, value, rule.to_owned()));
        if datasets::colormaps::by_name(&self.colors, [0.0, 1.0]).is_none() {
            let rule = format!("give one of {}", datasets::colormaps::NAMES.join(", "));
            return fault("colors", self.colors.clone(), &rule);
        }
        if let Some([a, b]) = self.range.filter(|[a, b]| !(a < b && (b - a).is_finite())) {
            return fault("range", format!("[{a}, {b}]"), "the first is less than the second");
        }
        if let Some(range) = self.range.filter(|_| !self.is_colored()) {
            return fault("range", format!("{range:?}"), "it needs an array");
        }
        if !(1..=MOST_SAMPLES).contains(&self.samples) {
            return fault("samples", self.samples.to_string(), "give 1 to 1024");
        }
        if !(self.zoom > 0.0 && self.zoom.is_finite()) {
            return fault("zoom", self.zoom.to_string(), "give a positive number");
        }
        if let Some(radius) = self.radius.filter(|r| !(*r > 0.0 && r.is_finite())) {
            return fault("radius", radius.to_string(), "give a positive number");
        }
        if let Some(middle) = self.middle.filter(|m| m.iter().any(|x| !x.is_finite())) {
            return fault("middle", format!("{middle:?}"), "give three numbers");
        }
        if !(0.0..=1.0).contains(&self.opacity) {
            return fault("opacity", self.opacity.to_string(), "give 0 to 1");
        }
        if !self.background.iter().all(|c| c.is_finite() && *c >= 0.0) {
            return fault("background", format!("{:?}", self.background), "give three numbers");
        }
        let isovalues = format!("{:?}", self.isovalues);
        if self.show == Show::Isosurface {
            if self.isovalues.is_empty() || self.isovalues.iter().any(|v| !v.is_finite()) {
                return fault("isovalues", isovalues, "show = \"isosurface\" needs some");
            }
        } else if !self.isovalues.is_empty() {
            return fault("isovalues", isovalues, "they need show = \"isosurface\"");
        }
        let needs_array = matches!(self.show, Show::Volume | Show::Isosurface);
        if needs_array && self.array.is_none() {
            return fault("array", "missing".into(), "volumes and isosurfaces need one");
        }
        if let Some(name) = self.color_array.as_ref().filter(|_| self.show != Show::Isosurface) {
            return fault("color_array", name.clone(), "it needs show = \"isosurface\"");
        }
        for (key, value) in [("slice_point", self.slice_point), ("slice_normal", self.slice_normal)]
        {
            let Some(value) = value else { continue };
            if self.show != Show::Slice {
                return fault(key, format!("{value:?}"), "it needs show = \"slice\"");
            }
            let usable = match key {
                "slice_normal" => DVec3::from(value).try_normalize().is_some(),
                _ => DVec3::from(value).is_finite(),
            };
            if !usable {
                return fault(key, format!("{value:?}"), "give three numbers, not all zero");
            }
        }
        Ok(())
    }
}

impl Photograph {
    fn check(&self) -> Result<(), Fault> {
        check_file(&self.file, self.every, self.size)?;
        check_axes(("direction", self.direction), ("up", self.up))?;
        for (key, value) in [
            ("density_unit", self.density_unit),
            ("length_unit", self.length_unit),
            ("gladstone_dale", self.gladstone_dale),
            ("slit_width", self.slit_width),
            ("focal_length", self.focal_length),
            ("step_voxels", self.step_voxels),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err((key, value.to_string(), "give a positive number".into()));
            }
        }
        for (key, value) in [
            ("reference_density", self.reference_density),
            ("knife_deg", self.knife_deg),
            ("focus", self.focus),
        ] {
            if !value.is_finite() {
                return Err((key, value.to_string(), "give a number".into()));
            }
        }
        let (key, value, of) = match self.technique {
            Technique::Schlieren => ("focus", self.focus, "shadowgraph"),
            Technique::Shadowgraph => ("knife_deg", self.knife_deg, "schlieren"),
        };
        if value != 0.0 {
            let rule = format!("it needs technique = \"{of}\"");
            return Err((key, value.to_string(), rule));
        }
        if !(0.0..=1.0).contains(&self.open_fraction) {
            return Err(("open_fraction", self.open_fraction.to_string(), "give 0 to 1".into()));
        }
        Ok(())
    }
}

fn check_file(file: &str, every: u64, size: [u32; 2]) -> Result<(), Fault> {
    if !file.ends_with(".png") && !file.ends_with(".exr") {
        return Err(("file", format!("`{file}`"), "let it end with .png or .exr".into()));
    }
    if !file.contains("{step}") && !file.contains("{time}") {
        let rule = "put {step} or {time} into it, so that steps do not replace each other";
        return Err(("file", format!("`{file}`"), rule.into()));
    }
    if every == 0 {
        return Err(("every", "0".into(), "give 1 for all calls".into()));
    }
    if size.iter().any(|s| !(1..=LARGEST_SIDE).contains(s)) {
        return Err(("size", format!("{size:?}"), "give 1 to 16384 pixels a side".into()));
    }
    Ok(())
}

/// Whether two directions make a view.
fn check_axes(
    (key, along): (&'static str, [f64; 3]),
    (up_key, up): (&'static str, [f64; 3]),
) -> Result<(), Fault> {
    let [along, up] = [along, up].map(DVec3::from);
    for (key, axis) in [(key, along), (up_key, up)] {
        if axis.try_normalize().is_none() {
            return Err((key, axis.to_string(), "give a direction, not zero".into()));
        }
    }
    if along.normalize().cross(up.normalize()).length() < 1e-9 {
        return Err((up_key, up.to_string(), format!("it may not be parallel to {key}")));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        Settings::parse(text, Path::new("a.toml")).unwrap_err().to_string()
    }

    #[test]
    fn what_is_not_given_has_defaults() {
        let text = "[[picture]]\narray = \"p\"\nfile = \"{step}.exr\"\n[[photograph]]\n";
        let settings = Settings::parse(text, Path::new("a.toml")).unwrap();
        let picture =
            Picture { array: Some("p".into()), file: "{step}.exr".into(), ..Picture::default() };
        assert_eq!(settings.picture, [picture]);
        assert_eq!(settings.photograph, [Photograph::default()]);
        let of_defaults = "[[picture]]";
        let settings = Settings::parse(of_defaults, Path::new("a.toml")).unwrap();
        assert_eq!(settings, Settings::without_file());
    }

    #[test]
    fn faults_name_the_file_the_key_and_the_value() {
        let cases = [
            ("picture = 3", "a.toml: "),
            ("[[picture]]\nshadow = true", "unknown field `shadow`"),
            ("[[picture]]\nfile = \"a.png\"", "picture number 1: file is `a.png`; put {step}"),
            ("[[picture]]\nfile = \"{step}.jpg\"", ".png or .exr"),
            ("[[picture]]\n[[picture]]\nevery = 0", "picture number 2: every is 0"),
            ("[[picture]]\nsize = [0, 3]", "size is [0, 3]"),
            ("[[picture]]\nfrom = [0, 0, 2]", "up is [0, 0, 1]; it may not be parallel to from"),
            ("[[picture]]\ncolors = \"jet\"", "colors is jet; give one of viridis"),
            ("[[picture]]\nrange = [1, 1]", "range is [1, 1]"),
            ("[[picture]]\nrange = [0, 1]", "range is [0.0, 1.0]; it needs an array"),
            ("[[photograph]]\nfocus = 0.1", "focus is 0.1; it needs technique"),
            ("[[picture]]\nzoom = nan", "zoom is NaN"),
            ("[[picture]]\nradius = -1", "radius is -1"),
            ("[[picture]]\nmiddle = [0, inf, 0]", "middle is [0.0, inf, 0.0]"),
            ("[[picture]]\nshow = \"volume\"", "array is missing"),
            ("[[picture]]\nshow = \"isosurface\"\narray = \"p\"", "isovalues is []"),
            ("[[picture]]\nisovalues = [1]", "they need show = \"isosurface\""),
            ("[[picture]]\ncolor_array = \"p\"", "color_array is p; it needs show"),
            ("[[picture]]\nslice_normal = [0, 0, 1]", "it needs show = \"slice\""),
            ("[[picture]]\nshow = \"slice\"\nslice_normal = [0, 0, 0]", "not all zero"),
            ("[[picture]]\nshow = \"points\"", "unknown variant `points`"),
            ("[[photograph]]\nlength_unit = 0", "length_unit is 0"),
            ("[[photograph]]\nopen_fraction = 2", "open_fraction is 2"),
            ("timeout_secs = 0", "timeout_secs is 0"),
        ];
        for (text, part) in cases {
            let said = error(text);
            assert!(said.contains(part) && said.starts_with("a.toml: "), "{text}: {said}");
        }
    }
}
