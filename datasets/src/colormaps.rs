//! Perceptually ordered colour maps for scalars. All returned colours are linear RGB.
//!
//! | name | for | source and licence |
//! |---|---|---|
//! | `viridis` | the default: magnitudes | S. van der Walt and N. Smith for Matplotlib 2.0, CC0 |
//! | `cool-warm` | deviations from a middle | K. Moreland, "Diverging Color Maps for Scientific Visualization" (2009); computed from the paper's formula, tables CC0 |
//! | `grey` | printing, schlieren | equal steps of sRGB |
//!
//! There is no rainbow map, because its lightness is not monotonic and shows edges that are not in
//! the data.

use rt_core::colormap::{ColorMap, Rgba, srgb_to_linear};

/// Names that [`by_name`] knows, the default first.
pub const NAMES: [&str; 3] = ["viridis", "cool-warm", "grey"];

/// The map of that name over the scalars `range`; `None` for an unknown name.
///
/// ```
/// let map = datasets::colormaps::by_name("cool-warm", [-1.0, 1.0]).unwrap();
/// let [r, g, b, _] = map.lookup(0.0); // the middle is a neutral light grey
/// assert!((r - g).abs() < 0.01 && (g - b).abs() < 0.01);
/// ```
pub fn by_name(name: &str, range: [f32; 2]) -> Option<ColorMap> {
    match name {
        "viridis" => Some(viridis(range)),
        "cool-warm" => Some(cool_warm(range)),
        "grey" => Some(grey(range)),
        _ => None,
    }
}

/// Dark blue over green to yellow; lightness rises evenly.
pub fn viridis(range: [f32; 2]) -> ColorMap {
    let code = |i: usize| {
        u8::from_str_radix(&VIRIDIS[2 * i..2 * i + 2], 16).unwrap_or_default() as f32 / 255.0
    };
    ColorMap::new(
        (0..256).map(|i| opaque([code(3 * i), code(3 * i + 1), code(3 * i + 2)])).collect(),
        range,
    )
}

/// Blue over light grey to red; the middle of `range` is neutral.
pub fn cool_warm(range: [f32; 2]) -> ColorMap {
    let ends =
        [[59.0, 76.0, 192.0], [180.0, 4.0, 38.0]].map(|c| msh_from_srgb(c.map(|v| v / 255.0)));
    ColorMap::new(
        (0..257).map(|i| opaque(diverging(ends, i as f64 / 256.0).map(|v| v as f32))).collect(),
        range,
    )
}

/// Black to white in equal steps of sRGB (which are approximately perceptually uniform).
pub fn grey(range: [f32; 2]) -> ColorMap {
    ColorMap::new((0..256).map(|i| opaque([i as f32 / 255.0; 3])).collect(), range)
}

fn opaque(srgb: [f32; 3]) -> Rgba {
    let [r, g, b] = srgb.map(srgb_to_linear);
    [r, g, b, 1.0]
}

// Moreland's Msh space: polar coordinates of CIELAB. M is the magnitude, s the angle from the
// lightness axis (saturation), h the hue.

/// Interpolates between two saturated ends through an unsaturated middle of magnitude 88 (Moreland
/// 2009, figure 6).
fn diverging([a, b]: [[f64; 3]; 2], t: f64) -> [f64; 3] {
    let middle = a[0].max(b[0]).max(88.0);
    let (from, to, t) = if t < 0.5 {
        (a, [middle, 0.0, adjusted_hue(a, middle)], 2.0 * t)
    } else {
        ([middle, 0.0, adjusted_hue(b, middle)], b, 2.0 * t - 1.0)
    };
    srgb_from_msh([0, 1, 2].map(|c| from[c] + (to[c] - from[c]) * t))
}

/// Hue at the unsaturated end that makes the interpolation look straight (Moreland 2009, figure 5).
fn adjusted_hue([m, s, h]: [f64; 3], unsaturated_m: f64) -> f64 {
    if m >= unsaturated_m {
        return h;
    }
    let spin = s * (unsaturated_m * unsaturated_m - m * m).sqrt() / (m * s.sin());
    if h > -std::f64::consts::FRAC_PI_3 { h + spin } else { h - spin }
}

/// White point D65, with the values of the paper's supplement.
const WHITE: [f64; 3] = [0.9505, 1.0, 1.089];

fn msh_from_srgb(srgb: [f64; 3]) -> [f64; 3] {
    let [r, g, b] = srgb.map(|v| srgb_to_linear(v as f32) as f64);
    let xyz = [
        0.4124 * r + 0.3576 * g + 0.1805 * b,
        0.2126 * r + 0.7152 * g + 0.0722 * b,
        0.0193 * r + 0.1192 * g + 0.9505 * b,
    ];
    let f = |c: usize| {
        let t = xyz[c] / WHITE[c];
        if t > 0.008_856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 }
    };
    let (l, a, b) = (116.0 * f(1) - 16.0, 500.0 * (f(0) - f(1)), 200.0 * (f(1) - f(2)));
    let m = (l * l + a * a + b * b).sqrt();
    [m, (l / m).acos(), b.atan2(a)]
}

fn srgb_from_msh([m, s, h]: [f64; 3]) -> [f64; 3] {
    let (l, a, b) = (m * s.cos(), m * s.sin() * h.cos(), m * s.sin() * h.sin());
    let y = (l + 16.0) / 116.0;
    let f = |t: f64| if t.powi(3) > 0.008_856 { t.powi(3) } else { (t - 16.0 / 116.0) / 7.787 };
    let [x, y, z] = [f(y + a / 500.0) * WHITE[0], f(y) * WHITE[1], f(y - b / 200.0) * WHITE[2]];
    let linear = [
        3.2406 * x - 1.5372 * y - 0.4986 * z,
        -0.9689 * x + 1.8758 * y + 0.0415 * z,
        0.0557 * x - 0.2040 * y + 1.0570 * z,
    ];
    linear.map(|v| rt_core::colormap::linear_to_srgb(v.clamp(0.0, 1.0) as f32) as f64)
}

/// 256 colours as sRGB bytes in hexadecimal. Source: Matplotlib's `viridis`
/// (bids.github.io/colormap), rounded to 8 bits. Licence: CC0 1.0.
const VIRIDIS: &str = "\
    44015444025645045745055946075a46085c460a5d460b5e470d60470e61471063471164471365481467481668481769\
    48186a481a6c481b6d481c6e481d6f481f70482071482173482374482475482576482677482878482979472a7a472c7a\
    472d7b472e7c472f7d46307e46327e46337f463480453581453781453882443983443a83443b84433d84433e85423f85\
    4240864241864142874144874045884046883f47883f48893e49893e4a893e4c8a3d4d8a3d4e8a3c4f8a3c508b3b518b\
    3b528b3a538b3a548c39558c39568c38588c38598c375a8c375b8d365c8d365d8d355e8d355f8d34608d34618d33628d\
    33638d32648e32658e31668e31678e31688e30698e306a8e2f6b8e2f6c8e2e6d8e2e6e8e2e6f8e2d708e2d718e2c718e\
    2c728e2c738e2b748e2b758e2a768e2a778e2a788e29798e297a8e297b8e287c8e287d8e277e8e277f8e27808e26818e\
    26828e26828e25838e25848e25858e24868e24878e23888e23898e238a8d228b8d228c8d228d8d218e8d218f8d21908d\
    21918c20928c20928c20938c1f948c1f958b1f968b1f978b1f988b1f998a1f9a8a1e9b8a1e9c891e9d891f9e891f9f88\
    1fa0881fa1881fa1871fa28720a38620a48621a58521a68522a78522a88423a98324aa8325ab8225ac8226ad8127ad81\
    28ae8029af7f2ab07f2cb17e2db27d2eb37c2fb47c31b57b32b67a34b67935b77937b87838b9773aba763bbb753dbc74\
    3fbc7340bd7242be7144bf7046c06f48c16e4ac16d4cc26c4ec36b50c46a52c56954c56856c66758c7655ac8645cc863\
    5ec96260ca6063cb5f65cb5e67cc5c69cd5b6ccd5a6ece5870cf5773d05675d05477d1537ad1517cd2507fd34e81d34d\
    84d44b86d54989d5488bd6468ed64590d74393d74195d84098d83e9bd93c9dd93ba0da39a2da37a5db36a8db34aadc32\
    addc30b0dd2fb2dd2db5de2bb8de29bade28bddf26c0df25c2df23c5e021c8e020cae11fcde11dd0e11cd2e21bd5e21a\
    d8e219dae319dde318dfe318e2e418e5e419e7e419eae51aece51befe51cf1e51df4e61ef6e620f8e621fbe723fde725";

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::colormap::linear_to_srgb;

    fn bytes(c: Rgba) -> [f32; 3] {
        [0, 1, 2].map(|i| linear_to_srgb(c[i]) * 255.0)
    }

    #[test]
    fn cool_warm_is_vtks_diverging_space() {
        // vtkColorTransferFunction with SetColorSpaceToDiverging between the same ends, times 255.
        let map = cool_warm([0.0, 1.0]);
        for (t, expected) in [
            (0.0, [59.0, 76.0, 192.0]),
            (0.125, [97.9, 129.8, 233.8]),
            (0.25, [141.1, 175.6, 253.8]),
            (0.375, [184.2, 207.5, 249.0]),
            (0.5, [220.7, 220.7, 220.7]),
            (0.625, [244.6, 196.3, 172.9]),
            (0.75, [244.4, 153.8, 122.8]),
            (0.875, [221.7, 96.5, 76.4]),
            (1.0, [180.0, 4.0, 38.0]),
        ] {
            let found = bytes(map.lookup(t));
            for c in 0..3 {
                assert!(
                    (found[c] - expected[c]).abs() < 0.6,
                    "{t}: {found:?}, expected {expected:?}"
                );
            }
        }
    }

    #[test]
    fn viridis_ends_and_middle() {
        let map = viridis([0.0, 1.0]);
        for (t, expected) in [(0.0, [68.0, 1.0, 84.0]), (1.0, [253.0, 231.0, 37.0])] {
            let found = bytes(map.lookup(t));
            assert!((0..3).all(|c| (found[c] - expected[c]).abs() < 0.1), "{t}: {found:?}");
        }
        assert_eq!(map.colors.len(), 256);
    }

    #[test]
    fn lightness_of_viridis_and_grey_rises() {
        for name in ["viridis", "grey"] {
            let map = by_name(name, [0.0, 1.0]).unwrap();
            let luminance = |c: &Rgba| 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
            // The table's rounding to 8 bits may reduce the value by half a code (0.002 in bright
            // green).
            let falls = map
                .colors
                .windows(2)
                .filter(|w| luminance(&w[1]) < luminance(&w[0]) - 2e-3)
                .count();
            assert_eq!(falls, 0, "{name}");
        }
    }

    #[test]
    fn all_names_are_known_and_the_rainbow_is_not() {
        for name in NAMES {
            let map = by_name(name, [2.0, 3.0]).unwrap();
            assert_eq!(map.range, [2.0, 3.0]);
            assert!(map.colors.iter().flatten().all(|v| (0.0..=1.0).contains(v)), "{name}");
        }
        assert!(by_name("jet", [0.0, 1.0]).is_none() && by_name("rainbow", [0.0, 1.0]).is_none());
    }
}
