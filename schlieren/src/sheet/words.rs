//! What a sheet takes of a scene, and its title.

use super::Sheet;
use crate::drawing::in_unit;
use crate::scene::Scene;

/// Longest side of a panel, in pixels, unless it is chosen.
pub(crate) const PANEL_SIDE: f64 = 320.0;

/// The flow, view, bodies and march of a scene, and its frame apart from the pixels. What belongs
/// to one technique is chosen for each panel.
pub(crate) fn scene_of_sheet(from: Scene) -> Scene {
    let mut s = Scene {
        flow: from.flow,
        view: from.view,
        march: from.march,
        solids: from.solids,
        media: from.media,
        ..Scene::default()
    };
    s.film.field_of_view_m = from.film.field_of_view_m;
    s.film.center_m = from.film.center_m;
    s.light.wavelengths_nm = from.light.wavelengths_nm;
    s
}

/// Why a scene has no sheet. `wavelengths` says where they are chosen.
pub(crate) fn refusal(scene: &Scene, wavelengths: &str) -> Option<String> {
    if scene.media.emission.is_some() || scene.media.rotation.is_some() {
        return Some(
            "media.emission and media.rotation of the scene are not in the panels of a sheet; \
             omit them, or use `schlieren render`"
                .into(),
        );
    }
    let several = scene.light.wavelengths_nm.len() > 1;
    several.then(|| format!("a sheet is of one wavelength; {wavelengths}"))
}

/// The file, the view and the size of the picture.
pub(crate) fn title(scene: &Scene, sheet: &Sheet) -> String {
    let name = scene.flow.file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let width_m = f64::from(sheet.framing.width) * sheet.framing.pixel_m;
    format!("{name}, light along {}, {} wide", scene.view.direction, in_unit(width_m, "m"))
}
