//! Small cases of OpenFOAM, written file by file.

use std::fmt::Write as _;
use std::path::Path;

/// How the files of a case are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Form {
    Text,
    Binary,
    /// Text, gzipped.
    Zipped,
}

/// A row of cubes along x.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    pub(crate) cells: usize,
    /// x of the first cube.
    pub(crate) start: usize,
    /// Types of the patches at both ends.
    pub(crate) ends: [&'static str; 2],
    /// Type of the patch at the lowest and highest z.
    pub(crate) across: &'static str,
}

/// Path within the case, and content.
pub(crate) type CaseFile = (String, Vec<u8>);

fn header(form: Form, class: &str, object: &str) -> String {
    let format = if form == Form::Binary { "binary" } else { "ascii" };
    format!(
        "/* a banner */\nFoamFile\n{{\n version 2.0;\n format {format};\n arch \
         \"LSB;label=32;scalar=64\";\n class {class};\n object {object};\n}}\n// * * //\n"
    )
}

fn file(form: Form, folder: &str, class: &str, object: &str, body: Vec<u8>) -> CaseFile {
    let mut bytes = header(form, class, object).into_bytes();
    bytes.extend(body);
    let name = format!("{folder}/{object}");
    match form {
        Form::Zipped => (format!("{name}.gz"), super::gzip(&bytes)),
        _ => (name, bytes),
    }
}

fn labels(form: Form, list: &[i32]) -> Vec<u8> {
    let mut out = format!("\n{}\n(", list.len()).into_bytes();
    for n in list {
        match form {
            Form::Binary => out.extend(n.to_le_bytes()),
            _ => out.extend(format!("\n{n}").bytes()),
        }
    }
    out.extend(b")\n");
    out
}

fn tuples(form: Form, components: usize, values: &[f64]) -> Vec<u8> {
    let mut out = format!("\n{}\n(", values.len() / components).into_bytes();
    for tuple in values.chunks(components) {
        match (form, components) {
            (Form::Binary, _) => tuple.iter().for_each(|x| out.extend(x.to_le_bytes())),
            (_, 1) => out.extend(format!("\n{}", tuple[0]).bytes()),
            _ => {
                let words: Vec<String> = tuple.iter().map(f64::to_string).collect();
                out.extend(format!("\n({})", words.join(" ")).bytes());
            }
        }
    }
    out.extend(b")\n");
    out
}

impl Row {
    /// The five files of the mesh.
    pub(crate) fn mesh(&self, form: Form, folder: &str) -> Vec<CaseFile> {
        let n = self.cells;
        let id = |i: usize, j: usize, k: usize| (i + (n + 1) * (j + 2 * k)) as i32;
        let mut points = Vec::new();
        for k in 0..2 {
            for j in 0..2 {
                for i in 0..=n {
                    let x = (self.start + i) as f64;
                    points.extend(match self.across {
                        // Radii of 1 and 2, at angles of -0.05 and 0.05 about the x axis.
                        "wedge" => {
                            let (sin, cos) = (0.1 * k as f64 - 0.05).sin_cos();
                            let radius = 1.0 + j as f64;
                            [x, radius * cos, radius * sin]
                        }
                        _ => [x, j as f64, k as f64],
                    });
                }
            }
        }
        let x_face = |i: usize| [id(i, 0, 0), id(i, 1, 0), id(i, 1, 1), id(i, 0, 1)];
        let reversed = |f: [i32; 4]| [f[3], f[2], f[1], f[0]];
        let mut faces: Vec<([i32; 4], usize)> = (1..n).map(|i| (x_face(i), i - 1)).collect();
        faces.push((reversed(x_face(0)), 0));
        faces.push((x_face(n), n - 1));
        for i in 0..n {
            let low = [id(i, 0, 0), id(i + 1, 0, 0), id(i + 1, 0, 1), id(i, 0, 1)];
            let high = [id(i, 1, 0), id(i + 1, 1, 0), id(i + 1, 1, 1), id(i, 1, 1)];
            faces.extend([(low, i), (reversed(high), i)]);
        }
        for i in 0..n {
            let back = [id(i, 0, 0), id(i + 1, 0, 0), id(i + 1, 1, 0), id(i, 1, 0)];
            let front = [id(i, 0, 1), id(i + 1, 0, 1), id(i + 1, 1, 1), id(i, 1, 1)];
            faces.extend([(reversed(back), i), (front, i)]);
        }
        let mut boundary = String::from("\n4\n(\n");
        let kinds = [
            ("inlet", self.ends[0], 1),
            ("outlet", self.ends[1], 1),
            ("walls", "wall", 2 * n),
            ("sides", self.across, 2 * n),
        ];
        let mut first = n - 1;
        for (name, kind, count) in kinds {
            let entries =
                format!("type {kind}; inGroups 1(all); nFaces {count}; startFace {first};");
            writeln!(boundary, " {name}\n {{ {entries} }}").unwrap();
            first += count;
        }
        boundary.push_str(")\n");
        let owner: Vec<i32> = faces.iter().map(|f| f.1 as i32).collect();
        let neighbour: Vec<i32> = (1..n as i32).collect();
        let (class, faces) = if form == Form::Binary {
            let starts: Vec<i32> = (0..=faces.len() as i32).map(|i| 4 * i).collect();
            let ids: Vec<i32> = faces.iter().flat_map(|f| f.0).collect();
            ("faceCompactList", [labels(form, &starts), labels(form, &ids)].concat())
        } else {
            let mut text = format!("{}\n(\n", faces.len());
            for ([a, b, c, d], _) in &faces {
                writeln!(text, "4({a} {b} {c} {d})").unwrap();
            }
            text.push_str(")\n");
            ("faceList", text.into_bytes())
        };
        let folder = format!("{folder}constant/polyMesh");
        vec![
            file(form, &folder, "vectorField", "points", tuples(form, 3, &points)),
            file(form, &folder, class, "faces", faces),
            file(form, &folder, "labelList", "owner", labels(form, &owner)),
            file(form, &folder, "labelList", "neighbour", labels(form, &neighbour)),
            file(form, &folder, "polyBoundaryMesh", "boundary", boundary.into_bytes()),
        ]
    }

    /// Temperature (x in cells, plus 300), velocity and a uniform pressure.
    pub(crate) fn fields(&self, form: Form, folder: &str) -> Vec<CaseFile> {
        let entry = |dimensions: &str, kind: &str, list: Vec<u8>| {
            let start = format!("\ndimensions {dimensions};\n\ninternalField nonuniform {kind} ");
            [start.into_bytes(), list, b";\nboundaryField\n{\n}\n".to_vec()].concat()
        };
        let at = |c: usize| (self.start + c) as f64;
        let t: Vec<f64> = (0..self.cells).map(|c| 300.0 + at(c)).collect();
        let u: Vec<f64> = (0..self.cells).flat_map(|c| [at(c), 0.5, -1.0]).collect();
        let t = entry("[0 0 0 1 0 0 0]", "List<scalar>", tuples(form, 1, &t));
        let u = entry("[0 1 -1 0 0 0 0]", "List<vector>", tuples(form, 3, &u));
        let p = b"dimensions [1 -1 -2 0 0 0 0];\ninternalField uniform 1e5;\nboundaryField { }\n";
        vec![
            file(form, folder, "volScalarField", "T", t),
            file(form, folder, "volVectorField", "U", u),
            file(form, folder, "volScalarField", "p", p.to_vec()),
            file(form, folder, "surfaceScalarField", "phi", b"internalField uniform 0;".to_vec()),
        ]
    }
}

/// A case of three cubes at two times.
pub(crate) fn case(form: Form, across: &'static str) -> Vec<CaseFile> {
    let row = Row { cells: 3, start: 0, ends: ["patch"; 2], across };
    let later = Row { start: 10, ..row };
    let mut files = row.mesh(form, "");
    files.extend(row.fields(form, "0"));
    files.extend(later.fields(form, "0.25"));
    files
}

/// The same case in two parts, of one and of two cubes.
pub(crate) fn decomposed(form: Form) -> Vec<CaseFile> {
    let row = Row { cells: 1, start: 0, ends: ["patch", "processor"], across: "patch" };
    let rest = Row { cells: 2, start: 1, ends: ["processor", "patch"], across: "patch" };
    let mut files = Vec::new();
    for (i, part) in [row, rest].into_iter().enumerate() {
        files.extend(part.mesh(form, &format!("processor{i}/")));
        files.extend(part.fields(form, &format!("processor{i}/0")));
        let later = Row { start: part.start + 10, ..part };
        files.extend(later.fields(form, &format!("processor{i}/0.25")));
    }
    files
}

/// The same parts in the collated format, in folders that hold `group` of them each: one file for
/// all, whose blocks but the first have no header.
pub(crate) fn collated(form: Form, group: usize) -> Vec<CaseFile> {
    let inner = if form == Form::Zipped { Form::Text } else { form };
    let parts = decomposed(inner);
    let count = 2;
    let mut files: Vec<CaseFile> = Vec::new();
    for (name, bytes) in &parts {
        let (processor, rest) = name.split_once('/').unwrap();
        let rank: usize = processor.trim_start_matches("processor").parse().unwrap();
        let first = rank / group * group;
        let folder = match group {
            _ if group >= count => format!("processors{count}"),
            _ => format!("processors{count}_{first}-{}", first + group - 1),
        };
        let path = format!("{folder}/{rest}");
        let block = match rank - first {
            0 => bytes.clone(),
            _ => {
                let end = b"// * * //\n";
                let at = bytes.windows(end.len()).position(|w| w == end).unwrap();
                bytes[at + end.len()..].to_vec()
            }
        };
        let mut text = format!("\n\n// Processor{rank}\n\n{}\n(", block.len()).into_bytes();
        text.extend(block);
        text.extend(b")\n");
        match files.iter_mut().find(|f| f.0 == path) {
            Some(file) => file.1.extend(text),
            None => {
                let head = header(Form::Binary, "decomposedBlockData", "x").into_bytes();
                files.push((path, [head, text].concat()));
            }
        }
    }
    if form == Form::Zipped {
        for (name, bytes) in &mut files {
            *name += ".gz";
            *bytes = super::gzip(bytes);
        }
    }
    files
}

/// Writes the files of a case.
pub(crate) fn write(folder: &Path, files: &[CaseFile]) {
    for (name, bytes) in files {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
}
