//! Warns about sizes that no test section has.

use super::Report;
use glam::DVec3;

/// Longest sides of test sections, m. Longer ones are rather in millimetres, and shorter ones in
/// metres, taken as something else.
pub(super) const SIDES_M: [f64; 2] = [5e-5, 20.0];

/// Warns about a flow whose longest side is not one of a test section.
pub(super) fn warn_size(size_m: DVec3, report: &mut Report) {
    let longest = size_m.max_element();
    let [least, most] = SIDES_M;
    if longest > most {
        report.warnings.push(format!(
            "the flow is {longest:.3} m long, and test sections are shorter than {most} m: if its \
             coordinates are in millimetres, set flow.length_unit_m to 0.001, or flow.spacing where \
             the file has none"
        ));
    } else if longest < least {
        report.warnings.push(format!(
            "the flow is {longest:.3e} m long, and test sections are longer than {least} m: check \
             flow.length_unit_m"
        ));
    }
}
