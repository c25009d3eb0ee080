//! The device under test, and what tests compare on it.
#![allow(dead_code, reason = "each test binary uses its part")]

use super::common::{cube, lopsided};
use glam::DVec3;
use schlieren::field::{Field, Node};
use schlieren::gpu::Gpu;
use schlieren::path::Exit;
use std::io::Write as _;
use std::sync::Arc;

/// The device. Without one, prints why the test is skipped.
pub(crate) fn gpu() -> Option<Arc<Gpu>> {
    match Gpu::shared() {
        Ok(gpu) => Some(gpu),
        Err(e) => {
            assert!(std::env::var_os("RTSV_REQUIRE_PEERS").is_none_or(|v| v != "1"), "{e}");
            // The test harness captures eprintln! of tests that pass.
            let _ = writeln!(std::io::stderr(), "skipped: {e}");
            None
        }
    }
}

/// Largest difference of `value`, relative to its largest value.
pub(crate) fn relative(a: &[Exit], b: &[Exit], value: impl Fn(&Exit) -> f32) -> f64 {
    let largest = b.iter().map(|e| f64::from(value(e)).abs()).fold(0.0, f64::max);
    let differences =
        a.iter().zip(b).map(|(a, b)| (f64::from(value(a)) - f64::from(value(b))).abs());
    differences.fold(0.0, |m, d| if d.is_nan() || d > m { d } else { m }) / largest
}

/// A solid ball within a shell of blank cells.
pub(crate) fn with_body(n: usize) -> Field {
    let plain = cube(n, lopsided);
    let node = |i: usize| {
        let at = [i % n, i / n % n, i / (n * n)].map(|k| k as f64 / (n - 1) as f64 - 0.5);
        match DVec3::from(at).distance(DVec3::new(0.1, -0.05, 0.0)) {
            r if r < 0.12 => Node::Solid,
            r if r < 0.2 => Node::Blank,
            _ => Node::Gas,
        }
    };
    let nodes = (0..n * n * n).map(node).collect();
    Field::new(
        plain.dims(),
        plain.spacing_m(),
        plain.origin_m(),
        plain.eps().to_vec(),
        1.0,
        Some(nodes),
    )
    .unwrap()
}
