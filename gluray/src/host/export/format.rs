//! The file format: an identifying line, a line of JSON that describes the content, then the
//! arrays.
//!
//! ```text
//! gluray-scene 1\n
//! {"program":"gmsh","frame":12,"space":"…","objects":[{"key":"3f2a","vertices":8,"triangles":12,"has":["normals"],…}]}\n
//! object after object: positions 3 × f32 per vertex, indices 3 × u32 per triangle, then, as `has` says,
//! normals 3 × f32 per vertex, colors 4 × u8 per vertex. Little-endian, without padding.
//! ```

use serde::{Deserialize, Serialize};
use std::io::{self, BufRead, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

const FIRST_LINE: &str = "gluray-scene 1\n";
/// Longest second line: a million objects have room.
const MAX_HEADER_BYTES: u64 = 1 << 28;

/// A scene as it was captured.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Program that drew it.
    pub program: String,
    /// In which frame.
    pub frame: u64,
    /// What the axes of the world are, in words: OpenGL has no world, so the library says which
    /// frame it took.
    pub space: String,
    /// What was traced.
    pub objects: Vec<Object>,
}

/// A traced object.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Object {
    /// What settings and reports call it.
    pub key: String,
    /// How it was drawn, in a few words.
    #[serde(default)]
    pub name: String,
    /// World from object, column by column as OpenGL has matrices.
    pub world_from_object: [f64; 16],
    /// Colour and opacity where vertices have none, as `glColor` takes them.
    pub color: [f32; 4],
    /// Positions in the object's axes.
    #[serde(skip)]
    pub positions: Vec<[f32; 3]>,
    /// Three vertices each.
    #[serde(skip)]
    pub indices: Vec<[u32; 3]>,
    /// One per vertex, in the object's axes, of any length; or none.
    #[serde(skip)]
    pub normals: Vec<[f32; 3]>,
    /// One RGBA per vertex; or none.
    #[serde(skip)]
    pub colors: Vec<[u8; 4]>,
}

/// What stands in the second line for an object.
#[derive(Serialize, Deserialize)]
struct Counts {
    vertices: u64,
    triangles: u64,
    has: Vec<String>,
    #[serde(flatten)]
    object: serde_json::Value,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    program: String,
    frame: u64,
    space: String,
    objects: Vec<Counts>,
}

/// Why a scene cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The system refuses.
    #[error("{}: cannot be used", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Not such a file, or a broken one.
    #[error("{}: {what}; {cure}", path.display())]
    Broken {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        what: String,
        /// What to do.
        cure: &'static str,
    },
}

const AGAIN: &str = "have the program write it again";

fn broken(path: &Path, what: impl Into<String>, cure: &'static str) -> SceneError {
    SceneError::Broken { path: path.into(), what: what.into(), cure }
}

impl Object {
    fn fault(&self) -> Option<String> {
        let n = self.positions.len();
        for (what, len) in [("normals", self.normals.len()), ("colors", self.colors.len())] {
            if len != 0 && len != n {
                return Some(format!("object {}: {len} {what} for {n} vertices", self.key));
            }
        }
        let past = self.indices.iter().flatten().find(|&&i| i as usize >= n)?;
        Some(format!("object {}: a triangle names vertex {past} of {n}", self.key))
    }

    fn counts(&self) -> serde_json::Result<Counts> {
        let has = [("normals", !self.normals.is_empty()), ("colors", !self.colors.is_empty())];
        Ok(Counts {
            vertices: self.positions.len() as u64,
            triangles: self.indices.len() as u64,
            has: has.iter().filter(|(_, is)| *is).map(|(n, _)| (*n).to_owned()).collect(),
            object: serde_json::to_value(self)?,
        })
    }
}

/// Writes a scene; the file appears whole or not at all.
pub fn write_scene(path: &Path, scene: &Scene) -> Result<(), SceneError> {
    let io = |source| SceneError::Io { path: path.into(), source };
    if let Some(what) = scene.objects.iter().find_map(Object::fault) {
        return Err(broken(path, what, "leave that object out"));
    }
    let objects = scene
        .objects
        .iter()
        .map(Object::counts)
        .collect::<Result<_, _>>()
        .map_err(|e| io(e.into()))?;
    let header = Header {
        program: scene.program.clone(),
        frame: scene.frame,
        space: scene.space.clone(),
        objects,
    };
    let name = path.file_name().ok_or_else(|| io(io::ErrorKind::InvalidInput.into()))?;
    let mut partial = name.to_os_string();
    partial.push(format!(".{}.partial", std::process::id()));
    let partial = path.with_file_name(partial);
    let write = || -> io::Result<()> {
        let mut out = BufWriter::with_capacity(1 << 20, std::fs::File::create(&partial)?);
        out.write_all(FIRST_LINE.as_bytes())?;
        serde_json::to_writer(&mut out, &header)?;
        out.write_all(b"\n")?;
        for o in &scene.objects {
            floats(&mut out, &o.positions)?;
            o.indices.iter().flatten().try_for_each(|i| out.write_all(&i.to_le_bytes()))?;
            floats(&mut out, &o.normals)?;
            out.write_all(o.colors.as_flattened())?;
        }
        out.flush()?;
        std::fs::rename(&partial, path)
    };
    write().map_err(|e| {
        // The first error is the one to report.
        let _ = std::fs::remove_file(&partial);
        io(e)
    })
}

fn floats(out: &mut impl Write, values: &[[f32; 3]]) -> io::Result<()> {
    values.iter().flatten().try_for_each(|v| out.write_all(&v.to_le_bytes()))
}

/// Reads a scene. Counts are held against the length of the file before memory is taken for them.
pub fn read_scene(path: &Path) -> Result<Scene, SceneError> {
    let io = |source| SceneError::Io { path: path.into(), source };
    let file = std::fs::File::open(path).map_err(io)?;
    let length = file.metadata().map_err(io)?.len();
    let mut file = BufReader::with_capacity(1 << 20, file);

    // What it is, and what there is.
    let mut first = vec![0; FIRST_LINE.len()];
    let is_scene = file.read_exact(&mut first).is_ok() && first == FIRST_LINE.as_bytes();
    if !is_scene {
        return Err(broken(
            path,
            "is no scene of gluray, version 1",
            "give a file that the library wrote (GLURAY_DUMP, or `export the scene` on the panel)",
        ));
    }
    let mut line = Vec::new();
    file.by_ref().take(MAX_HEADER_BYTES).read_until(b'\n', &mut line).map_err(io)?;
    let header: Header = serde_json::from_slice(&line)
        .map_err(|e| broken(path, format!("its second line makes no sense: {e}"), AGAIN))?;
    let begin = (FIRST_LINE.len() + line.len()) as u64;

    // Whether it is whole.
    let mut expected = begin;
    for c in &header.objects {
        let has = |what: &str| u64::from(c.has.iter().any(|h| h == what));
        let per_vertex = 12 + 12 * has("normals") + 4 * has("colors");
        let bytes = c
            .vertices
            .checked_mul(per_vertex)
            .zip(c.triangles.checked_mul(12))
            .and_then(|(v, t)| v.checked_add(t));
        let sum = bytes.and_then(|b| expected.checked_add(b));
        expected =
            sum.ok_or_else(|| broken(path, "its counts are too large for any file", AGAIN))?;
    }
    if expected != length {
        return Err(broken(
            path,
            format!("has {length} bytes, and its second line speaks of {expected}"),
            AGAIN,
        ));
    }

    let mut scene = Scene {
        program: header.program,
        frame: header.frame,
        space: header.space,
        objects: Vec::new(),
    };
    for (i, c) in header.objects.into_iter().enumerate() {
        let (n, m) = (c.vertices as usize, c.triangles as usize);
        if let Some(other) = c.has.iter().find(|h| !["normals", "colors"].contains(&h.as_str())) {
            return Err(broken(
                path,
                format!("object {i} has unknown `{other}`"),
                "read it with a newer gluray",
            ));
        }
        let has = |what: &str| if c.has.iter().any(|h| h == what) { n } else { 0 };
        let (normals, colors) = (has("normals"), has("colors"));
        let mut o: Object = serde_json::from_value(c.object)
            .map_err(|e| broken(path, format!("object {i}: {e}"), AGAIN))?;
        let mut triples = |count: usize| -> Result<Vec<[[u8; 4]; 3]>, SceneError> {
            let mut bytes = vec![0; 12 * count];
            file.read_exact(&mut bytes).map_err(io)?;
            Ok(bytes
                .chunks_exact(12)
                .map(|b| [0, 4, 8].map(|at| [b[at], b[at + 1], b[at + 2], b[at + 3]]))
                .collect())
        };
        o.positions = triples(n)?.into_iter().map(|t| t.map(f32::from_le_bytes)).collect();
        o.indices = triples(m)?.into_iter().map(|t| t.map(u32::from_le_bytes)).collect();
        o.normals = triples(normals)?.into_iter().map(|t| t.map(f32::from_le_bytes)).collect();
        let mut bytes = vec![0; 4 * colors];
        file.read_exact(&mut bytes).map_err(io)?;
        o.colors = bytes.chunks_exact(4).map(|c| [c[0], c[1], c[2], c[3]]).collect();
        if let Some(what) = o.fault() {
            return Err(broken(path, what, AGAIN));
        }
        scene.objects.push(o);
    }
    Ok(scene)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;

    pub(in crate::host::export) const IDENTITY: [f64; 16] =
        [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];

    pub(in crate::host::export) fn example() -> Scene {
        let mut moved = IDENTITY;
        moved[12] = 10.0;
        let a = Object {
            key: "a1".into(),
            name: "glDrawArrays".into(),
            world_from_object: IDENTITY,
            color: [1.0, 0.5, 0.0, 1.0],
            positions: vec![[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]],
            indices: vec![[0, 1, 2]],
            normals: vec![[0., 0., 2.]; 3],
            colors: Vec::new(),
        };
        let b = Object {
            key: "b2".into(),
            world_from_object: moved,
            colors: vec![[255, 0, 0, 128]; 4],
            positions: vec![[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]],
            indices: vec![[0, 1, 2], [0, 2, 3]],
            normals: Vec::new(),
            ..a.clone()
        };
        Scene {
            program: "test".into(),
            frame: 3,
            space: "the viewer's".into(),
            objects: vec![a, b],
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.gluray");
        write_scene(&path, &example()).unwrap();
        assert_eq!(read_scene(&path).unwrap(), example());
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "nothing else is left");
        let mut wrong = example();
        wrong.objects[0].indices[0][2] = 3;
        assert!(write_scene(&path, &wrong).unwrap_err().to_string().contains("vertex 3 of 3"));
        assert_eq!(read_scene(&path).unwrap(), example(), "the file from before is still there");
    }

    #[test]
    fn every_truncation_is_noticed_and_huge_counts_take_no_memory() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.gluray");
        write_scene(&path, &example()).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        for n in 0..bytes.len() {
            std::fs::write(&path, &bytes[..n]).unwrap();
            let e = read_scene(&path).unwrap_err().to_string();
            assert!(e.contains("a.gluray"), "{e}");
        }
        let text = format!(
            "{FIRST_LINE}{{\"program\":\"\",\"frame\":0,\"space\":\"\",\"objects\":[{{\"vertices\":{},\"triangles\":0,\"has\":[],\"key\":\"\",\"world_from_object\":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1],\"color\":[1,1,1,1]}}]}}\n",
            u64::MAX / 2
        );
        std::fs::write(&path, text).unwrap();
        assert!(read_scene(&path).unwrap_err().to_string().contains("too large"));
    }

    proptest! {
        #[test]
        fn changed_bytes_are_an_error_or_another_scene_and_never_a_panic(at in 0usize..600, to in any::<u8>()) {
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("a.gluray");
            write_scene(&path, &example()).unwrap();
            let mut bytes = std::fs::read(&path).unwrap();
            let at = at % bytes.len();
            bytes[at] = to;
            std::fs::write(&path, &bytes).unwrap();
            let _ = read_scene(&path);
        }
    }
}
