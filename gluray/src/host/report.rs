//! Reports what was traced, what went to the driver, and why, in one JSON file per process. The
//! file is rewritten once per second while frames arrive, because many programs end without running
//! exit handlers. It is also written when a context or the program ends.

use crate::host::timeline::SpanRecorder;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// From a frame on, another side draws: in mode `match`, each frame goes to whoever is cheaper.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RouteChange {
    /// The first frame of the new side; 1 is the first of all.
    pub frame: u64,
    /// `rays` or `driver`.
    pub to: String,
    /// The triangles of the frame by which this was decided.
    pub triangles: u64,
    /// The pixels that they cover, measured or assumed.
    pub pixels: u64,
    /// What the frame costs the driver, milliseconds of processor time by the model of costs.
    pub driver_ms: f64,
    /// The same for rays.
    pub rays_ms: f64,
}

/// The report of one process.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Report {
    /// Name of the executable.
    pub program: String,
    /// Its process id.
    pub pid: u32,
    /// Mode; `off` where nothing is traced.
    pub mode: String,
    /// True when every primitive was to be traced (`--trace all`).
    pub trace_all: bool,
    /// The driver's renderer and version.
    pub driver: String,
    /// Frames: buffer swaps, and read-backs of traced draws.
    pub frames: u64,
    /// Draw calls traced (a Begin/End pair is one).
    pub traced_draws: u64,
    /// Draw calls that the driver drew.
    pub passed_draws: u64,
    /// The reasons for it, with counts.
    pub passed_reasons: BTreeMap<String, u64>,
    /// From which frames on rays or the driver draw, as far as that is decided by costs.
    pub routes: Vec<RouteChange>,
    /// How often pending draws were presented, and before which calls.
    pub flushes: BTreeMap<String, u64>,
    /// Rays sent.
    pub rays: BTreeMap<String, u64>,
    /// Triangles of traced draws, summed over frames.
    pub triangles: u64,
    /// Acceleration structures built.
    pub builds: u64,
    /// Acceleration structures refitted from where the same triangles were in an earlier frame.
    pub refits: u64,
    /// Look-ups of geometry that was known.
    pub cache_hits: u64,
    /// Look-ups of geometry that was new.
    pub cache_misses: u64,
    /// Images that were shown again without a ray, because nothing had changed.
    pub pictures_again: u64,
    /// Images of textures read from the driver: one for each texture that is drawn with after a
    /// change.
    pub textures_read: u64,
    /// Pixels that traced surfaces covered.
    pub pixels: u64,
    /// Milliseconds by phase, summed.
    pub milliseconds: BTreeMap<String, f64>,
    /// Errors of ours. The driver drew from then on.
    pub faults: Vec<String>,
    /// Settings that were invalid and were not applied.
    pub problems: Vec<String>,
    /// Statistics of each rank, where helpers trace as well. Rank 0 is the program.
    pub ranks: Vec<crate::cluster::RankStats>,
    /// Objects of the last frame, largest first.
    pub objects: Vec<crate::host::panel::ObjectInfo>,
    /// When each phase ran, in the order of their ends: the first two hundred thousand.
    pub timeline: Vec<crate::host::timeline::Span>,
}

impl Report {
    /// Adds the report of another process.
    pub fn add(&mut self, other: &Report) {
        fn sum<V: Copy + Default + std::ops::Add<Output = V>>(
            a: &mut BTreeMap<String, V>,
            b: &BTreeMap<String, V>,
        ) {
            for (k, v) in b {
                let e = a.entry(k.clone()).or_default();
                *e = *e + *v;
            }
        }
        if self.driver.is_empty() {
            self.driver.clone_from(&other.driver);
        }
        self.frames += other.frames;
        self.traced_draws += other.traced_draws;
        self.passed_draws += other.passed_draws;
        self.triangles += other.triangles;
        self.builds += other.builds;
        self.refits += other.refits;
        self.cache_hits += other.cache_hits;
        self.cache_misses += other.cache_misses;
        self.pictures_again += other.pictures_again;
        self.textures_read += other.textures_read;
        self.pixels += other.pixels;
        sum(&mut self.passed_reasons, &other.passed_reasons);
        sum(&mut self.flushes, &other.flushes);
        sum(&mut self.rays, &other.rays);
        sum(&mut self.milliseconds, &other.milliseconds);
        self.faults.extend(other.faults.iter().cloned());
        self.problems.extend(other.problems.iter().cloned());
        for r in &other.ranks {
            match self.ranks.iter_mut().find(|own| own.rank == r.rank) {
                Some(own) => own.add(r),
                None => self.ranks.push(r.clone()),
            }
        }
        self.routes.extend(other.routes.iter().cloned());
        self.objects.extend(other.objects.iter().cloned());
        self.timeline.extend(other.timeline.iter().cloned());
    }
}

/// Decides when the file is written.
#[derive(Debug, Default)]
struct WriteSchedule {
    /// The time of the first change.
    begun: Option<Instant>,
    written: Option<Instant>,
    /// Something has changed since the last write.
    behind: bool,
    /// The process that has a thread which waits for the next write. A forked child has none of its
    /// parent's threads.
    waiting: Option<u32>,
}

/// What to do after a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum WriteDecision {
    /// Write the file now.
    Write,
    /// Write it after this time. The caller starts a thread that waits.
    Wait(Duration),
    /// Nothing: a thread waits already.
    Leave,
}

impl WriteSchedule {
    /// The longest time between two writes.
    const LONGEST: Duration = Duration::from_secs(1);
    /// The shortest time between two writes, except at an end.
    const SHORTEST: Duration = Duration::from_millis(20);

    const fn new() -> WriteSchedule {
        WriteSchedule { begun: None, written: None, behind: false, waiting: None }
    }

    /// The time between two writes: a tenth of the program's life so far, within the limits. A
    /// program that is killed runs no exit handler, so its report lacks at most this time.
    fn pause(&self, now: Instant) -> Duration {
        let life = self.begun.map_or(Duration::ZERO, |b| now.saturating_duration_since(b));
        (life / 10).clamp(Self::SHORTEST, Self::LONGEST)
    }

    /// Something has changed. `at_once` means that the process or a context may be at its end.
    fn changed(&mut self, now: Instant, at_once: bool, process: u32) -> WriteDecision {
        self.behind = true;
        self.begun.get_or_insert(now);
        let pause = self.pause(now);
        let since = self.written.map_or(pause, |t| now.saturating_duration_since(t));
        if at_once || since >= pause {
            return WriteDecision::Write;
        }
        if self.waiting == Some(process) {
            return WriteDecision::Leave;
        }
        self.waiting = Some(process);
        WriteDecision::Wait(pause - since)
    }

    /// The waiting thread is done. True when there still is something to write.
    fn waited(&mut self) -> bool {
        self.waiting = None;
        self.behind
    }

    fn wrote(&mut self, now: Instant) {
        (self.written, self.behind) = (Some(now), false);
    }
}

/// The process that drew. A forked child that draws nothing has its parent's numbers, and nothing
/// to report.
static DRAWING: AtomicU32 = AtomicU32::new(0);
static SCHEDULE: Mutex<WriteSchedule> = Mutex::new(WriteSchedule::new());
/// Only one thread writes at a time.
static WRITING: Mutex<()> = Mutex::new(());

fn schedule() -> std::sync::MutexGuard<'static, WriteSchedule> {
    SCHEDULE.lock().unwrap_or_else(|e| e.into_inner())
}

/// The counters of one context.
#[derive(Default)]
pub(crate) struct Counters {
    pub(crate) report: Report,
    /// The slot of this context in the sum of the process.
    slot: Option<usize>,
}

/// The phases that have ended since the last write.
static SPANS: Mutex<SpanRecorder> = Mutex::new(SpanRecorder::new(20_000));
/// The number of phases in the file. A run of hours must not fill a disk.
static SPANS_WRITTEN: AtomicUsize = AtomicUsize::new(0);
const MOST_SPANS: usize = 200_000;

/// A phase ended now, after this time. `track` names the thread.
pub(crate) fn span(track: &str, phase: &str, frame: u64, took: Duration) {
    if crate::host::config::current().run_dir.is_some() {
        SPANS.lock().unwrap_or_else(|e| e.into_inner()).ended(track, phase, frame, took);
    }
}

/// Appends new phases, so that a program that is killed loses none.
fn write_spans(file: &Path) {
    let new = SPANS.lock().unwrap_or_else(|e| e.into_inner()).take();
    if new.is_empty() || SPANS_WRITTEN.fetch_add(new.len(), Relaxed) > MOST_SPANS {
        return;
    }
    let lines =
        new.iter().filter_map(|s| Some(serde_json::to_string(s).ok()? + "\n")).collect::<String>();
    // A report that cannot be written must not disturb the program.
    if let Ok(mut file) = std::fs::OpenOptions::new().create(true).append(true).open(file) {
        file.write_all(lines.as_bytes()).ok();
    }
}

static SLOTS: Mutex<Vec<Report>> = Mutex::new(Vec::new());

impl Counters {
    /// True once the driver's name is known.
    pub(crate) fn knows_driver(&self) -> bool {
        !self.report.driver.is_empty()
    }

    pub(crate) fn set_driver(&mut self, renderer: &str, version: &str) {
        self.report.driver = format!("{renderer}, {version}");
    }

    /// Rays draw this many calls of the program, with this many triangles.
    pub(crate) fn count_traced(&mut self, calls: u64, triangles: usize) {
        self.report.traced_draws += calls;
        self.report.triangles += triangles as u64;
    }

    /// Adds primary rays, shadow rays and rays of ambient occlusion.
    pub(crate) fn add_rays_of_modes(&mut self, rays: [u64; 3]) {
        for (kind, n) in ["primary", "shadow", "ambient occlusion"].into_iter().zip(rays) {
            self.add_rays(kind, n);
        }
    }

    /// Acceleration structures were made.
    pub(crate) fn count_builds(&mut self, structures: crate::capture::geometry_cache::BuildCounts) {
        self.report.builds += structures.built;
        self.report.refits += structures.refitted;
    }

    /// Reports, once, that something could not be done as it was asked for.
    pub(crate) fn warn(&mut self, text: String) {
        if !self.report.problems.contains(&text) && self.report.problems.len() < 100 {
            self.report.problems.push(text);
        }
    }

    /// The driver draws `n` calls.
    pub(crate) fn count_driver_draws(&mut self, why: &'static str, n: u64) {
        self.report.passed_draws += n;
        match self.report.passed_reasons.get_mut(why) {
            Some(v) => *v += n,
            None => {
                self.report.passed_reasons.insert(why.to_owned(), n);
            }
        }
    }

    pub(crate) fn count_flush(&mut self, before: &str) {
        *self.report.flushes.entry(before.to_owned()).or_default() += 1;
    }

    pub(crate) fn add_rays(&mut self, kind: &str, n: u64) {
        if n > 0 {
            *self.report.rays.entry(kind.to_owned()).or_default() += n;
        }
    }

    pub(crate) fn add_time(&mut self, phase: &str, time: Duration) {
        span("program", phase, self.report.frames + 1, time);
        *self.report.milliseconds.entry(phase.to_owned()).or_default() += time.as_secs_f64() * 1e3;
    }

    /// Updates the file: at once when this may be the end, otherwise within a second.
    pub(crate) fn publish(&mut self, at_once: bool) {
        let Some(dir) = crate::host::config::current().run_dir.clone() else { return };
        {
            let mut slots = SLOTS.lock().unwrap_or_else(|e| e.into_inner());
            let slot = *self.slot.get_or_insert_with(|| {
                slots.push(Report::default());
                slots.len() - 1
            });
            if let Some(s) = slots.get_mut(slot) {
                s.clone_from(&self.report);
            }
        }
        DRAWING.store(std::process::id(), Relaxed);
        // A variable, so that the lock is not held while the file is written.
        let step = schedule().changed(Instant::now(), at_once, std::process::id());
        match step {
            WriteDecision::Write => write(&dir),
            WriteDecision::Leave => {}
            WriteDecision::Wait(time) => {
                let wait = move || {
                    std::thread::sleep(time);
                    let behind = schedule().waited();
                    if behind {
                        crate::faults::guard(|| write(&dir));
                    }
                };
                let spawned =
                    std::thread::Builder::new().name("gluray report".to_owned()).spawn(wait);
                if spawned.is_err() {
                    // The next frame tries again.
                    schedule().waited();
                }
            }
        }
    }
}

/// The process ends: writes what has not been written yet.
pub(crate) fn write_final_report() {
    if DRAWING.load(Relaxed) != std::process::id() {
        return;
    }
    let behind = schedule().behind;
    if let Some(dir) = crate::host::config::current().run_dir.clone().filter(|_| behind) {
        write(&dir);
    }
}

/// Writes the file.
fn write(dir: &Path) {
    let _one = WRITING.lock().unwrap_or_else(|e| e.into_inner());
    // Before the numbers are read: later changes are part of the next write.
    schedule().wrote(Instant::now());
    let mut sum = Report::default();
    SLOTS.lock().unwrap_or_else(|e| e.into_inner()).iter().for_each(|s| sum.add(s));
    sum.program = crate::host::config::program_name();
    sum.pid = std::process::id();
    let settings = &crate::host::config::current().settings;
    sum.trace_all = settings.trace == crate::host::config::Trace::All;
    sum.mode = if settings.enabled { settings.mode.name() } else { "off" }.to_owned();
    sum.faults = crate::faults::messages();
    sum.problems.extend(crate::host::config::current().problems.iter().cloned());
    sum.ranks = crate::cluster::rank_stats();
    if let Some(own) = sum.ranks.first_mut() {
        (own.builds, own.refits) = (sum.builds, sum.refits);
    }
    sum.problems.extend(crate::cluster::problems());
    write_spans(&dir.join(format!("{}.spans", sum.pid)));
    let (file, fresh) =
        (dir.join(format!("{}.json", sum.pid)), dir.join(format!("{}.new", sum.pid)));
    // A report that cannot be written must not disturb the program.
    if let Ok(text) = serde_json::to_vec(&sum)
        && std::fs::write(&fresh, text).is_ok()
    {
        std::fs::rename(fresh, file).ok();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_report_is_written_once_a_second_whatever_the_frame_rate_and_its_last_state_always() {
        for frames_per_sec in [1_u32, 7, 60, 400, 5000] {
            let start = Instant::now();
            let mut schedule = WriteSchedule::new();
            let (mut writings, mut due) = (0, None);
            let mut after_ten_secs = 0;
            let frames = 20 * frames_per_sec;
            let at = |frame: u32| start + Duration::from_secs(20) * frame / frames;
            for frame in 0..frames {
                let now = at(frame);
                if frame == frames / 2 {
                    after_ten_secs = writings;
                }
                if due.is_some_and(|d| d <= now) {
                    due = None;
                    if schedule.waited() {
                        writings += 1;
                        schedule.wrote(now);
                    }
                }
                match schedule.changed(now, false, 7) {
                    WriteDecision::Write => {
                        writings += 1;
                        schedule.wrote(now);
                    }
                    WriteDecision::Wait(time) => {
                        assert!(due.is_none(), "one waits, and no more");
                        due = Some(now + time);
                    }
                    WriteDecision::Leave => assert!(due.is_some(), "somebody waits"),
                }
            }
            let later = writings - after_ten_secs;
            assert!(
                (9..=11).contains(&later),
                "{later} in ten seconds at {frames_per_sec} a second"
            );
            // 20 ms apart up to 0.2 s, then each a tenth of its time after the other: ln 50 / ln
            // 1.1.
            assert!(
                after_ten_secs <= 10 + 42,
                "{after_ten_secs} at first, at {frames_per_sec} a second"
            );
            // The program sits idle, or ends.
            assert!(!schedule.behind || due.is_some(), "the last frame comes into the file");
            assert_eq!(
                schedule.changed(at(frames), true, 7),
                WriteDecision::Write,
                "an end is not put off"
            );
        }
    }

    #[test]
    fn a_forked_child_has_nobody_who_waits() {
        let now = Instant::now();
        let mut schedule = WriteSchedule::new();
        schedule.wrote(now);
        let soon = now + Duration::from_millis(10);
        assert!(matches!(schedule.changed(soon, false, 7), WriteDecision::Wait(_)));
        assert_eq!(schedule.changed(soon, false, 7), WriteDecision::Leave);
        assert!(matches!(schedule.changed(soon, false, 8), WriteDecision::Wait(_)));
    }
}
