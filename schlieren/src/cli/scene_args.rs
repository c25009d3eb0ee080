//! Parses the options that describe the scene and applies them to the scene of a file. An option
//! without effect is an error that names the option.

use super::flow_args::FlowArgs;
use super::march_args::{FrameArgs, MarchArgs, ViewArgs};
use super::media_args::MediaArgs;
use super::units;
use crate::scene::{
    BeamsSpec, CutoffSpec, FilterSpec, Jitter, SamplingSpec, Scene, SourceSpec, TechniqueSpec,
};
use clap::Args;
use datasets::cli::UsageError;
use std::path::PathBuf;

/// The scene's options, shared by `render`, `sweep` and `probe`.
#[derive(Debug, Clone, Args)]
pub(super) struct SceneArgs {
    /// A scene as TOML; options change it
    #[arg(long, value_name = "TOML")]
    pub(super) scene: Option<PathBuf>,
    #[command(flatten)]
    flow: FlowArgs,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    optics: OpticsArgs,
    #[command(flatten)]
    media: MediaArgs,
    #[command(flatten)]
    frame: FrameArgs,
    #[command(flatten)]
    film: FilmArgs,
    #[command(flatten)]
    march: MarchArgs,
}

#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Light and optics (lengths in m, or with mm, um, nm)")]
struct OpticsArgs {
    /// shadowgraph, schlieren, interferogram or bos; for comparison: volume or slice
    #[arg(long, value_name = "NAME", value_parser = technique)]
    technique: Option<TechniqueSpec>,
    /// point, slit:WIDTH,LENGTH or circle:DIAMETER
    #[arg(long, value_name = "SHAPE", value_parser = units::source)]
    source: Option<SourceSpec>,
    /// Focal length of the schlieren lens (f2)
    #[arg(long, value_name = "LENGTH", value_parser = units::length)]
    focal_length: Option<f64>,
    /// Focal length of the collimator (f1)
    #[arg(long, value_name = "LENGTH", value_parser = units::length)]
    collimator: Option<f64>,
    /// schlieren: knife, circle, complemented-circle, color, or an image (PNG)
    #[arg(long, value_name = "KIND|PNG")]
    cutoff: Option<String>,
    /// knife: direction that brightens; color: direction of red; in degrees from the image's right
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true)]
    cutoff_angle: Option<f64>,
    /// knife: open fraction of the source image, 0 to 1
    #[arg(long, value_name = "PART")]
    cutoff_open: Option<f64>,
    /// knife: open height of the source image in the cut-off plane
    #[arg(long, value_name = "LENGTH", value_parser = units::length, conflicts_with = "cutoff_open")]
    cutoff_height: Option<f64>,
    /// circle, complemented-circle, color: radius in the cut-off plane; image: half its width
    #[arg(long, value_name = "LENGTH", value_parser = units::length)]
    cutoff_radius: Option<f64>,
    /// Distance from the centre of the field; shadowgraph: of the film; bos: of the background;
    /// else: of the plane in focus
    #[arg(long, value_name = "LENGTH", value_parser = units::length, allow_hyphen_values = true)]
    film_distance: Option<f64>,
    /// interferogram: spacing of the fringes without flow [default: infinite]
    #[arg(long, value_name = "LENGTH", value_parser = units::length)]
    fringe_spacing: Option<f64>,
    /// interferogram: direction across the fringes
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true)]
    fringe_angle: Option<f64>,
    /// interferogram: contrast of the fringes, 0 to 1
    #[arg(long, value_name = "V")]
    visibility: Option<f64>,
    /// bos: diameter of the background's dots
    #[arg(long, value_name = "LENGTH", value_parser = units::length)]
    dot_diameter: Option<f64>,
    /// bos: mean spacing of the background's dots
    #[arg(long, value_name = "LENGTH", value_parser = units::length)]
    dot_spacing: Option<f64>,
    /// volume, slice: factor in the exponent
    #[arg(long, value_name = "NUMBER")]
    strength: Option<f64>,
    /// slice: distance from the centre of the field along the light
    #[arg(long, value_name = "LENGTH", value_parser = units::length, allow_hyphen_values = true)]
    slice_depth: Option<f64>,
}

#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Film")]
struct FilmArgs {
    /// Brightness factor; 1 makes undisturbed light white
    #[arg(long, value_name = "FACTOR")]
    exposure: Option<f64>,
    /// Photons per pixel [default: 16; shadowgraphs are noise-free]
    #[arg(long, value_name = "N")]
    samples: Option<u32>,
    /// Trace a lattice of rays and spread the light of its cells, in place of photons; the default
    /// for shadowgraphs
    #[arg(long, conflicts_with_all = ["samples", "filter", "jitter", "seed", "tilted_beams"])]
    noise_free: bool,
    /// Noise filter: none, gaussian:SIGMA, mean:RADIUS (pixels) or cone:NEAREST; its size is for 1
    /// photon per pixel, and narrower for more
    #[arg(long, value_name = "FILTER", value_parser = filter)]
    filter: Option<FilterSpec>,
    /// Jitter of the photons: sobol or random
    #[arg(long, value_name = "NAME", value_parser = jitter)]
    jitter: Option<Jitter>,
    /// Seed of the jitter
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Trace every photon in the beam of its own point of the source
    #[arg(long)]
    tilted_beams: bool,
}

fn technique(text: &str) -> Result<TechniqueSpec, String> {
    TechniqueSpec::by_name(text).ok_or_else(|| {
        format!("there is no technique `{text}`; there are: {}", TechniqueSpec::NAMES.join(", "))
    })
}

fn jitter(text: &str) -> Result<Jitter, String> {
    match text {
        "sobol" => Ok(Jitter::Sobol),
        "random" => Ok(Jitter::Random),
        _ => Err(format!("there is no jitter `{text}`; there are: sobol, random")),
    }
}

fn filter(text: &str) -> Result<FilterSpec, String> {
    let wrong = || format!("`{text}` is not a filter; write none, gaussian:0.8, mean:1 or cone:8");
    let (kind, number) = text.split_once(':').unwrap_or((text, ""));
    let number =
        || number.parse::<f64>().ok().filter(|v| v.is_finite() && *v >= 0.0).ok_or_else(wrong);
    match kind {
        "none" => Ok(FilterSpec::None {}),
        "gaussian" => Ok(FilterSpec::Gaussian { sigma_px: number()? }),
        "mean" => Ok(FilterSpec::Mean { radius_px: number()? }),
        "cone" => Ok(FilterSpec::Cone { nearest: number()? as u32 }),
        _ => Err(wrong()),
    }
}

fn no_effect(flag: &str, what: &str, name: &str, belongs: &str) -> UsageError {
    UsageError(format!("{flag} has no effect with {what} `{name}`; omit it or use {belongs}"))
}

impl SceneArgs {
    /// Whether the options or the scene's file choose the frame.
    #[cfg(feature = "serve")]
    pub(super) fn has_frame(&self) -> bool {
        self.scene.is_some() || self.frame.is_given()
    }

    /// The effective scene after validation.
    pub(super) fn scene(&self, file: Option<&std::path::Path>) -> anyhow::Result<Scene> {
        let mut s = match &self.scene {
            Some(path) => Scene::open(path)?,
            None => Scene::default(),
        };
        if let Some(file) = file {
            s.flow.file = file.to_path_buf();
        }
        if s.flow.file.as_os_str().is_empty() {
            return Err(UsageError("no flow: give a file, or a scene that names one".into()).into());
        }
        self.flow.apply(&mut s)?;
        self.view.apply(&mut s);
        self.optics.apply(&mut s)?;
        self.media.apply(&mut s.media);
        self.frame.apply(&mut s);
        self.film.apply(&mut s);
        self.march.apply(&mut s)?;
        // Without a scene file, the values come from the command line, so an invalid scene is wrong
        // usage.
        if let Err(e) = s.check() {
            return Err(match self.scene {
                None => UsageError(e.to_string()).into(),
                Some(_) => e.into(),
            });
        }
        Ok(s)
    }
}

impl OpticsArgs {
    fn apply(&self, s: &mut Scene) -> anyhow::Result<()> {
        let a = self;
        if let Some(t) = &a.technique
            && t.name() != s.technique.name()
        {
            s.technique = t.clone();
        }
        s.light.source = a.source.or(s.light.source);
        s.film.focus_m = a.film_distance.or(s.film.focus_m);
        self.apply_lenses(s)?;
        self.apply_cutoff(s)?;
        self.apply_rest(s)
    }

    fn apply_lenses(&self, s: &mut Scene) -> anyhow::Result<()> {
        let uses = s.technique.uses_source();
        for (flag, value) in
            [("--focal-length", self.focal_length), ("--collimator", self.collimator)]
        {
            if value.is_some() && !uses {
                return Err(no_effect(
                    flag,
                    "technique",
                    s.technique.name(),
                    "schlieren or shadowgraph",
                )
                .into());
            }
        }
        s.lenses.schlieren_m = self.focal_length.unwrap_or(s.lenses.schlieren_m);
        s.lenses.collimator_m = self.collimator.unwrap_or(s.lenses.collimator_m);
        Ok(())
    }

    fn apply_cutoff(&self, s: &mut Scene) -> anyhow::Result<()> {
        let name = s.technique.name();
        let flags = [
            ("--cutoff", self.cutoff.is_some()),
            ("--cutoff-angle", self.cutoff_angle.is_some()),
            ("--cutoff-open", self.cutoff_open.is_some()),
            ("--cutoff-height", self.cutoff_height.is_some()),
            ("--cutoff-radius", self.cutoff_radius.is_some()),
        ];
        let TechniqueSpec::Schlieren { cutoff } = &mut s.technique else {
            return match flags.iter().find(|f| f.1) {
                Some((flag, _)) => Err(no_effect(flag, "technique", name, "schlieren").into()),
                None => Ok(()),
            };
        };
        // Light deflected by 0.3 mrad reaches the rim at the default focal length.
        let default_radius_m = 0.5e-3;
        match self.cutoff.as_deref() {
            None => {}
            Some("knife") => *cutoff = CutoffSpec::default(),
            Some("circle") => {
                *cutoff = CutoffSpec::Circle { radius_m: default_radius_m, center_m: [0.0; 2] }
            }
            Some("complemented-circle") => {
                *cutoff = CutoffSpec::ComplementedCircle {
                    radius_m: default_radius_m,
                    center_m: [0.0; 2],
                };
            }
            Some("color") => {
                *cutoff = CutoffSpec::Color { radius_m: default_radius_m, red_deg: 0.0 }
            }
            Some(file) if file.to_ascii_lowercase().ends_with(".png") => {
                *cutoff = CutoffSpec::Image { file: file.into(), width_m: 2.0 * default_radius_m };
            }
            Some(other) => {
                return Err(UsageError(format!(
                    "there is no cut-off `{other}`; there are: knife, circle, complemented-circle, \
                     color, or an image file that ends in .png"
                ))
                .into());
            }
        }
        let kind = cutoff.name();
        if let Some(angle) = self.cutoff_angle {
            match cutoff {
                CutoffSpec::Knife { angle_deg, .. } => *angle_deg = angle,
                CutoffSpec::Color { red_deg, .. } => *red_deg = angle,
                _ => {
                    return Err(
                        no_effect("--cutoff-angle", "cut-off", kind, "knife or color").into()
                    );
                }
            }
        }
        if let Some(part) = self.cutoff_open {
            match cutoff {
                CutoffSpec::Knife { open, .. } => *open = part,
                _ => return Err(no_effect("--cutoff-open", "cut-off", kind, "knife").into()),
            }
        }
        if let Some(height) = self.cutoff_height {
            match cutoff {
                CutoffSpec::Knife { open_m, .. } => *open_m = Some(height),
                _ => return Err(no_effect("--cutoff-height", "cut-off", kind, "knife").into()),
            }
        }
        if let Some(radius) = self.cutoff_radius {
            match cutoff {
                CutoffSpec::Circle { radius_m, .. }
                | CutoffSpec::ComplementedCircle { radius_m, .. }
                | CutoffSpec::Color { radius_m, .. } => *radius_m = radius,
                CutoffSpec::Image { width_m, .. } => *width_m = 2.0 * radius,
                _ => {
                    return Err(
                        no_effect("--cutoff-radius", "cut-off", kind, "another cut-off").into()
                    );
                }
            }
        }
        Ok(())
    }

    fn apply_rest(&self, s: &mut Scene) -> anyhow::Result<()> {
        let name = s.technique.name();
        for (flag, present, belongs) in [
            ("--fringe-spacing", self.fringe_spacing.is_some(), &["interferogram"][..]),
            ("--fringe-angle", self.fringe_angle.is_some(), &["interferogram"]),
            ("--visibility", self.visibility.is_some(), &["interferogram"]),
            ("--dot-diameter", self.dot_diameter.is_some(), &["bos"]),
            ("--dot-spacing", self.dot_spacing.is_some(), &["bos"]),
            ("--strength", self.strength.is_some(), &["volume", "slice"]),
            ("--slice-depth", self.slice_depth.is_some(), &["slice"]),
        ] {
            if present && !belongs.contains(&name) {
                return Err(no_effect(flag, "technique", name, &belongs.join(" or ")).into());
            }
        }
        match &mut s.technique {
            TechniqueSpec::Interferogram { visibility, fringe_spacing_m, fringe_angle_deg } => {
                *visibility = self.visibility.unwrap_or(*visibility);
                *fringe_spacing_m = self.fringe_spacing.or(*fringe_spacing_m);
                *fringe_angle_deg = self.fringe_angle.or(*fringe_angle_deg);
            }
            TechniqueSpec::Bos { dot_diameter_m, dot_spacing_m, .. } => {
                *dot_diameter_m = self.dot_diameter.or(*dot_diameter_m);
                *dot_spacing_m = self.dot_spacing.or(*dot_spacing_m);
            }
            TechniqueSpec::Volume { strength } => *strength = self.strength.unwrap_or(*strength),
            TechniqueSpec::Slice { strength, depth_m } => {
                *strength = self.strength.unwrap_or(*strength);
                *depth_m = self.slice_depth.unwrap_or(*depth_m);
            }
            TechniqueSpec::Shadowgraph {} | TechniqueSpec::Schlieren { .. } => {}
        }
        Ok(())
    }
}

impl FilmArgs {
    fn apply(&self, s: &mut Scene) {
        let a = self;
        s.film.exposure = a.exposure.or(s.film.exposure);
        if a.noise_free {
            s.sampling = Some(SamplingSpec::Beams { cells_per_side: 1 });
        }
        if a.tilted_beams {
            s.light.beams = BeamsSpec::Tilted;
        }
        let wants_photons =
            a.samples.is_some() || a.filter.is_some() || a.jitter.is_some() || a.seed.is_some();
        if wants_photons {
            // Options of photon sampling select photons, whatever the technique's default is.
            let mut photons = s.sampling();
            if matches!(photons, SamplingSpec::Beams { .. }) {
                photons = SamplingSpec::default();
            }
            if let SamplingSpec::Photons { samples, jitter, seed, filter } = &mut photons {
                *samples = a.samples.unwrap_or(*samples);
                *jitter = a.jitter.unwrap_or(*jitter);
                *seed = a.seed.unwrap_or(*seed);
                *filter = a.filter.unwrap_or(*filter);
            }
            s.sampling = Some(photons);
        }
    }
}
