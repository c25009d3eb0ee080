//! Exact arithmetic for what the bounds in f64 leave open: integers of any length, because every
//! f64 is an integer times a power of two.

use super::input::RayF64;
use glam::DVec3;
use num_bigint::{BigInt, Sign};
use std::cmp::Ordering;

type Vector = [BigInt; 3];

/// The value of a finite number is integer · 2ᵏ.
fn integer_and_exponent(x: f64) -> (i64, i32) {
    let bits = x.to_bits();
    let (exponent, fraction) = ((bits >> 52 & 0x7ff) as i32, (bits & ((1 << 52) - 1)) as i64);
    let (integer, k) =
        if exponent == 0 { (fraction, -1074) } else { (fraction | 1 << 52, exponent - 1075) };
    (if x.is_sign_negative() { -integer } else { integer }, k)
}

/// The smallest exponent among numbers; 0 when all are zero.
fn common_exponent(values: impl Iterator<Item = f64>) -> i32 {
    values.filter(|&x| x != 0.0).map(|x| integer_and_exponent(x).1).min().unwrap_or(0)
}

/// x / 2ᵏ, for a `k` that is not above the exponent of `x`.
fn integer(x: f64, k: i32) -> BigInt {
    if x == 0.0 {
        return BigInt::ZERO;
    }
    let (integer, own) = integer_and_exponent(x);
    BigInt::from(integer) << (own - k) as u32
}

fn integers(v: DVec3, k: i32) -> Vector {
    v.to_array().map(|x| integer(x, k))
}

fn cross(p: &Vector, q: &Vector) -> Vector {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &p[i] * &q[j] - &p[j] * &q[i])
}

fn dot(p: &Vector, q: &Vector) -> BigInt {
    &p[0] * &q[0] + &p[1] * &q[1] + &p[2] * &q[2]
}

/// The exact intersection of a ray's line with a triangle's plane.
pub(super) struct ExactCrossing {
    /// Edge functions opposite of the three corners: d · (b × c), d · (c × a), d · (a × b), for
    /// corners a, b, c relative to the ray's origin.
    edges: Vector,
    /// a · (b × c).
    volume: BigInt,
    /// The parameter is volume / (sum of edges) · 2ᵏ.
    exponent: i32,
}

impl ExactCrossing {
    pub(super) fn new(ray: &RayF64, corners: [DVec3; 3]) -> Self {
        let all = corners.iter().chain([&ray.origin]).flat_map(|p| p.to_array());
        let (length, along) =
            (common_exponent(all), common_exponent(ray.dir.to_array().into_iter()));
        let (origin, dir) = (integers(ray.origin, length), integers(ray.dir, along));
        let [a, b, c] = corners.map(|p| {
            let p = integers(p, length);
            [0, 1, 2].map(|i| &p[i] - &origin[i])
        });
        let opposite_a = cross(&b, &c);
        let edges = [dot(&dir, &opposite_a), dot(&dir, &cross(&c, &a)), dot(&dir, &cross(&a, &b))];
        ExactCrossing { edges, volume: dot(&a, &opposite_a), exponent: length - along }
    }

    /// The sign of the edge function opposite of `corner`.
    pub(super) fn side(&self, corner: usize) -> Ordering {
        order(&self.edges[corner])
    }

    /// The parameter of the plane; `None` when the ray is parallel to it.
    pub(super) fn t(&self) -> Option<Ratio> {
        let sum: BigInt = self.edges.iter().sum();
        Ratio::new(self.volume.clone(), sum, self.exponent)
    }

    /// The weight of `corner` at the crossing.
    pub(super) fn weight(&self, corner: usize) -> Option<Ratio> {
        Ratio::new(self.edges[corner].clone(), self.edges.iter().sum(), 0)
    }
}

fn order(x: &BigInt) -> Ordering {
    match x.sign() {
        Sign::Minus => Ordering::Less,
        Sign::NoSign => Ordering::Equal,
        Sign::Plus => Ordering::Greater,
    }
}

/// numerator / denominator · 2ᵏ, with a denominator above zero.
pub(super) struct Ratio {
    numerator: BigInt,
    denominator: BigInt,
    exponent: i32,
}

impl Ratio {
    fn new(numerator: BigInt, denominator: BigInt, exponent: i32) -> Option<Ratio> {
        match denominator.sign() {
            Sign::NoSign => None,
            Sign::Plus => Some(Ratio { numerator, denominator, exponent }),
            Sign::Minus => {
                Some(Ratio { numerator: -numerator, denominator: -denominator, exponent })
            }
        }
    }

    pub(super) fn compare(&self, other: &Ratio) -> Ordering {
        let (mut left, mut right) =
            (&self.numerator * &other.denominator, &other.numerator * &self.denominator);
        let shift = self.exponent - other.exponent;
        if shift > 0 {
            left <<= shift as u32
        } else {
            right <<= shift.unsigned_abs()
        }
        left.cmp(&right)
    }

    /// Compares with a number that is not NaN.
    pub(super) fn compare_with(&self, x: f64) -> Ordering {
        if x.is_infinite() {
            return if x > 0.0 { Ordering::Less } else { Ordering::Greater };
        }
        let (numerator, exponent) = integer_and_exponent(x);
        let (numerator, denominator) = (BigInt::from(numerator), BigInt::from(1));
        self.compare(&Ratio { numerator, denominator, exponent })
    }

    /// The nearest f64. Results below the normal numbers may be rounded twice.
    pub(super) fn rounded(&self) -> f64 {
        let (n, d) = (self.numerator.magnitude(), &self.denominator);
        // A quotient of 66 or 67 bits, whose last bit says whether anything is left.
        let shift = 66 + d.bits() as i64 - n.bits() as i64;
        let (mut n, mut d) = (n.clone(), d.magnitude().clone());
        if shift > 0 {
            n <<= shift as u64
        } else {
            d <<= shift.unsigned_abs()
        }
        let quotient = &n / &d;
        let rest = &quotient * &d != n;
        let digits = quotient.to_u64_digits().into_iter().rev();
        let bits = digits.fold(0u128, |all, digit| all << 64 | u128::from(digit));
        let magnitude =
            times_power_of_two((bits | u128::from(rest)) as f64, i64::from(self.exponent) - shift);
        if self.numerator.sign() == Sign::Minus { -magnitude } else { magnitude }
    }
}

/// x · 2ᵏ, in steps that do not overflow or underflow before the result does.
fn times_power_of_two(mut x: f64, mut k: i64) -> f64 {
    use super::error_free::power_of_two;
    while k > 1000 && x.is_finite() && x != 0.0 {
        (x, k) = (x * power_of_two(1000), k - 1000);
    }
    while k < -900 && x != 0.0 {
        // The last step is the one that may leave the normal numbers.
        let step = if k < -1800 { 900 } else { (-k / 2).clamp(1, 900) };
        (x, k) = (x * power_of_two(-step as i32), k + step);
    }
    x * power_of_two(k.clamp(-1022, 1023) as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ratio(n: i64, d: i64, k: i32) -> f64 {
        Ratio::new(n.into(), d.into(), k).expect("not zero").rounded()
    }

    #[test]
    fn ratios_are_rounded_to_the_nearest() {
        for (n, d) in [(1, 3), (-2, 3), (1, -10), (0, 7), (355, 113), (i64::MAX, 3), (1, i64::MAX)]
        {
            let wanted = n as f64 / d as f64;
            let close = ratio(n, d, 0);
            assert!((close - wanted).abs() <= wanted.abs() * f64::EPSILON, "{n}/{d}: {close}");
        }
        assert_eq!(ratio(1, 3, 0), 1.0 / 3.0);
        assert_eq!(ratio(1, 10, 0), 0.1);
        assert_eq!(ratio(3, 1, -1074), 3.0 * f64::from_bits(1));
        assert_eq!(ratio(1, 1, 1023), 2f64.powi(1023));
        assert_eq!(ratio(1, 1, 2000), f64::INFINITY);
        assert_eq!(ratio(1, 1, -2000), 0.0);
        // Half way between two numbers: to the even one, unless something is left.
        assert_eq!(ratio((1 << 53) + 1, 1, 0), 9007199254740992.0);
        assert_eq!(ratio(((1 << 53) + 1) * 512 + 1, 512, 0), 9007199254740994.0);
    }

    #[test]
    fn ratios_are_compared_exactly() {
        let third = Ratio::new(1.into(), 3.into(), 0).expect("not zero");
        assert_eq!(third.compare_with(1.0 / 3.0), Ordering::Greater);
        assert_eq!(third.compare_with((1.0f64 / 3.0).next_up()), Ordering::Less);
        assert_eq!(third.compare_with(f64::INFINITY), Ordering::Less);
        let same = Ratio::new((-8).into(), (-3).into(), -3).expect("not zero");
        assert_eq!(third.compare(&same), Ordering::Equal);
    }
}
