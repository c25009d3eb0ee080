//! Rays in f64 against rays in f32 on the same mesh, in turns on one thread: the medians of eleven
//! rounds, and how fast f64 is of f32. `cargo bench -p rt-core --bench double_precision`
//!
//! The f64 world is the same mesh at the coordinates of a UTM zone, which f32 does not have.

mod common;

use rt_core::bvh::{BuildOptions, MeshF64, RayF64, World, WorldF64};
use rt_core::glam::{DVec3, Vec3};
use rt_core::math::{SplitMix64, median_high};
use rt_core::ray::{HitBlock, LANES, Ray, RayBlock};
use std::hint::black_box;
use std::time::Instant;

const ROUNDS: usize = 11;
const UTM: DVec3 = DVec3::new(500_000.0, 5_400_000.0, 300.0);

/// The medians of both, nanoseconds a ray.
fn in_turns(rays: usize, mut single: impl FnMut(), mut double: impl FnMut()) -> [f64; 2] {
    let mut times = [const { Vec::new() }; 2];
    let clock = |work: &mut dyn FnMut()| {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64() * 1e9 / rays as f64
    };
    for _ in 0..ROUNDS {
        times[0].push(clock(&mut single));
        times[1].push(clock(&mut double));
    }
    times.map(|mut t| median_high(&mut t).unwrap_or(f64::NAN))
}

fn main() {
    let mesh = common::shells();
    let positions = mesh.positions.iter().map(|p| UTM + p.as_dvec3()).collect();
    let options = BuildOptions::default();
    let double = WorldF64::from_mesh(MeshF64::new(positions, mesh.indices.clone()), &options)
        .expect("a sound mesh");
    let world = World::from_mesh(mesh.clone(), &options).expect("a sound mesh");

    // ---- Rays: through pixels, from what these meet to a light, around that, and anywhere.
    let primary = common::primary_rays(&world, 512);
    let points = common::points_met(&world, &mesh, &primary);
    let light = Vec3::new(4.0, 5.0, 3.0);
    let mut r = SplitMix64::new(1);
    let shadow: Vec<Ray> =
        points.iter().map(|(p, _)| Ray::new(*p, light - *p).with_t_max(1.0)).collect();
    let occlusion: Vec<Ray> = points
        .iter()
        .flat_map(|(p, n)| [0; 4].map(|_| Ray::new(*p, *n + r.direction().as_vec3())))
        .collect();
    let mut anywhere = || (r.direction() * (1.3 * r.unit())).as_vec3();
    let random: Vec<Ray> = (0..points.len())
        .map(|_| {
            let from = anywhere();
            Ray::new(from, anywhere() - from)
        })
        .collect();
    let primary: Vec<Ray> =
        primary.iter().flat_map(|b| (0..LANES).map(|lane| b.get(lane))).collect();

    println!("{} triangles; ns a ray; speed of f64 as a part of that of f32", mesh.indices.len());
    println!("{:32} {:>8} {:>8} {:>6}", "", "f32", "f64", "speed");
    let row = |name: &str, [a, b]: [f64; 2]| {
        println!("{name:32} {a:8.1} {b:8.1} {:5.0} %", 100.0 * a / b);
    };
    let sets = [("primary", primary), ("shadow", shadow), ("occlusion", occlusion)];
    for (name, rays) in sets.iter().map(|(n, r)| (*n, r)).chain([("random", &random)]) {
        let blocks = RayBlock::from_rays(rays);
        let wide = |ray: &Ray| RayF64 {
            t_max: f64::from(ray.t_max),
            ..RayF64::new(UTM + ray.origin.as_dvec3(), ray.dir.as_dvec3())
        };
        let rays64: Vec<RayF64> = rays.iter().map(wide).collect();
        let mut hits = vec![HitBlock::MISS; blocks.len()];
        let mut hits64 = vec![None; rays.len()];
        let mut masks = vec![0u16; blocks.len()];
        let mut blocked = vec![false; rays.len()];
        let n = rays.len();
        let any = name == "shadow" || name == "occlusion";
        if any {
            let one_by_one = in_turns(
                n,
                || _ = black_box(rays.iter().filter(|ray| world.occluded(ray)).count()),
                || _ = black_box(rays64.iter().filter(|ray| double.occluded(ray)).count()),
            );
            row(&format!("{name}, one by one"), one_by_one);
            let together = in_turns(
                n,
                || world.occluded_incoherent(&blocks, &mut masks).expect("one each"),
                || double.occluded_of_rays(&rays64, &mut blocked).expect("one each"),
            );
            row(&format!("{name}, many"), together);
            let set: u32 = masks.iter().map(|m| m.count_ones()).sum();
            let set64 = blocked.iter().filter(|b| **b).count();
            println!("{:32} {set:8} {set64:8} blocked", "");
        } else {
            let one_by_one = in_turns(
                n,
                || _ = black_box(rays.iter().filter_map(|ray| world.closest(ray)).count()),
                || _ = black_box(rays64.iter().filter_map(|ray| double.closest(ray)).count()),
            );
            row(&format!("{name}, one by one"), one_by_one);
            let together = in_turns(
                n,
                || world.closest_incoherent(&blocks, &mut hits).expect("one each"),
                || double.closest_of_rays(&rays64, &mut hits64).expect("one each"),
            );
            row(&format!("{name}, many"), together);
        }
        if name == "primary" {
            let packets = in_turns(
                n,
                || world.closest_coherent(&blocks, &mut hits).expect("one each"),
                || double.closest_of_rays(&rays64, &mut hits64).expect("one each"),
            );
            row(&format!("{name}, packets in f32"), packets);
        }
    }
}
