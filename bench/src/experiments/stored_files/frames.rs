//! Frames of what is stored.

use super::{Context, Sizes};
use crate::clock::Clock;
use crate::image::framing::Framing;
use crate::record::{Record, Row};
use crate::runner::{Schedule, Variant, interleave};
use datasets::view::View;
use rt_core::bvh::{BuildOptions, Geometry, Instance, PageUse, World};
use rt_core::camera::Camera;
use rt_core::effects::Effects;
use rt_core::glam::DAffine3;
use rt_core::render::{RenderOptions, RenderOutput, render};
use rt_core::scene::{Scene, SceneBuilder};
use rt_core::shapes::Shape;
use rt_core::volume::Volume;
use std::cell::RefCell;
use std::sync::Arc;
use std::time::Instant;

/// A scene, and how long its tree took.
pub(super) struct Pictured {
    scene: Scene,
    effects: Effects,
    tree_secs: Option<f64>,
}

impl Pictured {
    pub(super) fn shape(shape: Arc<dyn Shape>) -> anyhow::Result<Pictured> {
        let start = Instant::now();
        let placed = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
        let geometry = vec![Geometry::Shape(shape)];
        let scene = Scene::new(World::build(geometry, vec![placed], &BuildOptions::default())?);
        let tree_secs = Some(start.elapsed().as_secs_f64());
        Ok(Pictured { scene, effects: Effects::NONE, tree_secs })
    }

    pub(super) fn medium(volume: Arc<Volume>) -> anyhow::Result<Pictured> {
        let mut scene = SceneBuilder::new();
        scene.volume(volume);
        Ok(Pictured { scene: scene.build()?, effects: Effects::VOLUMES, tree_secs: None })
    }

    pub(super) fn cameras(
        &self,
        views: &[View],
        sizes: &Sizes,
    ) -> anyhow::Result<Vec<(String, Camera)>> {
        let camera = |view: &View| {
            let camera = Framing::At(view.clone()).of_scene(&self.scene, [sizes.pixels; 2])?;
            Ok((view.name.clone(), camera))
        };
        views.iter().map(camera).collect()
    }
}

/// What is measured, with what its rows have in common.
pub(super) struct Timed<'a> {
    pub(super) pictured: &'a Pictured,
    pub(super) row: Row,
    /// Whether its pictures should be those of the first of all.
    pub(super) repeats: bool,
    /// What of a file is in memory.
    pub(super) used: Option<&'a dyn Fn() -> PageUse>,
}

/// Frames of all views of all of them in turns, after a first one of each.
pub(super) fn frames(
    context: &mut Context<'_>,
    record: &mut Record,
    sizes: &Sizes,
    all: &[Timed<'_>],
    cameras: &[(String, Camera)],
) -> anyhow::Result<()> {
    let failed: RefCell<Option<anyhow::Error>> = RefCell::new(None);
    let (mut rows, mut variants, mut pictures) = (vec![], vec![], vec![]);
    for (timed, (name, camera)) in all.iter().flat_map(|t| cameras.iter().map(move |c| (t, c))) {
        context.report_step(format!("first frame of {name}"))?;
        let (scene, effects) = (&timed.pictured.scene, Some(timed.pictured.effects));
        // A ray through a medium goes through all of it: a sixteenth of them takes long enough.
        let is_medium = timed.pictured.effects.contains(Effects::VOLUMES);
        let pixels = if is_medium { sizes.pixels / 4 } else { sizes.pixels };
        let options = RenderOptions { effects, ..RenderOptions::new(pixels, pixels) };
        let covered =
            |output: &RenderOutput| output.frame.color.iter().filter(|c| c[3] > 0.0).count() as u64;
        let start = Instant::now();
        let output = render(scene, camera, &options)?;
        let first_secs = start.elapsed().as_secs_f64();
        let mut row = timed
            .row
            .clone()
            .with("view", name.as_str())
            .with("first_frame", first_secs)
            .with("covered", covered(&output));
        if let Some(secs) = timed.pictured.tree_secs {
            row = row.with("tree", secs * 1e3);
        }
        if let Some(pages) = timed.used.map(|used| used()) {
            row = row.with("reads", pages.reads).with("in_memory", pages.peak as f64 / 1e6);
        }
        if timed.repeats {
            let first: &Vec<[f32; 4]> = &pictures[rows.len() % cameras.len()];
            let pairs = first.iter().zip(&output.frame.color);
            let differ = pairs.filter(|(a, b)| a.map(f32::to_bits) != b.map(f32::to_bits)).count();
            row = row.with("differs", differ as u64);
        }
        pictures.push(output.frame.color);
        rows.push(row);
        let failed = &failed;
        variants.push(Variant::new(name.clone(), move || match render(scene, camera, &options) {
            Ok(output) => covered(&output),
            Err(e) => {
                failed.borrow_mut().get_or_insert(e.into());
                0
            }
        }));
    }
    context.report_step("frames in turns")?;
    let timings = interleave(&context.schedule(Schedule::all_threads(), 4.0), &mut variants)?;
    drop(variants);
    if let Some(error) = failed.into_inner() {
        return Err(error);
    }
    for (timed, row) in timings.variants.iter().zip(rows) {
        let wall = timed.summary(Clock::Wall);
        record.rows.push(
            row.with("time", wall.median * 1e3)
                .with("time_low", wall.low * 1e3)
                .with("time_high", wall.high * 1e3)
                .with("rate", 1.0 / wall.median),
        );
    }
    Ok(())
}
