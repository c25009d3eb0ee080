//! Pixels in memory of the program as the frames of the compositor: borrowed where they lie as it
//! reads them, copied otherwise, with the reason.

use super::memory::{at, check_pointer, flag, is_addressable};
use super::status::Failure;
use super::types::*;
use bytemuck::Pod;
use composite::{Composite, Frame, PixelFormat, Rect};
use std::ffi::c_void;
use std::fmt::Write as _;

/// Pixels of one kind, and from one row to the next in pixels.
enum Pixels<'a, T> {
    Borrowed(&'a [T], usize),
    Copied(Vec<T>),
}

impl<T> Pixels<'_, T> {
    fn slice(&self) -> &[T] {
        match self {
            Pixels::Borrowed(pixels, _) => pixels,
            Pixels::Copied(pixels) => pixels,
        }
    }
}

/// A plane whose description is sound.
struct Layout {
    data: *const c_void,
    /// Columns and rows.
    size: [u64; 2],
    /// From one pixel to the next and from one row to the next, bytes.
    strides: [i64; 2],
}

impl Layout {
    fn new<T>(plane: &RtsvCompositePlane, size: [u64; 2], what: &str) -> Result<Self, Failure> {
        let bytes = size_of::<T>() as u64;
        let pixel = if plane.pixel_bytes == 0 { bytes as i64 } else { plane.pixel_bytes };
        let tight = i128::from(pixel) * i128::from(size[0]);
        let row = if plane.row_bytes == 0 || size[1] <= 1 {
            i64::try_from(tight).unwrap_or(i64::MAX)
        } else {
            plane.row_bytes
        };
        let layout = Layout { data: plane.data, size, strides: [pixel, row] };
        if layout.is_empty() {
            return Ok(layout);
        }
        if plane.data.is_null() {
            check_pointer(plane.data.cast::<u8>(), &format!("{what}.data"))?;
        }
        if !is_addressable(&size, &layout.strides, bytes) {
            return Err(Failure::value(format!(
                "{what}: {} x {} pixels that are {pixel} bytes apart in rows that are {row} bytes \
                 apart: no memory is so large",
                size[0], size[1]
            )));
        }
        // Along one axis, all pixels of the other fit between two neighbours.
        let [across, down] = layout.strides.map(|s| i128::from(s).abs());
        let extent = |n: u64, stride: i128| i128::from(n - 1) * stride + i128::from(bytes);
        let rows_apart = across >= i128::from(bytes) && down >= extent(size[0], across);
        let columns_apart = down >= i128::from(bytes) && across >= extent(size[1], down);
        if size[1] > 1 && !(rows_apart || columns_apart) || across < i128::from(bytes) {
            return Err(Failure::value(format!(
                "{what}: pixels of {bytes} bytes overlap: pixel_bytes is {pixel} and row_bytes \
                 {row} for {} pixels per row; both count bytes",
                size[0]
            )));
        }
        Ok(layout)
    }

    fn is_empty(&self) -> bool {
        self.size.contains(&0)
    }

    /// From one row to the next in pixels, or why the compositor cannot read these pixels where
    /// they are.
    fn row_px<T>(&self) -> Result<usize, String> {
        let (bytes, [pixel, row]) = (size_of::<T>() as i64, self.strides);
        if pixel != bytes {
            Err(format!("its pixels are {pixel} bytes apart, not {bytes}"))
        } else if row < 0 {
            Err(format!("its rows descend in memory (row_bytes is {row})"))
        } else if row % bytes != 0 {
            Err(format!("its rows are {row} bytes apart, no multiple of {bytes}"))
        } else if !self.data.cast::<T>().is_aligned() {
            Err(format!("its address is no multiple of {}", align_of::<T>()))
        } else {
            Ok((row / bytes) as usize)
        }
    }

    /// # Safety
    /// The plane is readable memory for `'a`, up to its last pixel and also between its rows.
    unsafe fn borrowed<'a, T>(&self, row_px: usize) -> Pixels<'a, T> {
        let [columns, rows] = self.size.map(|n| n as usize);
        let length = (rows - 1) * row_px + columns;
        // SAFETY: the caller's promise; `row_px` has checked the alignment and the strides, and
        // `new` that the length is possible.
        Pixels::Borrowed(unsafe { std::slice::from_raw_parts(self.data.cast(), length) }, row_px)
    }

    /// # Safety
    /// Each pixel of the plane is readable memory.
    unsafe fn copied<'a, T: Pod>(&self) -> Pixels<'a, T> {
        let [columns, rows] = self.size;
        let mut pixels = Vec::with_capacity((columns * rows) as usize);
        for y in 0..rows {
            let row = at(self.data, y, self.strides[1]);
            pixels.extend((0..columns).map(|x| {
                // SAFETY: the caller's promise; any bytes are a pixel.
                unsafe { at(row, x, self.strides[0]).cast::<T>().read_unaligned() }
            }));
        }
        Pixels::Copied(pixels)
    }
}

/// The planes of a frame.
pub(crate) struct Planes<'a, P: PixelFormat> {
    frame: RtsvCompositeFrame,
    color: Pixels<'a, P::Color>,
    depth: Pixels<'a, f32>,
}

impl<'a, P: Composite> Planes<'a, P> {
    /// Borrows or copies the planes of `frame`. For each plane that is copied, `copies` gets a line
    /// with the reason.
    ///
    /// # Safety
    /// The planes that the format needs are readable memory for `'a`, and nothing writes to them.
    pub(crate) unsafe fn new(
        frame: &RtsvCompositeFrame,
        copies: &mut String,
    ) -> Result<Self, Failure> {
        let size = [frame.width, frame.height].map(u64::from);
        let color = Layout::new::<P::Color>(&frame.color, size, "color")?;
        let none = Pixels::Borrowed(&[][..], 0);
        if color.is_empty() {
            let color = Pixels::Borrowed(&[][..], frame.width as usize);
            return Ok(Planes { frame: *frame, color, depth: none });
        }
        let mut rows = [color.row_px::<P::Color>(), Ok(frame.width as usize)];
        let depth = if P::HAS_DEPTH {
            let depth = Layout::new::<f32>(&frame.depth, size, "depth")?;
            rows[1] = depth.row_px::<f32>();
            Some(depth)
        } else {
            rows[1] = rows[0].clone();
            None
        };
        // Both planes are read with one distance of rows, which that of a copy is the width.
        if let [Ok(a), Ok(b)] = &rows
            && a != b
        {
            let why = format!("the rows of color are {a} pixels apart, and those of depth {b}");
            rows = [Err(why.clone()), Err(why)];
        }
        let tight = frame.width as usize;
        if let [Ok(a), Err(_)] = &rows
            && *a != tight
        {
            rows[0] = Err("its rows have gaps, and depth is copied without".to_owned());
        }
        if let [Err(_), Ok(b)] = &rows
            && *b != tight
        {
            rows[1] = Err("its rows have gaps, and color is copied without".to_owned());
        }
        let told = if P::HAS_DEPTH { &rows[..] } else { &rows[..1] };
        for (what, row) in ["color", "depth"].into_iter().zip(told) {
            if let Err(why) = row {
                let [columns, rows] = size;
                writeln!(copies, "{what}: {columns} x {rows} pixels: copied: {why}")
                    .map_err(|_| Failure::value("no text for copies"))?;
            }
        }
        let [of_color, of_depth] = rows;
        // SAFETY: the caller's promise.
        let color = unsafe {
            match of_color {
                Ok(row_px) => color.borrowed(row_px),
                Err(_) => color.copied(),
            }
        };
        // SAFETY: the caller's promise.
        let depth = depth.map_or(none, |depth| unsafe {
            match of_depth {
                Ok(row_px) => depth.borrowed(row_px),
                Err(_) => depth.copied(),
            }
        });
        Ok(Planes { frame: *frame, color, depth })
    }

    /// The frame of the compositor.
    pub(crate) fn frame(&self) -> Result<Frame<'_, P>, Failure> {
        let RtsvCompositeFrame { width, height, bounds: [x0, y0, x1, y1], depth_range, .. } =
            self.frame;
        let row_px = match &self.color {
            Pixels::Borrowed(_, row_px) => *row_px,
            Pixels::Copied(_) => width as usize,
        };
        let (color, depth) = (self.color.slice(), self.depth.slice());
        let mut frame = Frame::with_rows(width, height, row_px, color, depth)?;
        if flag(self.frame.has_bounds, "has_bounds of RtsvCompositeFrame")? {
            frame = frame.with_bounds(Rect { x0, y0, x1, y1 })?;
        }
        if flag(self.frame.has_depth_range, "has_depth_range of RtsvCompositeFrame")? {
            let [near, far] = depth_range;
            if near.is_nan() || far.is_nan() || near > far {
                return Err(Failure::value(format!(
                    "depth_range of RtsvCompositeFrame is {near} to {far}: give the nearest depth \
                     first, or has_depth_range 0"
                )));
            }
            frame = frame.with_depth_range(depth_range);
        }
        Ok(frame)
    }
}
