//! What was traced, what was passed and why: a JSON file per process, rewritten as frames come, because many programs end without
//! running any of their exit handlers.

use crate::timeline::Recorder;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// The account of one process.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Report {
    /// Name of the executable.
    pub program: String,
    /// Its process id.
    pub pid: u32,
    /// Mode.
    pub mode: String,
    /// The driver's renderer and version.
    pub driver: String,
    /// Frames: buffer swaps, and read-backs of what was traced.
    pub frames: u64,
    /// Draw calls traced (a Begin/End pair is one).
    pub traced_draws: u64,
    /// Draw calls that the driver drew.
    pub passed_draws: u64,
    /// Why, with counts.
    pub passed_reasons: BTreeMap<String, u64>,
    /// How often what was pending was drawn, and before which calls.
    pub flushes: BTreeMap<String, u64>,
    /// Rays sent.
    pub rays: BTreeMap<String, u64>,
    /// Triangles of traced draws, summed over frames.
    pub triangles: u64,
    /// Acceleration structures built.
    pub builds: u64,
    /// Acceleration structures taken over from where the same triangles were in an earlier frame.
    pub refits: u64,
    /// Geometry found again, and not.
    pub cache_hits: u64,
    /// Geometry seen for the first time.
    pub cache_misses: u64,
    /// Pictures that were shown once more without a ray, because nothing had changed.
    pub pictures_again: u64,
    /// Images of textures read from the driver: one for each texture that is drawn with after it changed.
    pub textures_read: u64,
    /// Pixels that traced surfaces covered.
    pub pixels: u64,
    /// Milliseconds, by phase, summed.
    pub milliseconds: BTreeMap<String, f64>,
    /// Errors of ours; the driver drew from then on.
    pub faults: Vec<String>,
    /// Settings that made no sense and were not taken.
    pub problems: Vec<String>,
    /// What each rank did, where helpers trace as well; 0 is the program.
    pub ranks: Vec<crate::ranks::RankAccount>,
    /// Objects of the last frame, largest first.
    pub objects: Vec<crate::panel::ObjectInfo>,
    /// When each phase ran, in the order in which they ended: the first two hundred thousand.
    pub timeline: Vec<crate::timeline::Span>,
}

impl Report {
    /// Adds another process' account.
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
        self.objects.extend(other.objects.iter().cloned());
        self.timeline.extend(other.timeline.iter().cloned());
    }
}

/// Contexts that are gone, summed; and the time of the last writing.
struct Process {
    done: Report,
    written: Option<Instant>,
}

static PROCESS: Mutex<Option<Process>> = Mutex::new(None);

/// Counters of one context.
#[derive(Default)]
pub(crate) struct Counters {
    pub(crate) report: Report,
    /// Which slot of the process' sum this context has.
    slot: Option<usize>,
}

/// Phases that have ended since the last writing.
static SPANS: Mutex<Recorder> = Mutex::new(Recorder::new(20_000));
/// Lines of phases in the file; a run of hours must not fill a disk.
static SPANS_WRITTEN: AtomicUsize = AtomicUsize::new(0);
const MOST_SPANS: usize = 200_000;

/// A phase ended just now that took so long; `track` says on which thread.
pub(crate) fn span(track: &str, phase: &str, frame: u64, took: Duration) {
    if crate::config::current().run_dir.is_some() {
        SPANS.lock().unwrap_or_else(|e| e.into_inner()).ended(track, phase, frame, took);
    }
}

/// Appends what is new; a program that ends without a word loses nothing that way.
fn write_spans(file: &Path) {
    let new = SPANS.lock().unwrap_or_else(|e| e.into_inner()).take();
    if new.is_empty() || SPANS_WRITTEN.fetch_add(new.len(), Relaxed) > MOST_SPANS {
        return;
    }
    let lines = new.iter().filter_map(|s| Some(serde_json::to_string(s).ok()? + "\n")).collect::<String>();
    // A report that cannot be written must not trouble the program.
    if let Ok(mut file) = std::fs::OpenOptions::new().create(true).append(true).open(file) {
        file.write_all(lines.as_bytes()).ok();
    }
}

static SLOTS: Mutex<Vec<Report>> = Mutex::new(Vec::new());

impl Counters {
    pub(crate) fn set_driver(&mut self, renderer: &str, version: &str) {
        self.report.driver = format!("{renderer}, {version}");
    }

    /// Acceleration structures were made.
    pub(crate) fn made(&mut self, structures: crate::cache::Structures) {
        self.report.builds += structures.built;
        self.report.refits += structures.refitted;
    }

    /// Something that was asked for could not be done; said once.
    pub(crate) fn warn(&mut self, text: String) {
        if !self.report.problems.contains(&text) && self.report.problems.len() < 100 {
            self.report.problems.push(text);
        }
    }

    /// The driver draws `n` calls.
    pub(crate) fn pass(&mut self, why: &'static str, n: u64) {
        self.report.passed_draws += n;
        match self.report.passed_reasons.get_mut(why) {
            Some(v) => *v += n,
            None => {
                self.report.passed_reasons.insert(why.to_owned(), n);
            }
        }
    }

    pub(crate) fn flushed(&mut self, before: &str) {
        *self.report.flushes.entry(before.to_owned()).or_default() += 1;
    }

    pub(crate) fn rays(&mut self, kind: &str, n: u64) {
        if n > 0 {
            *self.report.rays.entry(kind.to_owned()).or_default() += n;
        }
    }

    pub(crate) fn spent(&mut self, phase: &str, time: Duration) {
        span("program", phase, self.report.frames + 1, time);
        *self.report.milliseconds.entry(phase.to_owned()).or_default() += time.as_secs_f64() * 1e3;
    }

    /// Brings the file up to date; unless `now`, not more often than the disk should see.
    pub(crate) fn publish(&mut self, now: bool) {
        let Some(dir) = crate::config::current().run_dir.clone() else { return };
        let mut slots = SLOTS.lock().unwrap_or_else(|e| e.into_inner());
        let slot = *self.slot.get_or_insert_with(|| {
            slots.push(Report::default());
            slots.len() - 1
        });
        if let Some(s) = slots.get_mut(slot) {
            s.clone_from(&self.report);
        }
        let mut process = PROCESS.lock().unwrap_or_else(|e| e.into_inner());
        let process = process.get_or_insert_with(|| Process { done: Report::default(), written: None });
        const PAUSE: Duration = Duration::from_millis(2);
        if !now && process.written.is_some_and(|t| t.elapsed() < PAUSE) {
            return;
        }
        process.written = Some(Instant::now());
        let mut sum = process.done.clone();
        slots.iter().for_each(|s| sum.add(s));
        sum.program = crate::config::program_name();
        sum.pid = std::process::id();
        sum.mode = crate::config::current().settings.mode.name().to_owned();
        sum.faults = crate::fault::messages();
        sum.problems.extend(crate::config::current().problems.iter().cloned());
        sum.ranks = crate::ranks::accounts();
        if let Some(own) = sum.ranks.first_mut() {
            (own.builds, own.refits) = (sum.builds, sum.refits);
        }
        sum.problems.extend(crate::ranks::problems());
        write_spans(&dir.join(format!("{}.spans", sum.pid)));
        let (file, fresh) = (dir.join(format!("{}.json", sum.pid)), dir.join(format!("{}.new", sum.pid)));
        // A report that cannot be written must not trouble the program.
        if let Ok(text) = serde_json::to_vec(&sum)
            && std::fs::write(&fresh, text).is_ok()
        {
            std::fs::rename(fresh, file).ok();
        }
    }
}
