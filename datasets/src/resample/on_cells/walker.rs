//! Follows lines from cell to cell.

use super::CellField;
use super::beside_hidden;
use super::blend::{Mean, Share};
use super::cell::PreparedCell;
use crate::resample::mesh::{HIDDEN, OUTSIDE, WALL};
use glam::DVec3;

/// Places for prepared cells: a power of two. Rays that are near each other pass the same cells,
/// a few hundred each.
const KEPT: usize = 1024;
/// Cells that are looked at for one that a place is in, at most.
const MOST_NEAR: usize = 200;
/// Cells that a line passes on the way back to where it is, at most.
const MOST_CELLS: usize = 1_000_000;

/// Where a line enters a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entry {
    /// Distance along the line.
    pub distance: f64,
    /// The cell that it enters.
    pub cell: u32,
    /// What it comes from.
    pub from: Beyond,
}

/// What lies beyond the face through which a line leaves a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Beyond {
    /// Another cell.
    Cell(u32),
    /// No cell with which it shares the face.
    Outside,
    /// A body, where the walls of the mesh are known.
    Wall,
    /// A cell that the solver hides.
    Hidden,
}

impl Beyond {
    fn of(number: u32) -> Beyond {
        match number {
            OUTSIDE => Beyond::Outside,
            WALL => Beyond::Wall,
            HIDDEN => Beyond::Hidden,
            cell => Beyond::Cell(cell),
        }
    }
}

/// Follows lines through the cells of a field, one line at a time. It keeps the cells that it
/// passed last, prepared for further lines; what it returns does not depend on them.
pub struct CellWalker<'a> {
    field: &'a CellField,
    kept: Vec<Option<Box<(u32, PreparedCell)>>>,
    shares: Vec<Share>,
    mean: Mean,
}

impl<'a> CellWalker<'a> {
    pub(super) fn new(field: &'a CellField, mean: Mean) -> CellWalker<'a> {
        let kept = std::iter::repeat_with(|| None).take(KEPT).collect();
        CellWalker { field, kept, shares: Vec::with_capacity(1), mean }
    }

    fn slot(&mut self, cell: u32) -> usize {
        // Fibonacci hashing: rows of a lattice must not share a slot.
        let slot = (cell.wrapping_mul(0x9e37_79b9) >> 16) as usize % KEPT;
        match &mut self.kept[slot] {
            Some(kept) if kept.0 == cell => {}
            Some(kept) => {
                kept.0 = cell;
                kept.1.prepare(self.field, cell as usize, self.mean);
            }
            empty => {
                let mut new = Box::new((cell, PreparedCell::default()));
                new.1.prepare(self.field, cell as usize, self.mean);
                *empty = Some(new);
            }
        }
        slot
    }

    fn prepared(&mut self, cell: u32) -> &PreparedCell {
        let slot = self.slot(cell);
        match &self.kept[slot] {
            Some(kept) => &kept.1,
            None => unreachable!("the slot was filled"),
        }
    }

    /// The first cell that the line from `at` in `direction`, of length one, is in or enters within
    /// `most`. `slack` is how far `at` may be beyond the face that it left through: faces within
    /// this distance are entered, and not left. `None` when there is none.
    ///
    /// A line that is in a cell already, as where blocks overlap, gets this cell at distance 0.
    pub fn enter(&mut self, at: DVec3, direction: DVec3, most: f64, slack: f64) -> Option<Entry> {
        let field = self.field;
        let passage =
            field.border.first_passage(&field.mesh, at, direction, f64::INFINITY, slack)?;
        let found = if passage.inwards {
            Entry {
                distance: passage.distance.max(0.0),
                cell: passage.cell,
                from: Beyond::of(passage.beyond),
            }
        } else {
            // The line leaves cells before it enters any, so it is inside: back to where it is.
            let (distance, cell, beyond) = self.back(at, direction, passage.distance, passage.cell);
            Entry { distance, cell, from: beyond }
        };
        (found.distance <= most).then_some(found)
    }

    /// From the face at `distance` back through the cells to `at`, or to where they end before it.
    fn back(
        &mut self,
        at: DVec3,
        direction: DVec3,
        distance: f64,
        mut cell: u32,
    ) -> (f64, u32, Beyond) {
        let mut from_start = distance;
        let mut from = Beyond::Outside;
        for _ in 0..MOST_CELLS {
            let place = at + direction * from_start;
            let Some((length, beyond)) = self.leave(cell, place, -direction, from) else { break };
            from_start -= length;
            from = Beyond::Cell(cell);
            match beyond {
                Beyond::Cell(next) if from_start > 0.0 => cell = next,
                beyond => return (from_start.max(0.0), cell, beyond),
            }
        }
        (from_start.max(0.0), cell, Beyond::Outside)
    }

    /// The distance at which the line from `at`, in the cell, in `direction` leaves it (negative in
    /// one that is inside out and overlaps the cell that it comes from), and what
    /// lies beyond. `None` when it passes no face of the cell outwards: rounding at an edge. `from`
    /// is where it came from: at an edge of a bent face, it does not go back there at once.
    pub fn leave(
        &mut self,
        cell: u32,
        at: DVec3,
        direction: DVec3,
        from: Beyond,
    ) -> Option<(f64, Beyond)> {
        let from = match from {
            Beyond::Cell(cell) => cell,
            Beyond::Outside => OUTSIDE,
            Beyond::Wall => WALL,
            Beyond::Hidden => HIDDEN,
        };
        let (distance, beyond) = self.prepared(cell).way_out(at, direction, from)?;
        Some((distance, Beyond::of(beyond)))
    }

    /// Whether a wall without thickness is between two cells. Both end there ([`Beyond::Wall`]),
    /// and a line that leaves one of them enters the other at once.
    pub fn has_baffle(&self, one: u32, other: u32) -> bool {
        self.field.mesh.has_baffle(one, other)
    }

    /// Whether the line from `at` in `direction`, of length one, is in a body somewhere within
    /// `most`, where it is outside all cells. No face tells of a body that fills the span of the
    /// mesh, along which the line runs. False where the walls of the mesh are not known.
    pub fn passes_body(&self, at: DVec3, direction: DVec3, most: f64) -> bool {
        let CellField { mesh, bodies, .. } = self.field;
        bodies.as_ref().is_some_and(|b| b.meet(mesh, at, direction, most))
    }

    /// The pieces, from and to, of the line from `at` in `direction`, of length one, up to `length`
    /// that lie in no hidden cell. The line is one outside the cells with values; `ends_hidden`
    /// says whether it begins and ends at a hidden cell. `slack` is how far `at` may be beyond a
    /// face.
    pub fn beside_hidden(
        &self,
        at: DVec3,
        direction: DVec3,
        length: f64,
        slack: f64,
        ends_hidden: [bool; 2],
    ) -> Vec<[f64; 2]> {
        let CellField { mesh, hidden, .. } = self.field;
        beside_hidden::pieces(hidden, mesh, at, direction, [length, slack], ends_hidden)
    }

    /// A cell that a place is in, of those that are near a cell: its neighbours, and theirs.
    pub fn near(&mut self, cell: u32, at: DVec3) -> Option<u32> {
        let mut seen = vec![cell];
        let mut next = 0;
        while next < seen.len() && seen.len() < MOST_NEAR {
            let prepared = self.prepared(seen[next]);
            if prepared.contains(at) {
                return Some(seen[next]);
            }
            let more: Vec<u32> = prepared.neighbours().collect();
            seen.extend(more.into_iter().filter(|c| !seen.contains(c)).collect::<Vec<u32>>());
            next += 1;
        }
        None
    }

    /// Value and gradient at a place in a cell; NaN in a cell without values.
    pub fn sample(&mut self, cell: u32, at: DVec3) -> (f64, DVec3) {
        let slot = self.slot(cell);
        let CellWalker { kept, shares: of_corners, .. } = self;
        let Some(kept) = &kept[slot] else { unreachable!("the slot was filled") };
        kept.1.sample(at, of_corners)
    }

    /// Diagonal of a cell's box.
    pub fn size(&mut self, cell: u32) -> f64 {
        self.prepared(cell).size
    }
}
