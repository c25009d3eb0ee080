//! Times: `BaseIterativeData_t` lists them, `ZoneIterativeData_t` names the coordinates and
//! solutions of each.

use super::tree::{Node, Tree};
use crate::read::error::Fault;

/// One of the times of a base.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    pub(super) index: usize,
    /// Number of times.
    pub(super) count: usize,
    pub(super) time: f64,
}

/// The times of a base; without times, the numbers of its iterations; none if it has neither.
pub(super) fn of_base(tree: &Tree, children: &[Node]) -> Result<Vec<f64>, Fault> {
    let Some(node) = children.iter().find(|c| c.label == "BaseIterativeData_t") else {
        return Ok(Vec::new());
    };
    let arrays = tree.children(node)?;
    let named = |name: &str| arrays.iter().find(|a| a.name == name);
    let Some(array) = named("TimeValues").or(named("IterationValues")) else {
        return Ok(Vec::new());
    };
    let times = array.numbers()?;
    match times.iter().find(|t| !t.is_finite()) {
        Some(t) => Err(array.fault(format!("a time is {t}"))),
        None => Ok(times),
    }
}

/// The names that one zone has for a step.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Pointers {
    /// The coordinates of the step.
    pub(super) grid: Option<String>,
    /// The solutions of the step.
    pub(super) solutions: Vec<String>,
    /// All solutions of any step: others hold at every time.
    pub(super) of_steps: Vec<String>,
}

impl Step {
    /// The zones that exist at this step, if the base says so.
    pub(super) fn zones(
        self,
        tree: &Tree,
        children: &[Node],
    ) -> Result<Option<Vec<String>>, Fault> {
        let Some(node) = children.iter().find(|c| c.label == "BaseIterativeData_t") else {
            return Ok(None);
        };
        let arrays = tree.children(node)?;
        let Some(pointers) = arrays.iter().find(|a| a.name == "ZonePointers") else {
            return Ok(None);
        };
        let names = pointers.texts()?;
        if names.is_empty() || names.len() % self.count != 0 {
            let what = format!("{} names of zones for {} times", names.len(), self.count);
            return Err(pointers.fault(what));
        }
        let each = names.len() / self.count;
        let of_step = &names[self.index * each..(self.index + 1) * each];
        let is_name = |n: &&String| !n.is_empty() && *n != "Null";
        Ok(Some(of_step.iter().filter(is_name).map(|n| last(n)).collect()))
    }

    /// The names of a zone for this step.
    pub(super) fn pointers(self, tree: &Tree, zone: &[Node]) -> Result<Pointers, Fault> {
        let mut out = Pointers::default();
        let Some(node) = zone.iter().find(|c| c.label == "ZoneIterativeData_t") else {
            return Ok(out);
        };
        for array in tree.children(node)? {
            let is_grid = array.name == "GridCoordinatesPointers";
            let of_solutions = array.name.starts_with("FlowSolution");
            if !array.name.ends_with("Pointers") || !(is_grid || of_solutions) {
                continue;
            }
            let names = array.texts()?;
            if names.len() != self.count {
                return Err(array.fault(format!("{} names for {} times", names.len(), self.count)));
            }
            let name = last(&names[self.index]);
            let exists = !name.is_empty() && name != "Null";
            if is_grid {
                out.grid = exists.then_some(name);
            } else {
                out.solutions.extend(exists.then_some(name));
                out.of_steps.extend(names.iter().map(|n| last(n)));
            }
        }
        Ok(out)
    }
}

/// The name of a node at the end of a path.
fn last(path: &str) -> String {
    path.rsplit('/').next().unwrap_or(path).trim().to_string()
}
