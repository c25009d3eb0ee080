//! `gluray panel`.

use crate::host::panel::{PanelError, serve};
use clap::Args;
use datasets::cli::{Cancel, CommonArgs, Interrupted, UsageError};
use serde_json::json;
use std::net::SocketAddr;

/// Options of `gluray panel`.
#[derive(Debug, Args)]
#[command(
    after_help = "The page works for every program that `gluray run` started, before or after the \
                  panel. Only this user on this machine can open it.

Examples:
  gluray panel
  gluray panel --listen 127.0.0.1:8080 --quiet --json"
)]
pub(super) struct PanelArgs {
    /// Where the page is; loopback only. Port 0 takes a free one
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:0")]
    listen: SocketAddr,
}

pub(super) fn panel(common: CommonArgs, args: &PanelArgs) -> anyhow::Result<()> {
    let cancel = Cancel::on_ctrl_c()?;
    let mut printed = Ok(());
    let outcome = serve(args.listen, None, cancel.flag(), |opened| {
        let value = json!({ "url": opened.url, "link": opened.endpoint.address });
        printed = common.result(&value, || format!("open {}", opened.url));
        common.note(0, "programs find the panel by themselves; Ctrl-C ends");
    });
    match outcome {
        Err(e @ PanelError::NotLoopback(_)) => return Err(UsageError(e.to_string()).into()),
        other => other?,
    }
    printed?;
    cancel.check()?;
    Err(Interrupted.into())
}
