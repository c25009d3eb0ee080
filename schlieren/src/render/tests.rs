use super::*;
use crate::field::{Field, Node};
use crate::solids::Solids;
use glam::{DVec3, Vec3};
use rt_core::bvh::{BuildOptions, World};
use rt_core::mesh::TriMesh;

const SIGMA: f64 = 12e-3;
const AMPLITUDE: f64 = -2e-5;

fn blob() -> Field {
    Field::from_fn([33; 3], [3e-3; 3], DVec3::splat(-48e-3), 1.00027, |p| {
        AMPLITUDE * (-p.length_squared() / (2.0 * SIGMA * SIGMA)).exp()
    })
    .unwrap()
}

fn scene(rest: &str) -> Scene {
    Scene::from_toml(&format!("[flow]\nfile = \"-\"\ndensity = \"-\"\n{rest}")).unwrap()
}

fn rendered(rest: &str, layers: Layers) -> RenderOutput {
    let s = scene(rest);
    let fields = s.lines().iter().map(|_| blob()).collect();
    let section = TestSection::of_fields(&s, fields, None).unwrap();
    render(&s, &section, layers, &Control::default()).unwrap()
}

const SMALL: &str = "[film]\nsize = [48, 40]\n";

#[test]
fn images_are_the_same_for_any_number_of_threads() {
    for technique in [
        "kind = \"schlieren\"",
        "kind = \"shadowgraph\"",
        "kind = \"schlieren\"\ncutoff = { kind = \"color\", radius_m = 1e-4 }",
    ] {
        for sampling in [
            "method = \"photons\"\nsamples = 4",
            "method = \"beams\"",
            "method = \"photons\"\nsamples = 4\nfilter = { kind = \"cone\", nearest = 6 }",
        ] {
            let text = format!("{SMALL}[technique]\n{technique}\n[sampling]\n{sampling}");
            let with = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| rendered(&text, Layers::NONE).pixels)
            };
            let bits = |p: Vec<Rgb>| p.into_iter().flatten().map(f32::to_bits).collect::<Vec<_>>();
            assert_eq!(bits(with(1)), bits(with(5)), "{text}");
        }
    }
}

#[test]
fn a_flow_that_no_light_passes_is_named() {
    let walled = |from: usize| {
        let kind =
            |i: usize| if i / 1089 == 16 && i % 33 >= from { Node::Blank } else { Node::Gas };
        let nodes: Vec<Node> = (0..33 * 33 * 33).map(kind).collect();
        let b = blob();
        Field::new(b.dims(), b.spacing_m(), b.origin_m(), b.eps().to_vec(), b.n0(), Some(nodes))
            .unwrap()
    };
    let s = scene(&format!("{SMALL}[view]\ndirection = \"z\"\n"));
    let warned = |from| {
        let section = TestSection::of_fields(&s, vec![walled(from)], None).unwrap();
        let r = render(&s, &section, Layers { map: true, ..Layers::NONE }, &Control::default())
            .unwrap();
        assert!(r.report.tally.blocked_in_field > 0);
        r.report.warnings.iter().any(|w| w.contains("no light passes the flow"))
    };
    assert!(warned(0));
    assert!(!warned(8), "a quarter is open");
}

#[test]
fn the_map_is_the_closed_form_with_row_0_at_the_top() {
    let r = rendered(SMALL, Layers { map: true, phase: true, ..Layers::NONE });
    let m = r.map.unwrap();
    let half_m = 48e-3;
    let n0 = 1.00027;
    let (mut worst, mut worst_phase) = (0.0f64, 0.0f64);
    for (i, s) in r.framing.pixel_centers().iter().enumerate() {
        let [x, y] = s.position_m.map(f64::from);
        if x.abs() > half_m || y.abs() > half_m {
            continue;
        }
        let inside = crate::analytic::erf(half_m / (SIGMA * 2f64.sqrt()));
        let path = AMPLITUDE
            * SIGMA
            * std::f64::consts::TAU.sqrt()
            * (-(x * x + y * y) / (2.0 * SIGMA * SIGMA)).exp()
            * inside;
        for (got, at) in m.deflection_rad[i].iter().zip([x, y]) {
            worst = worst.max((f64::from(*got) + at / (SIGMA * SIGMA) * path).abs());
        }
        worst_phase = worst_phase.max((f64::from(m.waves[i]) - n0 * path / 633e-9).abs());
    }
    // σ is four voxels, where the B-spline's relative error is far below 3e-3. Deflections reach
    // 3e-5.
    assert!(
        m.largest_deflection_rad > 2e-5 && worst < 3e-3 * m.largest_deflection_rad,
        "{worst:e}"
    );
    assert!(worst_phase < 2e-3, "{worst_phase:e} waves of {}", AMPLITUDE * SIGMA * 2.5 / 633e-9);
    // Warm air bends light away from its middle, so upwards in the upper row.
    assert!(m.deflection_rad[10 * 48 + 24][1] > 0.0 && m.deflection_rad[30 * 48 + 24][1] < 0.0);
}

#[test]
fn what_a_scene_does_not_call_for_is_not_counted() {
    let c = |text: &str, layers| rendered(&format!("{SMALL}{text}"), layers).report;
    let photons = "[sampling]\nmethod = \"photons\"\nsamples = 2\n";
    let plain = c(photons, Layers::NONE);
    let k = plain.counters;
    assert!(k.rays >= 2 * 48 * 40);
    assert_eq!(
        (
            k.map_rays,
            k.phase_rays,
            k.dispersion_rays,
            k.solid_queries,
            k.tilted_rays,
            k.differential_rays
        ),
        (0, 0, 0, 0, 0, 0)
    );
    assert_eq!(plain.effects, Effects::default());

    let phase = c(&format!("[technique]\nkind = \"interferogram\"\n{photons}"), Layers::NONE);
    assert!(phase.effects.phase && phase.counters.phase_rays == phase.counters.rays);
    let colors = c(&format!("[light]\nwavelengths_nm = [633, 532]\n{photons}"), Layers::NONE);
    assert!(
        colors.effects.dispersion && colors.counters.dispersion_rays * 2 == colors.counters.rays
    );
    let tilted = c(&format!("[light]\nbeams = \"tilted\"\n{photons}"), Layers::NONE);
    assert!(tilted.effects.tilted_beams && tilted.counters.tilted_rays == tilted.counters.rays);
    let beams = c("[technique]\nkind = \"shadowgraph\"\n", Layers::NONE);
    assert!(beams.effects.differentials && beams.counters.differential_rays == beams.counters.rays);
    let slice = c("[technique]\nkind = \"slice\"\n", Layers::NONE);
    assert_eq!(slice.counters, Counters::default());
}

#[test]
fn a_plate_casts_its_shadow_and_only_there() {
    // A square of 20 mm in the middle of the section, across the light.
    let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0) * 10e-3;
    let positions =
        vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let mesh = TriMesh::new(positions, vec![[0, 1, 2], [0, 2, 3]]);
    let plate =
        || Solids::from_world(World::from_mesh(mesh.clone(), &BuildOptions::default()).unwrap());
    for sampling in
        ["method = \"photons\"\nsamples = 4\nfilter = { kind = \"none\" }", "method = \"beams\""]
    {
        // The scene names a file so that its effects include bodies; the plate above is used.
        let s = scene(&format!(
            "{SMALL}[technique]\nkind = \"shadowgraph\"\n[solids]\nfiles = \
             [\"plate.stl\"]\n[sampling]\n{sampling}"
        ));
        let section = TestSection::of_fields(&s, vec![blob()], Some(plate())).unwrap();
        let r = render(&s, &section, Layers { map: true, ..Layers::NONE }, &Control::default())
            .unwrap();
        // Rays bend outwards by up to 0.5 m · 3e-5 = 15 µm, far below a pixel of 2.4 mm.
        let at = |x_mm: f64, y_mm: f64| {
            let [x, y] = [x_mm, -y_mm].map(|c| c * 1e-3 / r.framing.pixel_m);
            r.pixels[(y + 20.0) as usize * 48 + (x + 24.0) as usize][0]
        };
        assert_eq!(at(0.0, 0.0), 0.0, "{sampling}");
        assert_eq!(at(7.0, -7.0), 0.0);
        assert!(at(14.0, 0.0) > 0.4 && at(0.0, 14.0) > 0.4 && at(-14.0, 14.0) > 0.4);
        assert!(r.report.counters.solid_queries > 0 && r.report.effects.solids);
        assert!(r.report.silhouette_error_px.unwrap() < 0.01);
        let map = r.map.unwrap();
        assert_eq!(map.transmission[20 * 48 + 24], 0.0);
        assert!(map.dark > 50 && map.dark < 80, "(20 mm / 2.4 mm)² pixels: {}", map.dark);
    }
}

#[test]
fn uniform_images_are_warned_about_and_cancelling_cancels() {
    let r = rendered("[film]\nsize = [16, 16]\n[lenses]\ncollimator_m = 1e-3", Layers::NONE);
    assert!(
        r.report.warnings.iter().any(|w| w.contains("more sensitive")),
        "{:?}",
        r.report.warnings
    );
    let s = scene(SMALL);
    let section = TestSection::of_fields(&s, vec![blob()], None).unwrap();
    let cancel = AtomicBool::new(true);
    let control = Control { cancel: &cancel, progress: &|_| {} };
    assert!(matches!(render(&s, &section, Layers::NONE, &control), Err(RenderError::Cancelled)));
}

#[test]
fn the_tolerance_picks_the_march() {
    let march = |rest: &str| rendered(&format!("{SMALL}[march]\n{rest}"), Layers::NONE).report;
    let rough = march("tolerance_rad = 1e-6");
    assert!(rough.march.starts_with("line-of-sight"), "{}", rough.march);
    let fine = march("tolerance_rad = 2e-10");
    assert!(
        !fine.march.starts_with("line-of-sight"),
        "{} {:?}",
        fine.march,
        fine.deflection_error_rad
    );
    for name in MARCHES {
        assert!(march(&format!("method = \"{name}\"")).march.starts_with(name));
    }
    let s = scene("[march]\nmethod = \"guess\"");
    let section = TestSection::of_fields(&s, vec![blob()], None).unwrap();
    let error = render(&s, &section, Layers::NONE, &Control::default()).unwrap_err().to_string();
    assert!(error.contains("guess") && error.contains("rk4"), "{error}");
}

#[test]
fn dots_are_displaced_as_the_map_says() {
    let r = rendered(
        &format!("{SMALL}[technique]\nkind = \"bos\"\n"),
        Layers { map: true, ..Layers::NONE },
    );
    let m = r.map.unwrap();
    // Camera rays bend away from the warm middle. The background is 0.5 m behind it, so at (x, 0)
    // the displacement is about 0.5 m times the deflection.
    let i = 20 * 48 + 30;
    let ratio = f64::from(m.displacement_m[i][0]) / f64::from(m.deflection_rad[i][0]);
    assert!((ratio - 0.5).abs() < 0.01 && m.deflection_rad[i][0] > 0.0, "{ratio}");
}

/// Paths whose device failed while tracing: the results are right, and there is a warning.
struct Failed<'a>(Box<dyn LightPaths + 'a>);

impl LightPaths for Failed<'_> {
    fn trace(&self, starts: &[Start], exits: &mut [crate::path::Exit]) {
        self.0.trace(starts, exits);
    }
    fn view(&self) -> &crate::view::View {
        self.0.view()
    }
    fn quantities(&self) -> PathQuantities {
        self.0.quantities()
    }
    fn difference_step_m(&self) -> f64 {
        self.0.difference_step_m()
    }
    fn device_warning(&self) -> Option<String> {
        Some("the GPU `Lamp 9` failed (out of memory); the rest was computed on the CPU".into())
    }
}

#[test]
fn a_device_that_failed_on_the_way_is_a_warning_of_the_image_reported_once() {
    for technique in ["schlieren", "bos"] {
        let s = scene(&format!("{SMALL}[technique]\nkind = \"{technique}\""));
        let section = TestSection::of_fields(&s, vec![blob()], None).unwrap();
        let against_light = technique == "bos";
        let planned =
            section.paths(&s, 0, PathQuantities::default(), against_light, false).unwrap();
        let planned = PlannedPaths { paths: Box::new(Failed(planned.paths)), ..planned };
        let mut r = rendered(&format!("{SMALL}[technique]\nkind = \"{technique}\""), Layers::NONE);
        for _ in 0..2 {
            add_map(&s, &section, &planned, &Control::default(), &mut r).unwrap();
        }
        let warning = r
            .report
            .warnings
            .iter()
            .filter(|w| w.contains("Lamp 9") && w.contains("out of memory"));
        assert_eq!(warning.count(), 1, "{technique}: {:?}", r.report.warnings);
        assert!(r.map.is_some());
    }
    // Paths traced against the light pass the warning on.
    let s = scene(&format!("{SMALL}[technique]\nkind = \"bos\""));
    let section = TestSection::of_fields(&s, vec![blob()], None).unwrap();
    let planned = section.paths(&s, 0, PathQuantities::default(), false, false).unwrap();
    let reversed = crate::technique::bos::ReversedPaths::new(Box::new(Failed(planned.paths)));
    assert!(reversed.device_warning().is_some_and(|t| t.contains("Lamp 9")));
}

/// Dots are followed from the picture without a flow to the picture with it, as correlation does.
#[test]
fn dots_of_the_background_move_as_the_displacement_map_says() {
    let text = "[film]\nsize = [160, 120]\nfocus_m = 1.0\n[view]\ndirection = \"z\"\n\
                [technique]\nkind = \"bos\"\n\
                [sampling]\nmethod = \"photons\"\nsamples = 16\n";
    let s = scene(text);
    let layers = Layers { map: true, ..Layers::NONE };
    let with = |slope: [f64; 2]| {
        let field = Field::from_fn([33; 3], [3e-3; 3], DVec3::splat(-48e-3), 1.0, |p| {
            // A lens and a prism: shifts that differ from place to place.
            slope[0] * p.x + slope[1] * p.y + 0.5 * (slope[0] + slope[1]) * 5.0 * p.x * p.x
        })
        .unwrap();
        let section = TestSection::of_fields(&s, vec![field], None).unwrap();
        render(&s, &section, layers, &Control::default()).unwrap()
    };
    let still = with([0.0; 2]);
    let moved = with([0.03, -0.015]);
    let map = moved.map.as_ref().unwrap();
    let width = moved.framing.width as usize;
    let value = |r: &RenderOutput, x: usize, y: usize| f64::from(r.pixels[y * width + x][0]);
    let mut compared = 0;
    for (cx, cy) in [(50, 40), (80, 60), (110, 80), (60, 90)] {
        // The window's best whole shift by squared differences.
        let mut best = (f64::INFINITY, [0i64; 2]);
        for sx in -12..=12i64 {
            for sy in -12..=12i64 {
                let mut sum = 0.0;
                for y in cy - 12..cy + 12usize {
                    for x in cx - 12..cx + 12usize {
                        let (tx, ty) = (x as i64 + sx, y as i64 - sy);
                        let d = value(&still, x, y) - value(&moved, tx as usize, ty as usize);
                        sum += d * d;
                    }
                }
                if sum < best.0 {
                    best = (sum, [sx, sy]);
                }
            }
        }
        let said = map.apparent_m[cy * width + cx].map(|m| f64::from(m) / moved.framing.pixel_m);
        for c in 0..2 {
            let seen = best.1[c] as f64;
            assert!((said[c] - seen).abs() < 0.8, "at {cx}, {cy}: {said:?} seen {best:?}");
        }
        compared += usize::from(said[0].abs() > 1.5 && said[1].abs() > 1.0);
    }
    assert!(compared >= 3, "{compared} windows moved");
    // Just as far at the place where the dot is seen, and the other way.
    let [x, y] = [80usize, 60];
    let u = map.apparent_m[y * width + x].map(|m| f64::from(m) / moved.framing.pixel_m);
    let at = [(x as f64 + u[0]).round() as usize, (y as f64 - u[1]).round() as usize];
    let d = map.displacement_m[at[1] * width + at[0]];
    for c in 0..2 {
        let d = f64::from(d[c]) / moved.framing.pixel_m;
        assert!((u[c] + d).abs() < 0.2, "{u:?} {d}");
    }
}
