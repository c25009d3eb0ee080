//! Pixel formats and the operators that composite two pixels.
//!
//! A format is a colour ([`Color`]) with or without depth; [`PixelFormat`] is its storage and wire
//! form, [`Composite`] its operator. An *inactive* pixel is the identity of every operator **by
//! definition** ([`combine`]), so leaving it out of a message never changes a bit of the result.
use crate::color::Color;
use half::f16;
use std::fmt::Debug;

/// How a pixel is stored and sent: a colour plane, and for some formats a depth plane of `f32`.
pub trait PixelFormat: Copy + PartialEq + Debug + Send + Sync + 'static {
    /// The colour part.
    type Color: Color;
    /// Name in error messages.
    const NAME: &'static str;
    /// Number in message headers. It differs between formats, so that ranks that disagree notice.
    const CODE: u32;
    /// Bytes of one pixel in a message.
    const BYTES: usize = <Self::Color as Color>::BYTES + if Self::HAS_DEPTH { 4 } else { 0 };
    /// Whether frames of this format have a depth slice, and the nearest pixel wins.
    const HAS_DEPTH: bool;
    /// The pixel where no rank drew anything.
    const EMPTY: Self;
    /// Builds a pixel; formats without depth ignore `depth`.
    fn from_parts(color: Self::Color, depth: f32) -> Self;
    /// The colour part.
    fn color(&self) -> Self::Color;
    /// Depth in 0 (near) … 1 (far); 1 for formats without depth.
    fn depth(&self) -> f32;
}

/// The operator that merges the pixels of two groups of ranks.
pub trait Composite: PixelFormat {
    /// Whether something was drawn here.
    fn is_active(&self) -> bool;
    /// Merges two *active* pixels. Every rank of `lower` comes before every rank of `higher` in the
    /// order of compositing. Need not be associative: [`crate::rank_order`] fixes the grouping.
    fn merge(lower: Self, higher: Self) -> Self;
}

/// [`Composite::merge`] with inactive pixels as identities; two inactive pixels give
/// [`PixelFormat::EMPTY`].
#[inline(always)]
pub fn combine<P: Composite>(lower: P, higher: P) -> P {
    match (lower.is_active(), higher.is_active()) {
        (true, true) => P::merge(lower, higher),
        (true, false) => lower,
        (false, true) => higher,
        (false, false) => P::EMPTY,
    }
}

/// Opaque colour with depth; the nearest one wins.
///
/// Active iff `depth < 1`: NaN, +infinity and 1 are background, negative depths and -infinity are
/// nearest of all, as in IceT. Equal depths (`0.0` and `-0.0` too) go to the **highest rank**, the
/// rule of IceT's single-image strategies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthPixel<C> {
    /// Colour, not premultiplied by anything.
    pub color: C,
    /// Depth in 0 (near) … 1 (background).
    pub depth: f32,
}

/// Premultiplied colour; lower ranks are in front of higher ranks.
///
/// Active iff any bit is set, so pure emission (alpha 0, colour above 0) counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PremultipliedPixel<C> {
    /// Colour, already multiplied by its alpha.
    pub color: C,
}

macro_rules! formats {
    ($($color:ty, $depth_name:literal $depth_code:literal, $blend_name:literal $blend_code:literal;)*) => {$(
        impl PixelFormat for DepthPixel<$color> {
            type Color = $color;
            const NAME: &'static str = $depth_name;
            const CODE: u32 = $depth_code;
            const HAS_DEPTH: bool = true;
            const EMPTY: Self = Self { color: <$color as Color>::TRANSPARENT, depth: 1.0 };

            #[inline(always)]
            fn from_parts(color: $color, depth: f32) -> Self {
                Self { color, depth }
            }

            #[inline(always)]
            fn color(&self) -> $color {
                self.color
            }

            #[inline(always)]
            fn depth(&self) -> f32 {
                self.depth
            }
        }

        impl PixelFormat for PremultipliedPixel<$color> {
            type Color = $color;
            const NAME: &'static str = $blend_name;
            const CODE: u32 = $blend_code;
            const HAS_DEPTH: bool = false;
            const EMPTY: Self = Self { color: <$color as Color>::TRANSPARENT };

            #[inline(always)]
            fn from_parts(color: $color, _depth: f32) -> Self {
                Self { color }
            }

            #[inline(always)]
            fn color(&self) -> $color {
                self.color
            }

            #[inline(always)]
            fn depth(&self) -> f32 {
                1.0
            }
        }
    )*};
}

formats! {
    [u8; 4], "RGBA8 + depth" 1, "premultiplied RGBA8" 2;
    [f32; 4], "RGBA f32 + depth" 3, "premultiplied RGBA f32" 4;
    [u16; 4], "RGBA16 + depth" 5, "premultiplied RGBA16" 6;
    [f16; 4], "RGBA f16 + depth" 7, "premultiplied RGBA f16" 8;
}

impl<C: Color> Composite for DepthPixel<C>
where
    Self: PixelFormat,
{
    #[inline(always)]
    fn is_active(&self) -> bool {
        self.depth < 1.0
    }

    #[inline(always)]
    fn merge(lower: Self, higher: Self) -> Self {
        if lower.depth < higher.depth { lower } else { higher }
    }
}

impl<C: Color> Composite for PremultipliedPixel<C>
where
    Self: PixelFormat,
{
    #[inline(always)]
    fn is_active(&self) -> bool {
        !self.color.is_zero()
    }

    #[inline(always)]
    fn merge(lower: Self, higher: Self) -> Self {
        Self { color: C::over(lower.color, higher.color) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(depth: f32, value: u8) -> DepthPixel<[u8; 4]> {
        DepthPixel { color: [value; 4], depth }
    }

    #[test]
    fn equal_depths_go_to_the_highest_rank() {
        assert_eq!(combine(at(0.5, 1), at(0.5, 2)).color, [2; 4]);
        assert_eq!(combine(at(-0.0, 1), at(0.0, 2)).color, [2; 4]);
        assert_eq!(combine(at(0.0, 1), at(-0.0, 2)).color, [2; 4]);
        assert_eq!(combine(at(0.4, 1), at(0.5, 2)).color, [1; 4]);
    }

    #[test]
    fn nan_infinite_and_far_depths_are_background_and_negative_ones_are_nearest() {
        for background in [f32::NAN, -f32::NAN, f32::INFINITY, 1.0, 2.0] {
            assert_eq!(combine(at(background, 1), at(0.9, 2)).color, [2; 4]);
            assert_eq!(combine(at(0.9, 2), at(background, 1)).color, [2; 4]);
            assert_eq!(combine(at(background, 1), at(background, 1)), DepthPixel::EMPTY);
        }
        assert_eq!(combine(at(f32::NEG_INFINITY, 1), at(-1.0, 2)).color, [1; 4]);
        assert_eq!(combine(at(f32::from_bits(1), 1), at(0.0, 2)).color, [2; 4]);
    }

    #[test]
    fn inactive_pixels_change_no_bit_even_where_arithmetic_would() {
        let infinite = PremultipliedPixel { color: [f32::INFINITY, -0.0, 0.0, 1.0] };
        for merged in [
            combine(infinite, PremultipliedPixel::EMPTY),
            combine(PremultipliedPixel::EMPTY, infinite),
        ] {
            assert_eq!(merged.color.map(f32::to_bits), infinite.color.map(f32::to_bits));
        }
    }

    #[test]
    fn sizes_of_pixels_are_those_of_their_planes() {
        assert_eq!(DepthPixel::<[u8; 4]>::BYTES, 8);
        assert_eq!(PremultipliedPixel::<[u8; 4]>::BYTES, 4);
        assert_eq!(DepthPixel::<[f16; 4]>::BYTES, 12);
        assert_eq!(PremultipliedPixel::<[f32; 4]>::BYTES, 16);
    }
}
