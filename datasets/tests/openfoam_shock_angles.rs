//! Compares the committed OpenFOAM results with the exact solutions: shock angles within 0.3
//! degrees, densities within 2 %.

use datasets::generate::gas_dynamics::taylor_maccoll::cone_flow;
use datasets::generate::gas_dynamics::theta_beta_m::{Branch, oblique_shock};
use datasets::generate::swept_slice::{Slice, Sweep};
use datasets::read::open;

fn slice(case: &str) -> Slice {
    let path = format!("{}/openfoam/{case}/slice.vts", env!("CARGO_MANIFEST_DIR"));
    Slice::from_dataset(open(path).unwrap().dataset().unwrap()).unwrap()
}

/// Slope, in degrees, of the line through the points where the density, going inwards, reaches half
/// of the jump.
fn shock_angle_degrees(slice: &Slice, free: f64, ratio: f64) -> f64 {
    let middle = free * 0.5 * (1.0 + ratio);
    let mut points = Vec::new();
    for line in 0..slice.lines() {
        let cells = slice.line("density", line).unwrap();
        let x = cells[0].0[0];
        // Skip the apex, where the shock is thicker than its distance in cells, and the region
        // behind the shoulder.
        if !(0.015..0.048).contains(&x) {
            continue;
        }
        let outer =
            cells.windows(2).rev().find(|w| w[0].1 > middle && w[1].1 <= middle).expect("a shock");
        let t = (outer[0].1 - middle) / (outer[0].1 - outer[1].1);
        points.push([x, outer[0].0[1] + t * (outer[1].0[1] - outer[0].0[1])]);
    }
    assert!(points.len() > 60, "{}", points.len());
    let n = points.len() as f64;
    let [mx, my] = [0, 1].map(|c| points.iter().map(|p| p[c]).sum::<f64>() / n);
    let covariance: f64 = points.iter().map(|p| (p[0] - mx) * (p[1] - my)).sum();
    let variance: f64 = points.iter().map(|p| (p[0] - mx).powi(2)).sum();
    (covariance / variance).atan().to_degrees()
}

/// Density of a cell near the surface at x, relative to the free stream's, and the angle of that
/// cell seen from the apex.
fn surface_density(slice: &Slice, x: f64) -> (f64, f64) {
    let free = slice.line("density", 0).unwrap()[60].1;
    let line = (0..slice.lines()).find(|&l| slice.line("density", l).unwrap()[0].0[0] > x).unwrap();
    // Skip the first cells: the wall's boundary condition heats them slightly.
    let (at, density) = slice.line("density", line).unwrap()[8];
    (density / free, at[1].atan2(at[0]))
}

#[test]
fn wedge_has_the_shock_of_theta_beta_m() {
    let slice = slice("wedge15_mach2_5");
    let exact = oblique_shock(1.4, 2.5, 15f64.to_radians(), Branch::Weak).unwrap();
    let free = slice.line("density", 0).unwrap()[60].1;
    assert!((free - 0.52256).abs() < 1e-4, "{free}");
    let found = shock_angle_degrees(&slice, free, exact.jump.density);
    assert!(
        (found - exact.shock_rad.to_degrees()).abs() < 0.3,
        "{found} {}",
        exact.shock_rad.to_degrees()
    );
    let (density, _) = surface_density(&slice, 0.04);
    assert!((density / exact.jump.density - 1.0).abs() < 0.02, "{density} {}", exact.jump.density);
}

#[test]
fn cone_has_the_shock_of_taylor_and_maccoll() {
    let slice = slice("cone20_mach3");
    let exact = cone_flow(1.4, 3.0, 20f64.to_radians()).unwrap();
    let free = slice.line("density", 0).unwrap()[60].1;
    let found = shock_angle_degrees(&slice, free, exact.jump.density);
    assert!(
        (found - exact.shock_rad.to_degrees()).abs() < 0.3,
        "{found} {}",
        exact.shock_rad.to_degrees()
    );
    let (density, angle) = surface_density(&slice, 0.04);
    let expected = exact.state(angle).density;
    assert!(
        expected > 1.05 * exact.jump.density && (density / expected - 1.0).abs() < 0.01,
        "{density} {expected}"
    );
}

#[test]
fn revolved_cone_keeps_its_shock_and_its_hole() {
    let slice = slice("cone20_mach3");
    let flow = slice.flow(Sweep::Revolve, glam::UVec3::splat(48)).unwrap();
    let rho = flow.grid("density").unwrap();
    let exact = cone_flow(1.4, 3.0, 20f64.to_radians()).unwrap();
    // In the plane x = 40 mm: free stream outside the shock, compressed gas inside, no values in
    // the cone.
    let i = ((0.04 - flow.origin_m.x) / flow.spacing_m.x).round() as u32;
    let x = flow.position_m(i, 0, 0).x;
    for jk in 0..48 * 48 {
        let p = flow.position_m(i, jk % 48, jk / 48);
        let angle = p.y.hypot(p.z).atan2(x);
        let ratio = rho.at(i, jk % 48, jk / 48) as f64 / 0.6503;
        if angle > exact.shock_rad + 0.07 {
            assert!((ratio - 1.0).abs() < 0.01, "{p}: {ratio}");
        } else if angle < exact.shock_rad - 0.07 && angle > exact.cone_rad + 0.05 {
            assert!((ratio / exact.state(angle).density - 1.0).abs() < 0.05, "{p}: {ratio}");
        } else if angle < exact.cone_rad - 0.07 {
            assert!(ratio.is_nan(), "{p}: {ratio}");
        }
    }
}
