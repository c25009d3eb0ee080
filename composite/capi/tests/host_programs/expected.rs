//! What the examples must write, made by the Rust interface: ranks are threads, and the data are
//! those of the examples.

use composite::render::{DataParallel, FrameOptions, RankScene};
use composite::{
    Communicator, Compositor, DepthPixel, Frame, Options, PremultipliedPixel, threads,
};
use rt_core::camera::Camera;
use rt_core::glam::{DVec3, Vec3};
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::mesh::TriMesh;
use rt_core::render::RenderOptions;
use rt_core::shapes::{Radii, Spheres};
use std::sync::Arc;

pub(crate) const SIZE: (u32, u32) = (96, 64);
/// Size of the picture.
pub(crate) const VIEW: (u32, u32) = (320, 200);

/// The bytes of an image with depth, of a blended image, and of a picture.
#[derive(PartialEq)]
pub(crate) struct Images {
    pub(crate) depth: Vec<u8>,
    pub(crate) alpha: Vec<u8>,
    pub(crate) picture: Vec<u8>,
}

type Buffers = (Vec<[u8; 4]>, Vec<f32>, Vec<[f32; 4]>);

fn drawn_by(rank: u32) -> Buffers {
    let (mut colors, mut depths, mut blended) = (Vec::new(), Vec::new(), Vec::new());
    for (y, x) in (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (y, x))) {
        let drawn = ((x + 5 * rank) / 16 + y / 16).is_multiple_of(2);
        let channels =
            [(60 * rank + 40) % 256, 2 * x, 3 * y, 256].map(|c| if drawn { c } else { 0 });
        colors.push(channels.map(|c| c.min(255) as u8));
        blended.push(channels.map(|c| c as f32 / 1024.0));
        depths.push(if drawn { ((x + 3 * y + 17 * rank) % 64) as f32 / 64.0 } else { 1.0 });
    }
    (colors, depths, blended)
}

fn scene_of(rank: u32) -> RankScene {
    let mut scene = RankScene::new();
    let white = scene.material(Material::matte([1.0; 3]));
    scene.light(Light::ambient([0.25; 3]));
    scene.light(Light::directional(DVec3::new(-1.0, -0.5, 1.0)).with_color([0.75; 3]));
    let x = rank as f32;
    let corners = [[x, 0.0], [x + 1.0, 0.0], [x + 1.0, 4.0], [x, 4.0]];
    let corners = corners.map(|[x, y]| Vec3::new(x, y, 0.0)).to_vec();
    scene.mesh("ground", TriMesh::new(corners, vec![[0, 1, 2], [0, 2, 3]]), white);
    let center = Vec3::new(x + 0.5, 1.5 + (rank % 3) as f32 * 0.5, 0.75);
    let odd = (rank % 2) as f32;
    let ball = Spheres::new(vec![center], Radii::Common(0.5)).expect("a ball");
    let ball = ball.with_colors(vec![[odd, 0.5, 1.0 - odd, 1.0]]).expect("its colour");
    scene.shape("balls", Arc::new(ball), white);
    scene
}

/// The images of a group of `ranks` ranks.
pub(crate) fn images(ranks: u32) -> Images {
    let outputs = threads::run(ranks as usize, |mut comm| {
        let (colors, depths, blended) = drawn_by(comm.rank() as u32);
        let frame = Frame::with_depth(SIZE.0, SIZE.1, &colors, &depths).expect("a frame");
        let mut compositor = Compositor::<DepthPixel<[u8; 4]>>::new(Options::default());
        let depth = compositor.composite(&mut comm, &frame).expect("an image").image;
        let frame = Frame::premultiplied(SIZE.0, SIZE.1, &blended).expect("a frame");
        let mut compositor = Compositor::<PremultipliedPixel<[f32; 4]>>::new(Options::default());
        let alpha = compositor.composite(&mut comm, &frame).expect("an image").image;
        let scene = scene_of(comm.rank() as u32);
        let renderer = DataParallel::distributed(&mut comm, scene, FrameOptions::default());
        let n = f64::from(ranks);
        let (eye, target) = (DVec3::new(0.5, -0.625, 0.5), DVec3::new(0.5 * n, 2.0, 0.0));
        let aspect = f64::from(VIEW.0) / f64::from(VIEW.1);
        let angle = std::f64::consts::FRAC_PI_4;
        let camera = Camera::perspective(eye * n, target, DVec3::Z, angle, aspect, [0.01, 1000.0]);
        let options = RenderOptions::new(VIEW.0, VIEW.1);
        let picture =
            renderer.expect("a scene").frame(&mut comm, &camera.expect("a camera"), &options);
        (depth, alpha, picture.expect("a picture").frame)
    });
    let first = outputs.into_iter().next().expect("a rank").expect("no panic");
    let (Some(depth), Some(alpha), Some(picture)) = first else { panic!("rank 0 has the images") };
    let floats = |pixels: &[[f32; 4]]| -> Vec<u8> {
        pixels.as_flattened().iter().flat_map(|v| v.to_ne_bytes()).collect()
    };
    Images {
        depth: depth.colors().as_flattened().to_vec(),
        alpha: floats(alpha.colors()),
        picture: floats(&picture.color),
    }
}
