//! Wavefront OBJ files piece by piece, for those that are larger than memory.
//!
//! All vertices are in memory, because faces name any of them: 24 bytes each for positions, and 12
//! each for colours and normals where there are any. The text is read twice, a line at a time:
//! first for the vertices, then for the faces.

use super::ReadError;
use super::error::{At, BROKEN, Fault, io_error};
use super::obj::FORMAT;
use super::obj_text;
use crate::model::polygon::{Division, triangulate};
use glam::{DVec3, Vec3};
use rt_core::mesh::{Attribute, TriMesh};
use std::collections::HashMap;
use std::fs::File;
use std::io::{BufRead as _, BufReader, Read as _, Seek as _};
use std::path::{Path, PathBuf};

/// Most bytes of a line. Longer ones are no text.
const MOST_LINE: u64 = 1 << 20;

/// The faces of an OBJ file as triangles, in pieces. Each piece has the vertices that its faces
/// use, with their colours; normals where all of its corners have one. Texture coordinates and
/// materials are left out.
///
/// ```
/// # use datasets::read::obj_pieces::ObjPieces;
/// # let dir = tempfile::tempdir()?;
/// # let path = dir.path().join("scan.obj");
/// std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\nf 4 3 2 1\n")?;
/// let pieces = ObjPieces::open(&path, 2)?;
/// assert_eq!(pieces.faces(), 3);
/// let sizes: Result<Vec<usize>, _> = pieces.map(|p| p.map(|mesh| mesh.num_triangles())).collect();
/// assert_eq!(sizes?, [2, 2]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct ObjPieces {
    lines: Lines,
    positions: Vec<DVec3>,
    /// As many as positions, or none.
    colors: Vec<Vec3>,
    normals: Vec<Vec3>,
    origin: DVec3,
    contents: ObjContents,
    faces: u64,
    /// Faces read so far, and positions and normals before them.
    read: u64,
    before: [usize; 2],
    fanned: u64,
    normals_left_out: u64,
    piece: usize,
}

/// What an OBJ file has besides faces and their vertices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct ObjContents {
    /// Faces have materials.
    pub materials: bool,
    /// Vertices have texture coordinates.
    pub texcoords: bool,
    /// Some vertices have colours and some have none: no colours are read.
    pub colors_of_some: bool,
    /// Points and lines.
    pub points_and_lines: u64,
}

/// The text of a file, a line at a time.
struct Lines {
    file: BufReader<File>,
    path: PathBuf,
    line: Vec<u8>,
    /// Lines read so far.
    number: u64,
}

impl Lines {
    /// Reads the next line, with those that continue it; false at the end.
    fn advance(&mut self) -> Result<bool, ReadError> {
        self.line.clear();
        let mut read = self.append()?;
        if self.number == 1 {
            if self.line.starts_with(&[0xff, 0xfe]) || self.line.starts_with(&[0xfe, 0xff]) {
                let what = "text in UTF-16".to_owned();
                return Err(self.fault_with(what, "save it as UTF-8"));
            }
            if self.line.starts_with(&[0xef, 0xbb, 0xbf]) {
                self.line.drain(..3);
            }
        }
        while read && obj_text::continues(&self.line) {
            let end = self.line.iter().rposition(|&b| b == b'\\').unwrap_or(0);
            self.line.truncate(end);
            self.line.push(b' ');
            read = self.append()?;
        }
        Ok(!self.line.is_empty())
    }

    /// Appends one line of the file; false at the end.
    fn append(&mut self) -> Result<bool, ReadError> {
        let before = self.line.len() as u64;
        let most = MOST_LINE.saturating_sub(before);
        let read = (&mut self.file).take(most).read_until(b'\n', &mut self.line);
        let read = read.map_err(|e| io_error(&self.path, e))? as u64;
        self.number += 1;
        if before + read >= MOST_LINE && !self.line.ends_with(b"\n") {
            return Err(self.fault(format!("the line is longer than {MOST_LINE} bytes")));
        }
        Ok(read > 0)
    }

    /// The words of the line.
    fn words(&self) -> impl Iterator<Item = &[u8]> {
        self.line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
    }

    /// The numbers behind the first word, three at least.
    fn numbers(&self) -> Result<Vec<f64>, ReadError> {
        let number = |word: &[u8]| {
            let text = str::from_utf8(word).ok();
            let number = text.and_then(|text| text.parse::<f64>().ok());
            number.ok_or_else(|| self.fault(format!("`{}` is not a number", shown(word))))
        };
        let comment = |word: &&[u8]| !word.starts_with(b"#");
        let numbers: Vec<f64> =
            self.words().skip(1).take_while(comment).map(number).collect::<Result<_, _>>()?;
        if numbers.len() < 3 {
            let what = format!("{} numbers where three are needed", numbers.len());
            return Err(self.fault(what));
        }
        Ok(numbers)
    }

    fn fault(&self, what: String) -> ReadError {
        self.fault_with(what, BROKEN)
    }

    fn fault_with(&self, what: String, cure: &str) -> ReadError {
        Fault::new(At::Line(self.number), what, cure).in_file(&self.path, FORMAT)
    }
}

/// The start of a word, for errors.
fn shown(word: &[u8]) -> String {
    String::from_utf8_lossy(word).chars().take(40).collect()
}

impl ObjPieces {
    /// Opens a file and reads its vertices; faces come in pieces of `piece`, at least one.
    ///
    /// # Errors
    /// When the file cannot be read, or a vertex or normal has fewer than three numbers.
    pub fn open(path: &Path, piece: usize) -> Result<ObjPieces, ReadError> {
        let file = File::open(path).map_err(|e| io_error(path, e))?;
        let file = BufReader::with_capacity(1 << 20, file);
        let lines = Lines { file, path: path.to_path_buf(), line: Vec::new(), number: 0 };
        let mut pieces = ObjPieces {
            lines,
            positions: Vec::new(),
            colors: Vec::new(),
            normals: Vec::new(),
            origin: DVec3::ZERO,
            contents: ObjContents::default(),
            faces: 0,
            read: 0,
            before: [0; 2],
            fanned: 0,
            normals_left_out: 0,
            piece: piece.max(1),
        };
        pieces.read_vertices()?;
        let lines = &mut pieces.lines;
        lines.file.rewind().map_err(|e| io_error(path, e))?;
        lines.number = 0;
        let finite = pieces.positions.iter().filter(|p| p.is_finite());
        let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = finite.fold(empty, |(low, high), p| (low.min(*p), high.max(*p)));
        pieces.origin = TriMesh::from_f64_positions(&[low, high], Vec::new()).origin;
        Ok(pieces)
    }

    fn read_vertices(&mut self) -> Result<(), ReadError> {
        while self.lines.advance()? {
            match self.lines.words().next() {
                Some(b"v") => {
                    let numbers = self.lines.numbers()?;
                    self.positions.push(DVec3::new(numbers[0], numbers[1], numbers[2]));
                    if let [_, _, _, r, g, b, ..] = numbers[..] {
                        self.colors.push(DVec3::new(r, g, b).as_vec3());
                    }
                }
                Some(b"vn") => {
                    let numbers = self.lines.numbers()?;
                    self.normals.push(DVec3::new(numbers[0], numbers[1], numbers[2]).as_vec3());
                }
                Some(b"vt") => self.contents.texcoords = true,
                Some(b"usemtl") => self.contents.materials = true,
                Some(b"f") => self.faces += 1,
                Some(b"l" | b"p") => self.contents.points_and_lines += 1,
                _ => {}
            }
        }
        if self.colors.len() != self.positions.len() {
            self.contents.colors_of_some = !self.colors.is_empty();
            self.colors = Vec::new();
        }
        Ok(())
    }

    /// Faces of the file.
    pub fn faces(&self) -> u64 {
        self.faces
    }

    /// Faces read so far.
    pub fn faces_read(&self) -> u64 {
        self.read
    }

    /// Faces so far that cross themselves or are too large, and were divided as fans.
    pub fn fanned(&self) -> u64 {
        self.fanned
    }

    /// Vertices whose normals were left out so far, because others of their piece have none.
    pub fn normals_left_out(&self) -> u64 {
        self.normals_left_out
    }

    /// What is left out.
    pub fn contents(&self) -> ObjContents {
        self.contents
    }

    fn next_piece(&mut self, most: u64) -> Result<TriMesh, ReadError> {
        let mut part = Part::default();
        let (mut corners, mut places) = (Vec::new(), Vec::new());
        let end = self.read + most;
        while self.read < end {
            if !self.lines.advance()? {
                let what =
                    format!("it ends after {} of {} faces: it has changed", self.read, self.faces);
                return Err(self.lines.fault(what));
            }
            match self.lines.words().next() {
                Some(b"v") => self.before[0] += 1,
                Some(b"vn") => self.before[1] += 1,
                Some(b"f") => {
                    self.corners(&mut corners)?;
                    self.read += 1;
                    let place = |&[vertex, _]: &[u32; 2]| self.positions[vertex as usize];
                    places.clear();
                    places.extend(corners.iter().map(place));
                    let division = triangulate(&places, |triangle| {
                        let vertices = triangle.map(|k| part.vertex(corners[k]));
                        part.indices.push(vertices);
                    });
                    self.fanned += u64::from(division == Division::Fanned);
                }
                _ => {}
            }
        }
        let with_normal = part.vertices.iter().filter(|[_, normal]| *normal != u32::MAX).count();
        if with_normal < part.vertices.len() {
            self.normals_left_out += with_normal as u64;
        }
        Ok(self.mesh(part))
    }

    /// The numbers of the position and of the normal of each corner of a face; no normal is the
    /// largest number.
    fn corners(&self, corners: &mut Vec<[u32; 2]>) -> Result<(), ReadError> {
        corners.clear();
        let words = self.lines.words().skip(1).take_while(|word| !word.starts_with(b"#"));
        for word in words {
            let mut fields = word.split(|&b| b == b'/');
            let all = [self.positions.len(), self.normals.len()];
            let number = |field: &[u8], of: usize, name: &str| {
                let text = str::from_utf8(field).ok();
                let given: i64 = text.and_then(|text| text.parse().ok()).unwrap_or(0);
                // From 1 on, or back from the last that stands before the face.
                let number = if given < 0 { self.before[of] as i64 + given } else { given - 1 };
                match usize::try_from(number) {
                    Ok(number) if number < all[of] => Ok(number as u32),
                    _ => {
                        let (word, count) = (shown(word), all[of]);
                        let what = format!("`{word}` names no {name}: there are {count}");
                        Err(self.lines.fault(what))
                    }
                }
            };
            let position = number(fields.next().unwrap_or_default(), 0, "vertex")?;
            let normal = match fields.nth(1) {
                Some(field) if !field.is_empty() => number(field, 1, "normal")?,
                _ => u32::MAX,
            };
            corners.push([position, normal]);
        }
        Ok(())
    }

    fn mesh(&self, part: Part) -> TriMesh {
        let Part { vertices, indices, .. } = part;
        let position = |&[k, _]: &[u32; 2]| (self.positions[k as usize] - self.origin).as_vec3();
        let positions = vertices.iter().map(position).collect();
        let mut mesh = TriMesh { origin: self.origin, positions, indices, ..TriMesh::default() };
        if !self.colors.is_empty() {
            let color = |&[k, _]: &[u32; 2]| self.colors[k as usize].extend(1.0).to_array();
            mesh.colors = Some(Attribute::per_vertex(vertices.iter().map(color).collect()));
        }
        let normal = |&[_, k]: &[u32; 2]| self.normals.get(k as usize).copied();
        let normals: Option<Vec<Vec3>> = vertices.iter().map(normal).collect();
        mesh.normals = normals.filter(|all| !all.is_empty()).map(Attribute::per_vertex);
        mesh
    }
}

/// The triangles of a piece on their way into a mesh.
#[derive(Default)]
struct Part {
    /// Numbers of a position and a normal of the file.
    vertices: Vec<[u32; 2]>,
    numbers: HashMap<[u32; 2], u32>,
    indices: Vec<[u32; 3]>,
}

impl Part {
    /// The number in the piece of a vertex of the file.
    fn vertex(&mut self, corner: [u32; 2]) -> u32 {
        *self.numbers.entry(corner).or_insert_with(|| {
            self.vertices.push(corner);
            self.vertices.len() as u32 - 1
        })
    }
}

impl Iterator for ObjPieces {
    type Item = Result<TriMesh, ReadError>;

    /// The next piece; nothing after an error.
    fn next(&mut self) -> Option<Self::Item> {
        let left = self.faces - self.read;
        if left == 0 {
            return None;
        }
        let piece = self.next_piece(left.min(self.piece as u64));
        if piece.is_err() {
            self.faces = self.read;
        }
        Some(piece)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::shapes::icosphere;
    use crate::read::Content;
    use rt_core::math::SplitMix64;
    use std::fmt::Write as _;

    /// A ball with normals and colours, after a square whose corners are named from behind.
    fn ball() -> String {
        let mesh = icosphere(3);
        let mut text = "# a ball\nv 2 0 0 1 0 0\nv 3 0 0 1 0 0\nv 3 1 0 1 0 0\nv 2 1 0 1 0 0\n\
            vn 0 0 1\nf -4//-1 -3//-1 -2//-1 -1//-1\n"
            .to_string();
        for p in &mesh.positions {
            let [x, y, z] = p.to_array();
            writeln!(text, "v {x} {y} {z} {} {} 0.5", x.abs(), y.abs()).unwrap();
            writeln!(text, "vn {x} {y} {z}").unwrap();
        }
        for t in &mesh.indices {
            let [a, b, c] = t.map(|k| format!("{0}//{1}", k + 5, k + 2));
            writeln!(text, "f {a} {b} {c}").unwrap();
        }
        text
    }

    fn written(text: &str) -> (tempfile::TempDir, PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("ball.obj");
        std::fs::write(&path, text).unwrap();
        (dir, path)
    }

    /// Position, normal and colour.
    type Corner = (DVec3, Option<Vec3>, [f32; 4]);

    fn triangles(mesh: &TriMesh) -> Vec<[Corner; 3]> {
        let colors = &mesh.colors.as_ref().expect("colours").values;
        let corner = |k: u32| {
            let k = k as usize;
            let normal = mesh.normals.as_ref().map(|n| n.values[k]);
            (mesh.origin + mesh.positions[k].as_dvec3(), normal, colors[k])
        };
        mesh.indices.iter().map(|t| t.map(corner)).collect()
    }

    #[test]
    fn pieces_have_the_faces_of_the_whole_with_normals_and_colours() {
        let (_dir, path) = written(&ball());
        let Content::Scene(whole) = super::super::obj::read(&path).unwrap().content else {
            panic!("no scene")
        };
        let expected: Vec<_> = whole.meshes.iter().flat_map(|m| triangles(&m.mesh)).collect();
        assert_eq!(expected.len(), 1282);
        for size in [0, 7, 1281, 5000] {
            let pieces = ObjPieces::open(&path, size).unwrap();
            assert_eq!(pieces.faces(), 1281);
            let pieces: Vec<TriMesh> = pieces.map(Result::unwrap).collect();
            assert_eq!(pieces.len(), 1281_usize.div_ceil(size.max(1)));
            assert!(pieces.iter().all(|p| p.check().is_ok()));
            assert!(pieces.iter().flat_map(triangles).eq(expected.iter().copied()), "{size}");
        }
    }

    #[test]
    fn what_is_left_out_is_known_and_normals_of_some_corners_are_left_out() {
        let (_dir, path) = written(
            "mtllib a.mtl\nv 0 0 0\nv 1 0 0 # a comment\nv 0 1 0 1\nvt 0 0\nvn 0 0 1\nl 1 2\np 1\n\
             usemtl a\nf 1/1/1 2/1/1 3/1/1\nf 1/1 2/1 3/1\nf 1 2\n",
        );
        let mut pieces = ObjPieces::open(&path, 1).unwrap();
        let expected = ObjContents {
            materials: true,
            texcoords: true,
            colors_of_some: false,
            points_and_lines: 2,
        };
        assert_eq!(pieces.contents(), expected);
        let (_dir, some) = written("v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
        assert!(ObjPieces::open(&some, 1).unwrap().contents().colors_of_some);
        let first = pieces.next().unwrap().unwrap();
        assert!(first.normals.is_some() && first.colors.is_none());
        assert!(pieces.next().unwrap().unwrap().normals.is_none());
        assert_eq!(pieces.next().unwrap().unwrap().num_triangles(), 0);
        assert!(pieces.next().is_none());
        assert_eq!(pieces.normals_left_out(), 0);
        let mut whole = ObjPieces::open(&path, 9).unwrap();
        let pieces: Vec<_> = whole.by_ref().map(Result::unwrap).collect();
        assert!(pieces.len() == 1 && pieces[0].normals.is_none());
        assert_eq!(whole.normals_left_out(), 3);
    }

    #[test]
    fn errors_name_the_file_the_line_the_value_and_a_cure() {
        for (text, named) in [
            ("v 0 0 0\nv 1 x 0\n", ["line 2", "`x` is not a number"]),
            ("v 0 0 0\n\nv 1 2\n", ["line 3", "2 numbers where three"]),
            (
                "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 4\n",
                ["line 4", "`4` names no vertex: there are 3"],
            ),
            ("v 0 0 0\nf 0 1 1\n", ["line 2", "`0` names no vertex"]),
            ("v 0 0 0\nf 1 1 -2\nv 1 1 1\n", ["line 2", "`-2` names no vertex"]),
            ("v 0 0 0\nf 1//1 1//1 1//1\n", ["line 2", "`1//1` names no normal: there are 0"]),
            ("v 0 0 0\nf 1 1 99999999999999999999\n", ["line 2", "names no vertex"]),
        ] {
            let (_dir, path) = written(text);
            let all: Result<Vec<_>, _> = match ObjPieces::open(&path, 9) {
                Ok(pieces) => pieces.collect(),
                Err(e) => Err(e),
            };
            let error = all.expect_err(text).to_string();
            for part in ["ball.obj", BROKEN].iter().chain(&named) {
                assert!(error.contains(part), "{text:?}: {error}");
            }
        }
        let (_dir, path) = written(&"7".repeat(2 << 20));
        let error = ObjPieces::open(&path, 9).err().expect("no lines").to_string();
        assert!(error.contains("line 1") && error.contains("longer than"), "{error}");
    }

    #[test]
    fn far_from_zero_all_pieces_have_the_origin_of_the_whole() {
        let (_dir, path) =
            written("v 5000.25 0 0\nv 5001 0 0\nv 5001 1 0\nv 5000.25 1 0.125\nf 1 2 3\nf 1 3 4\n");
        let pieces: Vec<_> = ObjPieces::open(&path, 1).unwrap().map(Result::unwrap).collect();
        assert!(pieces[0].origin != DVec3::ZERO && pieces[0].origin == pieces[1].origin);
        let corner = pieces[1].origin + pieces[1].positions[2].as_dvec3();
        assert_eq!(corner, DVec3::new(5000.25, 1.0, 0.125));
    }

    #[test]
    fn damaged_files_end_in_errors_or_faces_and_never_in_a_panic() {
        let sound = ball().into_bytes();
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("ball.obj");
        let mut random = SplitMix64::new(6);
        let mut below = |n: usize| (random.unit() * n as f64) as usize;
        let (mut refused, mut read) = (0, 0);
        for _ in 0..400 {
            let mut bytes = sound.clone();
            match below(4) {
                0 => bytes.truncate(below(sound.len())),
                1 => drop(bytes.drain(below(sound.len())..).take(below(50))),
                2 => bytes[below(sound.len())] = b"-/# \n0f9\xff"[below(9)],
                _ => {
                    let (at, from) = (below(sound.len()), below(sound.len() - 60));
                    let copied = sound[from..from + below(60)].to_vec();
                    bytes.splice(at..at, copied);
                }
            }
            std::fs::write(&path, &bytes).unwrap();
            let all: Result<Vec<_>, _> = match ObjPieces::open(&path, 100) {
                Ok(pieces) => pieces.collect(),
                Err(e) => Err(e),
            };
            match all {
                Ok(pieces) => {
                    assert!(pieces.iter().all(|p| p.check().is_ok()));
                    read += 1;
                }
                Err(e) => {
                    let text = e.to_string();
                    assert!(text.contains("ball.obj: ") && text.contains("; "), "{text}");
                    refused += 1;
                }
            }
        }
        assert!(refused > 50 && read > 50, "{refused}, {read}");
    }
}
