//! An image that comes as one layer shows what the image in two layers shows, and without one where
//! it would not.

use rt_core::glam::{DMat4, DVec3};
use vtk_bridge::bridge::Bridge;
use vtk_bridge::input::{Scalars, View, Volume, VolumeBlend};
use vtk_bridge::options::Options;
use vtk_bridge::window_image::WindowImage;

const SIZE: u32 = 40;
const BACKGROUND: [f32; 3] = [0.9, 0.2, 0.5];

/// A thin medium in front of nothing.
fn image(one_layer: bool, brightness: f32) -> WindowImage {
    let n = 9u32;
    let values: Vec<f32> = (0..n * n * n)
        .map(|i| {
            let p = [i % n, i / n % n, i / n / n].map(|k| k as f32 - 4.0);
            (16.0 - p.iter().map(|x| x * x).sum::<f32>()).max(0.0)
        })
        .collect();
    let mut bridge = Bridge::default();
    bridge.begin(&Options::default());
    bridge
        .add_volume(&Volume {
            name: "medium",
            key: 0,
            scalars: Scalars::F32(&values),
            dims: [n; 3],
            spacing: [0.25; 3],
            world_from_data: DMat4::from_translation(DVec3::splat(-1.0)),
            nearest: false,
            range: [0.0, 16.0],
            colors: &[[0.1, 0.3, 1.0], [1.0, 0.8, 0.2]].map(|c| c.map(|v| brightness * v)),
            opacities: &[0.0, 0.4],
            unit_distance: 0.25,
            sample_distance: 0.1,
            viewer: None,
            shading: None,
            lights: &[],
            gradient_opacities: &[],
            steepest: 0.0,
            blend: VolumeBlend::Composite,
            cells: false,
            cropping: None,
            clip_planes: &[],
            cropping_in_texels: false,
            clipping_in_texels: false,
        })
        .expect("a volume");
    let view = View {
        clip_from_world: DMat4::from_scale(DVec3::new(0.8, 0.8, -0.4)),
        viewer: None,
        width: SIZE,
        height: SIZE,
        background: [BACKGROUND; 2],
        interactive: false,
        shadows: false,
        samples: 0,
        window_samples: 0,
        one_layer,
        lens: None,
    };
    bridge.render(&view).expect("an image").clone()
}

#[test]
fn one_layer_shows_what_two_show() {
    let (one, two) = (image(true, 1.0), image(false, 1.0));
    assert!(two.straight.is_empty() && two.first_depth.iter().any(|d| *d < 1.0));
    assert_eq!(one.straight.len(), two.blended.len());
    let mut seen = 0;
    for (straight, blended) in one.straight.iter().zip(&two.blended) {
        let [.., a] = straight.map(|v| f32::from(v) / 65535.0);
        for c in 0..3 {
            let layer = a * f32::from(straight[c]) / 65535.0 + (1.0 - a) * BACKGROUND[c];
            let wanted = blended[c] + (1.0 - blended[3]) * BACKGROUND[c];
            assert!((layer - wanted).abs() < 0.1 / 255.0, "{layer} {wanted}");
        }
        seen += usize::from(a > 0.1);
    }
    assert!(seen > 100, "{seen} pixels");
}

#[test]
fn colors_brighter_than_their_opacity_keep_two_layers() {
    let (bright, two) = (image(true, 3.0), image(false, 3.0));
    assert!(bright.straight.is_empty());
    assert_eq!(bright.blended, two.blended);
    assert_eq!(bright.first_depth, two.first_depth);
}
