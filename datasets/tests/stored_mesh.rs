//! Stored meshes in files: cut, changed, not finished, and rendered.

use datasets::stored_mesh::{create, finish, open};
use rt_core::mesh::{MeshSlices, TriMesh};
use rt_core::prelude::*;
use rt_core::render::{RenderError, render};
use std::path::Path;
use std::sync::Arc;

/// A height field of 2 n² triangles between -1 and 1.
fn hills(n: u32) -> TriMesh {
    let at = |i: u32| 2.0 * i as f32 / n as f32 - 1.0;
    let point = |i: u32, j: u32| {
        let (x, y) = (at(i), at(j));
        Vec3::new(x, y, 0.2 * (5.0 * x).sin() * (4.0 * y).cos())
    };
    let positions = (0..=n).flat_map(|j| (0..=n).map(move |i| point(i, j))).collect();
    let quad = |i: u32, j: u32| {
        let a = j * (n + 1) + i;
        [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
    };
    let indices = (0..n).flat_map(|j| (0..n).flat_map(move |i| quad(i, j))).collect();
    TriMesh::new(positions, indices)
}

fn store(mesh: &TriMesh, path: &Path) {
    let mut writer = create(path, mesh.origin).expect("a new file");
    writer.set_memory(0);
    let all = MeshSlices::of_mesh(mesh);
    for indices in all.indices.chunks(3 * 5000) {
        writer.add(&MeshSlices { indices, ..all }).expect("a piece");
    }
    finish(writer).expect("a complete file");
}

fn image(path: &Path, budget: usize) -> Result<Frame, RenderError> {
    let mut scene = SceneBuilder::new();
    scene.shape(Arc::new(open(path, budget).expect("a sound file")), Material::matte([0.8; 3]));
    scene.light(Light::directional(DVec3::new(1.0, 0.5, 1.0)));
    let scene = scene.build().expect("a scene");
    let eye = DVec3::new(0.3, -2.0, 2.0);
    let camera =
        Camera::perspective(eye, DVec3::ZERO, DVec3::Z, 0.9, 1.0, [0.1, 9.0]).expect("a camera");
    let options = RenderOptions { effects: Some(Effects::SHADOWS), ..RenderOptions::new(48, 48) };
    render(&scene, &camera, &options).map(|output| output.frame)
}

#[test]
fn a_picture_has_the_same_bits_with_any_budget_of_memory() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("hills.rtmesh");
    store(&hills(150), &path);
    let pictures = [0, 200_000, usize::MAX].map(|budget| image(&path, budget).expect("a picture"));
    assert!(pictures[0].color == pictures[1].color && pictures[0].color == pictures[2].color);
    let lit = pictures[0].color.iter().filter(|c| c[3] > 0.0 && c[0] > 0.1).count();
    assert!(lit > 500, "{lit} of {}", pictures[0].color.len());
}

#[test]
fn a_render_fails_when_the_file_changes_or_is_cut_below_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("hills.rtmesh");
    store(&hills(60), &path);
    assert!(image(&path, 0).is_ok());
    let whole = std::fs::read(&path).expect("the file");
    let mut changed = whole.clone();
    changed[700] ^= 1;
    std::fs::write(&path, &changed).expect("the same file");
    let error = image(&path, 0).expect_err("a damaged page");
    assert!(matches!(error, RenderError::Unreadable { geometry: 0, .. }), "{error}");
    assert!(error.to_string().contains("hills.rtmesh"), "{error}");
    std::fs::write(&path, &whole).expect("the same file");

    // Cut after it was opened: a mapped file would end the process here.
    let mesh = open(&path, 0).expect("a sound file");
    let file = std::fs::OpenOptions::new().write(true).open(&path).expect("the file");
    file.set_len(200).expect("a shorter file");
    let down = Ray::new(Vec3::new(0.1, 0.2, 3.0), Vec3::NEG_Z);
    let pages = 0..mesh.report().pages as u32;
    assert!(pages.into_iter().all(|page| mesh.triangle(page, &down).is_none()));
    assert!(mesh.failure().expect("a failure").contains("cannot read"), "{:?}", mesh.failure());
    assert!(open(&path, 0).is_err());
}

#[test]
fn what_is_not_finished_leaves_no_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.rtmesh");
    let mut writer = create(&path, DVec3::ZERO).expect("a new file");
    writer.add(&MeshSlices::of_mesh(&hills(3))).expect("a piece");
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 1);
    drop(writer);
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 0);
    let error = create(&folder.path().join("none/a.rtmesh"), DVec3::ZERO).err();
    assert!(error.expect("no folder").to_string().contains("none"));
    let error = open(&path, 0).err().expect("no file").to_string();
    assert!(error.contains("a.rtmesh") && error.contains("cannot open"), "{error}");
}
