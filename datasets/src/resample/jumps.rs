//! Sharpens the place of jumps that were sampled at points, and makes them what averages over cells
//! would be.
//!
//! A jump between two nodes says only that it lies between them. Along an oblique shock the nodes
//! therefore make a staircase, and light that crosses it is deflected by whole steps: by up to half
//! too much or too little. Averages over cells have the part of each cell on either side, and no
//! steps.
//!
//! Smoothing alone must be as wide as the steps are long. Here the place is found instead: the
//! crossings on the lines around lie on the staircase, and a plane through them (least squares)
//! passes between its steps. The nodes beside the jump then get the average of the two sides over
//! their cell, cut by that plane. Nodes farther than a node and a half from a jump keep their bits.
//!
//! What is already averaged over cells is left alone: its jumps take more than one step.

use super::ResampleError;
use rayon::prelude::*;

/// A step is a jump when it is this part of the range of all values, or more...
const LEAST_STEP: f64 = 0.02;
/// ... and the steps before and after it together are at most this part of it.
const NEIGHBOURS: f32 = 0.35;
/// Lines to either side, along both axes, on which crossings are looked for.
const REACH: i64 = 9;
/// Crossings that a plane needs, at least.
const LEAST_CROSSINGS: usize = 7;
/// A plane is used on lines that it crosses at least this steeply: its slope against them.
const MOST_SLOPE: f64 = 1.3;
/// Root mean square distance of crossings from their plane, in nodes, above which the front is
/// bent, or no front. That of a staircase is 0.29 (1/sqrt 12).
const MOST_RMS: f64 = 0.45;

/// What was found.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct JumpReport {
    /// Jumps from one node to the next, along all three axes.
    pub jumps: usize,
    /// Nodes that got another value.
    pub nodes: usize,
    /// Jumps without a plane through their neighbours: at edges and corners of fronts, and noise.
    pub left: usize,
}

/// Replaces the values beside jumps by averages over cells. Values that are not finite are
/// unchanged, and jumps beside them are left.
///
/// ```
/// use datasets::resample::average_jumps;
/// // Values 1 and 2 on either side of a plane with the slope 0.3, sampled at 32 x 32 x 2 nodes.
/// let dims = [32, 32, 2];
/// let front = |y: usize| 10.0 + 0.3 * y as f64;
/// let value = |i: usize| if ((i % 32) as f64) < front(i / 32 % 32) { 1.0 } else { 2.0 };
/// let mut values: Vec<f32> = (0..2048).map(value).collect();
/// let found = average_jumps(&mut values, dims)?;
/// assert!(found.jumps > 64 && found.nodes > 64);
/// // The sum along a row tells the place of the front to a tenth of a node.
/// let row: f32 = values[16 * 32..17 * 32].iter().map(|v| v - 1.0).sum();
/// assert!((f64::from(row) - (31.5 - front(16))).abs() < 0.1, "{row}");
/// # Ok::<(), datasets::resample::ResampleError>(())
/// ```
///
/// # Errors
/// If there is not one value for each node.
pub fn average_jumps(values: &mut [f32], dims: [usize; 3]) -> Result<JumpReport, ResampleError> {
    let nodes: usize = dims.iter().product();
    if nodes != values.len() {
        return Err(ResampleError::Count { found: values.len(), points: nodes, cells: 0 });
    }
    let finite = values.iter().filter(|v| v.is_finite());
    let (low, high) =
        finite.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    let least = (f64::from(high) - f64::from(low)) * LEAST_STEP;
    let mut report = JumpReport::default();
    if least.is_nan() || least <= 0.0 {
        return Ok(report);
    }
    // New values of the three axes, and how often each node got one.
    let before = values.to_vec();
    let mut sum = vec![(0.0f64, 0u8); nodes];
    for axis in 0..3 {
        let lines = Lines::of(&before, dims, axis, least as f32);
        report.jumps += lines.crossings.len();
        let found: Vec<Option<Averaged>> =
            (0..lines.crossings.len()).into_par_iter().map(|c| lines.averaged(c)).collect();
        for averaged in found {
            let Some(a) = averaged else {
                report.left += 1;
                continue;
            };
            for (node, value) in a {
                let s = &mut sum[node];
                *s = (s.0 + value, s.1 + 1);
            }
        }
    }
    for (value, (total, count)) in values.iter_mut().zip(sum) {
        if count > 0 {
            let new = (total / f64::from(count)) as f32;
            report.nodes += usize::from(new != *value);
            *value = new;
        }
    }
    Ok(report)
}

/// New values of the four nodes around a jump.
type Averaged = [(usize, f64); 4];

/// A jump from node `at` to the next along the axis.
#[derive(Debug, Clone, Copy)]
struct Crossing {
    line: u32,
    at: u32,
    step: f32,
}

/// The lines of nodes along one axis, with their jumps.
struct Lines<'a> {
    values: &'a [f32],
    /// Nodes along the axis, and lines along the two others.
    counts: [usize; 3],
    strides: [usize; 3],
    crossings: Vec<Crossing>,
    /// First crossing of each line.
    starts: Vec<u32>,
}

impl<'a> Lines<'a> {
    fn of(values: &'a [f32], dims: [usize; 3], axis: usize, least: f32) -> Lines<'a> {
        let all = [1, dims[0], dims[0] * dims[1]];
        let order = [axis, (axis + 1) % 3, (axis + 2) % 3];
        let (counts, strides) = (order.map(|a| dims[a]), order.map(|a| all[a]));
        let per_line: Vec<Vec<Crossing>> = (0..counts[1] * counts[2])
            .into_par_iter()
            .map(|line| {
                let first = line % counts[1] * strides[1] + line / counts[1] * strides[2];
                let v = |i: usize| values[first + i * strides[0]];
                let mut found = Vec::new();
                // A jump needs a node before it and one behind it.
                for i in 1..counts[0].saturating_sub(2) {
                    let step = v(i + 1) - v(i);
                    let beside = (v(i) - v(i - 1)).abs() + (v(i + 2) - v(i + 1)).abs();
                    if step.abs() >= least && beside <= NEIGHBOURS * step.abs() {
                        found.push(Crossing { line: line as u32, at: i as u32, step });
                    }
                }
                found
            })
            .collect();
        let mut starts = vec![0u32];
        let mut crossings = Vec::new();
        for line in per_line {
            crossings.extend(line);
            starts.push(crossings.len() as u32);
        }
        Lines { values, counts, strides, crossings, starts }
    }

    /// The averages of the nodes around a crossing; `None` without a plane.
    fn averaged(&self, crossing: usize) -> Option<Averaged> {
        let c = self.crossings[crossing];
        let (height, slopes) = self.plane(c)?;
        let [a, b] = slopes;
        if a.abs() > MOST_SLOPE || b.abs() > MOST_SLOPE {
            return None;
        }
        let (j, k) = (c.line as usize % self.counts[1], c.line as usize / self.counts[1]);
        let first = j * self.strides[1] + k * self.strides[2];
        let node = |i: usize| first + i * self.strides[0];
        let i = c.at as usize;
        let old = |i: usize| f64::from(self.values[node(i)]);
        // The values of the sides, continued to the front along the line.
        let (low, high) = (old(i - 1), old(i + 2));
        let mean = |at: usize| {
            let behind = part_behind(at as f64 - (i as f64 + height), [a, b]);
            // Beside the jump, the two sides are those that the nodes have.
            let (l, h) = match at {
                n if n <= i => (old(n), if n < i { old(i + 1) } else { high }),
                n => (if n > i + 1 { old(i) } else { low }, old(n)),
            };
            l + (h - l) * behind
        };
        Some([i - 1, i, i + 1, i + 2].map(|n| (node(n), mean(n))))
    }

    /// Height of the plane through the crossings around, from the node before the jump, and its
    /// slopes along the two other axes.
    fn plane(&self, c: Crossing) -> Option<(f64, [f64; 2])> {
        let [_, across, up] = self.counts;
        let (j, k) = ((c.line as usize % across) as i64, (c.line as usize / across) as i64);
        let sides =
            [(j, across), (k, up)].map(|(x, n)| (-x.min(REACH), (n as i64 - 1 - x).min(REACH)));
        // The nearest crossing of the same kind on a line, within the steepest slope.
        let on = |dj: i64, dk: i64| -> Option<f64> {
            let line = (j + dj + across as i64 * (k + dk)) as usize;
            let found = &self.crossings[self.starts[line] as usize..self.starts[line + 1] as usize];
            let most = MOST_SLOPE * (dj.abs() + dk.abs()) as f64 + 0.5;
            let distance = |o: &Crossing| f64::from(o.at) - f64::from(c.at);
            let like = found
                .iter()
                .filter(|o| o.step * c.step > 0.0 && (o.step - c.step).abs() <= 0.5 * c.step.abs());
            let nearest = like.map(distance).min_by(|a, b| a.abs().total_cmp(&b.abs()))?;
            (nearest.abs() <= most).then_some(nearest + 0.5)
        };
        let mut sums = Moments::default();
        for dk in sides[1].0..=sides[1].1 {
            for dj in sides[0].0..=sides[0].1 {
                // Weights that fall to zero: a line more or less must not move the plane.
                let far2 = (dj * dj + dk * dk) as f64 / ((REACH + 1) * (REACH + 1)) as f64;
                if let Some(h) = on(dj, dk).filter(|_| far2 < 1.0) {
                    sums.add(dj as f64, dk as f64, h, (1.0 - far2).powi(2));
                }
            }
        }
        sums.plane()
    }
}

/// Weighted sums for a plane h = h0 + a x + b y by least squares; `n` is that of the weights.
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    count: usize,
    n: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
    h: f64,
    hx: f64,
    hy: f64,
    hh: f64,
}

impl Moments {
    fn add(&mut self, x: f64, y: f64, h: f64, weight: f64) {
        self.count += 1;
        for (sum, value) in [
            (&mut self.n, 1.0),
            (&mut self.x, x),
            (&mut self.y, y),
            (&mut self.xx, x * x),
            (&mut self.xy, x * y),
            (&mut self.yy, y * y),
            (&mut self.h, h),
            (&mut self.hx, h * x),
            (&mut self.hy, h * y),
            (&mut self.hh, h * h),
        ] {
            *sum += weight * value;
        }
    }

    /// Height at the origin and slopes; `None` if points are too few or not near a plane. An axis
    /// along which there are no points has the slope 0.
    fn plane(&self) -> Option<(f64, [f64; 2])> {
        let n = self.n;
        if self.count < LEAST_CROSSINGS {
            return None;
        }
        let (mx, my, mh) = (self.x / n, self.y / n, self.h / n);
        let (xx, xy, yy) = (self.xx / n - mx * mx, self.xy / n - mx * my, self.yy / n - my * my);
        let (hx, hy) = (self.hx / n - mh * mx, self.hy / n - mh * my);
        let determinant = xx * yy - xy * xy;
        let (a, b) = if determinant > 1e-9 * (xx + yy).powi(2) {
            ((hx * yy - hy * xy) / determinant, (hy * xx - hx * xy) / determinant)
        } else if xx >= yy && xx > 0.0 {
            (hx / xx, 0.0)
        } else if yy > 0.0 {
            (0.0, hy / yy)
        } else {
            return None;
        };
        let variance = self.hh / n - mh * mh - a * hx - b * hy;
        let near = variance <= MOST_RMS * MOST_RMS;
        near.then_some((mh - a * mx - b * my, [a, b]))
    }
}

/// Part of the unit cell, `x` along the axis from a plane of these slopes, that lies behind it: the
/// mean of a ramp over the plane's rise within the cell, by two-point Gauss quadrature along each
/// slope in two halves.
fn part_behind(x: f64, [a, b]: [f64; 2]) -> f64 {
    const PLACES: [f64; 4] = [
        -0.394_337_567_297_406_4,
        -0.105_662_432_702_593_55,
        0.105_662_432_702_593_55,
        0.394_337_567_297_406_4,
    ];
    let mut sum = 0.0;
    for u in PLACES {
        for v in PLACES {
            sum += (x - a * u - b * v + 0.5).clamp(0.0, 1.0);
        }
    }
    sum / 16.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The largest error of the slope of the sums along z, which is what light along z is bent by,
    /// relative to that of the plane, with and without averaging.
    fn errors(slope: f64, n: usize, offset: f64) -> [f64; 2] {
        // The plane x = slope (z - middle) + offset; light goes along z.
        let dims = [n, 3, n];
        let middle = (n - 1) as f64 / 2.0;
        let front = |z: f64| middle + offset + slope * (z - middle);
        let value = |i: usize| {
            let (x, z) = (i % n, i / (3 * n));
            if (x as f64) < front(z as f64) { 0.0 } else { 1.0 }
        };
        let points: Vec<f32> = (0..3 * n * n).map(value).collect();
        let mut averaged = points.clone();
        let found = average_jumps(&mut averaged, dims).unwrap();
        assert!(found.nodes > 0 && 2 * found.left < found.jumps, "{slope}: {found:?}");
        // Columns that cross the front well inside.
        let reach = (middle * slope.min(1.0 / slope.max(1e-9)).min(1.0) * 0.6) as usize;
        let columns = (middle as usize - reach)..(middle as usize + reach);
        [&points, &averaged].map(|v| {
            let sum = |x: usize| (0..n).map(|z| f64::from(v[x + n * (1 + 3 * z)])).sum::<f64>();
            let error = |x: usize| ((sum(x + 1) - sum(x - 1)) / 2.0 * slope - 1.0).abs();
            columns.clone().map(error).fold(0.0, f64::max)
        })
    }

    #[test]
    fn an_oblique_front_bends_light_as_its_slope_says_at_all_angles() {
        let mut worst_points = 0.0f64;
        for n in [48, 96] {
            for slope in [0.21, 0.37, 0.5, 0.73, 0.95, 1.05, 1.41, 2.0, 2.7] {
                for offset in [0.0, 0.31] {
                    let [points, averaged] = errors(slope, n, offset);
                    assert!(averaged < 0.06, "{n} {slope}: {averaged}");
                    worst_points = worst_points.max(points);
                }
            }
        }
        assert!(worst_points > 0.4, "{worst_points}");
    }

    #[test]
    fn smooth_fields_keep_their_bits_and_averages_nearly() {
        let n = 40;
        let dims = [n, n, 4];
        let smooth = |i: usize| {
            let x = (i % n) as f64 - 20.0 + 0.3 * (i / n % n) as f64;
            (x / 2.5).tanh() as f32
        };
        let averaged = |i: usize| {
            let x = (i % n) as f64 - 14.2 - 0.4 * (i / n % n) as f64;
            part_behind(x, [0.4, 0.0]) as f32
        };
        for (field, most) in [(&smooth as &dyn Fn(usize) -> f32, 0.0), (&averaged, 0.12)] {
            let mut values: Vec<f32> = (0..n * n * 4).map(field).collect();
            let before = values.clone();
            average_jumps(&mut values, dims).unwrap();
            let worst = values.iter().zip(&before).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst <= most, "{worst}");
        }
        let mut hole = vec![1.0f32; n * n * 4];
        hole[5 * n + 5] = f32::NAN;
        let report = average_jumps(&mut hole, dims).unwrap();
        assert_eq!((report.jumps, report.nodes), (0, 0));
        assert!(average_jumps(&mut hole, [n, n, 5]).is_err());
    }
}
