//! CPU time of a volume's frame: integrated to half a level, and with samples a spacing apart.
//!
//! `cargo run --release -p rt-core --example volume_cost [-- POINTS PIXELS]`

use rt_core::bvh::{BuildOptions, World};
use rt_core::camera::Camera;
use rt_core::colormap::ColorMap;
use rt_core::glam::{DAffine3, DVec3, UVec3, Vec3};
use rt_core::grid::Grid;
use rt_core::mesh::TriMesh;
use rt_core::render::{RenderOptions, Renderer};
use rt_core::scene::{Scene, VolumeInstance};
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{Volume, VolumeOptions, VolumeShading};
use std::sync::Arc;
use std::time::Instant;

/// A smooth field, and few small balls in nothing.
fn field(kind: &str, points: u32) -> Vec<f32> {
    let n = points as usize;
    let at = |i: usize| 2.0 * i as f32 / (n - 1) as f32 - 1.0;
    let balls: Vec<Vec3> = (0..40u32)
        .map(|i| {
            let unit = |k: u32| {
                (i.wrapping_mul(2_654_435_761).wrapping_add(k) >> 8) as f32 / 2f32.powi(24)
            };
            1.8 * Vec3::new(unit(0), unit(911_382_323), unit(1_972_111_111)) - 0.9
        })
        .collect();
    let mut values = vec![0.0; n * n * n];
    for (k, slab) in values.chunks_mut(n * n).enumerate() {
        for (j, row) in slab.chunks_mut(n).enumerate() {
            for (i, v) in row.iter_mut().enumerate() {
                let p = Vec3::new(at(i), at(j), at(k));
                *v = match kind {
                    "smooth" => {
                        0.6 + 0.3 * (-p.length_squared()).exp()
                            + 0.08 * ((9.0 * p.x).sin() + (11.0 * p.y).sin() + (13.0 * p.z).cos())
                    }
                    _ => balls
                        .iter()
                        .map(|b| (-400.0 * p.distance_squared(*b)).exp())
                        .fold(0.0, f32::max),
                };
            }
        }
    }
    values
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let points: u32 = arguments.next().map_or(Ok(65), |a| a.parse())?;
    let pixels: u32 = arguments.next().map_or(Ok(512), |a| a.parse())?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    for kind in ["smooth", "sparse"] {
        let grid = Arc::new(Grid::new(
            UVec3::splat(points),
            DVec3::ZERO,
            DVec3::ONE,
            field(kind, points),
        )?);
        let colors = ColorMap::new(
            vec![[0.1, 0.2, 0.9, 1.0], [0.9, 0.9, 0.7, 1.0], [0.9, 0.1, 0.1, 1.0]],
            [0.0, 1.0],
        );
        let opacity: &[[f32; 2]] = match kind {
            "smooth" => &[[0.0, 0.0], [0.55, 0.0], [0.7, 0.2], [1.0, 0.5]],
            _ => &[[0.0, 0.0], [0.1, 0.0], [0.3, 0.3], [1.0, 0.8]],
        };
        let transfer = TransferFunction::from_opacity(colors, opacity, points as f32 / 64.0)?;
        for lit in [false, true] {
            let shading = lit.then(|| VolumeShading {
                ambient: 0.2,
                diffuse: 0.7,
                specular: 0.3,
                shininess: 12.0,
                ..VolumeShading::default()
            });
            for sample_distance in [None, Some(1.0)] {
                let options = VolumeOptions {
                    shading,
                    sample_distance,
                    clamped_gradients: true,
                    ..VolumeOptions::default()
                };
                let volume = Volume::new(Arc::clone(&grid), transfer.clone(), options)?;
                let mut scene = Scene::new(World::from_mesh(
                    TriMesh::new(Vec::new(), Vec::new()),
                    &BuildOptions::default(),
                )?);
                let size = f64::from(points);
                let (eye, middle) = (DVec3::new(1.0, -1.1, 0.9) * size, DVec3::splat(0.5 * size));
                let limits = [0.01 * size, 10.0 * size];
                let camera = Camera::perspective(eye, middle, DVec3::Z, 0.8, 1.0, limits)?;
                scene.volumes.push(VolumeInstance {
                    volume: Arc::new(volume),
                    world_from_object: DAffine3::IDENTITY,
                });
                let frame = RenderOptions::new(pixels, pixels);
                let mut renderer = Renderer::new();
                let mut times = Vec::new();
                for _ in 0..5 {
                    let start = Instant::now();
                    pool.install(|| renderer.render(&scene, &camera, &frame))?;
                    times.push(start.elapsed().as_secs_f64());
                }
                times.sort_by(f64::total_cmp);
                let how = if sample_distance.is_some() { "samples" } else { "integrated" };
                println!(
                    "{kind} lit={lit} {how}: {:.4} s ({:.4} to {:.4})",
                    times[2], times[0], times[4]
                );
            }
        }
    }
    Ok(())
}
