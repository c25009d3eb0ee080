//! Binary STL files piece by piece, for those that are larger than memory.

use super::ReadError;
use super::error::{At, Fault, TRUNCATED, io_error};
use super::stl::{FORMAT, HEADER_BYTES, TRIANGLE_BYTES};
use glam::Vec3;
use rt_core::mesh::TriMesh;
use std::fs::File;
use std::io::{BufReader, Read as _};
use std::path::{Path, PathBuf};

/// The triangles of a binary STL file, in pieces. Every triangle has corners of its own.
///
/// ```
/// # use datasets::read::stl_pieces::StlPieces;
/// # let dir = tempfile::tempdir()?;
/// # let path = dir.path().join("part.stl");
/// # let mut bytes = vec![0; 80];
/// # bytes.extend(3u32.to_le_bytes());
/// # bytes.extend([0; 150]);
/// # std::fs::write(&path, bytes)?;
/// let mut pieces = StlPieces::open(&path, 2)?.expect("a binary file");
/// assert_eq!(pieces.triangles(), 3);
/// let sizes: Result<Vec<usize>, _> = pieces.map(|p| p.map(|mesh| mesh.num_triangles())).collect();
/// assert_eq!(sizes?, [2, 1]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct StlPieces {
    file: BufReader<File>,
    path: PathBuf,
    triangles: u64,
    read: u64,
    piece: usize,
}

impl StlPieces {
    /// Opens a file, which is read in pieces of `piece` triangles, at least one. `None` for files
    /// whose length is not that of a binary STL file: [`super::stl::read`] reads text, and says
    /// what is wrong with others.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn open(path: &Path, piece: usize) -> Result<Option<StlPieces>, ReadError> {
        let io = |e| io_error(path, e);
        let mut file = File::open(path).map_err(io)?;
        let length = file.metadata().map_err(io)?.len();
        let mut start = [0; HEADER_BYTES + 4];
        if length < start.len() as u64 {
            return Ok(None);
        }
        file.read_exact(&mut start).map_err(io)?;
        let count = [80, 81, 82, 83].map(|at| start[at]);
        let triangles = u64::from(u32::from_le_bytes(count));
        if length != triangles * TRIANGLE_BYTES as u64 + start.len() as u64 {
            return Ok(None);
        }
        let (file, path) = (BufReader::with_capacity(1 << 20, file), path.to_path_buf());
        Ok(Some(StlPieces { file, path, triangles, read: 0, piece: piece.max(1) }))
    }

    /// Triangles of the file.
    pub fn triangles(&self) -> u64 {
        self.triangles
    }

    fn next_piece(&mut self, count: usize) -> Result<TriMesh, ReadError> {
        let mut mesh = TriMesh::default();
        let mut record = [0; TRIANGLE_BYTES];
        for _ in 0..count {
            self.file.read_exact(&mut record).map_err(|e| {
                if e.kind() != std::io::ErrorKind::UnexpectedEof {
                    return io_error(&self.path, e);
                }
                // The length was right when it was opened.
                let at = HEADER_BYTES as u64 + 4 + self.read * TRIANGLE_BYTES as u64;
                let what = format!("it ends after {} of {} triangles", self.read, self.triangles);
                Fault::new(At::Byte(at), what, TRUNCATED).in_file(&self.path, FORMAT)
            })?;
            let real = |i: usize| f32::from_le_bytes([0, 1, 2, 3].map(|k| record[i + k]));
            let first = mesh.positions.len() as u32;
            // The normal comes first; it is ignored, because it follows from the corners.
            for at in [12, 24, 36] {
                mesh.positions.push(Vec3::new(real(at), real(at + 4), real(at + 8)));
            }
            mesh.indices.push([first, first + 1, first + 2]);
            self.read += 1;
        }
        Ok(mesh)
    }
}

impl Iterator for StlPieces {
    type Item = Result<TriMesh, ReadError>;

    /// The next piece; nothing after an error.
    fn next(&mut self) -> Option<Self::Item> {
        let left = usize::try_from(self.triangles - self.read).unwrap_or(usize::MAX);
        if left == 0 {
            return None;
        }
        let piece = self.next_piece(left.min(self.piece));
        if piece.is_err() {
            self.read = self.triangles;
        }
        Some(piece)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::shapes::icosphere;
    use crate::model::Dataset;
    use crate::read::Content;

    /// A binary file of a ball.
    fn ball(path: &Path) -> TriMesh {
        let mesh = icosphere(3);
        let mut bytes = vec![b' '; HEADER_BYTES];
        bytes[..5].copy_from_slice(b"solid");
        bytes.extend((mesh.num_triangles() as u32).to_le_bytes());
        for t in 0..mesh.num_triangles() {
            bytes.extend([0; 12]);
            let corners: [Vec3; 3] = mesh.triangle(t);
            bytes.extend(corners.iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes));
            bytes.extend([0; 2]);
        }
        std::fs::write(path, bytes).unwrap();
        mesh
    }

    #[test]
    fn pieces_have_the_triangles_of_the_whole_in_order() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("ball.stl");
        let mesh = ball(&path);
        for size in [0, 1, 7, 1280, 5000] {
            let pieces = StlPieces::open(&path, size).unwrap().expect("binary");
            let pieces: Vec<TriMesh> = pieces.map(Result::unwrap).collect();
            let triangles: Vec<[Vec3; 3]> =
                pieces.iter().flat_map(|p| (0..p.num_triangles()).map(|i| p.triangle(i))).collect();
            assert_eq!(triangles.len(), mesh.num_triangles(), "{size}");
            assert!((0..triangles.len()).all(|i| triangles[i] == mesh.triangle(i)), "{size}");
        }
        let Content::Data(Dataset::PolyData(whole)) =
            crate::read::stl::read(&path).unwrap().content
        else {
            panic!("no triangles");
        };
        assert_eq!(whole.polys.len(), mesh.num_triangles());
    }

    #[test]
    fn text_and_cut_files_are_not_read_in_pieces() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("ball.stl");
        ball(&path);
        let whole = std::fs::read(&path).unwrap();
        for length in [0, 83, 84, whole.len() - 1] {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert!(StlPieces::open(&path, 9).unwrap().is_none(), "{length}");
        }
        std::fs::write(&path, "solid a\nendsolid a\n").unwrap();
        assert!(StlPieces::open(&path, 9).unwrap().is_none());
        assert!(StlPieces::open(&dir.path().join("none.stl"), 9).is_err());
    }

    #[test]
    fn a_file_that_is_cut_while_it_is_read_is_an_error_with_its_place() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("ball.stl");
        ball(&path);
        let mut pieces = StlPieces::open(&path, 100).unwrap().expect("binary");
        let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
        file.set_len(84 + 50 * 150 + 7).unwrap();
        assert_eq!(pieces.next().unwrap().unwrap().num_triangles(), 100);
        let error = pieces.next().unwrap().unwrap_err().to_string();
        assert!(error.contains("ball.stl") && error.contains("150 of 1280"), "{error}");
        assert!(pieces.next().is_none());
    }
}
