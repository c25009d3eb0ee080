//! Who draws volumes where the picture is the same either way, without `RTV_ALWAYS_TRACE`.

use crate::compare::{Limits, faults};
use crate::peers::skip;
use crate::session::{Program, Run, With, output, scripts_in};
use crate::vtk::SHADED;
use rt_core::simd::SimdLevel;

/// Images of `volume_alone`, whether rays draw them with AVX-512, and how near to stock's they are.
const IMAGES: [(&str, bool, Limits); 8] = [
    ("first", false, Limits::STRICT),
    ("large", true, Limits::STRICT),
    ("shaded_first", true, SHADED),
    ("shaded", true, SHADED),
    ("line_first", false, Limits::STRICT),
    ("line", false, Limits::STRICT),
    // The scene is looked at again after some frames.
    ("small_first", false, Limits::STRICT),
    ("small", false, Limits::STRICT),
];

fn same_as_stock(program: Program) {
    let scripts = scripts_in("choice");
    let run = |with, name: &str| {
        let folder = output(&format!("choice-{program:?}-{name}").to_lowercase());
        Run::new(program, with, &scripts, folder, &[("RTV_ALWAYS_TRACE", "0")])
    };
    let (stock, ours) = match (run(With::Stock, "stock"), run(With::Bridge, "ours")) {
        (Ok(stock), Ok(ours)) => (stock, ours),
        (Err(reason), _) | (_, Err(reason)) => return skip(&reason),
    };
    // With older instructions the model knows rays to be hardly cheaper.
    let fast = SimdLevel::available().contains(&SimdLevel::Avx512);
    let mut found = Vec::new();
    for (image, by_rays, limits) in IMAGES {
        let [a, b] = [&stock, &ours].map(|r| r.capture("volume_alone", image).unwrap());
        let (why, by_rays) = (b.choice(), by_rays && fast);
        if (b.traced_elements() > 0) != by_rays || why.starts_with("rays: about") != by_rays {
            found.push(format!("{image}: {} elements are traced: {why}", b.traced_elements()));
        }
        if !by_rays && !b.passed("reason").contains(&why) {
            found.push(format!("{image}: the volume's reason is {:?}", b.passed("reason")));
        }
        found.extend(faults(&a, &b, &limits).iter().map(|f| format!("{image}: {f}")));
    }
    assert!(found.is_empty(), "\n{}\n", found.join("\n"));
}

#[test]
fn large_volumes_alone_are_traced_and_look_as_in_the_stock_wheel() {
    same_as_stock(Program::Wheel);
}

#[test]
fn large_volumes_alone_are_traced_and_look_as_in_stock_vtk() {
    same_as_stock(Program::Vtk);
}
