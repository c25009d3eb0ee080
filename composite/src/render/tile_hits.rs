//! Hits of the camera rays in a tile.
use rt_core::deferred::{ShadingHit, TILE_SIDE};

/// Slots of a tile.
pub(super) const SLOTS: usize = (TILE_SIDE * TILE_SIDE) as usize;

/// Whether a hit, given by its parameter, instance and primitive, is ordered before another one of
/// the same ray: nearer, or at the same parameter with lower numbers.
pub(super) fn is_before(a: (f32, u32, u32), b: (f32, u32, u32)) -> bool {
    a.0 < b.0 || (a.0 == b.0 && (a.1, a.2) < (b.1, b.2))
}

/// The nearest hit of a pixel so far.
#[derive(Clone, Copy)]
pub(super) struct Nearest {
    pub(super) t: f32,
    pub(super) instance: u32,
    pub(super) primitive: u32,
    pub(super) rank: u32,
    pub(super) color: [f32; 4],
}

impl Nearest {
    pub(super) const NOTHING: Nearest = Nearest {
        t: f32::INFINITY,
        instance: u32::MAX,
        primitive: u32::MAX,
        rank: u32::MAX,
        color: [0.0; 4],
    };

    pub(super) fn is_before(&self, other: &Nearest) -> bool {
        let key = |n: &Nearest| (n.t, n.instance, n.primitive);
        // Empty slots have infinite t and the highest numbers, so every hit comes before them.
        is_before(key(self), key(other))
    }
}

/// The hits of the camera rays of one owned tile.
pub(super) struct TileHits {
    pub(super) nearest: Vec<Nearest>,
    /// Details of the hits, where they were requested.
    pub(super) hits: Vec<Option<ShadingHit>>,
}

impl TileHits {
    pub(super) fn new() -> TileHits {
        TileHits { nearest: vec![Nearest::NOTHING; SLOTS], hits: Vec::new() }
    }

    /// Colours of the nearest hits.
    pub(super) fn colors(&self) -> Vec<Option<[f32; 4]>> {
        self.nearest.iter().map(|n| (n.rank != u32::MAX).then_some(n.color)).collect()
    }

    /// The rank whose hit is the nearest in a slot; `u32::MAX` for none.
    pub(super) fn winner(&self, slot: usize) -> u32 {
        self.nearest[slot].rank
    }
}
