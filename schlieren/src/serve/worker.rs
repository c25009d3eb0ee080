//! The thread that renders: first a coarse image, then finer ones while nothing changes, then the
//! error of the march.
//!
//! ```text
//!            change                 change during 2…                 nothing changes
//!  requests ───┐                         ┐
//!  thread      └─ 1 coarse, never stopped └─ (stopped) 1 coarse ─ 2 … ─ samples × 4 … ─ finished ─ error measured
//! ```
//! The first image after a change is never stopped by the next change, so that continuous dragging
//! shows as many images as the machine can render. All others are stopped at once. Each image is
//! rendered from scratch, so the final one equals bit for bit what `schlieren render` makes of the
//! same scene. Because the number of photons grows by factors of four, this costs a third more than
//! accumulation would.

mod files;
mod levels;
mod next_step;

use super::deflection_map::DeflectionMap;
use super::filter_plane::{FilterPlane, legend_half_rad};
use super::flow::Flow;
use super::frame::{Frame, FrameInfo};
use super::legend::Legend;
use super::session::{Session, chain};
use crate::drawing::{Canvas, Overlay, draw_overlay};
use crate::film::Framing;
use crate::input::Outside;
use crate::path::PathQuantities;
use crate::render::{self, Control, Layers, Map, RenderError, RenderOutput, TestSection, framing};
use crate::scene::{Device, FlowSpec, MarchSpec, Scene, TechniqueSpec, ViewSpec};
use crate::solids::Solids;
use levels::{Level, dots, levels, wanted_samples};
use next_step::NextStep;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time that the first image after a change may take.
const INTERACTIVE_SECS: f64 = 0.06;
/// Upper and lower limit of the longest side of that image.
const INTERACTIVE_SIDES: [u32; 2] = [320, 64];
/// Time without a change before the error is measured, because measuring cannot be stopped.
const IDLE_TIME: Duration = Duration::from_millis(500);

/// The parts of a scene that determine deflections, and what is traced with them.
#[derive(Clone, PartialEq)]
struct Geometry {
    with: TracedWith,
    flow: FlowSpec,
    view: ViewSpec,
    wavelengths_nm: Vec<f64>,
    film: [f64; 6],
    march: MarchSpec,
}

impl Geometry {
    fn of(scene: &Scene) -> Geometry {
        let (f, n) = (&scene.film, f64::NEG_INFINITY);
        let [w, h] = f.size.map(f64::from);
        Geometry {
            with: TracedWith::of(scene),
            flow: scene.flow.clone(),
            view: scene.view.clone(),
            wavelengths_nm: scene.light.wavelengths_nm.clone(),
            film: [
                w,
                h,
                f.field_of_view_m.unwrap_or(n),
                f.center_m[0],
                f.center_m[1],
                scene.focus_m(),
            ],
            march: scene.march.clone(),
        }
    }
}

/// What a technique needs of rays besides their deflections.
#[derive(Clone, Copy, PartialEq)]
enum TracedWith {
    Nothing,
    /// The phase of fringes.
    Phase,
    /// The movement of the dots of a background, seen from the film.
    Dots,
}

impl TracedWith {
    fn of(scene: &Scene) -> TracedWith {
        match scene.technique {
            TechniqueSpec::Interferogram { .. } => TracedWith::Phase,
            TechniqueSpec::Bos { .. } => TracedWith::Dots,
            _ => TracedWith::Nothing,
        }
    }
}

/// Errors of deflections, measured once for each geometry.
#[derive(Clone, Copy, Default)]
struct Errors {
    march_rad: Option<f64>,
    resolution_rad: Option<f64>,
    mesh_rad: Option<f64>,
}

pub(super) struct Worker {
    session: Arc<Session>,
    /// The file read last.
    flow: Flow,
    /// The flow of a series' first step, the wavelength, and n0 - 1 for both.
    reference: Option<(FlowSpec, f64, f64)>,
    /// The test section for a flow and wavelengths, with a coarse one.
    section: Option<Section>,
    solids: Option<Solids>,
    traced: Option<(Geometry, Arc<DeflectionMap>)>,
    errors: Option<(Geometry, Errors)>,
    serial: u64,
    interactive_side: u32,
    /// The step that is read ahead, the one that was shown last, and whether it was before the one
    /// shown earlier.
    next: Option<NextStep>,
    step: Option<usize>,
    backwards: bool,
}

struct Section {
    flow: FlowSpec,
    wavelengths_nm: Vec<f64>,
    full: TestSection,
    coarse: Option<TestSection>,
    /// How differently the light of each wavelength is bent.
    dispersion: Vec<f64>,
}

impl Section {
    /// The section of a flow, without bodies.
    fn of(flow: &Flow, scene: &Scene) -> Result<Section, RenderError> {
        let mut full = flow.section(scene, None)?.with_caches();
        // Cells of a mesh have no coarse lattice.
        let coarse_fields: Option<Vec<_>> = match full.fields.is_empty() {
            true => None,
            false => full.fields.iter().map(super::flow::coarse).collect(),
        };
        let coarse = match coarse_fields {
            Some(fields) => Some(TestSection::of_fields(scene, fields, None)?.with_caches()),
            None => None,
        };
        full.warnings.extend(no_outside(scene, &full));
        let (flow, wavelengths_nm) = (scene.flow.clone(), scene.light.wavelengths_nm.clone());
        let dispersion = full.dispersion();
        Ok(Section { flow, wavelengths_nm, full, coarse, dispersion })
    }
}

impl Worker {
    pub(super) fn new(session: Arc<Session>, flow: Flow, solids: Option<Solids>) -> Worker {
        Worker {
            session,
            flow,
            reference: None,
            section: None,
            solids,
            traced: None,
            errors: None,
            serial: 0,
            interactive_side: INTERACTIVE_SIDES[0],
            next: None,
            step: None,
            backwards: false,
        }
    }

    /// Renders until the session stops.
    pub(super) fn run(mut self) {
        let mut finished = 0;
        loop {
            // Waits for work.
            let session = self.session.clone();
            let mut shared = session.lock();
            while !shared.stop && shared.saves.is_empty() && shared.generation == finished {
                shared =
                    session.wake.wait(shared).unwrap_or_else(std::sync::PoisonError::into_inner);
            }
            if shared.stop {
                return;
            }
            session.cancel.store(false, Ordering::Relaxed);
            let save = shared.saves.pop_front();
            let (scene, generation) = (shared.scene.clone(), shared.generation);
            let overlay = shared.overlay;
            drop(shared);

            match save {
                Some(save) => self.save(save),
                None => {
                    if self.draw(&scene, overlay, generation) {
                        finished = generation;
                    }
                }
            }
        }
    }

    /// Renders all images of a scene. False when stopped before the last.
    fn draw(&mut self, scene: &Scene, overlay: Option<Overlay>, generation: u64) -> bool {
        let session = self.session.clone();
        // A panic must not leave the page waiting forever.
        let outcome =
            catch_unwind(AssertUnwindSafe(|| self.draw_levels(scene, overlay, generation)));
        let error = match outcome {
            Ok(Ok(done)) => return done,
            Ok(Err(RenderError::Cancelled)) => return false,
            Ok(Err(e)) => chain(&e),
            Err(panic) => {
                self.section = None;
                let text = panic.downcast_ref::<String>().cloned();
                let text = text.or_else(|| panic.downcast_ref::<&str>().map(ToString::to_string));
                format!(
                    "rendering this scene panicked ({}); please report it with the saved scene",
                    text.unwrap_or_default()
                )
            }
        };
        self.serial += 1;
        let info = FrameInfo {
            serial: self.serial,
            generation,
            finished: true,
            error: Some(error),
            ..FrameInfo::default()
        };
        session.publish(Frame::new(info, None, None, None, None));
        true
    }

    fn draw_levels(
        &mut self,
        scene: &Scene,
        overlay: Option<Overlay>,
        generation: u64,
    ) -> Result<bool, RenderError> {
        self.prepare(scene)?;
        if self.session.lock().scene.film.size != scene.film.size {
            // The frame has just been fitted to the flow.
            return Ok(false);
        }
        let dots = self.with_section(false, |s| dots(scene, s))?;
        let levels = levels(scene, self.interactive_side).into_iter().map(|l| l.with_dots(&dots));
        let levels: Vec<Level> = levels.collect();
        let last = levels.len() - 1;
        let geometry = Geometry::of(scene);
        let mut last_frame = None;
        for (i, level) in levels.into_iter().enumerate() {
            let start = Instant::now();
            let rendered = self.render(&level, overlay)?;
            let elapsed_secs = start.elapsed().as_secs_f64();
            if i == 0 && last > 0 {
                self.adapt(elapsed_secs, scene);
            }
            let traced = self.traced(&level, &geometry)?;
            let info = FrameInfo {
                generation,
                finished: false,
                samples: level.samples,
                samples_wanted: wanted_samples(scene),
                elapsed_secs,
                draft: level.draft,
                ..FrameInfo::default()
            };
            let complete = i == last && self.errors_known(&geometry).is_some();
            self.publish(
                scene,
                FrameInfo { finished: complete, ..info.clone() },
                &rendered,
                &traced,
            )?;
            last_frame = Some((info, rendered, traced));
            // A device draws while the CPU reads.
            if i == last || !level.draft && scene.march.device != Device::Cpu {
                self.read_ahead(scene);
            }
            if i < last && self.session.cancel.load(Ordering::Relaxed) {
                return Ok(false);
            }
        }

        // Measures the error of the march once nothing changes any more.
        if self.errors_known(&geometry).is_some() {
            return Ok(true);
        }
        let end = Instant::now() + IDLE_TIME;
        while Instant::now() < end {
            if self.session.cancel.load(Ordering::Relaxed) {
                return Ok(false);
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        self.measure(scene, &geometry)?;
        if let Some((info, rendered, traced)) = last_frame {
            self.publish(scene, FrameInfo { finished: true, ..info }, &rendered, &traced)?;
        }
        Ok(true)
    }

    /// Prepares the test section of a scene.
    fn prepare(&mut self, scene: &Scene) -> Result<(), RenderError> {
        let fits =
            |s: &Section| s.flow == scene.flow && s.wavelengths_nm == scene.light.wavelengths_nm;
        if !self.section.as_ref().is_some_and(fits) {
            if let Some(old) = self.section.take() {
                self.solids = old.full.solids;
            }
            let mut of_series = scene.clone();
            of_series.flow.reference_n_minus_1 = self.reference_n_minus_1(scene)?;
            let read = self.next.take().and_then(|next| next.take(&of_series));
            // Bodies stay in `self.solids` until nothing can fail any more.
            let mut section = match read {
                Some((flow, section)) => {
                    self.flow = flow;
                    section
                }
                None => {
                    if self.flow.file != scene.flow.file {
                        self.flow = Flow::open(&scene.flow.file, &scene.flow.open_options())?;
                    }
                    Section::of(&self.flow, &of_series)?
                }
            };
            section.flow = scene.flow.clone();
            section.full.solids = self.solids.take();
            self.session.found_size(section.full.size_m());
            self.section = Some(section);
        }
        if let Some(s) = &mut self.section {
            let view = scene.view.direction.view(s.full.centre_m())?;
            s.full.view = view;
            if let Some(coarse) = &mut s.coarse {
                coarse.view = view;
            }
        }
        Ok(())
    }

    /// The n0 - 1 that all times of a scene are relative to: that around the first step, so that
    /// images can be compared.
    fn reference_n_minus_1(&mut self, scene: &Scene) -> Result<Option<f64>, RenderError> {
        if !self.session.is_later(scene) {
            return Ok(scene.flow.reference_n_minus_1);
        }
        let mut first = scene.clone();
        first.flow.file.clone_from(&self.session.steps[0].path);
        let wavelength_nm = scene.light.wavelengths_nm[0];
        let known = self.reference.as_ref().filter(|r| r.0 == first.flow && r.1 == wavelength_nm);
        let n_minus_1 = match known {
            Some((_, _, n_minus_1)) => *n_minus_1,
            None => Flow::open(&first.flow.file, &first.flow.open_options())?
                .reference_n_minus_1(&first)?,
        };
        self.reference = Some((first.flow, wavelength_nm, n_minus_1));
        self.session.lock().reference = Some((scene.flow.clone(), n_minus_1));
        Ok(Some(n_minus_1))
    }

    /// Calls `with` with the full or the coarse section. The full section owns the bodies, and the
    /// coarse one borrows them during the call.
    fn with_section<T>(
        &mut self,
        coarse: bool,
        with: impl FnOnce(&TestSection) -> T,
    ) -> Result<T, RenderError> {
        let Some(s) = &mut self.section else { return Err(RenderError::Cancelled) };
        match s.coarse.as_mut().filter(|_| coarse) {
            Some(coarse) => {
                coarse.solids = s.full.solids.take();
                let result = catch_unwind(AssertUnwindSafe(|| with(coarse)));
                s.full.solids = coarse.solids.take();
                result.map_err(|panic| std::panic::resume_unwind(panic))
            }
            None => Ok(with(&s.full)),
        }
    }

    /// Renders a level. Vectors are drawn when the image is no draft, as `schlieren render` draws
    /// them: on a coarse image arrows would jump.
    fn render(
        &mut self,
        level: &Level,
        overlay: Option<Overlay>,
    ) -> Result<RenderOutput, RenderError> {
        static NEVER: AtomicBool = AtomicBool::new(false);
        let session = self.session.clone();
        let control = Control {
            cancel: if level.stoppable { &session.cancel } else { &NEVER },
            progress: &|_| {},
        };
        let overlay = overlay.filter(|_| !level.draft);
        let layers =
            Layers { noise: true, accuracy: !level.draft, map: overlay.is_some(), ..Layers::NONE };
        let mut rendered = self
            .with_section(level.coarse, |s| render::render(&level.scene, s, layers, &control))??;
        if let Some(overlay) = overlay {
            draw_on(&mut rendered, overlay);
        }
        Ok(rendered)
    }

    /// Deflections of the scene itself where they are known, otherwise of this level.
    fn traced(
        &mut self,
        level: &Level,
        geometry: &Geometry,
    ) -> Result<Arc<DeflectionMap>, RenderError> {
        if let Some((g, t)) = &self.traced
            && g == geometry
        {
            return Ok(t.clone());
        }
        let (scene, draft) = (&level.scene, level.draft);
        let traced = self.with_section(level.coarse, |section| {
            let opd = geometry.with == TracedWith::Phase;
            let from_film = geometry.with == TracedWith::Dots;
            let quantities = PathQuantities { opd };
            let planned = section.paths(scene, 0, quantities, from_film, !draft)?;
            let framing = framing(scene, section);
            let blocked = |s: &crate::path::Start| {
                section.solids.as_ref().is_some_and(|b| b.block(&section.view, s))
            };
            let wavelength_m = scene.light.wavelengths_nm[0] * 1e-9;
            let n0 = section.n0(0);
            let mut map: Map = render::map::map(
                &*planned.paths,
                &scene.optics(),
                &framing,
                wavelength_m,
                n0,
                blocked,
                &AtomicBool::new(false),
            )
            .ok_or(RenderError::Cancelled)?;
            if from_film {
                let (shifts_m, transmission) = (&map.displacement_m, &map.transmission);
                map.apparent_m = render::apparent_displacements(&framing, shifts_m, transmission);
            }
            Ok::<_, RenderError>(Arc::new(DeflectionMap::new(map, framing, from_film)))
        })??;
        if !level.draft {
            self.traced = Some((geometry.clone(), traced.clone()));
        }
        Ok(traced)
    }

    fn errors_known(&self, geometry: &Geometry) -> Option<Errors> {
        self.errors.as_ref().filter(|e| e.0 == *geometry).map(|e| e.1)
    }

    fn measure(&mut self, scene: &Scene, geometry: &Geometry) -> Result<(), RenderError> {
        let errors = self.with_section(false, |section| {
            let planned = section.paths(scene, 0, PathQuantities { opd: false }, false, true)?;
            Ok::<_, RenderError>(Errors {
                march_rad: planned.error_rad,
                resolution_rad: planned.resolution_error_rad,
                mesh_rad: planned.mesh_error_rad,
            })
        })??;
        self.errors = Some((geometry.clone(), errors));
        Ok(())
    }

    fn publish(
        &mut self,
        scene: &Scene,
        info: FrameInfo,
        rendered: &RenderOutput,
        traced: &Arc<DeflectionMap>,
    ) -> Result<(), RenderError> {
        let filter = FilterPlane::new(scene, Some(traced))?;
        // Drafts keep the legend that is shown.
        let legend = match info.draft {
            true => None,
            false => {
                let section = self.section.as_ref();
                let dispersion = section.map_or(&[][..], |s| &s.dispersion);
                Legend::new(scene, legend_half_rad(scene, traced), dispersion)?
            }
        };
        let (mut axes, mut flow_center_m, mut whole_width_m) = ([[0.0; 3]; 3], [0.0; 3], 0.0);
        if let Some(Section { full, .. }) = &self.section {
            let view = &full.view;
            axes = [view.right, view.up, view.forward].map(|a| a.to_array());
            flow_center_m = view.centre_m.to_array();
            let [width, height] = scene.film.size;
            let all = Framing::fitted(width, height, full.sides_m());
            whole_width_m = all.pixel_m * f64::from(width);
        }
        self.serial += 1;
        let r = &rendered.report;
        let errors = self.errors_known(&Geometry::of(scene));
        let noise = rendered.noise.as_ref().filter(|n| !n.is_empty());
        let squares =
            |n: &Vec<f32>| n.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / n.len() as f64;
        let info = FrameInfo {
            serial: self.serial,
            rays: r.counters.rays,
            noise_rms: noise.map(|n| squares(n).sqrt()),
            noise_max: noise.map(|n| f64::from(n.iter().fold(0.0f32, |m, v| m.max(*v)))),
            deflection_error_rad: errors.and_then(|e| e.march_rad),
            resolution_error_rad: errors.and_then(|e| e.resolution_rad),
            mesh_error_rad: errors.and_then(|e| e.mesh_rad),
            largest_deflection_rad: Some(traced.map.largest_deflection_rad),
            march: r.march.clone(),
            levels: r.levels,
            warnings: r.warnings.clone(),
            focal_length_m: scene.optics().schlieren_focal_length_m,
            axes,
            flow_center_m,
            whole_width_m,
            film_size: scene.film.size,
            ..info
        };
        let traced = Some(traced.clone());
        let frame = Frame::new(info, Some(rendered), Some(&filter), legend.as_ref(), traced);
        self.session.publish(frame);
        Ok(())
    }

    /// Adapts the size of the first image to the speed of the machine.
    fn adapt(&mut self, elapsed_secs: f64, scene: &Scene) {
        let factor = (INTERACTIVE_SECS / elapsed_secs.max(1e-4)).sqrt().clamp(0.5, 1.3);
        let largest = scene.film.size[0].max(scene.film.size[1]).min(INTERACTIVE_SIDES[0]);
        let side = f64::from(self.interactive_side) * factor;
        self.interactive_side = (side as u32).min(largest).max(INTERACTIVE_SIDES[1]);
    }
}

/// Draws vectors on a rendered image, where it has a map.
fn draw_on(rendered: &mut RenderOutput, overlay: Overlay) {
    let Some(map) = &rendered.map else { return };
    let [width, height] = [rendered.framing.width, rendered.framing.height].map(|n| n as usize);
    let mut canvas = Canvas { width, height, pixels: std::mem::take(&mut rendered.pixels) };
    draw_overlay(&mut canvas, map, overlay);
    rendered.pixels = canvas.pixels;
    rendered.colored = true;
}

/// The warning about a choice for the outside of a mesh that nothing is outside of.
fn no_outside(scene: &Scene, section: &TestSection) -> Option<String> {
    let nothing = section.input.as_ref().is_some_and(|i| i.outside.is_none());
    (nothing && scene.flow.outside != Outside::Auto).then(|| {
        "flow.outside has no effect: no place of the lattice is outside the flow's mesh".to_owned()
    })
}
