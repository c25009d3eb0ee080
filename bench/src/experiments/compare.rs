//! Times tracers on the same rays.

use crate::baselines::{Tracer, closest_all, count_hits, count_occluded, occluded_all};
use crate::meshes::MeshScene;
use crate::rays::{self, HitBlock, RaySet, View};
use crate::record::{Record, Row};
use crate::runner::{Schedule, Timings, Unstable, Variant, interleave};
use std::cell::RefCell;
use std::time::Instant;

/// Purpose of rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Primary,
    Shadow,
    ShadowFromLight,
    AmbientOcclusion,
    Incoherent,
}

impl Kind {
    pub(super) const ALL: [Kind; 5] = [
        Kind::Primary,
        Kind::Shadow,
        Kind::ShadowFromLight,
        Kind::AmbientOcclusion,
        Kind::Incoherent,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Kind::Primary => "primary",
            Kind::Shadow => "shadow",
            Kind::ShadowFromLight => "shadow, from the light",
            Kind::AmbientOcclusion => "ambient occlusion",
            Kind::Incoherent => "incoherent",
        }
    }

    /// Whether the rays only test for occlusion.
    pub(super) fn occlusion(self) -> bool {
        matches!(self, Kind::Shadow | Kind::ShadowFromLight | Kind::AmbientOcclusion)
    }

    /// Whether neighbouring rays have similar directions.
    pub(super) fn coherent(self) -> bool {
        matches!(self, Kind::Primary | Kind::Shadow | Kind::ShadowFromLight)
    }
}

/// Generates the rays of a kind for a view of `size` x `size` pixels; `tracer` finds the surface on
/// which they start.
pub(super) fn make_rays(
    scene: &MeshScene,
    view: &View,
    size: u32,
    kinds: &[Kind],
    tracer: &dyn Tracer,
) -> Vec<(Kind, RaySet)> {
    let primary = view.primary(size);
    let mut hits = vec![HitBlock::MISS; primary.blocks.len()];
    closest_all(tracer, &primary, &mut hits, 0);
    let points = rays::surface_points(|i, p| scene.corners(i, p), &primary, &hits, view.radius);
    let make = |kind: Kind| match kind {
        Kind::Primary => primary.clone(),
        Kind::Shadow => rays::shadow(&points, view.light()),
        Kind::ShadowFromLight => rays::shadow_from_light(&points, view.light()),
        Kind::AmbientOcclusion => rays::ambient_occlusion(&points),
        Kind::Incoherent => rays::incoherent(scene.bounds(), (size * size) as usize),
    };
    kinds.iter().map(|&k| (k, make(k))).collect()
}

/// One of the tracers compared.
pub(super) struct Contender<'a> {
    /// Name of the tracer with its build. For baselines, the best mode is compared.
    pub(super) tracer_name: String,
    /// The entry point or packet width.
    pub(super) mode: String,
    pub(super) tracer: Box<dyn Tracer + 'a>,
}

impl Contender<'_> {
    pub(super) fn name(&self) -> String {
        format!("{}, {}", self.tracer_name, self.mode)
    }
}

/// Traces `rays` with all contenders in alternation, on one thread.
pub(super) fn time(
    schedule: &Schedule,
    kind: Kind,
    rays: &RaySet,
    contenders: &[Contender<'_>],
) -> Result<Timings, Unstable> {
    // One buffer for all contenders, so that the cache state is equal.
    let hits = RefCell::new(vec![HitBlock::MISS; rays.blocks.len()]);
    let masks = RefCell::new(vec![0u16; rays.blocks.len()]);
    let mut variants: Vec<Variant<'_>> = contenders
        .iter()
        .map(|c| {
            let tracer = &*c.tracer;
            let (hits, masks) = (&hits, &masks);
            if kind.occlusion() {
                let run = move || occluded_all(tracer, rays, &mut masks.borrow_mut(), 1);
                Variant::checked(c.name(), run, move || count_occluded(&masks.borrow()))
            } else {
                let run = move || closest_all(tracer, rays, &mut hits.borrow_mut(), 1);
                Variant::checked(c.name(), run, move || count_hits(rays, &hits.borrow()))
            }
        })
        .collect();
    interleave(schedule, &mut variants)
}

/// About 2^-k of the rays, for the smallest k with which `contender` needs at most `seconds`. Among
/// slivers a ray takes a hundred times as long as elsewhere.
pub(super) fn limited(rays: RaySet, kind: Kind, contender: &Contender<'_>, seconds: f64) -> RaySet {
    const SAMPLE: usize = 1 << 13;
    let sample = rays.clone().thinned(SAMPLE);
    let mut hits = vec![HitBlock::MISS; sample.blocks.len()];
    let mut masks = vec![0u16; sample.blocks.len()];
    let start = Instant::now();
    if kind.occlusion() {
        occluded_all(&*contender.tracer, &sample, &mut masks, 1);
    } else {
        closest_all(&*contender.tracer, &sample, &mut hits, 1);
    }
    let per_ray = start.elapsed().as_secs_f64() / sample.len.max(1) as f64;
    let mut limit = rays.len;
    while limit > SAMPLE && per_ray * limit as f64 > seconds {
        limit /= 2;
    }
    rays.thinned(limit)
}

/// Describes the columns that [`rows`] fills.
pub(super) fn explain_columns(record: &mut Record) {
    record.column("mesh", "", "name of the mesh");
    record.column("triangles", "", "triangles of the mesh");
    record.column("view", "", "orbit: the whole mesh; close: nearly every pixel shows it");
    record.column("rays", "", "what the rays are for");
    record.column("count", "", "number of rays");
    record.column("tracer", "", "tracer, with build and edge behaviour");
    record.column("mode", "", "how the rays were sent");
    record.column("simd", "", "widest instructions allowed");
    record.column("time", "ms", "median over the rounds, one thread, CPU time");
    record.column("time_low", "ms", "fastest round");
    record.column("time_high", "ms", "slowest round");
    record.column("rate", "Mray/s", "rays by median time");
    record.column("hits", "", "rays with a hit, or with something on them");
}

/// One row per contender.
pub(super) fn rows(
    base: &Row,
    kind: Kind,
    rays: &RaySet,
    contenders: &[Contender<'_>],
    timings: &Timings,
) -> Vec<Row> {
    let row = |c: &Contender<'_>| {
        let timed = timings.get(&c.name())?;
        let s = timed.summary(timings.clock);
        let row = base.clone().with("rays", kind.name()).with("count", rays.len);
        let row = row.with("tracer", c.tracer_name.as_str()).with("mode", c.mode.as_str());
        let row = row
            .with("time", s.median * 1e3)
            .with("time_low", s.low * 1e3)
            .with("time_high", s.high * 1e3);
        Some(row.with("rate", rays.len as f64 / s.median / 1e6).with("hits", timed.check))
    };
    contenders.iter().filter_map(row).collect()
}

/// The name of a tracer's fastest mode.
pub(super) fn best_mode(
    tracer_name: &str,
    contenders: &[Contender<'_>],
    timings: &Timings,
) -> Option<String> {
    let median = |name: &str| timings.summary(name).map_or(f64::INFINITY, |s| s.median);
    let names = contenders.iter().filter(|c| c.tracer_name == tracer_name).map(Contender::name);
    names.min_by(|a, b| median(a).total_cmp(&median(b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::meshes;
    use crate::rt_core_tracer::{Mode, RtCoreTracer};

    #[test]
    fn rays_from_the_surface_of_many_meshes_start_on_the_mesh_that_was_hit() {
        for scene in [meshes::city(16), meshes::forest(60)] {
            let ours = RtCoreTracer::build_scene(&scene, &Default::default()).unwrap();
            let (view, kinds) = (View::orbit(scene.bounds()), [Kind::Shadow]);
            let rays = make_rays(&scene, &view, 64, &kinds, &ours.view(Mode::Coherent));
            let [(_, rays)] = &rays[..] else { panic!("one kind of rays") };
            assert!(rays.len > 200, "{}: {} rays", scene.name, rays.len);
            for i in 0..rays.len {
                let point = ours.world.closest_point(rays.ray(i).0, f32::INFINITY);
                let distance = f64::from(point.unwrap().unwrap().distance);
                assert!(distance < 1e-4 * view.radius, "{}: ray {i}, {distance}", scene.name);
            }
        }
    }
}
