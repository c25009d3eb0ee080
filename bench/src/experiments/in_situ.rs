//! What pictures cost a simulation that makes them while it runs: the example `blast.cc` of
//! composite's C interface, on two ranks of Open MPI.

use super::Context;
use crate::record::{Record, Row};
use crate::stats::Summary;
use anyhow::Context as _;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The C interface's folder in the source tree.
const INTERFACE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../composite/capi");
/// The library, beside this program. Programs ask for the second name.
const LIBRARY: [&str; 2] = ["librtsv_composite.so", "librtsv_composite.so.0"];
const RANKS: &str = "2";
const STEPS: u32 = 20;
/// Steps from one picture and photograph to the next.
const STEPS_OF_A_PICTURE: u32 = 10;
const SIZE_PX: u32 = 512;

/// Seconds of one run on the slowest rank: of the solver, of its photographs, of its pictures.
type Seconds = [f64; 3];

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("cells", "", "cells along each side of the gas");
    record.column("step", "ms", "a step of the solver: median over the rounds");
    record.column("picture", "ms", "a picture of the density as a medium");
    record.column("picture_low", "ms", "the same of the fastest round");
    record.column("picture_high", "ms", "the same of the slowest round");
    record.column("photograph", "ms", "a schlieren photograph");
    record.column("photograph_low", "ms", "the same of the fastest round");
    record.column("photograph_high", "ms", "the same of the slowest round");
    record.column("picture_share", "%", "of the time of the ten steps from one to the next");
    record.column("photograph_share", "%", "likewise");
    record.notes.push(format!(
        "`blast.cc` solves Euler's equations on {RANKS} ranks of Open MPI, compiled with -O3 for \
         this processor, and makes a picture and a schlieren photograph of {SIZE_PX} x {SIZE_PX} \
         pixels at each tenth step. The densities are read where the solver has them for \
         photographs, and copied once for pictures."
    ));
    let folder = tempfile::tempdir()?;
    let program = match compiled(folder.path()) {
        Ok(program) => program,
        Err(missing) => {
            record.missing.push(missing);
            return Ok(());
        }
    };
    let (sizes, rounds): (&[u32], usize) =
        if context.quick { (&[32], 1) } else { (&[64, 128, 192, 256], 5) };
    for &cells in sizes {
        let mut all: Vec<Seconds> = Vec::new();
        for round in 1..=rounds {
            context.report_step(format!("{cells} cells a side: round {round} of {rounds}"))?;
            all.push(simulated(&program, folder.path(), cells)?);
        }
        let pictures = f64::from(STEPS / STEPS_OF_A_PICTURE);
        let of = |which: usize, count: f64| {
            let ms: Vec<f64> = all.iter().map(|secs| 1e3 * secs[which] / count).collect();
            Summary::of(&ms).context("no rounds")
        };
        let step = of(0, f64::from(STEPS))?;
        let (photograph, picture) = (of(1, pictures)?, of(2, pictures)?);
        let share = |ms: f64| 100.0 * ms / (f64::from(STEPS_OF_A_PICTURE) * step.median);
        record.rows.push(
            Row::new()
                .with("cells", cells)
                .with("step", step.median)
                .with("picture", picture.median)
                .with("picture_low", picture.low)
                .with("picture_high", picture.high)
                .with("photograph", photograph.median)
                .with("photograph_low", photograph.low)
                .with("photograph_high", photograph.high)
                .with("picture_share", share(picture.median))
                .with("photograph_share", share(photograph.median)),
        );
    }
    Ok(())
}

/// The program, or what is missing for it.
fn compiled(folder: &Path) -> Result<PathBuf, String> {
    let this = std::env::current_exe().map_err(|e| e.to_string())?;
    // A library that cargo has built for tests alone is in the second place.
    let places = [LIBRARY[0].to_owned(), format!("deps/{}", LIBRARY[0])];
    let built = places.map(|place| this.with_file_name(place));
    let Some(beside) = built.iter().find(|file| file.is_file()) else {
        return Err(format!(
            "{} is not there: cargo build --release -p composite-capi (for a release build)",
            built[0].display()
        ));
    };
    for name in LIBRARY {
        std::os::unix::fs::symlink(beside, folder.join(name)).map_err(|e| e.to_string())?;
    }
    let program = folder.join("blast");
    let folder = folder.display();
    let mut compiler = Command::new(tool("RTSV_MPICXX", "mpicxx.openmpi"));
    compiler.args(["-std=c++17", "-O3", "-march=native", "-o"]).arg(&program);
    compiler
        .arg(format!("-I{INTERFACE}/include"))
        .arg(format!("{INTERFACE}/examples/cpp/blast.cc"));
    compiler.arg(format!("-L{folder}")).arg("-lrtsv_composite");
    let made = compiler.arg(format!("-Wl,-rpath,{folder}")).output();
    match made {
        Ok(output) if output.status.success() => Ok(program),
        Ok(output) => Err(String::from_utf8_lossy(&output.stderr).into_owned()),
        Err(e) => Err(format!("mpicxx.openmpi: {e} (Debian: libopenmpi-dev)")),
    }
}

/// A program of Open MPI: that of the variable, or the one of this name.
fn tool(variable: &str, name: &str) -> PathBuf {
    std::env::var_os(variable).map_or_else(|| name.into(), PathBuf::from)
}

fn simulated(program: &Path, folder: &Path, cells: u32) -> anyhow::Result<Seconds> {
    let mut command = Command::new(tool("RTSV_MPIRUN", "mpirun.openmpi"));
    command.args(["-n", RANKS]).arg(program).arg(folder.join("out"));
    command.args([cells, STEPS, SIZE_PX].map(|n| n.to_string()));
    // For root in a container, on one machine.
    command.env("OMPI_ALLOW_RUN_AS_ROOT", "1").env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1");
    command.env("OMPI_MCA_btl", "self,vader").env("OMPI_MCA_rmaps_base_oversubscribe", "1");
    command.env("RAYON_NUM_THREADS", "1").stdin(std::process::Stdio::null());
    let output = command.output().context("mpirun.openmpi (Debian: openmpi-bin)")?;
    let said = String::from_utf8_lossy(&output.stdout);
    seconds_in(&said).with_context(|| {
        format!("blast: {}: {said}{}", output.status, String::from_utf8_lossy(&output.stderr))
    })
}

/// The seconds in `solver 0.5 s, photographs 2.9 s, pictures 0.5 s, ...`.
fn seconds_in(said: &str) -> Option<Seconds> {
    let line = said.lines().find(|l| l.starts_with("solver "))?;
    let of = |word: &str| {
        let rest = line.split_once(&format!("{word} "))?.1;
        rest.split_once(' ')?.0.parse::<f64>().ok()
    };
    Some([of("solver")?, of("photographs")?, of("pictures")?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_seconds_of_the_example_are_read() {
        let said = "x\nsolver 4.5 s, photographs 6.25 s, pictures 0.75 s, 0 copies of densities\n";
        assert_eq!(seconds_in(said), Some([4.5, 6.25, 0.75]));
        assert_eq!(seconds_in("solver 4.5 s, pictures 0.75 s"), None);
    }
}
