//! Where a shape's data become unreadable on one rank, nobody gets a picture.
use crate::scenes;
use composite::render::{DataParallel, FrameOptions, RankScene};
use composite::{Communicator, threads};
use rt_core::glam::DVec3;
use rt_core::math::Aabb;
use rt_core::prelude::*;
use rt_core::render::RenderOptions;
use rt_core::shapes::{Radii, Shape, ShapeHit, ShapeSurface, Spheres};
use std::sync::Arc;
use std::time::Duration;

const RANKS: usize = 3;

/// A shape that a ray cannot read.
struct Unreadable(Spheres);

impl Shape for Unreadable {
    fn num_primitives(&self) -> usize {
        self.0.num_primitives()
    }

    fn bounds(&self, prim: u32) -> Aabb {
        self.0.bounds(prim)
    }

    fn closest(&self, _: u32, _: &Ray) -> Option<ShapeHit> {
        None
    }

    fn surface(&self, prim: u32, hit: &ShapeHit, ray: &Ray) -> ShapeSurface {
        self.0.surface(prim, hit, ray)
    }

    fn failure(&self) -> Option<String> {
        Some("a page is missing".into())
    }
}

#[test]
fn a_shape_that_one_rank_cannot_read_leaves_the_root_without_a_picture() {
    let case = scenes::occlusion_alone();
    for stream in [false, true] {
        let results = threads::run(RANKS, |mut comm| {
            let mut scene = RankScene::new();
            let matte = scene.material(scenes::matte());
            scene.mesh("ground", scenes::bumps(DVec3::ZERO, 6), matte);
            if comm.rank() == 1 {
                let spheres = Spheres::new(vec![Vec3::Z], Radii::Common(0.1)).expect("a radius");
                scene.shape("page", Arc::new(Unreadable(spheres)), matte);
            }
            let options = FrameOptions {
                timeout: Duration::from_secs(60),
                stream,
                ..FrameOptions::default()
            };
            let mut renderer = DataParallel::distributed(&mut comm, scene, options)?;
            let options = RenderOptions::new(24, 24);
            renderer.frame(&mut comm, &case.camera, &options).map(|_| ())
        });
        let ends: Vec<_> = results.into_iter().map(|r| r.expect("no rank panics")).collect();
        let told = |end: &Result<(), _>| end.as_ref().err().map(ToString::to_string);
        assert!(told(&ends[1]).is_some_and(|e| e.contains("a page is missing")), "{ends:?}");
        // A rank that has sent its tiles is done. Streamed ones may all have been sent before.
        let root = told(&ends[0]);
        assert!(stream || root.is_some_and(|e| e.contains("a page is missing")), "{ends:?}");
    }
}
