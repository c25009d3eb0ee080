//! The two questions that ranks ask each other about rays: what a ray hits first, and what a light
//! ray hits where light passes through surfaces.
use super::rank_frame::RankFrame;
use super::tile_hits::is_before;
use super::wire_format::{HIT_WORDS, decode_hit, decode_light_hit, encode_hit, encode_light_hit};
use rt_core::deferred::{LightHit, ShadingHit};
use rt_core::ray::Ray;

/// The answer of one part to one ray that hits something.
pub(super) trait RayAnswer: Copy {
    /// Traces rays against this rank's part; primitives have their numbers in the whole scene. With
    /// `pixels` (tile and slot of each ray), hits have depth and distance.
    fn trace(
        side: &RankFrame<'_>,
        rays: &[Ray],
        pixels: Option<&[(u32, u16)]>,
    ) -> Vec<Option<Self>>;

    /// Whether this answer counts instead of another part's.
    fn is_before(&self, other: &Self) -> bool;

    fn encode(&self) -> [u32; HIT_WORDS];

    fn decode(words: &[u32; HIT_WORDS]) -> Self;
}

fn in_whole_scene(side: &RankFrame<'_>, hit: &mut ShadingHit) {
    hit.primitive = side.global_primitive(hit.instance, hit.primitive);
}

impl RayAnswer for ShadingHit {
    fn trace(
        side: &RankFrame<'_>,
        rays: &[Ray],
        pixels: Option<&[(u32, u16)]>,
    ) -> Vec<Option<ShadingHit>> {
        let mut hits = Vec::new();
        side.frame.closest(rays, pixels, &mut hits);
        hits.iter_mut().flatten().for_each(|hit| in_whole_scene(side, hit));
        hits
    }

    fn is_before(&self, other: &ShadingHit) -> bool {
        let key = |hit: &ShadingHit| (hit.t, hit.instance, hit.primitive);
        is_before(key(self), key(other))
    }

    fn encode(&self) -> [u32; HIT_WORDS] {
        encode_hit(self)
    }

    fn decode(words: &[u32; HIT_WORDS]) -> ShadingHit {
        decode_hit(words)
    }
}

impl RayAnswer for LightHit {
    fn trace(
        side: &RankFrame<'_>,
        rays: &[Ray],
        _pixels: Option<&[(u32, u16)]>,
    ) -> Vec<Option<LightHit>> {
        let mut hits = Vec::new();
        side.frame.light_hits(rays, &mut hits);
        for hit in hits.iter_mut().flatten() {
            if let LightHit::Surface(hit) = hit {
                in_whole_scene(side, hit);
            }
        }
        hits
    }

    fn is_before(&self, other: &LightHit) -> bool {
        match (self, other) {
            (_, LightHit::Blocked) => false,
            (LightHit::Blocked, LightHit::Surface(_)) => true,
            (LightHit::Surface(hit), LightHit::Surface(other)) => RayAnswer::is_before(hit, other),
        }
    }

    fn encode(&self) -> [u32; HIT_WORDS] {
        encode_light_hit(self)
    }

    fn decode(words: &[u32; HIT_WORDS]) -> LightHit {
        decode_light_hit(words)
    }
}
