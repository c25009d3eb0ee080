//! Small cases of OpenFOAM with a density in cells, written from the faces of each cell.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::path::Path;

/// A case before it is written.
#[derive(Default)]
pub(crate) struct Case {
    pub(crate) points: Vec<[f64; 3]>,
    /// For each face of each cell, in the order of the cells: its corners as seen from outside,
    /// with repeated ones where it collapsed, its cell, and the patch that it is of at the border.
    pub(crate) faces: Vec<(Vec<usize>, usize, &'static str)>,
    /// Names and types of the patches.
    pub(crate) patches: Vec<(&'static str, &'static str)>,
    /// Density in each cell, kg/m³.
    pub(crate) rho: Vec<f64>,
}

/// The faces of a hexahedron as corners along x, y and z, from outside: low and high x, y and z.
pub(crate) const HEXAHEDRON: [[[usize; 3]; 4]; 6] = [
    [[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]],
    [[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]],
    [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]],
    [[0, 1, 0], [0, 1, 1], [1, 1, 1], [1, 1, 0]],
    [[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]],
    [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
];

/// A face of the mesh.
struct Face {
    ids: Vec<usize>,
    owner: usize,
    neighbour: Option<usize>,
    patch: &'static str,
}

impl Case {
    /// Two cells share a face with the same corners, unless its patch has a name that begins with
    /// `baffle`.
    fn joined(&self) -> Vec<Face> {
        let mut faces: Vec<Face> = Vec::new();
        let mut known: HashMap<Vec<usize>, usize> = HashMap::new();
        for (corners, cell, patch) in &self.faces {
            let mut ids = corners.clone();
            ids.dedup();
            if ids.len() > 1 && ids.first() == ids.last() {
                ids.pop();
            }
            if ids.len() < 3 {
                continue;
            }
            let mut key = ids.clone();
            key.sort_unstable();
            match known.get(&key) {
                Some(&face) if !patch.starts_with("baffle") => faces[face].neighbour = Some(*cell),
                _ => {
                    known.insert(key, faces.len());
                    faces.push(Face { ids, owner: *cell, neighbour: None, patch });
                }
            }
        }
        faces
    }

    pub(crate) fn write(&self, folder: &Path) {
        let faces = self.joined();
        let mut ordered: Vec<&Face> = faces.iter().filter(|f| f.neighbour.is_some()).collect();
        let internal = ordered.len();
        let mut boundary = format!("{}\n(\n", self.patches.len());
        for (name, kind) in &self.patches {
            let first = ordered.len();
            ordered.extend(faces.iter().filter(|f| f.neighbour.is_none() && f.patch == *name));
            let count = ordered.len() - first;
            let size = format!("nFaces {count}; startFace {first};");
            writeln!(boundary, "{name} {{ type {kind}; {size} }}").unwrap();
        }
        boundary.push_str(")\n");
        let list = |items: Vec<String>| format!("{}\n(\n{}\n)\n", items.len(), items.join("\n"));
        let point = |v: &[f64; 3]| format!("({} {} {})", v[0], v[1], v[2]);
        let face = |f: &&Face| {
            let ids: Vec<String> = f.ids.iter().map(usize::to_string).collect();
            format!("{}({})", f.ids.len(), ids.join(" "))
        };
        let write = |name: &str, class: &str, body: String| {
            let path = folder.join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            let object = path.file_name().unwrap().to_string_lossy().into_owned();
            let head = format!("version 2.0; format ascii; class {class}; object {object};");
            std::fs::write(path, format!("FoamFile {{ {head} }}\n{body}")).unwrap();
        };
        let mesh = |name: &str| format!("constant/polyMesh/{name}");
        write(&mesh("points"), "vectorField", list(self.points.iter().map(point).collect()));
        write(&mesh("faces"), "faceList", list(ordered.iter().map(face).collect()));
        let owner = ordered.iter().map(|f| f.owner.to_string()).collect();
        write(&mesh("owner"), "labelList", list(owner));
        let behind = ordered[..internal].iter().filter_map(|f| Some(f.neighbour?.to_string()));
        write(&mesh("neighbour"), "labelList", list(behind.collect()));
        write(&mesh("boundary"), "polyBoundaryMesh", boundary);
        let rho = list(self.rho.iter().map(f64::to_string).collect());
        let field = "dimensions [1 -3 0 0 0 0 0];\ninternalField nonuniform List<scalar> ";
        write("0/rho", "volScalarField", format!("{field}{rho};\nboundaryField {{ }}\n"));
        write("system/controlDict", "dictionary", "application rhoCentralFoam;\n".into());
    }
}
