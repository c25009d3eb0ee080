//! `gluray serve-rays`: a helper that traces its share of other programs' pictures.

use crate::ranks::helper::serve;
use crate::ranks::sockets::SocketComm;
use anyhow::Context as _;
use datasets::cli::{Cancel, CommonArgs, CureExt as _, Interrupted};
use std::io::Read as _;
use std::os::unix::net::UnixListener;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

/// Options of `gluray serve-rays`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "`gluray run --ranks N` starts helpers by itself; this is for helpers with other rights, priorities or cores than the program.
Whoever can write to the socket can have pictures traced here: put it into a folder of your own.

Examples:
  taskset -c 8-15 gluray serve-rays --socket ~/rays/a &
  GLURAY_RANKS=$HOME/rays/a gluray run -- paraview"
)]
pub(super) struct ServeRaysArgs {
    /// Where programs find the helper: a socket that is made, and removed in the end
    #[arg(long, value_name = "FILE")]
    socket: PathBuf,
    /// Ends when standard input does: as a child of a program that may be killed
    #[arg(long)]
    until_input_ends: bool,
}

/// A socket that goes with its helper.
struct Socket(PathBuf);

impl Drop for Socket {
    fn drop(&mut self) {
        std::fs::remove_file(&self.0).ok();
    }
}

pub(super) fn serve_rays(common: &CommonArgs, args: &ServeRaysArgs) -> anyhow::Result<()> {
    let cancel = Cancel::on_ctrl_c()?;
    let listener = UnixListener::bind(&args.socket)
        .with_context(|| format!("cannot make the socket {}", args.socket.display()))
        .cure("name a file that is not there yet, in a folder that you can write to, with fewer than 108 bytes in all")?;
    let _socket = Socket(args.socket.clone());
    listener.set_nonblocking(true).context("the socket")?;
    crate::fault::silence();
    let over = Arc::new(AtomicBool::new(false));
    if args.until_input_ends {
        let over = over.clone();
        std::thread::spawn(move || {
            let mut ignored = [0; 64];
            while matches!(std::io::stdin().read(&mut ignored), Ok(n) if n > 0) {}
            over.store(true, Relaxed);
        });
    }
    common.note(0, format!("programs with GLURAY_RANKS={} are helped; Ctrl-C ends", args.socket.display()));
    while !over.load(Relaxed) {
        if cancel.check().is_err() {
            over.store(true, Relaxed);
            return Err(Interrupted.into());
        }
        match listener.accept() {
            Ok((stream, _)) => {
                let over = over.clone();
                std::thread::spawn(move || {
                    // A program that goes away, or sends what is no message, ends this talk and no other.
                    if let Ok(mut comm) = SocketComm::helper(stream) {
                        serve(&mut comm, &over).ok();
                    }
                });
            }
            Err(e) if e.kind() == std::io::ErrorKind::WouldBlock => {
                std::thread::sleep(Duration::from_millis(5));
            }
            Err(e) => return Err(e).context("the socket"),
        }
    }
    Ok(())
}
