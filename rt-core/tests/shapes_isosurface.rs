//! Implicit isosurfaces: leaks, agreement with a fine scan, exact ranges, bad values.

mod shapes_common;

use glam::{DVec3, UVec3, Vec3};
use rt_core::grid::Grid;
use rt_core::ray::Ray;
use rt_core::shapes::{Isosurface, IsosurfaceNormals, IsosurfaceOptions, Shape, ShapeError};
use shapes_common::{Random, closest};
use std::sync::Arc;

fn grid(n: u32, spacing: DVec3, f: impl Fn(Vec3) -> f32) -> Arc<Grid> {
    let at = |i: u32| Vec3::new((i % n) as f32, (i / n % n) as f32, (i / n / n) as f32);
    Grid::new(UVec3::splat(n), DVec3::ZERO, spacing, (0..n * n * n).map(|i| f(at(i))).collect())
        .unwrap()
        .into()
}

/// Distance from the middle of an n³ grid, in cells.
fn ball(n: u32) -> Arc<Grid> {
    let c = Vec3::splat(0.5 * (n - 1) as f32);
    grid(n, DVec3::ONE, |p| (p - c).length())
}

/// White noise with a positive border, so that every surface is closed.
fn noise(n: u32, seed: u64) -> Arc<Grid> {
    let mut rng = Random::new(seed);
    let values: Vec<f32> = (0..n * n * n).map(|_| rng.range(-1.0, 1.0)).collect();
    grid(n, DVec3::ONE, |p| {
        let border = p.min_element() == 0.0 || p.max_element() == (n - 1) as f32;
        if border { 1.0 } else { values[(p.x + n as f32 * (p.y + n as f32 * p.z)) as usize] }
    })
}

fn surface_of(g: &Arc<Grid>, isovalues: &[f32], brick_cells: u32) -> Isosurface {
    Isosurface::new(g.clone(), isovalues, &IsosurfaceOptions { brick_cells, ..Default::default() })
        .unwrap()
}

/// Trilinear value in f64, as a sum over corners.
fn value(g: &Grid, p: DVec3) -> f64 {
    let last = (g.dims() - UVec3::ONE).as_dvec3();
    let p = (p / g.spacing()).clamp(DVec3::ZERO, last);
    let cell = p.floor().min(last - 1.0);
    let f = p - cell;
    let v = g.corners(cell.as_uvec3());
    (0..8)
        .map(|i| {
            let w: f64 = (0..3).map(|a| if i >> a & 1 == 1 { f[a] } else { 1.0 - f[a] }).product();
            w * f64::from(v[i])
        })
        .sum()
}

/// All crossings, found by starting again behind each.
fn crossings(s: &Isosurface, ray: &Ray) -> Vec<f32> {
    let (mut r, mut all) = (*ray, Vec::new());
    while let Some((_, h)) = closest(s, &r) {
        all.push(h.t);
        r.t_min = h.t.next_up();
    }
    all
}

#[test]
fn no_ray_leaves_a_closed_surface_unseen() {
    let n = 17;
    let g = ball(n);
    let s = surface_of(&g, &[5.3], 4);
    let mut rng = Random::new(2);
    let lattice = |rng: &mut Random| {
        Vec3::new(
            rng.range(0.0, n as f32 - 0.01).floor(),
            rng.range(0.0, n as f32 - 0.01).floor(),
            rng.range(0.0, n as f32 - 0.01).floor(),
        )
    };
    let middle = Vec3::splat(8.0);
    let mut leaks = 0;
    for k in 0..30_000 {
        // From inside, on or off the lattice, at lattice points, edges, faces, anywhere; also along
        // axes and diagonals in grid planes.
        let origin = if k % 2 == 0 {
            middle + (2.0 * rng.cube()).round()
        } else {
            middle + 2.0 * rng.cube()
        };
        let mut target = lattice(&mut rng);
        match k % 5 {
            1 => target.x += rng.unit(),
            2 => target += Vec3::new(0.0, rng.unit(), rng.unit()),
            3 => target = origin + (2.0 * rng.cube()).round(),
            4 => target = origin + rng.cube(),
            _ => {}
        }
        let dir = target - origin;
        if dir == Vec3::ZERO {
            continue;
        }
        let ray = Ray::new(origin, dir);
        match closest(&s, &ray) {
            None => leaks += 1,
            Some((prim, h)) => {
                let p = s.surface(prim, &h, &ray);
                assert!((value(&g, p.point.as_dvec3()) - 5.3).abs() < 5e-6);
                // The surface of a coarse ball is only approximately round.
                assert!(
                    p.normal.dot((middle - p.point).normalize()) > 0.95,
                    "normals point to smaller values"
                );
            }
        }
    }
    assert_eq!(leaks, 0);
}

#[test]
fn parity_of_crossings_in_noise() {
    // Every cell of white noise has a surface, with saddles and tunnels. From an outside point, the
    // number of crossings must be even when the other end is also outside, and odd when it is
    // inside.
    let n = 9;
    let (g, mut rng, mut total) = (noise(n, 3), Random::new(8), 0);
    for bricks in [1, 3, 4] {
        let s = surface_of(&g, &[0.05], bricks);
        for k in 0..4000 {
            let inside = |rng: &mut Random| 4.0 + 3.9 * rng.cube();
            let mut end = inside(&mut rng);
            let mut dir = rng.unit_vector();
            if k % 3 == 0 {
                end = end.round();
            }
            if k % 4 == 0 {
                dir = (2.0 * rng.cube()).round();
                if dir == Vec3::ZERO {
                    continue;
                }
            }
            // For all but the shortest directions, sixteen steps away is outside the grid.
            let origin = end - 32.0 * dir;
            let ray = Ray::new(origin, dir).with_t_max(32.0);
            let at_end = value(&g, ray.at(32.0).as_dvec3()) - f64::from(0.05f32);
            let all = crossings(&s, &ray);
            if at_end.abs() < 1e-5 {
                continue; // f32 `at` may be on the other side
            }
            // Pairs closer than one ulp of t are found as one. They must be rare, and must not
            // occur here.
            let odd = all.len() % 2 == 1;
            assert_eq!(odd, at_end < 0.0, "bricks {bricks} ray {k} {ray:?}: {all:?}");
            total += all.len();
        }
    }
    assert!(total > 10_000, "{total}");
}

#[test]
fn brick_size_does_not_change_a_bit() {
    let g = noise(9, 4);
    let surfaces = [1, 2, 3, 8, 255].map(|b| surface_of(&g, &[-0.2, 0.3], b));
    let mut rng = Random::new(6);
    for k in 0..2000 {
        let target =
            if k % 2 == 0 { (4.0 + 3.0 * rng.cube()).round() } else { 4.0 + 3.0 * rng.cube() };
        let origin = target + 20.0 * if k % 3 == 0 { Vec3::X } else { rng.unit_vector() };
        let ray = Ray::new(origin, target - origin);
        let hits: Vec<_> = surfaces.iter().map(|s| closest(s, &ray).map(|(_, h)| h)).collect();
        assert!(hits.iter().all(|h| *h == hits[0]), "{hits:?}");
    }
}

#[test]
fn agrees_with_a_fine_scan_at_all_scales() {
    let mut rng = Random::new(9);
    let mut hits = 0;
    for (case, spacing) in [1e-6f64, 1e-2, 1.0, 1e3, 1e6].into_iter().enumerate() {
        let h = spacing * DVec3::new(1.0, 0.7, 1.6);
        let smooth = |p: Vec3| (p.x * 0.7).sin() + (p.y * 0.5 + 1.0).cos() * (p.z * 0.6).sin();
        let g = grid(8, h, smooth);
        let s = surface_of(&g, &[0.2], 3);
        let size = (7.0 * h).as_vec3();
        for k in 0..150 {
            let target = size * (0.5 + 0.45 * rng.cube());
            let origin = size * (0.5 + [1.5, 100.0, 0.2][k % 3] * rng.unit_vector());
            let ray = Ray::new(origin, (target - origin) * [1.0, 1e-4, 30.0][case % 3]);
            let hit = closest(&s, &ray);
            // Scan through the grid in 1/64 cells, then bisect.
            let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
            let f = |t: f64| value(&g, o + d * t) - f64::from(0.2f32);
            let (mut near, mut far) = (0f64, f64::INFINITY);
            for a in 0..3 {
                let (x, y) = (-o[a] / d[a], (7.0 * h[a] - o[a]) / d[a]);
                near = near.max(x.min(y));
                far = far.min(x.max(y));
            }
            let step = (spacing / d.length()) / 64.0;
            let mut found = None;
            let mut t = near + 1e-9 * step;
            while t + step < far && found.is_none() {
                if (f(t) < 0.0) != (f(t + step) < 0.0) {
                    let (mut a, mut b) = (t, t + step);
                    for _ in 0..60 {
                        let m = 0.5 * (a + b);
                        if (f(m) < 0.0) == (f(a) < 0.0) { a = m } else { b = m }
                    }
                    found = Some(a);
                }
                t += step;
            }
            match (hit, found) {
                (Some((_, hit)), Some(t)) => {
                    let error = (f64::from(hit.t) - t).abs();
                    // A tangential pair may lie between two steps of the scan. Then the hit is
                    // earlier, and it is on the surface.
                    let on = f(f64::from(hit.t)).abs() < 1e-5 && f64::from(hit.t) < t;
                    assert!(error < 1e-7 * t + 1e-6 * step || on, "{spacing} {k}: {} {t}", hit.t);
                    hits += 1;
                }
                (None, None) => {}
                (Some((_, h)), None) => {
                    assert!(f(f64::from(h.t)).abs() < 1e-5, "{spacing} {k}: hit where nothing is")
                }
                (None, Some(t)) => panic!("{spacing} {k}: missed {t}"),
            }
        }
    }
    assert!(hits > 300, "{hits}");
}

#[test]
fn planes_at_grid_points_are_hit_once_and_exactly() {
    for spacing in [1e-6, 1.0, 1e6] {
        let g = grid(6, DVec3::splat(spacing), |p| p.x);
        for brick in [1, 2, 4] {
            let s = surface_of(&g, &[2.0], brick);
            let h = spacing as f32;
            for (y, z) in [(0.0, 0.0), (-0.0, 5.0), (1.0, 2.0), (2.5, 2.0), (5.0, 5.0), (1.3, 4.9)]
            {
                for zero in [0.0f32, -0.0] {
                    let up = Ray::new(Vec3::new(-h, y * h, z * h), Vec3::new(h, zero, zero));
                    assert_eq!(crossings(&s, &up), [3.0], "brick {brick} at {y} {z}");
                    let down =
                        Ray::new(Vec3::new(7.0 * h, y * h, z * h), Vec3::new(-h, zero, zero));
                    assert_eq!(crossings(&s, &down), [5.0]);
                }
            }
        }
    }
}

#[test]
fn a_plateau_at_the_isovalue_is_solid() {
    let g = grid(8, DVec3::ONE, |p| if (2.0..=5.0).contains(&p.x) { 1.0 } else { 0.0 });
    let s = surface_of(&g, &[1.0], 4);
    assert_eq!(crossings(&s, &Ray::new(Vec3::new(-1.0, 3.3, 3.0), Vec3::X)), [3.0, 6.0]);
}

#[test]
fn t_min_is_inclusive_and_t_max_exclusive() {
    let g = grid(6, DVec3::ONE, |p| p.x);
    let s = surface_of(&g, &[2.5], 4);
    let ray = Ray::new(Vec3::new(-1.5, 1.2, 3.4), Vec3::X);
    let at = |t_min, t_max| closest(&s, &Ray { t_min, t_max, ..ray }).map(|(_, h)| h.t);
    assert_eq!(at(0.0, f32::INFINITY), Some(4.0));
    assert_eq!(at(4.0, 5.0), Some(4.0));
    assert_eq!(at(0.0, 4.0), None);
    assert_eq!(at(4f32.next_up(), 9.0), None);
    assert_eq!(at(3.9, 4f32.next_up()), Some(4.0));
    // The same when the ray starts on the surface, in either direction.
    for dir in [Vec3::X, -Vec3::X] {
        let on = Ray::new(Vec3::new(2.5, 1.2, 3.4), dir);
        assert_eq!(closest(&s, &on).map(|(_, h)| h.t), Some(0.0));
        assert_eq!(closest(&s, &Ray { t_min: 1e-6, ..on }), None);
    }
}

#[test]
fn several_isovalues_come_in_order_with_their_scalar() {
    let g = grid(9, DVec3::ONE, |p| p.x * p.x);
    let s = surface_of(&g, &[30.0, 1.0, 1e9, 10.0], 4);
    assert_eq!(s.report().isovalues_out_of_range, 1);
    let mut ray = Ray::new(Vec3::new(-1.0, 4.2, 4.2), Vec3::X);
    let mut seen = Vec::new();
    while let Some((prim, h)) = closest(&s, &ray) {
        assert_eq!(s.surface(prim, &h, &ray).scalar, Some(s.isovalues()[h.u as usize]));
        seen.push(s.isovalues()[h.u as usize]);
        ray.t_min = h.t.next_up();
    }
    assert_eq!(seen, [1.0, 10.0, 30.0]);
}

#[test]
fn coloured_by_another_grid_of_other_resolution() {
    let g = Arc::unwrap_or_clone(grid(9, DVec3::ONE, |p| p.x));
    let origin = DVec3::new(1e7, 0.0, -3.0);
    let g = Grid::new(g.dims(), origin, g.spacing(), g.into_values()).unwrap();
    let other = Grid::new(
        UVec3::new(2, 2, 2),
        DVec3::new(1e7, 0.0, -3.0),
        DVec3::splat(8.0),
        vec![0.0, 0.0, 8.0, 8.0, 0.0, 0.0, 8.0, 8.0],
    );
    let s = surface_of(&g.into(), &[3.5], 4).with_color_by(other.unwrap().into());
    assert_eq!(s.origin(), DVec3::new(1e7, 0.0, -3.0));
    let ray = Ray::new(Vec3::new(-1.0, 2.75, 4.2), Vec3::X);
    let (prim, h) = closest(&s, &ray).unwrap();
    assert_eq!(s.surface(prim, &h, &ray).scalar, Some(2.75));
}

#[test]
fn nan_and_infinite_values_empty_their_cells_and_are_counted() {
    let mut g = Arc::unwrap_or_clone(grid(8, DVec3::ONE, |p| p.x));
    let (a, b) = (g.index(3, 3, 3), g.index(0, 0, 0));
    g.values_mut()[a] = f32::NAN;
    g.values_mut()[b] = f32::INFINITY;
    let s = surface_of(&g.into(), &[3.5], 4);
    assert_eq!((s.report().cells_non_finite, s.report().cells), (9, 343));
    assert!(
        closest(&s, &Ray::new(Vec3::new(-1.0, 2.5, 2.5), Vec3::X)).is_none(),
        "through the hole"
    );
    assert!(
        closest(&s, &Ray::new(Vec3::new(-1.0, 1.5, 2.5), Vec3::X)).is_some(),
        "beside the hole"
    );
    let all = grid(4, DVec3::ONE, |_| f32::NAN);
    let s = surface_of(&all, &[0.0], 4);
    assert_eq!((s.num_primitives(), s.report().cells_non_finite), (0, 27));
}

#[test]
fn secondary_rays_from_the_surface_do_not_hit_it_again() {
    // On a plane every outward ray is free, so any hit is false.
    for (spacing, camera) in [(1.0f32, 5.0f32), (1e-4, 1e3), (1e4, 1e3)] {
        let g = grid(8, DVec3::splat(spacing.into()), |p| 0.8 * p.x + 0.3 * p.y + 0.52 * p.z);
        let s = surface_of(&g, &[6.1], 4);
        let mut rng = Random::new(12);
        let mut tested = 0;
        for _ in 0..3000 {
            let target = spacing * (3.5 + 2.5 * rng.cube());
            let origin = target + camera * spacing * rng.unit_vector();
            let ray = Ray::new(origin, target - origin);
            let Some((prim, h)) = closest(&s, &ray) else { continue };
            let surf = s.surface(prim, &h, &ray);
            let out = (surf.normal + 0.99 * rng.unit_vector()).normalize();
            if out.dot(surf.normal) > 1e-2 {
                // Grid values are f32: the "plane" itself is uneven by an ulp of its values, 5e-7
                // of a cell.
                let start = surf.point + surf.normal * (2.0 * surf.point_error + 1e-6 * spacing);
                assert!(closest(&s, &Ray::new(start, out)).is_none(), "spacing {spacing}");
                tested += 1;
            }
        }
        assert!(tested > 300, "{tested}");
    }
}

#[test]
fn smooth_normals_follow_central_differences() {
    let g = ball(17);
    let options = IsosurfaceOptions { normals: IsosurfaceNormals::Smooth, ..Default::default() };
    let (smooth, exact) =
        (Isosurface::new(g.clone(), &[5.3], &options).unwrap(), surface_of(&g, &[5.3], 4));
    let mut rng = Random::new(13);
    let (mut worst_smooth, mut worst_exact) = (1f32, 1f32);
    for _ in 0..500 {
        let ray = Ray::new(Vec3::splat(8.0), rng.unit_vector());
        let (prim, h) = closest(&smooth, &ray).unwrap();
        worst_smooth = worst_smooth.min(-smooth.surface(prim, &h, &ray).normal.dot(ray.dir));
        worst_exact = worst_exact.min(-exact.surface(prim, &h, &ray).normal.dot(ray.dir));
    }
    assert!(worst_smooth > 0.999 && worst_smooth > worst_exact, "{worst_smooth} {worst_exact}");
}

#[test]
fn useless_input_is_refused_with_the_cure() {
    let flat =
        Arc::new(Grid::new(UVec3::new(4, 4, 1), DVec3::ZERO, DVec3::ONE, vec![0.0; 16]).unwrap());
    let make = |g: &Arc<Grid>, iso: &[f32], brick_cells| {
        Isosurface::new(g.clone(), iso, &IsosurfaceOptions { brick_cells, ..Default::default() })
            .unwrap_err()
    };
    assert!(matches!(make(&flat, &[0.0], 4), ShapeError::NoCells { .. }));
    let g = ball(3);
    assert!(make(&g, &[], 4).to_string().contains("isovalues"));
    assert!(make(&g, &[f32::NAN], 4).to_string().contains("finite"));
    assert!(make(&g, &[0.0], 0).to_string().contains("1 to 255"));
}
