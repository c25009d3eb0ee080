//! Stored volumes in files: read plane by plane against the whole file, cut, changed, rendered.

use datasets::read::volume_planes::VolumePlanes;
use datasets::read::{self, ReadError};
use datasets::stored_volume::{create, finish, open};
use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use proptest::prelude::*;
use rt_core::glam::UVec3;
use rt_core::prelude::*;
use rt_core::render::{RenderError, render};
use rt_core::shapes::{Isosurface, IsosurfaceNormals, IsosurfaceOptions, Shape};
use rt_core::stored_volume::{StoredIsosurface, StoredVolume, ValueType};
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const DIMS: UVec3 = UVec3::new(35, 7, 34);

/// A wave of about 8 bits.
fn wave(i: u32) -> i64 {
    let p = UVec3::new(i % DIMS.x, i / DIMS.x % DIMS.y, i / DIMS.x / DIMS.y).as_dvec3();
    (60.0 * ((0.3 * p.x).sin() + (0.2 * p.y + 0.25 * p.z).cos())) as i64
}

/// The wave in numbers of one type.
fn bytes<const N: usize>(encode: impl Fn(i64) -> [u8; N]) -> Vec<u8> {
    (0..DIMS.element_product()).flat_map(|i| encode(wave(i))).collect()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).expect("memory");
    encoder.finish().expect("memory")
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).expect("memory");
    encoder.finish().expect("memory")
}

fn nrrd(kind: &str, fields: &str) -> Vec<u8> {
    let [x, y, z] = DIMS.to_array();
    format!(
        "NRRD0004\ntype: {kind}\ndimension: 3\nsizes: {x} {y} {z}\n{fields}spacings: 0.5 1 0.25\n\
         space origin: (1,2,3)\n"
    )
    .into_bytes()
}

fn mhd(kind: &str, fields: &str) -> Vec<u8> {
    let [x, y, z] = DIMS.to_array();
    format!(
        "ObjectType = Image\nNDims = 3\nDimSize = {x} {y} {z}\nElementType = {kind}\n{fields}\
         ElementSpacing = 0.5 1 0.25\nOffset = 1 2 3\n"
    )
    .into_bytes()
}

/// Files of all forms that can be read plane by plane, with the type of value that planes have.
fn files(folder: &Path) -> Vec<(PathBuf, ValueType)> {
    let mut files = Vec::new();
    let mut add = |name: &str, parts: &[&[u8]], values| {
        let path = folder.join(name);
        fs::write(&path, parts.concat()).expect("a new file");
        files.push((path, values));
    };
    let beside = |name: &str, bytes: &[u8]| fs::write(folder.join(name), bytes).expect("a file");
    let u8s = bytes(|v| [(v + 120) as u8]);
    let i16_big = bytes(|v| (v as i16 * 7).to_be_bytes());
    let u16s = bytes(|v| (v as u16).wrapping_add(300).to_le_bytes());
    let f32s = bytes(|v| (v as f32 / 7.0).to_le_bytes());
    let f64_big = bytes(|v| (v as f64 / 7.0).to_be_bytes());
    let i32s = bytes(|v| (v as i32 * 1_000_003).to_le_bytes());

    let raw = "encoding: raw\n";
    add("u8.nrrd", &[&nrrd("uchar", raw), b"\n", &u8s], ValueType::U8);
    let big = nrrd("short", "encoding: raw\nendian: big\n");
    add("i16.nrrd", &[&big, b"\n", &i16_big], ValueType::I16);
    let packed = nrrd("ushort", "encoding: gzip\nendian: little\n");
    add("u16.nrrd", &[&packed, b"\n", &gzip(&u16s)], ValueType::U16);
    beside("rest.bin", &[b"a header of another program", &f32s[..]].concat());
    let end = "encoding: raw\nendian: little\nbyte skip: -1\ndata file: rest.bin\n";
    add("f32.nhdr", &[&nrrd("float", end)], ValueType::F32);
    beside("some.bin", &[b"12345", &f64_big[..]].concat());
    let skip = "encoding: raw\nendian: big\nbyte skip: 5\ndata file: some.bin\n";
    add("f64.nhdr", &[&nrrd("double", skip)], ValueType::F32);

    let local = "ElementDataFile = LOCAL\n";
    add("i8.mha", &[&mhd("MET_CHAR", ""), local.as_bytes(), &bytes(|v| [v as u8])], ValueType::I8);
    let compressed = mhd("MET_USHORT", "CompressedData = True\n");
    add("u16.mha", &[&compressed, local.as_bytes(), &zlib(&u16s)], ValueType::U16);
    beside("ints.raw", &i32s);
    add("i32.mhd", &[&mhd("MET_INT", ""), b"ElementDataFile = ints.raw\n"], ValueType::F32);

    let [x, y, z] = DIMS.to_array();
    add(&format!("named_{x}x{y}x{z}_uint8.raw"), &[&u8s], ValueType::U8);
    let toml = format!(
        "dims = [{x}, {y}, {z}]\ntype = \"i16\"\nendian = \"big\"\nskip_bytes = 3\n\
         spacing = [0.5, 1.0, 0.25]\norigin = [1.0, 2.0, 3.0]\n"
    );
    beside("described.toml", toml.as_bytes());
    add("described.raw", &[b"abc", &i16_big], ValueType::I16);
    files
}

fn store(path: &Path, to: &Path) -> Result<(), ReadError> {
    let planes = VolumePlanes::open(path)?.expect("a file that can be read by planes");
    let mut writer = create(to, planes.layout()).expect("a new file");
    for plane in planes {
        writer.add_plane(&plane?).expect("a plane");
    }
    finish(writer).expect("a complete file");
    Ok(())
}

#[test]
fn volumes_read_plane_by_plane_are_those_of_the_whole_file() {
    let folder = tempfile::tempdir().expect("a folder");
    for (path, values) in files(folder.path()) {
        let stored = folder.path().join("stored.rtvolume");
        store(&path, &stored).unwrap_or_else(|e| panic!("{e}"));
        let volume = open(&stored, 1 << 20).expect("a sound file");
        let opened = read::open(&path).expect("a sound file");
        let data = opened.dataset().expect("data");
        let name = VolumePlanes::open(&path).expect("sound").expect("planes").name().to_owned();
        let grid = data.to_grid(&name).expect("a lattice");
        let layout = volume.layout();
        assert_eq!(layout.values, values, "{}", path.display());
        assert_eq!(
            (layout.dims, layout.origin, layout.spacing),
            (DIMS, grid.origin(), grid.spacing())
        );
        for (i, v) in (0..).zip(grid.values()) {
            let p = UVec3::new(i % DIMS.x, i / DIMS.x % DIMS.y, i / DIMS.x / DIMS.y);
            assert_eq!(volume.value(p).to_bits(), v.to_bits(), "{} {p}", path.display());
        }
        assert_eq!(volume.range(), grid.range());
    }
}

#[test]
fn files_that_are_cut_are_named_before_or_while_they_are_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let stored = folder.path().join("stored.rtvolume");
    for (path, _) in files(folder.path()) {
        let with_values = match path.extension().and_then(|e| e.to_str()) {
            Some("nhdr" | "mhd") => continue,
            _ => path.clone(),
        };
        let bytes = fs::read(&with_values).expect("a file");
        fs::write(&with_values, &bytes[..bytes.len() - 40]).expect("a file");
        let error = store(&path, &stored).expect_err("40 bytes are missing").to_string();
        let file = with_values.display().to_string();
        assert!(error.contains(&file) && error.contains("truncated"), "{error}");
        let left = fs::read_dir(folder.path()).expect("a folder").flatten();
        let left: Vec<_> = left.map(|f| f.file_name()).collect();
        let is_left = |name: &std::ffi::OsString| name.to_string_lossy().ends_with(".partial");
        assert!(!stored.exists() && !left.iter().any(is_left), "{left:?}");
    }
}

#[test]
fn what_must_be_read_as_a_whole_is_left_to_the_other_reader() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, parts: &[&[u8]]| {
        let path = folder.path().join(name);
        fs::write(&path, parts.concat()).expect("a new file");
        path
    };
    let text = nrrd("uchar", "encoding: text\n");
    let turned = mhd("MET_UCHAR", "TransformMatrix = 0 1 0 1 0 0 0 0 1\n");
    let colors = mhd("MET_UCHAR", "ElementNumberOfChannels = 3\n");
    let local = b"ElementDataFile = LOCAL\n";
    for path in [
        write("text.nrrd", &[&text, b"\n1 2 3"]),
        write("turned.mha", &[&turned, local]),
        write("colors.mha", &[&colors, local]),
        write("mesh.stl", &[b"solid"]),
    ] {
        let planes = VolumePlanes::open(&path).expect("a header");
        assert!(planes.is_none(), "{}", path.display());
    }
}

#[test]
fn sizes_that_no_file_can_have_take_no_memory() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("huge.nrrd");
    for encoding in ["raw", "gzip"] {
        let header = format!(
            "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2147483647 2147483647 2\n\
             encoding: {encoding}\n\n"
        );
        fs::write(&path, [header.as_bytes(), &gzip(&[0; 64])].concat()).expect("a new file");
        let error = VolumePlanes::open(&path).err().expect("refused").to_string();
        assert!(error.contains("huge.nrrd") && error.contains("9223372028264841218"), "{error}");
    }
}

fn scene_of(shape: Arc<dyn Shape>) -> Scene {
    let mut scene = SceneBuilder::new();
    scene.shape(shape, Material::matte([0.8; 3]));
    scene.light(Light::directional(DVec3::new(1.0, 0.5, 1.0)));
    scene.build().expect("a scene")
}

fn image(scene: &Scene) -> Result<Frame, RenderError> {
    let target = DVec3::new(9.0, 5.0, 7.0);
    let eye = target + DVec3::new(4.5, -16.5, 10.5);
    let camera =
        Camera::perspective(eye, target, DVec3::Z, 0.8, 1.0, [0.1, 90.0]).expect("a camera");
    let options = RenderOptions {
        effects: Some(Effects::SHADOWS | Effects::AMBIENT_OCCLUSION),
        ..RenderOptions::new(48, 48)
    };
    render(scene, &camera, &options).map(|output| output.frame)
}

fn surface_of(volume: StoredVolume) -> StoredIsosurface {
    StoredIsosurface::new(Arc::new(volume), &[125.0], IsosurfaceNormals::Smooth).expect("a surface")
}

#[test]
fn a_picture_is_that_of_the_volume_in_memory_with_any_budget() {
    let folder = tempfile::tempdir().expect("a folder");
    let (path, _) = files(folder.path()).swap_remove(0);
    let stored = folder.path().join("stored.rtvolume");
    store(&path, &stored).expect("a sound file");
    let opened = read::open(&path).expect("a sound file");
    let grid = opened.dataset().expect("data").to_grid("u8").expect("a lattice");
    let options = IsosurfaceOptions { normals: IsosurfaceNormals::Smooth, ..Default::default() };
    let resident = Isosurface::new(Arc::new(grid), &[125.0], &options).expect("a surface");
    let expected = image(&scene_of(Arc::new(resident))).expect("a picture").color;
    let covered = expected.iter().filter(|c| c[3] > 0.0).count();
    assert!(covered > 400, "{covered} pixels");
    for budget in [0, 100_000, usize::MAX] {
        let surface = surface_of(open(&stored, budget).expect("a sound file"));
        let found = image(&scene_of(Arc::new(surface))).expect("a picture").color;
        assert!(found == expected, "{budget}");
    }
}

#[test]
fn a_render_fails_when_the_file_is_cut_or_changed_below_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let (path, _) = files(folder.path()).swap_remove(0);
    let stored = folder.path().join("stored.rtvolume");
    store(&path, &stored).expect("a sound file");
    let whole = fs::read(&stored).expect("a file");
    let mut changed = whole.clone();
    changed[200..1200].fill(9);
    for bytes in [&whole[..150], &changed] {
        fs::write(&stored, &whole).expect("a file");
        let scene = || scene_of(Arc::new(surface_of(open(&stored, 0).expect("a sound file"))));
        assert!(image(&scene()).is_ok());
        // Another scene: whatever its budget, threads keep the last bricks that they used.
        let scene = scene();
        fs::write(&stored, bytes).expect("a file");
        let error = image(&scene).map(|_| "a picture").expect_err("a brick cannot be read");
        let error = error.to_string();
        assert!(error.contains("stored.rtvolume"), "{error}");
        assert!(error.contains("brick 0") || error.contains("cannot read"), "{error}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn headers_with_random_changes_end_in_planes_or_named_errors(
        which in 0usize..10,
        changes in proptest::collection::vec((0usize..260, any::<u8>()), 1..4),
    ) {
        let folder = tempfile::tempdir().expect("a folder");
        let (path, _) = files(folder.path()).swap_remove(which);
        let mut bytes = fs::read(&path).expect("a file");
        for (at, byte) in changes {
            let at = at % bytes.len();
            bytes[at] = byte;
        }
        fs::write(&path, bytes).expect("a file");
        match VolumePlanes::open(&path) {
            Ok(None) => {}
            Err(e) => prop_assert!(e.to_string().contains(&folder.path().display().to_string())),
            Ok(Some(planes)) => {
                let layout = planes.layout();
                let expected = u64::from(layout.dims.x) * u64::from(layout.dims.y);
                for plane in planes.take(50) {
                    let Ok(plane) = plane else { break };
                    let size = layout.values.bytes() as u64;
                    prop_assert_eq!(plane.len() as u64, expected * size);
                }
            }
        }
    }
}
