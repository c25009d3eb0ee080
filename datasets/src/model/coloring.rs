//! Chooses the array that colours a surface, a line or a point set.

use super::{Attributes, DataArray, Dataset, ModelError, Values};

/// An array and the component to use. Written as `pressure`, `velocity` (length of the vector),
/// `velocity:x` or `velocity:0`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ColorBy {
    /// Name of the array.
    pub name: String,
    /// The component; `None` is the length of the tuple.
    pub component: Option<usize>,
    /// True when the array belongs to points, false when it belongs to cells.
    pub per_point: bool,
}

impl ColorBy {
    /// Finds `name` in `data` (and in its blocks, if any), point arrays first. A name that contains
    /// a colon is tried unsplit first.
    pub fn find(data: &Dataset, name: &str) -> Result<ColorBy, ModelError> {
        let leaves = data.leaves();
        let attributes: Vec<&Attributes> = leaves.iter().filter_map(|d| d.attributes()).collect();
        let lookup = |name: &str| {
            let point = attributes.iter().find_map(|a| a.point_array(name)).map(|a| (a, true));
            point.or_else(|| attributes.iter().find_map(|a| a.cell_array(name)).map(|a| (a, false)))
        };
        if let Some((_, per_point)) = lookup(name) {
            return Ok(ColorBy { name: name.into(), component: None, per_point });
        }
        if let Some((array_name, suffix)) = name.rsplit_once(':')
            && let Some((array, per_point)) = lookup(array_name)
        {
            let component = match suffix.to_ascii_lowercase().as_str() {
                "magnitude" => None,
                "x" => Some(0),
                "y" => Some(1),
                "z" => Some(2),
                digits => Some(digits.parse().unwrap_or(usize::MAX)),
            };
            if component.is_some_and(|c| c >= array.components) {
                return Err(ModelError::NoComponent {
                    name: array_name.to_string(),
                    asked: name.into(),
                    components: array.components,
                });
            }
            return Ok(ColorBy { name: array_name.into(), component, per_point });
        }
        let mut names: Vec<String> = Vec::new();
        for a in &attributes {
            for (arrays, of) in [(&a.point, "points"), (&a.cell, "cells")] {
                for array in arrays {
                    let entry = format!("`{}` ({of})", array.name);
                    if !names.contains(&entry) {
                        names.push(entry);
                    }
                }
            }
        }
        let mut available =
            if names.is_empty() { "no arrays at all".into() } else { names.join(", ") };
        let arrays = attributes.iter().flat_map(|a| a.point.iter().chain(&a.cell));
        if let Some(near) = most_like(name, arrays.map(|a| a.name.as_str())) {
            available = format!("{available}; did you mean `{near}`?");
        }
        Err(ModelError::NoArray { name: name.into(), kind: data.kind(), available })
    }

    /// The array in `attributes`, if it exists and has the component.
    pub fn array<'a>(&self, attributes: &'a Attributes) -> Option<&'a DataArray> {
        let a = if self.per_point {
            attributes.point_array(&self.name)
        } else {
            attributes.cell_array(&self.name)
        };
        a.filter(|a| self.component.is_none_or(|c| c < a.components))
    }

    /// Value of tuple `i` of an array from [`Self::array`].
    pub fn value(&self, array: &DataArray, i: usize) -> f32 {
        match self.component {
            Some(c) => array.get(i, c) as f32,
            None => array.magnitude(i) as f32,
        }
    }

    /// True when the values are already colours: 8 bits, three or four components (VTK's "direct
    /// scalars").
    pub fn is_direct_color(&self, array: &DataArray) -> bool {
        self.component.is_none()
            && matches!(array.values, Values::U8(_))
            && matches!(array.components, 3 | 4)
    }
}

/// Tuple `i` of an 8-bit sRGB(A) array as linear RGBA (IEC 61966-2-1).
pub(crate) fn linear_from_srgb8(array: &DataArray, i: usize) -> [f32; 4] {
    std::array::from_fn(|c| {
        if c >= array.components {
            return 1.0;
        }
        let v = (array.get(i, c) / 255.0) as f32;
        if c == 3 { v } else { linear_from_srgb(v) }
    })
}

/// The sRGB decoding curve for one channel in 0..=1.
pub(crate) fn linear_from_srgb(v: f32) -> f32 {
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// The name that is most like a name that is not there, if one is: it has other capitals, or few
/// letters differ.
fn most_like<'a>(name: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let name = name.to_lowercase();
    let likeness = |other: &str| strsim::jaro_winkler(&name, &other.to_lowercase());
    names
        .map(|other| (likeness(other), other))
        .filter(|(likeness, _)| *likeness > 0.8)
        // The first of equals, so that the order of arrays decides.
        .reduce(|a, b| if b.0 > a.0 { b } else { a })
        .map(|(_, other)| other)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misspelt_names_find_the_one_that_was_meant() {
        let names = ["Temperature", "rho", "velocity", "Density"];
        let near = |name| most_like(name, names.into_iter());
        assert_eq!(near("RHO"), Some("rho"));
        assert_eq!(near("temprature"), Some("Temperature"));
        assert_eq!(near("density"), Some("Density"));
        assert_eq!(near("pressure"), None);
    }
}
