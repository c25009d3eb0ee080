use super::*;
use crate::capture::geometry_cache::GeometryCache;
use crate::capture::primitives::QuadSplit;
use crate::enums::*;

fn geometry() -> Arc<Geometry> {
    GeometryCache::default().of_runs(&[[0.0; 3]; 3], &[], &QuadSplit::default())
}

#[test]
fn attributes_that_change_late_keep_their_first_values_and_a_primitive_can_be_withdrawn() {
    let mut r = VertexRecorder::default();
    let mut c = CurrentAttributes { color: [1.0; 4], ..CurrentAttributes::default() };
    r.begin(TRIANGLES, &c);
    for i in 0..3 {
        r.vertex([i as f32; 3], &c);
    }
    r.end();
    r.begin(POLYGON, &c);
    r.vertex([7.0; 3], &c);
    c.color = [0.5; 4];
    r.set_color(c.color);
    c.materials[0].shininess = 9.0;
    r.set_materials(&c.materials);
    r.vertex([8.0; 3], &c);
    let (mode, open) = r.take_open_primitive();
    assert_eq!(mode, POLYGON);
    assert_eq!(open.len(), 2);
    assert_eq!((open[0].1.color, open[1].1.color), ([1.0; 4], [0.5; 4]));
    assert_eq!((open[0].1.materials[0].shininess, open[1].1.materials[0].shininess), (0.0, 9.0));
    assert_eq!(r.positions.len(), 3);
    r.flush_ring();
    let all = r.take_attributes(&geometry());
    assert_eq!(all.colors.at(2), [1.0; 4]);
    assert_eq!(r.runs, [PrimitiveRun { mode: TRIANGLES, count: 3, times: 1 }]);
}

fn frame(r: &mut VertexRecorder, cache: &mut GeometryCache, points: &[[f32; 3]]) -> Arc<Geometry> {
    let current = CurrentAttributes::default();
    for p in points.chunks(3) {
        r.begin(TRIANGLES, &current);
        p.iter().for_each(|p| r.vertex(*p, &current));
        r.end();
    }
    over(r, cache).0
}

/// The frame is over, all of it one batch: what it came to.
fn over(r: &mut VertexRecorder, cache: &mut GeometryCache) -> (Arc<Geometry>, Attributes) {
    let kind = &QuadSplit::default();
    r.flush_ring();
    let geometry = r.take_followed_geometry(kind).unwrap_or_else(|| {
        r.copy_followed_vertices();
        let made = cache.of_runs(&r.positions, &r.runs, kind);
        r.remember_batch(&made, kind);
        made
    });
    let attributes = r.take_attributes(&geometry);
    r.positions.clear();
    r.runs.clear();
    r.frame_done();
    (geometry, attributes)
}

#[test]
fn what_is_set_between_primitives_is_seen_by_the_next() {
    let (mut r, mut c) = (VertexRecorder::default(), CurrentAttributes::default());
    for (i, color) in [[1.0; 4], [1.0; 4], [0.5; 4]].into_iter().enumerate() {
        c.color = color;
        r.behind = true;
        r.begin(TRIANGLES, &c);
        (0..3).for_each(|_| r.vertex([i as f32; 3], &c));
        r.end();
        assert_eq!(r.colors.varying, i == 2);
    }
    r.flush_ring();
    let all = r.take_attributes(&geometry());
    assert_eq!([0, 5, 6, 8].map(|v| all.colors.at(v)[0]), [1.0, 1.0, 0.5, 0.5]);
}

#[test]
fn vertices_that_come_again_are_followed_and_others_are_written_down() {
    let (mut r, mut cache) = (VertexRecorder::default(), GeometryCache::default());
    let points: Vec<[f32; 3]> = (0..3000).map(|i| [i as f32, (i % 7) as f32, f32::NAN]).collect();
    let first = frame(&mut r, &mut cache, &points);
    assert!(Arc::ptr_eq(&first, &frame(&mut r, &mut cache, &points)));
    assert_eq!((cache.hits, cache.misses), (0, 1), "the second frame was not even looked up");
    let mut moved = points.clone();
    moved[2999][0] += 1.0;
    let second = frame(&mut r, &mut cache, &moved);
    assert!(!Arc::ptr_eq(&first, &second));
    assert_eq!(second.mesh.positions[2999].x, 3000.0);
    assert_eq!(second.mesh.positions[2998].x, 2998.0);
    let shorter = frame(&mut r, &mut cache, &moved[..1500]);
    assert_eq!(shorter.mesh.positions.len(), 1500);
    assert!(Arc::ptr_eq(&first, &frame(&mut r, &mut cache, &points)), "back to what it was");
}

/// A frame of triangles with a normal for each vertex; the version of its attributes.
fn lit_frame(
    r: &mut VertexRecorder,
    cache: &mut GeometryCache,
    points: &[[f32; 3]],
    normals: &[[f32; 3]],
) -> u64 {
    let current = CurrentAttributes::default();
    for (p, n) in points.chunks(3).zip(normals.chunks(3)) {
        r.begin(TRIANGLES, &current);
        for (p, n) in p.iter().zip(n) {
            r.set_normal(*n);
            r.vertex(*p, &current);
        }
        r.end();
    }
    let (geometry, attributes) = over(r, cache);
    for (i, n) in normals.iter().enumerate() {
        assert_eq!(attributes.normals.at(i).map(f32::to_bits), n.map(f32::to_bits), "normal {i}");
    }
    let version = attributes.version;
    r.recycle(attributes, &geometry);
    version
}

#[test]
fn a_normal_that_differs_in_one_bit_makes_another_version_and_the_same_ones_do_not() {
    let (mut r, mut cache) = (VertexRecorder::default(), GeometryCache::default());
    let points: Vec<[f32; 3]> = (0..3000).map(|i| [i as f32, (i % 7) as f32, 1.0]).collect();
    let normals: Vec<[f32; 3]> = (0..3000).map(|i| [f32::NAN, (i % 5) as f32, 1.0]).collect();
    let first = lit_frame(&mut r, &mut cache, &points, &normals);
    assert_ne!(first, 0);
    assert_eq!(lit_frame(&mut r, &mut cache, &points, &normals), first);
    for i in [0, 1, 63, 64, 1777, 2999] {
        for bits in [1, 1 << 31] {
            let before = lit_frame(&mut r, &mut cache, &points, &normals);
            let mut other = normals.clone();
            other[i][2] = f32::from_bits(other[i][2].to_bits() ^ bits);
            let changed = lit_frame(&mut r, &mut cache, &points, &other);
            assert_ne!(changed, before, "normal {i}");
            assert_eq!(lit_frame(&mut r, &mut cache, &points, &other), changed);
        }
    }
    let constant = vec![[0.0, 0.0, 1.0]; 3000];
    let one = lit_frame(&mut r, &mut cache, &points, &constant);
    assert_eq!(lit_frame(&mut r, &mut cache, &points, &constant), one);
    let half: Vec<[f32; 3]> =
        (0..3000).map(|i| if i < 1000 { constant[0] } else { normals[i] }).collect();
    let mixed = lit_frame(&mut r, &mut cache, &points, &half);
    assert_ne!(mixed, one);
    assert_eq!(lit_frame(&mut r, &mut cache, &points, &half), mixed);
    let mut moved = points.clone();
    moved[2000][0] = -0.0;
    assert_ne!(lit_frame(&mut r, &mut cache, &moved, &half), mixed);
    assert_ne!(lit_frame(&mut r, &mut cache, &points, &half), 0);
}

#[test]
fn vertices_without_a_normal_of_their_own_keep_the_one_before() {
    let (mut r, mut c) = (VertexRecorder::default(), CurrentAttributes::default());
    c.normal = [1.0, 0.0, 0.0];
    let mut wanted = Vec::new();
    for i in 0..300 {
        r.begin(TRIANGLES, &c);
        for v in 0..3 {
            if (3 * i + v) % 50 == 49 {
                c.normal = [i as f32, 2.0, 3.0];
                r.set_normal(c.normal);
            }
            wanted.push(c.normal);
            r.vertex([i as f32; 3], &c);
        }
        r.end();
    }
    r.flush_ring();
    let all = r.take_attributes(&geometry());
    assert!((0..900).all(|v| all.normals.at(v) == wanted[v]));
}

#[test]
fn a_primitive_is_withdrawn_from_the_middle_of_the_ring() {
    let (mut r, mut c) = (VertexRecorder::default(), CurrentAttributes::default());
    for i in 0..60_u16 {
        r.begin(TRIANGLES, &c);
        for v in 0..3 {
            c.normal = [f32::from(i), v as f32, 0.0];
            r.set_normal(c.normal);
            r.vertex([f32::from(i); 3], &c);
        }
        if i == 41 {
            let (_, taken) = r.take_open_primitive();
            assert_eq!(taken.len(), 3);
            assert_eq!((taken[2].0, taken[2].1.normal), ([41.0; 3], [41.0, 2.0, 0.0]));
        } else {
            r.end();
        }
    }
    r.flush_ring();
    assert_eq!(r.runs, [PrimitiveRun { mode: TRIANGLES, count: 3, times: 59 }]);
    let all = r.take_attributes(&geometry());
    assert_eq!(r.positions.len(), 59 * 3);
    assert_eq!((r.positions[41 * 3], all.normals.at(41 * 3)), ([42.0; 3], [42.0, 0.0, 0.0]));
    assert_eq!((r.positions[176], all.normals.at(176)), ([59.0; 3], [59.0, 2.0, 0.0]));
}
