//! Starts the helpers of `gluray run --ranks N` before the program, and ends them after it.

use crate::cluster::SOCKETS;
use crate::host::config::environment::variable_of;
use anyhow::{Context as _, bail};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// How long a helper may take to be there.
const PATIENCE: Duration = Duration::from_secs(20);

/// Helper processes; they end when this does, also by a kill: then their standard input ends.
pub(super) struct Helpers(Vec<Child>);

impl Helpers {
    /// Starts `ranks - 1` helpers with sockets in `folder`, and tells `program` of them.
    pub(super) fn start(
        ranks: u32,
        folder: &Path,
        program: &mut Command,
    ) -> anyhow::Result<Helpers> {
        let mut helpers = Helpers(Vec::new());
        if ranks < 2 {
            return Ok(helpers);
        }
        let threads = variable_of("threads");
        let cores = std::thread::available_parallelism().map_or(1, |n| n.get() as u32);
        // All ranks are on this machine, so each gets its part of it.
        let asked =
            program.get_envs().find(|(name, _)| *name == threads.as_str()).and_then(|(_, v)| v);
        let asked = asked.map(|v| v.to_string_lossy().into_owned());
        let each =
            asked.or_else(|| std::env::var(&threads).ok()).filter(|t| t != "0" && !t.is_empty());
        let each = each.unwrap_or_else(|| (cores / ranks).max(1).to_string());
        program.env(&threads, &each);
        let me = std::env::current_exe().context("this program has no name")?;
        let sockets: Vec<_> = (1..ranks).map(|rank| folder.join(format!("rank{rank}"))).collect();
        for socket in &sockets {
            let mut command = Command::new(&me);
            command.args(["--quiet", "serve-rays", "--until-input-ends", "--socket"]).arg(socket);
            command.env(&threads, &each).stdin(Stdio::piped()).stdout(Stdio::null());
            helpers.0.push(command.spawn().context("cannot start a helper")?);
        }
        let end = Instant::now() + PATIENCE;
        for (socket, child) in sockets.iter().zip(&mut helpers.0) {
            while !socket.exists() {
                if let Some(status) = child.try_wait()? {
                    bail!("a helper ended at once: {status}");
                }
                if Instant::now() > end {
                    bail!("a helper was not there after {} s", PATIENCE.as_secs());
                }
                std::thread::sleep(Duration::from_millis(2));
            }
        }
        let names: Vec<String> = sockets.iter().map(|s| s.to_string_lossy().into_owned()).collect();
        program.env(SOCKETS, names.join(":"));
        Ok(helpers)
    }
}

impl Drop for Helpers {
    fn drop(&mut self) {
        for child in &mut self.0 {
            drop(child.stdin.take());
        }
        let end = Instant::now() + Duration::from_secs(2);
        for child in &mut self.0 {
            while matches!(child.try_wait(), Ok(None)) {
                if Instant::now() > end {
                    child.kill().ok();
                }
                std::thread::sleep(Duration::from_millis(5));
            }
        }
    }
}
