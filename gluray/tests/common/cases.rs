//! One small program per case, run natively and through gluray. Colour and depth must agree.

use super::{Picture, Run, Xvfb, folder, metrics, peer};
use std::path::Path;

/// Colours and depths, bottom row first.
pub(crate) type Seen = (Picture, Vec<f32>);

/// The images that a program wrote one after the other.
pub(crate) fn read(file: &Path) -> Vec<Seen> {
    let bytes = std::fs::read(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let word = |i: usize| u32::from_ne_bytes(bytes[i..i + 4].try_into().expect("four bytes"));
    let (mut all, mut at) = (Vec::new(), 0);
    while at < bytes.len() {
        let (width, height) = (word(at) as usize, word(at + 4) as usize);
        let (n, colors) = (width * height, at + 8);
        let pixels =
            bytes[colors..colors + 4 * n].chunks_exact(4).map(|p| [p[0], p[1], p[2]]).collect();
        let depths = colors + 4 * n;
        let depth = (0..n).map(|i| f32::from_bits(word(depths + 4 * i))).collect();
        all.push((Picture { width, height, pixels }, depth));
        at = depths + 4 * n;
    }
    all
}

/// Requirements on a case besides agreement with the driver.
pub(crate) struct Expected {
    pub(crate) traced: bool,
    pub(crate) exit: i32,
}

/// Cases whose triangles the driver has to clip.
const CLIPPED: [&str; 2] = ["vertices_behind_the_eye", "levels_and_limits_of_textures"];

/// Cases whose depths are the driver's to the bit.
const EXACT_DEPTHS: [&str; 1] = ["surfaces_parallel_to_the_screen"];

/// Cases whose depths have larger rounding errors, and the limit in steps of 24 bits. llvmpipe
/// computes a sample's depth from the pixel's with one more addition: five steps were measured.
/// Where the two evaluated surfaces are seen nearly edge on, depth changes by half a million steps
/// from pixel to pixel: six steps were measured.
const ROUNDED: [(&str, f32); 3] =
    [("samples_of_surfaces", 6.0), ("patches_of_every_order", 7.0), ("rational_surfaces", 7.0)];

/// Asserts that colours equal the driver's except for pixels on edges, and depths likewise to
/// `steps` of 24 bits.
pub(crate) fn assert_agrees(
    what: &str,
    (native, native_depth): &Seen,
    (ours, depth): &Seen,
    steps: f32,
) -> metrics::Metrics {
    assert!(native.pixels.iter().any(|p| *p != native.pixels[0]), "{what} draws something");
    let m = metrics::compare(native, ours);
    let filled = m.raw <= 0.5 && m.interior <= 1.0 && m.interior_p99 <= 4.0 && m.overlap >= 0.995;
    assert!(filled, "{what}: {m:?}");
    let wrong = metrics::wrong_beyond_edges(native, ours);
    assert!(wrong.is_empty(), "{what}: {m:?}\n{}", wrong.join("\n"));
    let is_off = |(a, b): &(&f32, &f32)| (**a - **b).abs() > steps / 16_777_216.0;
    let far = native_depth.iter().zip(depth).filter(is_off).count();
    assert!(far * 200 <= depth.len(), "{what}: {far} of {} depths are off", depth.len());
    let steps = ROUNDED.iter().find(|(case, _)| *case == what).map_or(steps, |r| r.1);
    let far = metrics::depths_beyond_edges(native.width, native_depth, depth, steps / 16_777_216.0);
    assert!(far.is_empty(), "{what}: depths\n{}", far.join("\n"));
    m
}

/// Runs `case` of `script` (in `tests/programs`) both ways and compares. Returns `None`, with a
/// message, without the peers.
pub(crate) fn check(
    script: &str,
    case: &str,
    expected: &Expected,
    options: &[&str],
) -> Option<metrics::Metrics> {
    let python = peer("RTSV_SYSTEM_PYTHON")?;
    let x = Xvfb::start()?;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs").join(script);
    let place = folder();
    let run = |through, out: &str| {
        let run = Run { x: &x, folder: place.path(), through, environment: &[] };
        let (output, report) = run.program(&python, &[script.to_str().expect("UTF-8"), case, out]);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(expected.exit), "{case}: {text}");
        assert_eq!(text, "", "{case}: we must be silent");
        (read(&place.path().join(out)).pop().expect("a picture"), report)
    };
    let (native, _) = run(None, "native");
    let (ours, report) = run(Some(options), "ours");
    assert_eq!(report.traced_draws > 0, expected.traced, "{case}: {report:?}");
    // Where both images show the same surface, its depth equals the driver's to four steps of 24
    // bits. In triangles that it had to clip, llvmpipe interpolates from rounded new corners: up to
    // seven steps from the plane were measured. Our depths lie on the plane.
    let steps = match case {
        case if CLIPPED.contains(&case) => 8.0,
        case if EXACT_DEPTHS.contains(&case) => 0.5,
        _ => 4.0,
    };
    Some(assert_agrees(case, &native, &ours, steps))
}
