//! A helper: it keeps the scene that it received and renders the requested rows.

use super::draw_message::DrawMessage;
use super::requests::{
    MAX_REQUEST_BYTES, REPLY, REQUEST, ReplyHeader, TraceCost, TraceRequest, ViewParameters, Work,
    numbers, pixels, rect,
};
use super::row_share::{RowShare, put_rows};
use crate::capture::draw::{Attributes, Draw, Shading};
use crate::capture::geometry_cache::{Geometry, GeometryCache};
use crate::host::config::{self, Quality, Settings};
use crate::trace::path_tracing::PathTracer;
use crate::trace::texturing::Image;
use crate::trace::thread_pool;
use crate::trace::view::View;
use crate::trace::whitted;
use crate::trace::{self, Prepared, Rect};
use composite::comm::{CommError, Communicator};
use rt_core::glam::DMat4;
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// How often an idle helper checks whether it should stop.
const LOOK: Duration = Duration::from_millis(500);

/// The largest number of pixels in the bounding rectangle of all views of an image. No driver's
/// framebuffer is larger than 16384 x 16384.
const MOST_BETWEEN: i64 = 1 << 28;

/// The scene as received from a program, and the structures built from it.
#[derive(Default)]
pub(super) struct Helper {
    geometries: HashMap<u128, Arc<Geometry>>,
    attributes: HashMap<u128, Arc<Attributes>>,
    images: HashMap<u128, Arc<Image>>,
    /// Builds better structures for geometry at rest.
    cache: GeometryCache,
    path_tracer: PathTracer,
}

/// Serves the first rank until it leaves or `over` is set.
///
/// # Errors
/// What ended the group other than that the first rank left.
pub(crate) fn serve(comm: &mut dyn Communicator, over: &AtomicBool) -> Result<(), CommError> {
    let mut helper = Helper::default();
    while !over.load(Relaxed) {
        let order = match comm.recv(0, REQUEST, MAX_REQUEST_BYTES, LOOK) {
            Ok(order) => order,
            Err(CommError::Timeout { .. }) => continue,
            Err(CommError::PeerLost { .. }) => return Ok(()),
            Err(e) => return Err(e),
        };
        let answer = helper.answer(&order);
        comm.recycle(order);
        match comm.send(0, REPLY, answer) {
            Err(CommError::PeerLost { .. }) => return Ok(()),
            other => other?,
        }
    }
    Ok(())
}

fn error_reply(number: u64, text: String) -> Vec<u8> {
    let head = ReplyHeader {
        number,
        error_reply: Some(text),
        rect: [0; 4],
        cost: TraceCost::default(),
        warnings: Vec::new(),
    };
    super::codec::bytes_of(&head)
}

impl Helper {
    /// The reply to a request, even a malformed one.
    pub(super) fn answer(&mut self, order: &[u8]) -> Vec<u8> {
        let order = match TraceRequest::read(order) {
            Ok(order) => order,
            Err(malformed) => return error_reply(0, format!("an order that is none: {malformed}")),
        };
        let number = order.number;
        let made = catch_unwind(AssertUnwindSafe(|| thread_pool::on_pool(|| self.make(order))));
        match made {
            Ok(Ok(answer)) => answer,
            Ok(Err(why)) => error_reply(number, why),
            Err(_) => error_reply(number, "a fault of the helper's".to_owned()),
        }
    }

    fn make(&mut self, order: TraceRequest) -> Result<Vec<u8>, String> {
        let start = Instant::now();
        for name in &order.forget {
            self.geometries.remove(name);
            self.attributes.remove(name);
            self.images.remove(name);
        }
        for (name, (positions, triangles)) in order.update.geometries {
            let positions: Vec<[f32; 3]> = positions.iter().map(|p| p.to_array()).collect();
            self.geometries.insert(name, self.cache.put(name, &positions, triangles));
        }
        self.attributes.extend(order.update.attributes.into_iter().map(|(k, a)| (k, Arc::new(a))));
        self.images.extend(order.update.images.into_iter().map(|(k, i)| (k, Arc::new(i))));
        let settings = with_own_thread_count(order.settings);
        let draws = order.draws.into_iter().map(|p| self.draw(p)).collect::<Result<Vec<_>, _>>()?;
        let (mut cost, mut structures) =
            (TraceCost::default(), crate::capture::geometry_cache::BuildCounts::default());
        let ready: Vec<Prepared<'_>> = draws
            .iter()
            .map(|(d, image)| Prepared::new(d, image.clone(), &mut structures))
            .map(|p| p.ok_or("a draw that cannot be seen"))
            .collect::<Result<_, _>>()?;
        (cost.builds, cost.refits) = (structures.built, structures.refitted);
        let (area, rows, warnings) = match order.work {
            Work::Nearest => {
                // Small views may lie so far apart that the rectangle around them does not fit into
                // memory.
                let Rect { x, y, w, h } = ready.iter().fold(Rect::default(), |r, p| r.or(p.rect));
                if pixels(w, h) > MOST_BETWEEN {
                    return Err(format!("a picture of {w} x {h} pixels at ({x}, {y})"));
                }
                let (layer, extra) = trace::nearest(&ready, &settings, order.share);
                cost.add("primary", ready.iter().map(|p| p.rays.load(Relaxed)).sum());
                cost.add("shadow", extra[0]);
                cost.add("ambient occlusion", extra[1]);
                let size = [layer.rect.w.max(0) as usize, layer.rect.h.max(0) as usize];
                let mut rows = Vec::new();
                let there = |i: usize| layer.depth[i] < 1.5;
                put_rows(&mut rows, order.share, size, (&layer.color, &layer.depth), there);
                (layer.rect, rows, Vec::new())
            }
            Work::Whitted(view_parameters, background) => {
                let view = view(&view_parameters)?;
                let colors = whitted::colors(
                    &ready,
                    &view,
                    rect(view_parameters.rect),
                    &settings,
                    background,
                    order.share,
                );
                (colors.rect, self::colors(&colors, order.share, &mut cost), colors.warnings)
            }
            Work::Paths(view_parameters, [number, picture]) => {
                let view = view(&view_parameters)?;
                let number = usize::try_from(number).map_err(|_| "a view without end")?;
                let (at, share) = (rect(view_parameters.rect), order.share);
                let colors =
                    self.path_tracer.picture(&ready, &view, number, at, &settings, picture, share);
                (colors.rect, self::colors(&colors, order.share, &mut cost), colors.warnings)
            }
        };
        drop(ready);
        self.picture_done(settings.quality);
        cost.took_us = start.elapsed().as_micros() as u64;
        let number = order.number;
        let head = ReplyHeader { number, error_reply: None, rect: numbers(area), cost, warnings };
        let mut out = super::codec::bytes_of(&head);
        out.extend_from_slice(&rows);
        Ok(out)
    }

    fn draw(&self, p: DrawMessage) -> Result<(Draw, Option<Arc<Image>>), String> {
        let lost = |what: &str, name: u128| format!("{what} {name:x} was never sent");
        let image = |name: Option<u128>| match name {
            None => Ok(None),
            Some(n) => self.images.get(&n).cloned().map(Some).ok_or_else(|| lost("image", n)),
        };
        let [texture, map, picture] = p.images.map(image);
        let texture = texture?;
        let shading = match p.program {
            None => Shading::Fixed,
            Some(program) => Shading::Program(Arc::new(program.with_images([map?, picture?]))),
        };
        let draw = Draw {
            geometry: self
                .geometries
                .get(&p.geometry)
                .cloned()
                .ok_or_else(|| lost("geometry", p.geometry))?,
            attributes: (self.attributes.get(&p.attributes).cloned())
                .ok_or_else(|| lost("attributes", p.attributes))?,
            state: Arc::new(p.state),
            shading,
            clip_from_object: p.clip_from_object,
            calls: 1,
            ray_material: p.ray_material,
        };
        Ok((draw, texture))
    }

    /// Better structures for what rests; what was not forgotten stays.
    fn picture_done(&mut self, quality: Quality) {
        #[expect(clippy::iter_over_hash_type, reason = "each entry for itself")]
        for g in self.geometries.values() {
            self.cache.touch(g);
        }
        let auto = quality == Quality::Auto;
        self.cache.frame_done(|g| {
            if auto {
                thread_pool::in_background(move || g.improve());
            }
            auto
        });
        self.path_tracer.frame_done();
    }
}

fn view(view_parameters: &ViewParameters) -> Result<View, String> {
    let projection = DMat4::from_cols_array(&view_parameters.projection);
    View::new(projection, rect(view_parameters.viewport))
        .ok_or_else(|| "a projection without rays".to_owned())
}

fn colors(colors: &whitted::ColorImage, share: RowShare, cost: &mut TraceCost) -> Vec<u8> {
    colors.rays.iter().for_each(|(kind, n)| cost.add(kind, *n));
    let size = [colors.rect.w.max(0) as usize, colors.rect.h.max(0) as usize];
    let mut rows = Vec::new();
    put_rows(&mut rows, share, size, (&colors.rgba, &[0_u8; 0]), |i| colors.rgba[i] != [0.0; 4]);
    rows
}

/// The first rank's settings, but with this process's own number of threads.
fn with_own_thread_count(settings: Settings) -> Settings {
    let now = config::current();
    let settings = Settings { threads: now.settings.threads, ..settings };
    if now.settings != settings {
        config::replace(settings.clone());
    }
    settings
}
