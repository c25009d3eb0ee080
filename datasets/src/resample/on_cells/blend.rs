//! The mean of the corners' polynomials, weighted by their shares, and its gradient, for four
//! corners at once: a tetrahedron's, or half of a hexahedron's.
//!
//! Coefficients are f32 in memory already. Values are taken relative to the first corner's, and
//! places to its place, so that f32 keeps the digits of differences.

use crate::resample::reconstruct::{
    CAUTION, Expansion, FACTOR_FALL, Parts, TERMS, UNRESOLVED, factors,
};
use glam::{DMat3, DVec3};

/// Corners that are evaluated at once.
pub(super) const LANES: usize = 4;

type Lane = [f32; LANES];
const ZERO: Lane = [0.0; LANES];

/// Shares of four corners, and their slopes along the parameters of the cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Share {
    n: Lane,
    slope: [Lane; 3],
}

impl Share {
    pub(super) const NONE: Share = Share { n: ZERO, slope: [ZERO; 3] };

    /// Those of a tetrahedron at its parameters.
    pub(super) fn of_tetrahedron(q: DVec3) -> Share {
        let first = 1.0 - q.x - q.y - q.z;
        let slope = [[-1.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 1.0]];
        Share { n: [first, q.x, q.y, q.z].map(|n| n as f32), slope }
    }

    /// Those of the lower and the upper corners of a hexahedron at its parameters.
    pub(super) fn of_hexahedron(q: DVec3) -> [Share; 2] {
        let [r, s, t] = q.to_array().map(|x| x as f32);
        let [r1, s1, t1] = (1.0 - q).to_array().map(|x| x as f32);
        let (along_r, along_s) = ([r1, r, r, r1], [s1, s1, s, s]);
        let (up_r, up_s) = ([-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0]);
        let mut shares = [Share::NONE; 2];
        for (share, (height, up)) in shares.iter_mut().zip([(t1, -1.0), (t, 1.0)]) {
            for l in 0..LANES {
                let across = along_r[l] * along_s[l];
                share.n[l] = across * height;
                share.slope[0][l] = up_r[l] * along_s[l] * height;
                share.slope[1][l] = along_r[l] * up_s[l] * height;
                share.slope[2][l] = up * across;
            }
        }
        shares
    }
}

/// Sets the share of corner `i` and its slopes.
pub(super) fn set(shares: &mut [Share], i: usize, n: f64, slope: DVec3) {
    let (share, lane) = (&mut shares[i / LANES], i % LANES);
    share.n[lane] = n as f32;
    for a in 0..3 {
        share.slope[a][lane] = slope[a] as f32;
    }
}

/// How the polynomials of a cell's corners are joined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mean {
    /// With [`factors`] for their terms, if the shares of the corners allow it.
    Exact,
    /// It differs from the exact one by an estimate of the error: what that gains over the mean of
    /// the polynomials themselves ([`CAUTION`]), and a part of those that are not whole
    /// ([`UNRESOLVED`]).
    Doubted,
}

/// What a corner contributes.
pub(super) struct Corner<'a> {
    /// Relative to the cell's origin.
    pub(super) place: DVec3,
    pub(super) value: f64,
    /// None for linear reconstruction.
    pub(super) expansion: Option<&'a Expansion>,
}

/// The polynomials of a cell's corners.
#[derive(Default)]
pub(super) struct Polynomials {
    groups: Vec<Group>,
    /// The first corner's value.
    value: f64,
    linear: bool,
    /// Whether factors change from place to place: some polynomials are whole.
    mixed: bool,
    factors_of_share: f64,
}

/// Those of four corners: a lane for each.
#[derive(Clone)]
struct Group {
    place: [Lane; 3],
    value: Lane,
    /// 1 for whole polynomials.
    whole: Lane,
    frame: [Lane; 6],
    constant: Lane,
    terms: [Lane; TERMS],
    low: Lane,
    high: Lane,
    /// Twice the slack, and a quarter of its inverse.
    reach: Lane,
    fall: Lane,
}

const EMPTY: Group = Group {
    place: [ZERO; 3],
    value: ZERO,
    whole: ZERO,
    frame: [ZERO; 6],
    constant: ZERO,
    terms: [ZERO; TERMS],
    low: ZERO,
    high: ZERO,
    reach: ZERO,
    fall: ZERO,
};

impl Polynomials {
    /// `of_element` tells whether the shares will be those of an element.
    pub(super) fn prepare<'a>(
        &mut self,
        corners: impl ExactSizeIterator<Item = Corner<'a>> + Clone,
        of_element: bool,
        mean: Mean,
    ) {
        self.groups.clear();
        self.groups.resize(corners.len().div_ceil(LANES), EMPTY);
        self.linear = true;
        let is_whole = |c: &Corner<'_>| c.expansion.is_some_and(Expansion::is_whole);
        let whole = if of_element { corners.clone().filter(is_whole).count() } else { 0 };
        // How much of a share's factors is used: 1, or less by what is doubted.
        self.factors_of_share = match mean {
            Mean::Exact => 1.0,
            Mean::Doubted => 1.0 - CAUTION,
        };
        self.mixed = whole > 0 && whole < corners.len();
        let all = if whole == corners.len() { self.factors_of_share } else { 0.0 };
        let factors = factors(all).map(|f| f as f32);
        for (i, corner) in corners.enumerate() {
            if i == 0 {
                self.value = corner.value;
            }
            let (group, l) = (&mut self.groups[i / LANES], i % LANES);
            for a in 0..3 {
                group.place[a][l] = corner.place[a] as f32;
            }
            group.value[l] = (corner.value - self.value) as f32;
            group.whole[l] = f32::from(u8::from(is_whole(&corner)));
            let Some(expansion) = corner.expansion else { continue };
            self.linear = false;
            if mean == Mean::Doubted && !expansion.is_whole() {
                group.set(l, &expansion.parts().times((1.0 - UNRESOLVED) as f32), factors);
            } else {
                group.set(l, expansion.parts(), factors);
            }
        }
    }

    /// The value and its gradient at `at`, relative to the cell's origin. `to_space` has the
    /// gradients of the parameters as its columns.
    pub(super) fn blend(&self, at: DVec3, shares: &[Share], to_space: &DMat3) -> (f64, DVec3) {
        let at = at.to_array().map(|x| x as f32);
        let (mut lanes, mut by_factors) = (Lanes::NONE, DVec3::ZERO);
        if self.mixed {
            // Where factors change, the gradient also has a part along theirs.
            let (mut whole, mut slope) = (0.0f64, DVec3::ZERO);
            for (group, share) in self.groups.iter().zip(shares) {
                let of = |n: &Lane| {
                    let lanes = [0, 1, 2, 3].map(|l| n[l] * group.whole[l]);
                    f64::from(total(lanes))
                };
                whole += of(&share.n);
                slope += DVec3::from([0, 1, 2].map(|a| of(&share.slope[a])));
            }
            let factors = factors(self.factors_of_share * whole).map(|f| f as f32);
            let mut by_whole = 0.0;
            for (group, share) in self.groups.iter().zip(shares) {
                by_whole += f64::from(total(group.cubic(at, share, factors, &mut lanes)));
            }
            by_factors = by_whole * self.factors_of_share * slope;
        } else {
            for (group, share) in self.groups.iter().zip(shares) {
                match self.linear {
                    true => group.linear(share, &mut lanes),
                    false => _ = group.cubic(at, share, [1.0; 3], &mut lanes),
                }
            }
        }
        let sum = |of: [Lane; 3]| DVec3::from(of.map(|lane| f64::from(total(lane))));
        let gradient = sum(lanes.gradient) + *to_space * (sum(lanes.slope) + by_factors);
        (self.value + f64::from(total(lanes.value)), gradient)
    }
}

/// What corners contribute, a lane for each in turn: to the value, to its gradient by those of the
/// polynomials, and to its slopes along parameters by those of the shares.
struct Lanes {
    value: Lane,
    gradient: [Lane; 3],
    slope: [Lane; 3],
}

impl Lanes {
    const NONE: Lanes = Lanes { value: ZERO, gradient: [ZERO; 3], slope: [ZERO; 3] };
}

fn total(l: Lane) -> f32 {
    (l[0] + l[2]) + (l[1] + l[3])
}

impl Group {
    /// Sets the polynomial of a corner, with factors for the terms of each degree. Terms are in the
    /// order of `polynomial::monomials`.
    fn set(&mut self, l: usize, parts: &Parts, factors: [f32; 3]) {
        for (lane, f) in self.frame.iter_mut().zip(parts.frame) {
            lane[l] = f;
        }
        for (degree, factor) in [0..3, 3..9, 9..TERMS].into_iter().zip(factors) {
            for n in degree {
                self.terms[n][l] = factor * parts.terms[n];
            }
        }
        self.constant[l] = parts.constant;
        let bounds = parts.bounds;
        (self.low[l], self.high[l]) = (bounds.low, bounds.high);
        self.reach[l] = 2.0 * bounds.slack;
        self.fall[l] = if bounds.slack > 0.0 { 0.25 / bounds.slack } else { 0.0 };
    }

    fn linear(&self, share: &Share, out: &mut Lanes) {
        for l in 0..LANES {
            out.value[l] += share.n[l] * self.value[l];
            for a in 0..3 {
                out.slope[a][l] += share.slope[a][l] * self.value[l];
            }
        }
    }

    /// Adds value and gradient with factors for the terms of each degree. Returns the derivative of
    /// the value by the share of whole corners, which makes the factors.
    #[inline(always)]
    fn cubic(&self, at: [f32; 3], share: &Share, [f1, f2, f3]: [f32; 3], out: &mut Lanes) -> Lane {
        let (f, c) = (&self.frame, &self.terms);
        let mut by_whole = ZERO;
        for l in 0..LANES {
            let d = [0, 1, 2].map(|a| at[a] - self.place[a][l]);
            let x = f[0][l] * d[0];
            let y = f[1][l] * d[0] + f[2][l] * d[1];
            let z = f[3][l] * d[0] + f[4][l] * d[1] + f[5][l] * d[2];
            let (xx, xy, xz) = (x * x, x * y, x * z);
            let (yy, yz, zz) = (y * y, y * z, z * z);
            // Of each degree, the terms by x, y and z: their sum is the polynomial's part of that
            // degree, and gradients follow from the same numbers.
            let (q0, q1, q2) = (c[3][l], c[4][l], c[5][l]);
            let (q3, q4, q5) = (c[6][l], c[7][l], c[8][l]);
            let hx = 2.0 * q0 * x + q1 * y + q2 * z;
            let hy = q1 * x + 2.0 * q3 * y + q4 * z;
            let hz = q2 * x + q4 * y + 2.0 * q5 * z;
            let (k0, k1, k2) = (c[9][l], c[10][l], c[11][l]);
            let (k3, k4, k5) = (c[12][l], c[13][l], c[14][l]);
            let (k6, k7, k8, k9) = (c[15][l], c[16][l], c[17][l], c[18][l]);
            let kx = 3.0 * k0 * xx + 2.0 * (k1 * xy + k2 * xz) + k3 * yy + k4 * yz + k5 * zz;
            let ky = k1 * xx + 2.0 * (k3 * xy + k7 * yz) + k4 * xz + 3.0 * k6 * yy + k8 * zz;
            let kz = k2 * xx + k4 * xy + 2.0 * (k5 * xz + k8 * yz) + k7 * yy + 3.0 * k9 * zz;
            // Euler: x·∇p = degree · p for each degree.
            let first = c[0][l] * x + c[1][l] * y + c[2][l] * z;
            let second = x * hx + y * hy + z * hz;
            let third = x * kx + y * ky + z * kz;
            let all = (f3 / 3.0) * third + (0.5 * f2) * second + f1 * first;
            let change = self.constant[l] + all;
            let within = change.max(self.low[l]).min(self.high[l]);
            let beyond = (change - within).max(-self.reach[l]).min(self.reach[l]);
            let less = self.fall[l] * beyond.abs();
            let change = within + (beyond - less * beyond);
            let free = share.n[l] * (1.0 - 2.0 * less);
            let gx = f1 * c[0][l] + f2 * hx + f3 * kx;
            let gy = f1 * c[1][l] + f2 * hy + f3 * ky;
            let gz = f1 * c[2][l] + f2 * hz + f3 * kz;
            let value = self.value[l] + change;
            out.value[l] += share.n[l] * value;
            out.slope[0][l] += share.slope[0][l] * value;
            out.slope[1][l] += share.slope[1][l] * value;
            out.slope[2][l] += share.slope[2][l] * value;
            out.gradient[0][l] += free * (f[0][l] * gx + f[1][l] * gy + f[3][l] * gz);
            out.gradient[1][l] += free * (f[2][l] * gy + f[4][l] * gz);
            out.gradient[2][l] += free * (f[5][l] * gz);
            // A term of degree k falls by k times this.
            by_whole[l] = -(FACTOR_FALL as f32) * free * (first + second + third);
        }
        by_whole
    }
}
