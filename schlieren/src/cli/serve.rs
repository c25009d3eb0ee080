//! Implements `schlieren serve`: opens the interactive page.

use super::scene_args::SceneArgs;
use crate::serve;
use clap::Args;
use datasets::cli::{Cancel, CommonArgs, Interrupted, UsageError};
use serde_json::json;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

/// Options of `schlieren serve`.
#[derive(Debug, Args)]
pub(super) struct ServeArgs {
    /// The flow, or a time series (several files, or one .pvd) of which the page shows any step
    files: Vec<PathBuf>,
    /// Address to listen on; port 0 selects a free port. With an address other than 127.0.0.1,
    /// other machines that know the full URL have access
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:0")]
    listen: SocketAddr,
    #[command(flatten)]
    scene: SceneArgs,
}

pub(super) fn serve(common: CommonArgs, args: &ServeArgs) -> anyhow::Result<()> {
    let cancel = Cancel::on_ctrl_c()?;
    let mut scene = args.scene.scene(args.files.first().map(PathBuf::as_path))?;
    if !scene.media.is_empty() {
        return Err(UsageError(
            "the page does not show absorption, emission or rotation; omit [media] and its \
             options, or use `schlieren render`"
                .into(),
        )
        .into());
    }
    // Scenes may be saved in another folder, so paths must be absolute.
    let whole = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    scene.flow.file = whole(&scene.flow.file);
    scene.solids.files.iter_mut().for_each(|f| *f = whole(f));
    if let crate::scene::TechniqueSpec::Schlieren {
        cutoff: crate::scene::CutoffSpec::Image { file, .. },
    } = &mut scene.technique
    {
        *file = whole(file);
    }
    let mut steps = match &args.files[..] {
        [] | [_] => match crate::input::series(std::slice::from_ref(&scene.flow.file)) {
            Ok(steps) => steps,
            // Steps whose data set is split into several files cannot be selected. The first step
            // is read as a whole.
            Err(e @ crate::input::InputError::InFile { .. }) => {
                common.warn(format_args!(
                    "only the first time is shown: {}",
                    datasets::cli::report(&e.into())
                ));
                Vec::new()
            }
            Err(e) => return Err(e.into()),
        },
        files => crate::input::series(files)?,
    };
    steps.iter_mut().for_each(|s| s.path = whole(&s.path));
    if !args.listen.ip().is_loopback() {
        common.warn(format_args!(
            "listening on {}: everyone who can reach this machine and knows the address can use \
             the page, and the connection is not encrypted",
            args.listen
        ));
    }
    // A square picture of a long flow is mostly empty.
    let fit = !args.scene.has_frame();
    common.note(0, format_args!("reading {}", scene.flow.file.display()));
    let mut printed = Ok(());
    let outcome = serve::serve(scene, steps, fit, args.listen, cancel.flag(), |url| {
        printed = common.result(&json!({ "url": url }), || format!("open {url}"));
        common.note(0, "Ctrl-C ends the program");
    });
    match outcome {
        Err(serve::ServeError::Refused(why)) => return Err(UsageError(why.to_string()).into()),
        other => other?,
    }
    printed?;
    cancel.check()?;
    Err(Interrupted.into())
}
