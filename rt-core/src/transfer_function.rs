//! Appearance of a scalar inside a volume: colour and extinction, and their exact integrals over a
//! linear interval of scalars.
//!
//! Extinction σ is piecewise linear in the scalar, and colour follows a [`ColorMap`]. So ∫σ ds and
//! ∫σ·colour ds are piecewise polynomials, which are stored as running sums at the knots. The mean
//! over an interval s₀..s₁ is then a difference of two look-ups (Engel, Kraus and Ertl 2001,
//! "High-quality pre-integrated volume rendering", section 4.2, whose approximation also leaves out
//! attenuation within the interval, but without their table: a peak of any narrowness counts with
//! its full area).

use crate::colormap::ColorMap;

/// Colour and extinction by scalar.
#[derive(Debug, Clone)]
pub struct TransferFunction {
    colors: ColorMap,
    extinction: Vec<[f32; 2]>,
    exact: Pieces,
    /// With fewer knots, to [`SIMPLIFIED_COLOR`] and [`SIMPLIFIED_EXTINCTION`].
    simplified: Pieces,
}

/// Why a transfer function cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TransferFunctionError {
    /// No control point.
    #[error("transfer function has no extinction points; give at least one [scalar, extinction]")]
    Empty,
    /// An invalid control point.
    #[error("transfer function point {index} is {point:?}; {rule}")]
    Point {
        /// Index of the point.
        index: usize,
        /// Scalar and extinction (or opacity) given.
        point: [f32; 2],
        /// What is allowed.
        rule: &'static str,
    },
    /// An invalid unit distance.
    #[error("opacity unit distance is {0}; it must be finite and positive, in world units")]
    UnitDistance(f32),
    /// An invalid colour.
    #[error("transfer function: {field} is {value}; it must be {rule}")]
    Colors {
        /// The parameter.
        field: &'static str,
        /// Its value.
        value: String,
        /// What is allowed.
        rule: &'static str,
    },
    /// An invalid colour range.
    #[error("colour map range is {0:?}; it must be finite and, for a logarithmic map, positive")]
    ColorRange([f32; 2]),
}

/// Colour and extinction as linear pieces.
#[derive(Debug, Clone)]
pub(crate) struct Pieces {
    intervals: Vec<Interval>,
    /// For evenly spaced scalars from `buckets.lo`: the interval where the search starts, and how
    /// many buckets before this one have any extinction.
    buckets: Buckets,
}

/// An interval of scalars, starting at `s`, in which extinction and colour are linear.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Interval {
    pub(crate) s: f64,
    /// Extinction at `s`, and its slope.
    pub(crate) sigma: [f64; 2],
    /// Colour at `s`, and its slope.
    pub(crate) color: [[f64; 2]; 3],
    /// ∫σ, ∫σr, ∫σg, ∫σb up to `s`.
    sums: [f64; 4],
    /// Sum of the heights of the steps of σ up to and at `s`.
    steps: f64,
}

impl Interval {
    /// A piece without its integrals.
    pub(crate) fn linear(s: f64, sigma: [f64; 2], color: [[f64; 2]; 3]) -> Interval {
        Interval { s, sigma, color, sums: [0.0; 4], steps: 0.0 }
    }
}

#[derive(Debug, Clone)]
struct Buckets {
    lo: f64,
    per_scalar: f64,
    first_piece: Vec<u32>,
    occupied_before: Vec<u32>,
}

const BUCKETS: usize = 1024;
const LAST_BUCKET: f64 = (BUCKETS - 1) as f64;
/// Parts of one interval of a logarithmic colour map or of an opacity ramp, which are not linear in
/// what is stored.
const CURVED_PARTS: usize = 16;
/// Largest error of a colour in the simplified pieces: a twentieth of a level of 1/255.
const SIMPLIFIED_COLOR: f64 = 2e-4;
/// Largest relative error of an extinction in the simplified pieces. An opacity changes by at most
/// 1/e of it, a twentieth of a level.
const SIMPLIFIED_EXTINCTION: f64 = 5e-4;
/// Opacity 1 would be infinite extinction; a millionth of the light passes instead.
const MAX_OPACITY: f32 = 0.999_999;

impl TransferFunction {
    /// `extinction` holds [scalar, extinction per world unit] in order of scalar, linear between
    /// (two points with the same scalar make a step) and constant outside. The alpha of `colors` is
    /// not used.
    pub fn new(colors: ColorMap, extinction: Vec<[f32; 2]>) -> Result<Self, TransferFunctionError> {
        check_points(
            &extinction,
            |e| e >= 0.0 && e.is_finite(),
            "extinction must be finite and not negative",
        )?;
        let sound = ColorMap { range: [1.0; 2], ..colors.clone() }.check();
        sound.map_err(|(field, value, rule)| TransferFunctionError::Colors {
            field,
            value,
            rule,
        })?;
        let range_ok = colors.range.iter().all(|r| r.is_finite() && (!colors.log || *r > 0.0));
        if !range_ok {
            return Err(TransferFunctionError::ColorRange(colors.range));
        }
        let knots = knots(&colors, &extinction);
        let simplified = Pieces::new(&simplify(&knots, &colors, &extinction), &colors, &extinction);
        let exact = Pieces::new(&knots, &colors, &extinction);
        Ok(TransferFunction { colors, extinction, exact, simplified })
    }

    /// `opacity` holds [scalar, opacity of a slab `unit_distance` thick], 0..=1, linear between, as
    /// ParaView's and VTK's opacity functions with their "scalar opacity unit distance". Opacity 1
    /// lets a millionth pass.
    pub fn from_opacity(
        colors: ColorMap,
        opacity: &[[f32; 2]],
        unit_distance: f32,
    ) -> Result<Self, TransferFunctionError> {
        check_points(opacity, |a| (0.0..=1.0).contains(&a), "opacity must be 0 to 1")?;
        if !(unit_distance.is_finite() && unit_distance > 0.0) {
            return Err(TransferFunctionError::UnitDistance(unit_distance));
        }
        let sigma = |a: f32| -(-a.min(MAX_OPACITY)).ln_1p() / unit_distance;
        let mut extinction = vec![[opacity[0][0], sigma(opacity[0][1])]];
        for w in opacity.windows(2) {
            let flat = w[0][1] == w[1][1] || w[0][0] == w[1][0];
            let parts = if flat { 1 } else { CURVED_PARTS };
            for i in 1..parts {
                let f = i as f32 / parts as f32;
                let mix = |k: usize| w[0][k] + (w[1][k] - w[0][k]) * f;
                extinction.push([mix(0), sigma(mix(1))]);
            }
            extinction.push([w[1][0], sigma(w[1][1])]);
        }
        TransferFunction::new(colors, extinction)
    }

    /// The colour map.
    pub fn colors(&self) -> &ColorMap {
        &self.colors
    }

    /// Extinction per world unit at `scalar`, computed from the control points. At a step, the
    /// value after it.
    pub fn extinction(&self, scalar: f64) -> f64 {
        extinction_at(&self.extinction, scalar)
    }

    /// The scalars between which colour or extinction change; never empty.
    pub(crate) fn range(&self) -> [f64; 2] {
        let [mut low, mut high] = self.colors.range.map(f64::from);
        if low > high {
            (low, high) = (high, low);
        }
        for point in [self.extinction.first(), self.extinction.last()].into_iter().flatten() {
            (low, high) = (low.min(point[0].into()), high.max(point[0].into()));
        }
        if high > low { [low, high] } else { [low, (low as f32).next_up().into()] }
    }

    /// Colour and extinction as linear pieces: exact, or with fewer knots and an error of at most a
    /// tenth of a level.
    pub(crate) fn pieces(&self, simplified: bool) -> &Pieces {
        if simplified { &self.simplified } else { &self.exact }
    }

    /// See [`Pieces::is_clear`].
    #[inline]
    pub(crate) fn is_clear(&self, lo: f64, hi: f64) -> bool {
        self.exact.is_clear(lo, hi)
    }

    /// Whether there is extinction at all scalars in `lo..=hi`, as far as the buckets tell.
    pub(crate) fn is_nowhere_clear(&self, lo: f64, hi: f64) -> bool {
        let b = &self.exact.buckets;
        let (a, z) = (b.index(lo), b.index(hi));
        lo <= hi && (b.occupied_before[z + 1] - b.occupied_before[a]) as usize == z + 1 - a
    }

    /// ∫σ, ∫σr, ∫σg, ∫σb over the scalars up to `s`, from some fixed scalar on.
    #[inline]
    pub(crate) fn integral(&self, s: f64) -> [f64; 4] {
        let p = self.exact.interval(s);
        let x = s - p.s;
        let [e0, e1] = p.sigma;
        let mut r = p.sums;
        r[0] += x * (e0 + 0.5 * e1 * x);
        for c in 0..3 {
            let [c0, c1] = p.color[c];
            // (e₀ + e₁x)(c₀ + c₁x) integrated.
            r[c + 1] +=
                x * (e0 * c0 + x * (0.5 * (e0 * c1 + e1 * c0) + x * (e1 * c1) * (1.0 / 3.0)));
        }
        r
    }

    /// Extinction and colour at `s`.
    #[inline]
    pub(crate) fn sample(&self, s: f64) -> (f64, [f64; 3]) {
        let p = self.exact.interval(s);
        let x = s - p.s;
        (p.sigma[0] + p.sigma[1] * x, p.color.map(|c| c[0] + c[1] * x))
    }

    /// Scalars closer than this have no measurable difference of integrals.
    #[inline]
    pub(crate) fn resolution(&self) -> f64 {
        1e-4 / self.exact.buckets.per_scalar
    }

    /// Whether colour or extinction bend or jump between two scalars.
    #[inline]
    pub(crate) fn has_knot_between(&self, lo: f64, hi: f64) -> bool {
        self.exact.interval(lo).s != self.exact.interval(hi).s
    }

    /// Sum of the heights of the steps of extinction between two scalars.
    #[inline]
    pub(crate) fn steps_between(&self, lo: f64, hi: f64) -> f64 {
        self.exact.interval(hi).steps - self.exact.interval(lo).steps
    }
}

impl Pieces {
    fn new(knots: &[f64], colors: &ColorMap, extinction: &[[f32; 2]]) -> Pieces {
        let intervals = intervals(knots, colors, extinction);
        let buckets = buckets(&intervals);
        Pieces { intervals, buckets }
    }

    /// Whether there is any extinction for scalars in `lo..=hi`. May return true when extinction
    /// lies only within a thousandth of the range.
    #[inline]
    pub(crate) fn is_clear(&self, lo: f64, hi: f64) -> bool {
        let b = &self.buckets;
        let (a, z) = (b.index(lo), b.index(hi));
        b.occupied_before[z + 1] == b.occupied_before[a]
    }

    /// Number of the piece at `s`.
    #[inline]
    pub(crate) fn number_at(&self, s: f64) -> usize {
        let mut i = self.buckets.first_piece[self.buckets.index(s)] as usize;
        while i + 1 < self.intervals.len() && self.intervals[i + 1].s <= s {
            i += 1;
        }
        i
    }

    #[inline]
    fn interval(&self, s: f64) -> &Interval {
        &self.intervals[self.number_at(s)]
    }

    /// The pieces, by scalar.
    #[inline]
    pub(crate) fn all(&self) -> &[Interval] {
        &self.intervals
    }
}

impl Buckets {
    #[inline]
    fn index(&self, s: f64) -> usize {
        // Bucket 0 and the last one represent everything outside; NaN is in the first. Between
        // these limits the conversion to i32 is one instruction, to usize it is not.
        let place = (s - self.lo) * self.per_scalar;
        let place = if place > 0.0 { place } else { 0.0 };
        let place = if place < LAST_BUCKET { place } else { LAST_BUCKET };
        place as i32 as usize & (BUCKETS - 1)
    }
}

fn check_points(
    points: &[[f32; 2]],
    ok: impl Fn(f32) -> bool,
    rule: &'static str,
) -> Result<(), TransferFunctionError> {
    if points.is_empty() {
        return Err(TransferFunctionError::Empty);
    }
    for (index, &point) in points.iter().enumerate() {
        if !point[0].is_finite() {
            return Err(TransferFunctionError::Point {
                index,
                point,
                rule: "its scalar must be finite",
            });
        }
        if index > 0 && point[0] < points[index - 1][0] {
            return Err(TransferFunctionError::Point {
                index,
                point,
                rule: "scalars must not decrease",
            });
        }
        if !ok(point[1]) {
            return Err(TransferFunctionError::Point { index, point, rule });
        }
    }
    Ok(())
}

fn extinction_at(points: &[[f32; 2]], s: f64) -> f64 {
    let after = points.partition_point(|p| f64::from(p[0]) <= s);
    if after == 0 {
        return f64::from(points[0][1]);
    }
    let a = points[after - 1].map(f64::from);
    match points.get(after) {
        None => a[1],
        Some(b) => a[1] + (f64::from(b[1]) - a[1]) * (s - a[0]) / (f64::from(b[0]) - a[0]),
    }
}

/// Where extinction or colour bend, in order.
fn knots(colors: &ColorMap, extinction: &[[f32; 2]]) -> Vec<f64> {
    let [lo, hi] = colors.range.map(f64::from);
    let intervals = (colors.colors.len() - 1) * if colors.log { CURVED_PARTS } else { 1 };
    let mut knots: Vec<f64> = extinction.iter().map(|p| f64::from(p[0])).collect();
    for i in 0..=intervals {
        let f = i as f64 / intervals.max(1) as f64;
        knots.push(if colors.log { lo * (hi / lo).powf(f) } else { lo + (hi - lo) * f });
    }
    knots.sort_by(f64::total_cmp);
    knots.dedup();
    knots
}

/// Extinction and colour just before and just after a scalar.
struct Limits<'a> {
    colors: &'a ColorMap,
    extinction: &'a [[f32; 2]],
}

impl Limits<'_> {
    fn color_before(&self, s: f64) -> [f64; 3] {
        self.color_at((s as f32).next_down())
    }

    fn color_after(&self, s: f64) -> [f64; 3] {
        self.color_at((s as f32).next_up())
    }

    fn color_at(&self, s: f32) -> [f64; 3] {
        let c = self.colors.lookup(s);
        [c[0], c[1], c[2]].map(f64::from)
    }

    fn extinction_before(&self, s: f64) -> f64 {
        let extinction = self.extinction;
        let before = extinction.partition_point(|p| f64::from(p[0]) < s);
        match (before.checked_sub(1).map(|i| extinction[i].map(f64::from)), extinction.get(before))
        {
            (None, Some(b)) => f64::from(b[1]),
            (Some(a), None) => a[1],
            (Some(a), Some(b)) => {
                a[1] + (f64::from(b[1]) - a[1]) * (s - a[0]) / (f64::from(b[0]) - a[0])
            }
            (None, None) => 0.0,
        }
    }

    fn extinction_after(&self, s: f64) -> f64 {
        extinction_at(self.extinction, s)
    }
}

/// Leaves out knots that lie nearly on the line between their neighbours: tables of 1,024 entries,
/// as VTK makes them, mostly have few real bends. A knot is kept when the next one lies outside the
/// directions in which all knots since the last kept one are met within their tolerances, so the
/// cost is linear in the number of knots.
fn simplify(knots: &[f64], colors: &ColorMap, extinction: &[[f32; 2]]) -> Vec<f64> {
    let limits = Limits { colors, extinction };
    // Extinction and colour on both sides of a knot.
    let values = |s: f64| {
        let four = |sigma: f64, [r, g, b]: [f64; 3]| [sigma, r, g, b];
        let before = four(limits.extinction_before(s), limits.color_before(s));
        (before, four(limits.extinction_after(s), limits.color_after(s)))
    };
    let tolerance = |v: &[f64; 4]| -> [f64; 4] {
        std::array::from_fn(|c| match c {
            0 => SIMPLIFIED_EXTINCTION * v[0],
            _ => SIMPLIFIED_COLOR * v[c].abs().max(1.0),
        })
    };
    let Some(&first) = knots.first() else { return Vec::new() };
    let mut kept = vec![first];
    let (mut start, mut from) = (first, values(first).1);
    let mut directions = [[f64::NEG_INFINITY, f64::INFINITY]; 4];
    for pair in knots[1..].windows(2) {
        let [s, next] = [pair[0], pair[1]];
        let (before, after) = values(s);
        let near = tolerance(&before);
        let width = s - start;
        for (c, d) in directions.iter_mut().enumerate() {
            let rise = before[c] - from[c];
            *d = [d[0].max((rise - near[c]) / width), d[1].min((rise + near[c]) / width)];
        }
        // The colours were looked up at the neighbouring f32.
        let steps = (0..4).any(|c| (after[c] - before[c]).abs() > near[c]);
        let to = values(next).0;
        let straight = (0..4).all(|c| {
            let slope = (to[c] - from[c]) / (next - start);
            directions[c][0] <= slope && slope <= directions[c][1]
        });
        if steps || !straight {
            kept.push(s);
            (start, from) = (s, after);
            directions = [[f64::NEG_INFINITY, f64::INFINITY]; 4];
        }
    }
    if knots.len() > 1 {
        kept.push(knots[knots.len() - 1]);
    }
    kept
}

/// Splits the scalars at `knots`.
fn intervals(knots: &[f64], colors: &ColorMap, extinction: &[[f32; 2]]) -> Vec<Interval> {
    let largest = knots[0].abs().max(knots[knots.len() - 1].abs());
    let span =
        (knots[knots.len() - 1] - knots[0]).max(1e-5 * largest).max(f64::from(f32::MIN_POSITIVE));
    // Constant intervals on either side, wide enough for f32 scalars to be far inside.
    let mut all = vec![knots[0] - span];
    all.extend(knots);

    // Limits from inside each interval, so that steps stay steps; a colour map of zero width is
    // also a step.
    let limits = Limits { colors, extinction };
    let mut intervals: Vec<Interval> = Vec::with_capacity(all.len());
    let (mut sums, mut steps, mut sigma_before) = ([0.0; 4], 0.0, None);
    for (i, &s) in all.iter().enumerate() {
        let end = all.get(i + 1).copied();
        let sigma0 = limits.extinction_after(s);
        let (sigma0, sigma1) = match end {
            Some(e) if i == 0 => (limits.extinction_before(e), limits.extinction_before(e)),
            Some(e) => (sigma0, limits.extinction_before(e)),
            None => (sigma0, sigma0),
        };
        let color1 = end.map(|e| limits.color_before(e));
        let color0 = if i == 0 { color1 } else { None }.unwrap_or_else(|| limits.color_after(s));
        let color1 = color1.unwrap_or(color0);
        let width = end.map_or(1.0, |e| e - s);
        let interval = Interval {
            s,
            sigma: [sigma0, (sigma1 - sigma0) / width],
            color: std::array::from_fn(|c| [color0[c], (color1[c] - color0[c]) / width]),
            sums,
            steps: {
                steps += sigma_before.map_or(0.0, |b: f64| (sigma0 - b).abs());
                steps
            },
        };
        sigma_before = Some(sigma1);
        if end.is_some() {
            sums[0] += 0.5 * width * (sigma0 + sigma1);
            for c in 0..3 {
                // Simpson's rule is exact for the product of two linear functions.
                let mid = 0.25 * (sigma0 + sigma1) * (color0[c] + color1[c]);
                sums[c + 1] += width / 6.0 * (sigma0 * color0[c] + 4.0 * mid + sigma1 * color1[c]);
            }
        }
        intervals.push(interval);
    }
    intervals
}

fn buckets(intervals: &[Interval]) -> Buckets {
    let (first, last) = (intervals[0].s, intervals[intervals.len() - 1].s);
    let lo = first;
    let per_scalar = BUCKETS as f64 / (1.25 * (last - first));
    let mut b = Buckets { lo, per_scalar, first_piece: Vec::new(), occupied_before: vec![0] };
    let mut interval = 0;
    for i in 0..BUCKETS {
        let (from, to) = (lo + i as f64 / per_scalar, lo + (i + 1) as f64 / per_scalar);
        // Start one interval early: rounding in `index` may put a scalar of the previous bucket
        // into this one.
        while interval + 1 < intervals.len() && intervals[interval + 1].s < from - 0.5 / per_scalar
        {
            interval += 1;
        }
        b.first_piece.push(interval as u32);
        let occupied = (interval..intervals.len())
            .take_while(|&k| intervals[k].s <= to + 0.5 / per_scalar)
            .any(|k| {
                let p = &intervals[k];
                let end = intervals.get(k + 1).map_or(p.s, |n| n.s);
                p.sigma[0] > 0.0 || p.sigma[0] + p.sigma[1] * (end - p.s) > 0.0
            });
        b.occupied_before.push(b.occupied_before[i] + u32::from(occupied));
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map() -> ColorMap {
        ColorMap::new(
            vec![[0.0, 0.0, 1.0, 1.0], [1.0, 0.5, 0.0, 1.0], [1.0, 1.0, 1.0, 1.0]],
            [-1.0, 3.0],
        )
    }

    #[test]
    fn integrals_agree_with_fine_sums_for_ramps_steps_and_peaks() {
        let step = vec![[-2.0, 0.0], [0.5, 0.0], [0.5, 2.0], [1.0, 2.0], [1.0, 0.3]];
        let peak = vec![[0.0, 0.0], [1.999, 0.0], [2.0, 100.0], [2.001, 0.0]];
        for points in [step, peak, vec![[0.0, 1.5]], vec![[-1.0, 0.0], [3.0, 4.0]]] {
            let tf = TransferFunction::new(map(), points).unwrap();
            for (a, b) in
                [(-5.0, 5.0), (0.4, 0.6), (1.99, 2.5), (-9.0, -8.0), (6.0, 40.0), (0.1, 0.2)]
            {
                let (n, mut sums) = (200_000, [0.0; 4]);
                for i in 0..n {
                    let s = a + (b - a) * (i as f64 + 0.5) / n as f64;
                    let (sigma, c) = (tf.extinction(s), tf.colors.lookup(s as f32));
                    sums[0] += sigma;
                    for k in 0..3 {
                        sums[k + 1] += sigma * f64::from(c[k]);
                    }
                }
                let (ia, ib) = (tf.integral(a), tf.integral(b));
                for k in 0..4 {
                    let (exact, sum) = (ib[k] - ia[k], sums[k] * (b - a) / n as f64);
                    assert!(
                        (exact - sum).abs() < 2e-4 * (b - a).max(1.0),
                        "{a}..{b} [{k}]: {exact} {sum}"
                    );
                }
            }
            for i in 0..4000 {
                let s = -6.0 + i as f64 * 0.003_01;
                let (sigma, c) = tf.sample(s);
                assert!((sigma - tf.extinction(s)).abs() < 1e-9 * sigma.max(1.0), "{s}");
                let exact = tf.colors.lookup(s as f32);
                assert!(
                    (0..3).all(|k| (c[k] - f64::from(exact[k])).abs() < 1e-5),
                    "{s}: {c:?} {exact:?}"
                );
                if tf.is_clear(s, s + 0.01) {
                    assert!(
                        tf.extinction(s) == 0.0
                            && tf.extinction(s + 0.005) == 0.0
                            && tf.extinction(s + 0.01) == 0.0
                    );
                }
            }
        }
    }

    #[test]
    fn simplified_pieces_are_few_and_within_their_tolerance() {
        // As VTK's tables: 1,024 entries of a curved opacity and of curved colours.
        let table = |f: f64| {
            let s = f as f32;
            [s, 0.5 + 0.5 * (3.0 * s).sin(), (1.0 - s).powi(2), 1.0]
        };
        let colors = (0..1024).map(|i| table(f64::from(i) / 1023.0)).collect();
        let sigma = |f: f64| if f < 0.3 { 0.0 } else { -(1.0 - 0.8 * (f - 0.3)).ln() };
        let mut points: Vec<[f32; 2]> =
            (0..1024).map(|i| f64::from(i) / 1023.0).map(|f| [f as f32, sigma(f) as f32]).collect();
        // A step, which must stay one.
        points.insert(800, [points[800][0], 0.1]);
        let tf = TransferFunction::new(ColorMap::new(colors, [0.0, 1.0]), points).unwrap();
        let (exact, simplified) = (tf.pieces(false), tf.pieces(true));
        let (all, few) = (exact.all().len(), simplified.all().len());
        assert!(all > 1000 && few < 80, "{all} {few}");
        for k in 0..30_000 {
            let s = f64::from(k) / 29_000.0 - 0.01;
            let at = |p: &Pieces| {
                let p = *p.interval(s);
                let x = s - p.s;
                (p.sigma[0] + p.sigma[1] * x, p.color.map(|c| c[0] + c[1] * x))
            };
            let ((sigma, color), (sigma2, color2)) = (at(exact), at(simplified));
            assert!((sigma - sigma2).abs() <= 1.001 * SIMPLIFIED_EXTINCTION * sigma + 1e-9, "{s}");
            for c in 0..3 {
                assert!((color[c] - color2[c]).abs() <= 1.001 * SIMPLIFIED_COLOR, "{s}");
            }
            assert_eq!(sigma == 0.0, sigma2 == 0.0, "{s}: what is clear stays clear");
        }
    }

    #[test]
    fn clear_ranges_are_seen_and_narrow_peaks_are_not_clear() {
        let points = vec![[0.0, 0.0], [1.999, 0.0], [2.0, 100.0], [2.001, 0.0], [5.0, 0.0]];
        let tf = TransferFunction::new(map(), points).unwrap();
        assert!(tf.is_clear(-100.0, 1.9) && tf.is_clear(2.1, 1e9));
        assert!(!tf.is_clear(1.0, 3.0) && !tf.is_clear(2.0005, 2.0005));
    }

    #[test]
    fn opacity_per_unit_distance_is_kept() {
        let tf =
            TransferFunction::from_opacity(map(), &[[0.0, 0.0], [1.0, 0.75], [2.0, 1.0]], 10.0)
                .unwrap();
        for (s, a) in [(0.0, 0.0), (0.5, 0.375), (1.0, 0.75), (0.3, 0.225)] {
            let slab = 1.0 - (-10.0 * tf.extinction(s)).exp();
            assert!((slab - a).abs() < 1e-3, "{s}: {slab}");
        }
        assert!(tf.extinction(2.0).is_finite());
    }

    #[test]
    fn bad_points_are_named() {
        let new =
            |p: &[[f32; 2]]| TransferFunction::new(map(), p.to_vec()).unwrap_err().to_string();
        assert!(new(&[]).contains("at least one"));
        assert!(new(&[[0.0, -1.0]]).contains("point 0"));
        assert!(new(&[[1.0, 0.0], [0.0, 0.0]]).contains("decrease"));
        assert!(new(&[[f32::NAN, 0.0]]).contains("finite"));
        assert!(TransferFunction::from_opacity(map(), &[[0.0, 2.0]], 1.0).is_err());
        assert!(TransferFunction::from_opacity(map(), &[[0.0, 0.2]], 0.0).is_err());
    }
}
