//! Images on surfaces.

use crate::colormap::srgb_to_linear;
use glam::Vec2;

/// How texture coordinates outside 0..=1 are handled.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Wrap {
    /// Repeats the image (GL_REPEAT).
    #[default]
    Repeat,
    /// Uses the edge texel (GL_CLAMP_TO_EDGE).
    Clamp,
    /// Repeats the image mirrored (GL_MIRRORED_REPEAT).
    Mirror,
}

/// How texels are combined. There are no mipmaps: use several samples per pixel where a texture is
/// seen from afar.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Filter {
    /// The texel the point lies in.
    Nearest,
    /// Linear between the four nearest texel centres.
    #[default]
    Bilinear,
}

/// An image of linear RGBA texels.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    width: usize,
    height: usize,
    texels: Vec<[f32; 4]>,
    summary: TexelSummary,
    /// Wrap mode outside 0..=1, horizontal and vertical.
    pub wrap: [Wrap; 2],
    /// How texels are combined.
    pub filter: Filter,
}

/// Properties of the texels that every frame needs. Texels never change, so these are determined
/// once.
#[derive(Debug, Clone, Copy, PartialEq)]
struct TexelSummary {
    transparent: bool,
    black: bool,
    /// The first texel that is invalid in any texture, and the first that is invalid as light.
    unusable: Option<usize>,
    negative: Option<usize>,
}

#[cfg(test)]
thread_local! {
    /// Number of textures whose texels were all scanned on this thread.
    static SCANS: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
}

impl TexelSummary {
    fn of(texels: &[[f32; 4]]) -> TexelSummary {
        #[cfg(test)]
        SCANS.set(SCANS.get() + 1);
        let mut summary =
            TexelSummary { transparent: false, black: true, unusable: None, negative: None };
        for (i, t) in texels.iter().enumerate() {
            summary.transparent |= t[3] < 1.0;
            summary.black &= t[..3] == [0.0; 3];
            if summary.unusable.is_none() && !t.iter().all(|v| v.is_finite()) {
                summary.unusable = Some(i);
            }
            if summary.negative.is_none() && t[..3].iter().any(|v| *v < 0.0) {
                summary.negative = Some(i);
            }
        }
        summary
    }
}

/// Why a texture cannot be made.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TextureError {
    /// The number of texels does not match the size.
    #[error(
        "texture of {width} x {height} texels needs {expected} values, found {found}; give 4 per \
         texel (RGBA), at least one texel"
    )]
    Length {
        /// Texels per row.
        width: usize,
        /// Rows.
        height: usize,
        /// Values needed.
        expected: usize,
        /// Values found.
        found: usize,
    },
}

impl Texture {
    /// A texture from linear RGBA texels, row 0 at texture coordinate v = 0 (OpenGL's order).
    pub fn from_linear(
        width: usize,
        height: usize,
        texels: Vec<[f32; 4]>,
    ) -> Result<Texture, TextureError> {
        if texels.is_empty() || width.checked_mul(height) != Some(texels.len()) {
            let (expected, found) =
                (width.saturating_mul(height).saturating_mul(4), texels.len() * 4);
            return Err(TextureError::Length { width, height, expected, found });
        }
        let summary = TexelSummary::of(&texels);
        Ok(Texture {
            width,
            height,
            texels,
            summary,
            wrap: [Wrap::Repeat; 2],
            filter: Filter::Bilinear,
        })
    }

    /// A texture from sRGB-encoded 8-bit RGBA, row 0 at v = 0; alpha is linear.
    pub fn from_srgb8(width: usize, height: usize, rgba: &[u8]) -> Result<Texture, TextureError> {
        let expected = width.saturating_mul(height).saturating_mul(4);
        if expected == 0 || expected != rgba.len() {
            return Err(TextureError::Length { width, height, expected, found: rgba.len() });
        }
        let decode: Vec<f32> = (0..256).map(|v| srgb_to_linear(v as f32 / 255.0)).collect();
        let texels = rgba
            .chunks_exact(4)
            .map(|c| {
                [
                    decode[c[0] as usize],
                    decode[c[1] as usize],
                    decode[c[2] as usize],
                    c[3] as f32 / 255.0,
                ]
            })
            .collect();
        Texture::from_linear(width, height, texels)
    }

    /// Texels per row and rows.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// The texels, row by row.
    pub fn texels(&self) -> &[[f32; 4]] {
        &self.texels
    }

    /// True when a texel is transparent.
    pub fn has_transparency(&self) -> bool {
        self.summary.transparent
    }

    /// True when every texel is black.
    pub fn is_black(&self) -> bool {
        self.summary.black
    }

    /// Column and row of the first texel that is NaN or infinite in a channel.
    pub fn unusable_texel(&self) -> Option<[usize; 2]> {
        self.summary.unusable.map(|i| [i % self.width, i / self.width])
    }

    /// Column and row of the first texel with a negative colour.
    pub fn negative_texel(&self) -> Option<[usize; 2]> {
        self.summary.negative.map(|i| [i % self.width, i / self.width])
    }

    /// How often all texels of a texture were scanned on this thread.
    #[cfg(test)]
    pub(crate) fn scans() -> usize {
        SCANS.get()
    }

    /// Linear RGBA at texture coordinates `uv`; non-finite coordinates give texel (0,0).
    #[inline]
    pub fn sample(&self, uv: Vec2) -> [f32; 4] {
        let uv = if uv.is_finite() { uv } else { Vec2::ZERO };
        let (x, y) = (uv.x * self.width as f32, uv.y * self.height as f32);
        match self.filter {
            Filter::Nearest => self.texel(x.floor() as i64, y.floor() as i64),
            Filter::Bilinear => {
                let (x, y) = (x - 0.5, y - 0.5);
                let (x0, y0) = (x.floor(), y.floor());
                let (fx, fy) = (x - x0, y - y0);
                let (i, j) = (x0 as i64, y0 as i64);
                let t = [
                    self.texel(i, j),
                    self.texel(i + 1, j),
                    self.texel(i, j + 1),
                    self.texel(i + 1, j + 1),
                ];
                std::array::from_fn(|c| {
                    let low = t[0][c] + (t[1][c] - t[0][c]) * fx;
                    let high = t[2][c] + (t[3][c] - t[2][c]) * fx;
                    low + (high - low) * fy
                })
            }
        }
    }

    #[inline]
    fn texel(&self, i: i64, j: i64) -> [f32; 4] {
        let place = |k: i64, n: usize, wrap: Wrap| {
            let n = n as i64;
            let k = match wrap {
                Wrap::Repeat => k.rem_euclid(n),
                Wrap::Clamp => k.clamp(0, n - 1),
                Wrap::Mirror => {
                    let m = k.rem_euclid(2 * n);
                    if m < n { m } else { 2 * n - 1 - m }
                }
            };
            k as usize
        };
        self.texels
            [place(j, self.height, self.wrap[1]) * self.width + place(i, self.width, self.wrap[0])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_by_one() -> Texture {
        Texture::from_linear(2, 1, vec![[0.0, 0.0, 0.0, 1.0], [1.0, 1.0, 1.0, 1.0]]).unwrap()
    }

    #[test]
    fn bilinear_is_exact_at_texel_centres_and_half_way() {
        let t = two_by_one();
        assert_eq!(t.sample(Vec2::new(0.25, 0.5))[0], 0.0);
        assert_eq!(t.sample(Vec2::new(0.75, 0.5))[0], 1.0);
        assert_eq!(t.sample(Vec2::new(0.5, 0.5))[0], 0.5);
    }

    #[test]
    fn what_a_texture_says_of_its_texels_is_true_however_it_was_made() {
        let opaque = two_by_one();
        assert!(!opaque.has_transparency() && !opaque.is_black());
        let mut looked_through = Texture::from_srgb8(1, 2, &[0, 0, 0, 255, 0, 0, 0, 254]).unwrap();
        assert!(looked_through.has_transparency() && looked_through.is_black());
        // The mutable fields do not affect the texels; a replaced texture brings its own scan
        // results.
        (looked_through.wrap, looked_through.filter) = ([Wrap::Clamp; 2], Filter::Nearest);
        assert!(looked_through.clone().has_transparency() && looked_through.is_black());
        looked_through = opaque;
        assert!(!looked_through.has_transparency() && !looked_through.is_black());
        assert_eq!(looked_through.unusable_texel(), None);
        let mut texels = vec![[0.5; 4]; 12];
        texels[7][1] = f32::NAN;
        texels[9][3] = f32::INFINITY;
        let broken = Texture::from_linear(4, 3, texels).unwrap();
        assert_eq!(broken.unusable_texel(), Some([3, 1]));
    }

    #[test]
    fn wrapping_modes_differ_outside() {
        let mut t = two_by_one();
        t.filter = Filter::Nearest;
        let at = |t: &Texture, u: f32| t.sample(Vec2::new(u, 0.0))[0];
        assert_eq!((at(&t, 1.1), at(&t, -0.1)), (0.0, 1.0));
        t.wrap = [Wrap::Clamp; 2];
        assert_eq!((at(&t, 1.1), at(&t, -0.1)), (1.0, 0.0));
        t.wrap = [Wrap::Mirror; 2];
        assert_eq!((at(&t, 1.1), at(&t, 1.9), at(&t, -0.9)), (1.0, 0.0, 1.0));
        assert_eq!(at(&t, f32::NAN), 0.0);
    }

    #[test]
    fn wrong_lengths_are_named() {
        let e = Texture::from_srgb8(2, 2, &[0; 15]).unwrap_err();
        assert_eq!(e, TextureError::Length { width: 2, height: 2, expected: 16, found: 15 });
        assert!(Texture::from_linear(0, 0, vec![]).is_err());
    }
}
