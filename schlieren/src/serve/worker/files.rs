//! Writes the files that the page asks for.

use super::{Worker, draw_on};
use crate::output;
use crate::render::{self, Control, Layers};
use crate::serve::session::{Save, SaveKind, chain};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

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
}
