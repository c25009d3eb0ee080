//! Files that are larger than the memory for them: read in pieces and stored, they take no more
//! than a stated budget.

use datasets::model::{Dataset, Points, UnstructuredGrid};
use datasets::read::obj_pieces::ObjPieces;
use datasets::read::ply_pieces::PlyPieces;
use datasets::read::stl_pieces::StlPieces;
use datasets::read::vtk_xml::CellPieces;
use datasets::read::{Content, LoadedFile, ReadError};
use datasets::stored_mesh;
use datasets::write::{VtkOptions, write_vtk};
use peak_alloc::PeakAlloc;
use rt_core::glam::DVec3;
use rt_core::mesh::TriMesh;
use std::io::{BufWriter, Write as _};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

/// The tests measure the process, so they run one at a time.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// Vertices along an edge of the sheet, which is written several times over.
const EDGE: u32 = 120;
/// Faces of a piece.
const PIECE: usize = 1 << 12;
/// Bytes for triangles that wait to be stored.
const WAITING: usize = 1 << 20;
/// What reading and storing may take.
const BUDGET: usize = 12 << 20;

/// The two triangles of each square of a sheet, `times` times.
fn triangles(times: u32) -> impl Iterator<Item = [u32; 3]> {
    let squares = (0..EDGE - 1).flat_map(|y| (0..EDGE - 1).map(move |x| y * EDGE + x));
    let both = |k: u32| [[k, k + 1, k + EDGE], [k + 1, k + EDGE + 1, k + EDGE]];
    (0..times).flat_map(move |_| squares.clone().flat_map(both))
}

fn corner(k: u32) -> [f32; 3] {
    let (x, y) = ((k % EDGE) as f32, (k / EDGE) as f32);
    [x, y, (0.3 * x).sin() + (0.2 * y).cos()]
}

fn write_obj(path: &Path, times: u32) {
    let mut file = BufWriter::new(std::fs::File::create(path).unwrap());
    for k in 0..EDGE * EDGE {
        let [x, y, z] = corner(k);
        writeln!(file, "v {x} {y} {z}").unwrap();
    }
    for t in triangles(times) {
        let [a, b, c] = t.map(|k| k + 1);
        writeln!(file, "f {a}/1 {b}/1 {c}/1").unwrap();
    }
    file.flush().unwrap();
}

/// Stores pieces; asserts that it stayed within the budget, of which the file is a multiple.
fn store_within_budget(file: &Path, expected: u64, pieces: impl Iterator<Item = TriMesh>) {
    let length = std::fs::metadata(file).unwrap().len();
    assert!(length > 2 * BUDGET as u64, "{}: {length} bytes", file.display());
    let stored = file.with_extension("rtmesh");
    let mut writer = stored_mesh::create(&stored, DVec3::ZERO).unwrap();
    writer.set_memory(WAITING);
    for piece in pieces {
        writer.add_mesh(&piece).unwrap();
    }
    let report = stored_mesh::finish(writer).unwrap();
    let peak = ALLOCATED.peak_usage();
    assert!(peak < BUDGET, "{}: {} MiB", file.display(), peak >> 20);
    assert_eq!((report.triangles, report.skipped), (expected, 0));
}

fn mesh_of(file: LoadedFile) -> TriMesh {
    let Content::Data(data) = &file.content else { panic!("no data") };
    data.to_trimesh_at(None, Some(DVec3::ZERO)).unwrap().0
}

#[test]
fn files_of_several_times_the_budget_are_stored_within_it() {
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let dir = tempfile::tempdir().unwrap();
    let of = |name: &str| dir.path().join(name);
    let times = |bytes: usize| (2 * BUDGET).div_ceil(2 * bytes * (EDGE as usize - 1).pow(2)) + 1;
    let count = |times: usize| times as u64 * 2 * u64::from(EDGE - 1).pow(2);

    let (path, many) = (of("sheet.obj"), times(14));
    write_obj(&path, many as u32);
    ALLOCATED.reset_peak_usage();
    let pieces = ObjPieces::open(&path, PIECE).unwrap();
    store_within_budget(&path, count(many), pieces.map(Result::unwrap));

    let (path, many) = (of("sheet.ply"), times(13));
    let mut file = BufWriter::new(std::fs::File::create(&path).unwrap());
    let head = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\n\
         property float y\nproperty float z\nelement face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        EDGE * EDGE,
        count(many)
    );
    file.write_all(head.as_bytes()).unwrap();
    (0..EDGE * EDGE).flat_map(corner).for_each(|x| file.write_all(&x.to_le_bytes()).unwrap());
    for t in triangles(many as u32) {
        file.write_all(&[3]).unwrap();
        t.iter().for_each(|k| file.write_all(&k.to_le_bytes()).unwrap());
    }
    drop(file);
    ALLOCATED.reset_peak_usage();
    let pieces = PlyPieces::open(&path, PIECE).unwrap().expect("binary");
    store_within_budget(&path, count(many), pieces.map(|piece| mesh_of(piece.unwrap())));

    let (path, many) = (of("sheet.stl"), times(50));
    let mut file = BufWriter::new(std::fs::File::create(&path).unwrap());
    file.write_all(&[0; 80]).unwrap();
    file.write_all(&(count(many) as u32).to_le_bytes()).unwrap();
    for t in triangles(many as u32) {
        file.write_all(&[0; 12]).unwrap();
        t.iter().flat_map(|&k| corner(k)).for_each(|x| file.write_all(&x.to_le_bytes()).unwrap());
        file.write_all(&[0; 2]).unwrap();
    }
    drop(file);
    ALLOCATED.reset_peak_usage();
    let pieces = StlPieces::open(&path, PIECE).unwrap().expect("binary");
    store_within_budget(&path, count(many), pieces.map(Result::unwrap));
}

/// Cells of a solid beam along an edge, and along the other.
const BEAM: [usize; 2] = [24, 500];

/// A beam of hexahedra, long enough for a file that is a multiple of the budget.
fn beam() -> Dataset {
    let [edge, length] = BEAM;
    let n = edge + 1;
    let point = |i: usize| [i % n, i / n % n, i / (n * n)].map(|x| x as f32);
    let points = (0..n * n * (length + 1)).map(point).collect();
    let mut grid = UnstructuredGrid { points: Points::F32(points), ..UnstructuredGrid::default() };
    for cell in 0..edge * edge * length {
        let [x, y, z] = [cell % edge, cell / edge % edge, cell / (edge * edge)];
        let low = x + n * (y + n * z);
        let square = [low, low + 1, low + 1 + n, low + n];
        grid.cells.push(square.into_iter().chain(square.map(|k| k + n * n)).map(|k| k as u32));
        grid.types.push(12);
    }
    Dataset::UnstructuredGrid(grid)
}

#[test]
fn the_surface_of_solid_cells_is_stored_within_the_budget() {
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let dir = tempfile::tempdir().unwrap();
    for (name, compress) in [("plain.vtu", false), ("packed.vtu", true)] {
        let path = dir.path().join(name);
        write_vtk(&path, &beam(), VtkOptions { compress, ..VtkOptions::default() }).unwrap();
        let length = std::fs::metadata(&path).unwrap().len();
        assert!(compress || length > 2 * BUDGET as u64, "{length} bytes");
        ALLOCATED.reset_peak_usage();
        let mut pieces = CellPieces::open(&path, PIECE).unwrap().expect("binary");
        assert!(pieces.may_share_faces());
        pieces.find_shared_faces(|_| Ok::<_, ReadError>(())).unwrap();
        let stored = path.with_extension("rtmesh");
        let mut writer = stored_mesh::create(&stored, DVec3::ZERO).unwrap();
        writer.set_memory(WAITING);
        while let Some(piece) = pieces.next_piece() {
            let piece = piece.unwrap();
            let (data, shared) = (piece.file.dataset().unwrap(), piece.shared_faces);
            let mesh = data.to_trimesh_between(None, Some(DVec3::ZERO), shared.as_ref());
            writer.add_mesh(&mesh.unwrap().0).unwrap();
        }
        let report = stored_mesh::finish(writer).unwrap();
        let peak = ALLOCATED.peak_usage();
        assert!(peak < BUDGET, "{name}: {} MiB", peak >> 20);
        let [edge, length] = BEAM.map(|n| n as u64);
        assert_eq!(report.triangles, 2 * (2 * edge * edge + 4 * edge * length));
    }
}
