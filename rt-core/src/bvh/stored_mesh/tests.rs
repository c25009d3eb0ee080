//! Stored meshes against the same triangles in memory, and damaged files.

use super::*;
use crate::bvh::{BuildOptions, Geometry, Instance, World};
use crate::mesh::{MeshSlices, TriMesh};
use crate::ray::Ray;
use crate::shapes::Shape;
use crate::test_shapes::Random;
use glam::{DAffine3, DVec3, Vec3};
use std::sync::{Arc, Mutex};

/// A closed, uneven ball of 2 · rings · 2 · rings triangles.
fn ball(rings: u32) -> TriMesh {
    let n = 2 * rings;
    let at = |i: u32, j: u32| {
        let (a, b) = (
            std::f32::consts::PI * i as f32 / rings as f32,
            std::f32::consts::TAU * (j % n) as f32 / n as f32,
        );
        let radius = 1.0 + 0.1 * (7.0 * a).sin() * (5.0 * b).cos();
        Vec3::new(a.sin() * b.cos(), a.sin() * b.sin(), a.cos()) * radius
    };
    let positions = (0..=rings).flat_map(|i| (0..n).map(move |j| at(i, j))).collect();
    let quad = |i: u32, j: u32| {
        let (a, b) = (i * n + j, i * n + (j + 1) % n);
        [[a, a + n, b + n], [a, b + n, b]]
    };
    let indices = (0..rings).flat_map(|i| (0..n).flat_map(move |j| quad(i, j))).collect();
    TriMesh::new(positions, indices)
}

/// Stores a mesh in pieces of `piece` triangles.
fn store(mesh: &TriMesh, piece: usize) -> (Vec<u8>, StoredMeshReport) {
    let mut writer = StoredMeshWriter::new(Vec::new(), mesh.origin).expect("memory");
    writer.set_memory(52 * 25_000);
    let all = MeshSlices::of_mesh(mesh);
    for indices in all.indices.chunks(3 * piece) {
        writer.add(&MeshSlices { indices, ..all }).expect("a piece");
    }
    writer.finish().expect("a sound mesh")
}

fn world_of(geometry: Geometry) -> World {
    let placed = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
    World::build(vec![geometry], vec![placed], &BuildOptions::default()).expect("a world")
}

fn rays(count: usize) -> Vec<Ray> {
    let mut r = Random::new(7);
    (0..count)
        .map(|i| {
            let origin = r.direction() * if i % 3 == 0 { 0.5 } else { 3.0 };
            let aim = r.direction() * 0.9;
            // Among them rays along the axes, through vertices and edges of the ball.
            let dir = if i % 5 == 0 { Vec3::Z } else { aim - origin };
            Ray::new(origin, dir)
        })
        .collect()
}

#[test]
fn hits_are_those_of_the_mesh_in_memory_bit_for_bit_with_any_budget() {
    let mesh = ball(160);
    let (bytes, report) = store(&mesh, 10_000);
    assert_eq!((report.triangles, report.skipped), (mesh.indices.len() as u64, 0));
    assert!(report.pages > 8, "{report:?}");
    assert!(report.bytes < 17 * report.triangles, "{report:?}");
    let resident = world_of(Geometry::Mesh(Arc::new(mesh)));
    for budget in [0, 300_000, usize::MAX] {
        let stored = Arc::new(StoredMesh::open(bytes.clone(), budget).expect("sound bytes"));
        let world = world_of(Geometry::Shape(stored.clone()));
        let (mut hits, mut blocked) = (0, 0);
        for ray in rays(4000) {
            let (a, b) = (resident.closest(&ray), world.closest(&ray));
            assert_eq!(a.map(|h| h.t.to_bits()), b.map(|h| h.t.to_bits()), "{ray:?}");
            if let (Some(a), Some(b)) = (a, b) {
                hits += 1;
                // Where two triangles are hit at once, another page may answer.
                let number = stored.triangle(b.prim, &ray).expect("the same hit");
                let same = number == u64::from(a.prim);
                assert!(same || (a.u.min(a.v) < 1e-3 || a.u + a.v > 0.999), "{number}, {a:?}");
                if same {
                    assert_eq!((a.u.to_bits(), a.v.to_bits()), (b.u.to_bits(), b.v.to_bits()));
                }
            }
            let short = ray.with_t_max(0.7);
            assert_eq!(resident.occluded(&short), world.occluded(&short), "{ray:?}");
            blocked += u32::from(world.occluded(&short));
        }
        assert!(hits > 2000 && blocked > 100, "{hits} hits, {blocked} blocked");
        let pages = stored.page_use();
        assert!(pages.bytes <= budget.max(200_000), "{pages:?} of {budget}");
        assert_eq!(stored.failure(), None);
        assert!(pages.reads >= report.pages || budget == usize::MAX, "{pages:?}");
    }
}

#[test]
fn the_same_pieces_make_the_same_file_on_one_thread_and_on_four() {
    let mesh = ball(90);
    let files = [1, 4].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| store(&mesh, 7000).0)
    });
    assert!(files[0] == files[1]);
}

#[test]
fn surfaces_have_the_normal_and_a_point_of_the_triangle() {
    let mesh = ball(60);
    let (bytes, _) = store(&mesh, usize::MAX / 3);
    let stored = StoredMesh::open(bytes, 1 << 20).expect("sound bytes");
    let mut hits = 0;
    for ray in rays(600) {
        for page in 0..stored.num_primitives() as u32 {
            let Some(hit) = stored.closest(page, &ray) else { continue };
            hits += 1;
            let surface = stored.surface(page, &hit, &ray);
            let number = stored.triangle(page, &ray).expect("the same hit") as usize;
            let [a, b, c] = mesh.triangle(number).map(|p| p.as_dvec3());
            let normal = (b - a).cross(c - a).normalize();
            assert!(normal.dot(surface.normal.as_dvec3()) > 1.0 - 1e-6);
            let off = normal.dot(surface.point.as_dvec3() - a).abs();
            assert!(off <= f64::from(surface.point_error), "{off:e}, {surface:?}");
            assert!((surface.point - ray.at(hit.t)).length() < 1e-5, "{surface:?}");
        }
    }
    assert!(hits > 300, "{hits}");
}

#[test]
fn triangles_that_cannot_be_hit_are_counted_and_keep_their_numbers() {
    let mut writer = StoredMeshWriter::new(Vec::new(), DVec3::ZERO).expect("memory");
    let corners = [0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 1.0, 1.0, f32::NAN, 0.0, 0.0];
    writer.add(&MeshSlices::new(&corners, &[0, 1, 3, 0, 1, 9, 0, 1, 2])).expect("a piece");
    writer.add(&MeshSlices::new(&[], &[])).expect("an empty piece");
    let (bytes, report) = writer.finish().expect("a sound mesh");
    assert_eq!((report.triangles, report.skipped, report.pages), (3, 2, 1));
    let stored = StoredMesh::open(bytes, 0).expect("sound bytes");
    let up = Ray::new(Vec3::new(0.2, 0.2, 0.0), Vec3::Z);
    assert_eq!(stored.triangle(0, &up), Some(2));
    assert_eq!(stored.triangle(1, &up), None);
}

#[test]
fn a_file_without_triangles_is_an_empty_shape() {
    let writer = StoredMeshWriter::new(Vec::new(), DVec3::ZERO).expect("memory");
    let (bytes, report) = writer.finish().expect("no mesh");
    assert_eq!(report.pages, 0);
    let stored = Arc::new(StoredMesh::open(bytes, 0).expect("sound bytes"));
    let world = world_of(Geometry::Shape(stored));
    assert!(world.closest(&Ray::new(Vec3::ZERO, Vec3::Z)).is_none());
}

#[test]
fn pieces_that_cannot_be_stored_are_refused_by_number() {
    let triangle = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let of = |scale: f32| triangle.map(|x: f32| x * scale);
    let new = || StoredMeshWriter::new(Vec::new(), DVec3::ZERO).expect("memory");
    let mut writer = new();
    let elsewhere = MeshSlices { origin: DVec3::X, ..MeshSlices::new(&triangle, &[0, 1, 2]) };
    writer.add(&MeshSlices::new(&triangle, &[0, 1, 2])).expect("a piece");
    let error = writer.add(&elsewhere).expect_err("another origin");
    assert!(error.to_string().starts_with("piece 1 "), "{error}");
    let error = writer.add(&MeshSlices::new(&triangle, &[0, 1])).expect_err("two numbers");
    assert!(matches!(error, StoredMeshError::Mesh { piece: 1, .. }), "{error}");
    for scale in [1e10, 1e-8] {
        let mut writer = new();
        writer.add(&MeshSlices::new(&of(scale), &[0, 1, 2])).expect("a piece");
        let error = writer.finish().expect_err("coordinates out of range");
        assert!(matches!(error, StoredMeshError::Reach { .. }), "{error}");
    }
}

#[test]
fn bytes_that_were_cut_or_are_something_else_are_refused() {
    let (whole, _) = store(&ball(20), 1000);
    let open = |bytes: &[u8]| StoredMesh::open(bytes.to_vec(), 0).err().map(|e| e.to_string());
    assert_eq!(open(&whole), None);
    for length in [0, 1, 8, 127, 128, 129, whole.len() / 2, whole.len() - 1] {
        let error = open(&whole[..length]).expect("cut bytes");
        assert!(error.contains("bytes in memory"), "{length}: {error}");
    }
    let longer = [&whole[..], &[0]].concat();
    assert!(open(&longer).expect("more bytes").contains("bytes, but the header says"));
    let mut other = whole.clone();
    other[8] = 2;
    assert!(open(&other).expect("another version").contains("version 2"));
    let error = open(b"solid ball").expect("another format");
    assert!(error.contains("not a stored mesh"), "{error}");
    let unfinished = [&[0; 128], &whole[128..]].concat();
    assert!(open(&unfinished).expect("no header").contains("never finished"));
}

/// Bytes that change while a mesh reads them.
#[derive(Clone)]
struct Changing(Arc<Mutex<Vec<u8>>>);

impl PageSource for Changing {
    fn name(&self) -> String {
        "changing".into()
    }

    fn length(&self) -> Result<u64, String> {
        self.0.lock().expect("no panic").length()
    }

    fn read(&self, offset: u64, bytes: &mut [u8]) -> Result<(), String> {
        PageSource::read(&*self.0.lock().expect("no panic"), offset, bytes)
    }
}

#[test]
fn a_page_that_changes_below_us_is_a_failure_and_not_a_wrong_hit_in_silence() {
    let (whole, _) = store(&ball(20), 1000);
    let changing = Changing(Arc::new(Mutex::new(whole.clone())));
    let ray = Ray::new(Vec3::new(0.1, 0.2, -3.0), Vec3::Z);
    let open = || {
        *changing.0.lock().expect("no panic") = whole.clone();
        StoredMesh::open(changing.clone(), 0).expect("sound bytes")
    };
    let hit_somewhere = |mesh: &StoredMesh| {
        (0..mesh.num_primitives() as u32).any(|page| mesh.closest(page, &ray).is_some())
    };
    let mesh = open();
    assert!(hit_somewhere(&mesh) && mesh.failure().is_none());

    let mesh = open();
    changing.0.lock().expect("no panic")[700] ^= 1;
    assert!(!hit_somewhere(&mesh));
    let failure = mesh.failure().expect("a failure");
    assert!(failure.contains("checksum") && failure.contains("byte 128"), "{failure}");

    let mesh = Arc::new(open());
    changing.0.lock().expect("no panic").truncate(200);
    assert!(!hit_somewhere(&mesh));
    assert!(mesh.failure().expect("a failure").contains("no "));
    let world = world_of(Geometry::Shape(mesh));
    assert!(world.failure().is_some_and(|(geometry, _)| geometry == 0));
}

/// The bytes with the checksums of what they are now.
fn resealed(mut bytes: Vec<u8>) -> Vec<u8> {
    use super::format::{ENTRY_BYTES, HEADER_BYTES, Header, PageEntry, UNIT_BYTES, checksum};
    let header: &[u8; HEADER_BYTES] = bytes.first_chunk().expect("a header");
    let header = Header::read(header).expect("a sound header");
    let table = header.table as usize;
    for at in (table..bytes.len()).step_by(ENTRY_BYTES) {
        let mut page = PageEntry::read(&bytes[at..]);
        let start = page.offset as usize;
        page.checksum = checksum(&bytes[start..][..page.units as usize * UNIT_BYTES as usize]);
        bytes[at..at + ENTRY_BYTES].copy_from_slice(&page.bytes());
    }
    let header = Header { table_checksum: checksum(&bytes[table..]), ..header };
    bytes[..HEADER_BYTES].copy_from_slice(&header.bytes());
    bytes
}

#[test]
fn pages_with_any_bits_and_the_right_checksum_end_in_failures_or_hits_and_never_in_a_panic() {
    let (whole, _) = store(&ball(12), 1000);
    assert!(resealed(whole.clone()) == whole);
    let rays = rays(40);
    let mut r = Random::new(11);
    let (mut refused, mut traced) = (0, 0);
    for round in 0..3000 {
        let mut bytes = whole.clone();
        let table = u64::from_le_bytes(std::array::from_fn(|i| bytes[24 + i])) as usize;
        for _ in 0..=round % 3 {
            let at = 128 + (r.bits() as usize) % (table - 128);
            let bit = 1 << (r.bits() % 8);
            match round % 4 {
                0 => bytes[at] = 0xff,
                1 => bytes[at] = 0,
                _ => bytes[at] ^= bit,
            }
        }
        let mesh = StoredMesh::open(resealed(bytes), 0).expect("the table is sound");
        let mesh = Arc::new(mesh);
        let world = world_of(Geometry::Shape(mesh.clone()));
        for ray in &rays {
            let hit = world.closest(ray);
            assert!(hit.is_none_or(|h| h.t >= 0.0), "{hit:?}");
            world.occluded(ray);
        }
        *(if mesh.failure().is_some() { &mut refused } else { &mut traced }) += 1;
    }
    assert!(refused > 100 && traced > 100, "{refused} refused, {traced} traced");
}
