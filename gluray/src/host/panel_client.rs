//! The library's side of the control panel. Once per frame it takes commands and sends telemetry.
//!
//! The process has one link, created at the end of the first frame. Each context applies new
//! settings at the end of its own frame.

use crate::capture::draw::{Draw, Shading};
use crate::capture::geometry_cache::Geometry;
use crate::host::config::{self, Settings};
use crate::host::export::{Object, Scene, scenes_folder, write_scene};
use crate::host::panel::link::PanelCommand;
use crate::host::panel::{FrameStats, Hello, Link, ObjectInfo};
use crate::host::report::Report;
use rt_core::glam::DMat4;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Mutex, OnceLock, TryLockError};
use std::time::Instant;

/// Objects in a report, which is written often.
const IN_REPORT: usize = 100;

/// What is known between two frames.
#[derive(Default)]
pub(crate) struct FrameTelemetry {
    /// Counts at the last frame, for the difference.
    before: Report,
    frame_ended: Option<Instant>,
    /// Objects of this frame.
    objects: BTreeMap<u128, TracedObject>,
    /// Frame at which `GLURAY_DUMP` is written next.
    next_dump: u64,
    /// The answer to the panel's wish for the scene.
    exported: Option<Result<PathBuf, String>>,
    problem: Option<String>,
}

struct TracedObject {
    triangles: u64,
    calls: u64,
    color: [f32; 3],
}

static LINK: Mutex<Option<Link>> = Mutex::new(None);
/// The panel asked for the scene: the next frame with something traced in it writes it.
static EXPORT: AtomicBool = AtomicBool::new(false);

/// What settings and reports call a geometry.
pub(crate) fn key_of(geometry: &Geometry) -> String {
    // Half of the hash: enough to tell some thousand objects apart, and short enough to type.
    format!("{:016x}", geometry.key as u64)
}

impl FrameTelemetry {
    /// These draws are being traced.
    pub(crate) fn traced<'a>(&mut self, frame: u64, draws: impl Iterator<Item = &'a Draw> + Clone) {
        for d in draws.clone() {
            let seen = self.objects.entry(d.geometry.key).or_insert_with(|| TracedObject {
                triangles: 0,
                calls: 0,
                color: color(d, 0),
            });
            seen.triangles = d.geometry.mesh.num_triangles() as u64;
            seen.calls += d.calls;
        }
        let named = dump_file().filter(|_| frame >= self.next_dump);
        if named.is_none() && !EXPORT.load(Relaxed) {
            return;
        }
        let scene = scene(frame, draws);
        if let Some(file) = named {
            // Frames 1, 2, 4, 8…: in the end it is a late one, and writing costs little.
            self.next_dump = (2 * frame).max(1);
            self.problem = write_scene(file, &scene).err().map(|e| format!("GLURAY_DUMP: {e}"));
        }
        if EXPORT.swap(false, Relaxed) {
            self.exported = Some(write_to_scenes_folder(&scene));
        }
    }

    /// Somebody looks at what rays find: the panel, or the user in a file.
    pub(crate) fn is_watched() -> bool {
        let connected =
            || LINK.try_lock().is_ok_and(|l| l.as_ref().is_some_and(Link::is_connected));
        dump_file().is_some() || EXPORT.load(Relaxed) || connected()
    }

    /// What went wrong since it was asked last.
    pub(crate) fn take_problem(&mut self) -> Option<String> {
        self.problem.take()
    }

    /// A frame has ended; `report` counts since the context was made. The objects of the frame for
    /// the report, largest first.
    pub(crate) fn frame_done(&mut self, report: &Report, size: [u32; 2]) -> Vec<ObjectInfo> {
        let now = Instant::now();
        let took = self
            .frame_ended
            .replace(now)
            .map_or(0.0, |t| now.duration_since(t).as_secs_f64() * 1e3);
        let mut objects = self.take_objects();
        // Never waits: another thread talks to the panel just now, or did so when this process was
        // forked.
        let mut slot = match LINK.try_lock() {
            Ok(slot) => slot,
            Err(TryLockError::Poisoned(slot)) => slot.into_inner(),
            Err(TryLockError::WouldBlock) => {
                objects.truncate(IN_REPORT);
                return objects;
            }
        };
        let link = slot.get_or_insert_with(|| Link::new(hello()));
        let wish = link.poll();
        if link.is_connected() {
            link.objects(&objects);
            if let Some(outcome) = self.exported.take() {
                link.exported(outcome.as_deref().map_err(String::as_str));
            }
            // Between two frames in a row only: what was before the panel came is no frame.
            if self.before.frames + 1 == report.frames {
                let mut stats = between(&self.before, report);
                (stats.frame_ms, stats.size) = (took, size);
                link.frame(&stats);
            }
            self.before = report.clone();
        }
        drop(slot);
        match wish {
            None => {}
            Some(PanelCommand::Export) => EXPORT.store(true, Relaxed),
            Some(PanelCommand::Settings(settings)) => config::replace(*settings),
        }
        objects.truncate(IN_REPORT);
        objects
    }

    fn take_objects(&mut self) -> Vec<ObjectInfo> {
        let objects = std::mem::take(&mut self.objects);
        let mut list: Vec<ObjectInfo> = objects
            .into_iter()
            .map(|(key, s)| ObjectInfo {
                key: format!("{:016x}", key as u64),
                name: calls(s.calls),
                triangles: s.triangles,
                color: Some(s.color),
            })
            .collect();
        list.sort_by_key(|o| std::cmp::Reverse(o.triangles));
        list
    }
}

/// The file that `GLURAY_DUMP` names. Read once: the program may change its environment while we
/// look.
fn dump_file() -> Option<&'static Path> {
    static FILE: OnceLock<Option<PathBuf>> = OnceLock::new();
    FILE.get_or_init(|| crate::host::folders::variable("GLURAY_DUMP").map(PathBuf::from)).as_deref()
}

fn hello() -> Hello {
    let config = config::current();
    Hello {
        program: config::program_name(),
        process: std::process::id(),
        settings: Settings::clone(&config.settings),
        problems: config.problems.clone(),
        obeys: config::SUPPORTED_SETTINGS.iter().map(|p| (*p).to_owned()).collect(),
    }
}

/// What happened between two accounts of the same context.
fn between(before: &Report, now: &Report) -> FrameStats {
    fn less<V: Copy + PartialOrd + Default + std::ops::Sub<Output = V>>(
        now: &BTreeMap<String, V>,
        before: &BTreeMap<String, V>,
    ) -> BTreeMap<String, V> {
        let one =
            |(k, v): (&String, &V)| (k.clone(), *v - before.get(k).copied().unwrap_or_default());
        now.iter().map(one).filter(|(_, v)| *v > V::default()).collect()
    }
    FrameStats {
        frame: now.frames,
        phases_ms: less(&now.milliseconds, &before.milliseconds),
        rays: less(&now.rays, &before.rays),
        reasons: less(&now.passed_reasons, &before.passed_reasons),
        traced: now.traced_draws - before.traced_draws,
        passed: now.passed_draws - before.passed_draws,
        triangles: now.triangles - before.triangles,
        ..FrameStats::default()
    }
}

/// The colour that a vertex has before lights: OpenGL's diffuse one where lights decide.
fn color(d: &Draw, vertex: usize) -> [f32; 3] {
    let [r, g, b, _] = rgba(d, vertex);
    [r, g, b]
}

fn rgba(d: &Draw, vertex: usize) -> [f32; 4] {
    let follows_color = !d.state.lighting || d.state.color_material.is_some();
    match follows_color || d.attributes.materials.is_empty() {
        true => d.attributes.colors.at(vertex),
        false => d.attributes.materials_at(vertex)[0].diffuse,
    }
}

/// The draws as a scene in one frame for all of them: the viewer's axes, which OpenGL's fixed
/// function names; the first object's own axes where shaders only say how positions get to the
/// screen.
fn scene<'a>(frame: u64, draws: impl Iterator<Item = &'a Draw> + Clone) -> Scene {
    let clip = |d: &Draw| DMat4::from_cols_array(&d.clip_from_object.map(f64::from));
    let shaded = |d: &&Draw| matches!(d.shading, Shading::Program(_));
    let first = draws.clone().find(shaded).map(|d| clip(d).inverse());
    let space = match first {
        None => "the viewer's axes: x right, y up, z towards the viewer, in the program's unit",
        Some(_) => "the axes of the first object that a shader draws, in the program's unit",
    };
    let objects = draws
        .map(|d| object(d, first.filter(|_| shaded(&d)).map(|first| first * clip(d))))
        .collect();
    Scene { program: config::program_name(), frame, space: space.into(), objects }
}

fn object(d: &Draw, placed: Option<DMat4>) -> Object {
    let mesh = &d.geometry.mesh;
    let n = mesh.positions.len();
    let has_normals = d.state.lighting || placed.is_some();
    Object {
        key: key_of(&d.geometry),
        name: calls(d.calls),
        world_from_object: placed
            .map_or_else(|| d.state.model_view.map(f64::from), |m| m.to_cols_array()),
        color: rgba(d, 0),
        positions: mesh.positions.iter().map(|p| p.to_array()).collect(),
        indices: mesh.indices.clone(),
        normals: if has_normals {
            (0..n).map(|i| d.attributes.normals.at(i)).collect()
        } else {
            Vec::new()
        },
        colors: (0..n)
            .map(|i| rgba(d, i).map(|c| (255.0 * c.clamp(0.0, 1.0) + 0.5) as u8))
            .collect(),
    }
}

fn calls(n: u64) -> String {
    format!("{n} draw call{}", if n == 1 { "" } else { "s" })
}

fn write_to_scenes_folder(scene: &Scene) -> Result<PathBuf, String> {
    let folder = scenes_folder(crate::host::folders::variable)
        .ok_or("neither XDG_STATE_HOME nor HOME is set")?;
    std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let program: String =
        scene.program.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    let file = folder.join(format!("{program}-{}-{}.gluray", std::process::id(), scene.frame));
    write_scene(&file, scene).map_err(|e| e.to_string())?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_the_difference_of_two_accounts() {
        let counts = |n: u64| [("primary".to_owned(), 10 * n), ("shadow".to_owned(), 5)].into();
        let ms = |v: f64| [("trace".to_owned(), v)].into();
        let before = Report {
            frames: 3,
            traced_draws: 30,
            rays: counts(3),
            milliseconds: ms(1.5),
            ..Report::default()
        };
        let now = Report {
            frames: 4,
            traced_draws: 42,
            rays: counts(4),
            milliseconds: ms(4.0),
            ..Report::default()
        };
        let stats = between(&before, &now);
        assert_eq!((stats.frame, stats.traced, stats.phases_ms["trace"]), (4, 12, 2.5));
        assert_eq!(
            stats.rays,
            [("primary".to_owned(), 10)].into(),
            "kinds without rays are left out"
        );
    }
}
