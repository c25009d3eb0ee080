//! Ranks whose parts are stored meshes, of which memory has the pages that rays meet.
use crate::scenes::{self, AMBIENT, Case, camera, matte, options};
use crate::{assert_same, frame_options, one_node};
use composite::render::{DataParallel, FrameError, FrameOptions, RankScene, SecondaryRayPolicy};
use composite::{Communicator, threads};
use rt_core::bvh::{Geometry, StoredMesh, StoredMeshWriter};
use rt_core::glam::{DAffine3, DVec3};
use rt_core::light::Light;
use rt_core::scene::{AmbientOcclusion, Appearance, SceneBuilder};
use std::sync::Arc;

const BLOCKS: usize = 6;

/// A file of a block, opened anew: every rank keeps pages of its own.
fn block(bytes: &[u8]) -> Arc<StoredMesh> {
    Arc::new(StoredMesh::open(bytes.to_vec(), 1 << 20).expect("sound bytes"))
}

fn place(block: usize) -> DAffine3 {
    let (column, row) = ((block % 3) as f64 - 1.0, (block / 3) as f64 - 0.5);
    DAffine3::from_translation(DVec3::new(0.7 * column, 0.9 * row, 0.1 * column * row))
}

#[test]
fn blocks_in_stored_meshes_have_the_bits_of_one_node() {
    let mut mesh = scenes::bumps(DVec3::ZERO, 80);
    mesh.positions.iter_mut().for_each(|p| *p *= 0.4);
    let mut writer = StoredMeshWriter::new(Vec::new(), mesh.origin).expect("memory");
    writer.add_mesh(&mesh).expect("a sound mesh");
    let (bytes, report) = writer.finish().expect("a sound mesh");
    assert!(report.pages > 1, "{report:?}");

    let mut scene = SceneBuilder::new();
    let material = scene.material(matte());
    for k in 0..BLOCKS {
        let geometry = scene.geometry(Geometry::Shape(block(&bytes)));
        scene.instance(geometry, place(k), Appearance::new(material));
    }
    scene.light(Light::point(DVec3::new(1.0, 1.0, 4.0)));
    scene.light(Light::ambient(AMBIENT));
    let mut scene = scene.build().expect("a sound scene");
    scene.ambient_occlusion = Some(AmbientOcclusion { distance: 0.5, rays: 4 });
    let case =
        Case { name: "stored blocks", scene, camera: camera(DVec3::ZERO), options: options() };
    let expected = one_node(&case);
    assert!(expected.color.iter().filter(|c| c[3] > 0.0).count() > 1000, "blocks are in sight");

    for ranks in [1, 4, BLOCKS] {
        let outputs = threads::run(ranks, |mut comm| {
            let mut mine = RankScene::new();
            mine.materials = case.scene.materials.clone();
            mine.lights = case.scene.lights.clone();
            mine.background = case.scene.background;
            mine.ambient_occlusion = case.scene.ambient_occlusion;
            for k in (0..BLOCKS).filter(|k| k % ranks == comm.rank()) {
                mine.shape(format!("block {k}"), block(&bytes), 0);
                mine.place(vec![place(k)]);
            }
            let options = FrameOptions {
                root: Some(ranks - 1),
                ..frame_options(SecondaryRayPolicy::Forward)
            };
            let mut renderer = DataParallel::distributed(&mut comm, mine, options)?;
            renderer.frame(&mut comm, &case.camera, &case.options)
        });
        let outputs: Vec<_> = outputs
            .into_iter()
            .map(|o: Result<Result<_, FrameError>, _>| o.unwrap().unwrap())
            .collect();
        assert_same(&expected, &outputs, &format!("{ranks} ranks"));
    }
}
