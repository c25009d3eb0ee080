//! Gathers the pieces of the finished image on one rank as they are finished, or leaves them where
//! they are.
//!
//! Pieces are sent as sparse messages: background costs one bit per pixel, and depth is sent only
//! on request. All ranks know from the beginning which pieces there will be, so they post their
//! receives first.
use crate::codec;
use crate::error::CompositeError;
use crate::frame::{Image, Piece};
use crate::frame_exchange::{FrameExchange, Tag};
use crate::layer::Layer;
use crate::merge::Scratch;
use crate::pixel::Composite;
use crate::rect::Rect;

/// The image at the root. Other ranks have nothing, or their own piece if there is no root.
pub(crate) type Outcome<P> = (Option<Image<P>>, Option<Piece<P>>);

pub(crate) struct Collector<P: Composite> {
    root: Option<usize>,
    depths: bool,
    /// At the root: pieces of other ranks that have not arrived.
    outstanding: Vec<(usize, Rect)>,
    image: Option<Image<P>>,
    /// Without a root: what this rank has finished.
    kept: Vec<Layer<P>>,
    /// Scratch buffer for colours with their alpha restored.
    wide: Vec<u8>,
}

impl<P: Composite> Collector<P> {
    /// `pieces` are all pieces that will be submitted, with the order index of their rank. `spare`
    /// is an image of this size that may be overwritten.
    pub(crate) fn new(
        exchange: &mut FrameExchange<'_>,
        size_px: (u32, u32),
        root: Option<usize>,
        depths: bool,
        pieces: &[(usize, Rect)],
        spare: Option<Image<P>>,
    ) -> Result<Self, CompositeError> {
        let depths = depths && P::HAS_DEPTH;
        let mut collector = Self {
            root,
            depths,
            outstanding: Vec::new(),
            image: None,
            kept: Vec::new(),
            wide: Vec::new(),
        };
        if root != Some(exchange.order_index) {
            return Ok(collector);
        }
        for &(order_index, rect) in pieces.iter().filter(|piece| piece.0 != exchange.order_index) {
            collector.outstanding.push((order_index, rect));
        }
        for &(order_index, _) in &collector.outstanding {
            // Pieces of one rank arrive in any order, so each receive has the capacity of the
            // largest.
            let from_sender = collector.outstanding.iter().filter(|piece| piece.0 == order_index);
            let largest = from_sender.map(|piece| piece.1).max_by_key(codec::longest::<P>);
            exchange.post::<P>(order_index, Tag::Collect, &largest.unwrap_or(Rect::EMPTY))?;
        }
        let begin = exchange.comm.working_secs();
        collector.image = Some(blank(size_px, depths, pieces, spare));
        exchange.report.collect_secs += exchange.comm.working_secs() - begin;
        Ok(collector)
    }

    /// Takes a piece that this rank has finished.
    pub(crate) fn submit(
        &mut self,
        exchange: &mut FrameExchange<'_>,
        layer: Layer<P>,
        scratch: &mut Scratch<P>,
    ) -> Result<(), CompositeError> {
        let Some(root) = self.root else {
            self.kept.push(layer);
            return Ok(());
        };
        if let Some(image) = &mut self.image {
            let begin = exchange.comm.working_secs();
            let width = image.width_px as usize;
            let bounds = layer.bounds;
            for y in bounds.y0..bounds.y1 {
                let (colors, depths) = layer.view().row(y, bounds.x0, bounds.x1);
                let start = y as usize * width + bounds.x0 as usize;
                image.colors[start..start + colors.len()].copy_from_slice(colors);
                if self.depths {
                    image.depths[start..start + depths.len()].copy_from_slice(depths);
                }
            }
            exchange.report.collect_secs += exchange.comm.working_secs() - begin;
        } else {
            exchange.send(root, Tag::Collect, &layer.view(), layer.bounds, self.depths)?;
        }
        scratch.layers.push(layer);
        Ok(())
    }

    /// Writes the piece of another rank into the image.
    pub(crate) fn take(
        &mut self,
        exchange: &mut FrameExchange<'_>,
        order_index: usize,
        bytes: Vec<u8>,
    ) -> Result<(), CompositeError> {
        let begin = exchange.comm.working_secs();
        // A rank finishes its pieces in any order, so the header of the message says which of the
        // expected pieces this is.
        let said = codec::rect_of(&bytes);
        let mut from_sender =
            self.outstanding.iter().enumerate().filter(|(_, piece)| piece.0 == order_index);
        let first = from_sender.next();
        let index = from_sender.find(|(_, piece)| Some(piece.1) == said).map(|(index, _)| index);
        let index = match first {
            Some((at, piece)) if Some(piece.1) == said => Some(at),
            Some((at, _)) => index.or(Some(at)),
            None => None,
        };
        let expected = index.map_or(Rect::EMPTY, |index| self.outstanding.swap_remove(index).1);
        let part = exchange.codec.decode::<P>(&bytes, expected, self.depths);
        let part = part.map_err(|reason| exchange.unusable(order_index, reason))?;
        if let Some(image) = &mut self.image {
            part.copy_to_planes::<P>(
                exchange.codec.kernels,
                image.width_px as usize,
                &mut image.colors,
                &mut image.depths,
                &mut self.wide,
            );
        }
        exchange.comm.recycle(bytes);
        exchange.report.collect_secs += exchange.comm.working_secs() - begin;
        Ok(())
    }

    /// Waits for the outstanding pieces. Returns the image at the root, or this rank's piece if
    /// there is no root.
    pub(crate) fn finish(
        mut self,
        exchange: &mut FrameExchange<'_>,
    ) -> Result<Outcome<P>, CompositeError> {
        while exchange.is_receiving() {
            if let Some((order_index, _, bytes)) = exchange.next(true)? {
                self.take(exchange, order_index, bytes)?;
            }
        }
        exchange.comm.recycle(self.wide);
        if self.root.is_some() {
            return Ok((self.image, None));
        }
        Ok((None, Some(stack_layers(self.kept))))
    }
}

/// An image with background wherever no piece will arrive. Other pixels may hold anything, because
/// pieces include their background.
fn blank<P: Composite>(
    (width_px, height_px): (u32, u32),
    depths: bool,
    pieces: &[(usize, Rect)],
    spare: Option<Image<P>>,
) -> Image<P> {
    let pixels = Rect::of_size(width_px, height_px).pixels();
    let depth_pixels = if depths { pixels } else { 0 };
    let spare = spare.filter(|image| {
        image.colors.len() == pixels
            && image.depths.len() == depth_pixels
            && image.width_px == width_px
    });
    let Some(mut image) = spare else {
        let (colors, depths) = (vec![P::EMPTY.color(); pixels], vec![1.0; depth_pixels]);
        return Image { width_px, height_px, colors, depths };
    };
    let whole = pieces.iter().fold(Rect::EMPTY, |all, piece| all.around(&piece.1));
    let covered: usize = pieces.iter().map(|piece| piece.1.pixels()).sum();
    if covered < whole.pixels() {
        // Pieces with gaps between them: fill everything, because strategies make such pieces only
        // for empty images.
        image.colors.fill(P::EMPTY.color());
        image.depths.fill(1.0);
        return image;
    }
    for y in 0..height_px {
        let row = y as usize * width_px as usize;
        let (left, right) = if y < whole.y0 || y >= whole.y1 {
            (0..width_px, 0..0)
        } else {
            (0..whole.x0, whole.x1..width_px)
        };
        for columns in [left, right] {
            let range = row + columns.start as usize..row + columns.end as usize;
            image.colors[range.clone()].fill(P::EMPTY.color());
            if depths {
                image.depths[range].fill(1.0);
            }
        }
    }
    image
}

/// Joins slices of one tile, one above the other, into a single piece.
fn stack_layers<P: Composite>(mut layers: Vec<Layer<P>>) -> Piece<P> {
    layers.retain(|layer| !layer.bounds.is_empty());
    layers.sort_by_key(|layer| layer.bounds.y0);
    let mut layers = layers.into_iter();
    let Some(mut whole) = layers.next() else { return Piece::nothing() };
    for layer in layers {
        whole.bounds = whole.bounds.around(&layer.bounds);
        whole.colors.extend_from_slice(&layer.colors);
        whole.depths.extend_from_slice(&layer.depths);
    }
    whole.into()
}
