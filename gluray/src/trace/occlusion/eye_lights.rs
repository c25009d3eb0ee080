//! Lights at the eye and along the view: shadow rays are left out only where the eye cannot see a
//! shadow.

use super::*;
use crate::capture::draw::{Attributes, Draw};
use crate::capture::geometry_cache::{BuildCounts, GeometryCache};
use crate::cluster::row_share::RowShare;
use crate::enums::LESS;
use crate::state::current_attributes::CurrentAttributes;
use crate::state::material::Material;
use crate::state::snapshot::{GlLight, Snapshot};
use crate::trace::overrides::RayMaterial;
use crate::trace::path_tracing::PathTracer;
use crate::trace::view::View;
use crate::trace::{Rect, nearest};
use std::sync::Arc;

const N: i32 = 64;
/// Half the angle of the view.
const HALF: f64 = 0.5;
/// How far the eye is from the floor; the square is at height 1.
const HEIGHT: f64 = 4.0;

/// Depth from -1 to 1.
fn frustum() -> DMat4 {
    let (f, near, far) = (1.0 / HALF.tan(), 0.01, 100.0);
    let (a, b) = ((far + near) / (near - far), 2.0 * far * near / (near - far));
    DMat4::from_cols_array(&[f, 0., 0., 0., 0., f, 0., 0., 0., 0., a, -1., 0., 0., b, 0.])
}

/// Four units across and nine deep.
fn parallel() -> DMat4 {
    let m = [0.5, 0., 0., 0., 0., 0.5, 0., 0., 0., 0., -2.0 / 9.0, 0., 0., 0., -1., 1.];
    DMat4::from_cols_array(&m)
}

fn back(by: f64) -> DMat4 {
    DMat4::from_translation(DVec3::new(0.0, 0.0, -by))
}

fn numbers(m: DMat4) -> [f32; 16] {
    m.to_cols_array().map(|v| v as f32)
}

/// A square of half edge 1/4 at height 1 above a floor, beside the middle of the picture.
fn square_above_floor(light: [f32; 4], projection: DMat4, model_view: DMat4) -> Vec<Draw> {
    let white = Material {
        ambient: [0.0; 4],
        diffuse: [0.8, 0.8, 0.8, 1.0],
        specular: [0.0; 4],
        ..Material::default()
    };
    let current = CurrentAttributes {
        normal: [0.0, 0.0, 1.0],
        materials: [white; 2],
        ..CurrentAttributes::default()
    };
    let light = GlLight {
        diffuse: [1.0; 4],
        position: light,
        spot_cutoff_deg: 180.0,
        attenuation: [1.0, 0.0, 0.0],
        ..GlLight::default()
    };
    let state = Arc::new(Snapshot {
        model_view: numbers(model_view),
        projection: numbers(projection),
        viewport: [0, 0, N, N],
        depth_range: [0.0, 1.0],
        front_is_ccw: true,
        lighting: true,
        lights: vec![light],
        normalize: true,
        depth_test: true,
        depth_mask: true,
        depth_func: LESS,
        color_mask: true,
        ..Snapshot::default()
    });
    let mut cache = GeometryCache::default();
    let mut quad = |[x, y, z]: [f32; 3], r: f32| {
        let corners = [(-r, -r), (r, -r), (r, r), (-r, r)].map(|(u, v)| [x + u, y + v, z]);
        Draw {
            geometry: cache.of_indices(&corners, &[[0, 1, 2], [0, 2, 3]]),
            attributes: Arc::new(Attributes::constant(&current)),
            state: state.clone(),
            shading: Shading::Fixed,
            clip_from_object: crate::state::matrix::product(&state.projection, &state.model_view),
            calls: 1,
            ray_material: RayMaterial::default(),
        }
    };
    vec![quad([0.0; 3], 10.0), quad([1.0, 0.0, 1.0], 0.25)]
}

fn prepared(draws: &[Draw]) -> Vec<Prepared<'_>> {
    let ready = |d| Prepared::new(d, None, &mut BuildCounts::default()).expect("seen");
    draws.iter().map(ready).collect()
}

fn settings(mode: Mode) -> Settings {
    let mut out = Settings { mode, samples: 16, ..Settings::default() };
    (out.effects.shadows, out.effects.ambient_occlusion_samples) = (true, 0);
    out
}

/// Which pixels are black, row by row, and how many shadow rays that took.
fn black(light: [f32; 4], projection: DMat4, model_view: DMat4) -> (Vec<bool>, u64) {
    let draws = square_above_floor(light, projection, model_view);
    let (layer, [shadow, _]) = nearest(&prepared(&draws), &settings(Mode::Rich), RowShare::WHOLE);
    assert_eq!((layer.rect.w, layer.rect.h), (N, N), "the floor fills the picture");
    (layer.color.iter().map(|c| c[0] == 0).collect(), shadow)
}

/// Whether the perspective eye at [`HEIGHT`] sees a shadow of light along its view in a pixel.
fn is_shadowed(x: i32, y: i32) -> bool {
    let at = |k: i32| ((f64::from(k) + 0.5) / f64::from(N) * 2.0 - 1.0) * HALF.tan();
    let (tx, ty) = (at(x), at(y));
    let inside = |x: f64, y: f64| (x - 1.0).abs() < 0.25 && y.abs() < 0.25;
    let below = HEIGHT - 1.0;
    !inside(below * tx, below * ty) && inside(HEIGHT * tx, HEIGHT * ty)
}

#[test]
fn a_directional_headlight_casts_the_shadows_that_a_perspective_eye_sees() {
    let (black, _) = black([0.0, 0.0, 1.0, 0.0], frustum(), back(HEIGHT));
    for (k, found) in black.iter().enumerate() {
        let (x, y) = (k as i32 % N, k as i32 / N);
        assert_eq!(*found, is_shadowed(x, y), "pixel {x} {y}");
    }
    let dark = black.iter().filter(|b| **b).count();
    assert!(dark > 20, "the test looks at a shadow: {dark} pixels");
}

#[test]
fn light_along_the_rays_of_the_eye_sends_no_shadow_rays_and_other_light_does() {
    let (point, far) = ([0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]);
    for (light, projection) in [(point, frustum()), (far, parallel())] {
        let (black, rays) = black(light, projection, back(HEIGHT));
        assert_eq!((black.iter().filter(|b| **b).count(), rays), (0, 0), "{light:?}");
    }
    for (light, projection) in [(far, frustum()), (point, parallel())] {
        let (black, rays) = black(light, projection, back(HEIGHT));
        assert!(rays > 0 && black.contains(&true), "{light:?}: {rays} rays");
    }
}

#[test]
fn an_eye_that_the_projection_moves_is_not_the_origin_of_eye_space() {
    let moved = frustum() * back(HEIGHT);
    let (dark, rays) = black([0.0, 0.0, 0.0, 1.0], moved, back(HEIGHT));
    assert!(rays > 0 && dark.contains(&true), "a point before the eye casts shadows: {rays} rays");
    let (dark, rays) = black([0.0, 0.0, HEIGHT as f32, 1.0], moved, back(HEIGHT));
    assert_eq!((dark.iter().filter(|b| **b).count(), rays), (0, 0), "and one at the eye does not");
}

/// Mean brightness by paths of the pixels where parallel light would leave a shadow, and of others.
fn by_paths(light: [f32; 4]) -> [f32; 2] {
    let draws = square_above_floor(light, frustum(), back(HEIGHT));
    let view = View::of(&draws[0]).expect("a view");
    let (ready, settings) = (prepared(&draws), settings(Mode::Path));
    let rect = Rect { x: 0, y: 0, w: N, h: N };
    let colors =
        PathTracer::default().picture(&ready, &view, 0, rect, &settings, 0, RowShare::WHOLE);
    assert_eq!(colors.warnings, Vec::<String>::new());
    [true, false].map(|which| {
        let is_of = |k: usize| is_shadowed(k as i32 % N, k as i32 / N) == which;
        let of = colors.rgba.iter().enumerate().filter(|(k, _)| is_of(*k));
        let (sum, n) = of.fold((0.0, 0.0), |(sum, n), (_, c)| (sum + c[0], n + 1.0));
        sum / n
    })
}

#[test]
fn paths_see_the_shadows_of_a_directional_headlight_and_none_of_a_point_at_the_eye() {
    let [shadow, lit] = by_paths([0.0, 0.0, 1.0, 0.0]);
    assert!(shadow < 0.5 * lit, "{shadow} in shadow and {lit} beside it");
    let [beside, lit] = by_paths([0.0, 0.0, 0.0, 1.0]);
    assert!(beside > 0.8 * lit, "{beside} beside the square and {lit} elsewhere");
}
