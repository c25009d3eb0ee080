//! Truncated and damaged files: readers never panic, never allocate memory that the bytes cannot
//! justify, and always return an error with a cure.

mod sample_files;

use datasets::read::vtk_xml::CellPieces;
use datasets::read::{self, Content, LoadedFile, ReadError};
use peak_alloc::PeakAlloc;
use proptest::prelude::*;
use sample_files::openfoam::{Form, case, collated, decomposed, write};
use sample_files::{amrex, ensight, several};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

/// Reads a file, and applies all conversions.
fn open_and_use(path: &Path) -> Result<LoadedFile, ReadError> {
    within_memory(|| {
        let opened = read::open(path);
        if let Ok(opened) = &opened {
            use_all(opened);
        }
        opened
    })
}

/// Reads bytes as a file of this name, and applies all conversions.
fn read_and_use(name: &str, bytes: &[u8]) -> Result<LoadedFile, ReadError> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    let opened = open_and_use(&path);
    within_memory(|| use_cells_in_pieces(&path));
    if let Err(e) = &opened {
        let text = e.to_string();
        // A damaged name of another file gives an error about that file.
        let named = text.contains(name) || matches!(e, ReadError::Io { .. });
        assert!(named, "the error does not name the file: {text}");
        assert!(text.contains("; "), "no cure in: {text}");
    }
    opened
}

fn use_all(opened: &LoadedFile) {
    // Errors are allowed here, panics are not.
    let Content::Data(data) = &opened.content else {
        let _ = opened.to_meshes(None);
        return;
    };
    let mut names: Vec<String> = Vec::new();
    for leaf in data.leaves() {
        let a = leaf.attributes().unwrap();
        names.extend(a.point.iter().chain(&a.cell).map(|x| x.name.clone()));
    }
    let _ = data.to_trimesh(None);
    for name in &names {
        let _ = (
            data.to_trimesh(Some(name)),
            data.to_lines(Some(name)),
            data.to_points(Some(name)),
            data.to_grid(name),
        );
    }
}

/// Reads the cells of a file three at a time. Errors are allowed, panics are not.
fn use_cells_in_pieces(path: &Path) {
    let is_meant = path.extension().is_some_and(|e| e == "vtp" || e == "vtu");
    let Ok(Some(mut pieces)) = (if is_meant { CellPieces::open(path, 3) } else { Ok(None) }) else {
        return;
    };
    let _ = (pieces.origin(), pieces.find_shared_faces(|_| Ok::<_, ReadError>(())));
    while let Some(Ok(piece)) = pieces.next_piece() {
        use_all(&piece.file);
    }
}

/// What files below 10 kB may take, deflated ones included.
const MOST_BYTES: usize = 256 << 20;

/// What `work` gives. Asserts that it never held more than [`MOST_BYTES`], memory that it asked for
/// and left untouched included. One at a time, so that the file that took them is the one named.
fn within_memory<R>(work: impl FnOnce() -> R) -> R {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    ALLOCATED.reset_peak_usage();
    let result = work();
    let peak = ALLOCATED.peak_usage();
    assert!(peak < MOST_BYTES, "the process held {} MiB", peak >> 20);
    result
}

/// A kind of damage to a file.
#[derive(Debug, Clone)]
enum Damage {
    /// Keep this fraction of the file.
    Truncate(f64),
    /// Overwrite bytes at this position.
    Overwrite(f64, Vec<u8>),
    /// Replace a number at this position.
    Number(f64, &'static str),
    /// Remove bytes at this position.
    Cut(f64, usize),
    /// Repeat bytes at this position.
    Repeat(f64, usize),
}

fn damage() -> impl Strategy<Value = Damage> {
    let numbers = prop::sample::select(vec![
        "0",
        "-1",
        "1",
        "255",
        "65536",
        "2147483647",
        "4294967295",
        "4294967296",
        "9223372036854775807",
        "18446744073709551615",
        "1e308",
        "nan",
        "3.5",
        "",
    ]);
    let bytes = prop_oneof![
        prop::collection::vec(any::<u8>(), 1..4),
        Just(vec![0xff; 4]),
        Just(vec![0xff; 8]),
        Just(vec![0; 4]),
        Just(vec![0xff, 0xff, 0xff, 0x7f]),
        Just(vec![0, 0, 0, 0x40]),
        Just(vec![0x7f, 0xff, 0xff, 0xff]),
    ];
    prop_oneof![
        (0.0..1.0).prop_map(Damage::Truncate),
        (0.0..1.0, bytes).prop_map(|(at, b)| Damage::Overwrite(at, b)),
        (0.0..1.0, numbers).prop_map(|(at, n)| Damage::Number(at, n)),
        (0.0..1.0, 1usize..40).prop_map(|(at, n)| Damage::Cut(at, n)),
        (0.0..1.0, 1usize..40).prop_map(|(at, n)| Damage::Repeat(at, n)),
    ]
}

fn apply(bytes: &mut Vec<u8>, d: &Damage) {
    let len = bytes.len();
    let place = |at: f64| ((at * len as f64) as usize).min(len.saturating_sub(1));
    match d {
        Damage::Truncate(at) => bytes.truncate(place(*at)),
        Damage::Overwrite(at, new) => {
            let start = place(*at);
            bytes.iter_mut().skip(start).zip(new).for_each(|(b, n)| *b = *n);
        }
        Damage::Number(at, new) => {
            let Some(start) = (place(*at)..len).find(|&i| bytes[i].is_ascii_digit()) else {
                return;
            };
            let end = (start..len).find(|&i| !bytes[i].is_ascii_digit()).unwrap_or(len);
            bytes.splice(start..end, new.bytes());
        }
        Damage::Cut(at, n) => {
            let start = place(*at);
            bytes.drain(start..(start + n).min(len));
        }
        Damage::Repeat(at, n) => {
            let start = place(*at);
            let part = bytes[start..(start + n).min(len)].to_vec();
            bytes.splice(start..start, part);
        }
    }
}

#[test]
fn whole_samples_are_read() {
    for (name, bytes) in sample_files::all() {
        let opened = read_and_use(name, &bytes).unwrap_or_else(|e| panic!("{e}"));
        match &opened.content {
            Content::Data(d) => assert!(d.counts().0 > 0, "{name}"),
            Content::Scene(s) => assert!(s.num_triangles() > 0, "{name}"),
        }
    }
}

#[test]
fn every_truncation_is_survived() {
    for (name, bytes) in sample_files::all() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(name);
        for n in (0..bytes.len()).step_by(1 + bytes.len() / 300) {
            std::fs::write(&path, &bytes[..n]).unwrap();
            let _ = open_and_use(&path);
        }
    }
}

/// Random damage found the size of an element in one run of forty.
#[test]
fn every_number_of_a_vtkhdf_file_can_be_the_largest() {
    for (name, bytes) in sample_files::all() {
        if !name.ends_with(".vtkhdf") {
            continue;
        }
        for at in (0..bytes.len() - 3).step_by(4) {
            let mut bytes = bytes.clone();
            bytes[at..at + 4].fill(0xff);
            let _ = read_and_use(name, &bytes);
        }
    }
}

/// Cases per run: enough to find a new fault within days of CI, few enough for every change.
/// `PROPTEST_CASES` overrides the number.
fn cases() -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(1500)
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: cases(),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn every_damage_is_survived(
        which in any::<prop::sample::Index>(),
        damages in prop::collection::vec(damage(), 1..4),
    ) {
        thread_local!(static SAMPLES: Vec<sample_files::Sample> = sample_files::all());
        let (name, mut bytes) = SAMPLES.with(|s| s[which.index(s.len())].clone());
        damages.iter().for_each(|d| apply(&mut bytes, d));
        let _ = read_and_use(name, &bytes);
        }
}

proptest! {
    // Each case writes a dozen files.
    #![proptest_config(ProptestConfig {
        cases: cases() / 5,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn every_damage_to_an_openfoam_case_is_survived(
        form in prop::sample::select(vec![Form::Text, Form::Binary, Form::Zipped]),
        across in prop::sample::select(vec!["patch", "empty", "wedge"]),
        parts in 0usize..4,
        damages in prop::collection::vec((any::<prop::sample::Index>(), damage()), 1..4),
    ) {
        let mut files = match parts {
            0 => case(form, across),
            1 => decomposed(form),
            group => collated(form, group - 1),
        };
        let count = files.len();
        damages.iter().for_each(|(file, d)| apply(&mut files[file.index(count)].1, d));
        let dir = tempfile::tempdir().unwrap();
        write(dir.path(), &files);
        if let Err(e) = open_and_use(dir.path()) {
            prop_assert!(e.to_string().contains("; "), "no cure in: {e}");
        }
        }
}

proptest! {
    // Each case writes seven files.
    #![proptest_config(ProptestConfig {
        cases: cases() / 3,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn every_damage_to_an_ensight_case_is_survived(
        encoding in prop::sample::select(ensight::ENCODINGS.to_vec()),
        damages in prop::collection::vec((any::<prop::sample::Index>(), damage()), 1..4),
    ) {
        let mut files = ensight::case(encoding);
        let count = files.len();
        damages.iter().for_each(|(file, d)| apply(&mut files[file.index(count)].1, d));
        let dir = tempfile::tempdir().unwrap();
        ensight::write(dir.path(), &files);
        if let Err(e) = open_and_use(&dir.path().join("a.case")) {
            prop_assert!(e.to_string().contains("; "), "no cure in: {e}");
        }
        }
}

proptest! {
    // Each case writes five files.
    #![proptest_config(ProptestConfig {
        cases: cases() / 3,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn every_damage_to_a_plotfile_is_survived(
        damages in prop::collection::vec((any::<prop::sample::Index>(), damage()), 1..4),
    ) {
        let mut files = amrex::plotfile();
        let count = files.len();
        damages.iter().for_each(|(file, d)| apply(&mut files[file.index(count)].1, d));
        let dir = tempfile::tempdir().unwrap();
        amrex::write(dir.path(), &files);
        if let Err(e) = open_and_use(dir.path()) {
            prop_assert!(e.to_string().contains("; "), "no cure in: {e}");
        }
        }

    #[test]
    fn every_damage_to_levels_and_slices_is_survived(
        which in 0usize..4,
        damages in prop::collection::vec(damage(), 1..4),
    ) {
        let dir = tempfile::tempdir().unwrap();
        several::write_boxes(dir.path());
        several::write_slices(dir.path(), &vec![vec![7; 12]; 4], b"");
        let (name, text) = match which {
            0 => ("a.vthb", several::levels("vtkOverlappingAMR", "1.1", "spacing=\"1 1 1\"")),
            1 => ("a.nhdr", several::nrrd_of_slices("raw", "data file: s.%03d 7 10 1\n")),
            2 => ("a.nhdr", several::nrrd_of_slices("raw", "data file: LIST\ns.007\ns.008\n")),
            _ => ("a.mhd", several::metaimage_of_slices("s.%03d 7 10 1\n")),
        };
        let mut bytes = text.into_bytes();
        damages.iter().for_each(|d| apply(&mut bytes, d));
        std::fs::write(dir.path().join(name), bytes).unwrap();
        if let Err(e) = open_and_use(&dir.path().join(name)) {
            prop_assert!(e.to_string().contains("; "), "no cure in: {e}");
        }
        }
}

/// Asserts that the file is rejected with a message that contains all of `words`.
fn refused(name: &str, bytes: &[u8], words: &[&str]) {
    let e = read_and_use(name, bytes).err().unwrap_or_else(|| panic!("{name} was read"));
    let text = e.to_string();
    words.iter().for_each(|w| assert!(text.contains(w), "`{w}` is not in: {text}"));
}

#[test]
fn declared_sizes_beyond_the_file_are_refused_before_memory_is_taken() {
    refused(
        "a.vtk",
        b"# vtk DataFile Version 3.0\nx\nBINARY\nDATASET POLYDATA\nPOINTS 999999999999 float\n0000",
        &["at byte 79", "2999999999997 coordinates", "truncated"],
    );
    refused(
        "a.vtk",
        b"# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 6148914691236517206 \
          double\n0 0 0",
        &["truncated"],
    );
    refused(
        "a.ply",
        b"ply\nformat binary_little_endian 1.0\nelement vertex \
                       18446744073709551615\nproperty float x\nproperty float y\nproperty float \
                       z\nend_header\n",
        &["18446744073709551615"],
    );
    refused(
        "a.nrrd",
        b"NRRD0004\ntype: float\ndimension: 3\nsizes: 2000000000 2000000000 \
                        2000000000\nendian: little\nencoding: raw\n\n0",
        &["size of the volume"],
    );
    refused("a.nrrd", &sample_files::nrrd("gzip", sample_files::gzip(&[0; 4])), &["unpack"]);
    refused("a_4096x4096x4096_float64.raw", &[0; 64], &["68719476736", "64 bytes"]);
    let mut stl = vec![0u8; 84];
    stl[80..].copy_from_slice(&[0xff; 4]);
    refused("a.stl", &stl, &["4294967295 triangles", "truncated"]);
    let mut glb = sample_files::glb();
    glb[8..12].copy_from_slice(&[5, 0, 0, 0]);
    refused("a.glb", &glb, &["at byte 8", "5 bytes"]);
    let normal = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//6148914691236517207\n";
    refused("a.obj", normal, &["in line 5", "6148914691236517207"]);
    // A megabyte of zeros compresses to a kilobyte; a header that declares a terabyte must not
    // cause its allocation.
    let bomb = sample_files::raw_appended("vtkZLibDataCompressor", sample_files::zlib);
    let at = bomb.windows(4).position(|w| w == [20, 0, 0, 0]).unwrap();
    let mut bomb = bomb;
    bomb[at..at + 4].copy_from_slice(&[0, 0, 0, 0x40]);
    refused("a.vti", &bomb, &["array `p`", "cannot come from"]);
}

#[test]
fn huge_extent_without_arrays_makes_a_box_not_an_avalanche() {
    let file = b"<VTKFile type=\"ImageData\"><ImageData WholeExtent=\"0 2000000000 0 2000000000 0 \
                 2000000000\"><Piece Extent=\"0 2000000000 0 2000000000 0 \
                 2000000000\"/></ImageData></VTKFile>";
    // 8e27 points do not fit in 64 bits; counts saturate and the surface is not built.
    let opened = read_and_use("a.vti", file).unwrap();
    let (mesh, _) = opened.dataset().unwrap().to_trimesh(None).unwrap();
    assert!(mesh.num_triangles() <= 12);
    let small = String::from_utf8_lossy(file).replace("2000000000", "2000000");
    let (mesh, _) = read_and_use("a.vti", small.as_bytes())
        .unwrap()
        .dataset()
        .unwrap()
        .to_trimesh(None)
        .unwrap();
    assert_eq!(mesh.num_triangles(), 12);
}

#[test]
fn files_that_name_themselves_end_with_an_error() {
    let dir = tempfile::tempdir().unwrap();
    for (name, text) in [
        (
            "loop.pvd",
            "<VTKFile type=\"Collection\"><Collection><DataSet timestep=\"0\" \
             file=\"loop.pvd\"/></Collection></VTKFile>",
        ),
        (
            "loop.pvtp",
            "<VTKFile type=\"PPolyData\"><PPolyData><Piece \
             Source=\"loop.pvtp\"/></PPolyData></VTKFile>",
        ),
        (
            "loop.vtm",
            "<VTKFile type=\"vtkMultiBlockDataSet\"><vtkMultiBlockDataSet><DataSet \
             file=\"loop.vtm\"/></vtkMultiBlockDataSet></VTKFile>",
        ),
        (
            "loop.series",
            "{\"file-series-version\": \"1.0\", \"files\": [{\"name\": \"loop.pvd\", \"time\": 0}]}",
        ),
    ] {
        let path = dir.path().join(name);
        std::fs::write(&path, text).unwrap();
        let e = read::open(&path).unwrap_err().to_string();
        assert!(e.contains("names itself"), "{e}");
    }
}

#[test]
fn deep_nesting_does_not_overflow_the_stack() {
    let deep = format!(
        "<VTKFile type=\"PolyData\">{}{}</VTKFile>",
        "<a>".repeat(100_000),
        "</a>".repeat(100_000)
    );
    let _ = read_and_use("a.vtp", deep.as_bytes());
    let json = format!("{{\"asset\":{}{}}}", "[".repeat(100_000), "]".repeat(100_000));
    let _ = read_and_use("a.gltf", json.as_bytes());
}

#[test]
fn unknown_and_missing_files_are_named() {
    refused("a.h5", b"\x89HDF\r\n\x1a\n....", &["HDF5", "at byte 8", "version 46"]);
    let other = include_bytes!("files/old.h5");
    refused("a.h5", other, &["neither VTKHDF, NetCDF-4 nor CGNS", "PLOT3D"]);
    refused("empty.dat", b"", &["the file is empty"]);
    let e = read::open(Path::new("no/such/file.vti")).unwrap_err().to_string();
    assert!(e.contains("no/such/file.vti") && e.contains("check the name"), "{e}");
}
