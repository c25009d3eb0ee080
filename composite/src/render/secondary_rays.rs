//! Secondary rays of the hits of camera rays: occlusion requests for points, and rays of later
//! bounces.
use super::options::SecondaryRayPolicy;
use super::rank_bounds::{RankBounds, ranks_in};
use super::rank_frame::{RankFrame, each};
use super::ray_query::RayAnswer;
use super::request_reply::RankChannel;
use super::tile_hits::TileHits;
use super::wire_format::{
    HIT_WORDS, LEAST_POINT_WORDS, RAY_WORDS, read_point, read_ray, write_point, write_ray,
};
use super::{Activity, FrameError, RankReport, volumes};
use rt_core::deferred::{
    DeferredFrame, LightHit, LightPoint, OcclusionScratch, Pass, ShadingHit, TileState,
};
use rt_core::ray::Ray;

/// By tile and ray.
type Answers<A> = Vec<Vec<Option<A>>>;

/// The secondary rays of one pass.
pub(super) struct SecondaryRays<'a> {
    pub(super) side: &'a RankFrame<'a>,
    pub(super) rank_bounds: &'a RankBounds,
    pub(super) policy: SecondaryRayPolicy,
    /// This rank's part with a ghost layer, for ghost zones.
    pub(super) ghost_layer: Option<&'a DeferredFrame<'a>>,
    /// Whether there are media, which are distributed in bricks.
    pub(super) media: bool,
    pub(super) pass: Pass,
}

impl SecondaryRays<'_> {
    /// Runs until no ray is left in any tile of any rank.
    pub(super) fn run(
        &mut self,
        channel: &mut RankChannel<'_>,
        tiles: &mut [TileState],
        camera: Vec<TileHits>,
    ) -> Result<(), FrameError> {
        let (rank, frame) = (channel.rank(), self.side.frame);
        let fits = |source| FrameError::Answer { rank, source };
        // Ranks that camera rays hit, for the policy `LocalOnly`.
        let mut hit_ranks: Vec<Option<Vec<u32>>> = Vec::new();
        if self.media {
            let met: Vec<_> = camera.iter().map(|answer| answer.hits.clone()).collect();
            volumes::composite_volumes(channel, self.side, tiles, &met)?;
        }
        for (tile, answer) in tiles.iter_mut().zip(&camera) {
            tile.process_hits(frame, &answer.hits).map_err(fits)?;
            hit_ranks.push(Some((0..answer.hits.len()).map(|slot| answer.winner(slot)).collect()));
        }
        drop(camera);
        channel.record_span(Activity::Shade);
        let mut live: Vec<bool> = vec![true; tiles.len()];
        loop {
            if frame.light_passes_surfaces() {
                while self.transmitted_light(channel, tiles, &live)? {}
            } else if self.pass != Pass::Geometry && frame.light_rays_per_point() > 0 {
                self.exchange_occlusion(channel, tiles, &live, &hit_ranks)?;
            }
            let mut work: Vec<(&mut bool, &mut TileState)> =
                live.iter_mut().zip(tiles.iter_mut()).collect();
            each(channel, self.side.parallel, &mut work, |_, (live, tile)| {
                **live = **live && tile.advance(frame)
            });
            channel.record_span(Activity::Shade);
            hit_ranks.iter_mut().for_each(|h| *h = None);
            if !self.next_bounce(channel, tiles, &live)? {
                return Ok(());
            }
        }
    }

    // ---- Occlusion by opaque surfaces: points out, bits back -----------------------------------
    fn exchange_occlusion(
        &self,
        channel: &mut RankChannel<'_>,
        tiles: &mut [TileState],
        live: &[bool],
        hit_ranks: &[Option<Vec<u32>>],
    ) -> Result<(), FrameError> {
        let (frame, pass, size) = (self.side.frame, self.pass, channel.size());
        let words = (frame.light_rays_per_point() as usize).div_ceil(64);
        // ---- Which ranks to ask.
        let mut requests: Vec<Vec<u32>> = vec![Vec::new(); size];
        // By rank, the tiles and points requested from it.
        let mut asked: Vec<Vec<(u32, u32)>> = vec![Vec::new(); size];
        let mut bits: Vec<Vec<u64>> = Vec::with_capacity(tiles.len());
        for (t, tile) in tiles.iter().enumerate() {
            let points = if live[t] { tile.light_points() } else { &[] };
            bits.push(vec![0; points.len() * words]);
            if points.is_empty() {
                continue;
            }
            let stays = matches!(
                self.policy,
                SecondaryRayPolicy::LocalOnly | SecondaryRayPolicy::GhostZones
            );
            let targets = match &hit_ranks[t] {
                Some(hit) if stays => rank_that_was_hit(self.rank_bounds, tile, hit),
                _ => ranks_to_ask(self.rank_bounds, tile),
            };
            for (p, (point, targets)) in
                points.iter().zip(targets.chunks(self.rank_bounds.bit_words())).enumerate()
            {
                for r in ranks_in(targets).filter(|&r| r < size) {
                    write_point(point, &mut requests[r]);
                    asked[r].push((t as u32, p as u32));
                }
            }
        }
        let rank = channel.rank();
        channel.report.points_sent +=
            (0..size).filter(|&r| r != rank).map(|r| asked[r].len() as u64).sum::<u64>();
        channel.record_span(Activity::Shade);
        // ---- Replies are merged by or: exact, and in any order.
        let tracer = self.ghost_layer.unwrap_or(frame);
        let mut work = OcclusionScratch::default();
        let mut answer = |report: &mut RankReport, request: &[u32]| {
            let mut points = Vec::new();
            let mut rest = request;
            while !rest.is_empty() {
                let (point, r) = read_point(rest)?;
                points.push(point);
                rest = r;
            }
            let before = work.traced;
            let out = if self.side.parallel {
                blocked_in_parallel(tracer, &points, pass, &mut work)
            } else {
                let mut out = Vec::new();
                tracer.occlusion_bits(&points, pass, &mut work, &mut out);
                out
            };
            report.answered_rays += work.traced - before;
            Some(out.iter().flat_map(|b| [*b as u32, (*b >> 32) as u32]).collect())
        };
        let longest = |request: &[u32]| request.len() / LEAST_POINT_WORDS * words * 2;
        let message_error = |from: usize, n: usize| FrameError::Message {
            rank,
            from,
            what: "light bits",
            words: n,
        };
        channel.request_reply(
            "points to light",
            &requests,
            longest,
            &mut answer,
            |from, reply| {
                if reply.len() != asked[from].len() * words * 2 {
                    return Err(message_error(from, reply.len()));
                }
                for (&(t, p), answer) in asked[from].iter().zip(reply.chunks_exact(2 * words)) {
                    let first = p as usize * words;
                    for (k, pair) in answer.chunks_exact(2).enumerate() {
                        bits[t as usize][first + k] |=
                            u64::from(pair[0]) | u64::from(pair[1]) << 32;
                    }
                }
                Ok(())
            },
        )?;
        let mut failed = None;
        for (t, tile) in tiles.iter_mut().enumerate().filter(|(t, _)| live[*t]) {
            if !bits[t].is_empty() {
                failed = tile.apply_occlusion(frame, &bits[t]).err().or(failed);
            }
        }
        channel.record_span(Activity::Shade);
        failed.map_or(Ok(()), |source| Err(FrameError::Answer { rank, source }))
    }

    // ---- Rays that need their closest hit -------------------------------------------------------
    /// Traces one layer of transparent surfaces along light rays. Returns false when no rank has a
    /// light ray.
    fn transmitted_light(
        &self,
        channel: &mut RankChannel<'_>,
        tiles: &mut [TileState],
        live: &[bool],
    ) -> Result<bool, FrameError> {
        let rays: Vec<Vec<Ray>> = tiles
            .iter()
            .zip(live)
            .map(|(t, &l)| if l { t.light_rays().collect() } else { vec![] })
            .collect();
        let (any, met) = self.ask::<LightHit>(channel, &rays, None)?;
        let rank = channel.rank();
        for (tile, met) in tiles.iter_mut().zip(&met).filter(|(_, met)| !met.is_empty()) {
            tile.process_light_hits(self.side.frame, met)
                .map_err(|source| FrameError::Answer { rank, source })?;
        }
        channel.record_span(Activity::Shade);
        Ok(any)
    }

    /// Traces the next bounce. Returns false when no rank has one.
    fn next_bounce(
        &self,
        channel: &mut RankChannel<'_>,
        tiles: &mut [TileState],
        live: &[bool],
    ) -> Result<bool, FrameError> {
        let of = |t: &TileState, live: bool| if live { t.rays().collect() } else { Vec::new() };
        let waiting: Vec<Vec<(usize, u16, Ray)>> =
            tiles.iter().zip(live).map(|(t, &l)| of(t, l)).collect();
        let rays: Vec<Vec<Ray>> =
            waiting.iter().map(|w| w.iter().map(|(.., ray)| *ray).collect()).collect();
        let record = self.side.frame.records_geometry(self.pass);
        let pixel = |tile: &TileState, slot: u16| (tile.number() as u32) << 10 | u32::from(slot);
        let pixels: Option<Vec<Vec<u32>>> = record.then(|| {
            let of = |(t, w): (&TileState, &Vec<(usize, u16, Ray)>)| {
                w.iter().map(|(_, s, _)| pixel(t, *s)).collect()
            };
            tiles.iter().zip(&waiting).map(of).collect()
        });
        let (any, met) = self.ask::<ShadingHit>(channel, &rays, pixels.as_deref())?;
        let rank = channel.rank();
        let mut answers: Vec<Vec<Option<ShadingHit>>> =
            tiles.iter().map(|t| vec![None; t.num_rays()]).collect();
        for (t, answers) in answers.iter_mut().enumerate() {
            for ((place, ..), m) in waiting[t].iter().zip(&met[t]) {
                answers[*place] = *m;
            }
        }
        if self.media {
            volumes::composite_volumes(channel, self.side, tiles, &answers)?;
        }
        for (t, tile) in tiles.iter_mut().enumerate().filter(|(t, _)| live[*t]) {
            tile.process_hits(self.side.frame, &answers[t])
                .map_err(|source| FrameError::Answer { rank, source })?;
        }
        channel.record_span(Activity::Shade);
        // A bounce whose rays all need no reply is still a bounce of its tile; tiles have to agree
        // with the others only about requests.
        Ok(any)
    }

    /// For each ray of each tile, the nearest of the hits that the ranks whose bounds it enters
    /// report, ties to the lowest number. `pixels` are the tiles and slots of the rays, for hits
    /// with depth and distance. Returns false when no rank had a ray. All ranks ask the same
    /// question.
    fn ask<A: RayAnswer>(
        &self,
        channel: &mut RankChannel<'_>,
        rays: &[Vec<Ray>],
        pixels: Option<&[Vec<u32>]>,
    ) -> Result<(bool, Answers<A>), FrameError> {
        let (rank, size, side) = (channel.rank(), channel.size(), self.side);
        let mut met: Answers<A> = rays.iter().map(|r| vec![None; r.len()]).collect();
        let mut requests: Vec<Vec<u32>> = vec![Vec::new(); size];
        let mut asked: Vec<Vec<(u32, u32)>> = vec![Vec::new(); size];
        let mut bits = vec![0; self.rank_bounds.bit_words()];
        for (t, rays) in rays.iter().enumerate() {
            for (i, ray) in rays.iter().enumerate() {
                bits.fill(0);
                self.rank_bounds.add_hit_ranks(ray, &mut bits);
                // A ray that enters no part is still sent, to this rank: no rank may end while
                // others have rays.
                let mut nobody = true;
                for r in ranks_in(&bits).filter(|&r| r < size) {
                    nobody = false;
                    write_ray(ray, pixels.map(|p| p[t][i]), &mut requests[r]);
                    asked[r].push((t as u32, i as u32));
                }
                if nobody {
                    write_ray(ray, pixels.map(|p| p[t][i]), &mut requests[rank]);
                    asked[rank].push((t as u32, i as u32));
                }
            }
        }
        channel.report.rays_sent +=
            (0..size).filter(|&r| r != rank).map(|r| asked[r].len() as u64).sum::<u64>();
        channel.record_span(Activity::Shade);
        let words = RAY_WORDS + pixels.is_some() as usize;
        let mut answer = |report: &mut RankReport, request: &[u32]| {
            if !request.len().is_multiple_of(words) {
                return None;
            }
            let rays: Vec<Ray> = request.chunks_exact(words).map(read_ray).collect();
            let places: Option<Vec<(u32, u16)>> = (words > RAY_WORDS).then(|| {
                request
                    .chunks_exact(words)
                    .map(|w| (w[RAY_WORDS] >> 10, (w[RAY_WORDS] & 0x3ff) as u16))
                    .collect()
            });
            report.answered_rays += rays.len() as u64;
            let met = A::trace(side, &rays, places.as_deref());
            // A mask, then the hits.
            let mut out = vec![0; rays.len().div_ceil(32)];
            for (i, m) in met.iter().enumerate() {
                if let Some(m) = m {
                    out[i / 32] |= 1 << (i % 32);
                    out.extend(m.encode());
                }
            }
            Some(out)
        };
        let longest = |q: &[u32]| (q.len() / words).div_ceil(32) + q.len() / words * HIT_WORDS;
        let message_error = |from: usize, n: usize| FrameError::Message {
            rank,
            from,
            what: "first hits",
            words: n,
        };
        let any =
            channel.request_reply("rays", &requests, longest, &mut answer, |from, reply| {
                let (mask, rest) = reply
                    .split_at_checked(asked[from].len().div_ceil(32))
                    .ok_or_else(|| message_error(from, reply.len()))?;
                let (words, rest) = rest.as_chunks::<HIT_WORDS>();
                let mut words = words.iter();
                for (i, &(t, ray)) in asked[from].iter().enumerate() {
                    if mask[i / 32] >> (i % 32) & 1 == 0 {
                        continue;
                    }
                    let m =
                        A::decode(words.next().ok_or_else(|| message_error(from, reply.len()))?);
                    let best = &mut met[t as usize][ray as usize];
                    if best.as_ref().is_none_or(|b| m.is_before(b)) {
                        *best = Some(m);
                    }
                }
                if rest.is_empty() && words.next().is_none() {
                    Ok(())
                } else {
                    Err(message_error(from, reply.len()))
                }
            })?;
        Ok((any, met))
    }
}

/// For each point of the tile, a bit for each rank whose bounds one of its light rays enters.
fn ranks_to_ask(rank_bounds: &RankBounds, tile: &TileState) -> Vec<u16> {
    let words = rank_bounds.bit_words();
    let mut bits = vec![0; words * tile.light_points().len()];
    for (point, ray) in tile.light_rays_of_points() {
        rank_bounds.add_hit_ranks(&ray, &mut bits[point * words..(point + 1) * words]);
    }
    bits
}

/// The same, with only the rank that was hit.
fn rank_that_was_hit(rank_bounds: &RankBounds, tile: &TileState, hit: &[u32]) -> Vec<u16> {
    let words = rank_bounds.bit_words();
    let mut bits = vec![0; words * tile.light_points().len()];
    for (p, slot) in tile.slots_of_points().enumerate() {
        let rank = hit[slot as usize] as usize;
        if let Some(word) = bits.get_mut(p * words + rank / 16) {
            *word |= 1 << (rank % 16);
        }
    }
    bits
}

fn blocked_in_parallel(
    frame: &DeferredFrame<'_>,
    points: &[LightPoint],
    pass: Pass,
    work: &mut OcclusionScratch,
) -> Vec<u64> {
    use rayon::prelude::*;
    let pieces: Vec<(Vec<u64>, u64)> = points
        .par_chunks(512)
        .map(|points| {
            let (mut own, mut out) = (OcclusionScratch::default(), Vec::new());
            frame.occlusion_bits(points, pass, &mut own, &mut out);
            (out, own.traced)
        })
        .collect();
    work.traced += pieces.iter().map(|(_, traced)| traced).sum::<u64>();
    pieces.into_iter().flat_map(|(bits, _)| bits).collect()
}
