//! Input that breaks builders, for every preset.

use super::binned_sah::{LeafCapacity, SahConfig};
use super::obvhs_tree::reinsert;
use super::prim_ref::SetBounds;
use super::sah_tree::sah_tree;
use super::*;
use crate::bvh::brute_force;
use crate::bvh::layout::id_leaf::IdWriter;
use crate::bvh::layout::wide::LEAF_SIZE;
use crate::bvh::{BuildOptions, BuildQuality, TreeStats, World};
use crate::math::Aabb;
use crate::mesh::TriMesh;
use crate::ray::Ray;
use crate::test_shapes::{Random, noise_soup, sphere};
use fearless_simd::Level;
use glam::Vec3;
use std::sync::Arc;
use std::time::Instant;

const THOROUGH: SahConfig =
    SahConfig { bins: 16, longest_axis_only: false, leaves: LeafCapacity::Four };

fn soup_of(triangles: impl IntoIterator<Item = [Vec3; 3]>) -> TriMesh {
    let mut mesh = TriMesh::default();
    for t in triangles {
        let n = mesh.positions.len() as u32;
        mesh.positions.extend(t);
        mesh.indices.push([n, n + 1, n + 2]);
    }
    mesh
}

fn build(mesh: &Arc<TriMesh>, quality: BuildQuality) -> (World, TreeStats) {
    let options = BuildOptions { quality, ..Default::default() };
    let world = World::from_mesh(mesh.clone(), &options).expect("a valid mesh");
    let facts = world.validate().unwrap_or_else(|e| panic!("{quality:?}: {e}"));
    (world, facts)
}

/// Whether f32 rays can be aimed at single triangles of a mesh, so that trying every triangle in
/// f64 must give the same.
#[derive(PartialEq)]
enum Aim {
    Exact,
    /// Triangles smaller than the rounding of the rays: presets are compared with one another.
    BelowRounding,
    /// Triangles in line with themselves, whose `t` means nothing: only the trees are checked.
    Nowhere,
}

/// Every preset builds a sound tree over `mesh`, all find the same, and that is what trying every
/// triangle finds.
fn check(mesh: TriMesh, aim: Aim, what: &str) {
    let mesh = Arc::new(mesh);
    let usable: Vec<usize> = (0..mesh.indices.len()).filter(|&i| mesh.is_renderable(i)).collect();
    let bounds = mesh.bounds();
    let mut r = Random::new(9);
    let size = bounds.radius();
    let middle = |t: usize| mesh.triangle(t).iter().sum::<Vec3>() / 3.0;
    let rays: Vec<Ray> = (0..60)
        .filter(|_| !usable.is_empty())
        .map(|i| {
            let o = bounds.center() + r.direction() * 2.0 * size;
            let at_triangle = middle(usable[(r.bits() % usable.len() as u64) as usize]);
            let anywhere = bounds.center() + r.direction() * r.unit() * size;
            Ray::new(o, if i % 2 == 0 { at_triangle } else { anywhere } - o)
        })
        .collect();
    let mut expected: Option<Vec<Option<u32>>> = (aim == Aim::Exact).then(|| {
        rays.iter().map(|ray| brute_force::closest(&mesh, ray).map(|(_, prim)| prim)).collect()
    });
    for quality in BuildQuality::ALL {
        let (world, facts) = build(&mesh, quality);
        assert_eq!(facts.primitives, usable.len(), "{what} {quality:?}");
        assert_eq!(world.report().skipped, mesh.indices.len() - usable.len(), "{what} {quality:?}");
        let closest = |ray: &Ray| {
            let (ray, _) = world.ray_from_world(ray.origin.as_dvec3(), ray.dir.as_dvec3());
            world.closest(&ray).map(|h| h.prim)
        };
        let found: Vec<_> = rays.iter().map(closest).collect();
        if aim == Aim::Nowhere {
            continue;
        }
        let expected = expected.get_or_insert_with(|| found.clone());
        assert!(found == *expected, "{what} {quality:?}: {found:?} instead of {expected:?}");
        if aim == Aim::Exact && !usable.is_empty() {
            assert!(found.iter().flatten().count() >= 25, "{what} {quality:?}: {found:?}");
        }
    }
}

#[test]
fn one_to_nine_triangles() {
    for n in 1..=9 {
        check(noise_soup(n, n as u64), Aim::Exact, &format!("{n} triangles"));
    }
}

#[test]
fn triangles_with_nan_and_infinite_vertices_are_counted_and_left_out() {
    let mut mesh = noise_soup(2000, 4);
    for (i, bad) in
        [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].into_iter().cycle().take(300).enumerate()
    {
        mesh.positions[i * 20][i % 3] = bad;
    }
    mesh.indices[1000] = [0, 1, 1_000_000];
    check(mesh, Aim::Exact, "bad vertices");
    check(soup_of([[Vec3::NAN; 3], [Vec3::INFINITY; 3]]), Aim::Exact, "bad vertices only");
}

#[test]
fn triangles_without_area() {
    let mut r = Random::new(2);
    check(soup_of((0..5000).map(|_| [r.direction(); 3])), Aim::BelowRounding, "points");
    check(soup_of((0..5000).map(|_| [Vec3::ONE; 3])), Aim::BelowRounding, "one point");
    check(
        soup_of((0..5000).map(|i| [Vec3::ZERO, Vec3::X * i as f32, Vec3::X])),
        Aim::Nowhere,
        "on a line",
    );
}

#[test]
fn spacing_that_halves_stays_within_the_traversal_stack() {
    let at =
        |x: f32| [Vec3::new(x, 0.0, 0.0), Vec3::new(x, 0.3 * x, 0.0), Vec3::new(x, 0.0, 0.3 * x)];
    check(soup_of((0..120).map(|k| at(2f32.powi(-k)))), Aim::BelowRounding, "2^-k");
    check(soup_of((-60..60).map(|k| at(2f32.powi(k)))), Aim::BelowRounding, "2^k both ways");
    // Along all three axes and both directions, many times over.
    let spread = (0..12_000).map(|i| {
        let (k, axis, sign) =
            (i % 100, (i / 100 % 3) as usize, if i / 300 % 2 == 0 { 1.0 } else { -1.0 });
        at(sign * 2f32.powi(-k)).map(|p| {
            let v = p.to_array();
            Vec3::new(v[axis], v[(axis + 1) % 3], v[(axis + 2) % 3]) + Vec3::splat(i as f32 * 1e-9)
        })
    });
    let mesh = Arc::new(soup_of(spread));
    for quality in BuildQuality::ALL {
        build(&mesh, quality);
    }
}

#[test]
fn equal_boxes_on_a_line_and_in_a_grid() {
    // Equal costs everywhere.
    let at = |p: Vec3| [p, p + Vec3::X * 0.5, p + Vec3::new(0.0, 0.5, 0.5)];
    check(soup_of((0..20_000).map(|i| at(Vec3::X * i as f32))), Aim::Exact, "line");
    check(
        soup_of((0..20_000).map(|i| at(Vec3::new((i % 150) as f32, (i / 150) as f32, 0.0)))),
        Aim::Exact,
        "grid",
    );
    // Costs that only grow along the line.
    check(
        soup_of((0..3000).map(|i| at(Vec3::X * (i * i) as f32))),
        Aim::BelowRounding,
        "growing gaps",
    );
}

#[test]
fn duplicates_build_within_five_times_of_distinct_triangles() {
    let n = 100_000;
    let distinct = Arc::new(noise_soup(n, 8));
    let t = distinct.triangle(0);
    let same = Arc::new(soup_of(std::iter::repeat_n(t, n)));
    for quality in BuildQuality::ALL {
        let time = |mesh: &Arc<TriMesh>| {
            (0..3)
                .map(|_| {
                    let start = Instant::now();
                    build(mesh, quality);
                    start.elapsed().as_secs_f64()
                })
                .fold(f64::INFINITY, f64::min)
        };
        let (a, b) = (time(&distinct), time(&same));
        assert!(b < 5.0 * a + 0.1, "{quality:?}: {a:.3} s distinct, {b:.3} s identical");
        let (world, _) = build(&same, quality);
        let center = (t[0] + t[1] + t[2]) / 3.0;
        let normal = (t[1] - t[0]).cross(t[2] - t[0]);
        let (ray, _) = world.ray_from_world((center + normal).as_dvec3(), -normal.as_dvec3());
        let hit = world.closest(&ray).expect("in the way");
        assert_eq!(hit.prim, 0, "{quality:?}: ties go to the lowest number");
    }
}

#[test]
fn the_tree_does_not_depend_on_the_number_of_threads() {
    // Several fragments, and large enough for every parallel path below them.
    let mesh = Arc::new(noise_soup(150_000, 12));
    for quality in BuildQuality::ALL {
        let trees = [1, 2, 7].map(|threads| {
            let pool =
                rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let options = BuildOptions { quality, ..Default::default() };
            pool.install(|| World::from_mesh(mesh.clone(), &options).expect("a valid mesh"))
        });
        let units = |w: &World| {
            bytemuck::cast_slice::<_, u32>(&w.blas[0].bvh().expect("of its own").units).to_vec()
        };
        let first = units(&trees[0]);
        assert!(first == units(&trees[1]) && first == units(&trees[2]), "{quality:?}");
    }
}

#[test]
fn nodes_and_leaves_are_well_filled() {
    let mesh = Arc::new(sphere(6));
    for (quality, per_leaf, per_node) in
        [(BuildQuality::Fast, 3.4, 5.0), (BuildQuality::Balanced, 3.5, 5.0)]
    {
        let (_, f) = build(&mesh, quality);
        let (leaf, node) =
            (f.primitives as f64 / f.leaves as f64, f.children as f64 / f.nodes as f64);
        assert!(
            leaf > per_leaf && node > per_node,
            "{quality:?}: {leaf:.2} a leaf, {node:.2} a node"
        );
    }
}

fn refs_of(mesh: &TriMesh) -> (Vec<PrimRef>, SetBounds) {
    let boxes = (0..mesh.indices.len() as u32)
        .map(|i| PrimRef::new(Aabb::from_points(&mesh.triangle(i as usize)), i))
        .collect::<Vec<_>>();
    let bounds = SetBounds::of(&boxes);
    (boxes, bounds)
}

#[test]
fn reinsertion_lowers_the_cost() {
    let (mut refs, bounds) = refs_of(&noise_soup(5000, 6));
    let sah = sah_tree(&mut refs.clone(), &mut refs, &bounds, THOROUGH, Level::new());
    let better = reinsert(&sah, &[1.0, 0.5, 0.5], LeafCapacity::Four).expect("ordinary boxes");
    assert!(better.cost() < 0.98 * sah.cost(), "{} from {}", better.cost(), sah.cost());
    let mut ids = better.ids.clone();
    ids.sort_unstable();
    assert!(ids.iter().enumerate().all(|(i, &id)| i as u32 == id));
}

#[test]
fn what_obvhs_cannot_take_is_built_by_sah_and_noted() {
    let mut r = Random::new(3);
    let mut refs: Vec<PrimRef> = (0..3000)
        .map(|i| {
            let p = r.direction() * 1e19 * r.unit();
            PrimRef::new(Aabb::new(p, p + Vec3::splat(1e17)), i)
        })
        .collect();
    let bounds = SetBounds::of(&refs);
    assert!(
        reinsert(
            &sah_tree(&mut refs.clone(), &mut refs.clone(), &bounds, THOROUGH, Level::new()),
            &[1.0],
            LeafCapacity::Four
        )
        .is_none()
    );
    refs.sort_unstable_by_key(PrimRef::id);
    let config = BuilderConfig { method: Method::Reinsertion, sah: THOROUGH };
    let mut notes = Vec::new();
    let bvh =
        build_wide(refs.clone(), &IdWriter::<LEAF_SIZE>, config, &mut notes, &UNWATCHED).unwrap();
    assert_eq!(notes.len(), 1, "{notes:?}");
    assert!(notes[0].contains("surface area heuristic"), "{notes:?}");
    assert!(bvh.units.len() > refs.len() / 4, "{}", bvh.units.len());
}
