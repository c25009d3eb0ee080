//! Boxes of cells by their numbers along the axes.

/// Cells from `low` to `high`, both included; axes that the data do not have are 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::read) struct IndexBox {
    pub(in crate::read) low: [i64; 3],
    pub(in crate::read) high: [i64; 3],
}

impl IndexBox {
    /// The cells of a level that is coarser by `ratio`.
    pub(in crate::read) fn coarsened(&self, ratio: i64) -> IndexBox {
        let down = |v: [i64; 3]| v.map(|i| i.div_euclid(ratio.max(1)));
        IndexBox { low: down(self.low), high: down(self.high) }
    }
    pub(in crate::read) fn intersection(&self, other: &IndexBox) -> Option<IndexBox> {
        let low = [0, 1, 2].map(|a| self.low[a].max(other.low[a]));
        let high = [0, 1, 2].map(|a| self.high[a].min(other.high[a]));
        (0..3).all(|a| low[a] <= high[a]).then_some(IndexBox { low, high })
    }
    pub(in crate::read) fn contains(&self, other: &IndexBox) -> bool {
        self.intersection(other) == Some(*other)
    }
    /// Number of cells; `None` if it does not fit.
    pub(in crate::read) fn count(&self) -> Option<u64> {
        (0..3).try_fold(1u64, |n, a| {
            let along = self.high[a].checked_sub(self.low[a])?.checked_add(1)?;
            n.checked_mul(u64::try_from(along).ok()?)
        })
    }
}
