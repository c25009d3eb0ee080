//! Camera rays: every rank traces them against its part, and owners of tiles keep the nearest hit of each pixel.
use super::ask::{Tag, Talk};
use super::owners::Owners;
use super::sort_last::Side;
use super::{Activity, FrameError};
use rayon::prelude::*;
use rt_core::waves::{CameraHits, Met, Pass, WaveFrame};

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
    pub(super) met: Vec<Option<Met>>,
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

/// One pass of camera rays. `colors`: hits come with their colours. `whole_hits`: owners get everything about the nearest hits.
pub(super) fn run(
    talk: &mut Talk<'_>,
    side: &Side<'_>,
    owners: &Owners,
    pass: Pass,
    colors: bool,
    whole_hits: bool,
) -> Result<Vec<TileAnswer>, FrameError> {
    let (rank, size) = (talk.rank(), talk.size());
    let mut own = trace(talk, side, owners, pass);
    talk.spent(Activity::Render);

    // ---- Hits to the owners of their tiles.
    let mut messages: Vec<Vec<u32>> =
        (0..size).map(|owner| encode_hits(side, owners.shared(rank, owner), &mut own, colors)).collect();
    talk.spent(Activity::Render);
    for step in 1..size {
        let owner = (rank + step) % size;
        if owners.talks(rank, owner) {
            talk.send(owner, Tag::Hits, &messages[owner])?;
        }
    }
    talk.spent(Activity::Exchange);
    let mine = owners.tiles[rank].clone();
    let mut answers: Vec<TileAnswer> = mine.clone().map(|_| TileAnswer::new()).collect();
    // Of each rank, its tiles in which it has hits.
    let mut seen_by: Vec<Vec<usize>> = vec![Vec::new(); size];
    let mut join = |from: usize, words: &[u32]| {
        let tiles = owners.shared(from, rank);
        decode_hits(side, tiles, mine.start, from, words, colors, &mut answers, &mut seen_by[from])
    };
    join(rank, &std::mem::take(&mut messages[rank])).ok_or_else(|| talk.wrong(rank, "hits", 0))?;
    talk.spent(Activity::Composite);
    let per_pixel = words_per_hit(side.frame, colors);
    let most = |from: usize| owners.shared(from, rank).count() * (1 + MASK_WORDS + SLOTS * per_pixel);
    let sources = (0..size).filter(|&from| from != rank && owners.talks(from, rank));
    talk.receive(Tag::Hits, "hits", sources.map(|from| (from, most(from))), |talk, from, words| {
        join(from, &words).ok_or_else(|| talk.wrong(from, "hits", words.len()))?;
        talk.spent(Activity::Composite);
        Ok(())
    })?;
    if whole_hits {
        fetch_whole_hits(talk, side, owners, &own, &seen_by, &mut answers)?;
    }
    Ok(answers)
}

/// Traces the tiles in which this rank's part may be seen.
fn trace(talk: &mut Talk<'_>, side: &Side<'_>, owners: &Owners, pass: Pass) -> OwnHits {
    let (rank, size) = (talk.rank(), talk.size());
    let mut touched: Vec<usize> = (0..size).flat_map(|owner| owners.shared(rank, owner)).collect();
    touched.sort_unstable();
    let one = |&tile: &usize| {
        let mut hits = CameraHits::default();
        side.frame.camera_hits(tile, pass, &mut hits);
        let any = hits.mask().any(|m| m != 0);
        (tile, any, hits)
    };
    let traced: Vec<_> =
        if side.parallel { touched.par_iter().map(one).collect() } else { touched.iter().map(one).collect() };
    let mut own: OwnHits = Vec::new();
    own.resize_with(side.frame.num_tiles(), || None);
    for (tile, any, hits) in traced {
        talk.report.camera_rays += hits.rays();
        if any {
            own[tile] = Some(hits);
        }
    }
    own
}

fn words_per_hit(frame: &WaveFrame<'_>, colors: bool) -> usize {
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
        if owners.talks(to, rank) {
            talk.send(to, Tag::Won, &won[to])?;
        }
    }
    talk.spent(Activity::Exchange);
    // ---- Everything about this rank's hits that won.
    let with_hits =
        |owner: usize| owners.shared(rank, owner).filter(|&t| own[t].is_some()).collect::<Vec<_>>();
    let reply = |tiles: &[usize], masks: &[u32]| {
        let mut out = Vec::new();
        for (&tile, mask) in tiles.iter().zip(masks.chunks_exact(MASK_WORDS)) {
            for slot in slots(mask) {
                let mut met = own[tile].as_ref()?.met(side.frame, slot)?;
                met.primitive = side.in_whole(met.instance, met.primitive);
                out.extend(met.to_words());
            }
        }
        Some(out)
    };
    let mut put = |from: usize, words: &[u32]| {
        let (mets, rest) = words.as_chunks::<{ Met::WORDS }>();
        let mut mets = mets.iter().map(Met::from_words);
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
    let askers = (0..size).filter(|&owner| owner != rank && owners.talks(rank, owner));
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
    let sources = (0..size).filter(|&from| from != rank && owners.talks(from, rank));
    let sources: Vec<_> = sources.map(|from| (from, wins(from) * Met::WORDS)).collect();
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
