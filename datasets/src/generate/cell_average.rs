//! Cell averages of discontinuous fields, over the boxes around lattice points.
//!
//! The flows with shocks are plane (the same at all z) or axisymmetric about the x axis, and the
//! positions of their jumps along a line parallel to x are known. Along x, the mean is therefore
//! exact up to Gauss quadrature between the jumps. In y and z, boxes that contain a jump are
//! subdivided. Volume fractions are accurate to 2e-3 of a box (measured in the tests).

use glam::DVec3;

/// Sub-rows per axis (y and z) in boxes with a jump.
const SUBDIVISIONS: usize = 8;
/// Nodes of two-point Gauss quadrature on -1..1 (the weights are 1).
const GAUSS: [f64; 2] = [-0.577_350_269_189_625_8, 0.577_350_269_189_625_8];

/// A flow around a body that is either plane (`r` = y) or axisymmetric about x (`r` = distance from
/// the x axis).
pub(crate) trait LayeredFlow: Sync {
    /// Number of quantities per point.
    const QUANTITIES: usize;
    /// The distance on which the flow depends.
    fn r_m(&self, y_m: f64, z_m: f64) -> f64;
    /// Positions along x where the flow at `r_m` jumps or the body begins and ends, ascending;
    /// infinities are ignored.
    fn jumps_m(&self, r_m: f64) -> [f64; 4];
    /// Writes the quantities at a point between jumps to `out`; returns false inside the body.
    fn at(&self, x_m: f64, r_m: f64, out: &mut [f64]) -> bool;
}

/// Computes the means over the boxes of a row, and the gas fraction of each box. `sums` has
/// `QUANTITIES + 1` rows; the last is the gas fraction. Means of boxes without gas are NaN.
pub(crate) fn average_row<F: LayeredFlow>(
    flow: &F,
    first_m: DVec3,
    spacing_m: DVec3,
    n: usize,
    scratch: &mut Scratch,
    rows: &mut [&mut [f32]],
) {
    let q = F::QUANTITIES;
    scratch.sums.clear();
    scratch.sums.resize((q + 1) * n, 0.0);
    scratch.out.resize(q, 0.0);

    // How far the jumps move within the row's boxes determines, box by box, whether (y, z) need
    // subdivision.
    let half = 0.5 * spacing_m;
    let corners = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (0.0, 0.0)];
    let at_corners = corners
        .map(|(a, b)| flow.jumps_m(flow.r_m(first_m.y + a * half.y, first_m.z + b * half.z)));
    let index_of = |x: f64| (x - first_m.x) / spacing_m.x + 0.5;
    scratch.fine.clear();
    scratch.fine.resize(n, false);
    for jump in 0..4 {
        let xs = at_corners.map(|c| c[jump]);
        let finite = || xs.iter().copied().filter(|x| x.is_finite());
        // A jump that exists at some corners but not at others ends within the box's (y, z). The
        // position of that end is unknown, so all boxes from its finite positions on are
        // subdivided.
        let partly = finite().count() != corners.len();
        let low = finite().fold(f64::INFINITY, f64::min);
        let high = if partly { f64::INFINITY } else { finite().fold(f64::NEG_INFINITY, f64::max) };
        if low.is_finite() {
            // Add one box on each side: curved jumps can reach further between the corners than at
            // them.
            let from = (index_of(low).floor() - 1.0).clamp(0.0, n as f64) as usize;
            let to = (index_of(high).floor() + 2.0).clamp(0.0, n as f64) as usize;
            scratch.fine[from..to.max(from)].fill(true);
        }
    }

    // Smooth boxes: Gauss points in y and z. Boxes with jumps: midpoints of sub-rows.
    for (fine, offsets) in [(false, &GAUSS[..]), (true, &midpoints()[..])] {
        if !scratch.fine.contains(&fine) {
            continue;
        }
        for oz in offsets {
            for oy in offsets {
                let r = flow.r_m(first_m.y + oy * half.y, first_m.z + oz * half.z);
                add_line(flow, r, first_m.x, spacing_m.x, n, fine, scratch);
            }
        }
        let lines = (offsets.len() * offsets.len()) as f64;
        for i in (0..n).filter(|&i| scratch.fine[i] == fine) {
            let gas = scratch.sums[q * n + i] / (lines * spacing_m.x);
            for c in 0..q {
                // 0/0 in solids: NaN
                rows[c][i] = (scratch.sums[c * n + i] / scratch.sums[q * n + i]) as f32;
            }
            // Rounding in sums of lengths must not make a full box partly full.
            rows[q][i] = if gas > 1.0 - 1e-9 { 1.0 } else { gas as f32 };
        }
    }
}

/// Scratch storage of [`average_row`].
#[derive(Default)]
pub(crate) struct Scratch {
    sums: Vec<f64>,
    out: Vec<f64>,
    fine: Vec<bool>,
}

fn midpoints() -> [f64; SUBDIVISIONS] {
    std::array::from_fn(|i| (2 * i + 1) as f64 / SUBDIVISIONS as f64 - 1.0)
}

/// Adds the integrals along x, box by box, of the line at `r`.
fn add_line<F: LayeredFlow>(
    flow: &F,
    r: f64,
    first: f64,
    spacing: f64,
    n: usize,
    fine: bool,
    s: &mut Scratch,
) {
    let q = F::QUANTITIES;
    let jumps = flow.jumps_m(r);
    for i in (0..n).filter(|&i| s.fine[i] == fine) {
        let (low, high) = (first + (i as f64 - 0.5) * spacing, first + (i as f64 + 0.5) * spacing);
        let mut from = low;
        for to in jumps.into_iter().chain([high]) {
            // NaN and jumps before the box are skipped; jumps after it are clipped at its border.
            let to = if to > from { to.min(high) } else { continue };
            let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
            for g in GAUSS {
                if flow.at(middle + g * half, r, &mut s.out) {
                    for c in 0..q {
                        s.sums[c * n + i] += s.out[c] * half;
                    }
                    s.sums[q * n + i] += half;
                }
            }
            from = to;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Density 2 within a ball, 1 outside; solid within half its radius.
    struct Ball;
    impl LayeredFlow for Ball {
        const QUANTITIES: usize = 1;
        fn r_m(&self, y: f64, z: f64) -> f64 {
            y.hypot(z)
        }
        fn jumps_m(&self, r: f64) -> [f64; 4] {
            let [outer, inner] = [1.0, 0.5].map(|radius: f64| {
                if r < radius { (radius * radius - r * r).sqrt() } else { f64::NAN }
            });
            [-outer, -inner, inner, outer]
        }
        fn at(&self, x: f64, r: f64, out: &mut [f64]) -> bool {
            out[0] = if x.hypot(r) < 1.0 { 2.0 } else { 1.0 };
            x.hypot(r) > 0.5
        }
    }

    #[test]
    fn volumes_of_ball_and_hole_come_out_whatever_the_alignment() {
        let n = 16;
        for shift in [DVec3::ZERO, DVec3::new(0.03, 0.05, 0.081)] {
            let (mut excess, mut gas) = (0.0, 0.0);
            let h = DVec3::splat(2.6 / n as f64);
            let mut scratch = Scratch::default();
            for jk in 0..n * n {
                let first =
                    shift + h * (DVec3::new(0.0, (jk % n) as f64, (jk / n) as f64) + 0.5) - 1.3;
                let (mut mean, mut fraction) = ([0f32; 16], [0f32; 16]);
                average_row(&Ball, first, h, n, &mut scratch, &mut [&mut mean, &mut fraction]);
                for (m, f) in mean.iter().zip(fraction) {
                    assert!((*m >= 1.0 && *m <= 2.0) || (m.is_nan() && f == 0.0), "{m} {f}");
                    gas += f as f64;
                    excess += if f > 0.0 { ((m - 1.0) * f) as f64 } else { 0.0 };
                }
            }
            let volume = h.x * h.y * h.z;
            let ball = 4.0 / 3.0 * std::f64::consts::PI;
            let (solid, shell) = (2.6f64.powi(3) - gas * volume, excess * volume);
            assert!((solid / (ball / 8.0) - 1.0).abs() < 2e-3, "{solid}");
            assert!((shell / (ball * 7.0 / 8.0) - 1.0).abs() < 5e-4, "{shell}");
        }
    }
}
