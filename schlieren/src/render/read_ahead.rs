//! Reads the flow of the next image while this one is drawn, and keeps the flow where the next
//! image has the same.

use super::{RenderError, TestSection};
use crate::scene::{FlowSpec, MediaSpec, Scene, SolidsSpec};
use datasets::free_memory::available_bytes;
use std::path::Path;
use std::thread::JoinHandle;
use std::time::SystemTime;

/// Memory that a flow may take beside the one that is drawn, its splines included, as a multiple of
/// its lattice.
const TIMES_ITS_LATTICE: u64 = 4;
/// Memory that a mesh may take for light through its cells, as a multiple of its file: points,
/// polynomials, and faces, in double precision.
const TIMES_ITS_FILE: u64 = 20;

/// The test sections of several images in turn: times of a series, or one flow in several scenes.
///
/// ```no_run
/// # use schlieren::{render::{Control, Layers, ReadAhead, render}, scene::Scene};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let scenes: Vec<Scene> = vec![];
/// let mut sections = ReadAhead::default();
/// for (i, scene) in scenes.iter().enumerate() {
///     let section = sections.open(scene, |_| ())?;
///     if let Some(next) = scenes.get(i + 1) {
///         sections.begin(next, scene, &section);
///     }
///     let image = render(scene, &section, Layers::NONE, &Control::default())?;
///     sections.give_back(scene, section);
/// }
/// # Ok(()) }
/// ```
#[derive(Default)]
pub struct ReadAhead {
    /// The section of the image before.
    kept: Option<(Contents, TestSection)>,
    next: Option<Begun>,
}

/// A section that is being read.
struct Begun {
    contents: Contents,
    stamp: FileStamp,
    thread: JoinHandle<Result<TestSection, RenderError>>,
}

/// When a flow was written, and its length: that of its file, or of the file or folder that has it
/// as one of several times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FileStamp(Option<(Option<SystemTime>, u64)>);

impl FileStamp {
    pub(crate) fn of(path: &Path) -> FileStamp {
        let found = path.ancestors().find_map(|p| std::fs::metadata(p).ok());
        FileStamp(found.map(|m| (m.modified().ok(), m.len())))
    }
}

/// What a test section is read from.
#[derive(Debug, Clone, PartialEq)]
struct Contents {
    flow: FlowSpec,
    wavelengths_nm: Vec<f64>,
    solids: SolidsSpec,
    media: MediaSpec,
}

impl Contents {
    fn of(scene: &Scene) -> Contents {
        Contents {
            flow: scene.flow.clone(),
            wavelengths_nm: scene.light.wavelengths_nm.clone(),
            solids: scene.solids.clone(),
            media: scene.media.clone(),
        }
    }
}

impl ReadAhead {
    /// The test section of a scene: the one that was given back, if it is the same, or the one that
    /// was begun, or else read now as by [`TestSection::open`]. What could not be read before, and
    /// what has been written since, is read now.
    ///
    /// # Errors
    /// As [`TestSection::open`].
    pub fn open(
        &mut self,
        scene: &Scene,
        read: impl FnMut(&str),
    ) -> Result<TestSection, RenderError> {
        let contents = Contents::of(scene);
        let kept = self.kept.take().filter(|k| k.0 == contents);
        let next = self.next.take_if(|n| n.contents == contents);
        let next = next.filter(|n| n.stamp == FileStamp::of(&scene.flow.file));
        let ready = || next.and_then(|n| n.thread.join().ok()?.ok());
        let mut section = match kept.map(|k| k.1).or_else(ready) {
            Some(section) => section,
            None => TestSection::open(scene, read)?.with_caches(),
        };
        section.view = scene.view.direction.view(section.centre_m())?;
        Ok(section)
    }

    /// Reads the section of the next scene on a thread of its own, computes its splines, and copies
    /// it to the device if the scene wants one. Does nothing if the section that is being drawn
    /// will serve again, or if the memory that is free might not hold both.
    pub fn begin(&mut self, next: &Scene, drawn: &Scene, section: &TestSection) {
        let contents = Contents::of(next);
        let is_known = |known: &Contents| *known == contents;
        if is_known(&Contents::of(drawn))
            || self.next.as_ref().is_some_and(|n| is_known(&n.contents))
        {
            return;
        }
        let stamp = FileStamp::of(&next.flow.file);
        if !has_room_beside(section, stamp) {
            return;
        }
        let scene = next.clone();
        let thread = std::thread::spawn(move || {
            let section = TestSection::open(&scene, |_| ())?.with_caches();
            section.prepare(&scene);
            Ok(section)
        });
        self.next = Some(Begun { contents, stamp, thread });
    }

    /// Keeps the section of a scene that was drawn, in case that the next scene has the same.
    pub fn give_back(&mut self, scene: &Scene, section: TestSection) {
        self.kept = Some((Contents::of(scene), section));
    }
}

/// Whether the memory that is free will hold another section of this size, with its splines, that
/// is read from a file.
pub(crate) fn has_room_beside(section: &TestSection, next: FileStamp) -> bool {
    let lattice = section.fields.iter().map(|f| f.memory_bytes() as u64).sum::<u64>();
    let file = next.0.map_or(0, |(_, length)| length);
    let of_cells = if section.cells.is_empty() { 0 } else { TIMES_ITS_FILE.saturating_mul(file) };
    let need = TIMES_ITS_LATTICE.saturating_mul(lattice).max(of_cells);
    available_bytes().is_none_or(|free| free >= need)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::{Control, Layers, render};
    use std::fmt::Write as _;
    use std::path::PathBuf;

    /// A density in waves over a lattice of so many nodes along each axis.
    fn write_flow(folder: &Path, name: &str, amplitude: f64) -> PathBuf {
        let path = folder.join(name);
        let mut text = String::from(
            "# vtk DataFile Version 3.0\nwaves\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 9 9 \
             9\nORIGIN 0 0 0\nSPACING 0.01 0.01 0.01\nPOINT_DATA 729\nSCALARS rho \
             double\nLOOKUP_TABLE default\n",
        );
        for i in 0..729 {
            let wave = (0.9 * f64::from(i % 9) + 0.4 * f64::from(i / 9 % 9)).sin();
            writeln!(text, "{}", 1.2 + amplitude * wave).unwrap();
        }
        std::fs::write(&path, text).unwrap();
        path
    }

    /// The images are those of sections that are read one by one, and a flow is read once.
    #[test]
    fn sections_that_are_read_ahead_or_kept_make_the_same_images() {
        let folder = tempfile::tempdir().unwrap();
        let files =
            [("weak.vtk", 0.1), ("strong.vtk", 0.3)].map(|(n, a)| write_flow(folder.path(), n, a));
        let scene = |n: usize, view: &str| {
            let toml = format!(
                "[flow]\nfile = {:?}\ndensity = \"rho\"\n[view]\ndirection = \
                 \"{view}\"\n[film]\nsize = [12, 9]\n",
                files[n]
            );
            Scene::from_toml(&toml).unwrap()
        };
        let scenes = [scene(0, "z"), scene(0, "x"), scene(1, "x"), scene(0, "z"), scene(0, "z")];
        let mut sections = ReadAhead::default();
        let mut read = 0;
        for (i, scene) in scenes.iter().enumerate() {
            let section = sections.open(scene, |_| read += 1).unwrap();
            if let Some(next) = scenes.get(i + 1) {
                sections.begin(next, scene, &section);
                // Also when asked twice.
                sections.begin(next, scene, &section);
            }
            let image = |section: &TestSection| {
                render(scene, section, Layers::NONE, &Control::default()).unwrap().pixels
            };
            let alone = TestSection::open(scene, |_| ()).unwrap();
            assert_eq!(image(&section), image(&alone), "image {i}");
            sections.give_back(scene, section);
        }
        assert_eq!(read, 1, "flows that were read while nothing was drawn");
    }

    #[test]
    fn a_flow_that_cannot_be_read_ahead_is_an_error_when_it_is_opened() {
        let folder = tempfile::tempdir().unwrap();
        let good = write_flow(folder.path(), "good.vtk", 0.1);
        let scene = |file: &Path| {
            let toml = format!("[flow]\nfile = {file:?}\ndensity = \"rho\"\n");
            Scene::from_toml(&toml).unwrap()
        };
        let (good, missing) = (scene(&good), scene(&folder.path().join("missing.vtk")));
        let mut sections = ReadAhead::default();
        let section = sections.open(&good, |_| ()).unwrap();
        sections.begin(&missing, &good, &section);
        let error = sections.open(&missing, |_| ()).err().expect("there is no such file");
        assert!(error.to_string().contains("missing.vtk"), "{error}");
        assert!(sections.open(&good, |_| ()).is_ok());
    }
}
