//! Scene in, picture out.
//!
//! ```
//! use glam::DVec3;
//! use schlieren::field::Field;
//! use schlieren::render::{Control, Layers, TestSection, render};
//! use schlieren::scene::Scene;
//!
//! // A warm Gaussian blob in air, 10 cm wide, behind a vertical knife.
//! let scene = Scene::from_toml("[flow]\nfile = \"\"\ndensity = \"-\"\n[film]\nsize = [32, 32]")?;
//! let blob = Field::from_fn([33; 3], [3e-3; 3], DVec3::splat(-48e-3), 1.00027, |p| {
//!     -2e-5 * (-p.length_squared() / (2.0 * 12e-3f64.powi(2))).exp()
//! })?;
//! let section = TestSection::of_fields(&scene, vec![blob], None)?;
//! let picture = render(&scene, &section, Layers::NONE, &Control::default())?;
//! // Light is bent away from the warm middle: to the left of it darker, to the right brighter than the background of 1/2.
//! let [left, right] = [16 * 32 + 11, 16 * 32 + 20].map(|i: usize| picture.pixels[i][0]);
//! assert!(left < 0.46 && right > 0.54, "{left} {right}");
//! assert!((picture.pixels[0][0] - 0.5).abs() < 1e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub(crate) mod map;
mod media;
#[cfg(test)]
mod media_tests;
mod on_gpu;
mod paths;
mod section;
#[cfg(test)]
mod tests;

pub use map::Map;
pub use media::MediaMap;
pub use on_gpu::check_gpu;
pub use paths::{INTERPOLANTS, MARCHES, Planned};
pub use section::TestSection;

use crate::cutoff::Rgb;
use crate::film::beams::expose_beams;
use crate::film::photons::{Exposure, Landed, expose};
use crate::film::{Film, Framing, Tally};
use crate::filter::Filter;
use crate::optics::{Optics, SourceImage};
use crate::path::{Exit, LightPaths, Start, Wanted};
use crate::scene::{BeamsSpec, Counters, Effects, Jitter, SamplingSpec, Scene, SceneError, TechniqueSpec};
use crate::spectrum::{film_colors, filter_band};
use crate::technique::volume::ComparisonError;
use crate::technique::{Technique, bos, interferogram, schlieren, slice, volume};
use rt_core::sampler::Sampling;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The scene is none.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The flow cannot be read.
    #[error(transparent)]
    Input(#[from] crate::input::InputError),
    /// The bodies cannot be read.
    #[error(transparent)]
    Solids(#[from] crate::solids::SolidsError),
    /// The view is none.
    #[error(transparent)]
    View(#[from] crate::view::ViewError),
    /// A comparison cannot be drawn.
    #[error(transparent)]
    Comparison(#[from] ComparisonError),
    /// Not one field per wavelength.
    #[error("the scene has {wanted} wavelengths and {found} fields; give one field for each")]
    Fields {
        /// Wavelengths.
        wanted: usize,
        /// Fields.
        found: usize,
    },
    /// The GPU march is not part of this program.
    #[error("this program is built without the feature gpu; take --device cpu (march.device in a scene)")]
    NoGpu,
    /// The GPU was asked for and cannot do it.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Gpu(#[from] crate::gpu::GpuError),
    /// The scene names a property of the medium, and the test section has none.
    #[error(
        "the scene has media.{0} and the test section does not; read it from a file, or give it with `TestSection::with_media`"
    )]
    NoMedia(&'static str),
    /// A name that nothing has.
    #[error("{key}: there is no `{name}`; there are: {names}")]
    Unknown {
        /// Path of the key in the scene.
        key: &'static str,
        /// What was asked for.
        name: String,
        /// What there is.
        names: String,
    },
    /// The photons for a cone filter do not fit.
    #[error(
        "the cone filter keeps every photon, and {photons} are more than the {limit} it may keep; take fewer samples or another filter"
    )]
    TooManyPhotons {
        /// Wanted.
        photons: u64,
        /// Allowed.
        limit: u64,
    },
    /// Cancelled from outside.
    #[error("cancelled")]
    Cancelled,
}

/// Cancels a picture and follows its progress.
pub struct Control<'a> {
    /// Set it to stop soon.
    pub cancel: &'a AtomicBool,
    /// Gets parts done, 0..=1, from any thread, in order.
    pub progress: &'a (dyn Fn(f64) + Sync),
}

impl Default for Control<'_> {
    /// Runs to the end in silence.
    fn default() -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Control { cancel: &NEVER, progress: &|_| {} }
    }
}

/// What is wanted beside the picture. What is not wanted is not computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[allow(clippy::struct_excessive_bools, reason = "independent wishes")]
pub struct Layers {
    /// Deflection, displacement and transmission through the pixels' centres.
    pub map: bool,
    /// The phase there.
    pub phase: bool,
    /// Photons per pixel.
    pub counts: bool,
    /// The picture's noise.
    pub noise: bool,
}

impl Layers {
    /// The picture alone.
    pub const NONE: Layers = Layers { map: false, phase: false, counts: false, noise: false };
    /// Everything.
    pub const ALL: Layers = Layers { map: true, phase: true, counts: true, noise: true };
}

/// A picture and what belongs to it. All are row by row from the top.
#[derive(Debug, Clone)]
pub struct Rendered {
    /// Where its pixels lie in the test section.
    pub framing: Framing,
    /// Linear brightness, 1 is white: energy times exposure. Grey pictures have three equal channels.
    pub pixels: Vec<Rgb>,
    /// Whether channels can differ.
    pub colored: bool,
    /// With [`Layers::map`].
    pub map: Option<Map>,
    /// With [`Layers::map`], when the scene has media.
    pub media: Option<MediaMap>,
    /// With [`Layers::counts`], when photons were sent.
    pub counts: Option<Vec<u32>>,
    /// With [`Layers::noise`]: estimated error of each pixel's brightness by too few photons: half the difference between two halves of them, of the first
    /// wavelength, strongest channel. `None` for pictures without noise.
    pub noise: Option<Vec<f32>>,
    /// What was done.
    pub report: Report,
}

/// What was done for a picture.
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct Report {
    /// Effects that the scene calls for.
    pub effects: Effects,
    /// Work by kind.
    pub counters: Counters,
    /// Photons by fate, over all wavelengths.
    pub tally: Tally,
    /// The march, in words.
    pub march: String,
    /// Measured error of a deflection by march and interpolation, when there is a map.
    pub deflection_error_rad: Option<f64>,
    /// Estimated error of a deflection by the flow's own lattice.
    pub resolution_error_rad: Option<f64>,
    /// Largest deflection through a pixel's centre, when there is a map.
    pub largest_deflection_rad: Option<f64>,
    /// By how much bodies' silhouettes can be off because bodies see straight rays, when there are bodies and a map.
    pub silhouette_error_px: Option<f64>,
    /// Darkest and brightest channel of the picture.
    pub levels: [f32; 2],
    /// Pixels around the picture that sent light as well.
    pub margin_px: u32,
    /// Side of a pixel in the test section.
    pub pixel_m: f64,
    /// What should be known about the picture, a sentence each.
    pub warnings: Vec<String>,
}

impl Report {
    fn add_plan(&mut self, planned: &Planned<'_>) {
        self.march.clone_from(&planned.description);
        self.deflection_error_rad = planned.error_rad;
        self.resolution_error_rad = planned.resolution_error_rad;
        self.warnings.extend(planned.warnings.iter().cloned());
    }
}

/// Draws the scene's picture of a test section. The same for any number of threads.
pub fn render(
    scene: &Scene,
    section: &TestSection,
    layers: Layers,
    control: &Control<'_>,
) -> Result<Rendered, RenderError> {
    scene.check()?;
    let framing = framing(scene, section);
    let exposure = scene.exposure();
    let mut r = Rendered {
        framing,
        pixels: Vec::new(),
        colored: false,
        map: None,
        media: None,
        counts: None,
        noise: None,
        report: Report {
            effects: Effects::required_by(scene),
            pixel_m: framing.pixel_m,
            warnings: section.warnings.clone(),
            ..Report::default()
        },
    };

    // Comparisons have no light; the deflection map has.
    let against_light = matches!(scene.technique, TechniqueSpec::Bos { .. });
    let grey = |v: Vec<f32>| v.into_iter().map(|v| [v * exposure as f32; 3]).collect();
    let mut first = None;
    match scene.technique {
        TechniqueSpec::Volume { strength } => {
            r.pixels = grey(volume::volume(&section.fields[0], &section.view, &framing, strength)?);
        }
        TechniqueSpec::Slice { strength, depth_m } => {
            r.pixels = grey(slice::slice(&section.fields[0], &section.view, &framing, depth_m, strength)?);
        }
        _ => first = expose_lines(scene, section, layers, control, &mut r)?,
    }
    let measured = first.is_some();
    if control.cancel.load(Ordering::Relaxed) {
        return Err(RenderError::Cancelled);
    }

    if let Some(planned) = &first {
        media::add_emission(scene, section, planned, layers, &mut r)?;
    }
    if layers.map {
        // The picture's own paths serve when they tell what is wanted; the optical path is not computed for photons that do not need it.
        let planned = match first.filter(|p| p.paths.wanted().opd || !layers.phase) {
            Some(planned) => planned,
            None => section.paths(scene, 0, Wanted { opd: layers.phase }, against_light, !measured)?,
        };
        add_map(scene, section, &planned, &mut r);
        media::add_map(scene, section, &planned, &mut r)?;
    }
    media::warn(scene, layers, &mut r.report.warnings);
    r.report.levels = r
        .pixels
        .iter()
        .flatten()
        .fold([f32::INFINITY, f32::NEG_INFINITY], |[l, h], v| [l.min(*v), h.max(*v)]);
    warn_about_picture(scene, &mut r.report);
    (control.progress)(1.0);
    Ok(r)
}

/// Where pixels lie: the field of view, or all of the field.
pub fn framing(scene: &Scene, section: &TestSection) -> Framing {
    let [width, height] = scene.film.size;
    let fitted = Framing::fitted(width, height, section.sides_m());
    let pixel_m = scene.film.field_of_view_m.map_or(fitted.pixel_m, |v| v / f64::from(width));
    Framing { pixel_m, center_m: scene.film.center_m, ..fitted }
}

/// The technique for line `line` of the spectrum.
pub fn technique(
    scene: &Scene,
    line: usize,
    framing: &Framing,
    n0: f64,
    sample_source: bool,
) -> Result<Technique, RenderError> {
    let (optics, lines) = (scene.optics(), scene.lines());
    Ok(match &scene.technique {
        TechniqueSpec::Schlieren { cutoff } => {
            let s = schlieren::Schlieren::new(optics, &cutoff.cutoff()?, sample_source);
            let several = lines.len() > 1;
            Technique::Schlieren(if several {
                s.with_band(filter_band(lines[line].wavelength_nm))
            } else {
                s
            })
        }
        TechniqueSpec::Interferogram { visibility, fringe_spacing_m, fringe_angle_deg } => {
            let fringes = fringe_spacing_m.map(|spacing_m| interferogram::Fringes {
                spacing_m,
                angle_deg: fringe_angle_deg.unwrap_or(0.0),
            });
            let wavelength_m = lines[line].wavelength_nm * 1e-9;
            Technique::Interferogram(interferogram::Interferogram::new(
                optics,
                wavelength_m,
                *visibility,
                fringes,
                n0,
            ))
        }
        TechniqueSpec::Bos { dot_diameter_m, dot_spacing_m, seed } => {
            let diameter_m =
                dot_diameter_m.unwrap_or(3.0 * framing.pixel_m).min(dot_spacing_m.unwrap_or(f64::INFINITY));
            let spacing_m = dot_spacing_m.unwrap_or(2.0 * diameter_m);
            Technique::Bos(bos::Bos::new(optics, bos::Dots { diameter_m, spacing_m, seed: *seed }))
        }
        TechniqueSpec::Shadowgraph {} | TechniqueSpec::Volume { .. } | TechniqueSpec::Slice { .. } => {
            Technique::Shadowgraph(optics)
        }
    })
}

/// How far the beams of an extended source part from the axial one, in pixels: within the flow, or on the way to the plane in focus.
fn beam_spread_px(scene: &Scene, section: &TestSection, optics: &Optics, framing: &Framing) -> f64 {
    if !scene.technique.uses_source() {
        return 0.0;
    }
    let reach_m = match optics.source_image() {
        SourceImage::Point => 0.0,
        SourceImage::Rectangle { half_m, .. } => half_m[0].hypot(half_m[1]),
        SourceImage::Disc { radius_m } => radius_m,
    };
    let lever_m = optics.focus_m.abs().max(0.5 * section.depth_m());
    reach_m / optics.schlieren_focal_length_m * lever_m / framing.pixel_m
}

/// Exposes the film to every line of the spectrum and adds up their colours. Returns the paths of the first.
fn expose_lines<'a>(
    scene: &Scene,
    section: &'a TestSection,
    layers: Layers,
    control: &Control<'_>,
    r: &mut Rendered,
) -> Result<Option<Planned<'a>>, RenderError> {
    let (framing, optics) = (r.framing, scene.optics());
    let lines = scene.lines();
    let spread_px = beam_spread_px(scene, section, &optics, &framing);
    let by_photons = matches!(scene.sampling(), SamplingSpec::Photons { .. });
    let tilted_beams = by_photons
        && match scene.light.beams {
            BeamsSpec::Auto => spread_px > 0.5,
            BeamsSpec::Axial => false,
            BeamsSpec::Tilted => scene.technique.uses_source(),
        };
    if spread_px > 0.5 && !tilted_beams {
        r.report.warnings.push(format!(
            "the source's extent would blur the picture by {spread_px:.1} pixels, which is left out; take photons with light.beams = \"auto\""
        ));
    }
    r.report.effects.tilted_beams = tilted_beams;
    let against_light = matches!(scene.technique, TechniqueSpec::Bos { .. });
    let colors = film_colors(&lines);
    r.pixels = vec![[0.0; 3]; framing.pixels()];
    r.colored = lines.len() > 1;
    let mut first = None;

    for line in 0..lines.len() {
        let n0 = section.fields[line].n0();
        let t = technique(scene, line, &framing, n0, tilted_beams)?;
        let planned = section.paths(
            scene,
            line,
            Wanted { opd: t.needs_opd() },
            against_light,
            layers.map && line == 0,
        )?;
        if line == 0 {
            r.report.add_plan(&planned);
        }
        let margin_px = if t.looks_from_film() {
            0
        } else {
            margin_px(&*planned.paths, &optics, &framing, &mut r.report)
        };
        let (sampling, seed) = match scene.sampling() {
            SamplingSpec::Photons { jitter: Jitter::Random, seed, .. } => (Sampling::Random, seed),
            SamplingSpec::Photons { seed, .. } => (Sampling::Sobol, seed),
            SamplingSpec::Beams { .. } => (Sampling::Sobol, 0),
        };
        let setup = Exposure {
            paths: &*planned.paths,
            technique: &t,
            solids: section.solids.as_ref(),
            sampling,
            seed,
            margin_px,
            tilted_beams,
        };
        let part = |done: f64| (control.progress)((line as f64 + done) / lines.len() as f64);
        let wished =
            Layers { counts: layers.counts && line == 0, noise: layers.noise && line == 0, ..layers };
        let (scale, before) = (scene.exposure() as f32, r.report.counters.rays);
        if t.is_colored() {
            let film = expose_line::<3>(scene, &setup, framing, wished, control.cancel, &part, r)?;
            r.colored = true;
            r.pixels = film.into_iter().map(|p| p.map(|v| v * scale)).collect();
        } else {
            let film = expose_line::<1>(scene, &setup, framing, wished, control.cancel, &part, r)?;
            let color = if lines.len() > 1 { colors[line] } else { [1.0; 3] };
            for (p, f) in r.pixels.iter_mut().zip(film) {
                (0..3).for_each(|c| p[c] += f[0] * color[c] * scale);
            }
        }
        let counters = &mut r.report.counters;
        let rays = counters.rays - before;
        counters.phase_rays += if t.needs_opd() { rays } else { 0 };
        counters.tilted_rays += if tilted_beams { rays } else { 0 };
        counters.dispersion_rays += if line > 0 { rays } else { 0 };
        counters.media_rays += planned.take_media_rays();
        first.get_or_insert(planned);
    }
    Ok(first)
}

/// The film of one line, filtered: energy per pixel.
fn expose_line<const C: usize>(
    scene: &Scene,
    setup: &Exposure<'_>,
    framing: Framing,
    layers: Layers,
    cancel: &AtomicBool,
    progress: &(dyn Fn(f64) + Sync),
    r: &mut Rendered,
) -> Result<Vec<[f32; C]>, RenderError> {
    let done = AtomicU64::new(0);
    let side = |n: u32| u64::from(n) + 2 * u64::from(setup.margin_px);
    let per_pass = side(framing.width) * side(framing.height);
    let finished = |total: u64, rays: u64| {
        let so_far = done.fetch_add(rays, Ordering::Relaxed) + rays;
        progress(so_far as f64 / total as f64);
    };
    let film = match scene.sampling() {
        SamplingSpec::Beams { cells_per_side } => {
            let total = per_pass * u64::from(cells_per_side).pow(2);
            let film = Film::<C>::new(framing, false);
            let tally = expose_beams(setup, &film, cells_per_side, cancel, &|n| finished(total, n))
                .ok_or(RenderError::Cancelled)?;
            r.report.tally.add(&tally);
            let rays = done.load(Ordering::Relaxed);
            r.report.counters.differential_rays += rays;
            r.report.counters.rays += rays;
            r.report.counters.solid_queries += if setup.solids.is_some() { rays } else { 0 };
            film.developed(1.0)
        }
        SamplingSpec::Photons { samples, filter, .. } => {
            let filter = filter.filter().shrunk(samples);
            let total = per_pass * u64::from(samples);
            let keep = matches!(filter, Filter::Cone { .. });
            if keep && total > crate::filter::cone::MAX_PHOTONS {
                let limit = crate::filter::cone::MAX_PHOTONS;
                return Err(RenderError::TooManyPhotons { photons: total, limit });
            }
            let two = layers.noise && samples > 1;
            let films: Vec<Film<C>> =
                (0..if two { 2 } else { 1 }).map(|_| Film::new(framing, layers.counts)).collect();
            let exposed = expose(setup, &films, 0..samples, keep, cancel, &|n| finished(total, n))
                .ok_or(RenderError::Cancelled)?;
            r.report.tally.add(&exposed.tally);
            r.report.counters.rays += exposed.tally.sent - exposed.tally.blocked_by_solids;
            r.report.counters.solid_queries += if setup.solids.is_some() { exposed.tally.sent } else { 0 };
            if two {
                r.noise = Some(noise(&films, samples, filter, scene.exposure()));
            }
            if let [first, second] = &films[..] {
                first.add_film(second);
            }
            if layers.counts {
                r.counts = films[0].counts();
            }
            filtered(&films[0].developed(f64::from(samples)), &exposed.landed, &framing, filter, samples)
        }
    };
    Ok(film)
}

/// Takes the noise out of a film.
fn filtered<const C: usize>(
    film: &[[f32; C]],
    landed: &[Landed<C>],
    framing: &Framing,
    filter: Filter,
    samples: u32,
) -> Vec<[f32; C]> {
    let width = framing.width as usize;
    match filter {
        Filter::None => film.to_vec(),
        Filter::Gaussian { sigma_px } => crate::filter::gaussian::gaussian(film, width, sigma_px),
        Filter::Mean { radius_px } => crate::filter::mean::mean(film, width, radius_px),
        Filter::Cone { nearest } => crate::filter::cone::cone(landed, framing, nearest, f64::from(samples)),
    }
}

/// Half the difference between two halves of the photons, filtered like the picture (a cone's noise is told by its film's).
fn noise<const C: usize>(films: &[Film<C>], samples: u32, filter: Filter, exposure: f64) -> Vec<f32> {
    let halves = [samples.div_ceil(2), samples / 2];
    let developed: Vec<Vec<[f32; C]>> =
        films.iter().zip(halves).map(|(f, n)| f.developed(f64::from(n))).collect();
    let difference: Vec<[f32; C]> = developed[0]
        .iter()
        .zip(&developed[1])
        .map(|(a, b)| std::array::from_fn(|c| 0.5 * exposure as f32 * (a[c] - b[c])))
        .collect();
    let width = films[0].framing().width as usize;
    let difference = match filter {
        Filter::Gaussian { sigma_px } => crate::filter::gaussian::gaussian(&difference, width, sigma_px),
        Filter::Mean { radius_px } => crate::filter::mean::mean(&difference, width, radius_px),
        Filter::None | Filter::Cone { .. } => difference,
    };
    difference.iter().map(|d| d.iter().fold(0.0f32, |m, v| m.max(v.abs()))).collect()
}

/// Pixels around the picture from which light can stray into it: the farthest stray of a coarse lattice of rays over the picture and half its size more,
/// and a quarter of that for what the lattice missed.
fn margin_px(paths: &dyn LightPaths, optics: &Optics, framing: &Framing, report: &mut Report) -> u32 {
    const PROBES: u32 = 64;
    let probe =
        |i: u32, n: u32| (f64::from(i) + 0.5) / f64::from(PROBES) * 1.5 * f64::from(n) - 0.25 * f64::from(n);
    let starts: Vec<Start> = (0..PROBES * PROBES)
        .map(|k| {
            let at =
                framing.plane_from_pixel(probe(k % PROBES, framing.width), probe(k / PROBES, framing.height));
            Start { position_m: at.map(|c| c as f32), tilt_rad: [0.0; 2] }
        })
        .collect();
    let mut exits = vec![Exit::UNDISTURBED; starts.len()];
    paths.trace_parallel(&starts, &mut exits);
    let lands = |e: &&(&Start, &Exit)| e.1.transmission > 0.0 && e.1.status != crate::path::Status::Turned;
    let stray = |(s, e): (&Start, &Exit)| {
        let [x, y] = optics.film_shift_m(s, e);
        f64::from(x.abs().max(y.abs())) / framing.pixel_m
    };
    let pairs: Vec<(&Start, &Exit)> = starts.iter().zip(&exits).collect();
    let farthest = pairs.iter().filter(lands).map(|p| stray(*p)).fold(0.0f64, f64::max);
    let wanted = (1.25 * farthest + 1.0).ceil();
    let limit = f64::from(framing.width.max(framing.height));
    if wanted > limit {
        report.warnings.push(format!(
            "light strays by {farthest:.0} pixels, more than the picture's size; what comes from farther away is left out. Bring the film nearer, or look at more"
        ));
    }
    let margin = wanted.min(limit) as u32;
    report.margin_px = report.margin_px.max(margin);
    margin
}

fn add_map(scene: &Scene, section: &TestSection, planned: &Planned<'_>, r: &mut Rendered) {
    let blocked = |s: &Start| section.solids.as_ref().is_some_and(|b| b.block(&section.view, s));
    let wavelength_m = scene.light.wavelengths_nm[0] * 1e-9;
    let n0 = section.fields[0].n0();
    let m = map::map(&*planned.paths, &scene.optics(), &r.framing, wavelength_m, n0, blocked);
    let report = &mut r.report;
    if report.march.is_empty() {
        report.add_plan(planned);
    }
    report.counters.map_rays += m.transmission.len() as u64;
    report.counters.phase_rays += m.waves.len() as u64;
    report.counters.solid_queries += if section.solids.is_some() { m.transmission.len() as u64 } else { 0 };
    report.largest_deflection_rad = Some(m.largest_deflection_rad);
    if section.solids.is_some() {
        let error_px = m.largest_displacement_m / r.framing.pixel_m;
        report.silhouette_error_px = Some(error_px);
        if error_px > 0.5 {
            report.warnings.push(format!(
                "rays are displaced by up to {error_px:.1} pixels and bodies see them straight: silhouettes can be off by that much; mark the bodies' cells solid in the flow's file"
            ));
        }
    }
    if matches!(scene.technique, TechniqueSpec::Interferogram { .. }) && !m.waves.is_empty() {
        let pairs = interferogram::unresolved_pairs(&m.waves, r.framing.width as usize);
        if pairs > 0 {
            report.warnings.push(format!(
                "the phase changes by more than half a wave between {pairs} pairs of neighbouring pixels: fringes there are finer than pixels and turn grey; take more pixels or look at less"
            ));
        }
    }
    r.map = Some(m);
}

/// A picture that shows nothing is an answer, but mostly not the one that was wanted.
fn warn_about_picture(scene: &Scene, report: &mut Report) {
    let [low, high] = report.levels;
    // One step of an 8-bit picture at half brightness, in linear light.
    let visible = 0.004 * high.max(0.1);
    if high - low < visible && !matches!(scene.technique, TechniqueSpec::Bos { .. }) {
        let cure = match scene.technique {
            TechniqueSpec::Schlieren { .. } => {
                "a smaller source (light.source), a longer collimator (lenses.collimator_m) or a smaller opening of the cut-off make it more sensitive"
            }
            TechniqueSpec::Shadowgraph {} => "a film farther away (film.focus_m) makes it more sensitive",
            TechniqueSpec::Interferogram { .. } => {
                "the optical path differs by less than a fringe; finite fringes (technique.fringe_spacing_m) show less"
            }
            _ => "a larger technique.strength shows more",
        };
        report.warnings.push(format!("the picture is even ({low:.4} to {high:.4} of white): {cure}"));
    }
    if report.tally.not_a_number > 0 {
        report.warnings.push(format!(
            "{} photons came back with numbers that are none and were left out; please report this",
            report.tally.not_a_number
        ));
    }
}
