//! `gluray serve-rays`: a helper that traces its share of other programs' pictures, or an MPI job
//! of helpers.

use crate::cluster::SOCKETS;
use crate::cluster::helper::serve;
use crate::cluster::mpi_group::{coordinate_group, serve_group};
use crate::cluster::socket_comm::SocketComm;
use crate::host::config::environment::variable_of;
use crate::host::config::{self, Settings};
use anyhow::Context as _;
use composite::Communicator as _;
use composite::comm::mpi::{MpiComm, launcher};
use datasets::cli::{Cancel, CommonArgs, CureExt as _, Interrupted, UsageError};
use std::io::{ErrorKind, Read as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

/// Options of `gluray serve-rays`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "`gluray run --ranks N` starts helpers by itself; this is for helpers with other \
                  rights, priorities or cores than the program, and, with --mpi,
on other machines. Whoever can write to the socket can have pictures traced here: put it into a \
folder of your own.

With --mpi there is a socket for each rank, FILE, FILE.1, FILE.2 and so on, all on the machine of \
the first rank; programs there are no ranks of the job.

Examples:
  taskset -c 8-15 gluray serve-rays --socket ~/rays/a &
  GLURAY_RANKS=$HOME/rays/a gluray run -- paraview
  mpirun -n 3 gluray serve-rays --mpi --socket ~/rays/b &
  GLURAY_RANKS=$HOME/rays/b:$HOME/rays/b.1:$HOME/rays/b.2 gluray run -- paraview"
)]
pub(super) struct ServeRaysArgs {
    /// Where programs find the helper: a socket that is made, and removed in the end
    #[arg(long, value_name = "FILE")]
    socket: PathBuf,
    /// This is a rank of an MPI job of helpers: started by mpirun (Open MPI or MPICH)
    #[arg(long)]
    mpi: bool,
    /// Ends when standard input does: as a child of a program that may be killed
    #[arg(long)]
    until_input_ends: bool,
}

/// A socket that goes with its helper.
struct BoundSocket(PathBuf);

impl Drop for BoundSocket {
    fn drop(&mut self) {
        std::fs::remove_file(&self.0).ok();
    }
}

impl BoundSocket {
    fn bind(path: &Path) -> anyhow::Result<(UnixListener, BoundSocket)> {
        let bound = UnixListener::bind(path);
        // That of a helper that was killed: nobody answers there.
        let dead = bound.as_ref().is_err_and(|e| e.kind() == ErrorKind::AddrInUse)
            && UnixStream::connect(path).is_err_and(|e| e.kind() == ErrorKind::ConnectionRefused);
        let bound = if dead && std::fs::remove_file(path).is_ok() {
            UnixListener::bind(path)
        } else {
            bound
        };
        let listener =
            bound.with_context(|| format!("cannot make the socket {}", path.display())).cure(
                "name a file that is not there yet, in a folder that you can write to, with \
                   fewer than 108 bytes in all",
            )?;
        listener.set_nonblocking(true).context("the socket")?;
        Ok((listener, BoundSocket(path.to_owned())))
    }
}

pub(super) fn serve_rays(common: &CommonArgs, args: &ServeRaysArgs) -> anyhow::Result<()> {
    let cancel = Cancel::on_ctrl_c()?;
    crate::faults::silence();
    let over = Arc::new(AtomicBool::new(false));
    watch(cancel, args.until_input_ends, &over);
    if args.mpi {
        serve_job(common, args, &over)?;
    } else {
        let (listener, _socket) = BoundSocket::bind(&args.socket)?;
        let socket = args.socket.display();
        common.note(0, format!("programs with {SOCKETS}={socket} are helped; Ctrl-C ends"));
        accept(&listener, &over)?;
    }
    if cancel.is_set() {
        return Err(Interrupted.into());
    }
    Ok(())
}

/// Sets `over` at Ctrl-C, and at the end of standard input where that is asked for.
fn watch(cancel: Cancel, until_input_ends: bool, over: &Arc<AtomicBool>) {
    let flag = over.clone();
    std::thread::spawn(move || {
        while !cancel.is_set() {
            std::thread::sleep(Duration::from_millis(5));
        }
        flag.store(true, Relaxed);
    });
    if until_input_ends {
        let over = over.clone();
        std::thread::spawn(move || {
            let mut ignored = [0; 64];
            while matches!(std::io::stdin().read(&mut ignored), Ok(n) if n > 0) {}
            over.store(true, Relaxed);
        });
    }
}

/// Helps all programs that come, each on a thread of its own.
fn accept(listener: &UnixListener, over: &Arc<AtomicBool>) -> anyhow::Result<()> {
    while !over.load(Relaxed) {
        match listener.accept() {
            Ok((stream, _)) => {
                let over = over.clone();
                std::thread::spawn(move || {
                    // A program that goes away, or sends what is no message, ends this talk and no
                    // other.
                    if let Ok(mut comm) = SocketComm::helper(stream) {
                        serve(&mut comm, &over).ok();
                    }
                });
            }
            Err(e) if e.kind() == ErrorKind::WouldBlock => {
                std::thread::sleep(Duration::from_millis(5))
            }
            Err(e) => return Err(e).context("the socket"),
        }
    }
    Ok(())
}

// ---- An MPI job ---------------------------------------------------------------------------------
/// The part of this process in an MPI job of helpers.
fn serve_job(
    common: &CommonArgs,
    args: &ServeRaysArgs,
    over: &Arc<AtomicBool>,
) -> anyhow::Result<()> {
    let variable = |name: &str| std::env::var(name).ok();
    if !launcher::launched(variable) {
        return Err(UsageError(
            "--mpi is for ranks of an MPI job: start them with `mpirun -n N gluray serve-rays \
             --mpi --socket FILE`"
                .into(),
        )
        .into());
    }
    share_machine(variable);
    let mut comm = MpiComm::world()?;
    let served = if comm.rank() > 0 {
        serve_group(&mut comm, over).map_err(anyhow::Error::from)
    } else {
        coordinate_job(common, args, &mut comm, over)
    };
    if let Err(e) = served {
        // The others end as well: nobody waits for a job that is not whole.
        comm.abort(&format!("{e:#}"));
        return Err(e);
    }
    Ok(())
}

/// Ranks that share a machine share its cores, unless a number of threads was asked for.
fn share_machine(variable: impl Fn(&str) -> Option<String>) {
    if variable(&variable_of("threads")).is_some_and(|t| t != "0" && !t.is_empty()) {
        return;
    }
    let here = ["OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS"]
        .iter()
        .find_map(|v| variable(v)?.parse().ok());
    let here: usize = here.unwrap_or(1).max(1);
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    let settings =
        Settings { threads: (cores / here).max(1) as u32, ..config::current().settings.clone() };
    config::replace(settings);
}

/// The first rank: it helps by its own socket, and stands before the others.
fn coordinate_job(
    common: &CommonArgs,
    args: &ServeRaysArgs,
    comm: &mut MpiComm,
    over: &Arc<AtomicBool>,
) -> anyhow::Result<()> {
    let (own, own_socket) = BoundSocket::bind(&args.socket)?;
    let mut sockets = vec![own_socket];
    let mut listeners = Vec::new();
    for rank in 1..comm.size() {
        let mut name = args.socket.clone().into_os_string();
        name.push(format!(".{rank}"));
        let (listener, socket) = BoundSocket::bind(Path::new(&name))?;
        listeners.push(listener);
        sockets.push(socket);
    }
    let names: Vec<String> = sockets.iter().map(|s| s.0.display().to_string()).collect();
    common.note(
        0,
        format!(
            "{}: programs with {SOCKETS}={} are helped; Ctrl-C ends",
            comm.library_version(),
            names.join(":")
        ),
    );
    let flag = over.clone();
    let own = std::thread::spawn(move || accept(&own, &flag));
    let led = coordinate_group(comm, listeners, over);
    over.store(true, Relaxed);
    let helped = own.join().unwrap_or(Ok(()));
    drop(sockets);
    led?;
    helped
}
