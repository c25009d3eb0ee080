//! Monomials of three variables up to third degree, in the order of their degrees.

use glam::DVec3;

/// Number of monomials of degree 1 to 3; the constant is apart.
pub(in crate::resample) const TERMS: usize = 19;

/// Number of monomials of degree 1 to the given one.
pub(super) const TERMS_TO_DEGREE: [usize; 4] = [0, 3, 9, 19];

/// x, y, z; xx, xy, xz, yy, yz, zz; xxx, xxy, xxz, xyy, xyz, xzz, yyy, yyz, yzz, zzz.
pub(super) fn monomials(u: DVec3) -> [f64; TERMS] {
    let (x, y, z) = (u.x, u.y, u.z);
    let (xx, xy, xz, yy, yz, zz) = (x * x, x * y, x * z, y * y, y * z, z * z);
    [
        x,
        y,
        z,
        xx,
        xy,
        xz,
        yy,
        yz,
        zz,
        x * xx,
        x * xy,
        x * xz,
        x * yy,
        x * yz,
        x * zz,
        y * yy,
        y * yz,
        y * zz,
        z * zz,
    ]
}

/// Means of the monomials over a body with mean position `u` and central second moments `s` (xx,
/// xy, xz, yy, yz, zz). Its central third moments are taken as zero, as those of every body with a
/// centre of symmetry.
pub(super) fn means(u: DVec3, s: [f64; 6]) -> [f64; TERMS] {
    let mut m = monomials(u);
    for (mean, second) in m[3..9].iter_mut().zip(s) {
        *mean += second;
    }
    let [xx, xy, xz, yy, yz, zz] = s;
    let (x, y, z) = (u.x, u.y, u.z);
    // E[abc] = a b c + a S_bc + b S_ac + c S_ab.
    let third = [
        3.0 * x * xx,
        2.0 * x * xy + y * xx,
        2.0 * x * xz + z * xx,
        x * yy + 2.0 * y * xy,
        x * yz + y * xz + z * xy,
        x * zz + 2.0 * z * xz,
        3.0 * y * yy,
        2.0 * y * yz + z * yy,
        y * zz + 2.0 * z * yz,
        3.0 * z * zz,
    ];
    for (mean, t) in m[9..].iter_mut().zip(third) {
        *mean += t;
    }
    m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_over_a_box_are_those_of_its_gauss_points() {
        let (centre, half) = (DVec3::new(0.3, -1.2, 0.7), DVec3::new(0.5, 0.2, 1.1));
        // Two Gauss points along each axis integrate cubics.
        let g = half / 3f64.sqrt();
        let mut sum = [0.0; TERMS];
        for corner in 0..8 {
            let side = |axis: usize| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
            let p = centre + g * DVec3::new(side(0), side(1), side(2));
            for (s, m) in sum.iter_mut().zip(monomials(p)) {
                *s += m / 8.0;
            }
        }
        let second = g * g;
        let got = means(centre, [second.x, 0.0, 0.0, second.y, 0.0, second.z]);
        for (got, want) in got.iter().zip(sum) {
            assert!((got - want).abs() < 1e-14, "{got} {want}");
        }
    }
}
