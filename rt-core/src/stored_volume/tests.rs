//! Stored volumes against the same lattice in memory, and damaged files.

use super::format::{BrickEntry, ENTRY_BYTES, HEADER_BYTES, Header};
use super::*;
use crate::bvh::{BuildOptions, Geometry, Instance, World};
use crate::grid::Grid;
use crate::math::SplitMix64;
use crate::paging::PageSource;
use crate::paging::fields::checksum;
use crate::ray::{HitBlock, LANES, Ray, RayBlock};
use crate::shapes::{Isosurface, IsosurfaceNormals, IsosurfaceOptions, Shape, ShapeHit};
use glam::{DAffine3, DVec3, UVec3, Vec3};
use std::sync::{Arc, Mutex};

/// No axis is a multiple of a brick's or a block's cells.
const DIMS: UVec3 = UVec3::new(71, 38, 43);

fn layout(values: ValueType) -> VolumeLayout {
    let (origin, spacing) = (DVec3::new(1e5, -3.0, 0.25), DVec3::new(0.1, 0.25, 0.15));
    VolumeLayout { dims: DIMS, origin, spacing, values }
}

/// A closed, uneven body in the lower half of the lattice, with a constant around it.
fn field(p: UVec3) -> f64 {
    let q = (p.as_dvec3() / DIMS.as_dvec3() - DVec3::new(0.35, 0.5, 0.5)) * DVec3::new(1.8, 1., 1.);
    let wave = 0.2 * (19.0 * q.x).sin() * (23.0 * q.y).cos() + 0.1 * (31.0 * q.z).sin();
    (1.0 - 3.0 * q.length() + wave).max(-0.25)
}

fn points(dims: UVec3) -> impl Iterator<Item = UVec3> {
    let [x, y, z] = dims.to_array();
    (0..z).flat_map(move |k| (0..y).flat_map(move |j| (0..x).map(move |i| UVec3::new(i, j, k))))
}

/// The field as bytes of a type, and as the numbers that these are.
fn values(of: ValueType) -> (Vec<u8>, Vec<f32>) {
    let mut bytes = Vec::new();
    let mut numbers = Vec::new();
    for p in points(DIMS) {
        let v = field(p);
        let (encoded, number): (Vec<u8>, f32) = match of {
            ValueType::U8 => {
                let v = (100.0 + 100.0 * v) as u8;
                (vec![v], v.into())
            }
            ValueType::I8 => {
                let v = (100.0 * v) as i8;
                (v.to_le_bytes().to_vec(), v.into())
            }
            ValueType::U16 => {
                let v = (30_000.0 + 30_000.0 * v) as u16;
                (v.to_le_bytes().to_vec(), v.into())
            }
            ValueType::I16 => {
                let v = (30_000.0 * v) as i16;
                (v.to_le_bytes().to_vec(), v.into())
            }
            ValueType::F32 => ((v as f32).to_le_bytes().to_vec(), v as f32),
        };
        bytes.extend(encoded);
        numbers.push(number);
    }
    (bytes, numbers)
}

fn store(layout: VolumeLayout, bytes: &[u8]) -> (Vec<u8>, StoredVolumeReport) {
    let mut writer = StoredVolumeWriter::new(Vec::new(), layout).expect("memory");
    for plane in bytes.chunks(layout.plane_bytes() as usize) {
        writer.add_plane(plane).expect("a plane");
    }
    writer.finish().expect("all planes")
}

fn world_of(shape: Arc<dyn Shape>) -> World {
    let placed = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
    let options = BuildOptions::default();
    World::build(vec![Geometry::Shape(shape)], vec![placed], &options).expect("a world")
}

/// Rays relative to the lattice's origin: into it from outside and within, along axes, along planes
/// between bricks, and through their corners.
fn rays(count: usize) -> Vec<Ray> {
    let l = layout(ValueType::U8);
    let size = ((DIMS - UVec3::ONE).as_dvec3() * l.spacing).as_vec3();
    let mut r = SplitMix64::new(5);
    let mut inside = || Vec3::from_array([0; 3].map(|_| r.unit_f32())) * size;
    (0..count)
        .map(|i| {
            let (from, to) = (inside(), inside());
            let corner = (UVec3::splat(32).as_dvec3() * l.spacing).as_vec3();
            match i % 6 {
                0 => Ray::new(from - 2.0 * size, to + 2.0 * size - from),
                1 => Ray::new(from, to - from),
                2 => Ray::new(Vec3::new(-1.0, from.y, from.z), Vec3::X),
                3 => Ray::new(Vec3::new(corner.x, from.y, from.z), Vec3::new(0.0, 1.0, -0.4)),
                4 => Ray::new(from, corner - from),
                _ => Ray::new(from - Vec3::new(0.0, 0.0, 9.0), Vec3::Z),
            }
        })
        .collect()
}

/// Isovalues at shares of the range.
fn isovalues(numbers: &[f32], shares: &[f32]) -> Vec<f32> {
    let finite = numbers.iter().filter(|v| v.is_finite());
    let (lo, hi) =
        finite.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    shares.iter().map(|s| lo + (hi - lo) * s).collect()
}

/// Asserts that rays have the hits and surfaces of the same lattice in memory. Returns the hits.
fn assert_same_hits(
    stored: Arc<StoredIsosurface>,
    grid: Arc<Grid>,
    normals: IsosurfaceNormals,
    rays: &[Ray],
) -> usize {
    let options = IsosurfaceOptions { normals, ..IsosurfaceOptions::default() };
    let resident =
        Arc::new(Isosurface::new(grid, stored.isovalues(), &options).expect("a surface"));
    let worlds = [world_of(resident.clone()), world_of(stored.clone())];
    let mut hits = 0;
    for ray in rays {
        let [a, b] = worlds.each_ref().map(|world| world.closest(ray));
        let bits = |h: &crate::ray::Hit| (h.t.to_bits(), h.u.to_bits(), h.v.to_bits());
        assert_eq!(a.as_ref().map(bits), b.as_ref().map(bits), "{ray:?}");
        assert_eq!(worlds[0].occluded(ray), worlds[1].occluded(ray), "{ray:?}");
        if let (Some(a), Some(b)) = (a, b) {
            hits += 1;
            let at = |h: &crate::ray::Hit| ShapeHit { t: h.t, u: h.u, v: h.v };
            let (s, t) =
                (resident.surface(a.prim, &at(&a), ray), stored.surface(b.prim, &at(&b), ray));
            assert_eq!((s.point, s.normal, s.scalar), (t.point, t.normal, t.scalar), "{ray:?}");
            assert_eq!(s.point_error, t.point_error, "{ray:?}");
        }
    }
    hits
}

#[test]
fn hits_are_those_of_the_lattice_in_memory_bit_for_bit_for_all_types_of_values() {
    for of in ValueType::ALL {
        let layout = layout(of);
        let (bytes, numbers) = values(of);
        let grid = Grid::new(DIMS, layout.origin, layout.spacing, numbers.clone()).expect("a grid");
        let (grid, rays) = (Arc::new(grid), rays(4000));
        let (file, report) = store(layout, &bytes);
        assert_eq!((report.points, report.non_finite), (numbers.len() as u64, 0));
        assert_eq!((report.bricks, report.bricks_constant), (12, 5), "{of:?}: {report:?}");
        for (budget, normals, shares) in [
            (usize::MAX, IsosurfaceNormals::Smooth, &[0.5][..]),
            (0, IsosurfaceNormals::Surface, &[0.1, 0.8]),
        ] {
            let volume = Arc::new(StoredVolume::open(file.clone(), budget).expect("sound bytes"));
            assert_eq!(volume.range(), grid.range());
            let isovalues = isovalues(&numbers, shares);
            let stored =
                StoredIsosurface::new(volume.clone(), &isovalues, normals).expect("isovalues");
            let hits = assert_same_hits(Arc::new(stored), grid.clone(), normals, &rays);
            assert!(hits > 500, "{of:?}: {hits} hits");
            // Bricks keep the active cells of the surface above: this one has the blocks' ranges.
            let other = [isovalues[0] + 0.1 * (isovalues[0] - numbers[0])];
            let other = StoredIsosurface::new(volume, &other, normals).expect("isovalues");
            let hits = assert_same_hits(Arc::new(other), grid.clone(), normals, &rays[..1000]);
            assert!(hits > 50, "{of:?}: {hits} hits of another surface");
        }
    }
}

#[test]
fn blocks_and_packets_have_the_hits_of_single_rays_bit_for_bit() {
    let of = ValueType::U8;
    let (bytes, numbers) = values(of);
    let (file, _) = store(layout(of), &bytes);
    let size = ((DIMS - UVec3::ONE).as_dvec3() * layout(of).spacing).as_vec3();
    // Pixels of images from outside and from within, and rays of all kinds.
    let image = |eye: Vec3, width: f32| -> Vec<Ray> {
        let pixel = |i: usize| {
            let (x, y) = ((i / 256 % 4 * 16 + i % 16) as f32, (i / 1024 * 16 + i / 16 % 16) as f32);
            let dir = Vec3::new(1.0, width * (x / 32.0 - 1.03), width * (y / 32.0 - 0.98));
            let t_min = if i.is_multiple_of(7) { 2.0 } else { 0.0 };
            Ray { t_min, ..Ray::new(eye, dir) }.with_t_max(if i.is_multiple_of(5) {
                44.0
            } else {
                1e9
            })
        };
        (0..4096).map(pixel).collect()
    };
    let (outside, within) = (Vec3::new(-6.0, 0.51, 0.49) * size, Vec3::new(0.1, 0.52, 0.47) * size);
    let (outside, within, all) = (image(outside, 0.1), image(within, 1.0), rays(4096));
    for (budget, shares) in [(usize::MAX, &[0.5][..]), (100_000, &[0.2, 0.7])] {
        let volume = Arc::new(StoredVolume::open(file.clone(), budget).expect("sound bytes"));
        let isovalues = isovalues(&numbers, shares);
        let surface = StoredIsosurface::new(volume, &isovalues, IsosurfaceNormals::Smooth);
        let world = world_of(Arc::new(surface.expect("isovalues")));
        for (name, coherent, rays) in
            [("outside", true, &outside), ("within", true, &within), ("scattered", false, &all)]
        {
            let blocks = RayBlock::from_rays(rays);
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
            for (i, ray) in rays.iter().enumerate() {
                let (block, lane) = (i / LANES, i % LANES);
                let (hit, expected) = (found[block].get(lane), world.closest(ray));
                assert_eq!(hit, expected, "{name}: {ray:?}");
                assert_eq!(blocked[block] >> lane & 1 == 1, world.occluded(ray), "{ray:?}");
                hits += u32::from(hit.is_some());
            }
            assert!(hits > 400, "{name}: {hits} hits");
        }
        assert_eq!(world.failure(), None);
    }
}

#[test]
fn every_value_is_that_which_was_stored() {
    for of in ValueType::ALL {
        let (bytes, numbers) = values(of);
        let volume = StoredVolume::open(store(layout(of), &bytes).0, 1 << 20).expect("sound bytes");
        for (p, v) in points(DIMS).zip(&numbers) {
            assert_eq!(volume.value(p).to_bits(), v.to_bits(), "{of:?} {p}");
        }
        assert!(volume.value(DIMS).is_nan() && volume.failure().is_none());
    }
}

#[test]
fn surfaces_end_at_values_that_are_not_finite_as_in_memory() {
    let layout = layout(ValueType::F32);
    let (_, mut numbers) = values(ValueType::F32);
    let mut r = SplitMix64::new(3);
    for _ in 0..300 {
        let at = (r.unit() * numbers.len() as f64) as usize;
        numbers[at] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][at % 3];
    }
    let non_finite = numbers.iter().filter(|v| !v.is_finite()).count();
    let bytes: Vec<u8> = numbers.iter().flat_map(|v| v.to_le_bytes()).collect();
    let (file, report) = store(layout, &bytes);
    assert_eq!(report.non_finite, non_finite as u64);
    let volume = Arc::new(StoredVolume::open(file, 1 << 20).expect("sound bytes"));
    let grid = Grid::new(DIMS, layout.origin, layout.spacing, numbers.clone()).expect("a grid");
    let normals = IsosurfaceNormals::Surface;
    let isovalues = isovalues(&numbers, &[0.4]);
    let stored = StoredIsosurface::new(volume, &isovalues, normals).expect("isovalues");
    assert!(assert_same_hits(Arc::new(stored), Arc::new(grid), normals, &rays(3000)) > 500);
}

#[test]
fn bricks_that_no_surface_crosses_are_never_read_and_memory_keeps_its_budget() {
    let (bytes, numbers) = values(ValueType::I16);
    let (file, _) = store(layout(ValueType::I16), &bytes);
    // Its values, and a range and a word of bits for each of its blocks.
    let brick = 33 * 33 * 33 * 2 + 2 * 512 * 8;
    for budget in [0, 2 * brick, usize::MAX] {
        let volume = Arc::new(StoredVolume::open(file.clone(), budget).expect("sound bytes"));
        let isovalues = isovalues(&numbers, &[0.97]);
        let normals = IsosurfaceNormals::Smooth;
        let surface =
            StoredIsosurface::new(volume.clone(), &isovalues, normals).expect("isovalues");
        let bricks = surface.num_primitives();
        assert!((1..6).contains(&bricks), "{bricks} bricks");
        let world = world_of(Arc::new(surface));
        rays(2000).iter().for_each(|ray| _ = world.closest(ray));
        let used = volume.page_use();
        assert!(used.peak <= budget.saturating_add(brick), "{used:?}");
        if budget == usize::MAX {
            assert_eq!(used.reads, bricks as u64);
        }
    }
}

#[test]
fn layouts_and_planes_that_cannot_be_are_refused_by_name() {
    let refused = |layout: VolumeLayout| {
        StoredVolumeWriter::new(Vec::new(), layout).err().expect("refused").to_string()
    };
    let sound = layout(ValueType::U16);
    let flat = VolumeLayout { dims: UVec3::new(4, 1, 4), ..sound };
    assert!(refused(flat).contains("dims of the volume is [4, 1, 4]"), "{}", refused(flat));
    let huge = VolumeLayout { dims: UVec3::splat(1 << 31), ..sound };
    assert!(refused(huge).contains("below 2^31"));
    let many = VolumeLayout { dims: UVec3::new(1 << 30, 1 << 15, 2), ..sound };
    assert!(refused(many).contains("fewer than 2^32 bricks"));
    let backwards = VolumeLayout { spacing: DVec3::new(1.0, -1.0, 1.0), ..sound };
    assert!(refused(backwards).contains("spacing of the volume"));
    let nowhere = VolumeLayout { origin: DVec3::NAN, ..sound };
    assert!(refused(nowhere).contains("origin of the volume"));

    let plane = vec![0; sound.plane_bytes() as usize];
    let mut writer = StoredVolumeWriter::new(Vec::new(), sound).expect("memory");
    let short = writer.add_plane(&plane[1..]).expect_err("a byte is missing").to_string();
    assert!(short.contains("plane 0 (counted from 0): 5395 bytes; it must have 5396"), "{short}");
    writer.add_plane(&plane).expect("a plane");
    let few = writer.finish().expect_err("planes are missing").to_string();
    assert!(few.contains("plane 1 (counted from 0): 0 bytes"), "{few}");
    let mut writer = StoredVolumeWriter::new(Vec::new(), sound).expect("memory");
    (0..DIMS.z).for_each(|_| writer.add_plane(&plane).expect("a plane"));
    let many = writer.add_plane(&plane).expect_err("one too many").to_string();
    assert!(many.contains("plane 43") && many.contains("it must have 0"), "{many}");
}

#[test]
fn files_of_any_shorter_length_and_other_files_are_refused() {
    let small = VolumeLayout { dims: UVec3::new(3, 2, 2), ..layout(ValueType::U8) };
    let (file, _) = store(small, &(0..12).collect::<Vec<u8>>());
    for length in 0..file.len() {
        let error = StoredVolume::open(file[..length].to_vec(), 0).err().expect("refused");
        let named = match error {
            StoredVolumeError::NotAStoredVolume { .. } => length < HEADER_BYTES,
            StoredVolumeError::Length { found, expected, .. } => {
                (found, expected) == (length as u64, file.len() as u64)
            }
            _ => false,
        };
        assert!(named, "{length}: {error}");
    }
    let mut newer = file.clone();
    newer[8] = 2;
    let error = StoredVolume::open(newer, 0).err().expect("refused").to_string();
    assert!(error.contains("version 2 of the format; this program reads version 1"), "{error}");
    let error = StoredVolume::open(vec![7; 4096], 0).err().expect("refused").to_string();
    assert!(error.contains("not a stored volume"), "{error}");
}

#[test]
fn damage_is_named_when_it_is_read_and_rays_pass_through() {
    let (bytes, numbers) = values(ValueType::U8);
    let (file, _) = store(layout(ValueType::U8), &bytes);
    let isovalues = isovalues(&numbers, &[0.5]);
    let table = Header::read(file.first_chunk().expect("a header")).expect("a header").table;
    let mut r = SplitMix64::new(8);
    let (mut refused, mut found) = (0, 0);
    for round in 0..200 {
        let mut damaged = file.clone();
        // In the header or the table, or anywhere.
        let places = [HEADER_BYTES, file.len()];
        let mut at = (r.unit() * places[round % 2] as f64) as usize;
        if round % 4 == 2 {
            at = table as usize + at % (file.len() - table as usize);
        }
        damaged[at] ^= 1 << (round % 8);
        let volume = match StoredVolume::open(damaged, usize::MAX) {
            Ok(volume) => Arc::new(volume),
            Err(error) => {
                assert!(error.to_string().contains("bytes in memory"), "{error}");
                refused += 1;
                continue;
            }
        };
        let surface = StoredIsosurface::new(volume.clone(), &isovalues, IsosurfaceNormals::Smooth);
        let world = world_of(Arc::new(surface.expect("isovalues")));
        rays(500).iter().for_each(|ray| _ = world.closest(ray));
        if let Some((_, failure)) = world.failure() {
            assert!(failure.contains("brick") && failure.contains("checksum"), "{failure}");
            found += 1;
        }
    }
    assert!(refused >= 100 && found > 50, "{refused} refused, {found} found");
}

#[test]
fn numbers_of_the_header_and_the_table_with_right_checksums_end_in_errors_or_pictures() {
    let (bytes, _) = values(ValueType::U8);
    let (file, _) = store(layout(ValueType::U8), &bytes);
    let mut r = SplitMix64::new(4);
    let mut below = |n: usize| (r.unit() * n as f64) as usize;
    let rays = rays(40);
    let (mut opened, mut refused) = (0, 0);
    for _ in 0..3000 {
        let mut bad = file.clone();
        let table = u64::from_le_bytes(std::array::from_fn(|i| bad[24 + i])) as usize;
        let words = [0, 1, 2, 31, 33, u32::MAX, i32::MAX as u32, 0x7f80_0000, 0x7fc0_0000];
        let word = words[below(words.len())].to_le_bytes();
        if below(2) == 0 {
            let at = 16 + 4 * below(24);
            bad[at..at + 4].copy_from_slice(&word);
        } else {
            let at = table + 4 * below((file.len() - table) / 4);
            bad[at..at + 4].copy_from_slice(&word);
            let sum = checksum(&bad[table..]);
            bad[112..116].copy_from_slice(&sum.to_le_bytes());
        }
        bad[12..16].fill(0);
        let sum = checksum(&bad[..HEADER_BYTES]);
        bad[12..16].copy_from_slice(&sum.to_le_bytes());
        let Ok(volume) = StoredVolume::open(bad, 1 << 20) else {
            refused += 1;
            continue;
        };
        opened += 1;
        let surface = StoredIsosurface::new(Arc::new(volume), &[90.0], IsosurfaceNormals::Smooth);
        let surface = surface.expect("isovalues");
        // Also primitives without a box.
        for prim in 0..surface.num_primitives() as u32 {
            _ = surface.bounds(prim);
            for ray in &rays {
                if let Some(hit) = surface.closest(prim, ray) {
                    _ = surface.surface(prim, &hit, ray);
                }
            }
        }
    }
    assert!(opened > 300 && refused > 300, "{opened} opened, {refused} refused");
}

#[test]
fn more_points_than_32_bits_count_have_their_own_values() {
    /// 2,049 x 2,049 x 1,057 points, of which the value is that of x + 1 at one z.
    struct Sparse(Vec<u8>, u64, Mutex<Vec<u64>>);
    const Z: u32 = 1050;
    fn large() -> VolumeLayout {
        VolumeLayout { dims: UVec3::new(2049, 2049, 1057), ..layout(ValueType::U8) }
    }
    let layout = large();
    let bricks = layout.bricks();
    let count = bricks.element_product() as usize;
    // Bricks at their places in the file; those below `Z` are constant.
    let (mut table, mut offset) = (Vec::new(), HEADER_BYTES as u64);
    let mut crc = std::collections::HashMap::new();
    for number in 0..count as u32 {
        let place = layout.brick(number);
        let bytes = place.count() as u64;
        let is_kept = (place.lo.z..=place.hi.z).contains(&Z);
        let key = (is_kept, place.lo.x, place.points().to_array());
        let sum = *crc
            .entry(key)
            .or_insert_with(|| if is_kept { checksum(&brick_bytes(place)) } else { 0 });
        table.push(BrickEntry {
            offset: if is_kept { offset } else { 0 },
            range: if is_kept { [0.0, 255.0] } else { [0.0; 2] },
            checksum: sum,
            has_non_finite: false,
        });
        // As if all were stored: byte numbers beyond 2^32.
        offset += bytes;
    }
    fn brick_bytes(place: super::layout::BrickBox) -> Vec<u8> {
        let p = place.points();
        points(p)
            .map(|q| if q.z + place.lo.z == Z { ((q.x + place.lo.x + 1) % 256) as u8 } else { 0 })
            .collect()
    }
    assert!(offset > 1 << 32 && table.len() == count);
    let table_bytes: Vec<u8> = table.iter().flat_map(BrickEntry::bytes).collect();
    let header = Header {
        length: offset + table_bytes.len() as u64,
        table: offset,
        layout,
        range: [0.0, 255.0],
        non_finite: 0,
        table_checksum: checksum(&table_bytes),
    };
    impl PageSource for Sparse {
        fn name(&self) -> String {
            "a large volume".into()
        }
        fn length(&self) -> Result<u64, String> {
            Ok(self.1 + (self.0.len() - HEADER_BYTES) as u64)
        }
        fn read(&self, at: u64, bytes: &mut [u8]) -> Result<(), String> {
            self.2.lock().expect("no panic").push(at);
            let layout = large();
            if at == 0 || at >= self.1 {
                let from = if at == 0 { 0 } else { (at - self.1) as usize + HEADER_BYTES };
                bytes.copy_from_slice(&self.0[from..from + bytes.len()]);
                return Ok(());
            }
            let place = (0..layout.bricks().element_product())
                .scan(HEADER_BYTES as u64, |end, number| {
                    let (start, place) = (*end, layout.brick(number));
                    *end += place.count() as u64;
                    Some((start, place))
                })
                .find(|(start, _)| *start == at);
            bytes.copy_from_slice(&brick_bytes(place.expect("the start of a brick").1));
            Ok(())
        }
    }
    let bytes = [&header.bytes()[..], &table_bytes].concat();
    let source = Sparse(bytes, offset, Mutex::new(Vec::new()));
    let volume = StoredVolume::open(source, 1 << 20).expect("sound bytes");
    for x in [0, 31, 32, 1000, 2048] {
        let at = UVec3::new(x, 2048, Z);
        assert_eq!(volume.value(at), ((x + 1) % 256) as f32, "{at}");
        assert_eq!(volume.value(at + UVec3::Z), 0.0);
        assert_eq!(volume.value(UVec3::new(x, 0, 3)), 0.0);
    }
    assert_eq!(volume.failure(), None);
    assert!(volume.report().points > 1 << 32);
    // A ray along z meets the sheet at that z, in the last brick along y.
    let surface = StoredIsosurface::new(Arc::new(volume), &[1.5], IsosurfaceNormals::Surface);
    let surface = surface.expect("isovalues");
    let across = layout.spacing.as_vec3();
    let ray = Ray::new(Vec3::new(100.5, 2047.5, 0.0) * across, Vec3::Z);
    let hits = (0..surface.num_primitives() as u32).filter_map(|prim| {
        let b = surface.bounds(prim);
        let is_near = (0..2).all(|a| b.min[a] <= ray.origin[a] && ray.origin[a] <= b.max[a]);
        is_near.then(|| surface.closest(prim, &ray)).flatten()
    });
    let nearest = hits.map(|hit| hit.t).fold(f32::INFINITY, f32::min);
    // The value rises from 0 to 101.5 between Z - 1 and Z.
    let expected = (f64::from(Z - 1) + 1.5 / 101.5) * layout.spacing.z;
    assert!((f64::from(nearest) - expected).abs() < 1e-4, "{nearest}, not {expected}");
    assert!(table.len() * ENTRY_BYTES < 8 << 20);
}
