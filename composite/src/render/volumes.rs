//! Volumes in bricks: rays traverse them from near to far, and the accumulated light is sent along.
//!
//! The owner of a pixel knows which bricks a ray enters in which order ([`super::volume_bricks`]).
//! It sends the ray to a holder of the first brick, receives what the ray has accumulated there,
//! and sends it to the next: one round of requests per brick along a ray. Sums are made in the
//! order in which one node makes them, so they have the same bits.
use super::rank_frame::RankFrame;
use super::request_reply::RankChannel;
use super::wire_format::{
    INTEGRAL_WORDS, RAY_WORDS, decode_integral, encode_integral, read_ray, write_ray,
};
use super::{Activity, FrameError, RankReport};
use rayon::prelude::*;
use rt_core::deferred::{ShadingHit, TileState};
use rt_core::ray::Ray;
use rt_core::volume::{PartialIntegral, RaySegments, VolumeSample, composite_projections};

/// Words for the brick and the spans of a ray.
const HEAD: usize = 3;
/// Those words, a ray and its accumulated light.
const WORDS: usize = HEAD + RAY_WORDS + INTEGRAL_WORDS;

/// Consecutive spans of a ray in the same brick.
struct BrickSpan {
    brick: usize,
    first: usize,
    end: usize,
}

/// A ray through the volumes.
#[derive(Clone, Copy)]
struct VolumeRay {
    tile: usize,
    /// Its index among the answers of its tile's wavefront.
    place: usize,
    /// In render space.
    ray: Ray,
    /// Parameter of its surface hit, or of its own end.
    t_end: f32,
}

/// A ray that traverses the bricks.
struct BrickTraversal {
    ray: VolumeRay,
    /// Remaining bricks in reverse order.
    remaining: Vec<BrickSpan>,
    collected: PartialIntegral,
}

impl BrickTraversal {
    fn new(
        channel: &RankChannel<'_>,
        side: &RankFrame<'_>,
        ray: VolumeRay,
    ) -> Result<BrickTraversal, FrameError> {
        let bricks = &side.part.volume_bricks;
        let volumes = side.frame.volumes_along(ray.ray).collect();
        let segments = RaySegments::new(volumes, ray.ray.t_min, ray.t_end);
        let (mut remaining, mut held): (Vec<BrickSpan>, bool) = (Vec::new(), true);
        segments.spans(|number, here| {
            if !here.iter().any(|(v, block)| bricks.is_occupied(*v, *block)) {
                return;
            }
            let last = remaining.last_mut();
            match (bricks.find(here, last.as_ref().map(|s| s.brick)), last) {
                (Some(brick), Some(last)) if last.brick == brick => last.end = number + 1,
                (Some(brick), _) => {
                    remaining.push(BrickSpan { brick, first: number, end: number + 1 })
                }
                (None, _) => held = false,
            }
        });
        if !held {
            return Err(channel.message_error(channel.rank(), "a block that nobody holds", 0));
        }
        remaining.reverse();
        Ok(BrickTraversal { ray, remaining, collected: PartialIntegral::default() })
    }
}

/// Traverses all ranks' bricks with the rays of `tiles`, which end at their hits in `met`, and
/// gives the tiles the light that they accumulate.
pub(super) fn composite_volumes(
    channel: &mut RankChannel<'_>,
    side: &RankFrame<'_>,
    tiles: &mut [TileState],
    met: &[Vec<Option<ShadingHit>>],
) -> Result<(), FrameError> {
    let (rank, size) = (channel.rank(), channel.size());
    let quality = &side.options.volume_quality;
    let mut journeys = Vec::new();
    for (number, (tile, met)) in tiles.iter().zip(met).enumerate() {
        for (place, _, ray) in tile.rays() {
            let hit = met.get(place).and_then(|m| m.as_ref());
            let t_end = hit.map_or(ray.t_max, |m| m.t);
            let ray = VolumeRay { tile: number, place, ray, t_end };
            journeys.push(BrickTraversal::new(channel, side, ray)?);
        }
    }
    channel.record_span(Activity::Shade);
    loop {
        // ---- Send rays to their next brick.
        let mut requests: Vec<Vec<u32>> = vec![Vec::new(); size];
        let mut asked: Vec<Vec<usize>> = vec![Vec::new(); size];
        for (k, j) in journeys.iter_mut().enumerate() {
            if j.collected.is_opaque(quality) {
                j.remaining.clear();
            }
            let Some(next) = j.remaining.pop() else { continue };
            let holder = side.part.volume_bricks.holder(next.brick, rank);
            let request = &mut requests[holder];
            request.extend([next.brick as u32, next.first as u32, next.end as u32]);
            write_ray(&Ray { t_max: j.ray.t_end, ..j.ray.ray }, None, request);
            request.extend(encode_integral(&j.collected));
            asked[holder].push(k);
        }
        channel.report.rays_sent +=
            (0..size).filter(|&r| r != rank).map(|r| asked[r].len() as u64).sum::<u64>();
        channel.record_span(Activity::Shade);
        let mut answer = |report: &mut RankReport, request: &[u32]| {
            let (rays, rest) = request.as_chunks::<WORDS>();
            report.answered_rays += rays.len() as u64;
            let one = |words: &[u32; WORDS]| continue_ray(side, words);
            let all: Option<Vec<_>> = if side.parallel {
                rays.par_iter().map(one).collect()
            } else {
                rays.iter().map(one).collect()
            };
            all.filter(|_| rest.is_empty()).map(|all| all.into_flattened())
        };
        let longest = |q: &[u32]| q.len() / WORDS * INTEGRAL_WORDS;
        let any = channel.request_reply(
            "rays through a volume",
            &requests,
            longest,
            &mut answer,
            |from, reply| {
                let (collected, rest) = reply.as_chunks::<INTEGRAL_WORDS>();
                if !rest.is_empty() || collected.len() != asked[from].len() {
                    let what = "what rays collect in a volume";
                    return Err(FrameError::Message { rank, from, what, words: reply.len() });
                }
                for (&k, words) in asked[from].iter().zip(collected) {
                    journeys[k].collected = decode_integral(words);
                }
                Ok(())
            },
        )?;
        if !any {
            break;
        }
    }
    // ---- Give the samples to the tiles.
    let mut samples: Vec<Vec<VolumeSample>> =
        tiles.iter().map(|t| vec![VolumeSample::CLEAR; t.num_rays()]).collect();
    for j in &journeys {
        let sample = with_projections(side, &j.ray, j.collected.sample());
        samples[j.ray.tile][j.ray.place] = sample;
    }
    for (tile, samples) in tiles.iter_mut().zip(samples) {
        tile.set_volume_samples(samples).map_err(|source| FrameError::Answer { rank, source })?;
    }
    channel.record_span(Activity::Shade);
    Ok(())
}

/// What a ray collects in all volumes if it collects `mixed` in the media. Every rank holds the
/// projections whole.
fn with_projections(side: &RankFrame<'_>, ray: &VolumeRay, mixed: VolumeSample) -> VolumeSample {
    let volumes: Vec<_> = side.frame.volumes_along(ray.ray).collect();
    if volumes.iter().all(|(volume, _)| volume.is_medium()) {
        return mixed;
    }
    let quality = &side.options.volume_quality;
    composite_projections(&volumes, ray.ray.t_min, ray.t_end, quality, mixed)
}

/// The reply to one request; `None` for a request that is not for this rank.
fn continue_ray(side: &RankFrame<'_>, words: &[u32; WORDS]) -> Option<[u32; INTEGRAL_WORDS]> {
    let ([brick, first, end], words) = words.split_first_chunk::<HEAD>()?;
    let (ray, collected) = words.split_last_chunk::<INTEGRAL_WORDS>()?;
    let held = side.part.brick_data.get(*brick as usize)?.as_ref()?;
    let (ray, spans) = (read_ray(ray), *first as usize..*end as usize);
    let here = side.frame.volumes_along(ray).enumerate();
    let here = here.map(|(number, (whole, ray))| (held.volume(number).unwrap_or(whole), ray));
    let segments = RaySegments::new(here.collect(), ray.t_min, ray.t_max);
    if !segments.is_within(spans.clone(), |volume, block| held.has(volume, block)) {
        return None;
    }
    let quality = &side.options.volume_quality;
    Some(encode_integral(&segments.integrate_spans(spans, quality, decode_integral(collected))))
}
