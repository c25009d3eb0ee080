//! Which rank holds which bricks of which volumes.
//!
//! Where volumes overlap, a span of a ray needs the blocks of all of them at once. So a rank that
//! holds a brick of a volume also holds what coarser volumes have there, and computes every span in
//! which that volume is the finest. This way little is held twice. (The first volume of the scene,
//! tried before, had others hold five times a fine volume that was rotated against a coarse one.)
use super::FrameError;
use rt_core::glam::{DAffine3, DMat3, DVec3, UVec3};
use rt_core::scene::{Scene, VolumeInstance};
use rt_core::volume::{Brick, MACROCELL, Volume};
use std::sync::Arc;

/// Work of a block without extinction or that is not needed, relative to one with extinction that
/// is needed.
const CLEAR_WORK: f64 = 0.02;

/// A brick of a volume, and the ranks that hold it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct VolumeBrick {
    pub(super) volume: usize,
    pub(super) brick: Brick,
    pub(super) holders: Vec<u16>,
    /// Where it has extinction, if the blocks of the whole are nowhere listed.
    pub(super) occupied: Option<CoarseOccupancy>,
}

/// Whether parts of a brick have any extinction: a bit for each of 8 x 8 x 8 parts, x fastest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct CoarseOccupancy(pub(super) [u32; CoarseOccupancy::WORDS]);

impl CoarseOccupancy {
    pub(super) const WORDS: usize = 16;
    const PARTS: u32 = 8;

    /// That of `brick` of a volume that holds it; nothing without one.
    pub(super) fn of(volume: Option<&Volume>, brick: Brick) -> CoarseOccupancy {
        let mut bits = [0; CoarseOccupancy::WORDS];
        if let Some(volume) = volume {
            for block in blocks_of(brick).filter(|block| volume.is_occupied(*block)) {
                let (word, bit) = CoarseOccupancy::place(brick, block);
                bits[word] |= 1 << bit;
            }
        }
        CoarseOccupancy(bits)
    }

    /// Whether the part of `brick` around `block`, which is in the brick, has any extinction.
    fn has(&self, brick: Brick, block: UVec3) -> bool {
        let (word, bit) = CoarseOccupancy::place(brick, block);
        self.0[word] >> bit & 1 != 0
    }

    fn place(brick: Brick, block: UVec3) -> (usize, u32) {
        let (at, size) =
            ((block - brick.first).as_u64vec3(), (brick.end - brick.first).as_u64vec3());
        let part = (at * u64::from(CoarseOccupancy::PARTS) / size).as_uvec3();
        let k = (part.z * CoarseOccupancy::PARTS + part.y) * CoarseOccupancy::PARTS + part.x;
        (k as usize / 32, k % 32)
    }
}

/// All bricks of all volumes that are media. Projections need whole volumes, so every rank holds
/// those.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct VolumeBricks {
    pub(super) all: Vec<VolumeBrick>,
    /// By volume, whether a block has any extinction, x fastest. Empty where nobody has the whole:
    /// then the bricks know it, coarsely.
    occupied: Vec<Vec<bool>>,
    /// By volume, its blocks per axis.
    blocks: Vec<UVec3>,
    /// By volume, how many volumes are finer.
    finer: Vec<usize>,
}

impl VolumeBricks {
    /// Cuts every medium into one brick for each of `ranks` ranks.
    pub(super) fn one_per_rank(scene: &Scene, ranks: usize) -> VolumeBricks {
        let mut volume_bricks = VolumeBricks { finer: finer(scene), ..VolumeBricks::default() };
        for placed in &scene.volumes {
            volume_bricks.blocks.push(placed.volume.blocks());
            let whole = Brick { first: UVec3::ZERO, end: placed.volume.blocks() };
            volume_bricks
                .occupied
                .push(blocks_of(whole).map(|block| placed.volume.is_occupied(block)).collect());
        }
        let each: Vec<Vec<u16>> = (0..ranks).map(|rank| vec![rank as u16]).collect();
        for volume in 0..scene.volumes.len() {
            volume_bricks.cut(scene, volume, &each);
        }
        volume_bricks
    }

    /// Cuts a volume again: a brick for each list of ranks, which hold it.
    pub(super) fn cut(&mut self, scene: &Scene, volume: usize, holders: &[Vec<u16>]) {
        self.all.retain(|volume_brick| volume_brick.volume != volume);
        let placed = &scene.volumes[volume];
        if !placed.volume.is_medium() {
            return;
        }
        let bricks = bricks(&placed.volume, holders.len(), &covered_by(scene, &self.finer, volume));
        let volume_brick = |(brick, holders): (Brick, &Vec<u16>)| VolumeBrick {
            volume,
            brick,
            holders: holders.clone(),
            occupied: None,
        };
        self.all.extend(bricks.into_iter().zip(holders).map(volume_brick));
    }

    /// Bricks of volumes that no rank has whole. `scene` has placeholders for them.
    pub(super) fn of_bricks(scene: &Scene, all: Vec<VolumeBrick>) -> VolumeBricks {
        let blocks = scene.volumes.iter().map(|placed| placed.volume.blocks()).collect();
        VolumeBricks { all, occupied: Vec::new(), blocks, finer: finer(scene) }
    }

    /// The blocks that the holder of a brick needs, by volume: its own, and those of coarser
    /// volumes around it.
    pub(super) fn blocks_needed(&self, scene: &Scene, brick: &VolumeBrick) -> Vec<(usize, Brick)> {
        blocks_needed(scene, &self.finer, brick)
    }

    /// A block of `volume` that no brick has.
    pub(super) fn first_uncovered(&self, volume: usize) -> Option<UVec3> {
        let bricks: Vec<Brick> =
            self.all.iter().filter(|b| b.volume == volume).map(|b| b.brick).collect();
        first_outside(Brick { first: UVec3::ZERO, end: self.blocks[volume] }, &bricks)
    }

    /// Whether a block may have extinction.
    pub(super) fn is_occupied(&self, volume: usize, block: UVec3) -> bool {
        if self.occupied.is_empty() {
            let has = |b: &VolumeBrick| {
                b.volume == volume
                    && b.brick.contains(block)
                    && b.occupied.is_none_or(|occupied| occupied.has(b.brick, block))
            };
            return self.all.iter().any(has);
        }
        let blocks = self.blocks[volume];
        self.occupied[volume][((block.z * blocks.y + block.y) * blocks.x + block.x) as usize]
    }

    /// The brick whose holder has the blocks of all volumes in `here`; checks `likely` first.
    pub(super) fn find(&self, here: &[(usize, UVec3)], likely: Option<usize>) -> Option<usize> {
        let (volume, block) = *here.iter().min_by_key(|(v, _)| self.finer[*v])?;
        let has = |p: &VolumeBrick| p.volume == volume && p.brick.contains(block);
        likely.filter(|p| has(&self.all[*p])).or_else(|| self.all.iter().position(has))
    }

    /// The rank that `rank` asks about a brick: itself if it holds it, otherwise a holder chosen to
    /// spread requests.
    pub(super) fn holder(&self, volume_brick: usize, rank: usize) -> usize {
        let holders = &self.all[volume_brick].holders;
        match holders.iter().find(|h| usize::from(**h) == rank) {
            Some(_) => rank,
            None => usize::from(holders[rank % holders.len()]),
        }
    }

    /// The data that `rank` holds, by brick number.
    pub(super) fn brick_data(&self, scene: &Scene, rank: usize) -> Vec<Option<BrickData>> {
        let holds = |p: &VolumeBrick| {
            p.holders.iter().any(|h| usize::from(*h) == rank) && !p.brick.is_empty()
        };
        self.all.iter().map(|p| holds(p).then(|| BrickData::new(scene, &self.finer, p))).collect()
    }
}

/// Checks `holders` and converts them to the stored form.
///
/// # Errors
/// [`FrameError::Holders`] for invalid lists.
pub(super) fn checked(
    scene: &Scene,
    volume: usize,
    holders: &[Vec<usize>],
    ranks: usize,
) -> Result<Vec<Vec<u16>>, FrameError> {
    let fault = |reason: String| Err(FrameError::Holders { volume, reason });
    let Some(placed) = scene.volumes.get(volume) else {
        return fault(format!("the scene has {} volumes", scene.volumes.len()));
    };
    if !placed.volume.is_medium() {
        return fault(
            "it is a projection, which sees the whole volume: every rank holds it".into(),
        );
    }
    if holders.is_empty() {
        return fault("no brick has a holder".into());
    }
    for (brick, list) in holders.iter().enumerate() {
        if list.is_empty() {
            return fault(format!("brick {brick} has no holder"));
        }
        if let Some(rank) = list.iter().find(|r| **r >= ranks) {
            return fault(format!(
                "rank {rank} is to hold brick {brick}, but there are {ranks} ranks"
            ));
        }
        if let Some(rank) =
            list.iter().enumerate().find(|(i, r)| list[..*i].contains(r)).map(|(_, r)| r)
        {
            return fault(format!("rank {rank} is to hold brick {brick} twice"));
        }
    }
    Ok(holders.iter().map(|list| list.iter().map(|r| *r as u16).collect()).collect())
}

/// What a rank holds for one brick: its blocks, and what coarser volumes have there.
#[derive(Clone)]
pub(super) struct BrickData {
    /// By volume.
    parts: Vec<Option<(Brick, Arc<Volume>)>>,
}

impl BrickData {
    fn new(scene: &Scene, finer: &[usize], volume_brick: &VolumeBrick) -> BrickData {
        let mut data = BrickData::empty(scene.volumes.len());
        for (v, brick) in blocks_needed(scene, finer, volume_brick) {
            data.set(v, brick, scene.volumes[v].volume.part(brick));
        }
        data
    }

    /// Nothing of any of `volumes` volumes.
    pub(super) fn empty(volumes: usize) -> BrickData {
        BrickData { parts: vec![None; volumes] }
    }

    /// Sets the part of a volume.
    pub(super) fn set(&mut self, volume: usize, brick: Brick, part: Volume) {
        self.parts[volume] = Some((brick, Arc::new(part)));
    }

    /// The part of a volume in this data.
    pub(super) fn volume(&self, volume: usize) -> Option<&Volume> {
        self.parts[volume].as_ref().map(|(_, part)| &**part)
    }

    pub(super) fn has(&self, volume: usize, block: UVec3) -> bool {
        self.parts[volume].as_ref().is_some_and(|(brick, _)| brick.contains(block))
    }

    /// Number of grid values in this data.
    pub(super) fn num_values(&self) -> usize {
        self.parts.iter().flatten().map(|(_, part)| part.grid().values().len()).sum()
    }
}

/// What the holder of a brick needs, by volume.
fn blocks_needed(
    scene: &Scene,
    finer: &[usize],
    volume_brick: &VolumeBrick,
) -> Vec<(usize, Brick)> {
    let here = &scene.volumes[volume_brick.volume];
    let [lo, hi] = corners(&here.volume, volume_brick.brick);
    let mut needed = vec![(volume_brick.volume, volume_brick.brick)];
    for (v, other) in scene.volumes.iter().enumerate() {
        if !other.volume.is_medium() || finer[v] <= finer[volume_brick.volume] {
            continue;
        }
        let there = world_from_object(other).inverse() * world_from_object(here);
        let brick = blocks_around(&other.volume, there, lo, hi);
        if !brick.is_empty() {
            needed.push((v, brick));
        }
    }
    needed
}

/// A block of `whole` that is in none of `bricks`.
pub(super) fn first_outside(whole: Brick, bricks: &[Brick]) -> Option<UVec3> {
    if whole.is_empty() {
        return None;
    }
    let shares = |b: &Brick| b.first.cmplt(whole.end).all() && whole.first.cmplt(b.end).all();
    let Some(k) = bricks.iter().position(|b| !b.is_empty() && shares(b)) else {
        return Some(whole.first);
    };
    // What is left around the shared box, side by side: later bricks cover it, or nothing does.
    let (b, mut left) = (bricks[k], whole);
    for axis in 0..3 {
        let (mut below, mut above) = (left, left);
        below.end[axis] = b.first[axis].clamp(left.first[axis], left.end[axis]);
        above.first[axis] = b.end[axis].clamp(left.first[axis], left.end[axis]);
        (left.first[axis], left.end[axis]) = (below.end[axis], above.first[axis]);
        let outside = [below, above].into_iter().find_map(|b| first_outside(b, &bricks[k + 1..]));
        if outside.is_some() {
            return outside;
        }
    }
    None
}

/// Transform from the space relative to the volume's origin.
fn world_from_object(placed: &VolumeInstance) -> DAffine3 {
    placed.world_from_object * DAffine3::from_translation(placed.volume.origin())
}

/// Start of cell 0: half a spacing before the first point where cells are boxes around points.
fn first_cell(volume: &Volume) -> DVec3 {
    if volume.has_cells_around_points() { -0.5 * volume.grid().spacing() } else { DVec3::ZERO }
}

/// Corners of a brick, in the space relative to the volume's origin.
fn corners(volume: &Volume, brick: Brick) -> [DVec3; 2] {
    let at = |block: UVec3| {
        first_cell(volume) + (block * MACROCELL).as_dvec3() * volume.grid().spacing()
    };
    [at(brick.first), at(brick.end)]
}

/// The bounding box of a box's eight corners after a transform.
fn moved(there: DAffine3, lo: DVec3, hi: DVec3) -> [DVec3; 2] {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for i in 0..8 {
        let pick = |a: usize| if i >> a & 1 == 0 { lo[a] } else { hi[a] };
        let corner = there.transform_point3(DVec3::new(pick(0), pick(1), pick(2)));
        (low, high) = (low.min(corner), high.max(corner));
    }
    [low, high]
}

/// Blocks of `volume` that a box overlaps or nearly overlaps, by one cell: rays are rounded when
/// they enter another volume's space.
fn blocks_around(volume: &Volume, there: DAffine3, lo: DVec3, hi: DVec3) -> Brick {
    let [low, high] = moved(there, lo, hi);
    let cell = |p: DVec3| (p - first_cell(volume)) / volume.grid().spacing();
    let size = f64::from(MACROCELL);
    let first = ((cell(low) - 1.0) / size).floor().max(DVec3::ZERO).as_uvec3();
    let end = ((cell(high) + 1.0) / size).ceil().max(DVec3::ZERO).as_uvec3().min(volume.blocks());
    Brick { first: first.min(end), end }
}

/// By volume, how many have smaller cells in world space; of equal ones, the first in the scene
/// counts as finer.
fn finer(scene: &Scene) -> Vec<usize> {
    let cell = |placed: &VolumeInstance| {
        let size = DMat3::from_diagonal(placed.volume.grid().spacing());
        (placed.world_from_object.matrix3 * size).determinant().abs()
    };
    let cells: Vec<f64> = scene.volumes.iter().map(cell).collect();
    let before = |a: usize, b: usize| cells[a].total_cmp(&cells[b]).then(a.cmp(&b)).is_lt();
    (0..cells.len()).map(|v| (0..cells.len()).filter(|other| before(*other, v)).count()).collect()
}

/// Whether a block of a volume is completely inside a finer medium, so that it is never the finest.
fn covered_by(scene: &Scene, finer: &[usize], volume: usize) -> impl Fn(UVec3) -> bool {
    let here = &scene.volumes[volume];
    let others: Vec<(&VolumeInstance, DAffine3)> = scene
        .volumes
        .iter()
        .zip(finer)
        .filter(|(placed, finer_than_it)| {
            let options = placed.volume.options();
            let is_whole = options.clip_planes.is_empty() && options.cropping.is_none();
            placed.volume.is_medium() && is_whole && **finer_than_it < finer[volume]
        })
        .map(|(placed, _)| (placed, world_from_object(placed).inverse() * world_from_object(here)))
        .collect();
    move |block| {
        let [lo, hi] = corners(&here.volume, Brick { first: block, end: block + 1 });
        // With a margin of at least one cell of each: rays are rounded.
        let margin = here.volume.grid().spacing();
        others.iter().any(|(placed, there)| {
            let [low, high] = moved(*there, lo - margin, hi + margin);
            let (bounds, spacing) = (placed.volume.bounds(), placed.volume.grid().spacing());
            low.cmpgt(bounds.min.as_dvec3() + spacing).all()
                && high.cmplt(bounds.max.as_dvec3() - spacing).all()
        })
    }
}

/// Blocks of a brick, x fastest.
fn blocks_of(brick: Brick) -> impl Iterator<Item = UVec3> {
    let Brick { first, end } = brick;
    (first.z..end.z).flat_map(move |z| {
        (first.y..end.y).flat_map(move |y| (first.x..end.x).map(move |x| UVec3::new(x, y, z)))
    })
}

/// Cuts a volume into `count` bricks with about the same number of blocks that have extinction and
/// are not `covered`, and omits covered blocks at their sides.
fn bricks(volume: &Volume, count: usize, covered: &impl Fn(UVec3) -> bool) -> Vec<Brick> {
    let mut out = Vec::with_capacity(count);
    let all = Brick { first: UVec3::ZERO, end: volume.blocks() };
    let work = |block| if volume.is_occupied(block) && !covered(block) { 1.0 } else { CLEAR_WORK };
    halve(all, count, &work, &mut out);
    for brick in &mut out {
        let (mut first, mut end) = (UVec3::MAX, UVec3::ZERO);
        for block in blocks_of(*brick).filter(|b| !covered(*b)) {
            (first, end) = (first.min(block), end.max(block + 1));
        }
        *brick = Brick { first: first.min(end), end };
    }
    out
}

fn halve(brick: Brick, count: usize, work: &impl Fn(UVec3) -> f64, out: &mut Vec<Brick>) {
    if count == 1 {
        out.push(brick);
        return;
    }
    let size = brick.end.saturating_sub(brick.first).to_array();
    let axis = (0..3).max_by_key(|&a| size[a]).unwrap_or(0);
    // ---- Work of each layer of blocks across the axis.
    let layer_work = |at: u32| {
        let (mut first, mut end) = (brick.first, brick.end);
        (first[axis], end[axis]) = (at, at + 1);
        blocks_of(Brick { first, end }).map(work).sum()
    };
    let layers: Vec<f64> = (brick.first[axis]..brick.end[axis]).map(layer_work).collect();
    let lower = count / 2;
    let share = layers.iter().sum::<f64>() * lower as f64 / count as f64;
    let mut done = 0.0;
    let below = layers.iter().take_while(|&&work| {
        done += work;
        done - 0.5 * work < share
    });
    let cut = brick.first[axis] + below.count() as u32;
    let (mut near, mut far) = (brick, brick);
    (near.end[axis], far.first[axis]) = (cut, cut);
    halve(near, lower, work, out);
    halve(far, count - lower, work, out);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn brick(first: [u32; 3], end: [u32; 3]) -> Brick {
        Brick { first: UVec3::from_array(first), end: UVec3::from_array(end) }
    }

    #[test]
    fn a_hole_between_bricks_is_found_wherever_it_is() {
        let whole = brick([0; 3], [4; 3]);
        let mut cells: Vec<Brick> =
            blocks_of(whole).map(|first| Brick { first, end: first + 1 }).collect();
        cells.extend([brick([0; 3], [2; 3]), Brick::EMPTY]);
        assert_eq!(first_outside(whole, &cells), None);
        for k in 0..64 {
            let others = (0..64).filter(|i| *i != k);
            let left: Vec<Brick> = others.map(|i| cells[i]).collect();
            assert_eq!(first_outside(whole, &left), Some(cells[k].first));
        }
        assert_eq!(first_outside(whole, &[]), Some(UVec3::ZERO));
    }

    #[test]
    fn parts_of_a_brick_of_any_size_have_their_own_bits() {
        let brick = brick([3, 0, 9], [20, 1, 12]);
        let places: Vec<_> = blocks_of(brick).map(|b| CoarseOccupancy::place(brick, b)).collect();
        assert!(places.iter().all(|(word, _)| *word < CoarseOccupancy::WORDS));
        let first = blocks_of(brick).next().unwrap();
        assert_eq!(CoarseOccupancy::place(brick, first), (0, 0));
        let mut some = CoarseOccupancy([0; CoarseOccupancy::WORDS]);
        some.0[0] = 1;
        assert!(some.has(brick, first) && !some.has(brick, UVec3::new(19, 0, 11)));
    }
}
