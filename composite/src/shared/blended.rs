//! Formats without depth: merges a block of pixels of all frames in the canonical grouping while
//! they are in the first-level cache.
use super::columns::Columns;
use crate::layer::View;
use crate::pixel::Composite;
use crate::rank_order::Folding;
use crate::simd::runs::over_one_by_one;
use crate::simd::{Kernels, at_level};
use std::ops::Range;

/// Pixels of a block. Eight frames of f32 are read as streams of 4 KB; with 64 pixels (1 KB) dense
/// workloads took a quarter longer. The waiting groups still fit into the first-level cache.
pub(super) const BLOCK: usize = 256;

/// Scratch buffers of a thread that merges rows.
pub(super) struct BlendedRows<P: Composite> {
    /// Groups that wait for those behind them: the first is in the image, each other one here.
    waiting: Vec<[P::Color; BLOCK]>,
    /// The slot of the last frame of each group.
    slots: Vec<usize>,
}

/// The pixels of a frame, and their range in the block.
type SingleGroup<'a, C> = (&'a [C], Range<usize>);

impl<P: Composite> BlendedRows<P> {
    pub(super) fn new() -> Self {
        Self { waiting: Vec::new(), slots: Vec::new() }
    }

    /// Merges rows from `first_row` on into `colors`; `columns` says which frames drew where.
    pub(super) fn merge_rows(
        &mut self,
        kernels: Kernels,
        columns: &Columns<BLOCK>,
        views: &[View<'_, P>],
        rows: (u32, usize),
        colors: &mut [P::Color],
    ) {
        at_level!(
            kernels,
            simd => self.merge(columns, views, rows, colors,
                #[inline(always)]
                |others, held| <P::Color as crate::Color>::over_run(simd, others, held, false)),
            self.merge(columns, views, rows, colors, |others, held| over_one_by_one(others, held, false))
        );
    }

    /// `put_behind` composites its second argument over its first.
    #[inline(always)]
    fn merge(
        &mut self,
        columns: &Columns<BLOCK>,
        views: &[View<'_, P>],
        (first_row, width): (u32, usize),
        colors: &mut [P::Color],
        put_behind: impl Fn(&[u8], &mut [P::Color]),
    ) {
        let folding = Folding::new(views.len());
        for (row, colors) in colors.chunks_exact_mut(width).enumerate() {
            let y = first_row + row as u32;
            for (x, drawn) in columns.iter() {
                let target = &mut colors[x..(x + BLOCK).min(width)];
                if drawn.is_empty() {
                    target.fill(P::EMPTY.color());
                } else {
                    self.merge_block(&folding, views, drawn, (x, y), target, &put_behind);
                }
            }
        }
    }

    /// Merges like carries of a binary counter; slots in which no frame drew are skipped.
    #[inline(always)]
    fn merge_block(
        &mut self,
        folding: &Folding,
        views: &[View<'_, P>],
        drawn: &[usize],
        (x, y): (usize, u32),
        target: &mut [P::Color],
        put_behind: &impl Fn(&[u8], &mut [P::Color]),
    ) {
        self.slots.clear();
        // The last group, as long as it is a single frame: its pixels are not copied.
        let mut alone: Option<SingleGroup<'_, P::Color>> = None;
        for &index in drawn {
            let slot = folding.slot(index);
            while let [.., before, last] = self.slots[..]
                && merge_level(before, last) <= merge_level(last, slot)
            {
                self.merge_last(target, alone.take(), put_behind);
            }
            if let Some(alone) = alone.take() {
                self.hold(target, &alone);
            }
            let view = &views[index];
            let first = x.max(view.bounds.x0 as usize);
            let end = (x + target.len()).min(view.bounds.x1 as usize);
            alone = Some((view.row(y, first as u32, end as u32).0, first - x..end - x));
            self.slots.push(slot);
        }
        while self.slots.len() > 1 {
            self.merge_last(target, alone.take(), put_behind);
        }
        if let Some(alone) = alone {
            self.hold(target, &alone);
        }
    }

    /// Copies the last group to its waiting position.
    #[inline(always)]
    fn hold(&mut self, target: &mut [P::Color], (colors, pixels): &SingleGroup<'_, P::Color>) {
        let held = match self.slots.len() {
            0 | 1 => target,
            groups => {
                if self.waiting.len() < groups - 1 {
                    self.waiting.resize(groups - 1, [P::EMPTY.color(); BLOCK]);
                }
                &mut self.waiting[groups - 2][..target.len()]
            }
        };
        held[..pixels.start].fill(P::EMPTY.color());
        held[pixels.clone()].copy_from_slice(colors);
        held[pixels.end..].fill(P::EMPTY.color());
    }

    /// Composites the last group behind the one before it.
    #[inline(always)]
    fn merge_last(
        &mut self,
        target: &mut [P::Color],
        alone: Option<SingleGroup<'_, P::Color>>,
        put_behind: &impl Fn(&[u8], &mut [P::Color]),
    ) {
        let groups = self.slots.len();
        // Both are one group now, whose last slot is that of the latter.
        if let Some(last) = self.slots.pop()
            && let Some(before) = self.slots.last_mut()
        {
            *before = last;
        }
        let pixels = target.len();
        // The last group is here only if it is not a single frame.
        let place = (groups - 2).min(self.waiting.len());
        let (before, last) = self.waiting.split_at_mut(place);
        let before = match before.last_mut() {
            Some(before) => &mut before[..pixels],
            None => target,
        };
        match (alone, last.first()) {
            (Some((colors, part)), _) => {
                put_behind(bytemuck::cast_slice(colors), &mut before[part])
            }
            (None, Some(last)) => put_behind(bytemuck::cast_slice(&last[..pixels]), before),
            (None, None) => {}
        }
    }
}

/// The level of the balanced tree at which two slots are merged.
fn merge_level(one: usize, other: usize) -> u32 {
    usize::BITS - (one ^ other).leading_zeros()
}
