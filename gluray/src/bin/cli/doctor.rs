//! `gluray doctor`: what this machine has, and what is missing.

use super::{has_glvnd, library};
use datasets::cli::{CommonArgs, Status};
use serde::Serialize;

#[derive(Serialize)]
struct Finding {
    what: &'static str,
    ok: bool,
    detail: String,
}

pub(crate) fn doctor(common: &CommonArgs) -> anyhow::Result<Status> {
    let found = library();
    let mut findings = vec![
        Finding {
            what: "libgluray.so",
            ok: found.is_some(),
            detail: found.map_or("not beside this program; cure: cargo build --release -p gluray".into(), |p| p.display().to_string()),
        },
        Finding {
            what: "GLVND",
            ok: true,
            detail: if has_glvnd() { "there: programs get us as a vendor library" } else { "not there: programs get us by LD_PRELOAD" }.into(),
        },
    ];
    let display = std::env::var("DISPLAY").unwrap_or_default();
    findings.push(Finding {
        what: "DISPLAY",
        ok: !display.is_empty(),
        detail: if display.is_empty() { "not set; cure: start an X server, for example `Xvfb :1 -noreset +extension GLX`".into() } else { display },
    });
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    findings.push(Finding { what: "threads", ok: true, detail: threads.to_string() });
    let ok = findings.iter().all(|f| f.ok);
    common.result(&findings, || {
        let line = |f: &Finding| format!("{} {:<14} {}", if f.ok { "ok     " } else { "MISSING" }, f.what, f.detail);
        findings.iter().map(line).collect::<Vec<_>>().join("\n")
    })?;
    Ok(if ok { Status::Success } else { Status::Failure })
}
