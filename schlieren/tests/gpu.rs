//! Tests the GPU against the CPU, which has the same march and thus the same numbers within
//! rounding.
//!
//! Any Vulkan device will do, also Mesa's lavapipe. Without one these tests print that they are
//! skipped and pass, unless RTSV_REQUIRE_PEERS=1.
#![cfg(feature = "gpu")]

mod common;
mod device;

use common::{blob, cube, difference, grid, largest, lopsided, oblique, trace};
use device::{gpu, relative, with_body};
use glam::DVec3;
use schlieren::field::{Field, Node};
use schlieren::gpu::{Gpu, GpuError, GpuOptions, GpuPaths, Method};
use schlieren::interpolate::Interpolant;
use schlieren::march::{BlankCells, Deviational, Options, Scheme};
use schlieren::path::{Exit, LightPaths, PathQuantities, Start, Status};
use schlieren::render::{Control, Layers, RenderError, RenderOutput, TestSection, render};
use schlieren::scene::Scene;
use schlieren::view::{Axis, View};
use std::sync::Arc;

/// Largest difference of deflections, relative to the largest deflection. Both sum a hundred terms
/// in f32, compensated, from positions that differ by one rounding (1e-7 of 30 voxels), because
/// devices need not fuse multiplication and addition.
const TOLERANCE: f64 = 1e-6;

fn cpu<'a>(
    field: &'a Field,
    view: View,
    interpolant: Interpolant,
    options: GpuOptions,
) -> Deviational<'a> {
    let GpuOptions { method, step_voxels, quantities, blank, .. } = options;
    let scheme = if method == Method::Euler { Scheme::Euler } else { Scheme::Verlet };
    let options = Options { scheme, step_voxels, quantities, blank, ..Options::default() };
    Deviational::new(field, view, interpolant, options)
}

/// Exits of the GPU and of the CPU.
fn both(
    gpu: Arc<Gpu>,
    field: &Field,
    view: View,
    interpolant: Interpolant,
    options: GpuOptions,
    starts: &[Start],
) -> [Vec<Exit>; 2] {
    let on_gpu = GpuPaths::new(gpu, field, view, interpolant, options).unwrap();
    let exits = trace(&on_gpu, starts);
    assert_eq!(on_gpu.counters().rays_on_cpu, 0, "the device failed");
    assert_eq!(on_gpu.counters().rays, starts.len() as u64);
    [exits, trace(&cpu(field, view, interpolant, options), starts)]
}

#[test]
fn deflection_displacement_and_opd_agree_with_the_cpu() {
    let Some(gpu) = gpu() else { return };
    let field = cube(33, lopsided);
    let quantities = PathQuantities { opd: true };
    for view in [View::along(Axis::X, DVec3::ZERO), View::along(Axis::Z, DVec3::ZERO), oblique()] {
        let options = GpuOptions { quantities, ..GpuOptions::default() };
        let starts = grid(15, 0.9);
        let [a, b] = both(gpu.clone(), &field, view, Interpolant::BSpline, options, &starts);
        let (_, max) = difference(&a, &b);
        assert!(max < TOLERANCE, "deflection: {max:e}");
        let xi = relative(&a, &b, |e| e.displacement_m[0]);
        assert!(xi < TOLERANCE, "displacement: {xi:e}");
        let opd = relative(&a, &b, |e| e.opd_m);
        assert!(opd < TOLERANCE, "OPD: {opd:e}");
        for (a, b) in a.iter().zip(&b) {
            assert_eq!(
                (a.status, a.transmission, a.exit_depth_m),
                (b.status, b.transmission, b.exit_depth_m)
            );
        }
    }
}

/// The trilinear gradient jumps between cells, so a sample within a rounding of a face may use the
/// other cell. This changes the contribution of one step by the jump; all other rays agree.
#[test]
fn trilinear_agrees_but_for_samples_on_a_face() {
    let Some(gpu) = gpu() else { return };
    let field = cube(33, lopsided);
    for view in [View::along(Axis::Y, DVec3::ZERO), oblique()] {
        let quantities = PathQuantities { opd: true };
        let options = GpuOptions { quantities, ..GpuOptions::default() };
        let [a, b] =
            both(gpu.clone(), &field, view, Interpolant::Trilinear, options, &grid(15, 0.9));
        let scale = largest(&b);
        let off = |(a, b): &(&Exit, &Exit)| {
            (0..2).any(|c| {
                f64::from((a.deflection_rad[c] - b.deflection_rad[c]).abs()) > TOLERANCE * scale
            })
        };
        let others = a.iter().zip(&b).filter(off).count();
        assert!(others <= 2, "{others} of {} rays differ", a.len());
        let (_, max) = difference(&a, &b);
        assert!(max < 5e-3, "{max:e}");
        let opd = relative(&a, &b, |e| e.opd_m);
        assert!(opd < TOLERANCE, "OPD: {opd:e}");
    }
}

/// Euler's march, and differences that are interpolated, are in single precision on both. Their
/// sums are not compensated for the latter, so that a hundred roundings add up.
#[test]
fn euler_and_interpolated_gradients_agree_with_the_cpu() {
    let Some(gpu) = gpu() else { return };
    let field = cube(33, lopsided);
    for view in [View::along(Axis::Y, DVec3::ZERO), oblique()] {
        for (method, interpolant) in [
            (Method::Euler, Interpolant::BSpline),
            (Method::Euler, Interpolant::TrilinearGradient),
            (Method::Verlet, Interpolant::TrilinearGradient),
        ] {
            let quantities = PathQuantities { opd: true };
            let options = GpuOptions { method, quantities, ..GpuOptions::default() };
            let [a, b] = both(gpu.clone(), &field, view, interpolant, options, &grid(15, 0.9));
            let (_, max) = difference(&a, &b);
            let xi = relative(&a, &b, |e| e.displacement_m[0]);
            let opd = relative(&a, &b, |e| e.opd_m);
            assert!(max.max(xi).max(opd) < TOLERANCE, "{method:?}, {interpolant:?}: {max:e}");
        }
    }
}

/// Numbers of rays that are no multiple of a work group or of a group of rays, a single ray, no
/// ray, rays outside the field, and a lattice of 3 x 2 x 29 nodes.
#[test]
fn odd_sizes() {
    let Some(gpu) = gpu() else { return };
    let spacing = [0.3, 0.41, 0.037];
    let field = Field::from_fn([3, 2, 29], spacing, DVec3::new(-0.3, -0.2, -0.5), 1.0003, lopsided)
        .unwrap();
    let view = View::new(DVec3::new(0.2, -0.3, 1.0), DVec3::Y, field.centre_m()).unwrap();
    for interpolant in [Interpolant::BSpline, Interpolant::Trilinear] {
        for count in [0, 1, 31, 65, 997] {
            let starts = &grid(32, 1.3)[..count];
            let options = GpuOptions {
                step_voxels: 0.37,
                quantities: PathQuantities { opd: true },
                ..GpuOptions::default()
            };
            let [a, b] = both(gpu.clone(), &field, view, interpolant, options, starts);
            assert_eq!(a.len(), count);
            if count < 65 {
                continue;
            }
            let (_, max) = difference(&a, &b);
            assert!(max < TOLERANCE, "{interpolant:?}, {count} rays: {max:e}");
            let beside =
                a.iter().filter(|e| **e == Exit { opd_m: 0.0, ..Exit::UNDISTURBED }).count();
            assert!(count < 997 || beside > 100, "{beside} rays pass beside the field");
        }
    }
}

/// The paraxial form keeps its digits for gases of any strength. tests/deviational.rs has the same
/// test for the CPU.
#[test]
fn weak_gases_keep_their_digits_at_oblique_views() {
    let Some(gpu) = gpu() else { return };
    let starts = grid(9, 0.7);
    for amplitude in [1e-8, 1e-4] {
        let field = blob(33, amplitude, 0.12);
        let [a, b] = both(
            gpu.clone(),
            &field,
            oblique(),
            Interpolant::BSpline,
            GpuOptions::default(),
            &starts,
        );
        let (_, max) = difference(&a, &b);
        assert!(max < TOLERANCE, "{amplitude:e}: {max:e}");
        assert!(a.iter().all(|e| e.opd_m.is_nan()), "not asked for");
    }
}

/// Sums of thousands of terms: a compiler that removes the compensation of the sums, as Vulkan
/// permits, fails here.
#[test]
fn compilers_keep_the_compensation_of_sums() {
    let Some(gpu) = gpu() else { return };
    let field = blob(33, 1e-4, 0.12);
    let options = GpuOptions {
        step_voxels: 1.0 / 128.0,
        quantities: PathQuantities { opd: true },
        ..GpuOptions::default()
    };
    let view = View::along(Axis::Z, DVec3::ZERO);
    let [a, b] = both(gpu, &field, view, Interpolant::BSpline, options, &grid(5, 0.5));
    let (_, max) = difference(&a, &b);
    let opd = relative(&a, &b, |e| e.opd_m);
    assert!(max < 2e-7 && opd < 2e-7, "deflection {max:e}, OPD {opd:e}");
}

#[test]
fn tilted_beams_agree() {
    let Some(gpu) = gpu() else { return };
    let field = blob(24, 1e-4, 0.15);
    let mut starts = grid(9, 0.7);
    for (i, s) in starts.iter_mut().enumerate() {
        s.tilt_rad = [1e-3 * (i % 5) as f32, -2e-3 * (i % 3) as f32];
    }
    let [a, b] = both(gpu, &field, oblique(), Interpolant::BSpline, GpuOptions::default(), &starts);
    let (_, max) = difference(&a, &b);
    assert!(max < TOLERANCE, "{max:e}");
}

#[test]
fn masks_stop_the_rays_that_they_stop_on_the_cpu() {
    let Some(gpu) = gpu() else { return };
    let field = with_body(29);
    let starts = grid(23, 0.9);
    let methods = [Method::Verlet, Method::Euler];
    for (blank, method) in [BlankCells::Opaque, BlankCells::Continued]
        .into_iter()
        .flat_map(|blank| methods.map(|method| (blank, method)))
    {
        let options = GpuOptions { method, blank, ..GpuOptions::default() };
        let [a, b] = both(gpu.clone(), &field, oblique(), Interpolant::BSpline, options, &starts);
        let scale = largest(&b);
        for (a, b) in a.iter().zip(&b) {
            assert_eq!(a.transmission, b.transmission);
            assert_eq!(a.status, b.status, "{blank:?}");
            if a.transmission > 0.0 {
                for c in 0..2 {
                    let d = f64::from((a.deflection_rad[c] - b.deflection_rad[c]).abs());
                    assert!(d < TOLERANCE * scale, "{method:?}: {d:e} rad");
                }
            }
        }
        // The shell of blank cells stops light before the body does.
        let solid_is_met = blank == BlankCells::Continued;
        for (status, met) in
            [(Status::Free, true), (Status::Masked, true), (Status::Blocked, solid_is_met)]
        {
            assert_eq!(a.iter().any(|e| e.status == status), met, "{blank:?}: {status:?}");
        }
        let dark = a.iter().filter(|e| e.transmission == 0.0).count();
        assert!((10..400).contains(&dark), "{dark} of {} rays are stopped", a.len());
    }
}

/// Rays skip gas that bends them by less than the tolerance in all, each by itself: no more of the
/// deflection is lost than the report says, and the report says no more than the tolerance.
#[test]
fn skipped_gas_bends_no_ray_by_more_than_the_tolerance() {
    let Some(gpu) = gpu() else { return };
    let field = cube(65, |p| lopsided(2.5 * p));
    let body = Field::new(
        field.dims(),
        field.spacing_m(),
        field.origin_m(),
        field.eps().to_vec(),
        1.0,
        with_body(65).nodes().map(<[Node]>::to_vec),
    )
    .unwrap();
    let starts = grid(24, 0.9);
    for (field, blank) in [(&field, BlankCells::Opaque), (&body, BlankCells::Continued)] {
        for interpolant in [Interpolant::BSpline, Interpolant::Trilinear] {
            for skip_rad in [1e-9, 1e-7] {
                let options = GpuOptions {
                    quantities: PathQuantities { opd: true },
                    blank,
                    skip_rad,
                    skip_opd_m: 1e-10,
                    ..GpuOptions::default()
                };
                let paths =
                    GpuPaths::new(gpu.clone(), field, oblique(), interpolant, options).unwrap();
                let skipped = trace(&paths, &starts);
                let report = paths.skip_report().unwrap();
                let all = GpuOptions { skip_rad: 0.0, ..options };
                let paths = GpuPaths::new(gpu.clone(), field, oblique(), interpolant, all).unwrap();
                let expected = trace(&paths, &starts);
                assert_eq!(paths.skip_report(), None);
                // A ray that is bent less meets other gas: twice the bound, as on the CPU.
                let (_, max) = difference(&skipped, &expected);
                let lost = max * largest(&expected);
                assert!(lost <= 2.0 * report.bound_rad, "{lost:e} rad, {report:?}");
                assert!(report.bound_rad <= skip_rad && report.bound_rad > 0.0, "{report:?}");
                assert!((0.1..0.9).contains(&report.steps_part), "{report:?}");
                let stretches = 110.0 / 8.0;
                for (a, b) in skipped.iter().zip(&expected) {
                    assert_eq!((a.status, a.transmission), (b.status, b.transmission));
                    let d = f64::from((a.opd_m - b.opd_m).abs());
                    assert!(d < stretches * 1e-10 + 1e-12, "{d:e} m");
                }
                // Each ray skips by itself.
                let some: Vec<Start> = starts.iter().step_by(7).copied().collect();
                let paths =
                    GpuPaths::new(gpu.clone(), field, oblique(), interpolant, options).unwrap();
                let alone: Vec<Exit> = skipped.iter().step_by(7).copied().collect();
                assert_eq!(trace(&paths, &some), alone);
            }
        }
    }
    let options = GpuOptions { method: Method::Pefrl, skip_rad: 1e-9, ..GpuOptions::default() };
    let e = GpuPaths::new(gpu, &field, oblique(), Interpolant::BSpline, options).err().unwrap();
    assert!(e.to_string().contains("Pefrl"), "{e}");
}

/// A field divided into slabs gives the same exits bit for bit, because the arithmetic is the same.
#[test]
fn a_field_larger_than_a_binding_is_the_same_field() {
    let Some(whole) = gpu() else { return };
    let field = cube(21, lopsided);
    for interpolant in [Interpolant::BSpline, Interpolant::Trilinear] {
        let starts = grid(11, 0.9);
        let options =
            GpuOptions { quantities: PathQuantities { opd: true }, ..GpuOptions::default() };
        let view = oblique();
        let one = GpuPaths::new(whole.clone(), &field, view, interpolant, options).unwrap();
        // A driver on the CPU has coefficients as a texture.
        let is_texture = whole.is_software() && interpolant == Interpolant::BSpline;
        assert_eq!(one.slabs(), usize::from(!is_texture));
        let expected = trace(&one, &starts);
        // The field has 20 layers of cells. A binding holds 8, then 4 of them with their halo.
        for (layers, slabs) in [(8, 3), (4, 5)] {
            let (row, halo) = if interpolant == Interpolant::BSpline { (23, 3) } else { (21, 1) };
            let small =
                Gpu::open().unwrap().with_binding_limit(4 * row * row * (layers + halo) + 15);
            let many = GpuPaths::new(Arc::new(small), &field, view, interpolant, options).unwrap();
            assert_eq!(many.slabs(), slabs, "{interpolant:?}, {layers} layers");
            assert_eq!(trace(&many, &starts), expected, "{interpolant:?}, {slabs} slabs");
        }
    }
}

#[test]
fn a_field_that_fits_no_way_is_refused_with_numbers() {
    let Some(_) = gpu() else { return };
    let tiny = Arc::new(Gpu::open().unwrap().with_binding_limit(1024));
    let field = cube(21, lopsided);
    let e = GpuPaths::new(tiny, &field, oblique(), Interpolant::BSpline, GpuOptions::default())
        .err()
        .unwrap();
    assert!(matches!(e, GpuError::TooLarge { dims: [21, 21, 21], .. }), "{e:?}");
    assert!(e.to_string().contains("--device cpu"), "{e}");
}

/// Exits do not depend on the batches: a batch is prepared while the device works on the previous
/// one, buffers are reused, and the last batch is shorter.
#[test]
fn several_batches_have_the_bits_of_one() {
    let Some(gpu) = gpu() else { return };
    let field = with_body(17);
    let options = GpuOptions { quantities: PathQuantities { opd: true }, ..GpuOptions::default() };
    let starts = &grid(40, 1.1)[..1597];
    for interpolant in [Interpolant::BSpline, Interpolant::Trilinear] {
        let paths = |batch| {
            GpuPaths::new(gpu.clone(), &field, oblique(), interpolant, options)
                .unwrap()
                .with_batch(batch)
        };
        let one = paths(starts.len());
        let expected = format!("{:?}", trace(&one, starts));
        assert_eq!(one.counters().dispatches, 1);
        for batch in [64, 256, 1000, 1596] {
            let several = paths(batch);
            assert_eq!(format!("{:?}", trace(&several, starts)), expected, "batches of {batch}");
            let mut parallel = vec![Exit::UNDISTURBED; starts.len()];
            several.trace_parallel(starts, &mut parallel);
            assert_eq!(format!("{parallel:?}"), expected, "batches of {batch} in parallel");
            let c = several.counters();
            assert_eq!(c.dispatches, 2 * starts.len().div_ceil(batch) as u64);
            assert_eq!((c.rays, c.rays_repeated, c.rays_on_cpu), (2 * starts.len() as u64, 0, 0));
        }
    }
}

/// More rays than one dispatch takes, as in the program, against the CPU.
#[test]
fn images_larger_than_a_dispatch_agree_with_the_cpu() {
    let Some(gpu) = gpu() else { return };
    let field = cube(9, lopsided);
    let starts = grid(515, 0.9);
    assert!(starts.len() > 1 << 18);
    let on_gpu =
        GpuPaths::new(gpu, &field, oblique(), Interpolant::BSpline, GpuOptions::default()).unwrap();
    let (mut a, mut b) =
        (vec![Exit::UNDISTURBED; starts.len()], vec![Exit::UNDISTURBED; starts.len()]);
    on_gpu.trace_parallel(&starts, &mut a);
    assert_eq!((on_gpu.counters().dispatches, on_gpu.counters().rays_on_cpu), (2, 0));
    cpu(&field, oblique(), Interpolant::BSpline, GpuOptions::default())
        .trace_parallel(&starts, &mut b);
    let (_, max) = difference(&a, &b);
    assert!(max < TOLERANCE, "{max:e}");
}

/// Threads that share the paths get the same exits as one thread: buffers of batches are not mixed
/// up.
#[test]
fn batches_of_several_threads_do_not_mix() {
    let Some(gpu) = gpu() else { return };
    let field = cube(17, lopsided);
    let paths =
        GpuPaths::new(gpu, &field, oblique(), Interpolant::BSpline, GpuOptions::default()).unwrap();
    let starts = grid(32, 0.9);
    let expected = trace(&paths, &starts);
    let mut parallel = vec![Exit::UNDISTURBED; starts.len()];
    paths.trace_parallel(&starts, &mut parallel);
    assert_eq!(format!("{parallel:?}"), format!("{expected:?}"));
    std::thread::scope(|s| {
        for t in 0..4 {
            let (paths, starts, expected) = (&paths, &starts, &expected);
            s.spawn(move || {
                for part in 0..4 {
                    let range = 64 * (4 * t + part)..64 * (4 * t + part + 1);
                    let exits = trace(paths, &starts[range.clone()]);
                    assert_eq!(format!("{exits:?}"), format!("{:?}", &expected[range]));
                }
            });
        }
    });
}

/// Renders a scene of `field` on a device.
fn rendered(field: &Field, device: &str, rest: &str) -> Result<RenderOutput, Box<RenderError>> {
    // The film of the shadowgraph is far behind the flow, because its contrast grows with the
    // distance.
    let focus = if rest.contains("shadowgraph") { "focus_m = 30.0\n" } else { "" };
    let toml = format!(
        "[flow]\nfile = \"\"\ndensity = \"-\"\n[film]\nsize = [40, 30]\n{focus}[march]\ndevice \
         = \"{device}\"\n{rest}"
    );
    let scene = Scene::from_toml(&toml).unwrap();
    let section = TestSection::of_fields(&scene, vec![field.clone()], None).unwrap();
    render(&scene, &section, Layers { map: true, ..Layers::NONE }, &Control::default())
        .map_err(Box::new)
}

/// Schlieren by photons, a noise-free shadowgraph, an interferogram (which reads the phase), and
/// BOS (which is traced from the film).
#[test]
fn films_agree_with_the_cpu() {
    let Some(gpu) = gpu() else { return };
    let field = cube(33, lopsided);
    for rest in [
        "method = \"verlet\"\n[sampling]\nmethod = \"photons\"\nsamples = 2",
        "method = \"verlet\"\n[technique]\nkind = \"shadowgraph\"",
        "method = \"verlet\"\n[technique]\nkind = \"interferogram\"",
        "method = \"verlet\"\n[technique]\nkind = \"bos\"",
    ] {
        let [a, b] = ["gpu", "cpu"].map(|d| rendered(&field, d, rest).unwrap());
        let sum: f64 =
            a.pixels.iter().zip(&b.pixels).map(|(a, b)| f64::from(a[0] - b[0]).powi(2)).sum();
        let rms = (sum / a.pixels.len() as f64).sqrt();
        assert!(rms < 1e-3, "{rest}: {rms:e}");
        let contrast = b.report.levels[1] - b.report.levels[0];
        assert!(contrast > 0.05, "{rest}: an empty image, {contrast}");
        assert!(a.report.march.contains(&gpu.name()), "{}", a.report.march);
        assert!(!b.report.march.contains(" on "), "{}", b.report.march);
        let [a, b] = [a, b].map(|r| r.map.unwrap().deflection_rad);
        let scale = b.iter().flatten().fold(0.0f32, |m, d| m.max(d.abs()));
        let off = a
            .iter()
            .flatten()
            .zip(b.iter().flatten())
            .fold(0.0f32, |m, (a, b)| m.max((a - b).abs()));
        assert!(f64::from(off / scale) < TOLERANCE, "{rest}: {:e}", off / scale);
    }
}

/// Single precision knows a path to two millionths: of half a million waves that is a fringe.
#[test]
fn fringes_that_single_precision_shifts_are_warned_of() {
    let Some(_) = gpu() else { return };
    let rest = "method = \"pefrl\"\n[technique]\nkind = \"interferogram\"";
    for (scale, warned) in [(1e-4, false), (0.3, true)] {
        let field = cube(17, |p| scale * lopsided(p) / 1e-3);
        for device in ["gpu", "cpu"] {
            let report = rendered(&field, device, rest).unwrap().report;
            let found = report.warnings.iter().any(|w| w.contains("single precision is off"));
            assert_eq!(found, warned && device == "gpu", "{scale}, {device}: {report:?}");
        }
    }
}

/// Single rays sample the projection on the CPU, so they are its rays bit for bit. Without a named
/// march, the plan takes straight rays on the device where the tolerance allows it, and bent ones
/// where it does not.
#[test]
fn straight_rays_are_those_of_the_cpu_and_follow_from_the_plan() {
    let Some(_) = gpu() else { return };
    let field = cube(9, lopsided);
    for view in ["", "[view]\ndirection = \"31,-17\"\n"] {
        let rest = format!("method = \"line-of-sight\"\n{view}");
        let [a, b] = ["gpu", "cpu"].map(|d| rendered(&field, d, &rest).unwrap());
        assert!(a.report.march.starts_with("line-of-sight, b-spline, on "), "{}", a.report.march);
        let [a, b] = [a, b].map(|r| r.map.unwrap());
        assert_eq!(a.deflection_rad, b.deflection_rad);
        assert_eq!(a.displacement_m, b.displacement_m);
    }
    for (tolerance, march) in [("1e-3", "line-of-sight, b-spline, on "), ("1e-9", "verlet")] {
        let r = rendered(&field, "gpu", &format!("tolerance_rad = {tolerance}")).unwrap();
        assert!(r.report.march.starts_with(march), "{tolerance}: {}", r.report.march);
        assert!(r.report.march.contains(", on "), "{}", r.report.march);
    }
}
