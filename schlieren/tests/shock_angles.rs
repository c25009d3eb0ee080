//! Compares angles of shocks, measured in schlieren images as on a photograph, with theta-beta-M
//! and with Taylor and Maccoll. Also tests the phase across a shock.
//!
//! The compared number depends on the whole chain: gas dynamics, flow, field, march, optics and
//! film.

use datasets::generate::cone_shock::Cone;
use datasets::generate::flow::{Fields, Flow};
use datasets::generate::gas_dynamics::FreeStream;
use datasets::generate::oblique_shock::Wedge;
use glam::UVec3;
use schlieren::index::Gas;
use schlieren::input::{Medium, Options, from_dataset};
use schlieren::measure::{Line, Mark, Photograph, SearchFrom, fitted_line};
use schlieren::render::{Control, Layers, RenderOutput, TestSection, render};
use schlieren::scene::Scene;

/// Largest error of a fitted angle, in degrees.
const TOLERANCE_DEG: f64 = 0.3;

/// An image of a flow, 300 pixels wide, with the default bench and tolerance.
fn photographed(flow: Flow, toml: &str, layers: Layers) -> RenderOutput {
    let (w, h) = (flow.high_m().x - flow.origin_m.x, flow.high_m().y - flow.origin_m.y);
    let rows = (300.0 * h / w).round();
    let scene =
        format!("[flow]\nfile = \"\"\ndensity = \"-\"\n[film]\nsize = [300, {rows}]\n{toml}");
    let scene = Scene::from_toml(&scene).unwrap();
    let options = Options { wavelength_nm: 633.0, ..Options::new(Medium::density("density")) };
    let field = from_dataset(&flow.into_dataset(), &options).unwrap().field;
    let section = TestSection::of_fields(&scene, vec![field], None).unwrap();
    render(&scene, &section, layers, &Control::default()).unwrap()
}

/// The line fitted to the shock above the body, in the columns `part` of the image, from 0 at the
/// left to 1.
fn shock(flow: Flow, knife_deg: f64, part: [f64; 2]) -> Line {
    let toml = format!(
        "[technique]\nkind = \"schlieren\"\ncutoff = {{ kind = \"knife\", angle_deg = \
         {knife_deg:?} }}\n[sampling]\nmethod = \"photons\"\nsamples = 4"
    );
    let rendered = photographed(flow, &toml, Layers { map: true, ..Layers::NONE });
    let photograph = Photograph::from_render(&rendered).unwrap();
    let framing = photograph.framing;
    let [left, right] = part.map(|p| framing.plane_from_pixel(p * 300.0, 0.0)[0]);
    let points = photograph.fronts_m(SearchFrom::Top, Mark::Edge, 0.05, 4);
    let points: Vec<_> = points.into_iter().filter(|p| (left..right).contains(&p[0])).collect();
    let line = fitted_line(&points).unwrap();
    // The points lie on a line.
    assert!(
        line.points > 100 && line.rms_m < 2.0 * framing.pixel_m,
        "{line:?}, pixels of {}",
        framing.pixel_m
    );
    line
}

fn wedge(mach: f64, half_angle_deg: f64) -> Wedge {
    let stream = FreeStream::from_reservoir(mach, 1e5, 300.0);
    Wedge { stream, half_angle_rad: half_angle_deg.to_radians(), ..Wedge::default() }
}

fn assert_angle(what: &str, line: &Line, exact_rad: f64, golden_deg: f64) {
    let (got, exact) = (line.angle_rad.to_degrees(), exact_rad.to_degrees());
    println!(
        "{what}: {got:.4} degrees in the image, exact {exact:.4}, rms {:.1e} m over {} points",
        line.rms_m, line.points
    );
    // Compares the generator's own solution with the table that another program computed.
    assert!((exact - golden_deg).abs() < 1e-4, "{what}: {exact} {golden_deg}");
    assert!((got - exact).abs() < TOLERANCE_DEG, "{what}: {got} {exact} {line:?}");
}

#[test]
fn wedge_shocks_stand_at_theta_beta_m() {
    for (mach, half_angle_deg, golden_deg) in [(3.0, 20.0, 37.7636), (2.0, 10.0, 39.3139)] {
        let wedge = wedge(mach, half_angle_deg);
        let exact = wedge.shock().unwrap().shock_rad;
        for knife_deg in if mach == 3.0 { vec![0.0, 90.0] } else { vec![45.0] } {
            let flow = wedge.flow(UVec3::new(121, 121, 17), Fields::Density).unwrap();
            let line = shock(flow, knife_deg, [0.2, 0.98]);
            assert_angle(
                &format!("wedge {half_angle_deg}, M {mach}, knife {knife_deg}"),
                &line,
                exact,
                golden_deg,
            );
        }
    }
}

#[test]
fn cone_shocks_stand_at_taylor_maccoll() {
    for (mach, golden_deg) in [(3.0, 29.6146), (2.0, 37.7959)] {
        let stream = FreeStream::from_reservoir(mach, 1e5, 300.0);
        let cone = Cone { stream, ..Cone::default() };
        let exact = cone.solution().unwrap().shock_rad;
        let flow = cone.flow(UVec3::new(91, 97, 97), Fields::Density).unwrap();
        // Excludes the apex, where the shock is a few voxels across.
        let line = shock(flow, 90.0, [0.35, 0.98]);
        assert_angle(&format!("cone 20, M {mach}"), &line, exact, golden_deg);
    }
}

/// 2π K (ρ2 - ρ1) s / λ, in the phase layer and in the brightness of the infinite fringe.
#[test]
fn the_phase_steps_by_the_density_across_a_shock() {
    let wedge = wedge(3.0, 20.0);
    let shock = wedge.shock().unwrap();
    let rho = wedge.stream.density();
    let k = "air".parse::<Gas>().unwrap().k_m3_per_kg(0.633).unwrap();
    let waves = k * rho * (shock.jump.density - 1.0) * wedge.span_m / 633e-9;
    // The step must be several fringes, so that it is tested beyond a fraction of one.
    assert!((3.0..30.0).contains(&waves), "{waves}");

    let flow = wedge.flow(UVec3::new(121, 121, 17), Fields::Density).unwrap();
    let toml = "[technique]\nkind = \"interferogram\"";
    let r = photographed(flow, toml, Layers { map: true, phase: true, ..Layers::NONE });
    let map = r.map.unwrap();
    let (width, pixel_m) = (r.framing.width as usize, r.framing.pixel_m);
    // Lengths are measured from the wedge's edge. The image begins a fifth of the wedge's length
    // before it.
    let at = |x_m: f64, y_m: f64| {
        let i = ((x_m + 0.2 * wedge.length_m) / pixel_m) as usize;
        let j = (0.5 * f64::from(r.framing.height) - y_m / pixel_m) as usize;
        i + j * width
    };
    let (mut checked, mut worst, mut worst_brightness) = (0, 0.0f64, 0.0f64);
    for x_m in [0.02, 0.03, 0.04, 0.05] {
        // Samples between body and shock, and outside the shock, well away from both, above the
        // wedge and mirrored below it.
        let (surface, front) = (x_m * wedge.half_angle_rad.tan(), x_m * shock.shock_rad.tan());
        for share in [0.35, 0.5, 0.65] {
            for side in [1.0, -1.0] {
                let behind = at(x_m, side * (surface + share * (front - surface)));
                let before = at(x_m, side * 1.3 * front);
                assert!(map.transmission[behind] == 1.0 && map.transmission[before] == 1.0);
                let step = f64::from(map.waves[behind]) - f64::from(map.waves[before]);
                worst = worst.max((step - waves).abs());
                let fringe = 0.5 * (1.0 + (2.0 * std::f64::consts::PI * waves).cos());
                worst_brightness =
                    worst_brightness.max((f64::from(r.pixels[behind][0]) - fringe).abs());
                checked += 1;
            }
        }
    }
    println!("{waves:.4} waves, off by {worst:.1e}; brightness by {worst_brightness:.1e}");
    // The spline overshoots beside the jump. The overshoot falls by 3.7 per voxel (the pole of the
    // cubic spline's prefilter is sqrt(3) - 2), and samples are 4 voxels and more from the jump.
    // Tolerance: 2e-3 of the step and of a fringe's brightness.
    assert!(
        checked == 24 && worst < 2e-3 * waves && worst_brightness < 0.05,
        "{worst} of {waves}; {worst_brightness}"
    );
}
