//! Arrays on the points or cells of a topology.

use super::Domain;
use crate::node::{Node, Numbers};
use datasets::model::{DataArray, Dataset, Values};

/// The array that marks copies of other ranks' cells, and hidden cells (vtkDataSetAttributes.h).
const GHOSTS: &str = "vtkGhostType";
/// What Ascent calls such an array: 0 for a cell of this rank, 1 for a copy.
const GHOSTS_OF_ASCENT: &str = "ascent_ghosts";

/// An array where the simulation has it.
#[derive(Debug, Clone)]
pub struct Field<'a> {
    /// Its name.
    pub name: String,
    /// Whether it belongs to points; else to cells.
    pub per_point: bool,
    /// One array for each component, all of the same length.
    pub components: Vec<Numbers<'a>>,
}

/// The fields of a topology. What cannot be read is left out with a warning.
pub fn fields<'a>(
    domain: &Domain<'_, 'a>,
    topology: &str,
    warnings: &mut Vec<String>,
) -> Vec<Field<'a>> {
    let mut all = Vec::new();
    for (name, node) in domain.node.get("fields").map_or(&[][..], Node::children) {
        if node.text_at("topology").is_some_and(|of| of != topology) {
            continue;
        }
        match field(name, node) {
            Ok(mut field) => {
                let path = format!("{name}/attribute_type");
                if domain.metadata.and_then(|m| m.text_at(&path)) == Some("Ghosts") {
                    field.name = GHOSTS.to_owned();
                }
                all.push(field);
            }
            Err(why) => warnings.push(format!("{}/fields/{name}: left out: {why}", domain.path)),
        }
    }
    all
}

fn field<'a>(name: &str, node: &Node<'a>) -> Result<Field<'a>, String> {
    let per_point = match node.text_at("association") {
        Some("vertex") => true,
        Some("element") => false,
        Some(other) => return Err(format!("association `{other}`: give `vertex` or `element`")),
        None if node.get("basis").is_some() => {
            return Err("it has a basis of finite elements: give values at vertices".into());
        }
        None => return Err("it has no association".into()),
    };
    let values = node.get("values").ok_or("it has no values")?;
    let components = match values {
        Node::Numbers(numbers) => vec![*numbers],
        Node::Children(children) => {
            let numbers = children.iter().map(|(_, c)| c.numbers());
            numbers.collect::<Option<Vec<_>>>().ok_or("a component is no array of numbers")?
        }
        _ => return Err("its values are no numbers".into()),
    };
    let Some(first) = components.first() else { return Err("it has no components".into()) };
    if components.iter().any(|c| c.len() != first.len()) {
        let lengths: Vec<String> = components.iter().map(|c| c.len().to_string()).collect();
        return Err(format!("its components have {} numbers", lengths.join(", ")));
    }
    Ok(Field { name: name.to_owned(), per_point, components })
}

impl<'a> Field<'a> {
    /// Whether it marks cells or points that are not to be drawn.
    pub fn marks_ghosts(&self) -> bool {
        [GHOSTS, GHOSTS_OF_ASCENT].contains(&self.name.as_str())
    }

    /// The field and the component that `wanted` names: `pressure`, `velocity` (the length of the
    /// vector), `velocity:x` or `velocity:0`, as [`ColorBy`](datasets::model::ColorBy) has it.
    pub fn find<'f>(
        fields: &'f [Field<'a>],
        wanted: &str,
    ) -> Option<(&'f Field<'a>, Option<usize>)> {
        let by_name = |name: &str| fields.iter().find(|f| f.name == name);
        if let Some(field) = by_name(wanted) {
            return Some((field, (field.components.len() == 1).then_some(0)));
        }
        let (name, component) = wanted.rsplit_once(':')?;
        let component = match component {
            "magnitude" => None,
            "x" => Some(0),
            "y" => Some(1),
            "z" => Some(2),
            digits => Some(digits.parse().ok()?),
        };
        let field = by_name(name)?;
        component.is_none_or(|c| c < field.components.len()).then_some((field, component))
    }

    /// The value of tuple `i`: of a component, or the length. Panics when out of range.
    #[inline]
    pub fn value(&self, component: Option<usize>, i: usize) -> f64 {
        match component {
            Some(c) => self.components[c].get_f64(i),
            None => self.components.iter().map(|c| c.get_f64(i).powi(2)).sum::<f64>().sqrt(),
        }
    }

    /// Adds a copy to the arrays of `data`.
    pub(super) fn copy_to(&self, data: &mut Dataset) {
        let Some(attributes) = data.attributes_mut() else { return };
        let array = match (self.name.as_str(), &self.components[..]) {
            (GHOSTS_OF_ASCENT, [flags]) => {
                let flags = (0..flags.len()).map(|i| u8::from(flags.get_f64(i) != 0.0)).collect();
                DataArray::new(GHOSTS, 1, Values::U8(flags))
            }
            (GHOSTS, [flags]) => {
                let flags = (0..flags.len()).map(|i| flags.get_f64(i) as u8).collect();
                DataArray::new(GHOSTS, 1, Values::U8(flags))
            }
            (name, [numbers]) => DataArray::new(name, 1, numbers.to_values()),
            (name, components) => {
                let count = components[0].len();
                let tuples = (0..count).flat_map(|i| components.iter().map(move |c| c.get_f64(i)));
                DataArray::new(name, components.len(), Values::F64(tuples.collect()))
            }
        };
        if self.per_point { attributes.point.push(array) } else { attributes.cell.push(array) }
    }
}
