//! Ray-parallel mode with replicated data (dissertation, sections 4.1.3 and 6.2): several processes
//! render one program's image.
//!
//! The program is the first rank. Helpers (`gluray serve-rays`) hold the whole scene. They receive
//! its changes and render a fixed share of the rows of each image. All ranks use the communicator
//! of `composite`. `mpi_group` does the same for helpers that run as an MPI job. Every rank traces
//! the same ray packets that one process would, so images are identical bit by bit for any number
//! of ranks.

pub(crate) mod codec;
mod coordinator;
mod draw_message;
pub(crate) mod helper;
pub(crate) mod mpi_group;
mod rank_stats;
pub(crate) mod requests;
pub(crate) mod row_share;
pub(crate) mod socket_comm;

pub use rank_stats::RankStats;

use crate::host::config::Settings;
use crate::trace::path_tracing::PathTracer;
use crate::trace::view::View;
use crate::trace::whitted::{self, ColorImage};
use crate::trace::{self, Layer, Prepared, Rect};
use coordinator::{Coordinator, PartialImage, view_parameters};
use requests::Work;
use row_share::RowShare;
use socket_comm::SocketComm;
use std::os::unix::net::UnixStream;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// The variable that lists the helpers' sockets, separated by `:`.
pub(crate) const SOCKETS: &str = "GLURAY_RANKS";
/// The image size in pixels below which a request costs more than it saves.
const LEAST_PIXELS: i64 = 128 * 128;

/// The state of this process's helpers.
enum State {
    /// Nothing has been traced yet.
    Unknown,
    /// No helpers were given.
    Alone,
    /// The process that opened the connections, and the first rank.
    Together(u32, Box<Coordinator>),
}

static STATE: Mutex<State> = Mutex::new(State::Unknown);
/// The statistics of each rank. They have a lock of their own, so that a report does not wait for
/// an image.
static ACCOUNTS: Mutex<Vec<RankStats>> = Mutex::new(Vec::new());
/// Helpers that could not be reached.
static PROBLEMS: Mutex<Vec<String>> = Mutex::new(Vec::new());

fn connect(place: &str) -> std::io::Result<UnixStream> {
    let end = Instant::now() + Duration::from_secs(5);
    loop {
        match UnixStream::connect(place) {
            // The helper may be between creating its socket and listening on it.
            Err(e) if e.kind() == std::io::ErrorKind::ConnectionRefused && Instant::now() < end => {
                std::thread::sleep(Duration::from_millis(10));
            }
            other => return other,
        }
    }
}

fn begin() -> State {
    let Some(places) = crate::host::folders::variable(SOCKETS) else { return State::Alone };
    let mut problems = PROBLEMS.lock().unwrap_or_else(PoisonError::into_inner);
    let mut streams = Vec::new();
    for place in places.split(':').filter(|p| !p.is_empty()) {
        match connect(place) {
            Ok(stream) => streams.push(stream),
            Err(e) => problems.push(format!("no helper at {place} ({e}): others make its rows")),
        }
    }
    match SocketComm::first(streams) {
        Ok(comm) => State::Together(std::process::id(), Box::new(Coordinator::new(Box::new(comm)))),
        Err(e) => {
            problems.push(format!("helpers cannot be talked to: {e}"));
            State::Alone
        }
    }
}

/// True when the user has given this process helpers. Read once: the program may change its
/// environment while we look.
pub(crate) fn is_asked_for() -> bool {
    static GIVEN: OnceLock<bool> = OnceLock::new();
    *GIVEN.get_or_init(|| crate::host::folders::variable(SOCKETS).is_some())
}

/// Runs `f` on the first rank when there are helpers and an image of this size is worth a request.
fn with_coordinator<R>(rect: Rect, f: impl FnOnce(&mut Coordinator) -> R) -> Option<R> {
    if i64::from(rect.w) * i64::from(rect.h) < LEAST_PIXELS {
        return None;
    }
    let mut state = STATE.lock().unwrap_or_else(PoisonError::into_inner);
    if matches!(*state, State::Unknown) {
        *state = begin();
    }
    match &mut *state {
        State::Together(pid, coordinator)
            if *pid == std::process::id() && coordinator.has_helpers() =>
        {
            let made = f(coordinator);
            ACCOUNTS
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .clone_from(&coordinator.rank_stats.all().to_vec());
            Some(made)
        }
        _ => None,
    }
}

/// The statistics of each rank so far. Empty without helpers.
pub(crate) fn rank_stats() -> Vec<RankStats> {
    ACCOUNTS.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// The problems with helpers so far.
pub(crate) fn problems() -> Vec<String> {
    let mut out = PROBLEMS.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let lost = |a: &RankStats| {
        let why = a.lost.as_ref()?;
        Some(format!("helper rank {} was lost ({why}): others make its rows", a.rank))
    };
    out.extend(rank_stats().iter().filter_map(lost));
    out
}

/// [`trace::nearest`] on all ranks.
pub(crate) fn nearest(draws: &[Prepared<'_>], settings: &Settings) -> (Layer, [u64; 2]) {
    let rect = draws.iter().fold(Rect::default(), |r, d| r.or(d.rect));
    let primary = || draws.iter().map(|d| d.rays.load(Relaxed)).sum::<u64>();
    let made = with_coordinator(rect, |coordinator| {
        let before = primary();
        let made = coordinator.make(draws, settings, &Work::Nearest, |share| {
            let (layer, extra) = trace::nearest(draws, settings, share);
            let rays = vec![("shadow", extra[0]), ("ambient occlusion", extra[1])];
            let (rect, first, second) = (layer.rect, layer.color, layer.depth);
            PartialImage { rect, first, second, rays, warnings: Vec::new() }
        });
        coordinator.rank_stats.of(0).rays += primary() - before;
        made
    });
    let Some(made) = made else { return trace::nearest(draws, settings, RowShare::WHOLE) };
    let sum =
        |kind: &str| made.rays.iter().filter(|(k, _)| *k == kind).map(|(_, n)| n).sum::<u64>();
    // This rank's primary rays are already counted, draw by draw.
    draws[0].rays.fetch_add(sum("primary"), Relaxed);
    let extra = [sum("shadow"), sum("ambient occlusion")];
    let covered = made.second.iter().filter(|d| **d < 1.5).count();
    (Layer { rect: made.rect, color: made.first, depth: made.second, covered }, extra)
}

fn of_colors(c: ColorImage) -> PartialImage<[f32; 4], u8> {
    PartialImage {
        rect: c.rect,
        first: c.rgba,
        second: Vec::new(),
        rays: c.rays,
        warnings: c.warnings,
    }
}

fn to_colors(made: PartialImage<[f32; 4], u8>) -> ColorImage {
    let mut warnings = made.warnings;
    let mut rays: Vec<(&'static str, u64)> = Vec::new();
    for (kind, n) in made.rays {
        match rays.iter_mut().find(|(k, _)| *k == kind) {
            Some((_, sum)) => *sum += n,
            None => rays.push((kind, n)),
        }
    }
    warnings.sort();
    warnings.dedup();
    ColorImage { rect: made.rect, rgba: made.first, rays, warnings }
}

/// [`whitted::colors`] on all ranks.
pub(crate) fn whitted(
    draws: &[Prepared<'_>],
    view: &View,
    rect: Rect,
    settings: &Settings,
    background: [f32; 3],
) -> ColorImage {
    let make = |share| whitted::colors(draws, view, rect, settings, background, share);
    let work = Work::Whitted(view_parameters(view, rect), background);
    let made = with_coordinator(rect, |coordinator| {
        coordinator.make(draws, settings, &work, |share| of_colors(make(share)))
    });
    made.map_or_else(|| make(RowShare::WHOLE), to_colors)
}

/// [`PathTracer::picture`] on all ranks.
pub(crate) fn paths(
    path_tracer: &mut PathTracer,
    draws: &[Prepared<'_>],
    view: &View,
    number: usize,
    rect: Rect,
    settings: &Settings,
    picture: u64,
) -> ColorImage {
    let mut make = |share| path_tracer.picture(draws, view, number, rect, settings, picture, share);
    let work = Work::Paths(view_parameters(view, rect), [number as u64, picture]);
    let made = with_coordinator(rect, |coordinator| {
        coordinator.make(draws, settings, &work, |share| of_colors(make(share)))
    });
    match made {
        Some(made) => to_colors(made),
        None => make(RowShare::WHOLE),
    }
}

#[cfg(test)]
mod tests;
