//! Pixel formats and what it means to composite two pixels.
//!
//! A format is a colour ([`Color`]) with or without depth; [`PixelFormat`] is its storage and wire form, [`Composite`] its
//! operator. An *inactive* pixel is the identity of every operator **by definition** ([`combine`]), so leaving it out of a
//! message never changes a bit of the result.
use std::fmt::Debug;

/// Four colour channels, red, green, blue, alpha.
pub trait Color: Copy + PartialEq + Debug + Send + Sync + 'static {
    /// Bytes of one colour in a message.
    const BYTES: usize;
    /// All channels zero.
    const TRANSPARENT: Self;
    /// Whether every bit is zero (so that `-0.0` counts as something that was drawn).
    fn is_zero(&self) -> bool;
    /// Porter and Duff's `front over back` for premultiplied colours (SIGGRAPH 1984, table of section 4.2).
    fn over(front: Self, back: Self) -> Self;
    /// Appends [`Self::BYTES`] little-endian bytes.
    fn write(self, out: &mut Vec<u8>);
    /// Reads what [`Self::write`] wrote; `bytes` holds exactly [`Self::BYTES`] bytes.
    fn read(bytes: &[u8]) -> Self;
}

/// RGBA8. Blending rounds to nearest (IceT truncates, which loses faint layers); for many faint layers use `[f32; 4]`.
impl Color for [u8; 4] {
    const BYTES: usize = 4;
    const TRANSPARENT: Self = [0; 4];

    fn is_zero(&self) -> bool {
        *self == [0; 4]
    }

    fn over(front: Self, back: Self) -> Self {
        let see_through = 255 - u32::from(front[3]);
        std::array::from_fn(|i| {
            let behind = (u32::from(back[i]) * see_through + 127) / 255;
            front[i].saturating_add(behind as u8)
        })
    }

    fn write(self, out: &mut Vec<u8>) {
        out.extend_from_slice(&self);
    }

    fn read(bytes: &[u8]) -> Self {
        std::array::from_fn(|i| bytes[i])
    }
}

impl Color for [f32; 4] {
    const BYTES: usize = 16;
    const TRANSPARENT: Self = [0.0; 4];

    fn is_zero(&self) -> bool {
        self.iter().all(|channel| channel.to_bits() == 0)
    }

    fn over(front: Self, back: Self) -> Self {
        let see_through = 1.0 - front[3];
        std::array::from_fn(|i| front[i] + see_through * back[i])
    }

    fn write(self, out: &mut Vec<u8>) {
        for channel in self {
            out.extend_from_slice(&channel.to_le_bytes());
        }
    }

    fn read(bytes: &[u8]) -> Self {
        std::array::from_fn(|i| read_f32(&bytes[4 * i..]))
    }
}

fn read_f32(bytes: &[u8]) -> f32 {
    f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
}

/// How a pixel is stored and sent.
pub trait PixelFormat: Copy + PartialEq + Debug + Send + Sync + 'static {
    /// The colour part.
    type Color: Color;
    /// Name in error messages.
    const NAME: &'static str;
    /// Number in message headers; differs between formats, so that ranks that disagree find out.
    const CODE: u32;
    /// Bytes of one pixel in a message.
    const BYTES: usize;
    /// Whether frames of this format bring a depth slice.
    const HAS_DEPTH: bool;
    /// The pixel where no rank drew anything.
    const EMPTY: Self;
    /// Builds a pixel; formats without depth ignore `depth`.
    fn from_parts(color: Self::Color, depth: f32) -> Self;
    /// The colour part.
    fn color(&self) -> Self::Color;
    /// Depth in 0 (near) … 1 (far); 1 for formats without depth.
    fn depth(&self) -> f32;
    /// Appends [`Self::BYTES`] bytes.
    fn write(self, out: &mut Vec<u8>);
    /// Reads what [`Self::write`] wrote; `bytes` holds exactly [`Self::BYTES`] bytes.
    fn read(bytes: &[u8]) -> Self;
}

/// The operator that joins the pixels of two groups of ranks.
pub trait Composite: PixelFormat {
    /// Whether something was drawn here.
    fn is_active(&self) -> bool;
    /// Joins two *active* pixels; every rank behind `lower` comes before every rank behind `higher`. Need not be
    /// associative: [`crate::rank_order`] fixes the grouping.
    fn merge(lower: Self, higher: Self) -> Self;
}

/// [`Composite::merge`] with inactive pixels as identities; two inactive pixels give [`PixelFormat::EMPTY`].
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
/// Active iff `depth < 1`: NaN, +infinity and 1 are background, negative depths and -infinity are nearest of all, as in IceT.
/// Equal depths (`0.0` and `-0.0` too) go to the **highest rank**, the rule of IceT's single-image strategies.
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
            const BYTES: usize = <$color as Color>::BYTES + 4;
            const HAS_DEPTH: bool = true;
            const EMPTY: Self = Self { color: <$color as Color>::TRANSPARENT, depth: 1.0 };

            fn from_parts(color: $color, depth: f32) -> Self {
                Self { color, depth }
            }

            fn color(&self) -> $color {
                self.color
            }

            fn depth(&self) -> f32 {
                self.depth
            }

            fn write(self, out: &mut Vec<u8>) {
                self.color.write(out);
                out.extend_from_slice(&self.depth.to_le_bytes());
            }

            fn read(bytes: &[u8]) -> Self {
                let (color, depth) = bytes.split_at(<$color as Color>::BYTES);
                Self { color: Color::read(color), depth: read_f32(depth) }
            }
        }

        impl PixelFormat for PremultipliedPixel<$color> {
            type Color = $color;
            const NAME: &'static str = $blend_name;
            const CODE: u32 = $blend_code;
            const BYTES: usize = <$color as Color>::BYTES;
            const HAS_DEPTH: bool = false;
            const EMPTY: Self = Self { color: <$color as Color>::TRANSPARENT };

            fn from_parts(color: $color, _depth: f32) -> Self {
                Self { color }
            }

            fn color(&self) -> $color {
                self.color
            }

            fn depth(&self) -> f32 {
                1.0
            }

            fn write(self, out: &mut Vec<u8>) {
                self.color.write(out);
            }

            fn read(bytes: &[u8]) -> Self {
                Self { color: Color::read(bytes) }
            }
        }
    )*};
}

formats! {
    [u8; 4], "RGBA8 + depth" 1, "premultiplied RGBA8" 2;
    [f32; 4], "RGBA f32 + depth" 3, "premultiplied RGBA f32" 4;
}

impl<C: Color> Composite for DepthPixel<C>
where
    Self: PixelFormat,
{
    fn is_active(&self) -> bool {
        self.depth < 1.0
    }

    fn merge(lower: Self, higher: Self) -> Self {
        if lower.depth < higher.depth { lower } else { higher }
    }
}

impl<C: Color> Composite for PremultipliedPixel<C>
where
    Self: PixelFormat,
{
    fn is_active(&self) -> bool {
        !self.color.is_zero()
    }

    fn merge(lower: Self, higher: Self) -> Self {
        Self { color: C::over(lower.color, higher.color) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(depth: f32, mark: u8) -> DepthPixel<[u8; 4]> {
        DepthPixel { color: [mark; 4], depth }
    }

    #[test]
    fn equal_depths_go_to_the_highest_rank_and_minus_zero_is_zero() {
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
    fn eight_bit_over_rounds_to_nearest_and_saturates() {
        assert_eq!(<[u8; 4]>::over([10, 0, 0, 128], [255, 1, 2, 255]), [137, 0, 1, 255]);
        assert_eq!(<[u8; 4]>::over([250, 0, 0, 0], [250, 0, 0, 0]), [255, 0, 0, 0]);
        assert_eq!(<[u8; 4]>::over([7, 8, 9, 255], [255; 4]), [7, 8, 9, 255]);
    }

    #[test]
    fn inactive_pixels_change_no_bit_even_where_arithmetic_would() {
        let infinite = PremultipliedPixel { color: [f32::INFINITY, -0.0, 0.0, 1.0] };
        for joined in
            [combine(infinite, PremultipliedPixel::EMPTY), combine(PremultipliedPixel::EMPTY, infinite)]
        {
            assert_eq!(joined.color.map(f32::to_bits), infinite.color.map(f32::to_bits));
        }
    }

    #[test]
    fn pixels_survive_their_wire_form() {
        let pixel = DepthPixel { color: [1.0, -0.0, f32::MIN_POSITIVE, 0.25], depth: 0.125 };
        let mut bytes = Vec::new();
        pixel.write(&mut bytes);
        assert_eq!(bytes.len(), DepthPixel::<[f32; 4]>::BYTES);
        assert_eq!(DepthPixel::<[f32; 4]>::read(&bytes), pixel);
    }
}
