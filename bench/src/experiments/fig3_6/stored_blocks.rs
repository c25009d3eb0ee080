//! Weak scaling at the dissertation's size: 49 million triangles on every rank, up to 6 thousand
//! million on 128. Every rank has a wavelet of its own, a block of the whole, in a stored mesh: of
//! it, memory has what rays meet.

use super::super::Context;
use super::super::many_ranks::{frames_of, with_cost};
use super::{Lighting, OCCLUSION_RAYS};
use crate::record::{Record, Row};
use crate::stored_data::store_wavelet;
use anyhow::Context as _;
use composite::Communicator as _;
use composite::comm::sim::SimComm;
use composite::render::{DataParallel, FrameOptions, RankScene};
use datasets::stored_mesh;
use rt_core::camera::Camera;
use rt_core::environment::Background;
use rt_core::glam::{DAffine3, DVec3, UVec3};
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::render::RenderOptions;
use rt_core::scene::AmbientOcclusion;
use std::path::Path;
use std::sync::Arc;

/// Million triangles of a rank.
const MILLIONS: u32 = 49;
/// Length of a side of the wavelet.
const SIDE: f64 = 200.0;
/// Bytes of pages that a rank keeps.
const BUDGET: usize = 128 << 20;
/// Bytes for triangles that wait to be stored.
const STORING: usize = 2 << 30;
/// Vertical angle of view, in degrees.
const ANGLE: f64 = 30.0;

/// How many blocks lie along each axis, for a power of two.
fn blocks(ranks: usize) -> UVec3 {
    let doublings = ranks.ilog2();
    let along = |axis: u32| 1 << ((doublings + 2 - axis) / 3);
    UVec3::new(along(0), along(1), along(2))
}

/// The middle of a rank's block; that of all is the origin.
fn middle(rank: usize, blocks: UVec3) -> DVec3 {
    let rank = rank as u32;
    let at = UVec3::new(rank % blocks.x, rank / blocks.x % blocks.y, rank / blocks.x / blocks.y);
    (at.as_dvec3() + 0.5 - 0.5 * blocks.as_dvec3()) * SIDE
}

/// A view of all blocks.
fn camera(blocks: UVec3) -> anyhow::Result<Camera> {
    let radius = 0.5 * SIDE * blocks.as_dvec3().length();
    let angle = ANGLE.to_radians();
    let distance = radius / (0.5 * angle).sin();
    let eye = distance * DVec3::new(-0.55, -0.75, 0.4).normalize();
    let limits = [1e-3 * distance, distance + 2.0 * radius];
    Ok(Camera::perspective(eye, DVec3::ZERO, DVec3::Z, angle, 1.0, limits)?)
}

/// The part of one rank.
fn scene(path: &Path, rank: usize, blocks: UVec3, light: Lighting) -> anyhow::Result<RankScene> {
    let mesh = stored_mesh::open(path, BUDGET)?;
    let mut scene = RankScene::new();
    let matte = scene.material(Material::matte([0.8; 3]));
    scene.shape(format!("block {rank:03}"), Arc::new(mesh), matte);
    scene.place(vec![DAffine3::from_translation(middle(rank, blocks))]);
    scene.background = Background::Constant([1.0; 4]);
    if light == Lighting::Headlight {
        scene.light(Light::headlight());
    } else {
        let lamp = 2.0 * SIDE * blocks.as_dvec3().length() * DVec3::new(-0.8, -0.9, 1.5);
        scene.light(Light::point(lamp).with_color([0.75; 3]));
        scene.light(Light::ambient([0.35; 3]));
        scene.ambient_occlusion =
            Some(AmbientOcclusion { distance: 0.15 * SIDE, rays: OCCLUSION_RAYS });
    }
    Ok(scene)
}

pub(super) fn run(
    context: &mut Context<'_>,
    record: &mut Record,
    ranks: impl Iterator<Item = usize>,
    pixels: u32,
    count: usize,
) -> anyhow::Result<()> {
    record.notes.push(format!(
        "The size of the dissertation (--thesis): every rank has a wavelet of {MILLIONS} million \
         triangles, a block of the whole, in a stored mesh of which it keeps at most {} MB. All \
         ranks read the same file, each with pages of its own; what the system keeps of the file \
         they share. The first frame, which reads most pages, is not counted.",
        BUDGET >> 20
    ));
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("block.rtmesh");
    let stored = store_wavelet(&path, MILLIONS, STORING, &mut |surface| {
        context.report_step(format!("storing {}", surface.label))
    })?;
    let of_rank = stored.triangles;
    let render = RenderOptions::new(pixels, pixels);
    for ranks in ranks {
        let blocks = blocks(ranks);
        let camera = camera(blocks)?;
        context.part(record, &format!("{ranks} ranks"), |context, record| {
            for light in Lighting::ALL {
                context.report_step(format!("{ranks} ranks, {}", light.name()))?;
                let options =
                    FrameOptions { secondary_rays: light.secondary_rays(), ..Default::default() };
                let measured = frames_of(ranks, count, &options, |comm, options| {
                    let scene = scene(&path, comm.rank(), blocks, light)
                        .with_context(|| format!("rank {}", comm.rank()))?;
                    let mut renderer = DataParallel::distributed(comm, scene, options.clone())?;
                    let (camera, render) = (&camera, &render);
                    Ok(move |comm: &mut SimComm| Ok(renderer.frame(comm, camera, render)?))
                })?;
                record.rows.push(
                    with_cost(Row::new(), ranks, &measured)
                        .with("light", light.name())
                        .with("triangles", of_rank * ranks as u64)
                        .with("per_rank", of_rank),
                );
            }
            Ok(())
        })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_fill_a_box_and_the_camera_sees_all_of_it() {
        for (ranks, expected) in [(1, [1, 1, 1]), (2, [2, 1, 1]), (8, [2, 2, 2]), (128, [8, 4, 4])]
        {
            let blocks = blocks(ranks);
            assert_eq!(blocks.to_array(), expected);
            let mut sum = DVec3::ZERO;
            let camera = camera(blocks).unwrap();
            for rank in 0..ranks {
                sum += middle(rank, blocks);
                for corner in 0..8u32 {
                    let side = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2).as_dvec3();
                    let point = middle(rank, blocks) + (side - 0.5) * SIDE;
                    let ndc = camera.clip_from_world().project_point3(point);
                    assert!(ndc.x.abs() <= 1.0 && ndc.y.abs() <= 1.0, "{ranks}: {ndc}");
                }
            }
            assert!(sum.length() < 1e-9);
        }
    }
}
