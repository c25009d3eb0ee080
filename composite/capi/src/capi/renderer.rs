//! Frames of a scene of which every rank has a part.

use super::compositing::timeout_of;
use super::group::{collective, free};
use super::handles::{self, Handled};
use super::memory::{check_pointer, check_size, flag, put, read, unused};
use super::scene::SceneObject;
use super::scene_types::*;
use super::status::{Failure, c_text, guarded};
use super::types::*;
use composite::render::{DataParallel, FrameOptions, RankReport, RankScene, SecondaryRayPolicy};
use rt_core::camera::Camera;
use rt_core::frame::{Frame, Layers};
use rt_core::glam::{DMat4, DVec3};
use rt_core::render::RenderOptions;
use std::ffi::{CString, c_char};

/// The object behind a [`RtsvCompositeRenderer`].
struct RendererObject {
    /// The handle of its group.
    group: usize,
    renderer: DataParallel,
    /// What the last call gave to the program, on the root.
    frame: Option<Frame>,
    report: RankReport,
    text: CString,
}

impl Handled for RendererObject {
    const NAME: &'static str = "renderer";
}

const NOTHING: RtsvCompositePicture = RtsvCompositePicture {
    struct_bytes: size_of::<RtsvCompositePicture>() as u64,
    width: 0,
    height: 0,
    color: std::ptr::null(),
    depth: std::ptr::null(),
};

/// Fills options with their defaults; `struct_bytes` is sizeof of the structure.
///
/// # Safety
/// `options` is null or points to `struct_bytes` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_render_options_init(
    options: *mut RtsvCompositeRenderOptions,
    struct_bytes: u64,
) -> RtsvCompositeStatus {
    guarded(|| {
        check_size::<RtsvCompositeRenderOptions>(struct_bytes)?;
        let value = RtsvCompositeRenderOptions {
            struct_bytes,
            root: 0,
            secondary_rays: RTSV_COMPOSITE_FORWARD,
            threads: 0,
            reserved: 0,
            timeout_secs: 60.0,
        };
        // SAFETY: the caller's promise.
        unsafe { put(options, "options", value) }
    })
}

fn options_of(given: &RtsvCompositeRenderOptions, ranks: usize) -> Result<FrameOptions, Failure> {
    const NAME: &str = "RtsvCompositeRenderOptions";
    unused(given.reserved, NAME)?;
    if given.root as usize >= ranks {
        return Err(Failure::value(format!(
            "root of {NAME} is {}, but there are {ranks} ranks",
            given.root
        )));
    }
    Ok(FrameOptions {
        root: Some(given.root as usize),
        timeout: timeout_of(given.timeout_secs, NAME)?,
        secondary_rays: match given.secondary_rays {
            RTSV_COMPOSITE_FORWARD => SecondaryRayPolicy::Forward,
            RTSV_COMPOSITE_GHOST_ZONES => SecondaryRayPolicy::GhostZones,
            RTSV_COMPOSITE_LOCAL_ONLY => SecondaryRayPolicy::LocalOnly,
            other => {
                return Err(Failure::value(format!(
                    "secondary_rays of {NAME} is {other}: give RTSV_COMPOSITE_FORWARD or one \
                     beside it"
                )));
            }
        },
        parallel: flag(given.threads, &format!("threads of {NAME}"))?,
        ..FrameOptions::default()
    })
}

fn scene_of(scene: *const RtsvCompositeScene) -> Result<RankScene, Failure> {
    handles::with(scene.addr(), |object: &mut SceneObject| Ok(object.scene.clone()))
}

/// Collective: makes the ranks of a group render the sum of their scenes. A scene may be changed or
/// freed afterwards. Null options are the defaults.
///
/// # Safety
/// `options` is null or valid; `out` is null or points to memory for a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_renderer_new(
    comm: *mut RtsvCompositeComm,
    scene: *const RtsvCompositeScene,
    options: *const RtsvCompositeRenderOptions,
    out: *mut *mut RtsvCompositeRenderer,
) -> RtsvCompositeStatus {
    guarded(|| {
        let group = comm.addr();
        let renderer = collective(group, |comm| {
            check_pointer(out, "out")?;
            let options = if options.is_null() {
                FrameOptions::default()
            } else {
                // SAFETY: the caller's promise, also below.
                options_of(&unsafe { read(options, "options") }?, comm.size())?
            };
            Ok(DataParallel::distributed(comm, scene_of(scene)?, options)?)
        })?;
        let object = RendererObject {
            group,
            renderer,
            frame: None,
            report: RankReport::default(),
            text: CString::default(),
        };
        // SAFETY: as above.
        unsafe { put(out, "out", std::ptr::without_provenance_mut(handles::add(object))) }
    })
}

/// Collective: replaces what the ranks have, for the next time step; ranks whose part is the same
/// give the scene of before. After RTSV_COMPOSITE_DISAGREE the earlier scene remains.
#[unsafe(no_mangle)]
pub extern "C" fn rtsv_composite_renderer_replace(
    renderer: *mut RtsvCompositeRenderer,
    scene: *const RtsvCompositeScene,
) -> RtsvCompositeStatus {
    guarded(|| {
        handles::with(renderer.addr(), |object: &mut RendererObject| {
            let RendererObject { group, renderer, .. } = object;
            collective(*group, |comm| Ok(renderer.replace(comm, scene_of(scene)?)?))
        })
    })
}

/// Fills a view; `struct_bytes` is sizeof of the structure.
///
/// # Safety
/// `view` is null or points to `struct_bytes` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_view_init(
    view: *mut RtsvCompositeView,
    struct_bytes: u64,
) -> RtsvCompositeStatus {
    guarded(|| {
        check_size::<RtsvCompositeView>(struct_bytes)?;
        let options = RenderOptions::new(640, 480);
        let value = RtsvCompositeView {
            struct_bytes,
            width: options.width,
            height: options.height,
            projection: RTSV_COMPOSITE_PERSPECTIVE,
            samples: options.samples,
            light_rays: options.light_rays,
            max_bounces: -1,
            path_tracing: 0,
            depth: 0,
            seed: options.seed,
            eye: [0.0, 0.0, 1.0],
            target: [0.0; 3],
            up: [0.0, 1.0, 0.0],
            fov_y_rad: std::f64::consts::FRAC_PI_4,
            parallel_height: 1.0,
            near: 0.01,
            far: 1000.0,
            clip_from_world: DMat4::IDENTITY.to_cols_array(),
        };
        // SAFETY: the caller's promise.
        unsafe { put(view, "view", value) }
    })
}

fn camera_of(v: &RtsvCompositeView) -> Result<Camera, Failure> {
    let [eye, target, up] = [v.eye, v.target, v.up].map(DVec3::from);
    // A picture without height is refused by its own name.
    let aspect = f64::from(v.width) / f64::from(v.height.max(1));
    let range = [v.near, v.far];
    let camera = match v.projection {
        RTSV_COMPOSITE_PERSPECTIVE => {
            Camera::perspective(eye, target, up, v.fov_y_rad, aspect, range)
        }
        RTSV_COMPOSITE_PARALLEL => {
            Camera::orthographic(eye, target, up, v.parallel_height, aspect, range)
        }
        RTSV_COMPOSITE_MATRIX => {
            Camera::from_matrix(DMat4::from_cols_array(&v.clip_from_world).transpose())
        }
        other => {
            return Err(Failure::value(format!(
                "projection of RtsvCompositeView is {other}: give RTSV_COMPOSITE_PERSPECTIVE or \
                 one beside it"
            )));
        }
    };
    camera.map_err(|error| Failure::value(format!("RtsvCompositeView: {error}")))
}

fn render_options_of(v: &RtsvCompositeView) -> Result<RenderOptions, Failure> {
    let max_bounces = match v.max_bounces {
        -1 => None,
        most => Some(u32::try_from(most).map_err(|_| {
            Failure::value(format!(
                "max_bounces of RtsvCompositeView is {most}: give 0 or more, \
                                    or -1"
            ))
        })?),
    };
    let depth = flag(v.depth, "depth of RtsvCompositeView")?;
    let options = RenderOptions {
        samples: v.samples,
        light_rays: v.light_rays,
        max_bounces,
        path_tracing: flag(v.path_tracing, "path_tracing of RtsvCompositeView")?,
        layers: if depth { Layers::COLOR | Layers::DEPTH } else { Layers::COLOR },
        seed: v.seed,
        ..RenderOptions::new(v.width, v.height)
    };
    options.check().map_err(|error| Failure::value(format!("RtsvCompositeView: {error}")))?;
    Ok(options)
}

/// Collective: renders a picture, which goes to the root.
///
/// # Safety
/// `view` and `picture` are null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_renderer_render(
    renderer: *mut RtsvCompositeRenderer,
    view: *const RtsvCompositeView,
    picture: *mut RtsvCompositePicture,
) -> RtsvCompositeStatus {
    guarded(|| {
        handles::with(renderer.addr(), |object: &mut RendererObject| {
            let RendererObject { group, renderer, frame, report, .. } = object;
            collective(*group, |comm| {
                *frame = None;
                // SAFETY: the caller's promise, also below.
                let view = unsafe { read(view, "view") }?;
                // SAFETY: as above.
                unsafe { read(picture.cast_const(), "picture") }?;
                let options = render_options_of(&view)?;
                let camera = camera_of(&view)?;
                let output = renderer.frame(comm, &camera, &options)?;
                (*frame, *report) = (output.frame, output.report);
                let shown = frame.as_ref().map_or(NOTHING, |frame| RtsvCompositePicture {
                    width: frame.width,
                    height: frame.height,
                    color: frame.color.as_ptr().cast(),
                    depth: match frame.depth.is_empty() {
                        true => std::ptr::null(),
                        false => frame.depth.as_ptr(),
                    },
                    ..NOTHING
                });
                // SAFETY: as above.
                unsafe { put(picture, "picture", shown) }
            })
        })
    })
}

/// What this rank's scene and the last picture lack of what was asked for, and why: a line for
/// each, empty for none. The text belongs to the renderer until its next call.
///
/// # Safety
/// `text` is null or points to memory for a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_renderer_warnings(
    renderer: *mut RtsvCompositeRenderer,
    text: *mut *const c_char,
) -> RtsvCompositeStatus {
    guarded(|| {
        handles::with(renderer.addr(), |object: &mut RendererObject| {
            let mut lines = object.report.warnings.clone();
            let left_out = object.renderer.part().scene.world.report().skipped;
            if left_out > 0 {
                lines.push(format!(
                    "{left_out} primitives of this rank are left out: coordinates that are not \
                     finite, indices beyond the positions, or no size"
                ));
            }
            lines.iter_mut().for_each(|line| line.push('\n'));
            object.text = c_text(&lines.concat());
            // SAFETY: the caller's promise.
            unsafe { put(text, "text", object.text.as_ptr()) }
        })
    })
}

/// Frees a renderer and its picture; null is allowed.
#[unsafe(no_mangle)]
pub extern "C" fn rtsv_composite_renderer_free(
    renderer: *mut RtsvCompositeRenderer,
) -> RtsvCompositeStatus {
    free::<RendererObject, _>(renderer)
}
