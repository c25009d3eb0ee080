//! The C ABI behind the C++ shim, the plugin and the Python package: `include/rtv.h`.
//!
//! A frame is `rtv_begin`, then `rtv_surface` and `rtv_light` for each surface and light, then
//! `rtv_render`. Programs with VTK's props ask `rtv_check_actor` and the calls beside it which of
//! them can be traced, and report the others with `rtv_pass`. Arrays belong to the caller and are
//! read before the call returns. Images and strings belong to the bridge. A panic never crosses the
//! interface: it becomes a warning, and the call fails. One thread at a time uses a bridge.
//! Different bridges may be used concurrently, each with its own options.
#![allow(unsafe_code, reason = "this is where foreign code calls us")]

mod arrays;
mod eligibility;
mod facts;
mod state;
mod types;

pub use facts::*;
pub use types::*;

use crate::bridge::AddOutcome;
use crate::input::View;
use crate::options::Options;
use rt_core::glam::{DMat4, DVec3};
pub(crate) use state::guarded;
use state::{BridgeState, set_option, with};
use std::ffi::CStr;
use std::os::raw::c_char;

/// A renderer's side of the bridge.
pub struct RtvBridge {
    _private: [u8; 0],
}

/// Version of this interface, computed from its structures and calls (a test gives the value). A
/// shim built for another version must not continue.
pub const RTV_ABI: u32 = 3_395_303_342;

/// Warning about traced polygons whose depths OpenGL would move.
const POLYGON_OFFSET: &str = "polygon offsets (SetResolveCoincidentTopologyToPolygonOffset) are \
                              not followed: of surfaces and lines in one plane, others than in \
                              OpenGL's image may be in front";

/// [`RTV_ABI`] of the library.
#[unsafe(no_mangle)]
pub extern "C" fn rtv_abi() -> u32 {
    RTV_ABI
}

/// Makes a bridge; free it with `rtv_free`. Null only if that is impossible.
#[unsafe(no_mangle)]
pub extern "C" fn rtv_new() -> *mut RtvBridge {
    guarded(std::ptr::null_mut(), || Box::into_raw(Box::new(BridgeState::new())).cast())
}

/// Frees a bridge; null is allowed.
///
/// # Safety
/// `bridge` is null or came from `rtv_new` and is not used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_free(bridge: *mut RtvBridge) {
    if !bridge.is_null() {
        // SAFETY: made by `rtv_new` from a box of this type, and given back once (the caller's
        // promise).
        guarded((), || drop(unsafe { Box::from_raw(bridge.cast::<BridgeState>()) }));
    }
}

/// Sets an option for all bridges of the process (`RTV_AO`, "16"). An empty value unsets it.
/// Returns 1 if the option is valid.
///
/// # Safety
/// Both are null or end with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_set_option(name: *const c_char, value: *const c_char) -> i32 {
    // SAFETY: the caller's promise.
    guarded(0, || i32::from(unsafe { set_option(&text(name), &text(value)) }))
}

/// Sets an option for one bridge, over those of the process; as `rtv_set_option`. Two bridges that
/// draw in two threads do not see each other's.
///
/// # Safety
/// `bridge` is null or came from `rtv_new`; the texts are null or end with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_set_bridge_option(
    bridge: *mut RtvBridge,
    name: *const c_char,
    value: *const c_char,
) -> i32 {
    // SAFETY: the caller's promise.
    unsafe { with(bridge, 0, |h| i32::from(h.set_option(&text(name), &text(value)))) }
}

/// An option's value as a number: `RTV_POINT_RADIUS`, `RTV_LINE_RADIUS`, `RTV_OFF`; -1 for others.
///
/// # Safety
/// As `rtv_set_option`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_option(name: *const c_char) -> f64 {
    // SAFETY: the caller's promise.
    guarded(-1.0, || state::number(&state::options(), &unsafe { text(name) }))
}

/// As `rtv_option`, with the bridge's own options over those of the process: in a frame those that
/// it began with, else those that one begun now would have; -1 also without a bridge.
///
/// # Safety
/// As `rtv_set_bridge_option`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_bridge_option(bridge: *mut RtvBridge, name: *const c_char) -> f64 {
    // SAFETY: the caller's promise.
    unsafe { with(bridge, -1.0, |h| h.option(&text(name))) }
}

/// Tells which VTK the library is inside of: options whose default follows VTK's version
/// (`RTV_EDGES`, `RTV_VTK`) take it from here, unless the environment or the program says
/// otherwise. The build is `VTK_BUILD_VERSION`: 0 of 9.3.0, or a day, 20240617, between releases.
/// For all bridges of the process.
#[unsafe(no_mangle)]
pub extern "C" fn rtv_host(vtk_major: u32, vtk_minor: u32, vtk_build: u32) {
    guarded((), || state::set_host(vtk_major, vtk_minor, vtk_build));
}

/// Begins a frame. Returns 0 if OpenGL should draw everything (`RTV_OFF`).
///
/// # Safety
/// `bridge` is null or came from `rtv_new`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_begin(bridge: *mut RtvBridge) -> i32 {
    // SAFETY: the caller's promise, for this and all calls below.
    unsafe { with(bridge, 0, |h| h.begin()) }
}

/// Says who draws this frame: one of RTV_CHOICE_*. Where the picture is the same either way and a
/// model says that OpenGL is cheaper, it is OpenGL. Call it after `rtv_begin`, before anything is
/// added; a caller that does not ask traces.
///
/// # Safety
/// As `rtv_begin`; `facts` is null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_choose(bridge: *mut RtvBridge, facts: *const RtvSceneFacts) -> u32 {
    // SAFETY: as above.
    let Some(f) = (unsafe { facts.as_ref() }) else { return RTV_CHOICE_RAYS };
    // SAFETY: as above.
    unsafe { with(bridge, RTV_CHOICE_RAYS, |h| h.choose(f)) }
}

/// Tells the choice of a visible volume: after rtv_choose has asked for facts, and before it is
/// called with them.
///
/// # Safety
/// As `rtv_begin`; `volume` is null or valid, and so are its facts and its view; every array has
/// the length it says and is not written to during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_choose_volume(bridge: *mut RtvBridge, volume: *const RtvSceneVolume) {
    // SAFETY: as above.
    let Some(v) = (unsafe { volume.as_ref() }) else { return };
    // SAFETY: as above.
    unsafe {
        with(bridge, (), |h| {
            let (Some(facts), Some(view)) = (v.facts.as_ref(), v.view.as_ref()) else { return };
            let classes = [text(facts.volume_class), text(facts.mapper_class)];
            if let Ok(volume) = arrays::volume_in_view(v, facts, view) {
                h.choose_volume(&volume, facts, &classes, v.adjusts != 0 && view.interactive != 0);
            }
        })
    }
}

/// Adds a surface: 1 if it will be traced, 0 if it has nothing to trace, -1 if its arrays are
/// invalid.
///
/// # Safety
/// As `rtv_begin`; every array of `surface` has the length it says and is not written to during the
/// call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_surface(bridge: *mut RtvBridge, surface: *const RtvSurface) -> i32 {
    // SAFETY: as above.
    unsafe { rtv_surfaces(bridge, surface, 1) }
}

/// Adds all surfaces of one prop, or none of them, so that nothing is drawn twice. Returns how many
/// will be traced, or -1 if the arrays of one are invalid (a warning names it).
///
/// # Safety
/// As `rtv_surface`, for `count` surfaces one after the other.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_surfaces(
    bridge: *mut RtvBridge,
    surfaces: *const RtvSurface,
    count: u64,
) -> i32 {
    // SAFETY: as above; the work is done only with surfaces that are not null.
    unsafe {
        with(bridge, -1, |h| {
            let Some(given) = arrays::slice(surfaces, count) else { return -1 };
            let names: Vec<String> = given.iter().map(|s| text(s.name)).collect();
            let mut read = Vec::with_capacity(given.len());
            for (s, name) in given.iter().zip(&names) {
                match arrays::surface(s, name) {
                    Ok(surface) => read.push(surface),
                    Err(fault) => {
                        h.bridge.warn(format!("{name}: {fault}; OpenGL draws it"));
                        return -1;
                    }
                }
            }
            read.iter().filter(|s| h.bridge.add_surface(s) == AddOutcome::Traced).count() as i32
        })
    }
}

/// Adds a volume: null if it will be traced, else the reason, as `rtv_check_actor` gives it.
///
/// # Safety
/// As `rtv_surface`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_volume(
    bridge: *mut RtvBridge,
    volume: *const RtvVolume,
) -> *const c_char {
    // SAFETY: as above; a null volume is refused.
    let Some(v) = (unsafe { volume.as_ref() }) else { return c"no volume".as_ptr() };
    // SAFETY: as above.
    unsafe {
        with(bridge, c"internal error".as_ptr(), |h| {
            let name = text(v.name);
            let added = arrays::volume(v, &name).and_then(|volume| h.bridge.add_volume(&volume));
            match added {
                Ok(()) => std::ptr::null(),
                Err(reason) => h.answer(reason),
            }
        })
    }
}

/// Returns 1 if the scalars of this key are cached; `rtv_volume` then does not need them.
///
/// # Safety
/// As `rtv_begin`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_has_volume(bridge: *mut RtvBridge, scalar_key: u64) -> i32 {
    // SAFETY: as above.
    unsafe { with(bridge, 0, |h| i32::from(h.bridge.has_volume(scalar_key))) }
}

/// Returns 1 if colours of these keys are cached from the last frame; `rtv_surface` then does not
/// need their arrays.
///
/// # Safety
/// As `rtv_begin`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_has_colors(
    bridge: *mut RtvBridge,
    shape_key: u64,
    color_key: u64,
) -> i32 {
    // SAFETY: as above.
    unsafe { with(bridge, 0, |h| i32::from(h.bridge.has_colors(shape_key, color_key))) }
}

/// Adds a light.
///
/// # Safety
/// As `rtv_begin`; `light` is null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_light(bridge: *mut RtvBridge, light: *const RtvLight) {
    // SAFETY: as above.
    let Some(l) = (unsafe { light.as_ref() }) else { return };
    // SAFETY: as above.
    unsafe { with(bridge, (), |h| h.bridge.add_light(arrays::light(l))) }
}

/// Why OpenGL has to draw an actor; null if nothing in these facts speaks against ray tracing it.
/// The text is in memory of the bridge that is valid until it gives another one.
///
/// # Safety
/// As `rtv_begin`; `facts` is null or valid, and its texts are null or end with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_check_actor(
    bridge: *mut RtvBridge,
    facts: *const RtvActorFacts,
) -> *const c_char {
    // SAFETY: as above; null facts are refused.
    let Some(f) = (unsafe { facts.as_ref() }) else { return c"no facts".as_ptr() };
    // SAFETY: as above.
    unsafe {
        with(bridge, c"internal error".as_ptr(), |h| {
            let (actor, mapper) = (text(f.actor_class), text(f.mapper_class));
            let reason = eligibility::actor(f, &actor, &mapper, h.radii());
            if reason.is_none() && f.polygon_offset != 0 {
                h.bridge.warn(POLYGON_OFFSET.into());
            }
            h.reason(reason)
        })
    }
}

/// As `rtv_check_actor`, for the data of an actor or one of their blocks.
///
/// # Safety
/// As `rtv_check_actor`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_check_surface(
    bridge: *mut RtvBridge,
    facts: *const RtvSurfaceFacts,
) -> *const c_char {
    // SAFETY: as above.
    let Some(f) = (unsafe { facts.as_ref() }) else { return c"no facts".as_ptr() };
    // SAFETY: as above.
    unsafe {
        with(bridge, c"internal error".as_ptr(), |h| {
            let (number_type, class) = (text(f.cell_type), text(f.cell_array_class));
            let cells = eligibility::CellArray { number_type: &number_type, class: &class };
            h.reason(eligibility::surface(f, cells, h.radii()))
        })
    }
}

/// As `rtv_check_actor`, for glyphs.
///
/// # Safety
/// As `rtv_check_actor`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_check_glyphs(
    bridge: *mut RtvBridge,
    facts: *const RtvGlyphFacts,
) -> *const c_char {
    // SAFETY: as above.
    let Some(f) = (unsafe { facts.as_ref() }) else { return c"no facts".as_ptr() };
    // SAFETY: as above.
    unsafe { with(bridge, c"internal error".as_ptr(), |h| h.reason(eligibility::glyphs(f))) }
}

/// As `rtv_check_actor`, for volumes. `rtv_volume` may give a reason too.
///
/// # Safety
/// As `rtv_check_actor`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_check_volume(
    bridge: *mut RtvBridge,
    facts: *const RtvVolumeFacts,
) -> *const c_char {
    // SAFETY: as above.
    let Some(f) = (unsafe { facts.as_ref() }) else { return c"no facts".as_ptr() };
    // SAFETY: as above.
    unsafe {
        with(bridge, c"internal error".as_ptr(), |h| {
            let (volume, mapper) = (text(f.volume_class), text(f.mapper_class));
            let cheaper = h.why_volumes_are_left();
            h.reason(cheaper.or_else(|| eligibility::volume(f, &volume, &mapper).map(Into::into)))
        })
    }
}

/// Records for the report that OpenGL draws something, and why; null for the reason of
/// `rtv_choose`.
///
/// # Safety
/// As `rtv_begin`; texts are null or end with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_pass(
    bridge: *mut RtvBridge,
    name: *const c_char,
    reason: *const c_char,
) {
    // SAFETY: as above.
    unsafe {
        with(bridge, (), |h| {
            let reason = if reason.is_null() { h.choice_reason() } else { text(reason) };
            h.bridge.report_untraced(&text(name), &reason);
        })
    }
}

/// Warns the user, once for each text.
///
/// # Safety
/// As `rtv_pass`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_warn(bridge: *mut RtvBridge, message: *const c_char) {
    // SAFETY: as above.
    unsafe { with(bridge, (), |h| h.bridge.warn(text(message))) }
}

/// Renders what was added: 1 with an image, 0 if it could not be rendered. The user is told why,
/// and OpenGL should draw everything.
///
/// # Safety
/// As `rtv_begin`; `view` and `picture` are null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_render(
    bridge: *mut RtvBridge,
    view: *const RtvView,
    picture: *mut RtvPicture,
) -> i32 {
    // SAFETY: as above.
    let (Some(v), false) = (unsafe { view.as_ref() }, picture.is_null()) else { return 0 };
    let view = View {
        clip_from_world: DMat4::from_cols_array(&v.clip_from_world).transpose(),
        viewer: (v.has_viewer != 0).then(|| DVec3::from_array(v.viewer)),
        width: v.width,
        height: v.height,
        background: [v.background_bottom, v.background_top],
        interactive: v.interactive != 0,
        shadows: v.shadows != 0,
        samples: 0,
        window_samples: v.window_samples,
        one_layer: v.one_layer != 0,
        lens: Some(crate::input::Lens { aperture_radius: 0.0, focus_distance: v.focus_distance }),
    };
    // SAFETY: as above; `picture` is not null.
    unsafe {
        with(bridge, 0, |h| match h.render(&view) {
            Some(found) => {
                picture.write(found);
                1
            }
            None => 0,
        })
    }
}

/// Ends the frame: prints warnings and writes the report, even if nothing was drawn.
///
/// # Safety
/// As `rtv_begin`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtv_end(bridge: *mut RtvBridge) {
    // SAFETY: as above.
    unsafe { with(bridge, (), |h| h.end()) }
}

/// All calls in one table, so that a shim needs only one symbol.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct RtvApi {
    /// [`rtv_abi`].
    pub abi: extern "C" fn() -> u32,
    /// [`rtv_new`].
    pub new_bridge: extern "C" fn() -> *mut RtvBridge,
    /// [`rtv_free`].
    pub free_bridge: unsafe extern "C" fn(*mut RtvBridge),
    /// [`rtv_set_option`].
    pub set_option: unsafe extern "C" fn(*const c_char, *const c_char) -> i32,
    /// [`rtv_option`].
    pub option: unsafe extern "C" fn(*const c_char) -> f64,
    /// [`rtv_host`].
    pub host: extern "C" fn(u32, u32, u32),
    /// [`rtv_begin`].
    pub begin: unsafe extern "C" fn(*mut RtvBridge) -> i32,
    /// [`rtv_surface`].
    pub surface: unsafe extern "C" fn(*mut RtvBridge, *const RtvSurface) -> i32,
    /// [`rtv_has_colors`].
    pub has_colors: unsafe extern "C" fn(*mut RtvBridge, u64, u64) -> i32,
    /// [`rtv_volume`].
    pub volume: unsafe extern "C" fn(*mut RtvBridge, *const RtvVolume) -> *const c_char,
    /// [`rtv_has_volume`].
    pub has_volume: unsafe extern "C" fn(*mut RtvBridge, u64) -> i32,
    /// [`rtv_light`].
    pub light: unsafe extern "C" fn(*mut RtvBridge, *const RtvLight),
    /// [`rtv_pass`].
    pub pass: unsafe extern "C" fn(*mut RtvBridge, *const c_char, *const c_char),
    /// [`rtv_warn`].
    pub warn: unsafe extern "C" fn(*mut RtvBridge, *const c_char),
    /// [`rtv_render`].
    pub render: unsafe extern "C" fn(*mut RtvBridge, *const RtvView, *mut RtvPicture) -> i32,
    /// [`rtv_end`].
    pub end: unsafe extern "C" fn(*mut RtvBridge),
    /// [`rtv_set_bridge_option`].
    pub set_bridge_option:
        unsafe extern "C" fn(*mut RtvBridge, *const c_char, *const c_char) -> i32,
    /// [`rtv_bridge_option`].
    pub bridge_option: unsafe extern "C" fn(*mut RtvBridge, *const c_char) -> f64,
    /// [`rtv_surfaces`].
    pub surfaces: unsafe extern "C" fn(*mut RtvBridge, *const RtvSurface, u64) -> i32,
    /// [`rtv_check_actor`].
    pub check_actor: unsafe extern "C" fn(*mut RtvBridge, *const RtvActorFacts) -> *const c_char,
    /// [`rtv_check_surface`].
    pub check_surface:
        unsafe extern "C" fn(*mut RtvBridge, *const RtvSurfaceFacts) -> *const c_char,
    /// [`rtv_check_glyphs`].
    pub check_glyphs: unsafe extern "C" fn(*mut RtvBridge, *const RtvGlyphFacts) -> *const c_char,
    /// [`rtv_check_volume`].
    pub check_volume: unsafe extern "C" fn(*mut RtvBridge, *const RtvVolumeFacts) -> *const c_char,
    /// [`rtv_choose`].
    pub choose: unsafe extern "C" fn(*mut RtvBridge, *const RtvSceneFacts) -> u32,
    /// [`rtv_choose_volume`].
    pub choose_volume: unsafe extern "C" fn(*mut RtvBridge, *const RtvSceneVolume),
}

static API: RtvApi = RtvApi {
    abi: rtv_abi,
    new_bridge: rtv_new,
    free_bridge: rtv_free,
    set_option: rtv_set_option,
    option: rtv_option,
    host: rtv_host,
    begin: rtv_begin,
    surface: rtv_surface,
    has_colors: rtv_has_colors,
    volume: rtv_volume,
    has_volume: rtv_has_volume,
    light: rtv_light,
    pass: rtv_pass,
    warn: rtv_warn,
    render: rtv_render,
    end: rtv_end,
    set_bridge_option: rtv_set_bridge_option,
    bridge_option: rtv_bridge_option,
    surfaces: rtv_surfaces,
    check_actor: rtv_check_actor,
    check_surface: rtv_check_surface,
    check_glyphs: rtv_check_glyphs,
    check_volume: rtv_check_volume,
    choose: rtv_choose,
    choose_volume: rtv_choose_volume,
};

/// The table; valid as long as the library is loaded.
#[unsafe(no_mangle)]
pub extern "C" fn rtv_api() -> *const RtvApi {
    &API
}

/// Converts a C string; bytes that are not UTF-8 are replaced.
///
/// # Safety
/// Null, or ends with a zero byte.
unsafe fn text(t: *const c_char) -> String {
    if t.is_null() {
        return String::new();
    }
    // SAFETY: not null, and ends with zero (the caller's promise).
    unsafe { CStr::from_ptr(t) }.to_string_lossy().into_owned()
}

/// The effective options, for Rust programs that want to follow the environment.
pub fn options_of_process() -> Options {
    state::options()
}

#[cfg(test)]
mod tests;
