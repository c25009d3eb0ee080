//! Solutions: arrays at the points or in the cells of a zone.

use super::Notes;
use super::times::Pointers;
use super::tree::Node;
use super::zone::{Zone, core, rind};
use crate::model::{Attributes, DataArray};
use crate::read::error::Fault;

/// The arrays of a zone that hold at a step.
pub(super) fn arrays(
    zone: &Zone<'_>,
    pointers: &Pointers,
    notes: &mut Notes,
) -> Result<Attributes, Fault> {
    let mut out = Attributes::default();
    let is_solution = |n: &&Node| n.label == "FlowSolution_t";
    for name in &pointers.solutions {
        if !zone.children.iter().filter(is_solution).any(|n| n.name == *name) {
            return Err(zone.node.fault(format!("it has no solution `{name}`")));
        }
    }
    for node in zone.children.iter().filter(is_solution) {
        let of_other_step =
            pointers.of_steps.contains(&node.name) && !pointers.solutions.contains(&node.name);
        if !of_other_step {
            solution(zone, node, &mut out, notes)?;
        }
    }
    Ok(out)
}

fn solution(
    zone: &Zone<'_>,
    node: &Node,
    out: &mut Attributes,
    notes: &mut Notes,
) -> Result<(), Fault> {
    let children = zone.tree.children(node)?;
    let arrays = || children.iter().filter(|c| c.label == "DataArray_t");
    let location = children.iter().find(|c| c.label == "GridLocation_t");
    let location = location.map_or(Ok("Vertex".to_string()), Node::text)?;
    let (lengths, list) = match location.as_str() {
        "Vertex" => (&zone.points, &mut out.point),
        "CellCenter" => (&zone.cells, &mut out.cell),
        other => {
            let count = arrays().count();
            let path = &node.path;
            notes.warnings.push(format!("`{path}` left out: {count} arrays located at {other}"));
            return Ok(());
        }
    };
    let is_part = |c: &&Node| c.label == "IndexRange_t" || c.label == "IndexArray_t";
    if let Some(part) = children.iter().find(is_part) {
        let path = &node.path;
        notes.warnings.push(format!("`{path}` left out: it is given on a part ({})", part.name));
        return Ok(());
    }
    let rind = rind(&children, lengths.len())?;
    notes.rind += usize::from(rind.iter().any(|r| *r != [0, 0]));
    let units = zone.units.at(&children)?;
    for array in arrays() {
        // The names of arrays without values are kept by some programs.
        if array.shape()?.is_none() {
            continue;
        }
        if !array.is_number()? {
            notes.warnings.push(format!("`{}` left out: it holds no real numbers", array.path));
            continue;
        }
        let values = core(array, lengths, &rind)?;
        let values = match units.conversion(zone.tree, array, &mut notes.units)? {
            Some(conversion) => conversion.of(values),
            None => values,
        };
        let mut name = array.name.clone();
        if list.iter().any(|a: &DataArray| a.name == name) {
            name = format!("{name} ({})", node.name);
            notes.warnings.push(format!("a second `{}` is called `{name}`", array.name));
        }
        list.push(DataArray::new(name, 1, values));
    }
    Ok(())
}
