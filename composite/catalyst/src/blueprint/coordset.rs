//! Coordinates: uniform, rectilinear, or one position for each point.

use super::BlueprintError;
use crate::node::{Node, Numbers};
use datasets::model::{Points, ScalarType};
use rt_core::glam::DVec3;

/// Names of the axes, in the order of Blueprint's i, j, k.
const AXES: [&str; 3] = ["x", "y", "z"];

/// A coordset of uniform points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Uniform {
    /// Points per axis; 1 along axes that the simulation does not have.
    pub(super) dims: [usize; 3],
    pub(super) origin: DVec3,
    pub(super) spacing: DVec3,
}

/// The type of a coordset.
pub(super) fn kind<'n>(path: &str, node: &'n Node<'_>) -> Result<&'n str, BlueprintError> {
    let at = format!("{path}/type");
    node.text_at("type").ok_or_else(|| {
        BlueprintError::missing(&at, "the text `uniform`, `rectilinear` or `explicit`")
    })
}

/// Counts at `names` below `path`: points or cells along axes; 1 for axes that are not there.
pub(super) fn counts(
    path: &str,
    node: &Node<'_>,
    names: [&str; 3],
) -> Result<[Option<usize>; 3], BlueprintError> {
    let mut all = [None; 3];
    for (count, name) in all.iter_mut().zip(names) {
        let Some(child) = node.get(name) else { continue };
        let number = child.i64().and_then(|n| usize::try_from(n).ok());
        // VTK's extents are 32-bit integers, and so are those of `ImageData`.
        let number = number.filter(|n| *n < i32::MAX as usize);
        let at = format!("{path}/{name}");
        *count = Some(number.ok_or_else(|| BlueprintError::missing(&at, "a count below 2^31"))?);
    }
    Ok(all)
}

/// Reads a uniform coordset.
pub(super) fn uniform(path: &str, node: &Node<'_>) -> Result<Uniform, BlueprintError> {
    let Some(dims) = node.get("dims") else {
        return Err(BlueprintError::missing(&format!("{path}/dims"), "the numbers of points"));
    };
    let dims = counts(&format!("{path}/dims"), dims, ["i", "j", "k"])?;
    if dims.iter().all(Option::is_none) {
        return Err(BlueprintError::missing(&format!("{path}/dims/i"), "a number of points"));
    }
    let along = |group: &str, names: [&str; 3], default: f64| {
        let mut all = DVec3::splat(default);
        for (axis, name) in names.into_iter().enumerate() {
            let Some(child) = node.get(group).and_then(|g| g.get(name)) else { continue };
            let value = child.f64().filter(|v| v.is_finite());
            let at = format!("{path}/{group}/{name}");
            all[axis] = value.ok_or_else(|| BlueprintError::missing(&at, "a finite number"))?;
        }
        Ok(all)
    };
    let spacing = along("spacing", ["dx", "dy", "dz"], 1.0)?;
    if let Some(axis) = (0..3).find(|&a| spacing[a] <= 0.0 && dims[a].unwrap_or(1) > 1) {
        let at = format!("{path}/spacing/d{}", AXES[axis]);
        let value = spacing[axis].to_string();
        return Err(BlueprintError::unsupported(&at, &value, "give a positive number"));
    }
    let dims = dims.map(|n| n.unwrap_or(1));
    Ok(Uniform { dims, origin: along("origin", AXES, 0.0)?, spacing })
}

/// Arrays of a coordset along x, y and z; those of later axes may be missing. Coordinates of other
/// systems are refused by name.
pub(super) fn values<'a>(
    path: &str,
    node: &Node<'a>,
) -> Result<[Option<Numbers<'a>>; 3], BlueprintError> {
    let at = format!("{path}/values");
    let Some(values) = node.get("values") else {
        return Err(BlueprintError::missing(&at, "arrays of coordinates"));
    };
    if let Some((other, _)) = values.children().iter().find(|(n, _)| !AXES.contains(&n.as_str())) {
        let cure = "give Cartesian coordinates x, y and z";
        return Err(BlueprintError::unsupported(&at, other, cure));
    }
    let mut all = [None; 3];
    for (found, name) in all.iter_mut().zip(AXES) {
        let Some(child) = values.get(name) else { continue };
        let numbers = child.numbers();
        let at = format!("{at}/{name}");
        *found = Some(numbers.ok_or_else(|| BlueprintError::missing(&at, "an array of numbers"))?);
    }
    if all[0].is_none() {
        return Err(BlueprintError::missing(&format!("{at}/x"), "an array of numbers"));
    }
    Ok(all)
}

/// Positions of an explicit coordset, 0 along axes that are not there. Single precision stays so.
pub(super) fn explicit(path: &str, node: &Node<'_>) -> Result<Points, BlueprintError> {
    let arrays = values(path, node)?;
    let count = arrays[0].map_or(0, |x| x.len());
    for (name, array) in AXES.iter().zip(&arrays) {
        if let Some(array) = array.filter(|a| a.len() != count) {
            let reason = format!("{} numbers, but {count} along x", array.len());
            return Err(BlueprintError::inconsistent(&format!("{path}/values/{name}"), reason));
        }
    }
    let at = |i: usize| arrays.map(|array| array.map_or(0.0, |array| array.get_f64(i)));
    let single = arrays.iter().flatten().all(|a| a.kind() == ScalarType::F32);
    Ok(match single {
        true => Points::F32((0..count).map(|i| at(i).map(|v| v as f32)).collect()),
        false => Points::F64((0..count).map(at).collect()),
    })
}

/// Coordinates of a rectilinear coordset.
pub(super) fn rectilinear(path: &str, node: &Node<'_>) -> Result<[Vec<f64>; 3], BlueprintError> {
    let arrays = values(path, node)?;
    Ok(arrays.map(|array| match array {
        Some(array) => (0..array.len()).map(|i| array.get_f64(i)).collect(),
        None => vec![0.0],
    }))
}
