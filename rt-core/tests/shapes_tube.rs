//! Tubes and cylinders against a slow reference without quadratics: the union of all spheres along
//! the axis.

mod shapes_common;

use glam::{DVec3, Vec3};
use rt_core::ray::Ray;
use rt_core::shapes::{Cylinders, Radii, Shape, ShapeError, Tubes};
use shapes_common::{Random, closest};

/// Distance of `p` to the union of the spheres around a + w·(b−a) of radius ra + w·(rb−ra), 0 ≤ w ≤
/// 1: a convex function of w, minimised by ternary search.
fn distance(p: DVec3, a: DVec3, b: DVec3, ra: f64, rb: f64) -> f64 {
    let f = |w: f64| (p - a - w * (b - a)).length() - (ra + w * (rb - ra));
    let (mut lo, mut hi) = (0.0, 1.0);
    for _ in 0..80 {
        let (x, y) = (lo + (hi - lo) / 3.0, hi - (hi - lo) / 3.0);
        if f(x) < f(y) { hi = y } else { lo = x }
    }
    f(0.0).min(f(1.0)).min(f(0.5 * (lo + hi)))
}

/// Entry and exit by search along the ray in [t0, t1] (the distance to a convex body is convex
/// along a line). `None` also when the ray passes within `graze` of touching, where the reference
/// cannot decide.
enum Reference {
    Miss,
    Grazing,
    Interval(f64, f64),
}

fn reference(f: impl Fn(f64) -> f64, t0: f64, t1: f64, graze: f64) -> Reference {
    let (mut lo, mut hi) = (t0, t1);
    for _ in 0..120 {
        let (x, y) = (lo + (hi - lo) / 3.0, hi - (hi - lo) / 3.0);
        if f(x) < f(y) { hi = y } else { lo = x }
    }
    let mid = 0.5 * (lo + hi);
    let depth = f(mid);
    if depth.abs() < graze {
        return Reference::Grazing;
    }
    if depth > 0.0 {
        return Reference::Miss;
    }
    let bisect = |mut outside: f64, mut inside: f64| {
        for _ in 0..100 {
            let m = 0.5 * (outside + inside);
            if f(m) > 0.0 { outside = m } else { inside = m }
        }
        inside
    };
    Reference::Interval(bisect(t0, mid), bisect(t1, mid))
}

fn segment(a: Vec3, b: Vec3, ra: f32, rb: f32) -> Tubes {
    Tubes::new(vec![a, b], &[0, 2], Radii::Each(vec![ra, rb])).unwrap()
}

#[test]
fn rounded_cones_agree_with_the_union_of_spheres() {
    let mut rng = Random::new(11);
    let (mut hits, mut misses) = (0, 0);
    for case in 0..4000 {
        let scale = [1e-6f32, 1e-2, 1.0, 1e3, 1e6][case % 5];
        let offset = scale * [0.0f32, 1.0, 100.0][case % 3] * rng.unit_vector();
        let a = offset + scale * rng.cube();
        let b = offset + scale * rng.cube();
        // Slender, thick, one sphere inside the other, and pointed.
        let (ra, rb) = match case % 7 {
            0 => (0.05, 0.05),
            1 => (0.3, 0.1),
            2 => (0.0, 0.4),
            3 => (3.0, 0.01),
            4 => (0.001, 0.002),
            5 => (0.5, 0.0),
            _ => (rng.unit(), rng.unit()),
        };
        let (ra, rb) = (ra * scale, rb * scale);
        let tubes = segment(a, b, ra, rb);
        let size = f64::from((b - a).length() + ra + rb);
        let middle = 0.5 * (a + b);
        let origin = middle + (size as f32) * [1.5f32, 10.0, 0.3][case % 3] * rng.unit_vector();
        let target = a.lerp(b, rng.range(-0.1, 1.1)) + ra.max(rb) * 1.2 * rng.cube();
        let ray = Ray::new(origin, (target - origin) * [1.0, 1e-3, 1e5][case % 3]);
        let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
        let f = |t: f64| distance(o + t * d, a.as_dvec3(), b.as_dvec3(), ra.into(), rb.into());
        let reach = 30.0 * size / d.length();
        let from = if f(0.0) < 0.0 { -reach } else { 0.0 };
        let hit = tubes.closest(0, &ray);
        match reference(f, from, reach, 1e-6 * size) {
            Reference::Grazing => {}
            Reference::Miss => {
                assert!(hit.is_none(), "case {case}: {hit:?}");
                misses += 1;
            }
            Reference::Interval(near, far) => {
                let expected = if near >= 0.0 { near } else { far };
                let Some(hit) = hit else { panic!("case {case}: missed {near}..{far}") };
                let error = (f64::from(hit.t) - expected).abs();
                // The search is accurate to the square root of f64's resolution at its minimum. At
                // grazing exits the depth decides.
                assert!(
                    error <= 1e-6 * expected.abs() + 1e-7 * size / d.length(),
                    "case {case}: {} {expected}",
                    hit.t
                );
                let s = tubes.surface(0, &hit, &ray);
                let off =
                    distance(s.point.as_dvec3(), a.as_dvec3(), b.as_dvec3(), ra.into(), rb.into());
                assert!(
                    off.abs() <= f64::from(s.point_error) + 1e-9 * size,
                    "case {case}: off by {off}"
                );
                let h = 1e-5 * size;
                let slope = |n: DVec3| {
                    let at = |k: f64| {
                        distance(
                            s.point.as_dvec3() + k * h * n,
                            a.as_dvec3(),
                            b.as_dvec3(),
                            ra.into(),
                            rb.into(),
                        )
                    };
                    (at(1.0) - at(-1.0)) / (2.0 * h)
                };
                if ra.min(rb) > 1e-3 * size as f32 {
                    assert!(
                        slope(s.normal.as_dvec3()) > 0.99,
                        "case {case}: normal is not the gradient"
                    );
                }
                hits += 1;
            }
        }
    }
    assert!(hits > 1500 && misses > 300, "{hits} {misses}");
}

#[test]
fn radius_of_a_millionth_of_the_length() {
    let (r, l) = (1e-6f32, 1.0f32);
    let tubes = segment(Vec3::new(-0.3, 0.1, 0.2) * l, Vec3::new(0.5, -0.4, 0.9) * l, r, r);
    let (a, b) = (
        DVec3::new(-0.3f32 as f64, 0.1f32 as f64, 0.2f32 as f64),
        DVec3::new(0.5, -0.4f32 as f64, 0.9f32 as f64),
    );
    let e = (b - a).normalize();
    let mut rng = Random::new(4);
    let mut hits = 0;
    for _ in 0..20_000 {
        let on_axis = a + (b - a) * f64::from(rng.range(0.01, 0.99));
        let origin = (on_axis + 2.0 * rng.unit_vector().as_dvec3()).as_vec3();
        let dir =
            (on_axis + 1.5 * f64::from(r) * rng.cube().as_dvec3() - origin.as_dvec3()).as_vec3();
        // Distance of the two lines in f64, from the rounded ray.
        let (o, d) = (origin.as_dvec3(), dir.as_dvec3());
        let n = d.cross(e).normalize();
        let gap = n.dot(o - a).abs();
        if (gap - f64::from(r)).abs() < 1e-5 * f64::from(r) {
            continue;
        }
        let hit = tubes.closest(0, &Ray::new(origin, dir));
        assert_eq!(hit.is_some(), gap < f64::from(r), "gap {gap:e}");
        if let Some(h) = hit {
            let s = tubes.surface(0, &h, &Ray::new(origin, dir));
            let radial = s.normal.as_dvec3().dot(e).abs();
            assert!(radial < 1e-5, "normal leaves the radial plane by {radial}");
            hits += 1;
        }
    }
    assert!(hits > 1000, "{hits}");
}

#[test]
fn rays_along_the_axis_hit_the_round_end() {
    for (ra, rb, expected) in
        [(1.0f32, 1.0f32, 4.0f32), (0.5, 1.0, 4.5), (0.0, 1.0, 5.0), (1.0, 0.0, 4.0)]
    {
        let tubes = segment(Vec3::ZERO, Vec3::new(0.0, 0.0, 10.0), ra, rb);
        for zero in [0.0f32, -0.0] {
            let ray = Ray::new(Vec3::new(zero, 0.0, -5.0), Vec3::new(-zero, zero, 1.0));
            assert_eq!(tubes.closest(0, &ray).map(|h| h.t), Some(expected), "radii {ra} {rb}");
        }
    }
    // From inside, along and across.
    let tubes = segment(Vec3::ZERO, Vec3::new(0.0, 0.0, 10.0), 1.0, 1.0);
    assert_eq!(
        tubes.closest(0, &Ray::new(Vec3::new(0.0, 0.0, 4.0), Vec3::Z)).map(|h| h.t),
        Some(7.0)
    );
    assert_eq!(
        tubes.closest(0, &Ray::new(Vec3::new(0.5, 0.0, 4.0), Vec3::X)).map(|h| h.t),
        Some(0.5)
    );
    // Exactly on the lateral surface, parallel to the axis.
    let ray = Ray::new(Vec3::new(1.0, 0.0, -5.0), Vec3::Z);
    assert!(tubes.closest(0, &ray).is_some_and(|h| (4.0..=6.0).contains(&h.t)));
    assert!(tubes.closest(0, &Ray::new(Vec3::new(1f32.next_up(), 0.0, -5.0), Vec3::Z)).is_none());
}

#[test]
fn t_min_is_inclusive_and_t_max_exclusive() {
    let tubes = segment(Vec3::new(-5.0, 0.0, 10.0), Vec3::new(5.0, 0.0, 10.0), 1.0, 1.0);
    let at = |t_min, t_max| {
        tubes.closest(0, &Ray { t_min, t_max, ..Ray::new(Vec3::ZERO, Vec3::Z) }).map(|h| h.t)
    };
    assert_eq!(at(0.0, f32::INFINITY), Some(9.0));
    assert_eq!(at(9.0, 9f32.next_up()), Some(9.0));
    assert_eq!(at(0.0, 9.0), None);
    assert_eq!(at(9f32.next_up(), f32::INFINITY), Some(11.0));
    assert_eq!(at(9f32.next_up(), 11.0), None);
}

/// A random walk with bends of every sharpness, varying radii, a repeated point and a point whose
/// sphere lies inside its neighbour's.
fn walk(rng: &mut Random, points: usize, step: f32) -> (Vec<Vec3>, Vec<f32>) {
    let (mut p, mut heading) = (Vec3::ZERO, rng.unit_vector());
    let (mut ps, mut rs) = (vec![p], vec![0.3]);
    while ps.len() < points {
        heading = (heading + 0.8 * rng.unit_vector()).normalize();
        p += step * rng.range(0.8, 1.3) * heading;
        ps.push(p);
        rs.push(rng.range(0.1, 0.35));
        if ps.len() == points / 2 {
            ps.push(p);
            rs.push(0.2);
        }
    }
    (ps, rs)
}

#[test]
fn joints_have_no_gap_and_the_nearest_surface_is_the_union() {
    let mut rng = Random::new(21);
    for _ in 0..20 {
        let (ps, rs) = walk(&mut rng, 8, 1.0);
        let tubes = Tubes::new(ps.clone(), &[0, ps.len() as u32], Radii::Each(rs.clone())).unwrap();
        let union = |p: DVec3| {
            (0..ps.len() - 1)
                .map(|i| {
                    distance(
                        p,
                        ps[i].as_dvec3(),
                        ps[i + 1].as_dvec3(),
                        rs[i].into(),
                        rs[i + 1].into(),
                    )
                })
                .fold(f64::INFINITY, f64::min)
        };
        for k in 0..150 {
            // Aimed at joints, where segments meet.
            let i = k % ps.len();
            let target = ps[i] + rs[i] * 0.95 * rng.unit_vector();
            let ray = Ray::new(target + 8.0 * rng.unit_vector(), Vec3::ZERO);
            let ray = Ray { dir: target - ray.origin, ..ray };
            let (_, hit) = closest(&tubes, &ray).expect("aimed inside a joint's sphere");
            // Nothing of the union is nearer than the hit, and the hit is on it.
            let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
            let at = union(o + d * f64::from(hit.t));
            assert!(at.abs() < 3e-6, "{at}");
            let mut t = 0.0;
            while t < f64::from(hit.t) - 1e-4 {
                let gap = union(o + d * t);
                assert!(gap > -1e-6, "inside at {t}, before the hit at {}", hit.t);
                t += (gap / d.length()).max(1e-4);
            }
        }
    }
}

#[test]
fn a_transparent_polyline_shows_one_entry_and_one_exit_per_passage() {
    let mut rng = Random::new(5);
    let mut passages = 0;
    for round in 0..12 {
        let (ps, rs) = walk(&mut rng, 7, if round % 3 == 0 { 0.15 } else { 1.0 });
        let n = ps.len() as u32;
        let tubes = Tubes::new(ps.clone(), &[0, n], Radii::Each(rs.clone())).unwrap();
        for k in 0..60 {
            let i = k % ps.len();
            let target = ps[i] + rs[i] * 0.8 * rng.unit_vector();
            let origin = target + 8.0 * rng.unit_vector();
            let ray = Ray::new(origin, target - origin);
            let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
            // Merge the segments' intervals to get the boundary crossings of the union.
            let mut spans: Vec<(f64, f64)> = Vec::new();
            let mut unclear = false;
            for j in 0..ps.len() - 1 {
                let f = |t: f64| {
                    distance(
                        o + d * t,
                        ps[j].as_dvec3(),
                        ps[j + 1].as_dvec3(),
                        rs[j].into(),
                        rs[j + 1].into(),
                    )
                };
                match reference(f, -1.0, 4.0, 1e-4) {
                    Reference::Interval(a, b) => spans.push((a, b)),
                    Reference::Miss => {}
                    Reference::Grazing => unclear = true,
                }
            }
            spans.sort_by(|a, b| a.0.total_cmp(&b.0));
            let mut merged: Vec<(f64, f64)> = Vec::new();
            for s in spans {
                match merged.last_mut() {
                    Some(last) if s.0 <= last.1 => last.1 = last.1.max(s.1),
                    _ => merged.push(s),
                }
            }
            // Gaps within 1e-4 of merging, or between distant segments of a walk that crosses
            // itself, are not tested here.
            unclear |= merged.windows(2).any(|w| w[1].0 - w[0].1 < 1e-4);
            let crosses_itself = (0..ps.len() - 1).any(|j| {
                (j + 2..ps.len() - 1)
                    .any(|m| ps[j].lerp(ps[j + 1], 0.5).distance(ps[m].lerp(ps[m + 1], 0.5)) < 1.6)
            });
            if unclear || (crosses_itself && round % 3 != 0) {
                continue;
            }
            let mut found = Vec::new();
            let mut r = ray;
            while let Some((_, h)) = closest(&tubes, &r) {
                found.push(f64::from(h.t));
                r.t_min = h.t.next_up();
            }
            let expected: Vec<f64> = merged.iter().flat_map(|s| [s.0, s.1]).collect();
            assert_eq!(
                found.len(),
                expected.len(),
                "round {round} ray {k}: {found:?} {expected:?}"
            );
            for (f, e) in found.iter().zip(&expected) {
                assert!((f - e).abs() < 1e-5, "{f} {e}");
            }
            passages += merged.len();
        }
    }
    assert!(passages > 200, "{passages}");
}

#[test]
fn scalars_run_along_the_axis_and_are_continuous_at_joints() {
    let ps = vec![Vec3::ZERO, Vec3::new(4.0, 0.0, 0.0), Vec3::new(8.0, 2.0, 0.0)];
    let tubes = Tubes::new(ps, &[0, 3], Radii::Common(0.5))
        .unwrap()
        .with_scalars(vec![0.0, 1.0, 3.0])
        .unwrap();
    let scalar_at = |x: f32| {
        let ray = Ray::new(Vec3::new(x, 0.0, -5.0), Vec3::Z);
        let (prim, hit) = closest(&tubes, &ray).unwrap();
        tubes.surface(prim, &hit, &ray).scalar.unwrap()
    };
    assert!((scalar_at(1.0) - 0.25).abs() < 1e-6);
    assert!((scalar_at(3.0) - 0.75).abs() < 1e-6);
    let mut last = scalar_at(3.0);
    for i in 1..300 {
        let s = scalar_at(3.0 + i as f32 * 0.005);
        assert!((s - last).abs() < 0.01, "jump from {last} to {s} at {i}");
        last = s;
    }
}

#[test]
fn nan_points_and_bad_radii_are_left_out_and_leave_round_ends() {
    let x = |i: usize| Vec3::new(i as f32, 0.0, 0.0);
    let mut ps: Vec<Vec3> = (0..8).map(x).collect();
    ps[3] = Vec3::NAN;
    let mut rs = vec![0.2f32; 8];
    rs[6] = -1.0;
    let tubes = Tubes::new(ps, &[0, 7, 8], Radii::Each(rs)).unwrap();
    assert_eq!(tubes.num_primitives(), 6);
    let r = tubes.report();
    // 2-3 and 3-4 touch the NaN, 5-6 has a negative radius, point 7 is a line of its own.
    assert_eq!((r.primitives, r.non_finite, r.no_radius, r.degenerate), (6, 2, 1, 1));
    assert!(tubes.bounds(2).is_empty() && tubes.bounds(3).is_empty() && tubes.bounds(5).is_empty());
    // The segment after the gap has its own start sphere.
    let (prim, hit) = closest(&tubes, &Ray::new(Vec3::new(3.5, 0.0, 0.0), Vec3::X)).unwrap();
    assert_eq!((prim, hit.t), (4, 0.3));
}

#[test]
fn offsets_that_do_not_fit_are_named() {
    let new = |offsets: &[u32]| Tubes::new(vec![Vec3::ZERO; 4], offsets, Radii::Common(1.0));
    assert!(new(&[0, 2, 4]).is_ok());
    assert_eq!(new(&[0, 2]).unwrap_err(), ShapeError::Offsets { index: 1, value: 2, points: 4 });
    assert_eq!(new(&[1, 4]).unwrap_err(), ShapeError::Offsets { index: 0, value: 1, points: 4 });
    assert_eq!(
        new(&[0, 3, 2, 4]).unwrap_err(),
        ShapeError::Offsets { index: 2, value: 2, points: 4 }
    );
    assert!(new(&[]).is_err());
    assert!(Tubes::new(vec![], &[], Radii::Common(1.0)).is_ok());
    assert!(Tubes::new(vec![], &[0], Radii::Common(1.0)).is_ok());
}

#[test]
fn zero_length_and_swallowed_segments_are_spheres() {
    for (a, b, ra, rb) in
        [(0.0, 0.0, 1.0, 1.0), (0.0, 0.5, 2.0, 1.0), (0.0, 0.5, 0.2, 1.5), (0.0, 1.0, 2.0, 1.0)]
    {
        let tubes = segment(Vec3::new(a, 0.0, 0.0), Vec3::new(b, 0.0, 0.0), ra, rb);
        let (center, radius) = if ra >= rb { (a, ra) } else { (b, rb) };
        let ray = Ray::new(Vec3::new(center, -10.0, 0.0), Vec3::Y);
        assert_eq!(tubes.closest(0, &ray).map(|h| h.t), Some(10.0 - radius));
        assert_eq!(tubes.report().degenerate, 1);
    }
}

#[test]
fn cylinders_side_caps_and_open_ends() {
    let ends = vec![Vec3::ZERO, Vec3::new(0.0, 0.0, 4.0)];
    let capped = Cylinders::new(ends.clone(), Radii::Common(1.0), true).unwrap();
    let open = Cylinders::new(ends, Radii::Common(1.0), false).unwrap();
    let ray = |o: [f32; 3], d: [f32; 3]| Ray::new(o.into(), d.into());
    let t = |c: &Cylinders, r: Ray| c.closest(0, &r).map(|h| h.t);
    // Across: both the same.
    for c in [&capped, &open] {
        assert_eq!(t(c, ray([-5.0, 0.0, 2.0], [1.0, 0.0, -0.0])), Some(4.0));
        assert_eq!(t(c, ray([0.0, 0.0, 2.0], [1.0, 0.0, 0.0])), Some(1.0));
        assert_eq!(t(c, ray([-5.0, 0.0, 4.5], [1.0, 0.0, 0.0])), None);
    }
    // Along the axis: hits the caps, or nothing.
    let along = ray([0.5, 0.0, -3.0], [0.0, 0.0, 1.0]);
    assert_eq!((t(&capped, along), t(&open, along)), (Some(3.0), None));
    assert_eq!(capped.surface(0, &capped.closest(0, &along).unwrap(), &along).normal, -Vec3::Z);
    // Slanted through the open end onto the inner wall.
    let slanted = ray([0.0, 0.0, -1.0], [0.5, 0.0, 1.0]);
    assert_eq!((t(&capped, slanted), t(&open, slanted)), (Some(1.0), Some(2.0)));
    let s = open.surface(0, &open.closest(0, &slanted).unwrap(), &slanted);
    assert!(
        (s.point - Vec3::new(1.0, 0.0, 1.0)).length() < 1e-6
            && (s.normal - Vec3::X).length() < 1e-6
    );
    // Exactly at the edge of the lateral surface, and on its line parallel to the axis.
    assert_eq!(t(&capped, ray([-5.0, 0.0, 4.0], [1.0, 0.0, 0.0])), Some(4.0));
    assert!(t(&capped, ray([1.0, 0.0, -1.0], [0.0, 0.0, 1.0])).is_some());
}

#[test]
fn cones_agree_with_their_implicit_equation() {
    let mut rng = Random::new(31);
    let mut hits = 0;
    for case in 0..3000 {
        let scale = [1e-6f32, 1.0, 1e6][case % 3];
        let (a, b) = (scale * rng.cube(), scale * rng.cube());
        let (ra, rb) = (scale * rng.unit(), if case % 2 == 0 { 0.0 } else { scale * rng.unit() });
        let c = Cylinders::new(vec![a, b], Radii::Each(vec![ra, rb]), true).unwrap();
        let origin = scale * 4.0 * rng.unit_vector();
        let target = a.lerp(b, rng.unit()) + 0.3 * ra * rng.cube();
        let ray = Ray::new(origin, target - origin);
        // Positive outside; the solid is convex, the function is not a distance but has the right
        // sign.
        let (da, db) = (a.as_dvec3(), b.as_dvec3());
        let e = (db - da).normalize();
        let len = (db - da).length();
        let f = |t: f64| {
            let q = ray.origin.as_dvec3() + t * ray.dir.as_dvec3() - da;
            let z = q.dot(e);
            let rho = (q - z * e).length();
            let slope = (f64::from(rb) - f64::from(ra)) / len;
            let side = (rho - f64::from(ra) - slope * z) / (1.0 + slope * slope).sqrt();
            side.max(-z).max(z - len)
        };
        match reference(f, 0.0, 4.0, 1e-5 * f64::from(scale)) {
            Reference::Interval(near, _) => {
                let hit = c.closest(0, &ray).unwrap_or_else(|| panic!("case {case} missed {near}"));
                assert!((f64::from(hit.t) - near).abs() < 1e-6, "case {case}: {} {near}", hit.t);
                let s = c.surface(0, &hit, &ray);
                assert!(
                    s.normal.dot(ray.dir) <= 1e-4 * ray.dir.length(),
                    "case {case}: entry seen from behind"
                );
                let box_ = c.bounds(0);
                assert!(s.point.cmpge(box_.min).all() && s.point.cmple(box_.max).all());
                hits += 1;
            }
            Reference::Miss => assert!(c.closest(0, &ray).is_none(), "case {case}"),
            Reference::Grazing => {}
        }
    }
    assert!(hits > 1000, "{hits}");
}

#[test]
fn cylinders_that_cannot_be_drawn_are_counted() {
    let (o, x) = (Vec3::ZERO, Vec3::X);
    let c = Cylinders::new(
        vec![o, x, o, o, o, Vec3::NAN, o, x],
        Radii::Each(vec![1.0, 1.0, 1.0, 1.0, 1.0, 1.0, -1.0, 1.0]),
        true,
    )
    .unwrap();
    let r = c.report();
    assert_eq!((r.non_finite, r.no_radius, r.degenerate), (1, 1, 1));
    assert!((1..4).all(|i| c.bounds(i).is_empty()));
    assert!(Cylinders::new(vec![o], Radii::Common(1.0), true).is_err());
}
