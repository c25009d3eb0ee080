//! Colours: four channels in 8 or 16 bits, half or single precision, and how one is composited over
//! another.
use crate::simd::runs;
use bytemuck::Pod;
use fearless_simd::Simd;
use half::f16;
use std::fmt::Debug;

/// Four colour channels, red, green, blue, alpha.
///
/// The methods on one colour are the reference; [`over_run`](Color::over_run) must give the same
/// bits for many.
pub trait Color: Copy + PartialEq + Debug + Send + Sync + Pod {
    /// Bytes of one colour, in memory and in a message.
    const BYTES: usize = size_of::<Self>();
    /// All channels zero.
    const TRANSPARENT: Self;
    /// Whether every bit is zero (so that `-0.0` counts as something that was drawn).
    fn is_zero(&self) -> bool;
    /// Porter and Duff's `front over back` for premultiplied colours (SIGGRAPH 1984, table of
    /// section 4.2).
    fn over(front: Self, back: Self) -> Self;
    /// The channels as floating-point numbers; a full channel is 1.
    fn to_f32(self) -> [f32; 4];
    /// The nearest colour of this format; integer formats are clamped to 0 … 1.
    fn from_f32(channels: [f32; 4]) -> Self;

    /// Composites `others` (raw colours, one for each of `held`) over or under `held`; colours with
    /// all bits zero change nothing.
    #[doc(hidden)]
    #[inline(always)]
    fn over_run<S: Simd>(_simd: S, others: &[u8], held: &mut [Self], others_in_front: bool) {
        runs::over_one_by_one(others, held, others_in_front);
    }
}

/// RGBA8. Blending rounds to nearest (IceT truncates, which loses faint layers). For many faint
/// layers use another format.
impl Color for [u8; 4] {
    const TRANSPARENT: Self = [0; 4];

    #[inline(always)]
    fn is_zero(&self) -> bool {
        u32::from_ne_bytes(*self) == 0
    }

    #[inline(always)]
    fn over(front: Self, back: Self) -> Self {
        let see_through = 255 - u32::from(front[3]);
        std::array::from_fn(|i| {
            let behind = (u32::from(back[i]) * see_through + 127) / 255;
            front[i].saturating_add(behind as u8)
        })
    }

    fn to_f32(self) -> [f32; 4] {
        self.map(|channel| f32::from(channel) / 255.0)
    }

    fn from_f32(channels: [f32; 4]) -> Self {
        channels.map(|channel| (channel.clamp(0.0, 1.0) * 255.0).round() as u8)
    }

    #[inline(always)]
    fn over_run<S: Simd>(simd: S, others: &[u8], held: &mut [Self], others_in_front: bool) {
        runs::over_rgba8(simd, others, held, others_in_front);
    }
}

/// 16 bits per channel, 65535 for 1, eight bytes per pixel. 128 faint layers have an error of
/// 0.13/255, and any 128 layers one below 1/255.
impl Color for [u16; 4] {
    const TRANSPARENT: Self = [0; 4];

    #[inline(always)]
    fn is_zero(&self) -> bool {
        *self == [0; 4]
    }

    #[inline(always)]
    fn over(front: Self, back: Self) -> Self {
        let see_through = 65535 - u32::from(front[3]);
        std::array::from_fn(|i| {
            let behind = (u32::from(back[i]) * see_through + 32767) / 65535;
            front[i].saturating_add(behind as u16)
        })
    }

    fn to_f32(self) -> [f32; 4] {
        self.map(|channel| f32::from(channel) / 65535.0)
    }

    fn from_f32(channels: [f32; 4]) -> Self {
        channels.map(|channel| (channel.clamp(0.0, 1.0) * 65535.0).round() as u16)
    }
}

/// Half precision: eight bytes per pixel with the range of floating point. Colours are composited
/// in single precision and rounded once.
impl Color for [f16; 4] {
    const TRANSPARENT: Self = [f16::ZERO; 4];

    #[inline(always)]
    fn is_zero(&self) -> bool {
        self.iter().all(|channel| channel.to_bits() == 0)
    }

    #[inline(always)]
    fn over(front: Self, back: Self) -> Self {
        let merged = <[f32; 4]>::over(front.map(f16::to_f32), back.map(f16::to_f32));
        merged.map(f16::from_f32)
    }

    fn to_f32(self) -> [f32; 4] {
        self.map(f16::to_f32)
    }

    fn from_f32(channels: [f32; 4]) -> Self {
        channels.map(f16::from_f32)
    }
}

/// Single precision.
impl Color for [f32; 4] {
    const TRANSPARENT: Self = [0.0; 4];

    #[inline(always)]
    fn is_zero(&self) -> bool {
        // One comparison of 128 bits instead of four.
        u128::from_ne_bytes(bytemuck::cast(*self)) == 0
    }

    #[inline(always)]
    fn over(front: Self, back: Self) -> Self {
        let see_through = 1.0 - front[3];
        std::array::from_fn(|i| front[i] + see_through * back[i])
    }

    fn to_f32(self) -> [f32; 4] {
        self
    }

    fn from_f32(channels: [f32; 4]) -> Self {
        channels
    }

    #[inline(always)]
    fn over_run<S: Simd>(simd: S, others: &[u8], held: &mut [Self], others_in_front: bool) {
        runs::over_f32(simd, others, held, others_in_front);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_bit_over_rounds_to_nearest_and_saturates() {
        assert_eq!(<[u8; 4]>::over([10, 0, 0, 128], [255, 1, 2, 255]), [137, 0, 1, 255]);
        assert_eq!(<[u8; 4]>::over([250, 0, 0, 0], [250, 0, 0, 0]), [255, 0, 0, 0]);
        assert_eq!(<[u8; 4]>::over([7, 8, 9, 255], [255; 4]), [7, 8, 9, 255]);
    }

    #[test]
    fn sixteen_bit_over_keeps_what_is_behind_nothing_and_hides_behind_opaque() {
        let color = [1, 2, 65535, 40000];
        assert_eq!(<[u16; 4]>::over([0; 4], color), color);
        assert_eq!(<[u16; 4]>::over([5, 6, 7, 65535], [65535; 4]), [5, 6, 7, 65535]);
        assert_eq!(<[u16; 4]>::over([65535, 0, 0, 0], [1, 0, 0, 0]), [65535, 0, 0, 0]);
    }

    #[test]
    fn numbers_come_back_from_every_format_to_its_precision() {
        fn back<C: Color>(tolerance: f32) {
            for value in [0.0, 0.1, 0.5, 0.999, 1.0] {
                let there = C::from_f32([value, 0.0, 1.0, value]).to_f32();
                assert!(
                    (there[0] - value).abs() <= tolerance && there[2] == 1.0,
                    "{value}: {there:?}"
                );
            }
        }
        back::<[u8; 4]>(0.5 / 255.0 + 1e-6);
        back::<[u16; 4]>(0.5 / 65535.0 + 1e-6);
        back::<[f16; 4]>(0.000_25);
        back::<[f32; 4]>(0.0);
    }
}
