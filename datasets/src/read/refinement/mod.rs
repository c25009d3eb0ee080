//! Levels of refinement: cells that boxes of a finer level cover.

mod box_tree;
mod index_box;

use crate::model::{DataArray, ImageData, Values, extent_dims};
pub(super) use box_tree::BoxTree;
pub(super) use index_box::IndexBox;

/// `vtkGhostType` bit of cells that are covered by finer ones (vtkDataSetAttributes.h).
const REFINED: u8 = 8;
const GHOSTS: &str = "vtkGhostType";

/// Marks the cells of a box that boxes of the finer level cover, which are in its numbers. Marks
/// that the cells have stay. The image has the cells of the box.
pub(super) fn mark_refined(data: &mut ImageData, cells: &IndexBox, finer: &BoxTree) {
    let dims = extent_dims(data.extent).map(|d| d.saturating_sub(1).max(1));
    let mut refined = vec![false; dims.iter().product()];
    finer.visit(cells, &mut |both| {
        let from = |a: usize| (both.low[a] - cells.low[a]) as usize;
        let to = |a: usize| (both.high[a] - cells.low[a]) as usize;
        for k in from(2)..=to(2) {
            for j in from(1)..=to(1) {
                let row = dims[0] * (j + dims[1] * k);
                refined[row + from(0)..=row + to(0)].fill(true);
            }
        }
    });
    if !refined.contains(&true) {
        return;
    }
    let before = data.attributes.cell.iter().position(|a| a.name == GHOSTS && a.components == 1);
    let before = before.map(|at| data.attributes.cell.remove(at));
    let mark_of = |i: usize| {
        let before = before.as_ref().filter(|a| i < a.tuples()).map_or(0, |a| a.get(i, 0) as u8);
        before | if refined[i] { REFINED } else { 0 }
    };
    let marks = (0..refined.len()).map(mark_of).collect();
    data.attributes.cell.push(DataArray::new(GHOSTS, 1, Values::U8(marks)));
}
