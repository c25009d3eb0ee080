//! Images in (borrowed slices) and images out (owned planes).
use crate::color::Color;
use crate::error::CompositeError;
use crate::layer::{Layer, View};
use crate::pixel::{Composite, DepthPixel, PixelFormat, PremultipliedPixel};
use crate::rect::Rect;
use crate::simd::mask::{Counts, row_words, row_words_scalar};
use crate::simd::{Kernels, at_level};

/// One rank's rendered image: slices of the caller, row after row. The row order is free but must
/// be the same on all ranks.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a, P: PixelFormat> {
    width_px: u32,
    height_px: u32,
    /// From one row to the next, in pixels of both planes.
    row_px: usize,
    color: &'a [P::Color],
    depth: &'a [f32],
    bounds: Option<Rect>,
    depth_range: Option<[f32; 2]>,
}

impl<'a, C: Color> Frame<'a, DepthPixel<C>>
where
    DepthPixel<C>: PixelFormat<Color = C>,
{
    /// An opaque image with depths from 0 (near) to 1 (background). Both slices hold `width_px *
    /// height_px` values.
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
        Ok(Self::of_planes(width_px, height_px, width_px as usize, color, depth))
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
    pub fn premultiplied(
        width_px: u32,
        height_px: u32,
        color: &'a [C],
    ) -> Result<Self, CompositeError> {
        check_length("colour", width_px, height_px, color.len())?;
        Ok(Self::of_planes(width_px, height_px, width_px as usize, color, &[]))
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

impl Rect {
    /// Returns an error that names both rectangles if `bounds` is not within this one.
    pub(crate) fn must_contain(&self, bounds: &Self) -> Result<(), CompositeError> {
        if self.contains(bounds) {
            return Ok(());
        }
        Err(CompositeError::Options(format!(
            "bounds of columns {}..{} and rows {}..{} reach beyond an image of {}x{}: clip them to \
             the image",
            bounds.x0, bounds.x1, bounds.y0, bounds.y1, self.x1, self.y1
        )))
    }
}

impl<'a, P: PixelFormat> Frame<'a, P> {
    fn of_planes(
        width_px: u32,
        height_px: u32,
        row_px: usize,
        color: &'a [P::Color],
        depth: &'a [f32],
    ) -> Self {
        Self { width_px, height_px, row_px, color, depth, bounds: None, depth_range: None }
    }

    /// An image whose rows are `row_px` pixels apart in both planes: rows with padding, or a part
    /// of a larger image. The last row may end with its last pixel. `depth` is empty for formats
    /// without depth.
    ///
    /// # Errors
    /// [`CompositeError::Options`] if rows overlap, or if a plane ends before the last pixel.
    pub fn with_rows(
        width_px: u32,
        height_px: u32,
        row_px: usize,
        color: &'a [P::Color],
        depth: &'a [f32],
    ) -> Result<Self, CompositeError> {
        if row_px < width_px as usize {
            return Err(CompositeError::Options(format!(
                "rows of {width_px} pixels are {row_px} pixels apart: give at least their width"
            )));
        }
        let empty = width_px == 0 || height_px == 0;
        let before_last = (height_px.max(1) as usize - 1).checked_mul(row_px);
        let needed = before_last.and_then(|n| n.checked_add(width_px as usize));
        let needed = if empty { Some(0) } else { needed };
        let planes = [("colour", color.len(), true), ("depth", depth.len(), P::HAS_DEPTH)];
        for (plane, found, is_needed) in planes {
            if is_needed && needed.is_none_or(|needed| found < needed) {
                return Err(CompositeError::Options(format!(
                    "the {plane} plane holds {found} values, too few for {height_px} rows of \
                     {width_px} pixels that are {row_px} apart: pass it up to its last pixel"
                )));
            }
        }
        Ok(Self::of_planes(width_px, height_px, row_px, color, depth))
    }

    /// A part of this frame as a frame of its own, without a copy: a tile of a display wall. What
    /// is known of its bounds and its depth range holds for the part too.
    ///
    /// # Errors
    /// [`CompositeError::Options`] if `window` reaches outside the image.
    pub fn window(self, window: Rect) -> Result<Self, CompositeError> {
        Rect::of_size(self.width_px, self.height_px).must_contain(&window)?;
        let window = if window.is_empty() { Rect::EMPTY } else { window };
        let first = window.y0 as usize * self.row_px + window.x0 as usize;
        let in_window = |bounds: Rect| {
            let Rect { x0, y0, x1, y1 } = bounds.intersection(&window);
            if x1 <= x0 {
                return Rect::EMPTY;
            }
            Rect { x0: x0 - window.x0, y0: y0 - window.y0, x1: x1 - window.x0, y1: y1 - window.y0 }
        };
        Ok(Self {
            width_px: window.width() as u32,
            height_px: window.height() as u32,
            color: &self.color[first..],
            depth: if P::HAS_DEPTH { &self.depth[first..] } else { &[] },
            bounds: self.bounds.map(in_window),
            ..self
        })
    }

    /// The same frame, restricted to the pixels in `bounds`: a renderer that knows where it drew
    /// saves the search for active pixels. Pixels outside are background, whatever the slices hold
    /// there.
    ///
    /// # Errors
    /// [`CompositeError::Options`] if `bounds` reaches outside the image.
    pub fn with_bounds(self, bounds: Rect) -> Result<Self, CompositeError> {
        Rect::of_size(self.width_px, self.height_px).must_contain(&bounds)?;
        Ok(Self { bounds: Some(if bounds.is_empty() { Rect::EMPTY } else { bounds }), ..self })
    }

    /// The same frame, with the nearest and farthest depth that this rank drew, in any unit that
    /// all ranks share. This makes [`composite`](crate::composite) check the order of blended
    /// frames: if a rank reaches behind the nearest depth of one that comes after it, and their
    /// rectangles overlap, it returns [`CompositeError::Order`] instead of a wrong image.
    pub fn with_depth_range(self, near_to_far: [f32; 2]) -> Self {
        Self { depth_range: Some(near_to_far), ..self }
    }

    pub(crate) fn depth_range(&self) -> Option<[f32; 2]> {
        self.depth_range
    }

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
        self.width_px as usize * self.height_px as usize
    }

    /// Whether the image has no pixel at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A composited image as a frame.
    pub(crate) fn of_image(image: &'a Image<P>) -> Self {
        let row_px = image.width_px as usize;
        Self::of_planes(image.width_px, image.height_px, row_px, &image.colors, &image.depths)
    }

    /// Whether the renderer has set bounds.
    pub(crate) fn has_bounds(&self) -> bool {
        self.bounds.is_some()
    }

    /// All pixels that count: the whole image, or less if the frame is
    /// [`with_bounds`](Self::with_bounds).
    pub fn bounds(&self) -> Rect {
        self.bounds.unwrap_or(Rect::of_size(self.width_px, self.height_px))
    }

    /// Pixel number `index`, counted row by row; [`PixelFormat::EMPTY`] outside the bounds.
    ///
    /// # Panics
    /// If `index >= self.len()`, as slices do.
    pub fn pixel(&self, index: usize) -> P {
        let (x, y) = (index % self.width_px as usize, index / self.width_px as usize);
        if let Some(bounds) = self.bounds
            && (x < bounds.x0 as usize
                || x >= bounds.x1 as usize
                || y < bounds.y0 as usize
                || y >= bounds.y1 as usize)
        {
            return P::EMPTY;
        }
        let at = y * self.row_px + x;
        P::from_parts(self.color[at], if P::HAS_DEPTH { self.depth[at] } else { 1.0 })
    }

    /// Pixels of `bounds`, which must lie within the image.
    pub(crate) fn view(&self, bounds: Rect) -> View<'a, P> {
        View { bounds, origin: (0, 0), stride: self.row_px, colors: self.color, depths: self.depth }
    }
}

impl<P: Composite> Frame<'_, P> {
    /// Number of depths that are NaN. They count as background; [`crate::Report`] counts them too.
    pub fn nan_depths(&self) -> u64 {
        self.drawn(Kernels::new(None)).1.nan
    }

    /// The smallest rectangle around the active pixels within the bounds, and how many there are.
    pub(crate) fn drawn(&self, kernels: Kernels) -> (Rect, Counts) {
        let bounds = self.bounds();
        let (mut found, mut counts) = (Rect::EMPTY, Counts::default());
        if bounds.is_empty() {
            return (found, counts);
        }
        let view = self.view(bounds);
        // Columns are found in the union of all rows' masks.
        let mut columns = vec![0_u64; bounds.width().div_ceil(64)];
        for y in bounds.y0..bounds.y1 {
            let (colors, depths) = view.row(y, bounds.x0, bounds.x1);
            let before = counts.active;
            let mut words = columns.iter_mut();
            let mut put = |word| {
                if let Some(column) = words.next() {
                    *column |= word;
                }
            };
            at_level!(
                kernels,
                simd => row_words::<P, _>(simd, colors, depths, &mut counts, &mut put),
                row_words_scalar::<P>(colors, depths, &mut counts, &mut put)
            );
            if counts.active > before {
                if before == 0 {
                    found.y0 = y;
                }
                found.y1 = y + 1;
            }
        }
        let first = columns.iter().position(|&word| word != 0);
        let last = columns.iter().rposition(|&word| word != 0);
        if let (Some(first), Some(last)) = (first, last) {
            found.x0 = bounds.x0 + 64 * first as u32 + columns[first].trailing_zeros();
            found.x1 = bounds.x0 + 64 * last as u32 + 64 - columns[last].leading_zeros();
        }
        (found, counts)
    }
}

/// A composited image.
#[derive(Clone, Debug, PartialEq)]
pub struct Image<P: PixelFormat> {
    pub(crate) width_px: u32,
    pub(crate) height_px: u32,
    pub(crate) colors: Vec<P::Color>,
    pub(crate) depths: Vec<f32>,
}

impl<P: Composite> Image<P> {
    /// An image from its planes: `width_px * height_px` colours, and as many depths or none.
    ///
    /// # Errors
    /// [`CompositeError::FrameSize`] if a plane has another length.
    pub fn from_planes(
        width_px: u32,
        height_px: u32,
        colors: Vec<P::Color>,
        depths: Vec<f32>,
    ) -> Result<Self, CompositeError> {
        check_length("colour", width_px, height_px, colors.len())?;
        if !depths.is_empty() {
            check_length("depth", width_px, height_px, depths.len())?;
        }
        Ok(Self { width_px, height_px, colors, depths })
    }

    /// Width in pixels.
    pub fn width_px(&self) -> u32 {
        self.width_px
    }

    /// Height in pixels.
    pub fn height_px(&self) -> u32 {
        self.height_px
    }

    /// The colour plane, row after row; all channels zero where nothing was drawn.
    pub fn colors(&self) -> &[P::Color] {
        &self.colors
    }

    /// The depth plane, 1 where nothing was drawn; empty for formats without depth, and where
    /// [`Options::depth`](crate::Options::depth) did not ask for it.
    pub fn depths(&self) -> &[f32] {
        &self.depths
    }

    /// Both planes, moved out.
    pub fn into_planes(self) -> (Vec<P::Color>, Vec<f32>) {
        (self.colors, self.depths)
    }

    /// Pixel number `index`, counted row by row.
    ///
    /// # Panics
    /// If there is no such pixel, as slices do.
    pub fn pixel(&self, index: usize) -> P {
        P::from_parts(self.colors[index], self.depths.get(index).copied().unwrap_or(1.0))
    }

    /// Every bit of the image, plane after plane, for comparisons that must tell `-0.0` from `0.0`
    /// and NaN from NaN.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = bytemuck::cast_slice::<_, u8>(&self.colors).to_vec();
        bytes.extend_from_slice(bytemuck::cast_slice(&self.depths));
        bytes
    }
}

/// The part of the finished image that one rank holds. Pixels in no rank's piece are background.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece<P: PixelFormat> {
    /// Which pixels; possibly none.
    pub bounds: Rect,
    /// Their colours, row after row.
    pub colors: Vec<P::Color>,
    /// Their depths; empty for formats without depth.
    pub depths: Vec<f32>,
}

impl<P: PixelFormat> Piece<P> {
    /// A piece without pixels.
    pub fn nothing() -> Self {
        Self { bounds: Rect::EMPTY, colors: Vec::new(), depths: Vec::new() }
    }
}

impl<P: Composite> From<Layer<P>> for Piece<P> {
    fn from(layer: Layer<P>) -> Self {
        Self { bounds: layer.bounds, colors: layer.colors, depths: layer.depths }
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

    #[test]
    fn the_drawn_rectangle_is_tight_wherever_the_pixels_are() {
        let (width, height) = (150_u32, 9_u32);
        for (x, y, x2, y2) in
            [(0, 0, 0, 0), (149, 8, 149, 8), (63, 2, 64, 2), (70, 1, 3, 7), (128, 4, 127, 5)]
        {
            let mut color = vec![[0_u8; 4]; 150 * 9];
            for (x, y) in [(x, y), (x2, y2)] {
                color[y * 150 + x] = [0, 0, 0, 1];
            }
            let frame = Frame::premultiplied(width, height, &color).unwrap();
            let expected = Rect {
                x0: x.min(x2) as u32,
                y0: y.min(y2) as u32,
                x1: x.max(x2) as u32 + 1,
                y1: y.max(y2) as u32 + 1,
            };
            for kernels in [Kernels::new(None), Kernels(None)] {
                assert_eq!(frame.drawn(kernels).0, expected);
                assert_eq!(frame.with_bounds(Rect::EMPTY).unwrap().drawn(kernels).0, Rect::EMPTY);
            }
        }
    }

    #[test]
    fn windows_and_rows_with_padding_show_the_pixels_of_the_whole() {
        let color: Vec<[u8; 4]> = (0..7 * 5).map(|k| [k, 0, 0, 1]).collect();
        let depth: Vec<f32> = (0..7 * 5).map(|k| k as f32 / 64.0).collect();
        let whole = Frame::with_depth(7, 5, &color, &depth).unwrap();
        let bounded = whole.with_bounds(Rect { x0: 1, y0: 0, x1: 4, y1: 3 }).unwrap();
        let window = Rect { x0: 2, y0: 1, x1: 6, y1: 5 };
        for frame in [whole, bounded] {
            let part = frame.window(window).unwrap();
            assert_eq!((part.width_px(), part.height_px(), part.len()), (4, 4, 16));
            for k in 0..16 {
                assert_eq!(part.pixel(k), frame.pixel((k / 4 + 1) * 7 + k % 4 + 2), "pixel {k}");
            }
        }
        // The last row ends with its last pixel.
        let rows = Frame::<DepthPixel<[u8; 4]>>::with_rows(5, 5, 7, &color[2..], &depth[2..]);
        let rows = rows.unwrap();
        assert_eq!(rows.pixel(24), whole.pixel(34));
        let whole_of_rows = whole.window(Rect { x0: 2, y0: 0, x1: 7, y1: 5 }).unwrap();
        for kernels in [Kernels::new(None), Kernels(None)] {
            assert_eq!(rows.drawn(kernels).0, whole_of_rows.drawn(kernels).0);
        }
        assert_eq!(whole.window(Rect::EMPTY).unwrap().len(), 0);
    }

    #[test]
    fn rows_that_overlap_and_planes_that_end_early_are_refused() {
        type Pixel = PremultipliedPixel<[u8; 4]>;
        let color = [[1_u8; 4]; 12];
        let text = |width, rows, row_px: usize| match Frame::<Pixel>::with_rows(
            width,
            rows,
            row_px,
            &color,
            &[],
        ) {
            Ok(frame) => format!("{} pixels", frame.len()),
            Err(error) => error.to_string(),
        };
        assert!(text(5, 2, 4).contains("at least their width"));
        assert!(text(5, 3, 5).contains("the colour plane holds 12 values"));
        assert!(text(5, 3, usize::MAX).contains("too few for 3 rows"));
        assert_eq!(text(4, 3, 4), "12 pixels");
        assert_eq!(text(2, 3, 5), "6 pixels");
        assert_eq!(text(0, 3, usize::MAX), "0 pixels");
        let window = Frame::<Pixel>::with_rows(4, 3, 4, &color, &[]).unwrap();
        assert!(window.window(Rect { x0: 3, y0: 0, x1: 5, y1: 1 }).is_err());
    }

    #[test]
    fn bounds_beyond_the_image_are_refused() {
        let color = [[1_u8; 4]; 6];
        let frame = Frame::premultiplied(3, 2, &color).unwrap();
        let error = frame.with_bounds(Rect { x0: 1, y0: 0, x1: 4, y1: 1 }).unwrap_err().to_string();
        assert!(
            error.contains("columns 1..4 and rows 0..1 reach beyond an image of 3x2"),
            "{error}"
        );
        let with_bounds = frame.with_bounds(Rect { x0: 1, y0: 0, x1: 2, y1: 1 }).unwrap();
        assert_eq!(with_bounds.pixel(1).color, [1; 4]);
        assert_eq!(with_bounds.pixel(2).color, [0; 4]);
    }
}
