//! Meshes as simulations describe them to Catalyst: Conduit's [Mesh Blueprint][blueprint].
//!
//! A channel of Catalyst has one mesh (`type: mesh`) or several (`type: multimesh`), and a mesh has
//! one *domain* or several. A domain has coordinates (*coordsets*), cells over them (*topologies*)
//! and arrays (*fields*). [`domains`] finds the domains of a channel, [`dataset`] copies one
//! topology of a domain into a [`Dataset`], and [`Lattice`] is the same for uniform points without
//! copies.
//!
//! [blueprint]: https://llnl-conduit.readthedocs.io/en/latest/blueprint_mesh.html

mod coordset;
mod error;
mod field;
mod lattice;
mod topology;

pub use error::BlueprintError;
pub use field::{Field, fields};
pub use lattice::Lattice;

use crate::node::Node;
use datasets::model::Dataset;

/// A domain of a channel.
#[derive(Debug, Clone)]
pub struct Domain<'n, 'a> {
    /// Where it lies in the tree, for messages.
    pub path: String,
    /// Its coordsets, topologies and fields.
    pub node: &'n Node<'a>,
    /// What Catalyst tells about its fields: `state/metadata/vtk_fields` of the mesh.
    metadata: Option<&'n Node<'a>>,
}

/// The domains of a channel (`catalyst/channels/NAME`), in the order of the simulation.
///
/// # Errors
/// [`BlueprintError`] for other types of channels, and for what is no mesh.
pub fn domains<'n, 'a>(
    channel: &'n Node<'a>,
    path: &str,
) -> Result<Vec<Domain<'n, 'a>>, BlueprintError> {
    let at = format!("{path}/data");
    let Some(data) = channel.get("data") else {
        return Err(BlueprintError::missing(&at, "the mesh"));
    };
    let metadata = channel.get("state/metadata/vtk_fields");
    match channel.text_at("type") {
        Some("mesh") => domains_of_mesh(data, &at, metadata),
        Some("multimesh") => {
            let mut all = Vec::new();
            for (name, mesh) in data.children() {
                let metadata = mesh.get("state/metadata/vtk_fields").or(metadata);
                all.extend(domains_of_mesh(mesh, &format!("{at}/{name}"), metadata)?);
            }
            Ok(all)
        }
        Some(other) => Err(BlueprintError::unsupported(
            &format!("{path}/type"),
            other,
            "give `mesh` or `multimesh`",
        )),
        None => {
            Err(BlueprintError::missing(&format!("{path}/type"), "the text `mesh` or `multimesh`"))
        }
    }
}

fn domains_of_mesh<'n, 'a>(
    mesh: &'n Node<'a>,
    path: &str,
    metadata: Option<&'n Node<'a>>,
) -> Result<Vec<Domain<'n, 'a>>, BlueprintError> {
    if mesh.get("coordsets").is_some() {
        return Ok(vec![Domain { path: path.to_owned(), node: mesh, metadata }]);
    }
    // A rank without cells may give a mesh of nothing.
    let mut all = Vec::new();
    for (name, node) in mesh.children() {
        let path = format!("{path}/{name}");
        if name == "state" || matches!(node, Node::Empty) {
            continue;
        }
        if node.get("coordsets").is_none() {
            return Err(BlueprintError::missing(&format!("{path}/coordsets"), "coordinates"));
        }
        all.push(Domain { path, node, metadata });
    }
    Ok(all)
}

impl<'n, 'a> Domain<'n, 'a> {
    /// The topology `name`, or the first without a name: its own name and node. `None` for a domain
    /// that has no topologies.
    ///
    /// # Errors
    /// A name that the domain does not have.
    pub fn topology(
        &self,
        name: Option<&str>,
    ) -> Result<Option<(&'n str, &'n Node<'a>)>, BlueprintError> {
        let all = self.node.get("topologies").map_or(&[][..], Node::children);
        let found = match name {
            None => all.first(),
            Some(name) => match all.iter().find(|(n, _)| n == name) {
                None if !all.is_empty() => {
                    let names: Vec<&str> = all.iter().map(|(n, _)| n.as_str()).collect();
                    return Err(BlueprintError::NoTopology {
                        path: self.path.clone(),
                        name: name.to_owned(),
                        names: names.join(", "),
                    });
                }
                found => found,
            },
        };
        Ok(found.map(|(name, node)| (name.as_str(), node)))
    }

    /// The coordset that a topology names.
    fn coordset(
        &self,
        topology: (&str, &'n Node<'a>),
    ) -> Result<(String, &'n Node<'a>), BlueprintError> {
        let at = format!("{}/topologies/{}/coordset", self.path, topology.0);
        let name = topology.1.text_at("coordset");
        let name = name.ok_or_else(|| BlueprintError::missing(&at, "the name of a coordset"))?;
        let path = format!("{}/coordsets/{name}", self.path);
        match self.node.get("coordsets").and_then(|all| all.get(name)) {
            Some(node) => Ok((path, node)),
            None => Err(BlueprintError::missing(&path, "coordinates")),
        }
    }
}

/// Whether a topology of a domain has uniform points, and draws all its cells.
///
/// # Errors
/// As [`dataset`].
pub fn is_whole_lattice(
    domain: &Domain<'_, '_>,
    topology: Option<&str>,
) -> Result<bool, BlueprintError> {
    let Some(topology) = domain.topology(topology)? else { return Ok(false) };
    let (path, node) = domain.coordset(topology)?;
    let fields = fields(domain, topology.0, &mut Vec::new());
    let has_ghosts = fields.iter().any(Field::marks_ghosts);
    Ok(coordset::kind(&path, node)? == "uniform" && !has_ghosts)
}

/// A copy of one topology of a domain, with the arrays that lie on it; and warnings. `None` for a
/// domain without topologies.
///
/// # Errors
/// [`BlueprintError`]: what is missing, does not fit together, or is not supported, by its path.
pub fn dataset(
    domain: &Domain<'_, '_>,
    topology: Option<&str>,
) -> Result<Option<(Dataset, Vec<String>)>, BlueprintError> {
    let Some(topology) = domain.topology(topology)? else { return Ok(None) };
    let coordset = domain.coordset(topology)?;
    let mut data = topology::dataset(domain, topology, coordset)?;
    let mut warnings = Vec::new();
    for field in fields(domain, topology.0, &mut warnings) {
        field.copy_to(&mut data);
    }
    let inconsistent = |e| BlueprintError::Model { path: domain.path.clone(), source: e };
    data.check().map_err(inconsistent)?;
    Ok(Some((data, warnings)))
}

#[cfg(test)]
mod tests;
