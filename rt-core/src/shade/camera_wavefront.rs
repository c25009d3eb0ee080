//! The camera rays of a tile.

use super::SampleDimension;
use super::frame_context::FrameContext;
use super::tile::{PIXELS, TILE, TileArea, block_place, lane_pixel};
use super::wavefront::{RayKind, RayState, Wavefront};
use crate::effects::Effects;
use crate::ray::{LANES, Ray, RayBlock};
use crate::ray_stats::RayStats;
use crate::sampler::SamplerBlock;
use fearless_simd::{Simd, dispatch};
use glam::Vec3;

/// The states of a tile's camera rays. Copying them takes a tenth of the time of computing them.
static CAMERA_STATES: [RayState; PIXELS] = {
    let mut states = [RayState {
        throughput: Vec3::ONE,
        absorption: Vec3::ZERO,
        coverage: 1.0,
        stream: 0,
        slot: 0,
        bounce: 0,
        kind: RayKind::Camera,
        first: true,
    }; PIXELS];
    let mut slot = 0;
    while slot < PIXELS {
        states[slot].slot = slot as u16;
        slot += 1;
    }
    states
};

/// Rays of every pixel of the tile with their states, see [`generate_camera_rays`].
pub(super) fn generate_camera_wavefront(
    context: &FrameContext<'_>,
    area: &TileArea,
    wave: &mut Wavefront,
    sample: Option<u32>,
    stats: &mut RayStats,
    cost: Option<&mut [f32]>,
) {
    wave.states.clear();
    wave.has_scattered = false;
    wave.states.extend_from_slice(&CAMERA_STATES);
    generate_camera_rays(context, area, &mut wave.blocks, sample, stats, cost);
}

/// Rays of every pixel of the tile, in Morton order; lanes outside the image are inactive. `sample`
/// of `None` aims at pixel centres through the middle of the lens.
pub(super) fn generate_camera_rays(
    context: &FrameContext<'_>,
    area: &TileArea,
    blocks: &mut Vec<RayBlock>,
    sample: Option<u32>,
    stats: &mut RayStats,
    cost: Option<&mut [f32]>,
) {
    stats.primary += area.width as u64 * area.height as u64;
    if let Some(cost) = cost {
        cost.iter_mut().for_each(|c| *c += 1.0);
    }
    let through_lens = context.effects.contains(Effects::DEPTH_OF_FIELD) && sample.is_some();
    blocks.resize(PIXELS / LANES, RayBlock::INACTIVE);
    if through_lens
        || !dispatch!(
            context.level,
            simd => generate_pinhole_rays(simd, context, area, blocks, sample)
        )
    {
        generate_single_rays(context, area, blocks, sample, through_lens);
    }
    // Tiles may extend beyond the image's edge.
    if area.width < TILE || area.height < TILE {
        for slot in (0..PIXELS as u16).filter(|s| area.pixel(*s).is_none()) {
            blocks[slot as usize / LANES]
                .set(slot as usize % LANES, &Ray { t_max: -1.0, ..Ray::new(Vec3::ZERO, Vec3::Z) });
        }
    }
}

/// Camera rays, sixteen at a time; false where they need the arithmetic of
/// [`generate_single_rays`].
fn generate_pinhole_rays<S: Simd>(
    simd: S,
    context: &FrameContext<'_>,
    area: &TileArea,
    blocks: &mut [RayBlock],
    sample: Option<u32>,
) -> bool {
    // NDC of the pixels' centres: the lanes' values for each column and each row of blocks.
    let mut centres = [[[0.0; LANES]; TILE as usize / 4]; 2];
    for k in 0..TILE as usize / 4 {
        for lane in 0..LANES {
            let [i, j] = lane_pixel(lane);
            let [x, y] =
                context.ndc(area.x + (4 * k + i) as u32, area.y + (4 * k + j) as u32, [0.5; 2]);
            (centres[0][k][lane], centres[1][k][lane]) = (x, y);
        }
    }
    let (spread, listed) = (context.options.samples > 1, context.options.points.is_some());
    let mut sampler = SamplerBlock::new(context.options.sampling);
    for (b, block) in blocks.iter_mut().enumerate() {
        let [column, row] = block_place(b);
        let filled = match sample {
            Some(sample) if spread => {
                let (mut px, mut py) = ([0; LANES], [0; LANES]);
                for lane in 0..LANES {
                    let [i, j] = lane_pixel(lane);
                    (px[lane], py[lane]) =
                        (area.x + (4 * column + i) as u32, area.y + (4 * row + j) as u32);
                }
                sampler.set_pixels(
                    simd,
                    context.options.seed,
                    (&px, &py),
                    sample,
                    SampleDimension::PIXEL,
                );
                let at = sampler.squares(simd);
                let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
                for lane in 0..LANES {
                    [x[lane], y[lane]] =
                        context.ndc(px[lane], py[lane], [at[0][lane], at[1][lane]]);
                }
                context.camera_rays.fill_block(simd, &x, &y, block)
            }
            _ if listed => {
                let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
                for lane in 0..LANES {
                    let [i, j] = lane_pixel(lane);
                    let (px, py) = (4 * column + i, 4 * row + j);
                    [x[lane], y[lane]] =
                        context.ndc(area.x + px as u32, area.y + py as u32, [0.5; 2]);
                }
                context.camera_rays.fill_block(simd, &x, &y, block)
            }
            _ => context.camera_rays.fill_block(simd, &centres[0][column], &centres[1][row], block),
        };
        if !filled {
            return false;
        }
    }
    true
}

/// Camera rays one by one, for lenses and for near planes that clip each ray at another parameter.
fn generate_single_rays(
    context: &FrameContext<'_>,
    area: &TileArea,
    blocks: &mut [RayBlock],
    sample: Option<u32>,
    through_lens: bool,
) {
    for slot in 0..PIXELS as u16 {
        let Some([x, y]) = area.pixel(slot) else { continue };
        let (mut at, mut lens) = ([0.5; 2], [0.0; 2]);
        if let Some(sample) = sample {
            let sampler = context.sampler(x, y, sample);
            if context.options.samples > 1 {
                at = sampler.square(SampleDimension::PIXEL);
            }
            if through_lens {
                lens = crate::sampler::unit_disk(sampler.square(SampleDimension::LENS));
            }
        }
        let [nx, ny] = context.ndc(x, y, at);
        let ray = context.camera_rays.ray(nx, ny, lens);
        blocks[slot as usize / LANES].set(slot as usize % LANES, &ray);
    }
}
