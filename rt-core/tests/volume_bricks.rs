//! Rays carried from brick to brick of a volume accumulate the same bits as in the whole volume.
#![cfg(feature = "render")]
use rt_core::colormap::ColorMap;
use rt_core::glam::{DVec3, UVec3, Vec3};
use rt_core::grid::Grid;
use rt_core::ray::Ray;
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{
    Brick, Cropping, GridExtent, Interpolation, PartialIntegral, RaySegments, Volume, VolumeError,
    VolumeOptions, VolumeQuality, VolumeSample, VolumeShading,
};

const DIMS: UVec3 = UVec3::new(41, 37, 29);
const SPACING: DVec3 = DVec3::new(0.1, 0.1, 0.06);

/// Waves that are transparent in one corner, with one point missing.
fn volume(options: VolumeOptions) -> Volume {
    let value = |k: u32| {
        let (x, y, z) = (k % DIMS.x, k / DIMS.x % DIMS.y, k / DIMS.x / DIMS.y);
        let at = Vec3::new(x as f32, y as f32, z as f32) * 0.3;
        let v =
            if x < 12 && y < 15 { 0.0 } else { 0.5 + 0.5 * at.x.sin() * at.y.cos() * at.z.sin() };
        if k == 20_000 { f32::NAN } else { v }
    };
    let values = (0..DIMS.element_product()).map(value).collect();
    let grid = Grid::new(DIMS, DVec3::new(-2.0, -1.8, -0.7), SPACING, values).unwrap();
    let colors = ColorMap::new(vec![[0.1, 0.2, 0.9, 1.0], [1.0, 0.8, 0.1, 1.0]], [0.0, 1.0]);
    let opacity = [[0.2, 0.0], [0.6, 0.3], [1.0, 0.9]];
    let transfer = TransferFunction::from_opacity(colors, &opacity, 0.4).unwrap();
    Volume::new(grid.into(), transfer, options).unwrap()
}

/// Twelve bricks, four of which have no block.
fn bricks(blocks: UVec3) -> Vec<Brick> {
    let (x, y, z) = (blocks.x / 2, blocks.y / 3, blocks.z / 2);
    let mut out = Vec::new();
    for (x0, x1) in [(0, x), (x, blocks.x)] {
        for (y0, y1) in [(0, y), (y, y), (y, blocks.y)] {
            for (z0, z1) in [(0, z), (z, blocks.z)] {
                out.push(Brick { first: UVec3::new(x0, y0, z0), end: UVec3::new(x1, y1, z1) });
            }
        }
    }
    out
}

/// Ray `n`: some along an axis and exactly in grid planes, some from grid points.
fn ray(n: u32, random: &mut impl FnMut() -> f32) -> Ray {
    let from = Vec3::new(random() * 6.0 - 1.0, random() * 6.0 - 1.2, random() * 3.0 - 0.7);
    let at = Vec3::new(random() * 4.0, random() * 3.6, random() * 1.7);
    if n.is_multiple_of(5) {
        return Ray::new(Vec3::new(-1.0, 0.8, (n % 29) as f32 * 0.06), Vec3::X * (0.1 + at.x));
    }
    let from = if n.is_multiple_of(7) { from.round() } else { from };
    Ray::new(from, at - from)
}

fn bits(s: &VolumeSample) -> ([u32; 4], u32, u32) {
    (s.rgba.map(f32::to_bits), s.depth.to_bits(), s.samples)
}

#[test]
fn rays_through_bricks_have_the_bits_of_rays_through_the_whole() {
    let shading = VolumeShading {
        ambient: 0.3,
        diffuse: 0.7,
        specular: 0.4,
        shininess: 9.0,
        light: None,
        half_gradient: 1.0,
        ..VolumeShading::default()
    };
    let mut state = 12_345u64;
    let mut random = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1u64 << 24) as f32
    };
    let (mut met, mut through_three) = (0, 0);
    let size = SPACING * (DIMS - UVec3::ONE).as_dvec3();
    // A fence, which leaves up to three parts of a ray.
    let fence = Some(Cropping { planes: [0.3 * size, 0.7 * size], regions: 0x2eb_feba });
    for interpolation in [Interpolation::Linear, Interpolation::Nearest] {
        for (shading, cropping) in [(None, None), (Some(shading), None), (None, fence)] {
            let options = VolumeOptions { shading, interpolation, ..VolumeOptions::default() };
            let whole = volume(VolumeOptions { cropping, ..options });
            let bricks = bricks(whole.blocks());
            let parts: Vec<Volume> = bricks.iter().map(|b| whole.part(*b)).collect();
            let most = parts.iter().map(|p| p.grid().values().len()).max().unwrap();
            assert!(most < whole.grid().values().len() / 2, "a part holds {most} values");
            for quality in [VolumeQuality::default(), VolumeQuality::Step { voxels: 0.7 }] {
                for n in 0..5000 {
                    let ray = ray(n, &mut random);
                    let t1 = if n.is_multiple_of(3) { 0.8 } else { f32::INFINITY };
                    let expected = whole.integrate(&ray, 0.0, t1, &quality);
                    // Assigns spans to bricks.
                    let mut order: Vec<(usize, usize)> = Vec::new();
                    RaySegments::new(vec![(&whole, ray)], 0.0, t1).spans(|k, here| {
                        let brick = bricks.iter().position(|b| b.contains(here[0].1)).unwrap();
                        if order.last().map(|o| o.0) != Some(brick) {
                            assert!(order.iter().all(|o| o.0 != brick), "a brick is convex");
                            order.push((brick, k));
                        }
                    });
                    let mut carried = PartialIntegral::default();
                    for (k, (brick, first)) in order.iter().enumerate() {
                        let end = order.get(k + 1).map_or(usize::MAX, |next| next.1);
                        let segments = RaySegments::new(vec![(&parts[*brick], ray)], 0.0, t1);
                        carried = segments.integrate_spans(*first..end, &quality, carried);
                    }
                    let what = format!("{interpolation:?} {quality:?}, ray {n}, bricks {order:?}");
                    assert_eq!(bits(&carried.sample()), bits(&expected), "{what}");
                    met += u32::from(expected.samples > 0);
                    through_three += u32::from(order.len() > 2);
                }
            }
        }
    }
    assert!(
        met > 20_000 && through_three > 10_000,
        "{met} rays in the volume, {through_three} through three bricks"
    );
}

#[test]
fn a_brick_made_of_its_own_points_is_the_part_of_the_whole() {
    for interpolation in [Interpolation::Linear, Interpolation::Nearest] {
        let options = VolumeOptions { interpolation, ..VolumeOptions::default() };
        let whole = volume(options.clone());
        let extent = GridExtent { dims: DIMS, origin: whole.origin(), spacing: SPACING };
        let nearest = interpolation == Interpolation::Nearest;
        assert_eq!(extent.blocks(nearest), whole.blocks());
        for brick in bricks(whole.blocks()) {
            let part = whole.part(brick);
            let [low, high] = brick.points(DIMS, nearest);
            let mut values = Vec::new();
            for k in low.z..high.z {
                for j in low.y..high.y {
                    values.extend((low.x..high.x).map(|i| whole.grid().at(i, j, k)));
                }
            }
            let of_points = |values: Vec<f32>| {
                let transfer = whole.transfer_function().clone();
                Volume::from_brick(extent, brick, values, transfer, options.clone())
            };
            let made = of_points(values.clone()).unwrap();
            let numbers = |v: &Volume| -> Vec<u32> {
                v.grid().values().iter().map(|x| x.to_bits()).collect()
            };
            assert_eq!(numbers(&made), numbers(&part), "{brick:?}");
            assert_eq!((made.report(), made.bounds()), (part.report(), part.bounds()));
            assert_eq!(made.grid().origin(), part.grid().origin());
            let all = Brick { first: UVec3::ZERO, end: whole.blocks() };
            for z in 0..all.end.z {
                for y in 0..all.end.y {
                    for x in 0..all.end.x {
                        let block = UVec3::new(x, y, z);
                        let expected = brick.contains(block) && whole.is_occupied(block);
                        assert_eq!(made.is_occupied(block), expected, "{block}");
                        assert_eq!(part.is_occupied(block), expected, "{block}");
                    }
                }
            }
            values.pop();
            assert!(matches!(of_points(values), Err(VolumeError::Brick(_))), "one is missing");
        }
    }
}
