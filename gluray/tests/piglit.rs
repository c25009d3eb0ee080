//! Piglit's conformance tests in `match` mode. A test that passes natively must pass through
//! gluray, and must be traced where it draws filled primitives.

mod common;

use common::{Run, Xvfb, folder, peer};
use gluray::report::Report;
use std::path::Path;

/// Tests that draw filled primitives, and so must be traced.
const FILLED: &[&str] = &[
    "gl-1.0-dlist-shademodel -auto -fbo",
    "gl-1.0-texgen -auto -fbo",
    "gl-1.1-color-material-array -auto -fbo",
    "gl-1.1-draw-arrays-start -auto -fbo",
    "clipflat -auto -fbo",
    "dlist-color-material -auto -fbo",
    "dlist-fdo3129-02 -auto -fbo",
    "draw-arrays-colormaterial -auto -fbo",
    "fragment-center -auto -fbo",
    "polygon-offset -auto -fbo",
    "readpix-z -auto -fbo",
    "texgen -auto -fbo",
    "user-clip -auto -fbo",
    "two-sided-lighting-separate-specular -auto -fbo",
    "triangle-rasterization -auto -fbo",
    "draw-vertices -auto -fbo",
    "depth_clamp -auto -fbo",
    "depth-clamp-range -auto -fbo",
    "triangle-rasterization-overdraw -auto -fbo",
    "pos-array -auto -fbo",
    "provoking-vertex -auto",
    "gl-1.0-dlist-beginend -auto -fbo",
    "array-stride -auto -fbo",
    "gl-1.0-user-clip-all-planes -auto -fbo",
    "texredefine -auto -fbo",
    "copyteximage 1D -auto -fbo",
    "nv_primitive_restart-dlist -auto -fbo",
    "fbo-alphatest-formats -auto -fbo",
    "fbo-clear-formats GL_EXT_texture_snorm -auto -fbo",
    "tex-srgb -auto",
    "ext_framebuffer_object-mipmap -auto -fbo",
    "fbo-srgb -auto -fbo",
    "fbo-clear-formats GL_EXT_packed_depth_stencil stencil -auto -fbo",
];
/// Tests of errors, selection and other features that must not break.
const OTHERS: &[&str] = &[
    "gl-1.0-beginend-coverage -auto -fbo",
    "gl-1.0-dlist-bitmap -auto -fbo",
    "gl-1.0-edgeflag-const -auto -fbo",
    "gl-1.0-empty-begin-end-clause -auto -fbo",
    "gl-1.0-rendermode-feedback -auto -fbo",
    "gl-1.0-push-no-attribs -auto -fbo",
    "gl-1.0-no-op-paths -auto -fbo",
    "degenerate-prims -auto -fbo",
    "gl-1.1-set-vertex-color-after-draw -auto -fbo",
    "longprim -auto -fbo",
    "select depth -auto -fbo",
    "vao-element-array-buffer -auto -fbo",
    "vbo-map-remap -auto -fbo",
    "gl-1.2-texture-base-level -auto -fbo",
    "incomplete-texture fixed -auto -fbo",
    "levelclamp -auto -fbo",
    "lodclamp-between -auto -fbo",
    "mipmap-setup -auto -fbo",
    "texsubimage-depth-formats -auto -fbo",
    "gl-2.0-two-sided-stencil -auto -fbo",
    "arb_clip_control-clip-control -auto -fbo",
    "arb_clip_control-viewport -auto -fbo",
    "arb_color_buffer_float-render GL_RGBA16F -auto -fbo",
    "ati_fragment_shader-render-ops -auto -fbo",
    "fbo-blending-snorm -auto -fbo",
    "fbo-maxsize -auto -fbo",
    "arb_separate_shader_object-compat-builtins -auto -fbo",
    "nv_fog_distance-simple-draw radial -auto -fbo",
];

fn verdict(x: &Xvfb, piglit: &Path, line: &str, through: Option<&[&str]>) -> (String, Report) {
    let words: Vec<&str> = line.split(' ').collect();
    let place = folder();
    let source = piglit.parent().expect("bin lies in a folder").to_str().expect("UTF-8").to_owned();
    let environment = [("PIGLIT_SOURCE_DIR", source.as_str()), ("PIGLIT_PLATFORM", "glx")];
    let run = Run { x, folder: place.path(), through, environment: &environment };
    let (output, report) = run.program(&piglit.join(words[0]), &words[1..]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let last = text
        .lines()
        .rev()
        .find_map(|l| l.strip_prefix("PIGLIT: {\"result\": \""))
        .map(str::to_owned);
    (last.unwrap_or_default().split('"').next().unwrap_or_default().to_owned(), report)
}

fn all(lines: &[&str], must_trace: bool) {
    let Some(piglit) = peer("RTSV_PIGLIT") else { return };
    let Some(x) = Xvfb::start() else { return };
    let mut faults = Vec::new();
    for line in lines {
        let (native, _) = verdict(&x, &piglit, line, None);
        let (ours, report) = verdict(&x, &piglit, line, Some(&["--trace", "all"]));
        if native == "pass" && (ours != "pass" || (must_trace && report.traced_draws == 0)) {
            faults.push(format!("{line}: `{ours}`, {} draws traced", report.traced_draws));
        }
    }
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

#[test]
fn conformance_tests_of_filled_primitives_pass_and_are_traced() {
    all(FILLED, true);
}

#[test]
fn conformance_tests_of_errors_lists_and_selection_pass() {
    all(OTHERS, false);
}

#[test]
fn textures_replaced_five_thousand_times_are_read_once_each() {
    let line = "streaming-texture-leak -auto -fbo";
    let Some(piglit) = peer("RTSV_PIGLIT") else { return };
    let Some(x) = Xvfb::start() else { return };
    let (result, report) = verdict(&x, &piglit, line, Some(&["--trace", "all"]));
    assert_eq!((result.as_str(), report.traced_draws), ("pass", 5000));
    assert_eq!(report.textures_read, 5000, "{report:?}");
}
