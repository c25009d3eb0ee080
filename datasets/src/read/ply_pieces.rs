//! Binary PLY files piece by piece, for those that are larger than memory: scans of hundreds of
//! millions of triangles are kept so.
//!
//! Faces are read a piece at a time, and with each piece the vertices that its faces name. Vertices
//! that follow the faces' order are read about once; in the worst order each piece reads all.

use super::error::{At, BROKEN, Cursor, Fault, TRUNCATED, io_error};
use super::ply::{Element, Encoding, FORMAT, Property, faces, header, is_corners, rows};
use super::ply_vertices::PlyVertices;
use super::used_points::UsedPoints;
use super::{Content, LoadedFile, ReadError};
use crate::model::{Cells, Dataset, Endian, PolyData, Values};
use glam::DVec3;
use rt_core::mesh::TriMesh;
use std::fs::File;
use std::io::{BufReader, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

/// Longest header that is looked for.
const MOST_HEADER: u64 = 1 << 16;
/// Most corners of a face. Longer ones are a broken file's.
const MOST_CORNERS: u64 = 1 << 16;

/// The faces of a binary PLY file, in pieces. Each has the vertices that it uses, with all of their
/// properties, in the order of the file.
///
/// ```
/// # use datasets::read::ply_pieces::PlyPieces;
/// # let dir = tempfile::tempdir()?;
/// # let path = dir.path().join("scan.ply");
/// # datasets::write::write_ply(&path, &datasets::generate::shapes::icosphere(2))?;
/// let pieces = PlyPieces::open(&path, 100)?.expect("a binary file of vertices and faces");
/// assert_eq!(pieces.faces(), 320);
/// let pieces: Result<Vec<_>, _> = pieces.collect();
/// assert_eq!(pieces?.len(), 4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct PlyPieces {
    file: BufReader<File>,
    path: PathBuf,
    vertices: PlyVertices,
    element: Element,
    endian: Endian,
    /// Faces read so far, and the byte after them.
    read: u64,
    at: u64,
    piece: u64,
}

impl PlyPieces {
    /// Opens a file and reads its header; faces come in pieces of `piece`, at least one. `None`
    /// for text, and for files with anything but one list of vertices and one of faces:
    /// [`super::ply::read`] reads these, and says what is wrong with broken ones.
    ///
    /// # Errors
    /// When the file cannot be read, or its vertices have no position.
    pub fn open(path: &Path, piece: usize) -> Result<Option<PlyPieces>, ReadError> {
        let io = |e| io_error(path, e);
        let mut file = File::open(path).map_err(io)?;
        let length = file.metadata().map_err(io)?.len();
        let mut start = Vec::new();
        (&mut file).take(MOST_HEADER).read_to_end(&mut start).map_err(io)?;
        let mut cursor = Cursor::new(&start);
        let Ok((Encoding::Binary(endian), elements)) = header(&mut cursor) else {
            return Ok(None);
        };
        let body = cursor.pos as u64;
        let Ok([vertex, element]) = <[Element; 2]>::try_from(elements) else { return Ok(None) };
        let plain = vertex.properties.iter().all(|p| p.list.is_none());
        let lists: Vec<&Property> =
            element.properties.iter().filter(|p| p.list.is_some()).collect();
        let corners = matches!(lists[..], [list] if is_corners(&list.name));
        let row: u64 = vertex.properties.iter().map(|p| p.kind.size() as u64).sum();
        let end = vertex.count.checked_mul(row).and_then(|bytes| bytes.checked_add(body));
        let complete = end.is_some_and(|end| end <= length);
        if vertex.name != "vertex" || element.name != "face" || !plain || !corners || !complete {
            return Ok(None);
        }
        let end = end.unwrap_or(0);
        let vertices = PlyVertices {
            file: file.try_clone().map_err(io)?,
            path: path.to_path_buf(),
            element: vertex,
            endian,
            start: body,
            row,
        };
        // Whether they have positions.
        vertices.read(0..0)?;
        let mut file = BufReader::with_capacity(1 << 20, file);
        file.seek(SeekFrom::Start(end)).map_err(io)?;
        let (path, piece) = (path.to_path_buf(), piece.max(1) as u64);
        Ok(Some(PlyPieces { file, path, vertices, element, endian, read: 0, at: end, piece }))
    }

    /// Faces of the file.
    pub fn faces(&self) -> u64 {
        self.element.count
    }

    /// Faces read so far.
    pub fn faces_read(&self) -> u64 {
        self.read
    }

    /// What the positions of all pieces want to be relative to
    /// ([`crate::model::Dataset::to_trimesh_at`]): the origin that [`TriMesh::from_f64_positions`]
    /// chooses for the whole.
    ///
    /// # Errors
    /// When the vertices cannot be read.
    pub fn origin(&self) -> Result<DVec3, ReadError> {
        let bounds = self.vertices.bounds()?;
        Ok(TriMesh::from_f64_positions(&bounds, Vec::new()).origin)
    }

    fn next_piece(&mut self, count: u64) -> Result<LoadedFile, ReadError> {
        let mut bytes = Vec::new();
        for _ in 0..count {
            let before = bytes.len() as u64;
            let read = self.next_face(&mut bytes);
            read.map_err(|e| self.fault(e))?;
            self.read += 1;
            self.at += bytes.len() as u64 - before;
        }
        let fault = |f: Fault| f.in_file(&self.path, FORMAT);
        let some = Element { count, ..self.element.clone() };
        let columns =
            rows(&mut Cursor::new(&bytes), &some, Encoding::Binary(self.endian)).map_err(fault)?;
        drop(bytes);
        let (mut piece, mut warnings) = (PolyData::default(), Vec::new());
        faces(&some, columns, &mut piece, &mut warnings).map_err(fault)?;
        let missing = self.take_vertices(&mut piece)?;
        if missing > 0 {
            warnings
                .push(format!("{missing} point ids do not exist; their faces will be left out"));
        }
        let content = Content::Data(Dataset::PolyData(piece));
        Ok(LoadedFile { format: FORMAT, content, warnings, time_steps: Vec::new() })
    }

    /// Appends the bytes of the next face.
    fn next_face(&mut self, bytes: &mut Vec<u8>) -> std::io::Result<()> {
        for p in &self.element.properties {
            let start = bytes.len();
            let Some(length) = p.list else {
                bytes.resize(start + p.kind.size(), 0);
                self.file.read_exact(&mut bytes[start..])?;
                continue;
            };
            bytes.resize(start + length.size(), 0);
            self.file.read_exact(&mut bytes[start..])?;
            let corners = Values::from_bytes(length, &bytes[start..], self.endian).get_f64(0);
            if !(0.0..=MOST_CORNERS as f64).contains(&corners) {
                let what = format!("the length of a list is {corners}");
                return Err(std::io::Error::new(std::io::ErrorKind::InvalidData, what));
            }
            let start = bytes.len();
            bytes.resize(start + corners as usize * p.kind.size(), 0);
            self.file.read_exact(&mut bytes[start..])?;
        }
        Ok(())
    }

    /// What went wrong with the next face.
    fn fault(&self, e: std::io::Error) -> ReadError {
        let (what, cure) = match e.kind() {
            std::io::ErrorKind::UnexpectedEof => {
                (format!("it ends after {} of {} faces", self.read, self.faces()), TRUNCATED)
            }
            std::io::ErrorKind::InvalidData => (format!("face {}: {e}", self.read), BROKEN),
            _ => return io_error(&self.path, e),
        };
        Fault::new(At::Byte(self.at), what, cure).in_file(&self.path, FORMAT)
    }

    /// Gives a piece the vertices that its faces use. Returns how many numbers have none.
    fn take_vertices(&self, piece: &mut PolyData) -> Result<usize, ReadError> {
        let exists = |&id: &u32| Some(u64::from(id)).filter(|&id| id < self.vertices.count());
        let ids = piece.polys.connectivity();
        let UsedPoints { numbers, places, missing } = UsedPoints::of(|| ids.iter().map(exists));
        let ends = piece.polys.ends().iter().map(|&end| end as i64);
        piece.polys = Cells::from_ends(ends, places)
            .map_err(|b| Fault::field("element `face`", format!("face {} has no end", b.cell)))
            .map_err(|f| f.in_file(&self.path, FORMAT))?;
        let read = self.vertices.gathered(&numbers)?;
        piece.points = read.points;
        piece.attributes.point_normals = read.attributes.point_normals;
        piece.attributes.point_scalars = read.attributes.point_scalars;
        piece.attributes.point_texcoords = read.attributes.point_texcoords;
        piece.attributes.point = read.attributes.point;
        Ok(missing)
    }
}

impl Iterator for PlyPieces {
    type Item = Result<LoadedFile, ReadError>;

    /// The next piece; nothing after an error.
    fn next(&mut self) -> Option<Self::Item> {
        let left = self.element.count - self.read;
        if left == 0 {
            return None;
        }
        let piece = self.next_piece(left.min(self.piece));
        if piece.is_err() {
            self.element.count = self.read;
        }
        Some(piece)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::shapes::icosphere;
    use crate::write::write_ply;
    use glam::Vec3;
    use rt_core::math::SplitMix64;
    use rt_core::mesh::Attribute;

    /// A ball with normals, colours and scalars.
    fn ball() -> TriMesh {
        let mut mesh = icosphere(3);
        let colors = mesh.positions.iter().map(|p| [p.x.abs(), p.y.abs(), 0.5, 1.0]).collect();
        mesh.colors = Some(Attribute::per_vertex(colors));
        mesh
    }

    fn triangles(file: &LoadedFile) -> TriMesh {
        let Content::Data(data) = &file.content else { panic!("no data") };
        let marked = data.attributes().and_then(|a| a.point_scalars.clone());
        data.to_trimesh_at(marked.as_deref(), Some(DVec3::ZERO)).unwrap().0
    }

    fn pieces(path: &Path, size: usize) -> Vec<Result<LoadedFile, ReadError>> {
        PlyPieces::open(path, size).unwrap().expect("binary").collect()
    }

    #[test]
    fn pieces_have_the_faces_of_the_whole_with_their_properties() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("ball.ply");
        write_ply(&path, &ball()).unwrap();
        let whole = triangles(&super::super::ply::read(&path).unwrap());
        assert!(whole.colors.is_some());
        let of = |mesh: &TriMesh| -> Vec<_> {
            let at = |i: usize| {
                let corners = mesh.indices[i].map(|k| k as usize);
                let colors = &mesh.colors.as_ref().expect("colours").values;
                let normal = |k: usize| mesh.normals.as_ref().map(|n| n.values[k]);
                (
                    corners.map(|k| mesh.positions[k]),
                    corners.map(|k| colors[k]),
                    corners.map(normal),
                )
            };
            (0..mesh.num_triangles()).map(at).collect()
        };
        for size in [0, 7, 1280, 5000] {
            let parts = pieces(&path, size).into_iter().map(|p| triangles(&p.unwrap()));
            let parts: Vec<TriMesh> = parts.collect();
            assert_eq!(parts.len(), 1280_usize.div_ceil(size.max(1)));
            let all: Vec<_> = parts.iter().flat_map(&of).collect();
            assert!(all == of(&whole), "{size}");
        }
    }

    #[test]
    fn polygons_big_endian_numbers_and_missing_vertices_are_read_as_in_the_whole() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("quads.ply");
        let mut bytes = b"ply\nformat binary_big_endian 1.0\nelement vertex 5\nproperty double x\n\
            property double y\nproperty double z\nelement face 3\nproperty uchar part\n\
            property list ushort uint vertex_index\nend_header\n"
            .to_vec();
        for k in 0..5u32 {
            let p = [f64::from(k % 2), f64::from(k / 2), 1.0];
            bytes.extend(p.iter().flat_map(|x| x.to_be_bytes()));
        }
        for (part, ids) in [(7u8, &[0u32, 1, 3, 2][..]), (8, &[0, 1, 9]), (9, &[2, 3, 4])] {
            bytes.push(part);
            bytes.extend((ids.len() as u16).to_be_bytes());
            bytes.extend(ids.iter().flat_map(|i| i.to_be_bytes()));
        }
        std::fs::write(&path, bytes).unwrap();
        let parts: Vec<LoadedFile> = pieces(&path, 2).into_iter().map(Result::unwrap).collect();
        assert_eq!(parts[0].warnings.len(), 1);
        assert!(parts[0].warnings[0].starts_with("1 point ids"), "{:?}", parts[0].warnings);
        let parts: Vec<TriMesh> = parts.iter().map(triangles).collect();
        assert_eq!(parts.iter().map(TriMesh::num_triangles).collect::<Vec<_>>(), [2, 1]);
        let whole = triangles(&super::super::ply::read(&path).unwrap());
        let of = |mesh: &TriMesh| -> Vec<_> {
            (0..mesh.num_triangles()).map(|i| mesh.triangle(i)).collect::<Vec<_>>()
        };
        assert_eq!(parts.iter().flat_map(&of).collect::<Vec<_>>(), of(&whole));
    }

    #[test]
    fn far_from_zero_pieces_have_the_positions_of_the_whole_bit_for_bit() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("far.ply");
        let mut mesh = icosphere(2);
        mesh.positions.iter_mut().for_each(|p| *p += Vec3::new(4321.1, -765.4, 0.1));
        write_ply(&path, &mesh).unwrap();
        let Content::Data(whole) = super::super::ply::read(&path).unwrap().content else {
            panic!("no data")
        };
        let whole = whole.to_trimesh(None).unwrap().0;
        let parts = PlyPieces::open(&path, 50).unwrap().expect("binary");
        let origin = parts.origin().unwrap();
        assert!(origin == whole.origin && origin != DVec3::ZERO, "{origin}");
        let part = |p: Result<LoadedFile, ReadError>| {
            let Content::Data(data) = p.unwrap().content else { panic!("no data") };
            data.to_trimesh_at(None, Some(origin)).unwrap().0
        };
        let of = |mesh: &TriMesh| -> Vec<[Vec3; 3]> {
            (0..mesh.num_triangles()).map(|i| mesh.triangle(i)).collect()
        };
        let parts: Vec<TriMesh> = parts.map(part).collect();
        assert!(parts.len() > 3 && parts.iter().flat_map(&of).collect::<Vec<_>>() == of(&whole));
    }

    #[test]
    fn text_and_other_elements_are_left_to_the_reader_of_whole_files() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.ply");
        let open = |text: &str| {
            std::fs::write(&path, text).unwrap();
            PlyPieces::open(&path, 9).unwrap().is_some()
        };
        let head = "ply\nformat binary_little_endian 1.0\n";
        let vertex = "element vertex 0\nproperty float x\nproperty float y\nproperty float z\n";
        let face = "element face 0\nproperty list uchar int vertex_indices\n";
        assert!(open(&format!("{head}{vertex}{face}end_header\n")));
        assert!(!open(&format!("ply\nformat ascii 1.0\n{vertex}{face}end_header\n")));
        assert!(!open(&format!("{head}{vertex}end_header\n")));
        assert!(!open(&format!("{head}{vertex}{face}element edge 0\nend_header\n")));
        assert!(!open(&format!("{head}{vertex}{face}")));
        assert!(!open(&format!("{head}{}{face}end_header\n", vertex.replace(" 0", " 9"))));
        assert!(!open(""));
    }

    #[test]
    fn damaged_files_end_in_errors_or_faces_and_never_in_a_panic() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("ball.ply");
        write_ply(&path, &icosphere(1)).unwrap();
        let sound = std::fs::read(&path).unwrap();
        let mut random = SplitMix64::new(5);
        let mut below = |n: usize| (random.unit() * n as f64) as usize;
        let mut refused = 0;
        for _ in 0..500 {
            let mut bytes = sound.clone();
            if below(3) == 0 {
                bytes.truncate(below(sound.len()));
            } else {
                let at = below(sound.len());
                bytes[at] ^= 1 << below(8);
            }
            std::fs::write(&path, &bytes).unwrap();
            match PlyPieces::open(&path, 20) {
                Ok(Some(pieces)) => {
                    for piece in pieces {
                        let Ok(piece) = piece else {
                            refused += 1;
                            continue;
                        };
                        let Content::Data(data) = &piece.content else { panic!("no data") };
                        let _ = data.to_trimesh(None);
                    }
                }
                Ok(None) | Err(_) => refused += 1,
            }
        }
        assert!(refused > 100, "{refused}");
        std::fs::write(&path, &sound[..sound.len() - 20]).unwrap();
        let error = pieces(&path, 50).pop().unwrap().unwrap_err().to_string();
        assert!(error.contains("ball.ply") && error.contains("of 80 faces"), "{error}");
    }
}
