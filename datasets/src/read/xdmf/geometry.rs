//! `Geometry`: where the points are.

use super::data_item::{Items, all};
use super::topology::Lattice;
use super::{fault, place};
use crate::model::{
    DataArray, Dataset, ImageData, Points, RectilinearGrid, StructuredGrid, Values,
};
use crate::read::error::Fault;
use glam::DVec3;
use roxmltree::Node;

fn kind(node: Node<'_, '_>) -> String {
    let name = node.attribute("GeometryType").or(node.attribute("Type")).unwrap_or("XYZ");
    name.to_ascii_uppercase()
}

fn refused(node: Node<'_, '_>, kind: &str, cure: &str) -> Fault {
    Fault::unsupported(place(node), format!("GeometryType `{kind}`"), cure)
}

/// A position for each point.
pub(super) fn points(items: &Items<'_>, node: Node<'_, '_>) -> Result<Points, Fault> {
    let values = all(items, node)?;
    let flat = |v: &Values| -> Result<Points, Fault> {
        if !v.len().is_multiple_of(2) {
            return Err(fault(node, format!("{} coordinates of points in a plane", v.len())));
        }
        let points = (0..v.len() / 2).map(|i| [v.get_f64(2 * i), v.get_f64(2 * i + 1), 0.0]);
        Ok(Points::F64(points.collect()))
    };
    match (kind(node).as_str(), &values[..]) {
        ("XYZ", [xyz]) => {
            if !xyz.len().is_multiple_of(3) {
                return Err(fault(node, format!("{} coordinates of points in space", xyz.len())));
            }
            Ok(Points::from_array(DataArray::new("Points", 3, xyz.clone()))?)
        }
        ("XY", [xy]) => flat(xy),
        ("X_Y_Z" | "X_Y", [x, rest @ ..]) if rest.len() <= 2 => {
            if rest.iter().any(|r| r.len() != x.len()) {
                return Err(fault(node, "its items differ in length"));
            }
            let at = |i: usize, a: usize| rest.get(a).map_or(0.0, |v| v.get_f64(i));
            let points = (0..x.len()).map(|i| [x.get_f64(i), at(i, 0), at(i, 1)]);
            Ok(Points::F64(points.collect()))
        }
        (other, _) => Err(refused(node, other, "this topology needs XYZ, XY, X_Y_Z or X_Y")),
    }
}

/// A lattice of `dims` points.
pub(super) fn lattice(
    items: &Items<'_>,
    node: Node<'_, '_>,
    dims: [u64; 3],
    topology: Lattice,
) -> Result<Dataset, Fault> {
    let extent = [0, dims[0] - 1, 0, dims[1] - 1, 0, dims[2] - 1].map(|n| n as i32);
    let kind = kind(node);
    match topology {
        Lattice::Curvilinear => {
            let points = points(items, node)?;
            let attributes = Default::default();
            Ok(Dataset::StructuredGrid(StructuredGrid { extent, points, attributes }))
        }
        Lattice::Uniform => {
            if kind != "ORIGIN_DXDYDZ" && kind != "ORIGIN_DXDY" {
                return Err(refused(node, &kind, "a uniform mesh needs ORIGIN_DXDYDZ"));
            }
            let values = all(items, node)?;
            let axes = if kind == "ORIGIN_DXDY" { 2 } else { 3 };
            let [origin, spacing] = &values[..] else {
                return Err(fault(node, "it needs two items: the origin and the spacing"));
            };
            if origin.len() != axes || spacing.len() != axes {
                return Err(fault(node, format!("origin and spacing need {axes} numbers each")));
            }
            // The slowest axis comes first, as in `Dimensions`.
            let of = |v: &Values, rest: f64| {
                let at = |a: usize| if a < axes { v.get_f64(axes - 1 - a) } else { rest };
                DVec3::new(at(0), at(1), at(2))
            };
            let image = ImageData::new(dims.map(|d| d as u32), of(origin, 0.0), of(spacing, 1.0));
            Ok(Dataset::ImageData(image))
        }
        Lattice::Rectilinear => {
            if kind != "VXVYVZ" && kind != "VXVY" {
                return Err(refused(node, &kind, "a rectilinear mesh needs VXVYVZ"));
            }
            let values = all(items, node)?;
            let axis = |a: usize| match values.get(a) {
                Some(v) => (0..v.len()).map(|i| v.get_f64(i)).collect(),
                None => vec![0.0],
            };
            let coordinates = [axis(0), axis(1), axis(2)];
            let attributes = Default::default();
            Ok(Dataset::RectilinearGrid(RectilinearGrid { extent, coordinates, attributes }))
        }
    }
}
