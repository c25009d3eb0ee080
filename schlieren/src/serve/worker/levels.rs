//! The steps of the progressive refinement of an image.

use crate::render::{TestSection, framing};
use crate::scene::{SamplingSpec, Scene, TechniqueSpec};

/// Photons per pixel of that image.
const INTERACTIVE_SAMPLES: u32 = 4;
/// Tolerance of the first two images. It gives straight rays through all but the strongest flows,
/// without a visible difference.
const DRAFT_TOLERANCE_RAD: f64 = 1e-2;

/// One step of the progressive refinement.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Level {
    pub(super) scene: Scene,
    /// Whether it is rendered with a coarse tolerance.
    pub(super) draft: bool,
    pub(super) coarse: bool,
    pub(super) stoppable: bool,
    pub(super) samples: Option<u32>,
}

/// The background's dots in metres, where the scene leaves their size to the pixels: images with
/// coarser pixels must have the same dots.
pub(super) fn dots(scene: &Scene, section: &TestSection) -> Option<TechniqueSpec> {
    let TechniqueSpec::Bos { dot_diameter_m: None, dot_spacing_m, seed } = scene.technique else {
        return None;
    };
    // The same choice as in [`render::technique`].
    let diameter_m =
        (3.0 * framing(scene, section).pixel_m).min(dot_spacing_m.unwrap_or(f64::INFINITY));
    Some(TechniqueSpec::Bos {
        dot_diameter_m: Some(diameter_m),
        dot_spacing_m: Some(dot_spacing_m.unwrap_or(2.0 * diameter_m)),
        seed,
    })
}

impl Level {
    pub(super) fn with_dots(mut self, dots: &Option<TechniqueSpec>) -> Level {
        // The final image uses the scene unchanged.
        if let Some(dots) = dots.as_ref().filter(|_| self.coarse) {
            self.scene.technique = dots.clone();
        }
        self
    }
}

pub(super) fn wanted_samples(scene: &Scene) -> Option<u32> {
    match scene.sampling() {
        SamplingSpec::Photons { samples, .. } if scene.technique.follows_light() => Some(samples),
        _ => None,
    }
}

/// The steps of the progressive refinement; the last is the scene itself.
pub(super) fn levels(scene: &Scene, interactive_side: u32) -> Vec<Level> {
    let wanted = wanted_samples(scene);
    let whole = |samples: Option<u32>| {
        let mut s = scene.clone();
        if let (Some(n), SamplingSpec::Photons { jitter, seed, filter, .. }) =
            (samples, scene.sampling())
        {
            s.sampling = Some(SamplingSpec::Photons { samples: n, jitter, seed, filter });
        }
        Level { scene: s, draft: false, coarse: false, stoppable: true, samples }
    };
    let mut draft = whole(wanted.map(|n| n.min(INTERACTIVE_SAMPLES)));
    draft.scene.march.tolerance_rad = scene.march.tolerance_rad.max(DRAFT_TOLERANCE_RAD);
    draft.draft = true;
    let mut interactive = Level { coarse: true, stoppable: false, ..draft.clone() };
    shrink(&mut interactive.scene, interactive_side);
    let mut levels = vec![interactive, draft];
    let mut samples = INTERACTIVE_SAMPLES;
    while wanted.is_some_and(|w| samples < w) {
        levels.push(whole(Some(samples)));
        samples *= 4;
    }
    // The scene itself, unchanged.
    levels.push(Level { scene: scene.clone(), ..whole(wanted) });
    levels
}

/// Reduces the pixels of a scene.
fn shrink(scene: &mut Scene, side: u32) {
    let [w, h] = scene.film.size;
    let longest = w.max(h);
    if longest <= side {
        return;
    }
    let factor = f64::from(side) / f64::from(longest);
    scene.film.size = [w, h].map(|n| (f64::from(n) * factor).round().max(1.0) as u32);
    if let SamplingSpec::Beams { cells_per_side } = scene.sampling()
        && cells_per_side > 1
    {
        scene.sampling = Some(SamplingSpec::Beams { cells_per_side: 1 });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(rest: &str) -> Scene {
        Scene::from_toml(&format!("[flow]\nfile = \"a\"\ndensity = \"r\"\n{rest}")).unwrap()
    }

    #[test]
    fn images_get_finer_and_the_last_is_the_scene_itself() {
        let s = scene("[film]\nsize = [512, 256]\n[sampling]\nmethod = \"photons\"\nsamples = 100");
        let levels = levels(&s, 128);
        let samples: Vec<_> = levels.iter().map(|l| l.samples.unwrap()).collect();
        assert_eq!(samples, [4, 4, 4, 16, 64, 100]);
        assert!(levels[0].draft && levels[1].draft && !levels[2].draft);
        assert_eq!(levels[0].scene.film.size, [128, 64]);
        assert!(levels[0].coarse && !levels[0].stoppable);
        assert_eq!(levels.last().unwrap().scene, s);
        for l in &levels {
            l.scene.check().unwrap();
        }
    }

    #[test]
    fn every_technique_has_images_that_are_scenes() {
        for name in TechniqueSpec::NAMES {
            let s = scene(&format!("[technique]\nkind = \"{name}\""));
            let levels = levels(&s, 100);
            assert!(levels.len() >= 2, "{name}");
            levels.iter().for_each(|l| l.scene.check().unwrap());
            assert_eq!(levels.last().unwrap().scene, s);
        }
    }
}
