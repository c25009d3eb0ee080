//! Stored meshes against the same triangles in memory, and damaged files.

use super::*;
use crate::bvh::{BuildOptions, Geometry, Instance, World};
use crate::mesh::{Attribute, MeshSlices, PerElement, TriMesh};
use crate::paging::PageSource;
use crate::ray::{HitBlock, LANES, Ray, RayBlock};
use crate::shapes::{Shape, ShapeHit, ShapeSurface};
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
    for version in [1, 2, 3, 4, 5] {
        let mut other = whole.clone();
        other[8] = version;
        let error = open(&other).expect("another version");
        let expected = format!("version {version} of the format; this program reads version 6");
        assert!(error.contains(&expected), "{error}");
    }
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
    use super::format::{ENTRY_BYTES, HEADER_BYTES, Header, PageEntry, UNIT_BYTES};
    use crate::paging::fields::checksum;
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

/// A world of a stored ball, once as it is and once turned, scaled and moved, when `several`.
fn stored_world(bytes: &[u8], budget: usize, several: bool) -> World {
    let stored = Arc::new(StoredMesh::open(bytes.to_vec(), budget).expect("sound bytes"));
    let turned = DAffine3::from_scale_rotation_translation(
        DVec3::new(0.5, 0.7, -0.6),
        glam::DQuat::from_rotation_x(0.7),
        DVec3::new(1.5, 0.2, 0.0),
    );
    let places: &[DAffine3] =
        if several { &[DAffine3::IDENTITY, turned] } else { &[DAffine3::IDENTITY] };
    let placed =
        places.iter().map(|&world_from_object| Instance { geometry: 0, world_from_object });
    let geometries = vec![Geometry::Shape(stored)];
    World::build(geometries, placed.collect(), &BuildOptions::default()).expect("a world")
}

#[test]
fn blocks_and_packets_have_the_hits_of_single_rays_bit_for_bit() {
    let (bytes, _) = store(&ball(160), 10_000);
    let mut r = Random::new(11);
    let eye = Vec3::new(0.3, 0.4, 3.0);
    // Pixels of an image, and rays with random ends.
    let mut pixel = |i: usize| {
        let (x, y) = ((i / 256 % 4 * 16 + i % 16) as f32, (i / 1024 * 16 + i / 16 % 16) as f32);
        let dir = Vec3::new(x / 32.0 - 1.0, y / 32.0 - 1.0, -2.5) * 0.8;
        let t_min = if r.unit() < 0.1 { 0.9 } else { 0.0 };
        Ray { t_min, ..Ray::new(eye, dir) }.with_t_max(if r.unit() < 0.2 { 1.0 } else { 1e9 })
    };
    let image: Vec<Ray> = (0..4096).map(&mut pixel).collect();
    for (budget, several) in [(usize::MAX, false), (400_000, false), (usize::MAX, true)] {
        let world = stored_world(&bytes, budget, several);
        for (coherent, all) in [(true, &image), (false, &rays(4096))] {
            let blocks = RayBlock::from_rays(all);
            let mut found = vec![HitBlock::MISS; blocks.len()];
            let mut blocked = vec![0; blocks.len()];
            if coherent {
                world.closest_coherent(&blocks, &mut found).expect("as many");
                world.occluded_coherent(&blocks, &mut blocked).expect("as many");
            } else {
                world.closest_incoherent(&blocks, &mut found).expect("as many");
                world.occluded_incoherent(&blocks, &mut blocked).expect("as many");
            }
            let mut hits = 0;
            for (i, ray) in all.iter().enumerate() {
                let (block, lane) = (i / LANES, i % LANES);
                let (hit, expected) = (found[block].get(lane), world.closest(ray));
                assert_eq!(hit, expected, "{several}, {coherent}: {ray:?}");
                assert_eq!(blocked[block] >> lane & 1 == 1, world.occluded(ray), "{ray:?}");
                hits += u32::from(hit.is_some());
            }
            assert!(hits > 1500, "{several}, {coherent}: {hits} hits");
        }
        assert_eq!(world.failure(), None);
    }
}

#[test]
fn surfaces_of_packets_are_found_without_a_search_and_are_those_of_one_bit_for_bit() {
    let (bytes, _) = store_painted(&painted(160, false), 0.0);
    let [stored, other] =
        [0, 1].map(|_| Arc::new(StoredMesh::open(bytes.clone(), 1 << 20).expect("sound bytes")));
    let world = world_of(Geometry::Shape(stored.clone()));
    assert_eq!(world.origin(), DVec3::ZERO);
    let (eye, scattered) = (Vec3::new(0.3, 0.4, 3.0), rays(1024));
    let pixel = |i: usize| {
        let (x, y) = ((i / 256 % 2 * 16 + i % 16) as f32, (i / 512 * 16 + i / 16 % 16) as f32);
        Ray::new(eye, Vec3::new(x / 16.0 - 1.0, y / 16.0 - 1.0, -4.0))
    };
    let image: Vec<Ray> = (0..1024).map(pixel).collect();
    let mut counts = [(0, 0); 2];
    let compare = || {
        for (all, (hits, known)) in [&image, &scattered].into_iter().zip(&mut counts) {
            let blocks = RayBlock::from_rays(all);
            let mut found = vec![HitBlock::MISS; blocks.len()];
            world.closest_coherent(&blocks, &mut found).expect("as many");
            for (i, ray) in all.iter().enumerate() {
                let lane = i % LANES;
                let Some(hit) = found[i / LANES].get(lane) else { continue };
                let (key, of_block) = (stored.key(), &found[i / LANES]);
                let places = recent_hits::find(key, 1 << lane, &[*ray; LANES], of_block);
                *hits += 1;
                *known += usize::from(places[lane].parts().is_some());
                let at = ShapeHit { t: hit.t, u: hit.u, v: hit.v };
                let [a, b] = [&stored, &other].map(|mesh| mesh.surface(hit.prim, &at, ray));
                assert_eq!((a.point, a.normal, a.point_error), (b.point, b.normal, b.point_error));
                let of = |s: &ShapeSurface| (s.shading_normal, s.scalar, s.color);
                assert_eq!(of(&a), of(&b), "{ray:?}");
            }
        }
    };
    // What is kept is kept by the thread that traces.
    rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool").install(compare);
    let [(hits, known), (scattered, _)] = counts;
    assert!(hits > 500 && known * 10 > hits * 9, "{known} of {hits} known");
    assert!(scattered > 300, "{scattered}");
}

/// A ball with normals, colours and scalars: of vertices and of triangles in turns.
fn painted(rings: u32, faces: bool) -> TriMesh {
    let mut mesh = ball(rings);
    let of = |n: usize, scale: f32| (0..n).map(move |i| scale * (i as f32 * 0.37).sin());
    let (vertices, triangles) = (mesh.positions.len(), mesh.indices.len());
    mesh.normals = Some(if faces {
        let normal = |i| {
            let [a, b, c]: [Vec3; 3] = mesh.triangle(i);
            (b - a).cross(c - a).try_normalize().unwrap_or(Vec3::X)
        };
        Attribute::per_face((0..triangles).map(normal).collect())
    } else {
        Attribute::per_vertex(mesh.positions.iter().map(|p| p.normalize()).collect())
    });
    let colors = |n| of(n, 0.5).map(|x| [0.5 + x, 0.5, 0.25, 1.0]).collect();
    mesh.colors = Some(if faces {
        Attribute::per_vertex(colors(vertices))
    } else {
        Attribute::per_face(colors(triangles))
    });
    mesh.scalars = Some(Attribute::per_vertex(of(vertices, 3.0).collect()));
    mesh
}

fn store_painted(mesh: &TriMesh, tolerance: f64) -> (Vec<u8>, StoredMeshReport) {
    let mut writer = StoredMeshWriter::new(Vec::new(), mesh.origin).expect("memory");
    writer.set_normal_tolerance(tolerance);
    writer.add_mesh(mesh).expect("a sound mesh");
    writer.finish().expect("a sound mesh")
}

#[test]
fn surfaces_have_the_attributes_of_the_mesh_bit_for_bit_and_normals_within_the_tolerance() {
    for (faces, tolerance) in [(false, 0.0), (true, 0.0), (false, 0.5), (true, 0.01)] {
        let mesh = painted(120, faces);
        let (bytes, report) = store_painted(&mesh, tolerance);
        assert!(report.pages > 8 && report.attribute_bytes > 0, "{report:?}");
        let stored = StoredMesh::open(bytes, 1 << 20).expect("sound bytes");
        assert_eq!(stored.report(), report);
        let [low, high] = stored.attributes().scalars.expect("scalars");
        assert!(low < -2.9 && high > 2.9, "{low} to {high}");
        let mut hits = 0;
        for ray in rays(300) {
            for page in 0..stored.num_primitives() as u32 {
                let Some(hit) = stored.closest(page, &ray) else { continue };
                hits += 1;
                let surface = stored.surface(page, &hit, &ray);
                let number = stored.triangle(page, &ray).expect("the same hit") as usize;
                let corner = mesh.indices[number].map(|k| k as usize);
                let [w, u, v] = [1.0 - hit.u - hit.v, hit.u, hit.v];
                let normals = mesh.normals.as_ref().expect("normals");
                let normal = match normals.per {
                    PerElement::Face => normals.values[number],
                    PerElement::Vertex => {
                        let [x, y, z] = corner.map(|k| normals.values[k]);
                        x * w + y * u + z * v
                    }
                };
                let found = surface.shading_normal.expect("a normal");
                if tolerance == 0.0 {
                    assert_eq!(found, normal);
                } else {
                    let (a, b) = (found.as_dvec3(), normal.as_dvec3());
                    let angle = a.cross(b).length().atan2(a.dot(b)).to_degrees();
                    assert!(angle <= tolerance * 1.01, "{angle} degrees of {tolerance}");
                }
                let [x, y, z] = corner.map(|k| mesh.scalars.as_ref().expect("scalars").values[k]);
                assert_eq!(surface.scalar, Some(x * w + y * u + z * v));
                let colors = mesh.colors.as_ref().expect("colours");
                let color = match colors.per {
                    PerElement::Face => colors.values[number],
                    PerElement::Vertex => {
                        let [x, y, z] = corner.map(|k| colors.values[k]);
                        std::array::from_fn(|c| x[c] * w + y[c] * u + z[c] * v)
                    }
                };
                assert_eq!(surface.color, Some(color));
            }
        }
        assert!(hits > 150, "{hits}");
        assert!(!stored.has_transparency());
    }
}

#[test]
fn normals_within_a_tolerance_take_less_than_those_as_given() {
    let mut mesh = painted(120, false);
    (mesh.colors, mesh.scalars) = (None, None);
    let [exact, near] = [0.0, 0.1].map(|tolerance| store_painted(&mesh, tolerance).1);
    let bytes = |r: StoredMeshReport| r.attribute_bytes as f64 / r.triangles as f64;
    assert!(bytes(exact) < 13.0 && bytes(near) < 8.5, "{} and {}", bytes(exact), bytes(near));
}

#[test]
fn pieces_with_other_attributes_keep_their_own() {
    let (plain, mut painted) = (ball(30), painted(30, false));
    painted.colors.as_mut().expect("colours").values[7][3] = 0.5;
    let mut writer = StoredMeshWriter::new(Vec::new(), DVec3::ZERO).expect("memory");
    writer.add(&MeshSlices::of_mesh(&plain)).expect("a piece");
    writer.add_mesh(&painted).expect("a piece");
    writer.add(&MeshSlices::of_mesh(&plain)).expect("a piece");
    let mut wrong = painted.clone();
    wrong.scalars.as_mut().expect("scalars").values.pop();
    let error = writer.add_mesh(&wrong).expect_err("a scalar too few");
    assert!(error.to_string().starts_with("piece 3 "), "{error}");
    let (bytes, _) = writer.finish().expect("a sound mesh");
    let stored = StoredMesh::open(bytes, 1 << 20).expect("sound bytes");
    assert!(stored.has_transparency());
    let (mut with, mut without) = (0, 0);
    for ray in rays(100) {
        for page in 0..stored.num_primitives() as u32 {
            let Some(hit) = stored.closest(page, &ray) else { continue };
            let surface = stored.surface(page, &hit, &ray);
            let own = stored.triangle(page, &ray).expect("the same hit");
            let own = (1800 * 2..2 * 1800 * 2).contains(&own);
            assert_eq!((surface.color.is_some(), surface.shading_normal.is_some()), (own, own));
            if own { with += 1 } else { without += 1 }
        }
    }
    assert!(with > 20 && without > 40, "{with} and {without}");
}

#[test]
fn attributes_that_change_below_us_are_a_failure_and_damaged_words_never_panic() {
    let mesh = painted(40, false);
    let (bytes, report) = store_painted(&mesh, 0.1);
    let ray = Ray::new(Vec3::new(0.1, 0.2, -3.0), Vec3::Z);
    let plain = store(&mesh, usize::MAX / 3).1;
    // Behind the page's tree, which is that of the mesh without attributes.
    let at = 128 + (plain.bytes - 128 - 64 * plain.pages) as usize / plain.pages as usize + 8;
    assert!(report.attribute_bytes > 64 && report.pages == plain.pages, "{report:?}");
    let mut damaged = bytes.clone();
    damaged[at] ^= 1;
    let stored = StoredMesh::open(damaged, 1 << 20).expect("the header and table are sound");
    for page in 0..stored.num_primitives() as u32 {
        if let Some(hit) = stored.closest(page, &ray) {
            stored.surface(page, &hit, &ray);
        }
    }
    if stored.failure().is_none() {
        // The damage was in a page's tree after all, or in attributes that nothing asked for.
        panic!("damage at {at} was not noticed");
    }
}
