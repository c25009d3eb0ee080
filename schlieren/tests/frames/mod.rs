//! Frames of both devices, and how far they are apart.
#![allow(dead_code, reason = "each test binary uses its part")]

use super::device;
use glam::DVec3;
use schlieren::field::Field;
use schlieren::media::{Media, Property, Volume};
use schlieren::render::{Control, Layers, RenderOutput, TestSection, render};
use schlieren::scene::Scene;

/// Whether there is a device. Without one, prints why the test is skipped.
pub(crate) fn has_gpu() -> bool {
    device::gpu().is_some()
}

pub(crate) const PHOTONS: &str = "[sampling]\nmethod = \"photons\"\nsamples = 4\nseed = 77\n";
pub(crate) const BEAMS: &str = "[sampling]\nmethod = \"beams\"\ncells_per_side = 2\n";
pub(crate) const NO_FILTER: &str = "[sampling.filter]\nkind = \"none\"\n";

pub(crate) fn scene(device: &str, film: &str, rest: &str) -> Scene {
    marched(device, film, ["verlet", "b-spline"], rest)
}

pub(crate) fn marched(
    device: &str,
    film: &str,
    [march, interpolant]: [&str; 2],
    rest: &str,
) -> Scene {
    let toml = format!(
        "[flow]\nfile = \"\"\ndensity = \"-\"\n[film]\nsize = [41, 30]\n{film}[march]\ndevice = \
         \"{device}\"\nmethod = \"{march}\"\ninterpolant = \"{interpolant}\"\nstep_voxels = \
         1.0\n{rest}"
    );
    Scene::from_toml(&toml).unwrap_or_else(|e| panic!("{toml}: {e}"))
}

pub(crate) fn exposed(field: &Field, scene: &Scene) -> RenderOutput {
    let section = TestSection::of_fields(scene, vec![field.clone()], None).unwrap();
    let layers = Layers { counts: true, noise: true, ..Layers::NONE };
    render(scene, &section, layers, &Control::default()).unwrap()
}

/// As [`exposed`], through smoke in waves that turns the light's polarisation. Their lattices are
/// not that of the field.
pub(crate) fn exposed_through_smoke(field: &Field, scene: &Scene) -> RenderOutput {
    let wave = |p: DVec3| (3.0 * p.x - 2.0 * p.y + 4.0 * p.z).sin();
    let volume = |n: usize, scale: f64, offset: f64| {
        let spacing_m = field.size_m() * 1.2 / (n - 1) as f64;
        let low = field.origin_m() - 0.1 * field.size_m();
        let value = |p: DVec3| offset + scale * wave(p - field.origin_m());
        Volume::from_fn([n; 3], spacing_m.to_array(), low, value).unwrap()
    };
    let media = Media::default()
        .with(Property::Absorption, volume(19, 0.3, 0.4))
        .with(Property::Rotation, volume(40, 2.0, -0.5));
    let section = TestSection::of_fields(scene, vec![field.clone()], None).unwrap();
    render(scene, &section.with_media(media), Layers::NONE, &Control::default()).unwrap()
}

/// The frames of the GPU and of the CPU. The GPU must have exposed its own.
pub(crate) fn both(field: &Field, film: &str, rest: &str) -> [RenderOutput; 2] {
    let [gpu, cpu] = ["gpu", "cpu"].map(|d| exposed(field, &scene(d, film, rest)));
    check_device(&gpu, &cpu, rest);
    [gpu, cpu]
}

/// Checks that the GPU has exposed its frame, and that the same light arrived.
pub(crate) fn check_device(gpu: &RenderOutput, cpu: &RenderOutput, rest: &str) {
    let device = gpu.report.device.expect("the work of the device");
    let tally = gpu.report.tally;
    assert_eq!(device.photons, tally.sent, "{rest}: {:?}", gpu.report.warnings);
    assert!(gpu.report.device.is_some() && cpu.report.device.is_none());
    assert_eq!(tally.sent, cpu.report.tally.sent, "{rest}");
    let stopped = |o: &RenderOutput| [o.report.tally.blocked_in_field, o.report.tally.turned];
    assert_eq!(stopped(gpu), stopped(cpu), "{rest}");
    assert_eq!(tally.not_a_number, 0);
}

/// Number of pixels of which a channel differs by more than is allowed.
pub(crate) fn changed(a: &RenderOutput, b: &RenderOutput, allowed: f32) -> usize {
    let off = |(a, b): &(&[f32; 3], &[f32; 3])| (0..3).any(|c| (a[c] - b[c]).abs() > allowed);
    a.pixels.iter().zip(&b.pixels).filter(off).count()
}

/// Largest difference of the two images, and the largest brightness.
pub(crate) fn difference(a: &RenderOutput, b: &RenderOutput) -> [f32; 2] {
    let mut worst = [0.0f32; 2];
    for (a, b) in a.pixels.iter().zip(&b.pixels) {
        for c in 0..3 {
            assert!(a[c].is_finite());
            worst = [worst[0].max((a[c] - b[c]).abs()), worst[1].max(b[c])];
        }
    }
    worst
}

pub(crate) const KNIFE: &str =
    "[technique]\nkind = \"schlieren\"\n[technique.cutoff]\nkind = \"knife\"\n";

/// The scenes: technique, cut-off and source of each.
pub(crate) fn techniques() -> Vec<(&'static str, String)> {
    let schlieren =
        |cutoff: &str| format!("[technique]\nkind = \"schlieren\"\n[technique.cutoff]\n{cutoff}");
    let disc = "[light.source]\nkind = \"circle\"\ndiameter_m = 2e-3\n";
    let slit = "[light.source]\nkind = \"slit\"\nwidth_m = 1e-3\nlength_m = 2e-3\nangle_deg = \
                20.0\n";
    vec![
        ("knife", KNIFE.to_string()),
        ("knife before a turned slit", KNIFE.to_string() + slit),
        ("knife before a disc", KNIFE.to_string() + disc),
        ("circle", schlieren("kind = \"circle\"\nradius_m = 1e-3\n") + disc),
        ("circle before a slit", schlieren("kind = \"circle\"\nradius_m = 4e-4\n")),
        ("dark field", schlieren("kind = \"complemented-circle\"\nradius_m = 1e-3\n") + disc),
        ("colours", schlieren("kind = \"color\"\nradius_m = 2e-3\n")),
        ("interferogram", "[technique]\nkind = \"interferogram\"\n".into()),
        (
            "finite fringes",
            "[technique]\nkind = \"interferogram\"\nfringe_spacing_m = 0.05\nvisibility = 0.7\n"
                .into(),
        ),
        ("dots", "[technique]\nkind = \"bos\"\nseed = 5\n".into()),
        ("shadowgraph", "[technique]\nkind = \"shadowgraph\"\n".into()),
    ]
}
