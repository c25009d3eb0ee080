//! Tests the calls as C makes them, including mistakes of foreign code.

use super::*;
use std::ffi::OsStr;
use std::os::raw::c_void;
use std::os::unix::ffi::OsStrExt;
use std::ptr;

fn array<T, const N: usize>(values: &[[T; N]], kind: u32) -> RtvArray {
    RtvArray {
        data: values.as_ptr().cast::<c_void>(),
        tuples: values.len() as u64,
        components: N as u32,
        kind,
    }
}

const NO_ARRAY: RtvArray = RtvArray { data: ptr::null(), tuples: 0, components: 0, kind: RTV_NONE };
const NO_CELLS: RtvCells = RtvCells { offsets: NO_ARRAY, connectivity: NO_ARRAY };
const IDENTITY: [f64; 16] =
    [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];

fn property() -> RtvProperty {
    RtvProperty {
        ambient_color: [1.0; 3],
        diffuse_color: [1.0, 0.0, 0.0],
        specular_color: [1.0; 3],
        ambient: 0.0,
        diffuse: 1.0,
        specular: 0.0,
        specular_power: 1.0,
        opacity: 1.0,
        metallic: 0.0,
        roughness: 0.5,
        base_ior: 1.5,
        flat: 0,
        lighting: 0,
        pbr: 0,
        cull_front: 0,
        cull_back: 0,
        edge_color: [0.0; 3],
        edge_width: 0.0,
    }
}

fn surface(points: &[[f32; 3]], offsets: &[[i64; 1]], connectivity: &[[i64; 1]]) -> RtvSurface {
    let polys =
        RtvCells { offsets: array(offsets, RTV_I64), connectivity: array(connectivity, RTV_I64) };
    RtvSurface {
        name: c"test".as_ptr(),
        shape_key: 1,
        color_key: 0,
        texture_key: 0,
        points: array(points, RTV_F32),
        verts: NO_CELLS,
        lines: NO_CELLS,
        polys,
        strips: NO_CELLS,
        point_normals: NO_ARRAY,
        cell_normals: NO_ARRAY,
        texcoords: NO_ARRAY,
        clip_planes: NO_ARRAY,
        color_source: RTV_COLOR_PROPERTY,
        edges_only: 0,
        colors: NO_ARRAY,
        map: NO_ARRAY,
        nan_color: [0; 4],
        texture_interpolate: 0,
        texture_repeat: 0,
        texture_srgb: 0,
        reserved: 0,
        texture: NO_ARRAY,
        texture_width: 0,
        has_back: 0,
        property: property(),
        back: property(),
        world_from_data: IDENTITY,
        glyph_matrices: NO_ARRAY,
        glyph_colors: NO_ARRAY,
        point_radius: 0.0,
        line_radius: 0.0,
        tangents: NO_ARRAY,
        maps: std::ptr::null(),
    }
}

fn view() -> RtvView {
    RtvView {
        clip_from_world: IDENTITY,
        viewer: [0.0; 3],
        has_viewer: 0,
        background_bottom: [0.0; 3],
        background_top: [0.0; 3],
        focus_distance: 1.0,
        width: 4,
        height: 4,
        interactive: 0,
        shadows: 0,
        window_samples: 0,
        one_layer: 0,
    }
}

const NO_PICTURE: RtvPicture = RtvPicture {
    width: 0,
    height: 0,
    opaque: ptr::null(),
    blended: ptr::null(),
    depth: ptr::null(),
    first_depth: ptr::null(),
    straight: ptr::null(),
};

const POINTS: [[f32; 3]; 3] = [[-3.0, -1.0, 0.0], [3.0, -1.0, 0.0], [0.0, 3.0, 0.0]];

/// Draws `s` alone; the result of adding it, and whether a picture came.
fn frame(s: &RtvSurface) -> (i32, i32) {
    let bridge = rtv_new();
    let mut picture = NO_PICTURE;
    // SAFETY: everything lives until the end of this function, and lengths are those of slices.
    unsafe {
        rtv_begin(bridge);
        let added = rtv_surface(bridge, s);
        let drawn = rtv_render(bridge, &view(), &mut picture);
        if drawn == 1 {
            let pixels = std::slice::from_raw_parts(picture.opaque, 64);
            assert!(added != 1 || pixels.chunks(4).any(|p| p == [255, 0, 0, 255]), "{pixels:?}");
        }
        rtv_end(bridge);
        rtv_free(bridge);
        (added, drawn)
    }
}

#[test]
fn a_frame_through_the_c_abi() {
    assert_eq!(frame(&surface(&POINTS, &[[0], [3]], &[[0], [1], [2]])), (1, 1));
}

#[test]
fn nothing_to_draw_gives_an_empty_image() {
    assert_eq!(frame(&surface(&[], &[], &[])), (0, 1));
}

#[test]
fn null_pointers_wrong_kinds_and_lengths_are_refused() {
    // SAFETY: null is allowed everywhere.
    unsafe {
        rtv_free(ptr::null_mut());
        assert_eq!(rtv_begin(ptr::null_mut()), 0);
        assert_eq!(rtv_surface(ptr::null_mut(), ptr::null()), -1);
        assert_eq!(rtv_render(ptr::null_mut(), ptr::null(), ptr::null_mut()), 0);
        rtv_light(ptr::null_mut(), ptr::null());
        rtv_pass(ptr::null_mut(), ptr::null(), ptr::null());
        rtv_end(ptr::null_mut());
        assert_eq!(rtv_set_option(ptr::null(), ptr::null()), 1, "taking back nothing");
    }
    let good = surface(&POINTS, &[[0], [3]], &[[0], [1], [2]]);
    let null = RtvArray { data: ptr::null(), ..good.points };
    assert_eq!(frame(&RtvSurface { points: null, ..good }).0, -1);
    let two = RtvArray { components: 2, ..good.points };
    assert_eq!(frame(&RtvSurface { points: two, ..good }).0, -1);
    assert_eq!(frame(&RtvSurface { color_source: 77, ..good }).0, -1);
    let odd = RtvArray { data: good.points.data.wrapping_byte_add(1), tuples: 2, ..good.points };
    assert_eq!(frame(&RtvSurface { points: odd, ..good }).0, -1, "misaligned");
}

#[test]
fn point_numbers_that_do_not_exist_draw_nothing() {
    let mut red = 0;
    let s = surface(&POINTS, &[[0], [3]], &[[0], [1], [1 << 33]]);
    let bridge = rtv_new();
    let mut picture = NO_PICTURE;
    // SAFETY: as in `frame`.
    unsafe {
        rtv_begin(bridge);
        rtv_surface(bridge, &s);
        assert_eq!(rtv_render(bridge, &view(), &mut picture), 1);
        red += std::slice::from_raw_parts(picture.opaque, 64).iter().filter(|b| **b != 0).count();
        rtv_free(bridge);
    }
    assert_eq!(red, 0);
    assert_eq!(frame(&surface(&POINTS, &[[0], [-3], [i64::MAX]], &[[0], [1], [2]])).0, 0);
}

#[test]
fn sizes_that_cannot_be_drawn_are_reported_and_left_to_opengl() {
    let bridge = rtv_new();
    let mut picture = NO_PICTURE;
    // SAFETY: as in `frame`.
    unsafe {
        rtv_begin(bridge);
        assert_eq!(rtv_render(bridge, &RtvView { width: 0, ..view() }, &mut picture), 0);
        let singular = RtvView { clip_from_world: [0.0; 16], ..view() };
        assert_eq!(rtv_render(bridge, &singular, &mut picture), 0);
        let nan = RtvView { clip_from_world: [f64::NAN; 16], ..view() };
        assert_eq!(rtv_render(bridge, &nan, &mut picture), 0);
        rtv_free(bridge);
    }
}

/// Runs the test `name` of this file alone in a process of its own with `variables`, and gives what
/// it said. Variables of this process are shared with other tests.
fn in_a_process_with(name: &str, variables: &[(&OsStr, &OsStr)]) -> std::process::Output {
    let mut child = std::process::Command::new(std::env::current_exe().unwrap());
    child.args(["--exact", &format!("capi::tests::{name}"), "--nocapture", "--test-threads=1"]);
    child.envs(variables.iter().copied()).env(CHILD, "1");
    child.output().unwrap()
}

/// Set in processes that [`in_a_process_with`] starts.
const CHILD: &str = "VTK_BRIDGE_TEST_CHILD";

#[test]
fn variables_that_are_not_utf8_are_named_and_do_not_abort_the_program() {
    if std::env::var_os(CHILD).is_some() {
        let s = surface(&POINTS, &[[0], [3]], &[[0], [1], [2]]);
        assert_eq!(frame(&s), (1, 1), "a frame is drawn as ever");
        // SAFETY: a text that ends with zero.
        let radius = unsafe { rtv_option(c"RTV_POINT_RADIUS".as_ptr()) };
        assert_eq!(radius, 0.25, "what can be read beside it holds");
        assert_eq!(options_of_process().ao, 0);
        return;
    }
    let variables = [
        (OsStr::new("RTV_AO"), OsStr::from_bytes(b"16\xff")),
        (OsStr::from_bytes(b"RTV_\xfe"), OsStr::new("1")),
        (OsStr::new("RTV_POINT_RADIUS"), OsStr::new("0.25")),
        // Others' variables are none of ours, and folders may have any name.
        (OsStr::new("OTHER_PROGRAM"), OsStr::from_bytes(b"\xff")),
        (OsStr::from_bytes(b"OTHER_\xff"), OsStr::new("1")),
        (OsStr::new("RTV_HOME"), OsStr::from_bytes(b"/data/\xff")),
    ];
    let name = "variables_that_are_not_utf8_are_named_and_do_not_abort_the_program";
    let out = in_a_process_with(name, &variables);
    let told = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(out.status.success(), "{:?}: {told}", out.status);
    for expected in ["RTV_AO", "RTV_\\xFE"] {
        let about = |l: &&str| l.starts_with("vtk-bridge:") && l.contains(expected);
        let lines = told.lines().filter(about).collect::<Vec<_>>();
        assert!(lines.len() == 1 && lines[0].contains("UTF-8"), "{expected}: {lines:?}\n{told}");
    }
    assert!(!told.contains("OTHER_") && !told.contains("RTV_HOME"), "{told}");
}

/// Two views of a program: what one is told must not reach the other, whatever their threads do.
#[test]
fn views_in_two_threads_do_not_mix_their_options() {
    let together = std::sync::Barrier::new(2);
    let view = |off: bool, radius: &CStr, expected: f64| {
        let bridge = rtv_new();
        // SAFETY: texts end with zero, and this thread alone uses the bridge.
        let set = |name: &CStr, value: &CStr| unsafe {
            rtv_set_bridge_option(bridge, name.as_ptr(), value.as_ptr())
        };
        let mut found = Vec::new();
        for _ in 0..50 {
            together.wait();
            assert_eq!(set(c"RTV_POINT_RADIUS", radius), 1);
            assert_eq!(set(c"RTV_OFF", if off { c"1" } else { c"0" }), 1);
            together.wait();
            // SAFETY: as above.
            let seen = unsafe {
                (rtv_begin(bridge), rtv_bridge_option(bridge, c"RTV_POINT_RADIUS".as_ptr()))
            };
            found.push(seen);
            // SAFETY: as above.
            unsafe { rtv_end(bridge) };
            together.wait();
            set(c"RTV_POINT_RADIUS", c"");
            set(c"RTV_OFF", c"");
        }
        // SAFETY: as above; it is not used afterwards.
        unsafe { rtv_free(bridge) };
        found.retain(|seen| *seen != (i32::from(!off), expected));
        found
    };
    let wrong = std::thread::scope(|s| {
        let other = s.spawn(|| view(true, c"0.75", 0.75));
        [view(false, c"0.5", 0.5), other.join().unwrap()]
    });
    assert!(wrong.iter().all(Vec::is_empty), "views that were not as their options say: {wrong:?}");
}

/// Blocks of one prop: OpenGL draws the whole prop when one of them is refused.
#[test]
fn surfaces_of_a_prop_are_added_all_or_none() {
    let good = surface(&POINTS, &[[0], [3]], &[[0], [1], [2]]);
    let null = RtvArray { data: ptr::null(), ..good.points };
    let bad = RtvSurface { points: null, ..good };
    let drawn = |given: &[RtvSurface]| {
        let bridge = rtv_new();
        let mut picture = NO_PICTURE;
        // SAFETY: as in `frame`.
        unsafe {
            rtv_begin(bridge);
            let added = rtv_surfaces(bridge, given.as_ptr(), given.len() as u64);
            assert_eq!(rtv_render(bridge, &view(), &mut picture), 1);
            let bytes = std::slice::from_raw_parts(picture.opaque, 64);
            let any = bytes.iter().any(|b| *b != 0);
            rtv_free(bridge);
            (added, any)
        }
    };
    assert_eq!(drawn(&[good, good]), (2, true));
    assert_eq!(drawn(&[good, bad]), (-1, false), "the first must not be drawn alone");
    assert_eq!(drawn(&[bad, good]), (-1, false));
    assert_eq!(drawn(&[]), (0, false));
    // SAFETY: null and impossible numbers are refused.
    unsafe {
        let bridge = rtv_new();
        assert_eq!(rtv_surfaces(bridge, ptr::null(), 1), -1);
        assert_eq!(rtv_surfaces(bridge, &good, u64::MAX), -1);
        assert_eq!(rtv_surfaces(ptr::null_mut(), &good, 1), -1);
        rtv_free(bridge);
    }
}

#[test]
fn reasons_follow_the_radii_of_the_frame_and_bad_facts_are_refused() {
    let bridge = rtv_new();
    // SAFETY: all zero is no fact at all.
    let none: RtvSurfaceFacts = unsafe { std::mem::zeroed() };
    let facts = RtvSurfaceFacts { representation: RTV_SURFACE, num_lines: 7, ..none };
    // SAFETY: texts end with zero, facts live until the end, and only this thread uses the bridge.
    unsafe {
        assert_eq!(rtv_begin(bridge), 1);
        let reason = text(rtv_check_surface(bridge, &facts));
        assert_eq!(reason, "it has lines (set RTV_LINE_RADIUS to trace them as tubes)");
        rtv_end(bridge);
        assert_eq!(rtv_set_bridge_option(bridge, c"RTV_LINE_RADIUS".as_ptr(), c"1".as_ptr()), 1);
        assert_eq!(rtv_begin(bridge), 1);
        assert!(rtv_check_surface(bridge, &facts).is_null());
        let cells = RtvSurfaceFacts {
            unreadable_cells: 1,
            cell_components: 3,
            cell_type: c"int".as_ptr(),
            cell_array_class: c"vtkIntArray".as_ptr(),
            ..facts
        };
        let reason = rtv_check_surface(bridge, &cells);
        assert_eq!(text(reason), "its cells are numbered by 3 x int of vtkIntArray");
        rtv_pass(bridge, c"it".as_ptr(), reason);
        assert_eq!(text(reason), "its cells are numbered by 3 x int of vtkIntArray");
        assert_eq!(text(rtv_check_actor(bridge, ptr::null())), "no facts");
        assert_eq!(text(rtv_check_surface(ptr::null_mut(), &facts)), "internal error");
        rtv_end(bridge);
        rtv_free(bridge);
    }
}

#[test]
fn a_bridge_s_options_go_over_those_of_the_process_and_hold_for_a_frame() {
    let (bridge, other) = (rtv_new(), rtv_new());
    let name = c"RTV_LINE_RADIUS".as_ptr();
    // SAFETY: texts end with zero, and the bridges are used here alone.
    unsafe {
        let set = |value: &CStr| rtv_set_bridge_option(bridge, name, value.as_ptr());
        assert_eq!((set(c"2.5"), set(c"many")), (1, 0), "what is not understood changes nothing");
        let radius = |b| rtv_bridge_option(b, name);
        assert_eq!((radius(bridge), radius(other), rtv_option(name)), (2.5, 0.0, 0.0));
        assert_eq!(rtv_begin(bridge), 1);
        assert_eq!(set(c"3.5"), 1);
        assert_eq!(radius(bridge), 2.5, "a frame keeps the options that it began with");
        rtv_end(bridge);
        assert_eq!(radius(bridge), 3.5);
        assert_eq!((set(c""), radius(bridge)), (1, 0.0));
        assert_eq!(rtv_bridge_option(bridge, c"RTV_NOTHING".as_ptr()), -1.0);
        assert_eq!(radius(ptr::null_mut()), -1.0);
        rtv_free(bridge);
        rtv_free(other);
    }
}

/// The answers of twelve frames of one volume in a renderer of 1000 by 1000 pixels.
fn chosen(change: impl Fn(&mut RtvVolumeFacts, &mut RtvSceneVolume)) -> Vec<u32> {
    // SAFETY: all zero is no fact at all.
    let (mut facts, mut volume, mut scene): (RtvVolumeFacts, RtvSceneVolume, RtvSceneFacts) =
        unsafe { (std::mem::zeroed(), std::mem::zeroed(), std::mem::zeroed()) };
    facts.volume_class = c"vtkVolume".as_ptr();
    facts.mapper_class = c"vtkGPUVolumeRayCastMapper".as_ptr();
    (facts.has_data, facts.image, facts.scalars, facts.num_components) = (1, 1, 1, 1);
    (facts.dims, facts.range) = ([257; 3], [0.0, 1.0]);
    // All of it is clear: cheaper with rays at every level.
    let (values, opacities) = ([[1.0f32]; 8], [[0.0f32], [0.0]]);
    (volume.scalars, volume.dims) = (array(&values, RTV_F32), [2; 3]);
    volume.opacities = array(&opacities, RTV_F32);
    (volume.unit_distance, volume.sample_distance) = (1.0, 1.0 / 256.0);
    volume.world_from_unit = IDENTITY;
    change(&mut facts, &mut volume);
    let view = RtvView { width: 1000, height: 1000, ..view() };
    (volume.facts, volume.view) = (&facts, &view);
    (scene.pixels, scene.props) = (1_000_000, 1);
    let known = RtvSceneFacts { known: 1, software: 1, volumes: 1, ..scene };
    let bridge = rtv_new();
    // SAFETY: everything lives until the end of this function, and lengths are those of slices.
    let answers = (0..12).map(|_| unsafe {
        rtv_begin(bridge);
        let mut answer = rtv_choose(bridge, &scene);
        if answer == RTV_CHOICE_ASK_AGAIN {
            rtv_choose_volume(bridge, &volume);
            answer = rtv_choose(bridge, &known);
        }
        rtv_end(bridge);
        answer
    });
    let answers = answers.collect();
    // SAFETY: it is not used afterwards.
    unsafe { rtv_free(bridge) };
    answers
}

#[test]
fn a_volume_that_c_describes_goes_to_whoever_is_cheaper() {
    let traced = chosen(|_, _| ());
    let fast = rt_core::simd::SimdLevel::available().contains(&rt_core::simd::SimdLevel::Avx512);
    let expected = if fast { RTV_CHOICE_RAYS } else { traced[11] };
    assert_eq!((traced[0], traced[11]), (RTV_CHOICE_OPENGL, expected), "{traced:?}");
    let changes: [fn(&mut RtvVolumeFacts, &mut RtvSceneVolume); 8] = [
        |_, v| v.sample_distance = 0.5,
        // Not traced, or not as OpenGL samples it.
        |f, _| f.num_components = 3,
        |f, _| f.mask = 1,
        |f, _| f.blend_mode = RTV_BLEND_MAXIMUM,
        |_, v| v.sample_distance = 0.0,
        // Faults of the caller.
        |_, v| v.dims = [3; 3],
        |_, v| v.scalars.kind = RTV_F64,
        |_, v| v.world_from_unit = [f64::NAN; 16],
    ];
    for (k, change) in changes.into_iter().enumerate() {
        assert!(chosen(change).iter().all(|a| *a == RTV_CHOICE_OPENGL), "change {k}");
    }
    // SAFETY: null is allowed everywhere.
    unsafe {
        rtv_choose_volume(ptr::null_mut(), ptr::null());
        let bridge = rtv_new();
        rtv_choose_volume(bridge, ptr::null());
        rtv_choose_volume(bridge, &std::mem::zeroed());
        rtv_free(bridge);
    }
}

/// A panic that reaches C ends the program that we are a guest of.
#[test]
fn every_call_from_c_stops_panics() {
    // Calls that return a constant, or leave all to one that is looked at.
    let plain = ["rtv_abi", "rtv_api", "rtv_surface", "vtkGetFactoryCompilerUsed"];
    let sources = [include_str!("mod.rs"), include_str!("../loader/mod.rs")];
    let mut seen = 0;
    for source in sources {
        for part in source.split("#[unsafe(no_mangle)]").skip(1) {
            let body = part.split("\n}\n").next().unwrap_or_default();
            let name = body.split(" fn ").nth(1).and_then(|s| s.split('(').next()).unwrap();
            let caught = ["with(", "guarded("].iter().any(|g| body.contains(g));
            assert!(caught || plain.contains(&name), "{name} lets a panic through:\n{body}");
            seen += 1;
        }
    }
    assert!(seen >= 20, "{seen} calls were found");
}
