//! Camera rays: every rank traces them against its part, and owners of tiles keep the nearest hit of each pixel.
//!
//! Streamed, hits leave for the owner of their tiles as soon as a few tiles are traced, and what has come meanwhile is joined: messages travel while
//! rays are traced. Where local light suffices, finished tiles go on to the collecting rank at once. So a frame costs the longer of rendering and
//! compositing and not their sum: what sections 3.3.2 and 6.1 of the thesis wish for.
use super::ask::{Inbox, Incoming, Tag, Talk};
use super::collect::Collect;
use super::owners::Owners;
use super::sort_last::Side;
use super::{Activity, FrameError};
use rayon::prelude::*;
use rt_core::distributed::{CameraHits, DistributedFrame, Pass, ShadingHit};
use std::sync::atomic::Ordering;

/// Chunks of an owner's tiles at most, one after the other by all ranks. With more, less is left to send at the end, in more messages.
const CHUNKS: usize = 4;
/// Tiles of a chunk at least: with fewer, messages and looking for them cost more than travelling while others trace gains (measured with 100 tiles
/// and 128 ranks).
const CHUNK_TILES: usize = 8;
/// Tiles traced between two looks for messages.
const TILES_PER_LOOK: usize = 4;

/// Slots of a tile.
pub(super) const SLOTS: usize = 1024;
/// Words of a mask with a bit for each slot.
const MASK_WORDS: usize = SLOTS / 32;

/// The nearest hit of a pixel so far.
#[derive(Clone, Copy)]
struct Nearest {
    t: f32,
    instance: u32,
    primitive: u32,
    rank: u32,
    color: [f32; 4],
}

impl Nearest {
    const NOTHING: Nearest = Nearest {
        t: f32::INFINITY,
        instance: u32::MAX,
        primitive: u32::MAX,
        rank: u32::MAX,
        color: [0.0; 4],
    };

    fn is_before(&self, other: &Nearest) -> bool {
        let key = |n: &Nearest| (n.instance, n.primitive);
        // Nothing has t infinite and the highest numbers: every hit comes before it.
        self.t < other.t || (self.t == other.t && key(self) < key(other))
    }
}

/// What the camera rays of one owned tile meet.
pub(super) struct TileAnswer {
    nearest: Vec<Nearest>,
    /// Everything about the hits, where it was asked for.
    pub(super) met: Vec<Option<ShadingHit>>,
}

impl TileAnswer {
    fn new() -> TileAnswer {
        TileAnswer { nearest: vec![Nearest::NOTHING; SLOTS], met: Vec::new() }
    }

    /// Colours of the nearest hits.
    pub(super) fn colors(&self) -> Vec<Option<[f32; 4]>> {
        self.nearest.iter().map(|n| (n.rank != u32::MAX).then_some(n.color)).collect()
    }

    /// The rank whose hit is the nearest, of each slot; `u32::MAX` for none.
    pub(super) fn winner(&self, slot: usize) -> u32 {
        self.nearest[slot].rank
    }
}

/// Own hits, by tile; tiles without any are left out.
type OwnHits = Vec<Option<CameraHits>>;

/// What a pass of camera rays is for.
#[derive(Clone, Copy)]
pub(super) struct Wanted {
    pub(super) pass: Pass,
    /// Hits come with their colours.
    pub(super) colors: bool,
    /// Owners get everything about the nearest hits.
    pub(super) whole_hits: bool,
    /// Messages travel while rays are traced.
    pub(super) stream: bool,
}

/// One pass of camera rays. With `collect`, colours of hits make finished tiles, which go to the collecting rank.
pub(super) fn run(
    talk: &mut Talk<'_>,
    side: &Side<'_>,
    owners: &Owners,
    wanted: Wanted,
    collect: Option<&mut Collect<'_>>,
) -> Result<Vec<TileAnswer>, FrameError> {
    let (rank, size) = (talk.rank(), talk.size());
    let tiles_per_owner = side.frame.num_tiles() / size;
    let chunks = if wanted.stream { (tiles_per_owner / CHUNK_TILES).clamp(1, CHUNKS) } else { 1 };
    let mut wave = CameraWave {
        side,
        owners,
        wanted,
        chunks,
        own: Vec::new(),
        answers: owners.tiles[rank].clone().map(|_| TileAnswer::new()).collect(),
        seen_by: vec![Vec::new(); size],
        joined: vec![0; size],
        missing: Vec::new(),
        finished: 0,
        inbox: Inbox::default(),
        collect,
    };
    wave.own.resize_with(side.frame.num_tiles(), || None);
    wave.announce(talk)?;
    // ---- Rays, and hits to the owners of their tiles: to the next rank first, so that nobody gets all at once, and one's own last.
    let to = |step: usize| (rank + 1 + step) % size;
    let mut traced = 0;
    for chunk in 0..chunks {
        if side.parallel {
            let all = (0..size).flat_map(|owner| owners.shared(rank, owner, (chunk, chunks)));
            wave.trace(talk, all.collect());
        }
        for owner in (0..size).map(to) {
            if !side.parallel {
                let tiles: Vec<usize> = owners.shared(rank, owner, (chunk, chunks)).collect();
                traced += tiles.len();
                wave.trace(talk, tiles);
            }
            if wanted.stream {
                wave.hand_over(talk, owner, chunk)?;
            }
            if wanted.stream && (side.parallel || traced >= TILES_PER_LOOK) {
                traced = 0;
                while let Some(incoming) = talk.next(&mut wave.inbox, false)? {
                    wave.take(talk, incoming)?;
                }
            }
        }
    }
    if !wanted.stream {
        for owner in (0..size).map(to) {
            wave.hand_over(talk, owner, 0)?;
        }
    }
    while let Some(incoming) = talk.next(&mut wave.inbox, true)? {
        wave.take(talk, incoming)?;
    }
    let CameraWave { own, seen_by, mut answers, .. } = wave;
    if wanted.whole_hits {
        fetch_whole_hits(talk, side, owners, &own, &seen_by, &mut answers)?;
    }
    Ok(answers)
}

/// All of an owner's tiles, as one chunk.
const WHOLE: (usize, usize) = (0, 1);

/// One rank's camera rays of one pass.
struct CameraWave<'a, 'c> {
    side: &'a Side<'a>,
    owners: &'a Owners,
    wanted: Wanted,
    chunks: usize,
    own: OwnHits,
    answers: Vec<TileAnswer>,
    /// Of each rank, its tiles in which it has hits.
    seen_by: Vec<Vec<usize>>,
    /// Of each rank, how many chunks of its hits have been joined (or passed, having nothing).
    joined: Vec<usize>,
    /// Of each of the own chunks, how many ranks have not yet said what they see there.
    missing: Vec<usize>,
    /// Own chunks that have gone on to the root.
    finished: usize,
    inbox: Inbox,
    collect: Option<&'a mut Collect<'c>>,
}

impl CameraWave<'_, '_> {
    /// Posts all receives of the pass.
    fn announce(&mut self, talk: &mut Talk<'_>) -> Result<(), FrameError> {
        let (rank, size) = (talk.rank(), talk.size());
        let per_pixel = words_per_hit(self.side.frame, self.wanted.colors);
        for chunk in (0..self.chunks).map(|c| (c, self.chunks)) {
            let mut missing = 1;
            for from in (0..size).filter(|&from| from != rank) {
                let tiles = self.owners.shared(from, rank, chunk).count();
                if tiles > 0 {
                    let most = tiles * (1 + MASK_WORDS + SLOTS * per_pixel);
                    talk.expect(&mut self.inbox, from, Tag::Hits, most)?;
                    missing += 1;
                }
            }
            self.missing.push(missing);
        }
        match &mut self.collect {
            Some(collect) => collect.announce(talk, &mut self.inbox, self.owners, self.chunks),
            None => Ok(()),
        }
    }

    /// Traces some of the tiles in which this rank's part may be seen.
    fn trace(&mut self, talk: &mut Talk<'_>, tiles: Vec<usize>) {
        let side = self.side;
        let one = |&tile: &usize| {
            let mut hits = CameraHits::default();
            side.frame.camera_hits(tile, self.wanted.pass, &mut hits);
            let any = hits.mask().any(|m| m != 0);
            (tile, any, hits)
        };
        let traced: Vec<_> = if side.parallel {
            talk.beside(|steps| {
                let count = |hits| {
                    steps.fetch_add(1, Ordering::Relaxed);
                    hits
                };
                tiles.par_iter().map(one).map(count).collect()
            })
        } else {
            let mut with_sign = |tile| {
                let hits = one(tile);
                talk.alive();
                hits
            };
            tiles.iter().map(&mut with_sign).collect()
        };
        for (tile, any, hits) in traced {
            talk.report.camera_rays += hits.rays();
            if any {
                self.own[tile] = Some(hits);
            }
        }
        talk.spent(Activity::Render);
    }

    /// The own hits in a chunk to the owner of its tiles.
    fn hand_over(&mut self, talk: &mut Talk<'_>, owner: usize, chunk: usize) -> Result<(), FrameError> {
        let (rank, place) = (talk.rank(), (chunk, self.chunks));
        if owner != rank && !self.owners.talks(rank, owner, place) {
            return Ok(());
        }
        let tiles = self.owners.shared(rank, owner, place);
        let words = encode_hits(self.side, tiles, &mut self.own, self.wanted.colors);
        talk.spent(Activity::Render);
        if owner == rank {
            return self.join(talk, rank, chunk, &words);
        }
        talk.send(owner, Tag::Hits, &words)?;
        talk.spent(Activity::Exchange);
        Ok(())
    }

    fn take(&mut self, talk: &mut Talk<'_>, incoming: Incoming) -> Result<(), FrameError> {
        let Incoming { from, tag, words } = incoming;
        if tag == Tag::Tiles as u32 {
            return match &mut self.collect {
                Some(collect) => collect.place(talk, self.owners, from, self.chunks, &words),
                None => Err(talk.wrong(from, "tiles", words.len())),
            };
        }
        // Messages of one rank come in order; chunks of which it sees nothing are not sent.
        let (rank, chunks) = (talk.rank(), self.chunks);
        let next = (self.joined[from]..chunks).find(|&c| self.owners.talks(from, rank, (c, chunks)));
        let chunk = next.ok_or_else(|| talk.wrong(from, "hits", words.len()))?;
        self.joined[from] = chunk + 1;
        self.join(talk, from, chunk, &words)
    }

    /// What rank `from` sees in an own chunk.
    fn join(
        &mut self,
        talk: &mut Talk<'_>,
        from: usize,
        chunk: usize,
        words: &[u32],
    ) -> Result<(), FrameError> {
        let (rank, place) = (talk.rank(), (chunk, self.chunks));
        let (tiles, first) = (self.owners.shared(from, rank, place), self.owners.tiles[rank].start);
        let (answers, seen) = (&mut self.answers, &mut self.seen_by[from]);
        decode_hits(self.side, tiles, first, from, words, self.wanted.colors, answers, seen)
            .ok_or_else(|| talk.wrong(from, "hits", words.len()))?;
        talk.spent(Activity::Composite);
        self.missing[chunk] -= 1;
        // In the order of chunks, which the root relies on: a chunk that few ranks see may be complete before the one in front of it.
        let Some(collect) = &mut self.collect else { return Ok(()) };
        while self.missing.get(self.finished) == Some(&0) {
            let tiles = self.owners.chunk(rank, (self.finished, self.chunks));
            self.finished += 1;
            collect.finish(talk, tiles, self.wanted.pass, &self.answers)?;
        }
        Ok(())
    }
}

fn words_per_hit(frame: &DistributedFrame<'_>, colors: bool) -> usize {
    2 + (frame.num_instances() > 1) as usize + if colors { 4 } else { 0 }
}

/// Hits in `tiles`: of each tile whether there are any, then a mask of slots and the hits in order.
fn encode_hits(
    side: &Side<'_>,
    tiles: impl Iterator<Item = usize>,
    own: &mut OwnHits,
    colors: bool,
) -> Vec<u32> {
    let several = side.frame.num_instances() > 1;
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
            out.push(side.in_whole(hit.instance, hit.prim));
            if colors {
                out.extend(palette[slot].map(f32::to_bits));
            }
        }
    }
    out
}

/// Joins what [`encode_hits`] of rank `from` made to the nearest hits of this rank's tiles, which begin at `first`.
fn decode_hits(
    side: &Side<'_>,
    tiles: impl Iterator<Item = usize>,
    first: usize,
    from: usize,
    mut words: &[u32],
    colors: bool,
    answers: &mut [TileAnswer],
    seen: &mut Vec<usize>,
) -> Option<()> {
    let several = side.frame.num_instances() > 1;
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

/// Asks the ranks whose hits are the nearest for everything about them.
fn fetch_whole_hits(
    talk: &mut Talk<'_>,
    side: &Side<'_>,
    owners: &Owners,
    own: &OwnHits,
    seen_by: &[Vec<usize>],
    answers: &mut [TileAnswer],
) -> Result<(), FrameError> {
    let (rank, size) = (talk.rank(), talk.size());
    let first = owners.tiles[rank].start;
    for a in answers.iter_mut() {
        a.met = vec![None; SLOTS];
    }
    // ---- To everyone who has sent hits: a mask of those that won.
    let won: Vec<Vec<u32>> = (0..size).map(|from| won_masks(from, &seen_by[from], first, answers)).collect();
    for step in 1..size {
        let to = (rank + step) % size;
        if owners.talks(to, rank, WHOLE) {
            talk.send(to, Tag::Won, &won[to])?;
        }
    }
    talk.spent(Activity::Exchange);
    // ---- Everything about this rank's hits that won.
    let with_hits =
        |owner: usize| owners.shared(rank, owner, WHOLE).filter(|&t| own[t].is_some()).collect::<Vec<_>>();
    let reply = |tiles: &[usize], masks: &[u32]| {
        let mut out = Vec::new();
        for (&tile, mask) in tiles.iter().zip(masks.chunks_exact(MASK_WORDS)) {
            for slot in slots(mask) {
                let mut met = own[tile].as_ref()?.shading_hit(side.frame, slot)?;
                met.primitive = side.in_whole(met.instance, met.primitive);
                out.extend(met.to_words());
            }
        }
        Some(out)
    };
    let mut put = |from: usize, words: &[u32]| {
        let (mets, rest) = words.as_chunks::<{ ShadingHit::WORDS }>();
        let mut mets = mets.iter().map(ShadingHit::from_words);
        for (&tile, mask) in seen_by[from].iter().zip(won[from].chunks_exact(MASK_WORDS)) {
            for slot in slots(mask) {
                answers[tile - first].met[slot] = Some(mets.next()?);
            }
        }
        (rest.is_empty() && mets.next().is_none()).then_some(())
    };
    let own_words =
        reply(&with_hits(rank), &won[rank]).ok_or_else(|| talk.wrong(rank, "hits that won", 0))?;
    put(rank, &own_words).ok_or_else(|| talk.wrong(rank, "whole hits", own_words.len()))?;
    talk.spent(Activity::Composite);
    let askers = (0..size).filter(|&owner| owner != rank && owners.talks(rank, owner, WHOLE));
    let sources: Vec<_> = askers.map(|owner| (owner, with_hits(owner).len() * MASK_WORDS)).collect();
    talk.receive(Tag::Won, "hits that won", sources, |talk, owner, masks| {
        let tiles = with_hits(owner);
        let wrong = |talk: &Talk<'_>| talk.wrong(owner, "hits that won", masks.len());
        if masks.len() != tiles.len() * MASK_WORDS {
            return Err(wrong(talk));
        }
        let words = reply(&tiles, &masks).ok_or_else(|| wrong(talk))?;
        talk.spent(Activity::Composite);
        talk.send(owner, Tag::Answer, &words)?;
        talk.spent(Activity::Exchange);
        Ok(())
    })?;
    let wins = |from: usize| won[from].iter().map(|w| w.count_ones() as usize).sum::<usize>();
    let sources = (0..size).filter(|&from| from != rank && owners.talks(from, rank, WHOLE));
    let sources: Vec<_> = sources.map(|from| (from, wins(from) * ShadingHit::WORDS)).collect();
    talk.receive(Tag::Answer, "whole hits", sources, |talk, from, words| {
        put(from, &words).ok_or_else(|| talk.wrong(from, "whole hits", words.len()))?;
        talk.spent(Activity::Composite);
        Ok(())
    })
}

/// Of each of `tiles`, a mask of the slots where the hit of rank `from` is the nearest.
fn won_masks(from: usize, tiles: &[usize], first: usize, answers: &[TileAnswer]) -> Vec<u32> {
    let mut out = Vec::with_capacity(tiles.len() * MASK_WORDS);
    for &tile in tiles {
        let nearest = &answers[tile - first].nearest;
        out.extend(nearest.chunks_exact(32).map(|slots| {
            slots.iter().enumerate().fold(0, |mask, (bit, n)| mask | ((n.rank == from as u32) as u32) << bit)
        }));
    }
    out
}
