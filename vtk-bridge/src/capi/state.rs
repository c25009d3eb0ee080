//! The state behind a handle, which is a bridge with its options, and the guard against panics.

use super::eligibility::Radii;
use super::{
    RTV_BLEND_COMPOSITE, RTV_CHOICE_ASK_AGAIN, RTV_CHOICE_OPENGL, RTV_CHOICE_RAYS, RtvBridge,
    RtvPicture, RtvSceneFacts, RtvVolumeFacts, eligibility,
};
use crate::bridge::Bridge;
use crate::choice::media::Media;
use crate::choice::volume_work::VolumeInView;
use crate::choice::{Choice, SceneFacts, Way};
use crate::input::View;
use crate::options::{Options, readable};
use crate::report;
use std::collections::BTreeMap;
use std::ffi::{CString, OsString};
use std::os::raw::c_char;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// The state behind an [`RtvBridge`].
pub(super) struct BridgeState {
    pub(super) bridge: Bridge,
    number: u64,
    poisoned: bool,
    /// The last text that a call returned.
    answer: CString,
    /// Options set for this bridge alone; they take precedence over all others.
    own: OptionValues,
    effective_options: EffectiveOptions,
    choice: Choice,
    /// The volumes that this frame's choice was told of.
    media: Media,
    /// Whether this frame leaves its volumes to OpenGL.
    volumes_left: bool,
    /// True between `rtv_begin` and `rtv_end`, while options must not change.
    in_frame: bool,
}

/// Values of options by name, as set by the caller.
type OptionValues = BTreeMap<String, String>;

/// Options set by the program for all bridges; they take precedence over the environment.
static PROGRAM_OPTIONS: Mutex<OptionValues> = Mutex::new(BTreeMap::new());

/// The options of the process, for callers without a bridge.
static PROCESS_OPTIONS: Mutex<EffectiveOptions> = Mutex::new(EffectiveOptions::NONE);

/// VTK's version as set by [`set_host`] and packed by [`packed`]; 0 when unknown.
static HOST: AtomicU64 = AtomicU64::new(0);

pub(super) fn set_host(major: u32, minor: u32, build: u32) {
    HOST.store(packed(major, minor, build), Ordering::Relaxed);
}

/// Major, minor and build number of a version in one word, of 16, 16 and 32 bits. Builds between
/// releases are numbered by their day, 20240617, which needs 25 bits.
fn packed(major: u32, minor: u32, build: u32) -> u64 {
    let [major, minor] = [major, minor].map(|n| u64::from(n.min(0xffff)));
    major << 48 | minor << 32 | u64::from(build)
}

/// Builds with numbers from here on are days between two releases: 9.3.20240617 comes after 9.3.0
/// and 9.3.1.
const FIRST_DAY: u64 = 19_000_000;

/// Options that follow VTK's version, if it is known. Shaders after the releases 9.3 draw edges
/// only on the surface itself (ParaView 5.13, which has VTK 9.3.20240617, too).
fn host_options(host: u64) -> Vec<(String, String)> {
    let (major, minor, build) = (host >> 48, host >> 32 & 0xffff, host & 0xffff_ffff);
    let mut options = Vec::new();
    if (major, minor) > (0, 0) {
        options.push(("RTV_VTK".to_owned(), format!("{major}.{minor}")));
    }
    if (major, minor) > (9, 3) || (major, minor) == (9, 3) && build >= FIRST_DAY {
        options.push(("RTV_EDGES".to_owned(), "0".to_owned()));
    }
    options
}

/// All sources of options; later ones take precedence over earlier ones.
#[derive(PartialEq)]
struct OptionSources {
    host: u64,
    environment: Vec<(OsString, OsString)>,
    process: OptionValues,
    own: OptionValues,
}

impl OptionSources {
    /// The current sources. The environment is read each time, because programs change it (a
    /// script's `os.environ`).
    fn now(own: &OptionValues) -> OptionSources {
        let is_ours = |name: &OsString| name.as_encoded_bytes().starts_with(b"RTV_");
        OptionSources {
            host: HOST.load(Ordering::Relaxed),
            environment: std::env::vars_os().filter(|(name, _)| is_ours(name)).collect(),
            process: PROGRAM_OPTIONS.lock().map(|s| s.clone()).unwrap_or_default(),
            own: own.clone(),
        }
    }

    /// The options, and the settings that were not understood.
    fn parse(&self) -> (Options, Vec<String>) {
        let (environment, unreadable) = readable(&self.environment);
        let set = self.process.iter().chain(&self.own).map(|(n, v)| (n.clone(), v.clone()));
        let pairs = host_options(self.host).into_iter().chain(environment).chain(set);
        let (options, faults) = Options::parse(pairs);
        (options, [unreadable, faults].concat())
    }
}

/// Options together with their sources, so that they are parsed once per change.
struct EffectiveOptions(Option<(OptionSources, Options, Vec<String>)>);

impl EffectiveOptions {
    const NONE: EffectiveOptions = EffectiveOptions(None);

    /// The options for `sources`, and the settings that were not understood.
    fn of(&mut self, sources: OptionSources) -> (&Options, &[String]) {
        if self.0.as_ref().is_some_and(|(from, ..)| *from != sources) {
            self.0 = None;
        }
        let (_, options, faults) = self.0.get_or_insert_with(|| {
            let (options, faults) = sources.parse();
            (sources, options, faults)
        });
        (options, faults)
    }
}

/// The options of the process, which apply to bridges without options of their own.
pub(super) fn options() -> Options {
    let sources = OptionSources::now(&OptionValues::new());
    match PROCESS_OPTIONS.lock() {
        Ok(mut kept) => kept.of(sources).0.clone(),
        // Another thread panicked while it held the lock; the options can be parsed again.
        Err(_) => sources.parse().0,
    }
}

/// Sets an option among `named`; an empty value unsets it. Returns false if the value is invalid.
fn set(named: &mut OptionValues, name: &str, value: &str) -> bool {
    if value.is_empty() {
        named.remove(name);
        return true;
    }
    let understood = Options::default().set(name, value).is_ok();
    if understood {
        named.insert(name.to_owned(), value.to_owned());
    }
    understood
}

pub(super) fn set_option(name: &str, value: &str) -> bool {
    PROGRAM_OPTIONS.lock().is_ok_and(|mut all| set(&mut all, name, value))
}

/// An option as a number for C callers; -1 for options that they do not need.
pub(super) fn number(options: &Options, name: &str) -> f64 {
    match name {
        "RTV_REPORT" => f64::from(u8::from(options.report.is_some())),
        "RTV_OFF" => f64::from(u8::from(options.off)),
        "RTV_POINT_RADIUS" => options.point_radius,
        "RTV_LINE_RADIUS" => options.line_radius,
        _ => -1.0,
    }
}

impl BridgeState {
    pub(super) fn new() -> BridgeState {
        static NUMBER: AtomicU64 = AtomicU64::new(1);
        BridgeState {
            bridge: Bridge::new(),
            number: NUMBER.fetch_add(1, Ordering::Relaxed),
            poisoned: false,
            answer: CString::default(),
            own: OptionValues::new(),
            effective_options: EffectiveOptions::NONE,
            choice: Choice::default(),
            media: Media::default(),
            volumes_left: false,
            in_frame: false,
        }
    }

    pub(super) fn set_option(&mut self, name: &str, value: &str) -> bool {
        set(&mut self.own, name, value)
    }

    /// As [`number`], with the options of the current frame, or of a frame that would begin now.
    pub(super) fn option(&mut self, name: &str) -> f64 {
        if self.in_frame {
            return number(self.bridge.options(), name);
        }
        number(self.effective_options.of(OptionSources::now(&self.own)).0, name)
    }

    /// The radii of this frame.
    pub(super) fn radii(&self) -> Radii {
        let options = self.bridge.options();
        Radii { point: options.point_radius, line: options.line_radius }
    }

    /// The reason for the caller, as [`BridgeState::answer`] stores it; null if there is none.
    pub(super) fn reason(&mut self, reason: Option<impl Into<String>>) -> *const c_char {
        reason.map_or(std::ptr::null(), |text| self.answer(text.into()))
    }

    /// Stores `text` for the caller until the next text.
    pub(super) fn answer(&mut self, text: String) -> *const c_char {
        self.answer = CString::new(text.replace('\0', " ")).unwrap_or_default();
        self.answer.as_ptr()
    }

    pub(super) fn begin(&mut self) -> i32 {
        let (options, faults) = self.effective_options.of(OptionSources::now(&self.own));
        self.bridge.begin(options);
        for fault in faults {
            self.bridge.warn(fault.clone());
        }
        self.in_frame = !options.off;
        self.volumes_left = false;
        self.media = Media::default();
        i32::from(!options.off && !self.poisoned)
    }

    /// See `rtv_choose`.
    pub(super) fn choose(&mut self, f: &RtvSceneFacts) -> u32 {
        // Ranks trace alike, because their images are put together.
        if self.bridge.options().need_rays() || f.shadows != 0 || report::ranks() > 1 {
            let why = "rays: an option, shadows or several ranks need them";
            self.bridge.report.choice = why.to_owned();
            return RTV_CHOICE_RAYS;
        }
        let media = std::mem::take(&mut self.media);
        let facts = (f.known != 0).then(|| SceneFacts {
            pixels: f.pixels,
            props: f.props,
            triangles: f.triangles,
            volumes: f.volumes,
            unknown_volumes: f.volumes.saturating_sub(media.known()),
            media: media.costs(),
            others: f.others,
            translucent: f.translucent,
            edges: f.edges,
            software: f.software != 0,
            python: f.python != 0,
            interactive: f.interactive != 0,
        });
        if facts.is_none() && self.choice.is_due(f.pixels, f.props, f.interactive != 0) {
            return RTV_CHOICE_ASK_AGAIN;
        }
        let way = self.choice.decide(facts);
        self.bridge.report.choice = self.choice.reason();
        self.volumes_left = self.choice.leaves_volumes();
        match way {
            Way::OpenGl => RTV_CHOICE_OPENGL,
            Way::Surfaces | Way::All => RTV_CHOICE_RAYS,
        }
    }

    /// See `rtv_choose_volume`. A volume that is left out here is one that the model does not know.
    pub(super) fn choose_volume(
        &mut self,
        volume: &VolumeInView<'_>,
        facts: &RtvVolumeFacts,
        [volume_class, mapper_class]: &[String; 2],
        coarser: bool,
    ) {
        // What takes no samples at OpenGL's places has another picture, if only a little.
        let sampled = facts.blend_mode == RTV_BLEND_COMPOSITE && facts.gradient_opacity == 0;
        let traced = eligibility::volume(facts, volume_class, mapper_class).is_none();
        if sampled && traced && !coarser {
            self.media.add(volume);
        }
    }

    /// Why this frame leaves its volumes to OpenGL, if it does.
    pub(super) fn why_volumes_are_left(&self) -> Option<String> {
        self.volumes_left.then(|| self.choice.reason_of_volumes())
    }

    pub(super) fn choice_reason(&self) -> String {
        self.choice.reason()
    }

    pub(super) fn render(&mut self, view: &View) -> Option<RtvPicture> {
        let error = match self.bridge.render(view) {
            Ok(p) => {
                let pointer = |v: &[f32]| if v.is_empty() { std::ptr::null() } else { v.as_ptr() };
                return Some(RtvPicture {
                    width: p.width,
                    height: p.height,
                    opaque: if p.opaque.is_empty() {
                        std::ptr::null()
                    } else {
                        p.opaque.as_ptr().cast()
                    },
                    blended: pointer(p.blended.as_flattened()),
                    depth: pointer(&p.depth),
                    first_depth: pointer(&p.first_depth),
                    straight: if p.straight.is_empty() {
                        std::ptr::null()
                    } else {
                        p.straight.as_ptr().cast()
                    },
                });
            }
            Err(e) => e,
        };
        self.bridge.warn(format!("this frame is not ray traced, OpenGL draws it: {error}"));
        None
    }

    pub(super) fn end(&mut self) {
        self.in_frame = false;
        let warnings = self.bridge.take_warnings();
        let options = self.bridge.options();
        if !options.quiet {
            for w in warnings {
                warn_user_once(&w);
            }
        }
        if let Some(path) = &options.report
            && let Err(e) = report::write(self.number, self.bridge.report(), path)
        {
            warn_user_once(&format!("RTV_REPORT={path} cannot be written: {e}"));
        }
    }
}

impl Drop for BridgeState {
    fn drop(&mut self) {
        report::forget(self.number);
    }
}

/// Prints a line for the user of the host program, each text once per process. A guest library has
/// no other channel for messages.
fn warn_user_once(text: &str) {
    static SHOWN_WARNINGS: Mutex<BTreeMap<String, ()>> = Mutex::new(BTreeMap::new());
    let first =
        SHOWN_WARNINGS.lock().map(|mut t| t.insert(text.to_owned(), ()).is_none()).unwrap_or(false);
    if first {
        use std::io::Write;
        let _ = writeln!(std::io::stderr().lock(), "vtk-bridge: {text}");
    }
}

/// Calls `work` with the handle. Returns `otherwise` for null and after a panic, which is reported.
/// After a panic the bridge leaves everything to OpenGL, because its caches may be inconsistent.
///
/// # Safety
/// `bridge` is null or came from `rtv_new`, and no other thread uses it.
pub(super) unsafe fn with<T>(
    bridge: *mut RtvBridge,
    otherwise: T,
    work: impl FnOnce(&mut BridgeState) -> T,
) -> T {
    // SAFETY: `rtv_new` made it from a `BridgeState`; the caller promises that it is alive and not
    // in use.
    let Some(handle) = (unsafe { bridge.cast::<BridgeState>().as_mut() }) else { return otherwise };
    if handle.poisoned {
        return otherwise;
    }
    let result = guarded(None, || Some(work(handle)));
    handle.poisoned |= result.is_none();
    result.unwrap_or(otherwise)
}

/// Calls `work`; returns `otherwise` after a panic, which is reported. Every function that C calls
/// runs inside this, because a panic that reached C would end the program.
pub(crate) fn guarded<T>(otherwise: T, work: impl FnOnce() -> T) -> T {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let message = panic
            .downcast_ref::<&str>()
            .map(|s| (*s).to_owned())
            .or_else(|| panic.downcast_ref::<String>().cloned())
            .unwrap_or_default();
        warn_user_once(&format!(
            "internal error, the program draws without us from now on; please report it: {message}"
        ));
        otherwise
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_follow_the_version_of_vtk_unless_set() {
        let of = |major, minor, build| {
            let (options, faults) = Options::parse(host_options(packed(major, minor, build)));
            assert!(faults.is_empty(), "{faults:?}");
            (options.vtk, options.edge_reach)
        };
        assert_eq!(of(0, 0, 0), (Options::default().vtk, 0.25), "unknown");
        let moving = [(9, 0, 0), (9, 1, 0), (9, 2, 6), (9, 2, 20_220_823), (9, 3, 0), (9, 3, 1)];
        for (major, minor, build) in moving {
            assert_eq!(of(major, minor, build), ((major, minor), 0.25));
        }
        for (major, minor, build) in [(9, 3, 20_240_617), (9, 4, 0), (9, 7, 0), (10, 0, 0)] {
            assert_eq!(of(major, minor, build), ((major, minor), 0.0));
        }
        let said = ("RTV_EDGES".to_owned(), "0.5".to_owned());
        assert_eq!(
            Options::parse(host_options(packed(9, 5, 0)).into_iter().chain([said])).0.edge_reach,
            0.5
        );
    }
}
