//! The filters of a texture, and the choice among its mipmap levels as llvmpipe makes it.

/// How mipmap levels are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Mip {
    /// Only the base level.
    None,
    /// The nearest level.
    Nearest,
    /// Two levels, blended.
    Linear,
}

/// The filters of a texture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Filters {
    pub(crate) mag_linear: bool,
    pub(crate) min_linear: bool,
    pub(crate) mip: Mip,
    /// The bias that is added to the level of detail.
    pub(crate) bias: f32,
    /// The limits of the level of detail.
    pub(crate) lod: [f32; 2],
}

crate::cluster::codec::wire_enum!(Mip { None, Nearest, Linear });
crate::cluster::codec::wire_struct!(Filters { mag_linear, min_linear, mip, bias, lod });

/// The driver's limit for levels of detail that it does not look at.
const DEEPEST: f32 = 14.0;

/// The logarithm as llvmpipe computes it: of the square, interpolated linearly between powers of
/// two. It is up to 0.043 too small.
fn log2(rho: f32) -> f32 {
    let square = rho * rho;
    let whole = square.log2().floor();
    0.5 * (whole + square / whole.exp2() - 1.0)
}

impl Filters {
    /// None at all.
    pub(super) const NEAREST: Filters =
        Filters { mag_linear: false, min_linear: false, mip: Mip::None, bias: 0.0, lod: [0.0; 2] };

    /// The effect of a footprint of `rho` texels: whether the texture is minified, the level, and
    /// the share of the level after it.
    pub(super) fn choose(&self, rho: f32, last: usize) -> (bool, usize, f32) {
        let [least, most] = [self.lod[0].max(0.0), self.lod[1]];
        let plain = self.bias == 0.0 && least == 0.0 && most >= DEEPEST;
        // As the driver adjusts it, and only where an adjustment applies.
        let lod = (log2(rho) + self.bias).max(least).min(most.max(least));
        let smaller = if plain { rho > 1.0 } else { lod > 0.0 };
        let level = match self.mip {
            Mip::None => 0.0,
            Mip::Nearest if plain => (rho * std::f32::consts::SQRT_2).log2().floor(),
            Mip::Nearest => (lod + 0.5).floor(),
            Mip::Linear => lod.floor(),
        };
        let share = if self.mip == Mip::Linear { lod - level } else { 0.0 };
        // A footprint that is not a number also ends here.
        let inside = level >= 0.0;
        match level as usize {
            _ if !inside => (smaller, 0, 0.0),
            n if n >= last => (smaller, last, 0.0),
            n => (smaller, n, share.clamp(0.0, 1.0)),
        }
    }
}
