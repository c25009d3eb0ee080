//! The calls as C makes them, with what foreign code gets wrong.

use super::*;
use std::os::raw::c_void;
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
const IDENTITY: [f64; 16] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];

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
    let polys = RtvCells { offsets: array(offsets, RTV_I64), connectivity: array(connectivity, RTV_I64) };
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
        background_bottom: [0.0; 3],
        background_top: [0.0; 3],
        focus_distance: 1.0,
        width: 4,
        height: 4,
        interactive: 0,
        shadows: 0,
    }
}

const NO_PICTURE: RtvPicture = RtvPicture {
    width: 0,
    height: 0,
    opaque: ptr::null(),
    blended: ptr::null(),
    depth: ptr::null(),
    first_depth: ptr::null(),
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
fn nothing_to_draw_gives_an_empty_picture() {
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
fn sizes_that_cannot_be_drawn_are_told_and_left_to_opengl() {
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
