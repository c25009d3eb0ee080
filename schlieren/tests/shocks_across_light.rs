//! Light across oblique shocks that were sampled at points, against the closed form: a plane jump
//! of eps bends light by the jump times the cotangent of the angle between them, whatever the
//! thickness of the jump.

use datasets::model::{DataArray, Dataset, ImageData, Values};
use glam::DVec3;
use schlieren::input::{LoadedField, Medium, Options, Quantity, Reference, from_dataset};
use schlieren::path::{Exit, Start};
use schlieren::plan::{Plan, Request};
use schlieren::view::{Axis, View};

/// The jump of n - 1, as of a weak shock in air.
const JUMP: f64 = 1e-5;
/// Largest error of the averages, which the warning of the input names.
const TOLERANCE: f64 = 0.06;

/// n - 1 on a cube of n nodes a side, in units of nodes, with a jump at x = slope z + offset from
/// the middle.
fn sampled(n: usize, slope: f64, offset: f64) -> Dataset {
    let middle = (n - 1) as f64 / 2.0;
    let mut image =
        ImageData::new([n as u32, 6, n as u32], DVec3::new(-middle, 0.0, -middle), DVec3::ONE);
    let value = |i: usize| {
        let (x, z) = ((i % n) as f64 - middle, (i / (6 * n)) as f64 - middle);
        if x < slope * z + offset { 0.0 } else { JUMP }
    };
    let values = (0..6 * n * n).map(value).collect();
    image.attributes.point.push(DataArray::new("n", 1, Values::F64(values)));
    Dataset::ImageData(image)
}

/// The largest relative error of deflections of light along z that crosses the jump well inside.
fn error(data: &Dataset, n: usize, slope: f64, average_jumps: bool) -> f64 {
    let options = Options {
        average_jumps,
        reference: Reference::Given { n_minus_1: 0.0 },
        // A node is 0.1 mm.
        length_unit_m: 1e-4,
        ..Options::new(Medium::NMinus1(Quantity::array("n")))
    };
    let LoadedField { field, report } = from_dataset(data, &options).unwrap();
    assert_eq!(report.jumps.is_some(), average_jumps);
    let plan = Plan::new(&field, Request { tolerance_rad: 1e-9, ..Request::default() });
    let paths = plan.paths(&field, View::along(Axis::Z, field.centre_m()));
    // Rays at every quarter of a node, where the whole staircase around is inside.
    let half = 0.55 * 0.5 * (n - 1) as f64 * slope.min(1.0);
    let count = (8.0 * half) as usize;
    let starts: Vec<Start> = (0..=count)
        .map(|i| {
            let x = -half + 2.0 * half * i as f64 / count as f64;
            Start { position_m: [(x * 1e-4) as f32, 0.0], tilt_rad: [0.0; 2] }
        })
        .collect();
    let mut exits = vec![Exit::UNDISTURBED; starts.len()];
    paths.trace(&starts, &mut exits);
    let expected = JUMP / slope;
    exits
        .iter()
        .map(|e| (f64::from(e.deflection_rad[0]) / expected - 1.0).abs())
        .fold(0.0, f64::max)
}

#[test]
fn point_sampled_shocks_bend_light_as_cell_averages_do() {
    let mut worst_points = 0.0f64;
    for n in [48, 80] {
        for slope in [0.3, 0.55, 0.83, 0.95, 1.1, 1.6, 2.3] {
            for offset in [0.0, 0.37] {
                let data = sampled(n, slope, offset);
                let [points, averaged] = [false, true].map(|a| error(&data, n, slope, a));
                let angle = slope.atan().to_degrees();
                println!("{n} nodes, {angle:.1} degrees: {points:.3} becomes {averaged:.4}");
                assert!(averaged < TOLERANCE, "{n} {slope} {offset}: {averaged}");
                worst_points = worst_points.max(points);
            }
        }
    }
    // Without averages steps of the staircase are seen one by one.
    assert!(worst_points > 0.4, "{worst_points}");
}
