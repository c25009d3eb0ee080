//! A volume in bricks, one for each rank: rays are carried through them, from near to far, with what they have collected.
//!
//! The owner of a pixel knows which bricks a ray meets in which order. It asks the holder of the first one, takes back what the ray has collected there, and asks the next:
//! one round of questions per brick along a ray. Sums are made in the order in which one node makes them, so they have the same bits.
use super::ask::Talk;
use super::sort_last::Side;
use super::{Activity, FrameError, RankReport};
use rayon::prelude::*;
use rt_core::glam::UVec3;
use rt_core::ray::Ray;
use rt_core::volume::{Brick, Marched, Volume, VolumeSample};
use rt_core::waves::{Met, TileInWork};

/// Words of a ray and what it has collected.
const WORDS: usize = 8 + Marched::WORDS;

/// Cuts a volume into one brick for each of `ranks` ranks with about the same number of blocks that are not clear.
pub(super) fn bricks(volume: &Volume, ranks: usize) -> Vec<Brick> {
    let mut out = Vec::with_capacity(ranks);
    let all = Brick { first: UVec3::ZERO, end: volume.blocks() };
    halve(volume, all, ranks, &mut out);
    out
}

fn halve(volume: &Volume, brick: Brick, ranks: usize, out: &mut Vec<Brick>) {
    if ranks == 1 {
        out.push(brick);
        return;
    }
    let size = brick.end.saturating_sub(brick.first).to_array();
    let axis = (0..3).max_by_key(|&a| size[a]).unwrap_or(0);
    // ---- Work of each layer of blocks across the axis.
    let layer_work = |at: u32| {
        let (mut first, mut end) = (brick.first, brick.end);
        (first[axis], end[axis]) = (at, at + 1);
        let mut work = 0.0;
        for z in first.z..end.z {
            for y in first.y..end.y {
                for x in first.x..end.x {
                    work += if volume.is_occupied(UVec3::new(x, y, z)) { 1.0 } else { 0.02 };
                }
            }
        }
        work
    };
    let layers: Vec<f64> = (brick.first[axis]..brick.end[axis]).map(layer_work).collect();
    let lower = ranks / 2;
    let share = layers.iter().sum::<f64>() * lower as f64 / ranks as f64;
    let mut done = 0.0;
    let below = layers.iter().take_while(|&&work| {
        done += work;
        done - 0.5 * work < share
    });
    let cut = brick.first[axis] + below.count() as u32;
    let (mut near, mut far) = (brick, brick);
    (near.end[axis], far.first[axis]) = (cut, cut);
    halve(volume, near, lower, out);
    halve(volume, far, ranks - lower, out);
}

/// A ray on its way through the bricks.
struct Journey {
    tile: usize,
    /// Among the answers of its tile.
    place: usize,
    ray: Ray,
    /// Ranks whose bricks are still to come, the next one last.
    to_come: Vec<u16>,
    collected: Marched,
}

/// Carries the rays of `tiles`, which end where they `met` something, through all ranks' bricks, and gives the tiles what they collect.
pub(super) fn cross(
    talk: &mut Talk<'_>,
    side: &Side<'_>,
    bricks: &[Brick],
    tiles: &mut [TileInWork],
    met: &[Vec<Option<Met>>],
) -> Result<(), FrameError> {
    let (rank, size, frame) = (talk.rank(), talk.size(), side.frame);
    let Some(volume) = frame.volume() else { return Ok(()) };
    let quality = frame.volume_quality();
    let owner = |block: UVec3| bricks.iter().position(|b| b.contains(block));
    let mut journeys = Vec::new();
    for (t, (tile, met)) in tiles.iter().zip(met).enumerate() {
        for (place, ray) in tile.volume_rays(frame, met) {
            let mut to_come: Vec<u16> = Vec::new();
            volume.blocks_along(&ray, ray.t_min, ray.t_max, |block| {
                // Blocks of the same brick follow each other: a brick is convex.
                let same = to_come.last().is_some_and(|&r| bricks[usize::from(r)].contains(block));
                if !same {
                    to_come.extend(owner(block).map(|r| r as u16));
                }
                true
            });
            to_come.reverse();
            journeys.push(Journey { tile: t, place, ray, to_come, collected: Marched::default() });
        }
    }
    talk.spent(Activity::Shade);
    loop {
        // ---- To the next brick.
        let mut questions: Vec<Vec<u32>> = vec![Vec::new(); size];
        let mut asked: Vec<Vec<usize>> = vec![Vec::new(); size];
        for (k, j) in journeys.iter_mut().enumerate() {
            if j.collected.is_opaque(quality) {
                j.to_come.clear();
            }
            let Some(next) = j.to_come.pop().map(usize::from) else { continue };
            super::waves::write_ray(&j.ray, None, &mut questions[next]);
            questions[next].extend(j.collected.to_words());
            asked[next].push(k);
        }
        talk.report.rays_sent += (0..size).filter(|&r| r != rank).map(|r| asked[r].len() as u64).sum::<u64>();
        talk.spent(Activity::Shade);
        let mut answer = |report: &mut RankReport, question: &[u32]| {
            let (rays, rest) = question.as_chunks::<WORDS>();
            report.answered_rays += rays.len() as u64;
            let one = |words: &[u32; WORDS]| {
                let (ray, collected) = words.split_last_chunk::<{ Marched::WORDS }>()?;
                let ray = super::waves::read_ray(ray);
                let collected = Marched::from_words(collected);
                Some(volume.carry_on(&ray, ray.t_min, ray.t_max, quality, collected).to_words())
            };
            let all: Option<Vec<_>> = if side.parallel {
                rays.par_iter().map(one).collect()
            } else {
                rays.iter().map(one).collect()
            };
            all.filter(|_| rest.is_empty()).map(|all| all.into_flattened())
        };
        let longest = |q: &[u32]| q.len() / WORDS * Marched::WORDS;
        let any = talk.ask("rays through a volume", &questions, longest, &mut answer, |from, reply| {
            let (collected, rest) = reply.as_chunks::<{ Marched::WORDS }>();
            if !rest.is_empty() || collected.len() != asked[from].len() {
                let what = "what rays collect in a volume";
                return Err(FrameError::Message { rank, from, what, words: reply.len() });
            }
            for (&k, words) in asked[from].iter().zip(collected) {
                journeys[k].collected = Marched::from_words(words);
            }
            Ok(())
        })?;
        if !any {
            break;
        }
    }
    // ---- To the tiles.
    let mut samples: Vec<Vec<VolumeSample>> =
        tiles.iter().map(|t| vec![VolumeSample::CLEAR; t.num_rays()]).collect();
    for j in &journeys {
        samples[j.tile][j.place] = j.collected.sample();
    }
    for (tile, samples) in tiles.iter_mut().zip(samples) {
        tile.cross(samples).map_err(|source| FrameError::Answer { rank, source })?;
    }
    talk.spent(Activity::Shade);
    Ok(())
}
