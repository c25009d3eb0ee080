//! What leaves the hits of camera rays: light asked for by points, and rays of later waves.
use super::ask::Talk;
use super::boxes::{Boxes, ranks_in};
use super::camera_wave::TileAnswer;
use super::sort_last::{Light, Side, each};
use super::{Activity, FrameError, RankReport, volumes};
use rt_core::distributed::{DistributedFrame, LightPoint, OcclusionScratch, Pass, ShadingHit, TileState};
use rt_core::glam::Vec3;
use rt_core::ray::Ray;

/// Words of a ray in a message.
const RAY_WORDS: usize = 8;

/// By tile and ray.
type FirstHits = Vec<Vec<Option<ShadingHit>>>;

/// One pass beyond its camera rays.
pub(super) struct Wave<'a> {
    pub(super) side: &'a Side<'a>,
    pub(super) boxes: &'a Boxes,
    pub(super) way: Light,
    /// This rank's part with a rim, for ghost zones.
    pub(super) rim: Option<&'a DistributedFrame<'a>>,
    /// Whether there are media, which are held in bricks.
    pub(super) media: bool,
    pub(super) pass: Pass,
}

impl Wave<'_> {
    /// Until no ray is left in any tile of any rank.
    pub(super) fn run(
        &mut self,
        talk: &mut Talk<'_>,
        tiles: &mut [TileState],
        camera: Vec<TileAnswer>,
    ) -> Result<(), FrameError> {
        let (rank, frame) = (talk.rank(), self.side.frame);
        let fits = |source| FrameError::Answer { rank, source };
        // Ranks that were hit by camera rays, for light that stays there.
        let mut hit_ranks: Vec<Option<Vec<u32>>> = Vec::new();
        if self.media {
            let met: Vec<_> = camera.iter().map(|answer| answer.met.clone()).collect();
            volumes::cross(talk, self.side, tiles, &met)?;
        }
        for (tile, answer) in tiles.iter_mut().zip(&camera) {
            tile.process_hits(frame, &answer.met).map_err(fits)?;
            hit_ranks.push(Some((0..answer.met.len()).map(|slot| answer.winner(slot)).collect()));
        }
        drop(camera);
        talk.spent(Activity::Shade);
        let mut live: Vec<bool> = vec![true; tiles.len()];
        loop {
            if frame.light_passes_surfaces() {
                while self.light_through_surfaces(talk, tiles, &live)? {}
            } else if self.pass != Pass::Geometry && frame.light_rays_per_point() > 0 {
                self.light_bits(talk, tiles, &live, &hit_ranks)?;
            }
            let mut work: Vec<(&mut bool, &mut TileState)> = live.iter_mut().zip(tiles.iter_mut()).collect();
            each(talk, self.side.parallel, &mut work, |_, (live, tile)| {
                **live = **live && tile.advance(frame)
            });
            talk.spent(Activity::Shade);
            hit_ranks.iter_mut().for_each(|h| *h = None);
            if !self.later_rays(talk, tiles, &live)? {
                return Ok(());
            }
        }
    }

    // ---- Light that nothing passes through: points out, bits back ----------------------------------------------

    fn light_bits(
        &self,
        talk: &mut Talk<'_>,
        tiles: &mut [TileState],
        live: &[bool],
        hit_ranks: &[Option<Vec<u32>>],
    ) -> Result<(), FrameError> {
        let (frame, pass, size) = (self.side.frame, self.pass, talk.size());
        let words = (frame.light_rays_per_point() as usize).div_ceil(64);
        // ---- Whom to ask.
        let mut questions: Vec<Vec<u32>> = vec![Vec::new(); size];
        // Of each rank, the tiles and points asked of it.
        let mut asked: Vec<Vec<(u32, u32)>> = vec![Vec::new(); size];
        let mut bits: Vec<Vec<u64>> = Vec::with_capacity(tiles.len());
        for (t, tile) in tiles.iter().enumerate() {
            let points = if live[t] { tile.light_points() } else { &[] };
            bits.push(vec![0; points.len() * words]);
            if points.is_empty() {
                continue;
            }
            let stays = matches!(self.way, Light::LocalOnly | Light::Ghost);
            let targets = match &hit_ranks[t] {
                Some(hit) if stays => only_hit_ranks(self.boxes, tile, hit),
                _ => whom_to_ask(self.boxes, tile),
            };
            for (p, (point, targets)) in points.iter().zip(targets.chunks(self.boxes.bit_words())).enumerate()
            {
                for r in ranks_in(targets).filter(|&r| r < size) {
                    point.write(&mut questions[r]);
                    asked[r].push((t as u32, p as u32));
                }
            }
        }
        let rank = talk.rank();
        talk.report.points_sent +=
            (0..size).filter(|&r| r != rank).map(|r| asked[r].len() as u64).sum::<u64>();
        talk.spent(Activity::Shade);
        // ---- Answers, joined by or: exact, and in any order.
        let tracer = self.rim.unwrap_or(frame);
        let mut work = OcclusionScratch::default();
        let mut answer = |report: &mut RankReport, question: &[u32]| {
            let mut points = Vec::new();
            let mut rest = question;
            while !rest.is_empty() {
                let (point, r) = LightPoint::read(rest)?;
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
        // At least nine words a point.
        let longest = |question: &[u32]| question.len() / 9 * words * 2;
        let wrong = |from: usize, n: usize| FrameError::Message { rank, from, what: "light bits", words: n };
        talk.ask("points to light", &questions, longest, &mut answer, |from, reply| {
            if reply.len() != asked[from].len() * words * 2 {
                return Err(wrong(from, reply.len()));
            }
            for (&(t, p), answer) in asked[from].iter().zip(reply.chunks_exact(2 * words)) {
                let first = p as usize * words;
                for (k, pair) in answer.chunks_exact(2).enumerate() {
                    bits[t as usize][first + k] |= u64::from(pair[0]) | u64::from(pair[1]) << 32;
                }
            }
            Ok(())
        })?;
        let mut failed = None;
        for (t, tile) in tiles.iter_mut().enumerate().filter(|(t, _)| live[*t]) {
            if !bits[t].is_empty() {
                failed = tile.apply_occlusion(frame, &bits[t]).err().or(failed);
            }
        }
        talk.spent(Activity::Shade);
        failed.map_or(Ok(()), |source| Err(FrameError::Answer { rank, source }))
    }

    // ---- Rays that want what they meet first --------------------------------------------------------------------

    /// One layer of surfaces in the way of light. False when no light ray is under way anywhere.
    fn light_through_surfaces(
        &self,
        talk: &mut Talk<'_>,
        tiles: &mut [TileState],
        live: &[bool],
    ) -> Result<bool, FrameError> {
        let rays: Vec<Vec<Ray>> =
            tiles.iter().zip(live).map(|(t, &l)| if l { t.light_rays().collect() } else { vec![] }).collect();
        let (any, met) = self.first_hits(talk, &rays, Wanted::Light)?;
        let rank = talk.rank();
        for (tile, met) in tiles.iter_mut().zip(&met).filter(|(_, met)| !met.is_empty()) {
            tile.process_light_hits(self.side.frame, met)
                .map_err(|source| FrameError::Answer { rank, source })?;
        }
        talk.spent(Activity::Shade);
        Ok(any)
    }

    /// The next wave. False when there is none anywhere.
    fn later_rays(
        &self,
        talk: &mut Talk<'_>,
        tiles: &mut [TileState],
        live: &[bool],
    ) -> Result<bool, FrameError> {
        let of = |t: &TileState, live: bool| if live { t.rays().collect() } else { Vec::new() };
        let waiting: Vec<Vec<(usize, u16, Ray)>> = tiles.iter().zip(live).map(|(t, &l)| of(t, l)).collect();
        let rays: Vec<Vec<Ray>> = waiting.iter().map(|w| w.iter().map(|(.., ray)| *ray).collect()).collect();
        let record = self.side.frame.records_geometry(self.pass);
        let pixel = |tile: &TileState, slot: u16| (tile.number() as u32) << 10 | u32::from(slot);
        let pixels: Option<Vec<Vec<u32>>> = record.then(|| {
            let of = |(t, w): (&TileState, &Vec<(usize, u16, Ray)>)| {
                w.iter().map(|(_, s, _)| pixel(t, *s)).collect()
            };
            tiles.iter().zip(&waiting).map(of).collect()
        });
        let wanted = Wanted::Closest { pixels: pixels.as_deref() };
        let (any, met) = self.first_hits(talk, &rays, wanted)?;
        let rank = talk.rank();
        let mut answers: Vec<Vec<Option<ShadingHit>>> =
            tiles.iter().map(|t| vec![None; t.num_rays()]).collect();
        for (t, answers) in answers.iter_mut().enumerate() {
            for ((place, ..), m) in waiting[t].iter().zip(&met[t]) {
                answers[*place] = *m;
            }
        }
        if self.media {
            volumes::cross(talk, self.side, tiles, &answers)?;
        }
        for (t, tile) in tiles.iter_mut().enumerate().filter(|(t, _)| live[*t]) {
            tile.process_hits(self.side.frame, &answers[t])
                .map_err(|source| FrameError::Answer { rank, source })?;
        }
        talk.spent(Activity::Shade);
        // A wave of which every ray waits for nothing is still a wave of its tile; tiles agree with the others only on questions.
        Ok(any)
    }

    /// Of each ray of each tile the nearest of what all ranks in whose bounds it comes say it meets, ties to the lowest number. False when no
    /// rank had a ray.
    fn first_hits(
        &self,
        talk: &mut Talk<'_>,
        rays: &[Vec<Ray>],
        wanted: Wanted<'_>,
    ) -> Result<(bool, FirstHits), FrameError> {
        let (pixels, light) = match wanted {
            Wanted::Closest { pixels } => (pixels, false),
            Wanted::Light => (None, true),
        };
        let (rank, size, side) = (talk.rank(), talk.size(), self.side);
        let mut met: FirstHits = rays.iter().map(|r| vec![None; r.len()]).collect();
        let mut questions: Vec<Vec<u32>> = vec![Vec::new(); size];
        let mut asked: Vec<Vec<(u32, u32)>> = vec![Vec::new(); size];
        let mut bits = vec![0; self.boxes.bit_words()];
        for (t, rays) in rays.iter().enumerate() {
            for (i, ray) in rays.iter().enumerate() {
                bits.fill(0);
                self.boxes.add_met(ray, &mut bits);
                // A ray that meets no part is still asked, of this rank: nobody may end while others have rays.
                let mut nobody = true;
                for r in ranks_in(&bits).filter(|&r| r < size) {
                    nobody = false;
                    write_ray(ray, pixels.map(|p| p[t][i]), &mut questions[r]);
                    asked[r].push((t as u32, i as u32));
                }
                if nobody {
                    write_ray(ray, pixels.map(|p| p[t][i]), &mut questions[rank]);
                    asked[rank].push((t as u32, i as u32));
                }
            }
        }
        talk.report.rays_sent += (0..size).filter(|&r| r != rank).map(|r| asked[r].len() as u64).sum::<u64>();
        talk.spent(Activity::Shade);
        let words = RAY_WORDS + pixels.is_some() as usize;
        let mut answer = |report: &mut RankReport, question: &[u32]| {
            if !question.len().is_multiple_of(words) {
                return None;
            }
            let rays: Vec<Ray> = question.chunks_exact(words).map(read_ray).collect();
            let places: Option<Vec<(u32, u16)>> = (words > RAY_WORDS).then(|| {
                question
                    .chunks_exact(words)
                    .map(|w| (w[RAY_WORDS] >> 10, (w[RAY_WORDS] & 0x3ff) as u16))
                    .collect()
            });
            report.answered_rays += rays.len() as u64;
            let mut met = Vec::new();
            if light {
                side.frame.light_hits(&rays, &mut met);
            } else {
                side.frame.closest(&rays, places.as_deref(), &mut met);
            }
            // A mask, then what was met.
            let mut out = vec![0; rays.len().div_ceil(32)];
            for (i, m) in met.into_iter().enumerate() {
                if let Some(mut m) = m {
                    if !m.is_blocked() {
                        m.primitive = side.in_whole(m.instance, m.primitive);
                    }
                    out[i / 32] |= 1 << (i % 32);
                    out.extend(m.to_words());
                }
            }
            Some(out)
        };
        let longest = |q: &[u32]| (q.len() / words).div_ceil(32) + q.len() / words * ShadingHit::WORDS;
        let wrong = |from: usize, n: usize| FrameError::Message { rank, from, what: "first hits", words: n };
        let any = talk.ask("rays", &questions, longest, &mut answer, |from, reply| {
            let (mask, rest) = reply
                .split_at_checked(asked[from].len().div_ceil(32))
                .ok_or_else(|| wrong(from, reply.len()))?;
            let (words, rest) = rest.as_chunks::<{ ShadingHit::WORDS }>();
            let mut words = words.iter();
            for (i, &(t, ray)) in asked[from].iter().enumerate() {
                if mask[i / 32] >> (i % 32) & 1 == 0 {
                    continue;
                }
                let m = ShadingHit::from_words(words.next().ok_or_else(|| wrong(from, reply.len()))?);
                let best = &mut met[t as usize][ray as usize];
                if best.as_ref().is_none_or(|b| m.is_before(b)) {
                    *best = Some(m);
                }
            }
            if rest.is_empty() && words.next().is_none() { Ok(()) } else { Err(wrong(from, reply.len())) }
        })?;
        Ok((any, met))
    }
}

/// What is asked of rays; the same on all ranks.
#[derive(Clone, Copy)]
enum Wanted<'a> {
    /// What they meet first; with pixels, depth and distance as well.
    Closest { pixels: Option<&'a [Vec<u32>]> },
    /// Of rays to light: what they meet that may let it through, or that something opaque is in the way.
    Light,
}

/// Of each point of the tile a bit for each rank into whose bounds one of its light rays comes.
fn whom_to_ask(boxes: &Boxes, tile: &TileState) -> Vec<u16> {
    let words = boxes.bit_words();
    let mut bits = vec![0; words * tile.light_points().len()];
    for (point, ray) in tile.light_rays_of_points() {
        boxes.add_met(&ray, &mut bits[point * words..(point + 1) * words]);
    }
    bits
}

/// The same with the rank that was hit alone.
fn only_hit_ranks(boxes: &Boxes, tile: &TileState, hit: &[u32]) -> Vec<u16> {
    let words = boxes.bit_words();
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
    frame: &DistributedFrame<'_>,
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

pub(super) fn write_ray(ray: &Ray, pixel: Option<u32>, out: &mut Vec<u32>) {
    out.extend(ray.origin.to_array().map(f32::to_bits));
    out.extend(ray.dir.to_array().map(f32::to_bits));
    out.extend([ray.t_min.to_bits(), ray.t_max.to_bits()]);
    out.extend(pixel);
}

pub(super) fn read_ray(words: &[u32]) -> Ray {
    let f = |i: usize| f32::from_bits(words[i]);
    Ray { origin: Vec3::new(f(0), f(1), f(2)), dir: Vec3::new(f(3), f(4), f(5)), t_min: f(6), t_max: f(7) }
}
