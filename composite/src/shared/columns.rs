//! Which frames drew in which blocks of a row.
use crate::layer::View;
use crate::pixel::Composite;
use std::ops::Range;

/// The frames that drew in each block (of `BLOCK` pixels) of a row, in their order; only those need
/// to be read.
#[derive(Default)]
pub(super) struct Columns<const BLOCK: usize> {
    /// For each block, the range of its frames in `drawn`.
    blocks: Vec<Range<usize>>,
    drawn: Vec<usize>,
    /// Frames of the row, and their columns.
    here: Vec<(usize, Range<usize>)>,
}

impl<const BLOCK: usize> Columns<BLOCK> {
    /// Finds the frames of row `y`, and returns the row up to `end_row` before which this does not
    /// change.
    pub(super) fn look_up<P: Composite>(
        &mut self,
        views: &[View<'_, P>],
        width: usize,
        y: u32,
        end_row: u32,
    ) -> u32 {
        let mut end = end_row;
        self.here.clear();
        for (index, view) in views.iter().enumerate().filter(|(_, view)| !view.bounds.is_empty()) {
            if y < view.bounds.y0 {
                end = end.min(view.bounds.y0);
            } else if y < view.bounds.y1 {
                end = end.min(view.bounds.y1);
                self.here.push((index, view.bounds.x0 as usize..view.bounds.x1 as usize));
            }
        }
        self.blocks.clear();
        self.drawn.clear();
        for x in (0..width).step_by(BLOCK) {
            let first = self.drawn.len();
            let drawn = self
                .here
                .iter()
                .filter(|(_, columns)| columns.start < x + BLOCK && x < columns.end);
            self.drawn.extend(drawn.map(|(index, _)| index));
            self.blocks.push(first..self.drawn.len());
        }
        end
    }

    /// The first column of each block, and the indices of its frames.
    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, &[usize])> {
        self.blocks
            .iter()
            .enumerate()
            .map(|(block, drawn)| (BLOCK * block, &self.drawn[drawn.clone()]))
    }
}
