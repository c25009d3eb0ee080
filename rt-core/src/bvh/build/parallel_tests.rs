//! Worlds of many geometries: who builds them, and that it makes no difference.

use crate::bvh::{BuildError, BuildOptions, Geometry, Instance, World};
use crate::math::Aabb;
use crate::mesh::{Attribute, TriMesh};
use crate::ray::Ray;
use crate::shapes::{Shape, ShapeHit, ShapeSurface};
use crate::test_shapes::noise_soup;
use glam::{DAffine3, Vec3};
use std::collections::HashSet;
use std::sync::{Arc, Condvar, Mutex};
use std::thread::ThreadId;
use std::time::Duration;

fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads")
}

fn everywhere(geometries: usize) -> Vec<Instance> {
    let instance = |geometry| Instance { geometry, world_from_object: DAffine3::IDENTITY };
    (0..geometries).map(instance).collect()
}

/// Where threads wait for one another, until as many have come as there are.
struct Rendezvous {
    wanted: usize,
    came: Mutex<HashSet<ThreadId>>,
    more: Condvar,
    /// The shapes that were built.
    built: Mutex<HashSet<usize>>,
}

/// Long enough on any machine; only a build that one thread does alone waits for it, once.
const PATIENCE: Duration = Duration::from_secs(20);

/// Whoever builds it waits at the meeting.
struct BlockingShape {
    number: usize,
    primitives: usize,
    meeting: Arc<Rendezvous>,
}

impl Shape for BlockingShape {
    fn num_primitives(&self) -> usize {
        self.primitives
    }

    fn bounds(&self, prim: u32) -> Aabb {
        let m = &self.meeting;
        m.built.lock().unwrap().insert(self.number);
        let mut came = m.came.lock().unwrap();
        if came.insert(std::thread::current().id()) {
            m.more.notify_all();
            while came.len() < m.wanted {
                let (guard, timeout) = m.more.wait_timeout(came, PATIENCE).unwrap();
                came = guard;
                if timeout.timed_out() {
                    break;
                }
            }
        }
        let corner = Vec3::new(prim as f32, self.number as f32, 0.0);
        Aabb::new(corner, corner + Vec3::ONE)
    }

    fn closest(&self, _: u32, _: &Ray) -> Option<ShapeHit> {
        None
    }

    fn surface(&self, _: u32, _: &ShapeHit, _: &Ray) -> ShapeSurface {
        unreachable!("never hit")
    }
}

/// Threads that build `shapes` shapes of `primitives` each, of `threads` that wait for one another.
fn builders(threads: usize, shapes: usize, primitives: usize) -> usize {
    let meeting = Arc::new(Rendezvous {
        wanted: threads,
        came: Mutex::default(),
        more: Condvar::new(),
        built: Mutex::default(),
    });
    let shape = |number| {
        Geometry::Shape(Arc::new(BlockingShape { number, primitives, meeting: meeting.clone() }))
    };
    let geometries = (0..shapes).map(shape).collect();
    let world = pool(threads).install(|| {
        World::build(geometries, everywhere(shapes), &BuildOptions::default())
            .expect("sound shapes")
    });
    assert_eq!(world.report().primitives, shapes * primitives);
    assert_eq!(meeting.built.lock().unwrap().len(), shapes);
    meeting.came.lock().unwrap().len()
}

#[test]
fn a_thousand_small_geometries_are_built_by_all_threads() {
    assert_eq!(builders(4, 1000, 3), 4);
}

#[test]
fn one_large_geometry_is_built_by_all_threads() {
    // Beyond what is built side by side with others.
    assert_eq!(builders(3, 1, 200_000), 3);
}

#[test]
fn worlds_of_many_geometries_do_not_depend_on_the_number_of_threads() {
    // Small, middling and large ones, in mixed order.
    let sizes = [3, 140_000, 0, 900, 20_000, 1, 135_000, 40_000, 7];
    let mut geometries: Vec<Geometry> =
        sizes.iter().map(|&n| Geometry::Mesh(Arc::new(noise_soup(n, n as u64)))).collect();
    let small = (0..200).map(|k| Geometry::Mesh(Arc::new(noise_soup(1 + k % 40, 1000 + k as u64))));
    geometries.extend(small);
    let n = geometries.len();
    let build = |threads| {
        pool(threads).install(|| {
            World::build(geometries.clone(), everywhere(n), &BuildOptions::default())
                .expect("sound meshes")
        })
    };
    let words = |w: &World| -> Vec<Vec<u32>> {
        let group = w.group.as_ref().map(|g| &g.bvh);
        let trees = w.blas.iter().filter_map(|b| b.bvh()).chain(group).chain([&w.tlas]);
        trees.map(|t| bytemuck::cast_slice::<_, u32>(&t.units).to_vec()).collect()
    };
    let one = build(1);
    let expected = words(&one);
    for threads in [2, 7] {
        let world = build(threads);
        assert!(words(&world) == expected, "{threads} threads");
        assert_eq!(world.origin(), one.origin());
        assert_eq!(world.report().primitives, one.report().primitives);
    }
    for (g, b) in geometries.iter().zip(&one.blas) {
        assert_eq!(g.num_primitives(), b.primitives, "trees are in the order of their geometries");
    }
}

#[test]
fn of_several_errors_the_first_is_told_whatever_the_threads() {
    let bad = |values| TriMesh {
        colors: Some(Attribute::per_face(vec![[1.0; 4]; values])),
        ..noise_soup(10, 1)
    };
    let mut geometries = vec![Geometry::Mesh(Arc::new(noise_soup(10, 2))); 300];
    for (i, values) in [(77, 3), (78, 4), (200, 5)] {
        geometries[i] = Geometry::Mesh(Arc::new(bad(values)));
    }
    for threads in [1, 4] {
        let built = pool(threads)
            .install(|| World::build(geometries.clone(), vec![], &BuildOptions::default()));
        let error = built.err().expect("three meshes are wrong");
        assert!(matches!(error, BuildError::Mesh { geometry: 77, .. }), "{error}");
    }
    let sound = vec![Geometry::Mesh(Arc::new(noise_soup(10, 2)))];
    let mut instances = everywhere(1).repeat(5000);
    for i in [1234, 1235, 4321] {
        instances[i].world_from_object.matrix3.x_axis *= 0.0;
    }
    for threads in [1, 4] {
        let built = pool(threads)
            .install(|| World::build(sound.clone(), instances.clone(), &BuildOptions::default()));
        let error = built.err().expect("three instances are wrong");
        assert!(matches!(error, BuildError::SingularTransform { instance: 1234, .. }), "{error}");
    }
}
