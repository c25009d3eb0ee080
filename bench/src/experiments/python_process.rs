//! A script in a Python that has the packages it needs.

use anyhow::Context as _;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};

/// Runs `script` with `order` as its argument, and reads the object that it prints.
///
/// # Errors
/// When the script does not start, fails, or prints something else.
pub(super) fn run<T: DeserializeOwned>(
    python: &Path,
    script: &str,
    order: &Value,
) -> anyhow::Result<T> {
    let output = Command::new(python)
        .args(["-B", "-c", script, &order.to_string()])
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .with_context(|| format!("{} does not start", python.display()))?;
    let named = || format!("{} with {order}", python.display());
    anyhow::ensure!(output.status.success(), "{}: {}", named(), output.status);
    serde_json::from_slice(&output.stdout).with_context(named)
}
