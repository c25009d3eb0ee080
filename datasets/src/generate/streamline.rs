//! Streamlines by the classical fourth-order Runge-Kutta method.
//!
//! Lines are parametrised by arc length, not by time. The direction field `v/|v|` is integrated, so
//! points are evenly spaced even where the speed varies (field lines of a magnet vary over many
//! orders of magnitude).

use glam::DVec3;

/// Parameters of the tracing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StreamlineOptions {
    /// Maximum number of points of a line.
    pub max_points: usize,
    /// Along the field (1) or against it (-1).
    pub sign: f64,
    /// Minimum speed: where the field is weaker, a line ends because its direction would be noise.
    pub min_speed: f64,
}

/// Traces the field from `seed`, which becomes the first point. `step` returns the arc length of
/// the next step at a point. A line ends where `step` returns `None` (outside), where the field is
/// too weak or not finite, or at `max_points`.
pub fn trace(
    field: impl Fn(DVec3) -> DVec3,
    seed: DVec3,
    step: impl Fn(DVec3) -> Option<f64>,
    options: StreamlineOptions,
) -> Vec<DVec3> {
    let direction = |p: DVec3| -> Option<DVec3> {
        let v = field(p) * options.sign;
        let speed = v.length();
        // A NaN speed also fails this comparison.
        (speed > options.min_speed && speed.is_finite()).then(|| v / speed)
    };
    let mut points = Vec::new();
    let mut p = seed;
    while points.len() < options.max_points {
        points.push(p);
        let Some(next) = step(p).and_then(|h| rk4_step(direction, p, h)) else { break };
        p = next;
    }
    points
}

/// One step of length `h`: y + h/6·(k1 + 2k2 + 2k3 + k4). `None` when the field is undefined on the
/// way.
pub fn rk4_step(field: impl Fn(DVec3) -> Option<DVec3>, p: DVec3, h: f64) -> Option<DVec3> {
    let k1 = field(p)?;
    let k2 = field(p + 0.5 * h * k1)?;
    let k3 = field(p + 0.5 * h * k2)?;
    let k4 = field(p + h * k3)?;
    Some(p + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rotation(p: DVec3) -> DVec3 {
        DVec3::new(-p.y, p.x, 0.0) * 17.0
    }

    const FORWARD: StreamlineOptions =
        StreamlineOptions { max_points: usize::MAX, sign: 1.0, min_speed: 1e-9 };

    #[test]
    fn error_on_a_circle_falls_with_the_fourth_power_of_the_step() {
        let error = |n: usize| {
            let h = std::f64::consts::TAU / n as f64;
            let line = trace(
                rotation,
                DVec3::X,
                |_| Some(h),
                StreamlineOptions { max_points: n + 1, ..FORWARD },
            );
            line[n].distance(DVec3::X)
        };
        // With fewer steps, two error terms of opposite sign hide the order.
        let order = (error(320) / error(640)).log2();
        assert!((3.8..4.2).contains(&order), "order {order}");
        assert!(error(80) < 1e-6);
    }

    #[test]
    fn backward_undoes_forward() {
        let there = trace(
            rotation,
            DVec3::X,
            |_| Some(0.01),
            StreamlineOptions { max_points: 101, ..FORWARD },
        );
        let back = StreamlineOptions { max_points: 101, sign: -1.0, ..FORWARD };
        assert!(trace(rotation, there[100], |_| Some(0.01), back)[100].distance(DVec3::X) < 1e-10);
    }

    #[test]
    fn lines_end_at_stagnation_nan_and_border() {
        let sink = |p: DVec3| -p;
        let line =
            trace(sink, DVec3::X, |_| Some(0.09), StreamlineOptions { min_speed: 0.2, ..FORWARD });
        assert!((5..12).contains(&line.len()), "{}", line.len());
        assert_eq!(trace(|_| DVec3::NAN, DVec3::X, |_| Some(0.1), FORWARD), [DVec3::X]);
        let inside = |p: DVec3| (p.x < 2.0).then_some(0.25);
        assert_eq!(trace(|_| DVec3::X, DVec3::ZERO, inside, FORWARD).len(), 9);
    }
}
