//! Bricks of volumes: which rank has which blocks, and the points that it fetches from others.
//!
//! A block of cells belongs to the lowest rank whose points have the first cell of the block. So
//! the blocks of a rank are a box, which every rank computes from the others' tables. At the upper
//! sides of its brick a rank lacks points of its last blocks, and the ghost points around them that
//! gradients need: it fetches those from the ranks that have them. Where volumes overlap, it also
//! fetches what coarser ones have around its blocks.
use super::rank_scene::{DistributedVolume, PointBrick};
use super::tables::Table;
use crate::render::FrameError;
use crate::render::request_reply::RankChannel;
use crate::render::volume_bricks::{BrickData, CoarseOccupancy, VolumeBrick, VolumeBricks};
use rt_core::glam::UVec3;
use rt_core::scene::Scene;
use rt_core::volume::{Brick, Interpolation, MACROCELL, Volume};

/// Words of a question for points: the volume, the brick of the rank that is asked, and the corners
/// of a box.
const QUESTION_WORDS: usize = 8;

/// How often a rank may ask for all the points that another one has: bricks of finer volumes may
/// all lie around the same points of a coarse one.
const MOST_TIMES: usize = 4096;

/// A box of points of a volume, to be filled.
struct Wanted {
    volume: usize,
    low: UVec3,
    high: UVec3,
    values: Vec<f32>,
    filled: Vec<bool>,
    missing: usize,
}

impl Wanted {
    fn new(volume: usize, [low, high]: [UVec3; 2]) -> Wanted {
        let points = (high - low).as_usizevec3().element_product();
        let (values, filled) = (vec![0.0; points], vec![false; points]);
        Wanted { volume, low, high, values, filled, missing: points }
    }

    fn index(&self, p: UVec3) -> usize {
        let (at, size) = ((p - self.low).as_usizevec3(), (self.high - self.low).as_usizevec3());
        (at.z * size.y + at.y) * size.x + at.x
    }

    /// The box that this and another one share; `None` for none.
    fn shared(&self, low: UVec3, high: UVec3) -> Option<[UVec3; 2]> {
        let (low, high) = (self.low.max(low), self.high.min(high));
        low.cmplt(high).all().then_some([low, high])
    }

    /// Sets the points of a box that no earlier one has set; `value` is called for each in order.
    fn fill(&mut self, [low, high]: [UVec3; 2], mut value: impl FnMut(UVec3) -> f32) {
        for p in points(low, high) {
            let (k, v) = (self.index(p), value(p));
            if !std::mem::replace(&mut self.filled[k], true) {
                self.values[k] = v;
                self.missing -= 1;
            }
        }
    }

    fn lacks_some_of(&self, [low, high]: [UVec3; 2]) -> bool {
        points(low, high).any(|p| !self.filled[self.index(p)])
    }

    /// Marks points as asked for: other ranks need not send them too.
    fn mark(&mut self, [low, high]: [UVec3; 2]) {
        for p in points(low, high) {
            let k = self.index(p);
            self.filled[k] = true;
        }
    }
}

/// Points of a box, x fastest.
fn points(low: UVec3, high: UVec3) -> impl Iterator<Item = UVec3> {
    (low.z..high.z).flat_map(move |z| {
        (low.y..high.y).flat_map(move |y| (low.x..high.x).map(move |x| UVec3::new(x, y, z)))
    })
}

fn is_nearest(volume: &DistributedVolume) -> bool {
    volume.options.interpolation == Interpolation::Nearest
}

/// The blocks of a rank with these points.
fn blocks_of(volume: &DistributedVolume, [first, dims]: [UVec3; 2]) -> Brick {
    let nearest = is_nearest(volume);
    let cells = if nearest { dims } else { dims.saturating_sub(UVec3::ONE) };
    if cells.min_element() == 0 {
        return Brick::EMPTY;
    }
    let block = |p: u32| p.div_ceil(MACROCELL);
    let (low, high) = (first.to_array(), (first + cells).to_array());
    let brick = Brick {
        first: UVec3::from_array(low.map(block)),
        end: UVec3::from_array(high.map(block)).min(volume.whole.blocks(nearest)),
    };
    if brick.is_empty() { Brick::EMPTY } else { brick }
}

/// A volume without values, which stands for the whole.
///
/// # Errors
/// In words, why it cannot be one.
pub(super) fn placeholder(volume: &DistributedVolume) -> Result<Volume, String> {
    let (transfer, options) = (volume.transfer.clone(), volume.options.clone());
    let none = Volume::from_brick(volume.whole, Brick::EMPTY, vec![0.0], transfer, options)
        .map_err(|e| format!("volume `{}`: {e}", volume.name))?;
    if none.is_medium() {
        Ok(none)
    } else {
        Err(format!(
            "volume `{}` is a projection, which sees the whole volume at once: it cannot be \
             distributed; blend it as a medium",
            volume.name
        ))
    }
}

/// What this rank holds of all volumes, and who holds what. `scene` has the placeholders of all
/// volumes.
///
/// # Errors
/// [`FrameError::RankScene`] on every rank when nobody has some of the points, or errors of the
/// transport.
pub(super) fn exchange(
    channel: &mut RankChannel<'_>,
    volumes: &[DistributedVolume],
    tables: &[Table],
    scene: &Scene,
) -> Result<(VolumeBricks, Vec<Option<BrickData>>), FrameError> {
    let rank = channel.rank();
    let mut all = Vec::new();
    for (v, volume) in volumes.iter().enumerate() {
        for (holder, table) in tables.iter().enumerate() {
            for points in &table.bricks[v] {
                let (brick, holders) = (blocks_of(volume, *points), vec![holder as u16]);
                all.push(VolumeBrick { volume: v, brick, holders, occupied: None });
            }
        }
    }
    let mut bricks = VolumeBricks::of_bricks(scene, all);

    for (v, volume) in volumes.iter().enumerate() {
        if let Some(block) = bricks.first_uncovered(v) {
            let values = format!(
                "no rank has the cell at point {}; bricks must share the points between them and \
                 fill the grid",
                block * MACROCELL
            );
            let (what, field) = (format!("volume `{}`", volume.name), "bricks".to_owned());
            return Err(FrameError::Contradiction { what, field, values });
        }
    }

    // ---- The points that this rank's bricks need, as far as it has them itself.
    let mut wanted: Vec<Wanted> = Vec::new();
    // Of each wanted box, the brick that it is for, and its blocks.
    let mut places: Vec<(usize, Brick)> = Vec::new();
    for (k, brick) in bricks.all.iter().enumerate() {
        if brick.holders != [rank as u16] || brick.brick.is_empty() {
            continue;
        }
        for (v, blocks) in bricks.blocks_needed(scene, brick) {
            let range = blocks.points(volumes[v].whole.dims, is_nearest(&volumes[v]));
            wanted.push(Wanted::new(v, range));
            places.push((k, blocks));
        }
    }
    for w in &mut wanted {
        for own in &volumes[w.volume].bricks {
            if let Some(range) = w.shared(own.first, own.first + own.dims) {
                w.fill(range, |p| value_at(own, p));
            }
        }
    }

    // ---- The others are fetched.
    let mut requests: Vec<Vec<u32>> = vec![Vec::new(); channel.size()];
    let mut asked: Vec<Vec<(usize, [UVec3; 2])>> = vec![Vec::new(); channel.size()];
    for (k, w) in wanted.iter_mut().enumerate() {
        let known = w.filled.clone();
        for (from, table) in tables.iter().enumerate().filter(|(from, _)| *from != rank) {
            for (number, [first, dims]) in table.bricks[w.volume].iter().enumerate() {
                let shared = w.shared(*first, *first + *dims);
                let Some(range) = shared.filter(|range| w.lacks_some_of(*range)) else { continue };
                w.mark(range);
                requests[from].extend([w.volume as u32, number as u32]);
                requests[from].extend(range.iter().flat_map(|p| p.to_array()));
                asked[from].push((k, range));
            }
        }
        w.filled = known;
    }
    let mut answer = |_: &mut _, request: &[u32]| answer_points(volumes, request);
    let longest = |request: &[u32]| {
        let (questions, _) = request.as_chunks::<QUESTION_WORDS>();
        questions.iter().map(|q| points_of(*q).unwrap_or(0)).sum()
    };
    channel.request_reply(
        "points of a volume",
        &requests,
        longest,
        &mut answer,
        |from, reply| {
            let mut next = reply.iter();
            for &(k, range) in &asked[from] {
                let mut short = false;
                wanted[k].fill(range, |_| match next.next() {
                    Some(word) => f32::from_bits(*word),
                    None => {
                        short = true;
                        0.0
                    }
                });
                if short {
                    let (what, words) = ("points of a volume", reply.len());
                    return Err(FrameError::Message { rank, from, what, words });
                }
            }
            if next.next().is_some() {
                let (what, words) = ("points of a volume", reply.len());
                return Err(FrameError::Message { rank, from, what, words });
            }
            Ok(())
        },
    )?;

    // ---- Bricks of what came.
    let mut held: Vec<Option<BrickData>> = vec![None; bricks.all.len()];
    let mut problem = Ok(());
    for (w, (k, blocks)) in wanted.into_iter().zip(places) {
        match make(&volumes[w.volume], w, blocks) {
            Ok((v, part)) => {
                held[k].get_or_insert_with(|| BrickData::empty(volumes.len())).set(v, blocks, part)
            }
            Err(reason) => problem = problem.and(Err(reason)),
        }
    }
    channel.agree_on_success(problem)?;

    // ---- Where there is something to see.
    let mut mine = Vec::new();
    for (k, brick) in bricks.all.iter().enumerate() {
        if brick.holders == [rank as u16] {
            let part = held[k].as_ref().and_then(|data| data.volume(brick.volume));
            mine.extend(CoarseOccupancy::of(part, brick.brick).0);
        }
    }
    let all = channel.all_gather_varying(&mine)?;
    let mut next: Vec<&[u32]> = all.iter().map(Vec::as_slice).collect();
    for brick in &mut bricks.all {
        let from = usize::from(brick.holders[0]);
        let (words, rest) = next[from]
            .split_first_chunk()
            .ok_or_else(|| channel.message_error(from, "bricks of volumes", all[from].len()))?;
        (brick.occupied, next[from]) = (Some(CoarseOccupancy(*words)), rest);
    }
    if let Some(from) = next.iter().position(|rest| !rest.is_empty()) {
        return Err(channel.message_error(from, "bricks of volumes", all[from].len()));
    }
    Ok((bricks, held))
}

/// The number of the volume, and its part.
fn make(volume: &DistributedVolume, w: Wanted, blocks: Brick) -> Result<(usize, Volume), String> {
    let name = &volume.name;
    if let Some(missing) = w.filled.iter().position(|there| !there) {
        let size = (w.high - w.low).as_usizevec3();
        let at = [missing % size.x, missing / size.x % size.y, missing / size.x / size.y];
        let p = w.low + UVec3::from_array(at.map(|c| c as u32));
        return Err(format!(
            "no rank has the value of point {p} of volume `{name}` (and {} others that this rank \
             needs): bricks must share the points between them and fill the grid",
            w.missing - 1
        ));
    }
    let (transfer, options) = (volume.transfer.clone(), volume.options.clone());
    let part = Volume::from_brick(volume.whole, blocks, w.values, transfer, options)
        .map_err(|e| format!("volume `{name}`: {e}"))?;
    Ok((w.volume, part))
}

fn value_at(brick: &PointBrick, p: UVec3) -> f32 {
    let (at, dims) = ((p - brick.first).as_usizevec3(), brick.dims.as_usizevec3());
    brick.values[(at.z * dims.y + at.y) * dims.x + at.x]
}

/// Number of points of a question's box.
fn points_of([_, _, low @ .., x, y, z]: [u32; QUESTION_WORDS]) -> Option<usize> {
    let size = UVec3::new(x, y, z).checked_sub(UVec3::from_array(low))?;
    let points = u64::from(size.x).checked_mul(size.y.into())?.checked_mul(size.z.into())?;
    usize::try_from(points).ok()
}

/// The values that another rank asks for; `None` when this rank does not have them.
fn answer_points(volumes: &[DistributedVolume], request: &[u32]) -> Option<Vec<u32>> {
    let (questions, rest) = request.as_chunks::<QUESTION_WORDS>();
    if !rest.is_empty() {
        return None;
    }
    let held: usize = volumes.iter().flat_map(|v| &v.bricks).map(|b| b.values.len()).sum();
    // Nobody needs a point more often than for each brick that it has.
    let most = held.saturating_mul(MOST_TIMES);
    let mut out = Vec::new();
    for question in questions {
        let [volume, number, x, y, z, high @ ..] = *question;
        let brick = volumes.get(volume as usize)?.bricks.get(number as usize)?;
        let (low, high) = (UVec3::new(x, y, z), UVec3::from_array(high));
        let end = brick.first + brick.dims;
        if !(low.cmpge(brick.first).all() && low.cmplt(high).all() && high.cmple(end).all()) {
            return None;
        }
        if points_of(*question)?.checked_add(out.len())? > most {
            return None;
        }
        out.extend(points(low, high).map(|p| value_at(brick, p).to_bits()));
    }
    Some(out)
}
