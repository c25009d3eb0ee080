//! `datasets list`.

use datasets::catalogue::{self, flows};
use datasets::cli::CommonArgs;
use serde::Serialize;

#[derive(Serialize)]
struct Entry {
    name: &'static str,
    kind: &'static str,
    description: &'static str,
    thesis: &'static str,
    sizes: Vec<Size>,
}

#[derive(Serialize)]
struct Size {
    name: &'static str,
    /// Number of triangles of a mesh, segments of lines, or points of a flow.
    elements: u64,
}

fn entries() -> anyhow::Result<Vec<Entry>> {
    let mut entries: Vec<Entry> = catalogue::entries()
        .iter()
        .map(|e| Entry {
            name: e.name,
            kind: if e.is_lines() { "lines" } else { "mesh" },
            description: e.description,
            thesis: e.thesis,
            sizes: e.sizes.iter().map(|s| Size { name: s.name, elements: s.elements }).collect(),
        })
        .collect();
    for flow in flows::entries() {
        let mut sizes = vec![];
        for (name, _) in flows::SIZES {
            sizes.push(Size { name, elements: flow.dims(name)?.as_u64vec3().element_product() });
        }
        let (name, description, thesis) = (flow.name, flow.description, flow.thesis);
        entries.push(Entry { name, kind: "flow", description, thesis, sizes });
    }
    Ok(entries)
}

/// Prints the catalogue.
pub(super) fn list(common: CommonArgs) -> anyhow::Result<()> {
    let entries = entries()?;
    common.result(&entries, || {
        let width = entries.iter().map(|e| e.name.len()).max().unwrap_or(0);
        let line = |e: &Entry| {
            let sizes: Vec<&str> = e.sizes.iter().map(|s| s.name).collect();
            let (name, kind) = (e.name, e.kind);
            format!(
                "{name:width$}  {kind:5}  {}\n{:width$}         sizes: {}",
                e.description,
                "",
                sizes.join(", ")
            )
        };
        entries.iter().map(line).collect::<Vec<_>>().join("\n")
    })
}
