//! Writes the files that the page asks for.

use super::{Worker, draw_on};
use crate::output;
use crate::render::{self, Control, Layers};
use crate::serve::session::{Save, SaveKind, chain};
use crate::sheet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

/// Panels of a sheet in a row, as `schlieren sheet` has them.
const COLUMNS: usize = 4;

impl Worker {
    pub(super) fn save(&mut self, save: Save) {
        let outcome = catch_unwind(AssertUnwindSafe(|| self.file(&save)));
        let result = outcome.unwrap_or_else(|_| {
            Err("rendering this scene panicked; please report it with the saved scene".into())
        });
        // The request may have ended.
        let _ = save.reply.send(result);
    }

    fn file(&mut self, save: &Save) -> Result<Vec<u8>, String> {
        let text = |e: &dyn std::error::Error| chain(e);
        self.prepare(&save.scene).map_err(|e| text(&e))?;
        if save.kind == SaveKind::Sheet {
            return self.sheet(save);
        }
        let start = Instant::now();
        let layers = match save.kind {
            SaveKind::Exr => Layers::ALL,
            // Measured as the shown image is, which may refine the march.
            _ => Layers { map: save.overlay.is_some(), accuracy: true, ..Layers::NONE },
        };
        // A change of the scene does not stop a requested file; the end of its request or of the
        // program does.
        let control = Control { cancel: &save.cancel, progress: &|_| {} };
        let mut rendered = self
            .with_section(false, |s| render::render(&save.scene, s, layers, &control))
            .and_then(|r| r)
            .map_err(|e| text(&e))?;
        let folder = tempfile::tempdir().map_err(|e| text(&e))?;
        let path = folder.path().join("image");
        match save.kind {
            SaveKind::Exr => {
                output::write_exr(&path, &rendered, &save.scene, start.elapsed().as_secs_f64())
            }
            _ => {
                if let Some(overlay) = save.overlay {
                    draw_on(&mut rendered, overlay);
                }
                output::write_png(&path, &rendered).map(|_| ())
            }
        }
        .map_err(|e| text(&e))?;
        std::fs::read(&path).map_err(|e| text(&e))
    }

    /// The flow by all techniques, in the present view and frame.
    fn sheet(&mut self, save: &Save) -> Result<Vec<u8>, String> {
        let mut scene = sheet::scene_of_sheet(save.scene.clone());
        let [w, h] = save.scene.film.size.map(f64::from);
        let pixels = |n: f64| ((sheet::PANEL_SIDE * n / w.max(h)).round() as u32).max(16);
        scene.film.size = [pixels(w), pixels(h)];
        let control = Control { cancel: &save.cancel, progress: &|_| {} };
        let sheet = self
            .with_section(false, |s| sheet::render_sheet(&scene, s, &control))
            .and_then(|s| s)
            .map_err(|e| chain(&e))?;
        if sheet.interrupted {
            return Err("the sheet was interrupted".into());
        }
        let canvas = sheet::compose(&sheet, &sheet::title(&scene, &sheet), COLUMNS);
        let folder = tempfile::tempdir().map_err(|e| chain(&e))?;
        let path = folder.path().join("sheet");
        output::write_canvas(&path, &canvas).map_err(|e| chain(&e))?;
        std::fs::read(&path).map_err(|e| chain(&e))
    }
}
