//! Renders absorption, emission and rotation of the medium: dims the light paths, adds the emitted
//! light and makes the layers of both.
//!
//! Light from the source is dimmed photon by photon ([`crate::media::AttenuatedPaths`]). Light that
//! the medium emits belongs to no photon. It is integrated along each pixel's camera ray, parallel
//! to the axis and against the light, and added to the exposed film after all filters, because it
//! has no noise. Emitted light passes the same bench. It fills the stop in the cut-off plane
//! uniformly, so a cut-off passes its mean over the stop wherever the light comes from
//! ([`Technique::passes_evenly`]). An analyser passes half of it.

use super::planned::PlannedPaths;
use super::{Layers, RenderError, RenderOutput, TestSection, technique};
use crate::march::BlankCells;
#[cfg(feature = "gpu")]
use crate::media::Bend;
use crate::media::{AttenuatedPaths, Media, MediaIntegrals, MediaIntegrator, Property};
use crate::path::Start;
use crate::scene::{Scene, TechniqueSpec};
use crate::spectrum::film_colors;
use crate::technique::Technique;
use crate::technique::bos::ReversedPaths;
use crate::view::View;
use std::sync::Arc;

/// Integrals along the rays through the pixels' centres, row by row from the top. Empty for
/// properties that are not in the scene.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MediaMap {
    /// Optical depth.
    pub optical_depth: Vec<f32>,
    /// Emission towards the film, before cut-off and exposure. 1 is that of undisturbed light
    /// without a cut-off.
    pub emission: Vec<f32>,
    /// Rotation of the plane of polarisation in rad.
    pub rotation_rad: Vec<f32>,
}

impl TestSection {
    /// Adds properties of the medium.
    #[must_use]
    pub fn with_media(mut self, media: Media) -> TestSection {
        self.warnings.extend(media.warnings());
        self.media = Some(media);
        // A device has the values of what was there before.
        #[cfg(feature = "gpu")]
        self.caches.iter_mut().for_each(|c| c.media = Default::default());
        self
    }

    /// The media that the scene needs; `None` when it needs none.
    fn media_of(&self, scene: &Scene) -> Result<Option<&Media>, RenderError> {
        let has = |p: Property| self.media.as_ref().is_some_and(|m| m.get(p).is_some());
        match scene.media.quantities().iter().find(|(p, _)| !has(*p)) {
            Some((property, _)) => Err(RenderError::NoMedia(property.name())),
            None => Ok(self.media.as_ref().filter(|_| !scene.media.is_empty())),
        }
    }

    /// Adds the attenuation by the medium to planned paths.
    pub(super) fn attenuated<'a>(
        &'a self,
        scene: &Scene,
        line: usize,
        view: View,
        mut planned: PlannedPaths<'a>,
    ) -> Result<PlannedPaths<'a>, RenderError> {
        let wanted = scene.media.attenuating();
        let Some(media) = self.media_of(scene)?.filter(|_| !wanted.is_empty()) else {
            return Ok(planned);
        };
        let integrator = self.media_integrator(media, line, view, &planned, &wanted);
        let (analyser, rays) = (scene.media.analyser_rad(), Arc::clone(&planned.media_rays));
        #[cfg(feature = "gpu")]
        if planned.on_device.is_some() {
            planned.media_on_device = self.media_on_device(&integrator, line, analyser);
            if planned.media_on_device.is_none() {
                planned.on_device = None;
                planned.warnings.push(
                    "a full march bends the rays, so the CPU integrates absorption and rotation"
                        .into(),
                );
            }
        }
        planned.paths = Box::new(AttenuatedPaths::new(planned.paths, integrator, analyser, rays));
        Ok(planned)
    }

    /// The same integration on a device; `None` for rays that bend strongly.
    #[cfg(feature = "gpu")]
    fn media_on_device<'a>(
        &'a self,
        integrator: &MediaIntegrator<'a>,
        line: usize,
        analyser_rad: Option<f64>,
    ) -> Option<crate::gpu::FrameMedia<'a>> {
        let [absorption, _, rotation] = integrator.properties();
        let bent = match integrator.bend() {
            Bend::Straight => false,
            Bend::Paraxial => true,
            Bend::Full => return None,
        };
        Some(crate::gpu::FrameMedia {
            absorption,
            rotation,
            analyser_rad,
            bent,
            step_voxels: integrator.step_voxels(),
            origin_m: self.fields[line].origin_m(),
            cache: self.caches.get(line).map(|c| &c.media),
        })
    }

    fn media_integrator<'a>(
        &'a self,
        media: &'a Media,
        line: usize,
        view: View,
        planned: &PlannedPaths<'_>,
        wanted: &[Property],
    ) -> MediaIntegrator<'a> {
        let field = &self.fields[line];
        MediaIntegrator::new(
            field,
            view,
            media,
            wanted,
            planned.bend,
            planned.step_voxels,
            BlankCells::default(),
        )
    }

    /// Absorption and rotation of the image's light from these starts, traced along the light, or
    /// from the camera for techniques that trace from the film. Emission is not included: see
    /// [`TestSection::emitted`]. `None` when the scene has no media.
    ///
    /// # Errors
    /// If the scene needs a property that the test section lacks.
    pub fn media_integrals(
        &self,
        scene: &Scene,
        planned: &PlannedPaths<'_>,
        starts: &[Start],
    ) -> Result<Option<Vec<MediaIntegrals>>, RenderError> {
        let Some(media) = self.media_of(scene)? else { return Ok(None) };
        let wanted = [Property::Absorption, Property::Rotation];
        let against_light = matches!(scene.technique, TechniqueSpec::Bos { .. });
        let mut out = vec![MediaIntegrals::default(); starts.len()];
        if against_light {
            let integrator =
                self.media_integrator(media, 0, ReversedPaths::view(&self.view), planned, &wanted);
            integrator.integrate_parallel(&ReversedPaths::starts(starts), None, &mut out);
        } else {
            self.media_integrator(media, 0, self.view, planned, &wanted)
                .integrate_parallel(starts, None, &mut out);
        }
        Ok(Some(out))
    }

    /// The medium's emission towards the film along camera rays through these starts. Bodies hide
    /// what is behind them. `None` when the scene has no emission.
    ///
    /// # Errors
    /// If the scene needs a property that the test section lacks.
    pub fn emitted(
        &self,
        scene: &Scene,
        planned: &PlannedPaths<'_>,
        starts: &[Start],
    ) -> Result<Option<Vec<f32>>, RenderError> {
        let emission = scene.media.emission.is_some();
        let Some(media) = self.media_of(scene)?.filter(|_| emission) else { return Ok(None) };
        let view = ReversedPaths::view(&self.view);
        let wanted = [Property::Absorption, Property::Emission];
        let integrator = self.media_integrator(media, 0, view, planned, &wanted);
        let starts = ReversedPaths::starts(starts);
        let ends: Option<Vec<f64>> = self.solids.as_ref().map(|solids| {
            starts.iter().map(|s| solids.depth_m(&view, s).unwrap_or(f64::INFINITY)).collect()
        });
        let mut out = vec![MediaIntegrals::default(); starts.len()];
        integrator.integrate_parallel(&starts, ends.as_deref(), &mut out);
        Ok(Some(out.into_iter().map(|c| c.emission).collect()))
    }
}

/// Adds the light that the medium emits to the exposed film.
pub(super) fn add_emission(
    scene: &Scene,
    section: &TestSection,
    planned: &PlannedPaths<'_>,
    layers: Layers,
    r: &mut RenderOutput,
) -> Result<(), RenderError> {
    if scene.media.emission.is_none() {
        return Ok(());
    }
    let Some(emitted) = section.emitted(scene, planned, &r.framing.pixel_centers())? else {
        return Ok(());
    };
    r.report.counters.media_rays += emitted.len() as u64;

    // The medium emits with the spectrum of the light.
    let lines = scene.lines();
    let colors = film_colors(&lines);
    let mut gain = [0.0f32; 3];
    for line in 0..lines.len() {
        let t: Technique = technique(scene, line, &r.framing, section.n0(line), false)?;
        let passes = t.passes_evenly(scene.media.stop_m());
        let color = if lines.len() > 1 { colors[line] } else { [1.0; 3] };
        (0..3).for_each(|c| gain[c] += passes[c] * color[c]);
    }
    let polariser = if scene.media.analyser_deg.is_some() { 0.5 } else { 1.0 };
    let exposure = scene.exposure() as f32 * polariser;
    for (pixel, emission) in r.pixels.iter_mut().zip(&emitted) {
        (0..3).for_each(|c| pixel[c] += emission * gain[c] * exposure);
    }
    if layers.map {
        r.media.get_or_insert_default().emission = emitted;
    }
    Ok(())
}

/// Adds the layers of absorption and rotation; pixels without light get zeros.
pub(super) fn add_map(
    scene: &Scene,
    section: &TestSection,
    planned: &PlannedPaths<'_>,
    r: &mut RenderOutput,
) -> Result<(), RenderError> {
    let counters = &mut r.report.counters;
    counters.media_rays += planned.take_media_rays();
    let spec = &scene.media;
    if spec.absorption.is_none() && spec.rotation.is_none() {
        return Ok(());
    }
    let Some(all) = section.media_integrals(scene, planned, &r.framing.pixel_centers())? else {
        return Ok(());
    };
    counters.media_rays += all.len() as u64;
    let lit = |i: usize| r.map.as_ref().is_none_or(|m| m.transmission[i] > 0.0);
    let layer = |wanted: bool, of: fn(&MediaIntegrals) -> f32| -> Vec<f32> {
        let all = if wanted { &all[..] } else { &[] };
        all.iter().enumerate().map(|(i, c)| if lit(i) { of(c) } else { 0.0 }).collect()
    };
    let optical_depth = layer(spec.absorption.is_some(), |c| c.optical_depth);
    let rotation_rad = layer(spec.rotation.is_some(), |c| c.rotation_rad);
    let map = r.media.get_or_insert_default();
    (map.optical_depth, map.rotation_rad) = (optical_depth, rotation_rad);
    Ok(())
}

/// Warns about a rotation that no analyser makes visible, unless it is written to layers.
pub(super) fn warn(scene: &Scene, layers: Layers, warnings: &mut Vec<String>) {
    if scene.media.rotation.is_some() && scene.media.analyser_deg.is_none() && !layers.map {
        warnings.push(
            "media.rotation is not visible in the image without an analyser (media.analyser_deg); \
             its angles are in the EXR's layer rotation.Y"
                .into(),
        );
    }
}
