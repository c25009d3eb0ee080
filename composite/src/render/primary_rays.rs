//! Primary rays: every rank traces camera rays against its part, and owners of tiles keep the
//! nearest hit of each pixel.
//!
//! When streaming, a rank sends hits to the owners of their tiles as soon as a few tiles are
//! traced, and merges the hits that have arrived meanwhile, so messages are in flight while rays
//! are traced. Where local light suffices, finished tiles go on to the collecting rank at once. So
//! a frame costs the longer of rendering and compositing and not their sum, as sections 3.3.2 and
//! 6.1 of the thesis suggest.
use super::rank_frame::RankFrame;
use super::request_reply::{Inbox, Incoming, RankChannel, Tag};
use super::tile_collector::TileCollector;
use super::tile_hits::{Nearest, SLOTS, TileHits};
use super::tile_owners::TileOwners;
use super::wire_format::{HIT_WORDS, decode_hit, encode_hit};
use super::{Activity, FrameError};
use rayon::prelude::*;
use rt_core::deferred::{CameraHits, Pass};
use std::sync::atomic::Ordering;

/// Most chunks of an owner's tiles; all ranks process them one after the other. With more chunks,
/// less is left to send at the end, but in more messages.
const CHUNKS: usize = 4;
/// Least tiles of a chunk: with fewer, sending and polling messages costs more than the overlap
/// with tracing gains (measured with 100 tiles and 128 ranks).
const CHUNK_TILES: usize = 8;
/// Tiles traced between two polls for messages.
const TILES_PER_LOOK: usize = 4;

/// Words of a mask with a bit for each slot.
const MASK_WORDS: usize = SLOTS / 32;

/// Own hits, by tile; `None` for tiles without hits.
type OwnHits = Vec<Option<CameraHits>>;

/// The kind of a pass of camera rays.
#[derive(Clone, Copy)]
pub(super) struct PrimaryPass {
    pub(super) pass: Pass,
    /// Hits include their colours.
    pub(super) colors: bool,
    /// Owners get all details of the nearest hits.
    pub(super) hit_details: bool,
    /// Messages are in flight while rays are traced.
    pub(super) stream: bool,
}

/// Runs one pass of camera rays. With `collect`, tiles are finished from the colours of hits and
/// sent to the collecting rank.
pub(super) fn run(
    channel: &mut RankChannel<'_>,
    side: &RankFrame<'_>,
    owners: &TileOwners,
    wanted: PrimaryPass,
    collect: Option<&mut TileCollector<'_>>,
) -> Result<Vec<TileHits>, FrameError> {
    let (rank, size) = (channel.rank(), channel.size());
    let tiles_per_owner = side.frame.num_tiles() / size;
    let chunks = if wanted.stream { (tiles_per_owner / CHUNK_TILES).clamp(1, CHUNKS) } else { 1 };
    let mut wave = PrimaryRays {
        side,
        owners,
        wanted,
        chunks,
        own: Vec::new(),
        answers: owners.tiles[rank].clone().map(|_| TileHits::new()).collect(),
        seen_by: vec![Vec::new(); size],
        merged: vec![0; size],
        missing: Vec::new(),
        finished: 0,
        inbox: Inbox::default(),
        collect,
    };
    wave.own.resize_with(side.frame.num_tiles(), || None);
    wave.post_receives(channel)?;
    // ---- Trace rays, and send hits to the owners of their tiles: to the next rank first, so that
    // no rank gets all messages at once, and own hits last.
    let to = |step: usize| (rank + 1 + step) % size;
    let mut traced = 0;
    for chunk in 0..chunks {
        if side.parallel {
            let all = (0..size).flat_map(|owner| owners.shared(rank, owner, (chunk, chunks)));
            wave.trace(channel, all.collect());
        }
        for owner in (0..size).map(to) {
            if !side.parallel {
                let tiles: Vec<usize> = owners.shared(rank, owner, (chunk, chunks)).collect();
                traced += tiles.len();
                wave.trace(channel, tiles);
            }
            if wanted.stream {
                wave.send_hits(channel, owner, chunk)?;
            }
            if wanted.stream && (side.parallel || traced >= TILES_PER_LOOK) {
                traced = 0;
                while let Some(incoming) = channel.next(&mut wave.inbox, false)? {
                    wave.take(channel, incoming)?;
                }
            }
        }
    }
    if !wanted.stream {
        for owner in (0..size).map(to) {
            wave.send_hits(channel, owner, 0)?;
        }
    }
    while let Some(incoming) = channel.next(&mut wave.inbox, true)? {
        wave.take(channel, incoming)?;
    }
    let PrimaryRays { own, seen_by, mut answers, .. } = wave;
    if wanted.hit_details {
        fetch_hit_details(channel, side, owners, &own, &seen_by, &mut answers)?;
    }
    Ok(answers)
}

/// All of an owner's tiles, as one chunk.
const WHOLE: (usize, usize) = (0, 1);

/// One rank's camera rays of one pass.
struct PrimaryRays<'a, 'c> {
    side: &'a RankFrame<'a>,
    owners: &'a TileOwners,
    wanted: PrimaryPass,
    chunks: usize,
    own: OwnHits,
    answers: Vec<TileHits>,
    /// By rank, the tiles of this rank in which it has hits.
    seen_by: Vec<Vec<usize>>,
    /// By rank, how many chunks of its hits have been merged (or skipped, having no hits).
    merged: Vec<usize>,
    /// By own chunk, how many ranks have not yet sent their hits.
    missing: Vec<usize>,
    /// Own chunks that have been sent on to the root.
    finished: usize,
    inbox: Inbox,
    collect: Option<&'a mut TileCollector<'c>>,
}

impl PrimaryRays<'_, '_> {
    /// Posts all receives of the pass.
    fn post_receives(&mut self, channel: &mut RankChannel<'_>) -> Result<(), FrameError> {
        let (rank, size) = (channel.rank(), channel.size());
        let per_pixel = words_per_hit(self.side, self.wanted.colors);
        for chunk in (0..self.chunks).map(|c| (c, self.chunks)) {
            let mut missing = 1;
            for from in (0..size).filter(|&from| from != rank) {
                let tiles = self.owners.shared(from, rank, chunk).count();
                if tiles > 0 {
                    let most = tiles * (1 + MASK_WORDS + SLOTS * per_pixel);
                    channel.expect(&mut self.inbox, from, Tag::Hits, most)?;
                    missing += 1;
                }
            }
            self.missing.push(missing);
        }
        match &mut self.collect {
            Some(collect) => {
                collect.post_receives(channel, &mut self.inbox, self.owners, self.chunks)
            }
            None => Ok(()),
        }
    }

    /// Traces some of the tiles in which this rank's part may be visible.
    fn trace(&mut self, channel: &mut RankChannel<'_>, tiles: Vec<usize>) {
        let side = self.side;
        let one = |&tile: &usize| {
            let mut hits = CameraHits::default();
            side.frame.camera_hits(tile, self.wanted.pass, &mut hits);
            let any = hits.mask().any(|m| m != 0);
            (tile, any, hits)
        };
        let traced: Vec<_> = if side.parallel {
            channel.in_background(|steps| {
                let count = |hits| {
                    steps.fetch_add(1, Ordering::Relaxed);
                    hits
                };
                tiles.par_iter().map(one).map(count).collect()
            })
        } else {
            let mut with_sign = |tile| {
                let hits = one(tile);
                channel.alive();
                hits
            };
            tiles.iter().map(&mut with_sign).collect()
        };
        for (tile, any, hits) in traced {
            channel.report.camera_rays += hits.rays();
            if any {
                self.own[tile] = Some(hits);
            }
        }
        channel.record_span(Activity::Render);
    }

    /// Sends own hits in a chunk to the owner of its tiles.
    fn send_hits(
        &mut self,
        channel: &mut RankChannel<'_>,
        owner: usize,
        chunk: usize,
    ) -> Result<(), FrameError> {
        let (rank, chunk_of) = (channel.rank(), (chunk, self.chunks));
        if owner != rank && !self.owners.has_messages(rank, owner, chunk_of) {
            return Ok(());
        }
        let tiles = self.owners.shared(rank, owner, chunk_of);
        let words = encode_hits(self.side, tiles, &mut self.own, self.wanted.colors);
        channel.record_span(Activity::Render);
        if owner == rank {
            return self.merge_hits(channel, rank, chunk, &words);
        }
        channel.send(owner, Tag::Hits, &words)?;
        channel.record_span(Activity::Exchange);
        Ok(())
    }

    fn take(
        &mut self,
        channel: &mut RankChannel<'_>,
        incoming: Incoming,
    ) -> Result<(), FrameError> {
        let Incoming { from, tag, words } = incoming;
        if tag == Tag::Tiles as u32 {
            return match &mut self.collect {
                Some(collect) => collect.put_chunk(channel, self.owners, from, self.chunks, &words),
                None => Err(channel.message_error(from, "tiles", words.len())),
            };
        }
        // Messages of one rank arrive in order; chunks in which it sees nothing are not sent.
        let (rank, chunks) = (channel.rank(), self.chunks);
        let next = (self.merged[from]..chunks)
            .find(|&c| self.owners.has_messages(from, rank, (c, chunks)));
        let chunk = next.ok_or_else(|| channel.message_error(from, "hits", words.len()))?;
        self.merged[from] = chunk + 1;
        self.merge_hits(channel, from, chunk, &words)
    }

    /// Merges the hits of rank `from` in an own chunk.
    fn merge_hits(
        &mut self,
        channel: &mut RankChannel<'_>,
        from: usize,
        chunk: usize,
        words: &[u32],
    ) -> Result<(), FrameError> {
        let (rank, chunk_of) = (channel.rank(), (chunk, self.chunks));
        let (tiles, first) =
            (self.owners.shared(from, rank, chunk_of), self.owners.tiles[rank].start);
        let (answers, seen) = (&mut self.answers, &mut self.seen_by[from]);
        decode_hits(self.side, tiles, first, from, words, self.wanted.colors, answers, seen)
            .ok_or_else(|| channel.message_error(from, "hits", words.len()))?;
        channel.record_span(Activity::Composite);
        self.missing[chunk] -= 1;
        // Finish chunks in order, which the root relies on: a chunk that few ranks see may be
        // complete before the one in front of it.
        let Some(collect) = &mut self.collect else { return Ok(()) };
        while self.missing.get(self.finished) == Some(&0) {
            let tiles = self.owners.chunk(rank, (self.finished, self.chunks));
            self.finished += 1;
            collect.finish(channel, tiles, self.wanted.pass, &self.answers)?;
        }
        Ok(())
    }
}

fn words_per_hit(side: &RankFrame<'_>, colors: bool) -> usize {
    2 + (side.num_instances() > 1) as usize + if colors { 4 } else { 0 }
}

/// Encodes hits in `tiles`: for each tile whether there are any, then a mask of slots and the hits
/// in order.
fn encode_hits(
    side: &RankFrame<'_>,
    tiles: impl Iterator<Item = usize>,
    own: &mut OwnHits,
    colors: bool,
) -> Vec<u32> {
    let several = side.num_instances() > 1;
    let tiles: Vec<usize> = tiles.collect();
    let mut out = Vec::new();
    for tile in tiles {
        let Some(hits) = own[tile].as_mut() else {
            out.push(0);
            continue;
        };
        out.push(1);
        let halves: Vec<u16> = hits.mask().collect();
        out.extend(halves.chunks_exact(2).map(|h| u32::from(h[0]) | u32::from(h[1]) << 16));
        let palette = if colors { hits.colors(side.frame).to_vec() } else { Vec::new() };
        for slot in 0..SLOTS {
            let Some(hit) = hits.get(slot) else { continue };
            out.push(hit.t.to_bits());
            if several {
                out.push(hit.instance);
            }
            out.push(side.global_primitive(hit.instance, hit.prim));
            if colors {
                out.extend(palette[slot].map(f32::to_bits));
            }
        }
    }
    out
}

/// Merges the output of [`encode_hits`] of rank `from` into the nearest hits of this rank's tiles,
/// which begin at `first`.
fn decode_hits(
    side: &RankFrame<'_>,
    tiles: impl Iterator<Item = usize>,
    first: usize,
    from: usize,
    mut words: &[u32],
    colors: bool,
    answers: &mut [TileHits],
    seen: &mut Vec<usize>,
) -> Option<()> {
    let several = side.num_instances() > 1;
    for tile in tiles {
        let (&any, rest) = words.split_first()?;
        words = rest;
        if any == 0 {
            continue;
        }
        seen.push(tile);
        let (mask, mut rest) = words.split_at_checked(MASK_WORDS)?;
        let nearest = &mut answers[tile - first].nearest;
        for slot in slots(mask) {
            let mut next = || {
                let (&word, r) = rest.split_first()?;
                rest = r;
                Some(word)
            };
            let t = f32::from_bits(next()?);
            let instance = if several { next()? } else { 0 };
            let primitive = next()?;
            let mut hit = Nearest { t, instance, primitive, rank: from as u32, color: [0.0; 4] };
            if colors {
                for channel in &mut hit.color {
                    *channel = f32::from_bits(next()?);
                }
            }
            if hit.is_before(&nearest[slot]) {
                nearest[slot] = hit;
            }
        }
        words = rest;
    }
    words.is_empty().then_some(())
}

/// Slots whose bits are set.
fn slots(mask: &[u32]) -> impl Iterator<Item = usize> + '_ {
    mask.iter().enumerate().flat_map(|(word, &bits)| {
        let mut left = bits;
        std::iter::from_fn(move || {
            let bit = (left != 0).then(|| left.trailing_zeros() as usize)?;
            left &= left - 1;
            Some(32 * word + bit)
        })
    })
}

/// Requests the details of the nearest hits from the ranks that have them.
fn fetch_hit_details(
    channel: &mut RankChannel<'_>,
    side: &RankFrame<'_>,
    owners: &TileOwners,
    own: &OwnHits,
    seen_by: &[Vec<usize>],
    answers: &mut [TileHits],
) -> Result<(), FrameError> {
    let (rank, size) = (channel.rank(), channel.size());
    let first = owners.tiles[rank].start;
    for a in answers.iter_mut() {
        a.hits = vec![None; SLOTS];
    }
    // ---- Send everyone who has sent hits a mask of those that are nearest.
    let won: Vec<Vec<u32>> =
        (0..size).map(|from| winner_masks(from, &seen_by[from], first, answers)).collect();
    for step in 1..size {
        let to = (rank + step) % size;
        if owners.has_messages(to, rank, WHOLE) {
            channel.send(to, Tag::Winners, &won[to])?;
        }
    }
    channel.record_span(Activity::Exchange);
    // ---- Send the details of this rank's nearest hits.
    let with_hits = |owner: usize| {
        owners.shared(rank, owner, WHOLE).filter(|&t| own[t].is_some()).collect::<Vec<_>>()
    };
    let reply = |tiles: &[usize], masks: &[u32]| {
        let mut out = Vec::new();
        for (&tile, mask) in tiles.iter().zip(masks.chunks_exact(MASK_WORDS)) {
            for slot in slots(mask) {
                let mut met = own[tile].as_ref()?.shading_hit(side.frame, slot)?;
                met.primitive = side.global_primitive(met.instance, met.primitive);
                out.extend(encode_hit(&met));
            }
        }
        Some(out)
    };
    let mut put = |from: usize, words: &[u32]| {
        let (mets, rest) = words.as_chunks::<HIT_WORDS>();
        let mut mets = mets.iter().map(decode_hit);
        for (&tile, mask) in seen_by[from].iter().zip(won[from].chunks_exact(MASK_WORDS)) {
            for slot in slots(mask) {
                answers[tile - first].hits[slot] = Some(mets.next()?);
            }
        }
        (rest.is_empty() && mets.next().is_none()).then_some(())
    };
    let own_words = reply(&with_hits(rank), &won[rank])
        .ok_or_else(|| channel.message_error(rank, "hits that won", 0))?;
    put(rank, &own_words)
        .ok_or_else(|| channel.message_error(rank, "whole hits", own_words.len()))?;
    channel.record_span(Activity::Composite);
    let askers =
        (0..size).filter(|&owner| owner != rank && owners.has_messages(rank, owner, WHOLE));
    let sources: Vec<_> =
        askers.map(|owner| (owner, with_hits(owner).len() * MASK_WORDS)).collect();
    channel.receive(Tag::Winners, "hits that won", sources, |channel, owner, masks| {
        let tiles = with_hits(owner);
        let message_error =
            |channel: &RankChannel<'_>| channel.message_error(owner, "hits that won", masks.len());
        if masks.len() != tiles.len() * MASK_WORDS {
            return Err(message_error(channel));
        }
        let words = reply(&tiles, &masks).ok_or_else(|| message_error(channel))?;
        channel.record_span(Activity::Composite);
        channel.send(owner, Tag::Reply, &words)?;
        channel.record_span(Activity::Exchange);
        Ok(())
    })?;
    let wins = |from: usize| won[from].iter().map(|w| w.count_ones() as usize).sum::<usize>();
    let sources = (0..size).filter(|&from| from != rank && owners.has_messages(from, rank, WHOLE));
    let sources: Vec<_> = sources.map(|from| (from, wins(from) * HIT_WORDS)).collect();
    channel.receive(Tag::Reply, "whole hits", sources, |channel, from, words| {
        put(from, &words).ok_or_else(|| channel.message_error(from, "whole hits", words.len()))?;
        channel.record_span(Activity::Composite);
        Ok(())
    })
}

/// For each of `tiles`, a mask of the slots where the hit of rank `from` is the nearest.
fn winner_masks(from: usize, tiles: &[usize], first: usize, answers: &[TileHits]) -> Vec<u32> {
    let mut out = Vec::with_capacity(tiles.len() * MASK_WORDS);
    for &tile in tiles {
        let nearest = &answers[tile - first].nearest;
        out.extend(nearest.chunks_exact(32).map(|slots| {
            slots
                .iter()
                .enumerate()
                .fold(0, |mask, (bit, n)| mask | ((n.rank == from as u32) as u32) << bit)
        }));
    }
    out
}
