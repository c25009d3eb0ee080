//! Who draws the next frame in `match` without effects, where both make the same picture: the
//! driver or rays, whichever is cheaper.
//!
//! A frame belongs to one of them as a whole, because a change between them within a frame costs
//! another pass over the pixels. The first frame is the driver's, except from the first draw on
//! that is worth its rays even once. While the driver draws, calls and vertices are counted, and
//! nothing else is done. While rays draw, it is counted what they did. [`cost`] makes a price of
//! both counts. No clock is read, so the same calls are drawn by the same side on each run.
//!
//! Changes have a price, so there is hysteresis: rays must promise a fifth less than the driver,
//! and they lose a frame only after they were dearer three times in a row. What they cost then is
//! remembered (the share of pixels that they covered, the share of triangles in new structures), so
//! that the next promise is better.
//!
//! [`cost`]: crate::classify::cost

use crate::capture::primitives::triangles_of;
use crate::classify::cost::{self, DriverSpeed, DriverWork, RayWork};
use crate::host::config::{Mode, Settings, Trace};
use crate::host::report::RouteChange;

/// The reason in the report for draws of frames that are the driver's.
pub(crate) const CHEAPER: &str = "a frame that costs the driver less than rays";

/// So much less than the driver's cost rays must promise.
const PROMISE: f64 = 1.2;
/// After so many frames in a row in which rays were dearer, the driver draws.
const DEARER_FRAMES: u32 = 3;
/// After so many frames of the driver's, it is forgotten what rays cost when they lost: what was
/// rebuilt in each frame may rest by now. Doubled each time.
const FORGET_FRAMES: u64 = 128;
/// A draw with fewer triangles is never worth its rays once.
const LEAST_AT_ONCE: u32 = 100_000;
/// Changes of sides that a report lists.
const MOST_CHANGES: usize = 50;

/// What rays do in proportion to the window and to the triangles.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Shares {
    /// Of the window's pixels: those searched, hits, pixels brought into the framebuffer.
    searched: f64,
    covered: f64,
    presented: f64,
    /// Of the triangles: those in structures that are built for one frame.
    built: f64,
    /// Sets, and draws after those of one state were joined, in a frame.
    sets: f64,
    draws: f64,
}

/// Before anything is known: a surface on half of the window's pixels.
const UNKNOWN: Shares =
    Shares { searched: 1.0, covered: 0.5, presented: 1.0, built: 0.0, sets: 1.0, draws: 1.0 };

/// The side that draws, and the counts of the frame so far.
#[derive(Debug)]
pub(crate) struct Router {
    /// Frames go to whoever is cheaper; otherwise to rays.
    applies: bool,
    /// The driver draws this frame: each draw goes there as it comes.
    pub(crate) is_drivers: bool,
    /// Vertices of immediate mode that went to the driver, ever.
    pub(crate) vertices: u64,
    /// The same at the last Begin, and its mode.
    at_begin: u64,
    mode: u32,
    speed: DriverSpeed,
    /// What went to the driver in this frame, unlooked at, and the number of draw calls that the
    /// report does not have yet.
    passed: DriverWork,
    unreported: u64,
    /// What was traced in this frame: as work for rays, and as work for the driver.
    traced: RayWork,
    instead: DriverWork,
    shares: Shares,
    /// The pixels of the largest viewport at the end of a frame.
    window_px: f64,
    /// Frames in a row in which rays were dearer; the first frame of rays does not count, because
    /// what it builds stays.
    dearer: u32,
    first: bool,
    /// Frames of the driver's since rays have lost, and after how many that is forgotten.
    since: u64,
    patience: u64,
    changes: Vec<RouteChange>,
}

impl Router {
    pub(crate) fn new(settings: &Settings) -> Router {
        let applies = applies(settings);
        Router {
            applies,
            is_drivers: applies,
            vertices: 0,
            at_begin: 0,
            mode: 0,
            speed: DriverSpeed::default(),
            passed: DriverWork::default(),
            unreported: 0,
            traced: RayWork::default(),
            instead: DriverWork::default(),
            shares: UNKNOWN,
            window_px: 0.0,
            dearer: 0,
            first: true,
            since: 0,
            patience: FORGET_FRAMES,
            changes: Vec::new(),
        }
    }

    /// The driver's name (`GL_RENDERER`).
    pub(crate) fn set_driver(&mut self, renderer: &str) {
        self.speed = DriverSpeed::of(renderer);
    }

    /// The settings are others, or somebody looks at what rays find (`watched`). True when the
    /// frame, which was the driver's, is rays' from now on.
    pub(crate) fn set_settings(&mut self, settings: &Settings, watched: bool) -> bool {
        self.applies = applies(settings) && !watched;
        !self.applies && self.is_drivers
    }

    /// Changes of sides that the report does not have yet.
    pub(crate) fn take_changes(&mut self) -> Vec<RouteChange> {
        std::mem::take(&mut self.changes)
    }

    // ---- Frames of the driver's -----------------------------------------------------------------
    /// A primitive of immediate mode begins in the driver.
    #[inline(always)]
    pub(crate) fn begin(&mut self, mode: u32) {
        (self.at_begin, self.mode) = (self.vertices, mode);
    }

    /// It ends.
    #[inline(always)]
    pub(crate) fn end(&mut self) {
        self.pass(self.mode, (self.vertices - self.at_begin) as u32);
    }

    /// The driver draws so many vertices.
    #[inline]
    pub(crate) fn pass(&mut self, mode: u32, vertices: u32) {
        self.unreported += 1;
        self.passed.draws += 1.0;
        self.passed.triangles += f64::from(triangles_of(mode, vertices));
    }

    /// The driver draws a display list, which was compiled with so many draws in it.
    pub(crate) fn pass_list(&mut self, draws: u32, triangles: u32) {
        self.unreported += u64::from(draws);
        self.passed.draws += 1.0;
        self.passed.triangles += f64::from(triangles);
    }

    /// True when something went to the driver unlooked at since the last frame ended.
    pub(crate) fn has_passed(&self) -> bool {
        self.unreported > 0
    }

    /// The draws that went to the driver since this was asked last.
    pub(crate) fn take_passed_draws(&mut self) -> u64 {
        std::mem::take(&mut self.unreported)
    }

    /// True when so many vertices are worth their rays and their structure, even if they are drawn
    /// once. The rest of `frame` is rays' then. `viewport` is asked for where it matters.
    pub(crate) fn is_worth_rays_at_once(
        &mut self,
        mode: u32,
        vertices: u32,
        frame: u64,
        viewport: impl FnOnce() -> [i32; 4],
    ) -> bool {
        let triangles = triangles_of(mode, vertices);
        if triangles < LEAST_AT_ONCE {
            return false;
        }
        self.see_window(viewport());
        let (mut rays, driver) = self.promise(f64::from(triangles), 1.0);
        rays.built = f64::from(triangles);
        self.promises_less(frame, rays, driver)
    }

    fn see_window(&mut self, [_, _, w, h]: [i32; 4]) {
        self.window_px = self.window_px.max(f64::from(w.max(0)) * f64::from(h.max(0)));
    }

    /// What so many triangles would ask of rays and of the driver.
    fn promise(&self, triangles: f64, draws: f64) -> (RayWork, DriverWork) {
        let (s, px) = (&self.shares, self.window_px);
        let rays = RayWork {
            sets: s.sets,
            draws: s.draws,
            triangles,
            built: s.built * triangles,
            searched: s.searched * px,
            covered: s.covered * px,
            presented: s.presented * px,
        };
        (rays, DriverWork { draws, triangles, pixels: s.covered * px })
    }

    /// A frame of the driver's is over. True when the next one, `frame`, is for rays.
    pub(crate) fn end_of_drivers(
        &mut self,
        frame: u64,
        viewport: impl FnOnce() -> [i32; 4],
    ) -> bool {
        let passed = std::mem::take(&mut self.passed);
        if passed.triangles == 0.0 {
            return false;
        }
        self.see_window(viewport());
        self.since += 1;
        if self.since > self.patience && self.shares != UNKNOWN {
            (self.shares, self.since) = (UNKNOWN, 0);
            self.patience = self.patience.saturating_mul(2);
        }
        let (rays, driver) = self.promise(passed.triangles, passed.draws);
        self.promises_less(frame, rays, driver)
    }

    /// Whether rays promise to cost so much less that `frame` is theirs.
    fn promises_less(&mut self, frame: u64, rays: RayWork, driver: DriverWork) -> bool {
        let costs = [self.speed.ns(&driver), cost::rays_ns(&rays)];
        let change = costs[1] * PROMISE < costs[0];
        if change {
            self.note("rays", frame, driver, costs);
        }
        change
    }

    // ---- Frames of rays' ------------------------------------------------------------------------
    /// A draw is traced that the driver would draw `times` times.
    pub(crate) fn trace(&mut self, calls: u64, triangles: usize, times: f64) {
        self.traced.draws += 1.0;
        self.traced.triangles += triangles as f64;
        self.instead.draws += calls as f64 * times;
        self.instead.triangles += triangles as f64 * times;
    }

    /// So many pixels were searched for surfaces, once for each draw. Rays found surfaces at
    /// `covered`; `presented` are brought into the framebuffer, and structures of `built` triangles
    /// were made.
    pub(crate) fn traced_set(
        &mut self,
        searched: u64,
        covered: usize,
        presented: usize,
        built: u64,
    ) {
        self.traced.sets += 1.0;
        self.traced.searched += searched as f64;
        self.traced.covered += covered as f64;
        self.traced.presented += presented as f64;
        self.traced.built += built as f64;
        self.instead.pixels += covered as f64;
    }

    /// A frame of rays' is over. True when the next one, `frame`, is the driver's.
    pub(crate) fn end_of_rays(&mut self, frame: u64, viewport: impl FnOnce() -> [i32; 4]) -> bool {
        let (traced, instead) =
            (std::mem::take(&mut self.traced), std::mem::take(&mut self.instead));
        if !self.applies || instead.triangles == 0.0 {
            return false;
        }
        self.see_window(viewport());
        if std::mem::take(&mut self.first) {
            return false;
        }
        let costs = [self.speed.ns(&instead), cost::rays_ns(&traced)];
        self.dearer = if costs[1] > costs[0] { self.dearer + 1 } else { 0 };
        if self.dearer < DEARER_FRAMES {
            return false;
        }
        let of_window = |n: f64| n / self.window_px.max(1.0);
        self.shares = Shares {
            searched: of_window(traced.searched),
            covered: of_window(traced.covered),
            presented: of_window(traced.presented),
            built: traced.built / traced.triangles,
            sets: traced.sets,
            draws: traced.draws,
        };
        self.note("driver", frame, instead, costs);
        true
    }

    /// The sides change.
    pub(crate) fn change(&mut self, is_drivers: bool) {
        (self.is_drivers, self.dearer, self.first, self.since) = (is_drivers, 0, true, 0);
        (self.traced, self.instead) = (RayWork::default(), DriverWork::default());
    }

    fn note(&mut self, to: &str, frame: u64, work: DriverWork, [driver_ns, rays_ns]: [f64; 2]) {
        if self.changes.len() < MOST_CHANGES {
            self.changes.push(RouteChange {
                frame,
                to: to.to_owned(),
                triangles: work.triangles as u64,
                pixels: work.pixels as u64,
                driver_ms: driver_ns / 1e6,
                rays_ms: rays_ns / 1e6,
            });
        }
    }
}

/// True where the driver's picture is wanted, and nothing was asked for that only rays do.
fn applies(s: &Settings) -> bool {
    s.enabled
        && s.mode == Mode::Match
        && s.trace == Trace::Scene
        && !s.always_trace
        && !s.asynchronous
        && !crate::cluster::is_asked_for()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::enums::TRIANGLES;

    const WINDOW: [i32; 4] = [0, 0, 1024, 1024];

    fn router() -> Router {
        Router::new(&Settings::default())
    }

    /// A frame of so many triangles on half of the window, on the side that the router has chosen.
    fn frame(r: &mut Router, n: u64, triangles: u32, rebuilt: bool) {
        let changes = match r.is_drivers {
            true => {
                r.pass(TRIANGLES, 3 * triangles);
                r.end_of_drivers(n + 1, || WINDOW)
            }
            false => {
                r.trace(1, triangles as usize, 1.0);
                let built = if rebuilt { u64::from(triangles) } else { 0 };
                r.traced_set(1 << 20, 1 << 19, 1 << 20, built);
                r.end_of_rays(n + 1, || WINDOW)
            }
        };
        if changes {
            r.change(!r.is_drivers);
        }
    }

    #[test]
    fn few_triangles_stay_the_drivers_and_many_go_to_rays_after_one_frame() {
        let mut r = router();
        (0..100).for_each(|n| frame(&mut r, n, 60_000, false));
        assert!(r.is_drivers && r.take_changes().is_empty());
        frame(&mut r, 100, 4_000_000, false);
        assert!(!r.is_drivers);
        let changes = r.take_changes();
        assert_eq!((changes.len(), changes[0].frame, changes[0].to.as_str()), (1, 101, "rays"));
        (101..200).for_each(|n| frame(&mut r, n, 4_000_000, false));
        assert!(!r.is_drivers && r.take_changes().is_empty());
    }

    #[test]
    fn a_call_for_each_triangle_costs_the_driver_more() {
        let by_calls = |calls: u32| {
            let mut r = router();
            (0..calls).for_each(|_| r.pass(TRIANGLES, 3 * (240_000 / calls)));
            assert_eq!(r.take_passed_draws(), u64::from(calls));
            r.end_of_drivers(2, || WINDOW)
        };
        assert!(!by_calls(1) && by_calls(240_000));
    }

    #[test]
    fn one_dear_frame_changes_nothing_and_three_do() {
        let mut r = router();
        (0..9).for_each(|n| frame(&mut r, n, 4_000_000, false));
        for n in 9..20 {
            frame(&mut r, n, if n % 3 == 0 { 4_000_000 } else { 100 }, false);
            assert!(!r.is_drivers, "two dear frames in a row are not enough");
        }
        (20..24).for_each(|n| frame(&mut r, n, 100, false));
        assert!(r.is_drivers);
        assert_eq!(r.take_changes().iter().filter(|c| c.to == "driver").count(), 1);
    }

    #[test]
    fn what_is_rebuilt_in_each_frame_is_tried_ever_less_often() {
        let mut r = router();
        (0..4000).for_each(|n| frame(&mut r, n, 1_500_000, true));
        let tries: Vec<u64> =
            r.take_changes().iter().filter(|c| c.to == "rays").map(|c| c.frame).collect();
        assert!((2..8).contains(&tries.len()), "{tries:?}");
        let gaps: Vec<u64> = tries.windows(2).map(|w| w[1] - w[0]).collect();
        assert!(gaps.is_sorted() && gaps[0] > FORGET_FRAMES, "{gaps:?}");
    }

    #[test]
    fn equal_calls_are_decided_equally() {
        let run = || {
            let mut r = router();
            (0..300).for_each(|n| {
                frame(&mut r, n, (n as u32 % 90) * 50_000, n % 5 == 0);
            });
            r.take_changes()
        };
        assert!(run() == run() && !run().is_empty());
    }

    #[test]
    fn a_large_draw_is_worth_its_rays_at_once_and_a_small_one_is_not_asked_about() {
        let mut r = router();
        assert!(!r.is_worth_rays_at_once(TRIANGLES, 30_000, 1, || panic!("asked in vain")));
        assert!(!r.is_worth_rays_at_once(TRIANGLES, 3 * 200_000, 1, || WINDOW));
        r.set_driver("Mesa Intel(R) Xe Graphics");
        assert!(!r.is_worth_rays_at_once(TRIANGLES, 48_000_000, 1, || WINDOW), "on such a card");
    }

    #[test]
    fn whoever_asks_for_more_than_the_drivers_picture_gets_rays() {
        let with = |change: fn(&mut Settings)| {
            let mut s = Settings::default();
            change(&mut s);
            Router::new(&s).is_drivers
        };
        assert!(with(|_| ()));
        for change in [
            (|s| s.mode = Mode::Phong) as fn(&mut Settings),
            |s| s.always_trace = true,
            |s| s.trace = Trace::All,
            |s| s.asynchronous = true,
            |s| s.enabled = false,
        ] {
            assert!(!with(change));
        }
    }
}
