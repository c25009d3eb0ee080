//! The same frames under SimGrid's SMPI, the established simulator of MPI programs: how far is our model from it?

use std::path::PathBuf;
use std::process::Command;

/// Names the program `composite`.
const PROGRAM_VARIABLE: &str = "RTSV_COMPOSITE";

/// The program `composite`, if it has been built.
fn program() -> Option<PathBuf> {
    if let Some(named) = std::env::var_os(PROGRAM_VARIABLE) {
        return Some(named.into());
    }
    let beside = std::env::current_exe().ok()?.with_file_name("composite");
    beside.is_file().then_some(beside)
}

/// Median time in milliseconds of direct send, and of IceT's best strategy, for frames of `composite compare` under SMPI; or why there is none.
pub(super) fn compare_ms(ranks: usize, size: u32, frames: usize) -> Result<[f64; 2], String> {
    let program = program().ok_or_else(|| {
        format!("the program `composite` is not beside this one: cargo build -p composite --features cli (with the same --release), or name it in {PROGRAM_VARIABLE}")
    })?;
    let (ranks, size, frames) = (ranks.to_string(), size.to_string(), frames.to_string());
    let output = Command::new(program)
        .args(["compare", "--smpi", "--json", "--quiet", "--scene", "discs"])
        .args(["--ranks", &ranks, "--size", &size, "--frames", &frames])
        .output()
        .map_err(|e| e.to_string())?;
    let said = String::from_utf8_lossy(&output.stdout);
    let value: Option<serde_json::Value> = said
        .lines()
        .rev()
        .find_map(|l| serde_json::from_str(l).ok())
        .or_else(|| serde_json::from_str(&said).ok());
    let row = value.as_ref().map(|v| &v["rows"][0]);
    let number = |name: &str| row.and_then(|r| r[name].as_f64());
    number("ours_ms").zip(number("rival_ms")).map(|(a, b)| [a, b]).ok_or_else(|| {
        let why = String::from_utf8_lossy(&output.stderr);
        let last = why.lines().rev().find(|l| !l.trim().is_empty()).unwrap_or("no reason given").to_string();
        format!("composite compare --smpi ended with {}: {last}", output.status)
    })
}
