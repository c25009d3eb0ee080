//! `composite doctor`: what this machine has, and how to get what it lacks.
use super::mpirun;
use crate::comm::mpi::{inspect, launcher};
use crate::icet;
use crate::simd::SimdLevel;
use datasets::cli::{CommonArgs, Status};
use serde::Serialize;
use std::fmt;
use std::process::Command;

#[derive(Debug, Serialize)]
struct Diagnosis {
    findings: Vec<Finding>,
}

#[derive(Debug, Serialize)]
struct Finding {
    what: &'static str,
    usable: bool,
    found: String,
    cure: Option<String>,
}

pub(super) fn doctor(common: CommonArgs) -> anyhow::Result<Status> {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = Finding {
        what: "threads",
        usable: true,
        found: format!("{processors} processors; kernels: {}", SimdLevel::best().name()),
        cure: None,
    };
    let findings = vec![
        threads,
        mpi("Open MPI", launcher::OPEN_MPI, "openmpi-bin"),
        mpi("MPICH", launcher::MPICH, "mpich"),
        mpirun_program(processors),
        this_process(),
        smpi(),
        icet(),
    ];
    let diagnosis = Diagnosis { findings };
    common.result(&diagnosis, || &diagnosis)?;
    Ok(Status::Success)
}

fn mpi(what: &'static str, names: &[&str], package: &str) -> Finding {
    match inspect(names) {
        Ok((library, version, abi)) => {
            let first = version.lines().next().unwrap_or_default().trim().to_string();
            let cure = abi.as_ref().err().map(ToString::to_string);
            let known = abi.map_or("unknown binary interface", |abi| abi.name());
            Finding {
                what,
                usable: cure.is_none(),
                found: format!("{library}: {first} ({known})"),
                cure,
            }
        }
        Err(error) => Finding {
            what,
            usable: false,
            found: error.to_string(),
            cure: Some(format!(
                "install it (Debian: {package}), or name its library in COMPOSITE_MPI"
            )),
        },
    }
}

/// The first line that a program prints about itself.
fn version_of(program: impl AsRef<std::ffi::OsStr>, flag: &str) -> Option<String> {
    let output = Command::new(program).arg(flag).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned()
        + &String::from_utf8_lossy(&output.stderr);
    text.lines().find(|line| !line.trim().is_empty()).map(|line| line.trim().to_string())
}

fn mpirun_program(processors: usize) -> Finding {
    let name = mpirun::launcher();
    let version = version_of(&name, "--version");
    let name = name.display();
    match version {
        Some(version) => {
            let settings: Vec<String> = mpirun::settings(processors + 1)
                .iter()
                .map(|(name, value)| format!("{name}={value}"))
                .collect();
            let more = if settings.is_empty() {
                String::new()
            } else {
                format!("; for more ranks than processors --mpi sets {}", settings.join(" "))
            };
            Finding {
                what: "launcher",
                usable: true,
                found: format!("{name}: {version}{more}"),
                cure: None,
            }
        }
        None => Finding {
            what: "launcher",
            usable: false,
            found: format!("there is no program {name}"),
            cure: Some(format!(
                "install openmpi-bin or mpich, or name the launcher in {}",
                mpirun::LAUNCHER_VARIABLE
            )),
        },
    }
}

fn this_process() -> Finding {
    let found = match launcher::choose(launcher::variable) {
        Ok(choice) => format!("a rank: {} ({})", choice.libraries.join(" or "), choice.reason),
        Err(_) => "not started by an MPI launcher; --mpi starts one".to_string(),
    };
    Finding { what: "this process", usable: true, found, cure: None }
}

fn smpi() -> Finding {
    let what = "SMPI";
    match version_of("smpirun", "-version") {
        Some(version) => Finding { what, usable: true, found: version, cure: None },
        None => Finding {
            what,
            usable: false,
            found: "there is no program smpirun".to_string(),
            cure: Some("install SimGrid for --smpi (Debian: libsimgrid-dev)".to_string()),
        },
    }
}

fn icet() -> Finding {
    let what = "IceT";
    match icet::find() {
        Ok(path) => Finding { what, usable: true, found: path.display().to_string(), cure: None },
        Err(error) => Finding {
            what,
            usable: false,
            found: "not found".to_string(),
            cure: Some(format!("for `composite compare`: {error}")),
        },
    }
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, finding) in self.findings.iter().enumerate() {
            if index > 0 {
                writeln!(f)?;
            }
            let mark = if finding.usable { "ok" } else { "--" };
            write!(f, "{mark} {:<13} {}", finding.what, finding.found)?;
            if let Some(cure) = &finding.cure {
                write!(f, "\n   {:<13} cure: {cure}", "")?;
            }
        }
        Ok(())
    }
}
