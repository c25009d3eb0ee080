//! Checks scenes: refuses invalid values and values that change no pixel.

use super::{
    BeamsSpec, CutoffSpec, FilterSpec, SamplingSpec, Scene, SceneError, SourceSpec, TechniqueSpec,
};
use std::fmt::Display;

/// Largest side of an image in pixels.
const MAX_SIDE: u32 = 16384;
/// Largest number of photons per pixel.
const MAX_SAMPLES: u32 = 1 << 20;

fn wrong(key: &'static str, value: impl Display, cure: impl Into<String>) -> SceneError {
    SceneError::Value { key, value: value.to_string(), cure: cure.into() }
}

pub(super) fn positive(key: &'static str, value: f64) -> Result<(), SceneError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(wrong(key, value, "give a number above 0"))
}

pub(super) fn finite(key: &'static str, values: &[f64]) -> Result<(), SceneError> {
    match values.iter().find(|v| !v.is_finite()) {
        None => Ok(()),
        Some(v) => Err(wrong(key, v, "give a finite number")),
    }
}

fn within(key: &'static str, value: f64, low: f64, high: f64) -> Result<(), SceneError> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(wrong(key, value, format!("give a number from {low} to {high}")))
}

impl Scene {
    /// Refuses invalid values and values that change no pixel. Scenes from files are already
    /// checked.
    ///
    /// # Errors
    /// [`SceneError`] with the key and the cure.
    pub fn check(&self) -> Result<(), SceneError> {
        self.check_light()?;
        self.check_technique()?;
        self.check_film()?;
        self.check_flow()?;
        positive("march.tolerance_rad", self.march.tolerance_rad)?;
        self.march.step_voxels.map_or(Ok(()), |s| positive("march.step_voxels", s))?;
        self.check_skip()?;
        self.check_on_cells()?;
        self.check_effect()?;
        self.check_media()
    }

    /// Only one march can skip gas.
    fn check_skip(&self) -> Result<(), SceneError> {
        let skip = self.march.skip_rad;
        if !(skip >= 0.0 && skip.is_finite()) {
            return Err(wrong("march.skip_rad", skip, "give 0 or a small angle, such as 1e-9"));
        }
        match self.march.method.as_deref().filter(|m| skip > 0.0 && *m != "verlet") {
            Some(m) => Err(wrong(
                "march.skip_rad",
                skip,
                format!(
                    "it has no effect with march.method = \"{m}\": only verlet can skip uniform gas"
                ),
            )),
            None => Ok(()),
        }
    }

    fn check_flow(&self) -> Result<(), SceneError> {
        let flow = &self.flow;
        positive("flow.length_unit_m", flow.length_unit_m)?;
        flow.density_unit_kg_m3.map_or(Ok(()), |s| positive("flow.density_unit_kg_m3", s))?;
        flow.pressure_unit_pa.map_or(Ok(()), |s| positive("flow.pressure_unit_pa", s))?;
        flow.span.map_or(Ok(()), |s| positive("flow.span", s))?;
        for h in flow.spacing.into_iter().flatten() {
            positive("flow.spacing", h)?;
        }
        finite("flow.origin", &flow.origin.unwrap_or_default())?;
        finite("flow.temperature_zero_k", &[flow.temperature_zero_k.unwrap_or(0.0)])?;
        finite("flow.pressure_zero_pa", &[flow.pressure_zero_pa.unwrap_or(0.0)])?;
        within("flow.smoothing_nodes", flow.smoothing_nodes, 0.0, 100.0)?;
        within("flow.resample_samples", flow.resample_samples as f64, 1.0, 8.0)?;
        flow.medium().map(|_| ())
    }

    fn check_light(&self) -> Result<(), SceneError> {
        let light = &self.light;
        if light.wavelengths_nm.is_empty() {
            return Err(wrong(
                "light.wavelengths_nm",
                "[]",
                "give at least one wavelength, such as 633",
            ));
        }
        for &nm in &light.wavelengths_nm {
            within("light.wavelengths_nm", nm, 100.0, 20_000.0)?;
        }
        if !light.weights.is_empty() && light.weights.len() != light.wavelengths_nm.len() {
            let cure = format!(
                "give one weight for each of the {} wavelengths",
                light.wavelengths_nm.len()
            );
            return Err(wrong("light.weights", format!("{:?}", light.weights), cure));
        }
        light.weights.iter().try_for_each(|w| positive("light.weights", *w))?;
        match light.source {
            Some(SourceSpec::Slit { width_m, length_m, angle_deg }) => {
                positive("light.source.width_m", width_m)?;
                positive("light.source.length_m", length_m)?;
                finite("light.source.angle_deg", &[angle_deg.unwrap_or(0.0)])?;
            }
            Some(SourceSpec::Circle { diameter_m }) => {
                positive("light.source.diameter_m", diameter_m)?
            }
            Some(SourceSpec::Point {}) | None => {}
        }
        positive("lenses.collimator_m", self.lenses.collimator_m)?;
        positive("lenses.schlieren_m", self.lenses.schlieren_m)
    }

    fn check_technique(&self) -> Result<(), SceneError> {
        match &self.technique {
            TechniqueSpec::Shadowgraph {} => Ok(()),
            TechniqueSpec::Schlieren { cutoff } => match cutoff {
                CutoffSpec::Knife { angle_deg, open, open_m } => {
                    finite("technique.cutoff.angle_deg", &[*angle_deg])?;
                    open_m.map_or(Ok(()), |h| positive("technique.cutoff.open_m", h))?;
                    if open_m.is_some() && *open != 0.5 {
                        return Err(wrong(
                            "technique.cutoff.open",
                            open,
                            "omit it if open_m is given",
                        ));
                    }
                    within("technique.cutoff.open", *open, 0.0, 1.0)
                }
                CutoffSpec::Circle { radius_m, center_m }
                | CutoffSpec::ComplementedCircle { radius_m, center_m } => {
                    finite("technique.cutoff.center_m", center_m)?;
                    positive("technique.cutoff.radius_m", *radius_m)
                }
                CutoffSpec::Color { radius_m, red_deg } => {
                    finite("technique.cutoff.red_deg", &[*red_deg])?;
                    positive("technique.cutoff.radius_m", *radius_m)
                }
                CutoffSpec::Image { width_m, .. } => positive("technique.cutoff.width_m", *width_m),
                CutoffSpec::Painted(p) => {
                    p.size_m.iter().try_for_each(|s| positive("technique.cutoff.size_m", *s))
                }
            },
            TechniqueSpec::Interferogram { visibility, fringe_spacing_m, fringe_angle_deg } => {
                within("technique.visibility", *visibility, 0.0, 1.0)?;
                finite("technique.fringe_angle_deg", &[fringe_angle_deg.unwrap_or(0.0)])?;
                if fringe_angle_deg.is_some() && fringe_spacing_m.is_none() {
                    return Err(SceneError::NoEffect {
                        key: "technique.fringe_angle_deg",
                        technique: "interferogram",
                        hint: " or give technique.fringe_spacing_m for a finite fringe",
                    });
                }
                fringe_spacing_m.map_or(Ok(()), |s| positive("technique.fringe_spacing_m", s))
            }
            TechniqueSpec::Bos { dot_diameter_m, dot_spacing_m, .. } => {
                dot_diameter_m.map_or(Ok(()), |d| positive("technique.dot_diameter_m", d))?;
                dot_spacing_m.map_or(Ok(()), |d| positive("technique.dot_spacing_m", d))?;
                match (dot_diameter_m, dot_spacing_m) {
                    (Some(d), Some(s)) if d > s => Err(wrong(
                        "technique.dot_diameter_m",
                        d,
                        "give at most technique.dot_spacing_m",
                    )),
                    _ => Ok(()),
                }
            }
            TechniqueSpec::Volume { strength } => positive("technique.strength", *strength),
            TechniqueSpec::Slice { strength, depth_m } => {
                finite("technique.depth_m", &[*depth_m])?;
                positive("technique.strength", *strength)
            }
        }
    }

    fn check_film(&self) -> Result<(), SceneError> {
        let film = &self.film;
        if !film.size.iter().all(|s| (1..=MAX_SIDE).contains(s)) {
            let value = format!("{}x{}", film.size[0], film.size[1]);
            return Err(wrong(
                "film.size",
                value,
                format!("give 1 to {MAX_SIDE} pixels along each side"),
            ));
        }
        film.field_of_view_m.map_or(Ok(()), |v| positive("film.field_of_view_m", v))?;
        film.exposure.map_or(Ok(()), |v| positive("film.exposure", v))?;
        finite("film.center_m", &film.center_m)?;
        finite("film.focus_m", &[self.focus_m()])?;
        match self.sampling() {
            SamplingSpec::Photons { samples, filter, .. } => {
                if !(1..=MAX_SAMPLES).contains(&samples) {
                    return Err(wrong(
                        "sampling.samples",
                        samples,
                        format!("give 1 to {MAX_SAMPLES}"),
                    ));
                }
                match filter {
                    FilterSpec::None {} => Ok(()),
                    FilterSpec::Gaussian { sigma_px } => {
                        within("sampling.filter.sigma_px", sigma_px, 0.0, 100.0)
                    }
                    FilterSpec::Mean { radius_px } => {
                        within("sampling.filter.radius_px", radius_px, 0.0, 100.0)
                    }
                    FilterSpec::Cone { nearest } => {
                        within("sampling.filter.nearest", f64::from(nearest), 2.0, 10_000.0)
                    }
                }
            }
            SamplingSpec::Beams { cells_per_side } => {
                within("sampling.cells_per_side", f64::from(cells_per_side), 1.0, 16.0)
            }
        }
    }

    /// Refuses focal lengths that cancel or have no effect. Default values are never refused,
    /// because every effective scene has them.
    fn check_lenses(&self) -> Result<(), SceneError> {
        let technique = self.technique.name();
        let defaults = super::LensSpec::default();
        let fraction = matches!(
            self.technique,
            TechniqueSpec::Schlieren { cutoff: CutoffSpec::Knife { open_m: None, .. } }
        );
        if self.lenses.schlieren_m != defaults.schlieren_m {
            let no_effect =
                |hint| Err(SceneError::NoEffect { key: "lenses.schlieren_m", technique, hint });
            if fraction {
                return no_effect(
                    ", because with a knife that leaves a fraction of the source open the image \
                     and its shift grow alike; give the open height technique.cutoff.open_m, or \
                     use lenses.collimator_m",
                );
            }
            if !matches!(self.technique, TechniqueSpec::Schlieren { .. }) {
                return no_effect("; it belongs to schlieren");
            }
        }
        let point = self.optics().source == crate::optics::SourceShape::Point;
        if self.lenses.collimator_m != defaults.collimator_m
            && (point || !self.technique.uses_source())
        {
            let hint = "; it sets the size of the source's image, and the source is a point or \
                        unused";
            return Err(SceneError::NoEffect { key: "lenses.collimator_m", technique, hint });
        }
        Ok(())
    }

    /// Refuses keys whose value cannot change a pixel.
    fn check_effect(&self) -> Result<(), SceneError> {
        let technique = self.technique.name();
        let no_effect = |key, hint| Err(SceneError::NoEffect { key, technique, hint });
        if self.light.source.is_some() && !self.technique.uses_source() {
            return no_effect("light.source", "; it belongs to schlieren and shadowgraph");
        }
        if self.light.beams != BeamsSpec::Auto && !self.technique.uses_source() {
            return no_effect("light.beams", "; it belongs to schlieren and shadowgraph");
        }
        if self.light.beams == BeamsSpec::Tilted
            && matches!(self.sampling(), SamplingSpec::Beams { .. })
        {
            return no_effect("light.beams = \"tilted\"", " with sampling by beams; use photons");
        }
        self.check_lenses()?;
        if !self.technique.follows_light() {
            if self.film.focus_m.is_some() {
                return no_effect("film.focus_m", "; it has no optics");
            }
            if self.sampling.is_some() {
                return no_effect("sampling", "; it traces one ray per pixel");
            }
            if !self.solids.files.is_empty() {
                return no_effect("solids", "; it traces no light");
            }
            if self.light.wavelengths_nm.len() > 1 {
                return no_effect("light.wavelengths_nm (several)", "; give one");
            }
        }
        if matches!(self.technique, TechniqueSpec::Shadowgraph {}) && self.focus_m() == 0.0 {
            let cure = "a film in focus at the middle of the flow shows no shadowgraph; give the \
                        film's distance";
            return Err(wrong("film.focus_m", 0.0, cure));
        }
        if matches!(self.technique, TechniqueSpec::Bos { .. }) && self.focus_m() <= 0.0 {
            return Err(wrong(
                "film.focus_m",
                self.focus_m(),
                "give the background's distance behind the flow, above 0",
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLOW: &str = "[flow]\nfile = \"a.vti\"\ndensity = \"rho\"\n";

    fn refused(rest: &str) -> String {
        let error = Scene::from_toml(&format!("{FLOW}{rest}")).expect_err(rest);
        format!(
            "{error} {}",
            std::error::Error::source(&error).map_or(String::new(), ToString::to_string)
        )
    }

    #[test]
    fn unknown_keys_are_refused_at_every_level_by_name() {
        for (text, key) in [
            ("[fiml]\nsize = [1, 1]", "fiml"),
            ("[film]\nsiez = [1, 1]", "siez"),
            (
                "[light]\nsource = { kind = \"slit\", width_m = 1e-3, length_m = 1e-3, depth = 1 }",
                "depth",
            ),
            ("[light]\nsource = { kind = \"point\", width_m = 1e-3 }", "width_m"),
            ("[technique]\nkind = \"schlieren\"\nvisibility = 1.0", "visibility"),
            ("[technique]\nkind = \"shadowgraph\"\ncutoff = { kind = \"knife\" }", "cutoff"),
            (
                "[technique]\nkind = \"schlieren\"\ncutoff = { kind = \"knife\", opne = 0.5 }",
                "opne",
            ),
            ("[sampling]\nmethod = \"beams\"\nsamples = 3", "samples"),
            (
                "[sampling]\nmethod = \"photons\"\nfilter = { kind = \"cone\", nearest = 3, \
                 sigma_px = 1.0 }",
                "sigma_px",
            ),
            (
                "[technique]\nkind = \"schlieren\"\ncutoff = { kind = \"painted\", size_m = [1, \
                 1], ground_rgb = [1, 1, 1], glow = 1 }",
                "glow",
            ),
        ] {
            let message = refused(text);
            assert!(message.contains(key), "{text}: {message}");
        }
    }

    #[test]
    fn impossible_values_are_named_with_their_cure() {
        for (text, words) in [
            ("[film]\nsize = [0, 5]", ["film.size", "1 to 16384"]),
            ("[lenses]\nschlieren_m = -1.0", ["lenses.schlieren_m", "above 0"]),
            ("[light]\nwavelengths_nm = []", ["wavelengths_nm", "633"]),
            ("[light]\nwavelengths_nm = [0.633]", ["wavelengths_nm", "100 to 20000"]),
            ("[light]\nwavelengths_nm = [500, 600]\nweights = [1.0]", ["weights", "2 wavelengths"]),
            ("[view]\ndirection = \"up\"", ["up", "AZIMUTH"]),
            ("[march]\ntolerance_rad = nan", ["tolerance_rad", "above 0"]),
            ("[march]\nskip_rad = -1e-9", ["skip_rad", "give 0"]),
            ("[march]\nskip_rad = 1e-9\nmethod = \"euler\"", ["skip_rad", "only verlet"]),
        ] {
            let message = refused(text);
            assert!(words.iter().all(|w| message.contains(w)), "{text}: {message}");
        }
    }

    #[test]
    fn values_that_change_no_pixel_are_refused_by_name() {
        for (text, key) in [
            ("[technique]\nkind = \"bos\"\n[light]\nsource = { kind = \"point\" }", "light.source"),
            ("[technique]\nkind = \"slice\"\n[film]\nfocus_m = 1.0", "film.focus_m"),
            (
                "[technique]\nkind = \"volume\"\n[sampling]\nmethod = \"photons\"\nsamples = 4",
                "sampling",
            ),
            ("[technique]\nkind = \"volume\"\n[solids]\nfiles = [\"a.stl\"]", "solids"),
            ("[technique]\nkind = \"interferogram\"\nfringe_angle_deg = 3.0", "fringe_angle_deg"),
            ("[technique]\nkind = \"shadowgraph\"\n[film]\nfocus_m = 0.0", "film.focus_m"),
            ("[lenses]\nschlieren_m = 3.0", "lenses.schlieren_m"),
            (
                "[technique]\nkind = \"shadowgraph\"\n[lenses]\ncollimator_m = 3.0",
                "lenses.collimator_m",
            ),
        ] {
            let message = refused(text);
            assert!(message.contains(key), "{text}: {message}");
        }
    }

    #[test]
    fn effective_scenes_say_everything_and_mean_the_same() {
        for technique in TechniqueSpec::NAMES {
            let text = format!("{FLOW}[technique]\nkind = \"{technique}\"");
            let scene = Scene::from_toml(&text).unwrap();
            let effective = scene.effective();
            let written = effective.to_toml().unwrap();
            let again = Scene::from_toml(&written)
                .unwrap_or_else(|e| panic!("{technique}: {e:?}\n{written}"));
            assert_eq!(again, effective);
            assert_eq!(again.optics(), scene.optics());
            assert!(written.contains("exposure"), "{written}");
        }
    }

    #[test]
    fn the_slit_follows_the_knife() {
        let text = format!(
            "{FLOW}[technique]\nkind = \"schlieren\"\ncutoff = {{ kind = \"knife\", angle_deg = \
             90.0 }}"
        );
        let optics = Scene::from_toml(&text).unwrap().optics();
        assert!(matches!(optics.source, crate::optics::SourceShape::Slit { angle_deg: 90.0, .. }));
    }
}
