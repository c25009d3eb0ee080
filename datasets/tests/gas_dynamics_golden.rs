//! Compares wedge and cone shocks with a table computed by another program (f64, gamma = 1.4),
//! whose wedges agree with the figures of NACA 1135.

use datasets::generate::gas_dynamics::taylor_maccoll::cone_flow;
use datasets::generate::gas_dynamics::theta_beta_m::{Branch, oblique_shock};

#[test]
fn every_row_of_the_golden_table() {
    let table = include_str!("golden/gasdyn_golden.csv");
    let mut kinds = [0, 0];
    for row in table.lines().skip(1) {
        let cells: Vec<&str> = row.split(',').collect();
        let number = |i: usize| cells[i].parse::<f64>().expect("a number");
        let (mach, angle) = (number(1), number(2).to_radians());
        // Tolerance: the table's last digit.
        let (shock, jump, tolerance) = match cells[0] {
            "wedge" => {
                kinds[0] += 1;
                let s = oblique_shock(1.4, mach, angle, Branch::Weak).unwrap();
                (s.shock_rad, s.jump, 1e-8)
            }
            _ => {
                kinds[1] += 1;
                let c = cone_flow(1.4, mach, angle).unwrap();
                (c.shock_rad, c.jump, 1e-6)
            }
        };
        assert!(
            (shock.to_degrees() - number(3)).abs() < tolerance,
            "{row}: {}",
            shock.to_degrees()
        );
        assert!((jump.density - number(4)).abs() < tolerance, "{row}: {}", jump.density);
        assert!((jump.pressure - number(5)).abs() < tolerance, "{row}: {}", jump.pressure);
    }
    assert!(kinds.iter().all(|&n| n > 10), "{kinds:?}");
}
