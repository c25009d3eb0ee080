//! Planes of pixels inside this crate: borrowed from a frame ([`View`]) or owned while they are
//! merged ([`Layer`]).
use crate::pixel::{Composite, PixelFormat};
use crate::rect::Rect;
use crate::simd::expand::{Side, clean_run, clean_run_scalar, merge_run, merge_run_scalar};
use crate::simd::{Kernels, at_level};
use fearless_simd::Simd;

/// Pixels of `bounds` in planes whose rows are `stride` apart and whose first value is the pixel at
/// `origin`.
#[derive(Clone, Copy)]
pub(crate) struct View<'a, P: PixelFormat> {
    pub(crate) bounds: Rect,
    pub(crate) origin: (u32, u32),
    pub(crate) stride: usize,
    pub(crate) colors: &'a [P::Color],
    /// Empty for formats without depth.
    pub(crate) depths: &'a [f32],
}

impl<'a, P: Composite> View<'a, P> {
    /// Columns `x0..x1` of row `y`, which must be within the bounds.
    #[inline(always)]
    pub(crate) fn row(&self, y: u32, x0: u32, x1: u32) -> (&'a [P::Color], &'a [f32]) {
        let start = (y - self.origin.1) as usize * self.stride + (x0 - self.origin.0) as usize;
        let range = start..start + (x1 - x0) as usize;
        (&self.colors[range.clone()], if P::HAS_DEPTH { &self.depths[range] } else { &[] })
    }
}

/// Pixels of `bounds`, row after row, inactive ones as [`PixelFormat::EMPTY`].
#[derive(Clone, Debug)]
pub(crate) struct Layer<P: PixelFormat> {
    pub(crate) bounds: Rect,
    pub(crate) colors: Vec<P::Color>,
    /// Empty for formats without depth.
    pub(crate) depths: Vec<f32>,
}

impl<P: Composite> Layer<P> {
    /// An empty layer of `bounds`, in the buffers of `spare`.
    pub(crate) fn empty(bounds: Rect, spare: Option<Self>) -> Self {
        let (mut colors, mut depths) =
            spare.map_or((Vec::new(), Vec::new()), |s| (s.colors, s.depths));
        colors.clear();
        colors.resize(bounds.pixels(), P::EMPTY.color());
        depths.clear();
        depths.resize(if P::HAS_DEPTH { bounds.pixels() } else { 0 }, 1.0);
        Self { bounds, colors, depths }
    }

    /// Copies the pixels of `view` in `bounds`, which is cheaper than merging them into an empty
    /// layer.
    pub(crate) fn copied(
        bounds: Rect,
        view: &View<'_, P>,
        kernels: Kernels,
        spare: Option<Self>,
    ) -> Self {
        let (mut colors, mut depths) =
            spare.map_or((Vec::new(), Vec::new()), |s| (s.colors, s.depths));
        colors.clear();
        depths.clear();
        colors.reserve(bounds.pixels());
        depths.reserve(if P::HAS_DEPTH { bounds.pixels() } else { 0 });
        let both = bounds.intersection(&view.bounds);
        for y in bounds.y0..bounds.y1 {
            let end = colors.len() + bounds.width();
            if y >= both.y0 && y < both.y1 {
                let (row_colors, row_depths) = view.row(y, both.x0, both.x1);
                let first = colors.len() + (both.x0 - bounds.x0) as usize;
                colors.resize(first, P::EMPTY.color());
                colors.extend_from_slice(row_colors);
                if P::HAS_DEPTH {
                    depths.resize(first, 1.0);
                    depths.extend_from_slice(row_depths);
                    let (new_colors, new_depths) = (&mut colors[first..], &mut depths[first..]);
                    at_level!(
                        kernels,
                        simd => clean_run::<P, _>(simd, new_colors, new_depths),
                        clean_run_scalar::<P>(new_colors, new_depths)
                    );
                }
            }
            colors.resize(end, P::EMPTY.color());
            if P::HAS_DEPTH {
                depths.resize(end, 1.0);
            }
        }
        Self { bounds, colors, depths }
    }

    pub(crate) fn view(&self) -> View<'_, P> {
        View {
            bounds: self.bounds,
            origin: (self.bounds.x0, self.bounds.y0),
            stride: self.bounds.width(),
            colors: &self.colors,
            depths: &self.depths,
        }
    }

    #[inline(always)]
    pub(crate) fn row_mut(&mut self, y: u32, x0: u32, x1: u32) -> (&mut [P::Color], &mut [f32]) {
        let start =
            (y - self.bounds.y0) as usize * self.bounds.width() + (x0 - self.bounds.x0) as usize;
        let range = start..start + (x1 - x0) as usize;
        let depths = if P::HAS_DEPTH { &mut self.depths[range.clone()] } else { &mut [][..] };
        (&mut self.colors[range], depths)
    }

    /// Merges the pixels of `view` within these bounds.
    pub(crate) fn merge_view(&mut self, kernels: Kernels, view: &View<'_, P>, side: Side) {
        let both = self.bounds.intersection(&view.bounds);
        at_level!(kernels, simd => merge_rows(simd, self, view, both, side), {
            for y in both.y0..both.y1 {
                let (colors, depths) = view.row(y, both.x0, both.x1);
                let (held_colors, held_depths) = self.row_mut(y, both.x0, both.x1);
                let (colors, depths) = (bytemuck::cast_slice(colors), bytemuck::cast_slice(depths));
                merge_run_scalar::<P>(colors, depths, held_colors, held_depths, side);
            }
        });
    }

    /// The same pixels in larger bounds that contain these and `bounds`.
    pub(crate) fn grown(self, bounds: Rect, spare: Option<Self>) -> Self {
        let bounds = self.bounds.around(&bounds);
        if bounds == self.bounds {
            return self;
        }
        let mut grown = Self::empty(bounds, spare);
        for y in self.bounds.y0..self.bounds.y1 {
            let (colors, depths) = self.view().row(y, self.bounds.x0, self.bounds.x1);
            let (to_colors, to_depths) = grown.row_mut(y, self.bounds.x0, self.bounds.x1);
            to_colors.copy_from_slice(colors);
            to_depths.copy_from_slice(depths);
        }
        grown
    }
}

#[inline(always)]
fn merge_rows<P: Composite, S: Simd>(
    simd: S,
    layer: &mut Layer<P>,
    view: &View<'_, P>,
    both: Rect,
    side: Side,
) {
    for y in both.y0..both.y1 {
        let (colors, depths) = view.row(y, both.x0, both.x1);
        let (held_colors, held_depths) = layer.row_mut(y, both.x0, both.x1);
        let (colors, depths) = (bytemuck::cast_slice(colors), bytemuck::cast_slice(depths));
        merge_run::<P, S>(simd, colors, depths, held_colors, held_depths, side);
    }
}
