//! Images in (borrowed slices) and images out (owned pixels).
use crate::error::CompositeError;
use crate::pixel::{Color, Composite, DepthPixel, PixelFormat, PremultipliedPixel};
use std::ops::Range;

/// One rank's rendered image: slices of the caller, row after row, any row order as long as all ranks use the same.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a, P: PixelFormat> {
    width_px: u32,
    height_px: u32,
    color: &'a [P::Color],
    depth: &'a [f32],
}

impl<'a, C: Color> Frame<'a, DepthPixel<C>>
where
    DepthPixel<C>: PixelFormat<Color = C>,
{
    /// An opaque image with depth 0 (near) … 1 (background). Both slices hold `width_px * height_px` values.
    ///
    /// # Errors
    /// [`CompositeError::FrameSize`] if a slice has another length.
    pub fn with_depth(
        width_px: u32,
        height_px: u32,
        color: &'a [C],
        depth: &'a [f32],
    ) -> Result<Self, CompositeError> {
        check_length("colour", width_px, height_px, color.len())?;
        check_length("depth", width_px, height_px, depth.len())?;
        Ok(Self { width_px, height_px, color, depth })
    }
}

impl<'a, C: Color> Frame<'a, PremultipliedPixel<C>>
where
    PremultipliedPixel<C>: PixelFormat<Color = C>,
{
    /// A transparent image of premultiplied colours, `width_px * height_px` of them.
    ///
    /// # Errors
    /// [`CompositeError::FrameSize`] if the slice has another length.
    pub fn premultiplied(width_px: u32, height_px: u32, color: &'a [C]) -> Result<Self, CompositeError> {
        check_length("colour", width_px, height_px, color.len())?;
        Ok(Self { width_px, height_px, color, depth: &[] })
    }
}

fn check_length(
    slice: &'static str,
    width_px: u32,
    height_px: u32,
    found: usize,
) -> Result<(), CompositeError> {
    let expected = u64::from(width_px) * u64::from(height_px);
    if found as u64 == expected {
        Ok(())
    } else {
        Err(CompositeError::FrameSize { slice, width_px, height_px, expected, found: found as u64 })
    }
}

impl<P: PixelFormat> Frame<'_, P> {
    /// Width in pixels.
    pub fn width_px(&self) -> u32 {
        self.width_px
    }

    /// Height in pixels.
    pub fn height_px(&self) -> u32 {
        self.height_px
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.color.len()
    }

    /// Whether the image has no pixel at all.
    pub fn is_empty(&self) -> bool {
        self.color.is_empty()
    }

    /// Pixel number `index`, counted row by row.
    ///
    /// # Panics
    /// If `index >= self.len()`, as slices do.
    pub fn pixel(&self, index: usize) -> P {
        P::from_parts(self.color[index], if P::HAS_DEPTH { self.depth[index] } else { 1.0 })
    }

    /// Depths that are not a number: they count as background, and [`crate::Report`] says how many there were.
    pub fn nan_depths(&self) -> u64 {
        self.depth.iter().filter(|depth| depth.is_nan()).count() as u64
    }
}

impl<P: Composite> Frame<'_, P> {
    /// All pixels, inactive ones as [`PixelFormat::EMPTY`].
    pub(crate) fn pixels(&self) -> Vec<P> {
        self.pixels_of(0..self.len())
    }

    pub(crate) fn pixels_of(&self, range: Range<usize>) -> Vec<P> {
        let drawn = |pixel: P| if pixel.is_active() { pixel } else { P::EMPTY };
        range.map(|index| drawn(self.pixel(index))).collect()
    }
}

/// A composited image.
#[derive(Clone, Debug, PartialEq)]
pub struct Image<P> {
    /// Width in pixels.
    pub width_px: u32,
    /// Height in pixels.
    pub height_px: u32,
    /// `width_px * height_px` pixels, row after row; [`PixelFormat::EMPTY`] where nothing was drawn.
    pub pixels: Vec<P>,
}

impl<P: Composite> Image<P> {
    /// The colour plane.
    pub fn colors(&self) -> Vec<P::Color> {
        self.pixels.iter().map(P::color).collect()
    }

    /// The depth plane; 1 everywhere for formats without depth.
    pub fn depths(&self) -> Vec<f32> {
        self.pixels.iter().map(P::depth).collect()
    }

    /// Every bit of the image, pixel after pixel, for comparisons that must tell `-0.0` from `0.0` and NaN from NaN.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.pixels.len() * P::BYTES);
        for pixel in &self.pixels {
            pixel.write(&mut bytes);
        }
        bytes
    }
}

/// The contiguous part of the finished image that one rank holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece<P> {
    /// Index of the first pixel.
    pub start: usize,
    /// The pixels, possibly none.
    pub pixels: Vec<P>,
}

impl<P> Piece<P> {
    /// A piece without pixels.
    pub fn nothing() -> Self {
        Self { start: 0, pixels: Vec::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_depth_slice_that_is_too_short_is_named_with_both_lengths() {
        let error = Frame::with_depth(3, 2, &[[0_u8; 4]; 6], &[0.5; 5]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "the depth slice holds 5 values but a 3x2 image needs 6: pass one value per pixel"
        );
        assert!(Frame::premultiplied(3, 2, &[[0.0_f32; 4]; 7]).is_err());
    }

    #[test]
    fn nan_depths_are_counted() {
        let frame = Frame::with_depth(3, 1, &[[0_u8; 4]; 3], &[f32::NAN, 0.5, -f32::NAN]).unwrap();
        assert_eq!(frame.nan_depths(), 2);
    }
}
