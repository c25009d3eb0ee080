//! Spheres against closed forms, over scales, offsets and awkward rays.

mod shapes_common;

use glam::{DVec3, Vec3};
use rt_core::ray::Ray;
use rt_core::shapes::{Radii, Shape, ShapeError, Spheres};
use shapes_common::Random;

fn one(center: Vec3, radius: f32) -> Spheres {
    Spheres::new(vec![center], Radii::Common(radius)).unwrap()
}

/// Errors of an aimed ray: the relative error of t against the distance travelled, and the distance
/// of the surface point from the sphere.
fn error_of(center: Vec3, r: f32, origin: Vec3, dir: Vec3) -> Option<(f64, f64)> {
    let s = one(center, r);
    let ray = Ray::new(origin, dir);
    let hit = s.closest(0, &ray)?;
    // The oracle: closest approach in f64, then the half chord. (Independent of the
    // product-of-roots form.)
    let (o, d, c) = (origin.as_dvec3(), dir.as_dvec3(), center.as_dvec3());
    let len = d.length();
    let along = (c - o).dot(d) / len;
    let off = (c - o) - along * d / len;
    let half = (f64::from(r).powi(2) - off.length_squared()).max(0.0).sqrt();
    let expected = if (c - o).length() > f64::from(r) { along - half } else { along + half } / len;
    let surf = s.surface(0, &hit, &ray);
    let off_surface = ((surf.point.as_dvec3() - c).length() - f64::from(r)).abs();
    assert!(off_surface <= f64::from(surf.point_error), "{off_surface} > {}", surf.point_error);
    assert!((surf.normal.length() - 1.0).abs() < 1e-6);
    Some((((f64::from(hit.t) - expected) / expected).abs(), off_surface))
}

#[test]
fn scales_offsets_and_directions_of_any_length() {
    let mut rng = Random::new(1);
    let mut worst = 0f64;
    for scale in [1e-6f32, 1e-3, 1.0, 1e3, 1e6] {
        for offset in [0.0f32, 1.0, 1e4] {
            for length in [1e-20f32, 1e-3, 1.0, 1e8] {
                for _ in 0..300 {
                    let center = offset * scale * rng.unit_vector();
                    let origin = center + scale * 5.0 * rng.unit_vector();
                    let target = center + 0.9 * scale * rng.unit_vector();
                    let dir = (target - origin).normalize() * length;
                    let (err, _) =
                        error_of(center, scale, origin, dir).expect("aimed inside the sphere");
                    worst = worst.max(err);
                }
            }
        }
    }
    assert!(worst <= 6.0e-8, "t is the f64 root rounded once: {worst}");
}

#[test]
fn small_and_far_without_cancellation() {
    // A radius of 1e-4 at a distance of 1000: r² − |oc|² + b² in f32 would lose all digits (squares
    // differ by 1e-14 relative).
    let (mut rng, mut hits) = (Random::new(5), 0);
    let s = one(Vec3::ZERO, 1e-4);
    for _ in 0..1000 {
        let origin = 1000.0 * rng.unit_vector();
        let dir = 1.5e-4 * rng.unit_vector() - origin;
        let d = dir.as_dvec3();
        let distance =
            (origin.as_dvec3() - d * origin.as_dvec3().dot(d) / d.length_squared()).length();
        let hit = s.closest(0, &Ray::new(origin, dir));
        if (distance - f64::from(1e-4f32)).abs() > 1e-12 {
            assert_eq!(hit.is_some(), distance < f64::from(1e-4f32), "distance {distance}");
        }
        hits += hit.is_some() as u32;
    }
    assert!((100..900).contains(&hits), "{hits}");
}

#[test]
fn grazing_rays_hit_up_to_the_last_bit_of_the_radius() {
    let s = one(Vec3::ZERO, 1.0);
    let ray = |y: f32| Ray::new(Vec3::new(-10.0, y, 0.0), Vec3::X);
    assert!(s.closest(0, &ray(1.0)).is_some(), "tangent rays touch");
    assert!(s.closest(0, &ray(1f32.next_down())).is_some());
    assert!(s.closest(0, &ray(1f32.next_up())).is_none());
}

#[test]
fn inside_rays_hit_the_far_side() {
    let s = one(Vec3::new(5.0, 0.0, 0.0), 2.0);
    let hit = s.closest(0, &Ray::new(Vec3::new(5.0, 0.0, 0.0), Vec3::Y * 0.5)).unwrap();
    assert_eq!(hit.t, 4.0);
    let hit = s.closest(0, &Ray::new(Vec3::new(6.5, 0.0, 0.0), Vec3::X)).unwrap();
    assert_eq!(hit.t, 0.5);
    assert!(s.closest(0, &Ray::new(Vec3::new(8.0, 0.0, 0.0), Vec3::X)).is_none(), "behind the ray");
}

#[test]
fn t_min_is_inclusive_and_t_max_exclusive() {
    let s = one(Vec3::new(0.0, 0.0, 10.0), 1.0);
    let ray = Ray::new(Vec3::ZERO, Vec3::Z);
    let at = |t_min, t_max| s.closest(0, &Ray { t_min, t_max, ..ray }).map(|h| h.t);
    assert_eq!(at(0.0, f32::INFINITY), Some(9.0));
    assert_eq!(at(9.0, 9.5), Some(9.0));
    assert_eq!(at(0.0, 9.0), None);
    assert_eq!(at(9f32.next_up(), 11.0), None);
    assert_eq!(at(9f32.next_up(), 11f32.next_up()), Some(11.0));
    assert!(s.occluded(0, &Ray { t_max: 9.5, ..ray }));
}

#[test]
fn signed_zero_direction_components() {
    let s = one(Vec3::ZERO, 1.0);
    for z in [0.0f32, -0.0] {
        let ray = Ray::new(Vec3::new(0.0, -3.0, z), Vec3::new(z, 1.0, -z));
        assert_eq!(s.closest(0, &ray).map(|h| h.t), Some(2.0));
    }
}

#[test]
fn secondary_rays_from_the_surface_do_not_hit_it_again() {
    let mut rng = Random::new(7);
    for (radius, offset, camera) in [(1.0f32, 0.0f32, 3.0f32), (1e-4, 1.0, 1e3), (1e4, 1e6, 1e3)] {
        for _ in 0..20_000 {
            let center = offset * Vec3::new(0.6, -0.48, 0.64);
            let s = one(center, radius);
            let origin = center + camera * radius * rng.unit_vector();
            let ray = Ray::new(origin, center + 0.95 * radius * rng.unit_vector() - origin);
            let Some(hit) = s.closest(0, &ray) else { continue };
            let surf = s.surface(0, &hit, &ray);
            let out = surf.normal + 0.999 * rng.unit_vector();
            // Twice the bound: once for the point's error, once for the rounding of the sum.
            let start = surf.point + surf.normal * (2.0 * surf.point_error);
            if out.normalize().dot(surf.normal) > 1e-3 {
                assert!(
                    s.closest(0, &Ray::new(start, out)).is_none(),
                    "r {radius} offset {offset}"
                );
            }
        }
    }
}

#[test]
fn nan_negative_and_zero_radii_are_left_out_and_counted() {
    let inf = f32::INFINITY;
    let s = Spheres::new(
        vec![
            Vec3::ZERO,
            Vec3::NAN,
            Vec3::splat(inf),
            Vec3::ZERO,
            Vec3::ZERO,
            Vec3::ZERO,
            Vec3::splat(3e38),
        ],
        Radii::Each(vec![1.0, 1.0, 1.0, f32::NAN, -1.0, 0.0, 3e38]),
    )
    .unwrap();
    let r = s.report();
    assert_eq!((r.primitives, r.non_finite, r.no_radius), (7, 4, 2));
    for i in 1..7 {
        assert!(s.bounds(i).is_empty(), "{i}");
    }
    assert!(!s.bounds(0).is_empty());
}

#[test]
fn bounds_contain_the_surface() {
    let mut rng = Random::new(3);
    for _ in 0..2000 {
        let (c, r) = (1e3 * rng.unit_vector(), 1e-3 + rng.unit());
        let b = one(c, r).bounds(0);
        for axis in 0..3 {
            assert!(f64::from(b.min[axis]) < f64::from(c[axis]) - f64::from(r));
            assert!(f64::from(b.max[axis]) > f64::from(c[axis]) + f64::from(r));
        }
    }
}

#[test]
fn wrong_lengths_are_named() {
    let e = Spheres::new(vec![Vec3::ZERO; 3], Radii::Each(vec![1.0])).unwrap_err();
    assert_eq!(
        e,
        ShapeError::Length {
            shape: "spheres",
            field: "radii",
            per: "sphere",
            expected: 3,
            found: 1
        }
    );
    assert!(e.to_string().contains("3 in all"));
    assert!(one(Vec3::ZERO, 1.0).with_scalars(vec![]).is_err());
}

#[test]
fn scalars_colors_and_far_origins_come_back() {
    let s = Spheres::from_f64_centers(
        &[DVec3::new(1e9, 0.0, 0.0), DVec3::new(1e9 + 0.25, 1.0, 0.0)],
        Radii::Common(0.1),
    )
    .unwrap()
    .with_scalars(vec![3.0, 4.0])
    .unwrap()
    .with_colors(vec![[1.0; 4], [0.25; 4]])
    .unwrap();
    let center = (DVec3::new(1e9 + 0.25, 1.0, 0.0) - s.origin()).as_vec3();
    let ray = Ray::new(center - Vec3::Z, Vec3::Z);
    let hit = s.closest(1, &ray).unwrap();
    assert!((hit.t - 0.9).abs() < 1e-6);
    let surf = s.surface(1, &hit, &ray);
    assert_eq!((surf.scalar, surf.color), (Some(4.0), Some([0.25; 4])));
}
