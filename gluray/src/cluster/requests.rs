//! The requests of the first rank to a helper, and the replies.

use super::codec::{MalformedMessage, Reader, Wire, put_pods, wire_struct};
use super::draw_message::DrawMessage;
use super::row_share::RowShare;
use crate::capture::draw::Attributes;
use crate::classify::rules::MOST_PIXELS;
use crate::host::config::Settings;
use crate::trace::Rect;
use crate::trace::texturing::Image;
use rt_core::glam::Vec3;

/// Tags of the communicator.
pub(crate) const REQUEST: u32 = 1;
pub(crate) const REPLY: u32 = 2;

/// Both ends must be of the same build, because messages are raw memory.
const GREETING: &str = concat!("gluray ranks 2, version ", env!("CARGO_PKG_VERSION"));
/// Sent as a number, so that a machine with another byte order is detected.
const BYTE_ORDER: u32 = 0x0102_0304;

/// The largest request in bytes: a scene of 300 million triangles.
pub(crate) const MAX_REQUEST_BYTES: usize = 1 << 34;

/// Positions and triangles.
type Shape = (Vec<Vec3>, Vec<[u32; 3]>);

/// Content that a helper does not have yet.
#[derive(Default)]
pub(super) struct SceneUpdate {
    pub(super) geometries: Vec<(u128, Shape)>,
    pub(super) attributes: Vec<(u128, Attributes)>,
    pub(super) images: Vec<(u128, Image)>,
}

/// How eye space is projected to the screen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ViewParameters {
    pub(crate) projection: [f64; 16],
    pub(crate) viewport: [i32; 4],
    pub(crate) rect: [i32; 4],
}

wire_struct!(ViewParameters { projection, viewport, rect });

/// What to render.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Work {
    /// The nearest surfaces, with colours and depths.
    Nearest,
    /// Rays beyond the nearest surfaces, with the background colour.
    Whitted(ViewParameters, [f32; 3]),
    /// Path tracing: the number of the view, and of its image.
    Paths(ViewParameters, [u64; 2]),
}

impl Wire for Work {
    fn put(&self, out: &mut Vec<u8>) {
        match self {
            Work::Nearest => out.push(0),
            Work::Whitted(view_parameters, background) => {
                out.push(1);
                view_parameters.put(out);
                background.put(out);
            }
            Work::Paths(view_parameters, numbers) => {
                out.push(2);
                view_parameters.put(out);
                numbers.put(out);
            }
        }
    }
    fn get(from: &mut Reader<'_>) -> Result<Self, MalformedMessage> {
        Ok(match u8::get(from)? {
            0 => Work::Nearest,
            1 => Work::Whitted(ViewParameters::checked(from)?, Wire::get(from)?),
            2 => Work::Paths(ViewParameters::checked(from)?, Wire::get(from)?),
            n => return Err(from.fault(format!("{n} is no kind of work"))),
        })
    }
}

impl ViewParameters {
    fn checked(from: &mut Reader<'_>) -> Result<ViewParameters, MalformedMessage> {
        let view_parameters = ViewParameters::get(from)?;
        let fits = |r: &[i32; 4]| r[2] > 0 && r[3] > 0 && is_traced(r);
        match fits(&view_parameters.viewport) && fits(&view_parameters.rect) {
            true => Ok(view_parameters),
            false => Err(from.fault(format!(
                "a view {:?} of {:?}",
                view_parameters.rect, view_parameters.viewport
            ))),
        }
    }
}

/// True for a rectangle that a program's first rank may request. Larger views go to the driver, so
/// no memory is reserved for larger sizes that a peer claims.
pub(super) fn is_traced([x, y, w, h]: &[i32; 4]) -> bool {
    const FAR: i32 = 1 << 24;
    [x, y, w, h].iter().all(|v| (-FAR..=FAR).contains(*v)) && pixels(*w, *h) <= MOST_PIXELS.into()
}

/// The number of pixels of a rectangle. Zero when a side is negative.
pub(super) fn pixels(w: i32, h: i32) -> i64 {
    i64::from(w.max(0)) * i64::from(h.max(0))
}

/// The request for one image. Updates come first, so that a request that is refused later still
/// leaves the helper with them.
pub(super) struct TraceRequest {
    pub(super) number: u64,
    pub(super) forget: Vec<u128>,
    pub(super) update: SceneUpdate,
    pub(super) settings: Settings,
    pub(super) share: RowShare,
    pub(super) work: Work,
    pub(super) draws: Vec<DrawMessage>,
}

/// Writes the start of a request. Updates follow, then the [`OrderEnd`].
pub(super) fn put_head(out: &mut Vec<u8>, number: u64, forget: &[u128]) {
    GREETING.to_owned().put(out);
    BYTE_ORDER.put(out);
    number.put(out);
    forget.to_vec().put(out);
}

/// A shape.
pub(super) fn put_geometry(
    out: &mut Vec<u8>,
    name: u128,
    positions: &[Vec3],
    triangles: &[[u32; 3]],
) {
    name.put(out);
    put_pods(out, positions);
    put_pods(out, triangles);
}

impl TraceRequest {
    pub(super) fn read(bytes: &[u8]) -> Result<TraceRequest, MalformedMessage> {
        let from = &mut Reader::new(bytes);
        let greeting = String::get(from)?;
        if greeting != GREETING {
            return Err(from.fault(format!(
                "`{}` is not `{GREETING}`",
                greeting.chars().take(80).collect::<String>()
            )));
        }
        if u32::get(from)? != BYTE_ORDER {
            return Err(from.fault("numbers of another kind of machine"));
        }
        let number = Wire::get(from)?;
        let forget = Wire::get(from)?;
        let mut update = SceneUpdate::default();
        for _ in 0..u32::get(from)? {
            let name = Wire::get(from)?;
            let (positions, triangles): (Vec<Vec3>, Vec<[u32; 3]>) = (from.pods()?, from.pods()?);
            let most = positions.len();
            if let Some(t) = triangles.iter().find(|t| t.iter().any(|i| *i as usize >= most)) {
                return Err(from.fault(format!("triangle {t:?} of {most} vertices")));
            }
            update.geometries.push((name, (positions, triangles)));
        }
        update.attributes = Wire::get(from)?;
        update.images = Wire::get(from)?;
        let settings = String::get(from)?;
        let settings = serde_json::from_str(&settings)
            .map_err(|e| from.fault(format!("settings that are none: {e}")))?;
        let share: RowShare = Wire::get(from)?;
        if share.index >= share.count {
            return Err(from.fault(format!("share {} of {}", share.index, share.count)));
        }
        let work = Wire::get(from)?;
        let draws: Vec<DrawMessage> = Wire::get(from)?;
        draws.iter().try_for_each(|d| d.check(from))?;
        from.end()?;
        Ok(TraceRequest { number, forget, update, settings, share, work, draws })
    }
}

/// Writes the end of a request.
pub(super) fn put_end(
    out: &mut Vec<u8>,
    settings: &str,
    share: RowShare,
    work: &Work,
    draws: &[DrawMessage],
) {
    settings.to_owned().put(out);
    share.put(out);
    work.put(out);
    draws.len().put(out);
    draws.iter().for_each(|d| d.put(out));
}

/// The cost of a share.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct TraceCost {
    /// Primary, shadow, ambient occlusion, reflection, refraction, transparency, path.
    pub(crate) rays: [u64; 7],
    /// Acceleration structures built, and structures refitted from earlier positions.
    pub(crate) builds: u64,
    pub(crate) refits: u64,
    pub(crate) took_us: u64,
}

wire_struct!(TraceCost { rays, builds, refits, took_us });

/// The kinds of rays, in their order in a [`TraceCost`].
pub(crate) const RAYS: [&str; 7] =
    ["primary", "shadow", "ambient occlusion", "reflection", "refraction", "transparency", "path"];

impl TraceCost {
    /// Adds rays of a kind.
    pub(crate) fn add(&mut self, kind: &str, n: u64) {
        if let Some(at) = RAYS.iter().position(|k| *k == kind) {
            self.rays[at] += n;
        }
    }
}

/// The start of a reply. Rows follow unless it reports an error.
pub(super) struct ReplyHeader {
    pub(super) number: u64,
    pub(super) error_reply: Option<String>,
    pub(super) rect: [i32; 4],
    pub(super) cost: TraceCost,
    pub(super) warnings: Vec<String>,
}

wire_struct!(ReplyHeader { number, error_reply, rect, cost, warnings });

pub(crate) fn numbers(r: Rect) -> [i32; 4] {
    [r.x, r.y, r.w, r.h]
}

pub(crate) fn rect([x, y, w, h]: [i32; 4]) -> Rect {
    Rect { x, y, w, h }
}
