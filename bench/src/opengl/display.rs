//! Starts an X server without a screen.

use anyhow::Context as _;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// Xvfb on an unused display; dropping this value ends it.
pub struct Display {
    server: Child,
    name: String,
}

impl Display {
    /// Starts `xvfb`.
    pub fn start(xvfb: &Path) -> anyhow::Result<Display> {
        let screen = ["-displayfd", "1", "-screen", "0", "1280x1280x24", "+extension", "GLX"];
        let mut server = Command::new(xvfb)
            .args(screen)
            .args(["-noreset", "-nolisten", "tcp"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .with_context(|| format!("cannot start `{}`", xvfb.display()))?;
        let mut line = String::new();
        if let Some(out) = server.stdout.take() {
            BufReader::new(out).read_line(&mut line).context("Xvfb does not say its display")?;
        }
        let display = Display { server, name: format!(":{}", line.trim()) };
        anyhow::ensure!(display.name.len() > 1, "Xvfb ended before it had a display");
        Ok(display)
    }

    /// Value of `DISPLAY` for this server.
    pub fn name(&self) -> &str {
        &self.name
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        // The server may have ended already.
        self.server.kill().ok();
        self.server.wait().ok();
    }
}
