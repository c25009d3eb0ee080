//! What blocks of rays have found so far, and the masks that say which of them go on.

use crate::bvh::query::HitQuery;
use crate::ray::{HitBlock, LANES, NO_HIT, RayBlock};

/// The distances up to which rays with these hits have to search.
#[inline(always)]
pub(crate) fn limits_of<Q: HitQuery>(rays: &RayBlock, hits: &HitBlock) -> [f32; LANES] {
    std::array::from_fn(|lane| {
        let found = hits.prim[lane] != NO_HIT;
        // One ulp past the best: a tie may go to an instance with a lower number. Blocked shadow
        // rays are finished.
        let limit = if Q::ANY { -1.0 } else { hits.t[lane].next_up().min(rays.t_max[lane]) };
        if found { limit } else { rays.t_max[lane] }
    })
}

/// The numbers of the lanes, or of the groups of a packet, in a mask.
#[inline(always)]
pub(crate) fn set_bits(mut mask: u16) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        (mask != 0).then(|| {
            let bit = mask.trailing_zeros() as usize & 15;
            mask &= mask - 1;
            bit
        })
    })
}
