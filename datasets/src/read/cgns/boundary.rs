//! The walls of a zone, by its boundary conditions (`ZoneBC_t`).
//!
//! Source: SIDS 4.4, chapters "Boundary Conditions" and "Families".

use super::connectivity::Section;
use super::element::{Element, MIXED, NGON};
use super::tree::{Node, Tree};
use super::zone::Zone;
use crate::model::{DataArray, Values, WALL_POINTS, is_name_of_body};
use crate::read::error::Fault;
use std::collections::HashSet;
use std::ops::RangeInclusive;

/// Where a condition holds: points, or faces by their indices or numbers.
#[derive(Debug, Default)]
struct Place {
    /// From one index to another, axis by axis.
    range: Option<Vec<i64>>,
    /// Indices, those of all axes after each other.
    list: Vec<i64>,
    /// Whether they are of faces. Of the faces of a lattice, the axis that they lie across.
    faces: bool,
    across: Option<usize>,
}

/// The points of the zone's walls as field data; `None` where the file does not say which parts of
/// the border are walls. `siblings` are the nodes beside the zone, for its families.
pub(super) fn wall_points(
    zone: &Zone<'_>,
    siblings: &[Node],
    warnings: &mut Vec<String>,
) -> Result<Option<DataArray>, Fault> {
    let tree = zone.tree;
    let (mut is_known, mut places): (bool, Vec<(String, Place)>) = (false, Vec::new());
    for conditions in zone.children.iter().filter(|c| c.label == "ZoneBC_t") {
        for condition in tree.children(conditions)?.iter().filter(|c| c.label == "BC_t") {
            let children = tree.children(condition)?;
            let is_wall = is_wall(tree, condition, &children, siblings)?;
            is_known |= is_wall.is_some();
            if is_wall == Some(true) {
                places.push((condition.path.clone(), place(&children)?));
            }
        }
    }
    if !is_known {
        return Ok(None);
    }
    let count = zone.points.iter().try_fold(1u64, |a, n| a.checked_mul(*n));
    let count = count.and_then(|n| usize::try_from(n).ok()).filter(|n| u32::try_from(*n).is_ok());
    let count = count.ok_or_else(|| zone.node.fault("it has too many points"))?;
    let mut walls = Marked { of_points: vec![false; count], marked: 0, missing: 0 };
    for (path, place) in &places {
        let marked = walls.marked;
        if zone.is_structured {
            walls.mark_lattice(&zone.points, place);
        } else if place.faces {
            walls.mark_elements(zone, place)?;
        } else {
            walls.mark_points(place);
        }
        if walls.marked == marked {
            warnings.push(format!(
                "the wall `{path}` has no points or faces that the file holds: its border is taken \
                 as open; write its PointRange or PointList, and its faces as elements"
            ));
        }
    }
    if walls.missing > 0 {
        let path = &zone.node.path;
        warnings.push(format!(
            "`{path}`: walls name points beyond its own, {} times; these are left out",
            walls.missing
        ));
    }
    let ids = (0..).zip(walls.of_points).filter(|(_, is_wall)| *is_wall).map(|(id, _)| id);
    Ok(Some(DataArray::new(WALL_POINTS, 1, Values::U32(ids.collect()))))
}

/// Whether a condition is that of a wall; `None` if neither its type nor its names say so.
fn is_wall(
    tree: &Tree,
    condition: &Node,
    children: &[Node],
    siblings: &[Node],
) -> Result<Option<bool>, Fault> {
    let of_type = |kind: &str| match kind {
        k if k.starts_with("BCWall") => Some(true),
        k if k.starts_with("BC") => Some(false),
        _ => None,
    };
    if let Some(known) = of_type(condition.text()?.trim_matches('\0')) {
        return Ok(Some(known));
    }
    let mut named = is_name_of_body(&condition.name);
    for family in children.iter().filter(|c| c.label == "FamilyName_t") {
        let path = family.text()?;
        let name = path.trim_matches(['\0', '/']).rsplit('/').next().unwrap_or_default();
        let family = siblings.iter().find(|s| s.label == "Family_t" && s.name == name);
        if let Some(family) = family {
            let children = tree.children(family)?;
            if let Some(of_family) = children.iter().find(|c| c.label == "FamilyBC_t")
                && let Some(known) = of_type(of_family.text()?.trim_matches('\0'))
            {
                return Ok(Some(known));
            }
        }
        named |= is_name_of_body(name);
    }
    Ok(named.then_some(true))
}

fn place(children: &[Node]) -> Result<Place, Fault> {
    let mut place = Place::default();
    if let Some(location) = children.iter().find(|c| c.label == "GridLocation_t") {
        let location = location.text()?;
        let location = location.trim_matches('\0');
        place.faces = location != "Vertex";
        place.across =
            ["IFaceCenter", "JFaceCenter", "KFaceCenter"].iter().position(|l| *l == location);
    }
    for node in children {
        match (node.label.as_str(), node.name.as_str()) {
            ("IndexRange_t", "PointRange" | "ElementRange") => {
                place.range = Some(node.integers()?);
            }
            ("IndexArray_t", "PointList" | "ElementList") => place.list = node.integers()?,
            _ => continue,
        }
        // Files of before version 3 name elements so.
        place.faces |= node.name.starts_with("Element");
    }
    Ok(place)
}

impl Place {
    /// The range of numbers of an unstructured zone.
    fn numbers(&self) -> Option<RangeInclusive<i64>> {
        match self.range.as_deref() {
            Some(&[a, b]) => Some(a.min(b)..=a.max(b)),
            _ => None,
        }
    }
}

/// The points of walls.
struct Marked {
    of_points: Vec<bool>,
    /// How often a point was marked, and how often one that does not exist.
    marked: usize,
    missing: usize,
}

impl Marked {
    /// Marks a point by its number, from 1.
    fn mark(&mut self, number: i64) {
        let index = number.checked_sub(1).and_then(|i| usize::try_from(i).ok());
        match index.and_then(|i| self.of_points.get_mut(i)) {
            Some(is_wall) => {
                *is_wall = true;
                self.marked += 1;
            }
            None => self.missing += 1,
        }
    }

    /// Marks points by their numbers. A range goes on to the first point that does not exist, and
    /// no further: it may end anywhere.
    fn mark_points(&mut self, place: &Place) {
        place.list.iter().for_each(|id| self.mark(*id));
        if let Some(range) = place.numbers() {
            let end = (*range.end()).min(self.of_points.len() as i64 + 1);
            ((*range.start()).max(0)..=end).for_each(|id| self.mark(id));
        }
    }

    /// Marks the points of a lattice, or those of its faces.
    fn mark_lattice(&mut self, lengths: &[u64], place: &Place) {
        let axes = lengths.len();
        if let Some([from, to]) =
            place.range.as_ref().and_then(|r| r.split_at_checked(axes)).map(|(a, b)| [a, b])
            && to.len() == axes
        {
            self.mark_box(lengths, from, to, place);
        }
        for index in place.list.chunks_exact(axes) {
            self.mark_box(lengths, index, index, place);
        }
    }

    /// Marks from one index to another. Those of faces have one point more along all axes but the
    /// one that they lie across.
    fn mark_box(&mut self, lengths: &[u64], from: &[i64], to: &[i64], place: &Place) {
        let length = |a: usize| i64::try_from(lengths[a]).unwrap_or(i64::MAX);
        let is_end = |a: &usize| from[*a] == to[*a] && (from[*a] == 1 || from[*a] == length(*a));
        let across = place.across.or_else(|| (0..lengths.len()).find(is_end));
        let mut ends = [[0u64; 2]; 3];
        for a in 0..lengths.len() {
            let more = i64::from(place.faces && across != Some(a));
            let (low, high) = (from[a].min(to[a]), from[a].max(to[a]).saturating_add(more));
            if low < 1 || high > length(a) {
                self.missing += 1;
            }
            ends[a] = [low.max(1) as u64 - 1, high.clamp(0, length(a)) as u64];
        }
        ends[lengths.len()..].fill([0, 1]);
        let [x, y, z] = ends.map(|[low, high]| low..high);
        let rows = [lengths[0], lengths.get(1).copied().unwrap_or(1)];
        for k in z {
            for j in y.clone() {
                for i in x.clone() {
                    let index = i + rows[0] * (j + rows[1] * k);
                    if let Some(is_wall) = self.of_points.get_mut(index as usize) {
                        *is_wall = true;
                        self.marked += 1;
                    }
                }
            }
        }
    }

    /// Marks the corners of elements of an unstructured zone.
    fn mark_elements(&mut self, zone: &Zone<'_>, place: &Place) -> Result<(), Fault> {
        let list: HashSet<i64> = place.list.iter().copied().collect();
        let numbers = place.numbers();
        let holds = |n: i64| list.contains(&n) || numbers.as_ref().is_some_and(|r| r.contains(&n));
        for node in zone.children.iter().filter(|c| c.label == "Elements_t") {
            let section = Section::new(zone.tree, node)?;
            let [first, last] = section.range;
            let meets = numbers.as_ref().is_some_and(|r| *r.start() <= last && first <= *r.end());
            if !meets && !list.iter().any(|n| (first..=last).contains(n)) {
                continue;
            }
            match section.kind {
                NGON => {
                    let lists = section.lists()?;
                    let of_wall = (first..).zip(lists.iter()).filter(|(n, _)| holds(*n));
                    of_wall.for_each(|(_, face)| face.iter().for_each(|id| self.mark(*id)));
                }
                MIXED => {
                    let values = section.connectivity()?;
                    let (mut rest, mut number) = (&values[..], first);
                    while let [kind, after @ ..] = rest {
                        let nodes = Element::of(*kind).map(|e| e.nodes);
                        let split = nodes.and_then(|n| after.split_at_checked(n));
                        let Some((nodes, next)) = split else { break };
                        if holds(number) {
                            nodes.iter().for_each(|id| self.mark(*id));
                        }
                        (rest, number) = (next, number + 1);
                    }
                }
                kind => {
                    let Some(element) = Element::of(kind) else { continue };
                    let values = section.connectivity()?;
                    let elements = (first..).zip(values.chunks_exact(element.nodes.max(1)));
                    for (_, nodes) in elements.filter(|(n, _)| holds(*n)) {
                        nodes.iter().for_each(|id| self.mark(*id));
                    }
                }
            }
        }
        Ok(())
    }
}
