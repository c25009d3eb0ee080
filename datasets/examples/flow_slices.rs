//! Writes the middle slices of a flow's fields as PNG, grey from the field's minimum to its
//! maximum, magenta where there is no value: `cargo run --release -p datasets --example flow_slices
//! -- helium-plume small DIRECTORY`.

use datasets::catalogue::flows::find;
use datasets::generate::flow::{Fields, Flow};
use datasets::image_io::{LayeredImage, PngDepth, write_png};
use std::io::Write;
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    let [name, size, directory] = arguments.as_slice() else {
        return Err("usage: flow_slices NAME SIZE DIRECTORY".into());
    };
    let text = |a: &std::ffi::OsString| {
        a.to_str().map(str::to_string).ok_or(format!("{a:?} is not UTF-8"))
    };
    let (name, size) = (&text(name)?, &text(size)?);
    let mut out = std::io::stdout().lock();
    let start = std::time::Instant::now();
    let flow = find(name)?.generate(size, Fields::All)?;
    writeln!(out, "{name} {} in {:.2} s", flow.dims, start.elapsed().as_secs_f64())?;
    for f in &flow.fields {
        writeln!(out, "  {} {:?} {}", f.name, f.range(), f.unit)?;
        for (axis, label) in ["x", "y", "z"].iter().enumerate() {
            let path = Path::new(directory).join(format!("{name}-{}-{label}.png", f.name));
            write_png(&path, &slice(&flow, f.name, axis)?, PngDepth::Eight)?;
        }
    }
    Ok(())
}

/// The slice across `axis` in the middle; z is up, or y for a slice across z.
fn slice(
    flow: &Flow,
    field: &str,
    axis: usize,
) -> Result<LayeredImage, Box<dyn std::error::Error>> {
    let grid = flow.grid(field).ok_or("no such field")?;
    let (low, high) = grid.range().ok_or("no values")?;
    let [across, up] = [[1, 2], [0, 2], [0, 1]][axis];
    let dims = flow.dims.to_array();
    let mut values = Vec::new();
    for v in (0..dims[up]).rev() {
        for u in 0..dims[across] {
            let mut at = [0; 3];
            (at[axis], at[across], at[up]) = (dims[axis] / 2, u, v);
            values.push((grid.at(at[0], at[1], at[2]) - low) / (high - low).max(f32::MIN_POSITIVE));
        }
    }
    let mut image = LayeredImage::new(dims[across], dims[up]);
    // Compensate the sRGB encoding of the PNG, so that grey levels are linear in the value.
    let linear: Vec<f32> = values.iter().map(|v| v.powf(2.2)).collect();
    for channel in ["R", "G", "B"] {
        image.add(channel, "1", linear.clone())?;
    }
    Ok(image)
}
