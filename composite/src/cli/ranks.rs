//! Where the ranks of a job run, and how they are started.
use super::{mpirun, smpirun};
use crate::comm::mpi::{Abi, MpiComm, launcher};
use crate::comm::{CommError, Communicator, sim, threads};
use crate::error::CompositeError;
use datasets::cli::{CommonArgs, Status, UsageError};
use std::ffi::OsString;
use std::io::Write as _;
use std::num::NonZeroU32;
use std::time::Duration;

/// The largest job: more threads or processes on one machine measure nothing.
const MOST_RANKS: usize = 4096;

/// The network of `--model`, which is that of `--smpi`.
const MODEL: sim::Network = sim::Network::QDR_AS_SMPI;

/// Groups that are made and dropped before the one that works.
const GROUPS_BEFORE: usize = 5;

/// What every job takes.
#[derive(Debug, clap::Args)]
pub(super) struct RankArgs {
    /// Number of ranks; under an MPI launcher those it has started. `compare` takes several, such
    /// as 2,4,8
    #[arg(long, short = 'n', value_name = "N", value_delimiter = ',')]
    ranks: Vec<usize>,
    /// Ranks are threads of this process (the default)
    #[arg(long, group = "where")]
    threads: bool,
    /// Ranks are processes of an MPI job; mpirun is started unless a launcher has started this
    #[arg(long, group = "where")]
    mpi: bool,
    /// Ranks are simulated by SimGrid on a network of 4X QDR InfiniBand
    #[arg(long, group = "where")]
    smpi: bool,
    /// Ranks are simulated in this process, by a model (LogGP) of the same network; needs nothing
    /// installed
    #[arg(long, group = "where")]
    model: bool,
    /// Longest wait for one message, in seconds
    #[arg(long, default_value_t = 60.0, value_name = "SECONDS")]
    timeout: f64,
    /// Cut messages over MPI into chunks of this many bytes, as those of more than 64 MiB are
    #[arg(long, hide = true, default_value_t = 1 << 26)]
    chunk_bytes: usize,
    /// Split the ranks of an MPI job into this many groups, which all do the same at once, each
    /// with a communicator of its own; the first group reports
    #[arg(long, hide = true, default_value_t = NonZeroU32::MIN)]
    groups: NonZeroU32,
    /// All ranks but the last wait this many milliseconds after each collective in shared memory,
    /// on a busy machine
    #[arg(long, hide = true, default_value_t = 0)]
    linger_ms: u64,
}

/// One rank on any transport.
pub(super) enum RankComm {
    Thread(threads::ThreadComm),
    Mpi(Box<MpiComm>),
    Model(sim::SimComm),
}

impl RankComm {
    pub(super) fn comm(&mut self) -> &mut dyn Communicator {
        match self {
            Self::Thread(comm) => comm,
            Self::Mpi(comm) => &mut **comm,
            Self::Model(comm) => comm,
        }
    }

    /// Number of machines that the ranks are on.
    pub(super) fn nodes(&mut self) -> usize {
        match self {
            Self::Thread(_) => 1,
            Self::Mpi(comm) => comm.nodes().iter().max().map_or(0, |last| last + 1),
            Self::Model(comm) => comm.size(),
        }
    }

    /// Whether no other rank runs in this process.
    pub(super) fn is_a_process(&self) -> bool {
        match self {
            Self::Mpi(comm) => comm.abi() != Abi::Smpi,
            Self::Thread(_) | Self::Model(_) => false,
        }
    }

    /// Name of the transport.
    pub(super) fn transport(&self) -> String {
        match self {
            Self::Thread(_) => "threads".to_string(),
            Self::Mpi(comm) => comm.library_version().to_string(),
            Self::Model(_) => format!("a model (LogGP) of {}", MODEL.name),
        }
    }

    fn location(&self) -> String {
        match self {
            Self::Thread(comm) => format!("rank {}", comm.rank()),
            Self::Mpi(comm) => format!("rank {} on {}", comm.rank(), comm.processor_name()),
            Self::Model(comm) => format!("modelled rank {}", comm.rank()),
        }
    }
}

impl RankArgs {
    pub(super) fn timeout(&self) -> Duration {
        Duration::from_secs_f64(self.timeout.clamp(0.001, 1e6))
    }

    /// The caveat of every number from simulated ranks.
    pub(super) fn caveat(&self) -> Option<String> {
        if smpirun::inside() {
            return Some(smpirun::CAVEAT.to_string());
        }
        self.model.then(|| {
            "network by a model (LogGP, fair shares of every adapter) of 4X QDR InfiniBand, 3.2 \
             GB/s; computing measured on this machine's cores"
                .to_string()
        })
    }

    /// Simulated ranks share this machine's processors, so a frame of all of them takes long.
    pub(super) fn is_simulated(&self) -> bool {
        self.smpi || self.model
    }

    /// The requested numbers of ranks.
    pub(super) fn counts(&self) -> &[usize] {
        &self.ranks
    }

    /// Whether this process is one of the ranks already: a launcher of MPI has started it, and
    /// nothing else is asked for.
    pub(super) fn is_rank(&self) -> bool {
        let elsewhere = self.threads || self.smpi || self.model;
        smpirun::inside() || (!elsewhere && launcher::launched(launcher::variable))
    }

    /// Whether ranks are threads of this process that all run at once.
    pub(super) fn are_threads(&self) -> bool {
        !(self.mpi || self.smpi || self.model || self.is_rank())
    }

    pub(super) fn count(&self) -> Result<usize, UsageError> {
        if self.ranks.len() > 1 {
            return Err(UsageError(format!(
                "--ranks {:?}: this takes one number of ranks",
                self.ranks
            )));
        }
        match self.ranks.first().copied().unwrap_or(4) {
            0 => Err(UsageError("0 ranks can do nothing; give at least 1".to_string())),
            many if many > MOST_RANKS => Err(UsageError(format!(
                "{many} ranks on one machine are too many; give at most {MOST_RANKS}"
            ))),
            ranks => Ok(ranks),
        }
    }

    /// Does `work` on every rank, starting them if this process is not one, and passes the result
    /// of rank 0 to `finish`. `arguments` are this program's own, for processes that are to do the
    /// same.
    pub(super) fn run<T: Send>(
        &self,
        common: CommonArgs,
        arguments: &[OsString],
        work: impl Fn(&mut RankComm) -> anyhow::Result<T> + Sync,
        finish: impl FnOnce(T) -> anyhow::Result<Status>,
    ) -> anyhow::Result<Status> {
        if self.is_rank() {
            return self.run_as_rank(work, finish);
        }
        let ranks = self.count()?;
        if self.mpi {
            return mpirun::start(common, ranks, arguments);
        }
        if self.smpi {
            return smpirun::start(common, ranks, arguments);
        }
        let on_rank = |mut comm: RankComm| {
            let result = work(&mut comm);
            if let Err(error) = &result {
                comm.comm().abort(&format!("{error:#}"));
            }
            result
        };
        let results = if self.model {
            // One rank computes at a time, so that ranks do not disturb each other.
            let measured = sim::Compute::Measured(1.0);
            sim::run_on(ranks, MODEL, measured, 1, |comm| on_rank(RankComm::Model(comm)))
        } else {
            threads::run(ranks, |comm| on_rank(RankComm::Thread(comm)))
        };
        let mut root = None;
        let mut first_error: Option<anyhow::Error> = None;
        for (rank, result) in results.into_iter().enumerate() {
            match result.map_err(anyhow::Error::from).and_then(|inner| inner) {
                Ok(value) if rank == 0 => root = Some(value),
                Ok(_) => {}
                // All ranks report that the group was aborted; the rank that gave up reports why.
                Err(error) => {
                    if first_error.as_ref().is_none_or(is_echo) {
                        // A usage error is not specific to a rank.
                        let of_all = error.is::<UsageError>();
                        first_error = Some(if of_all {
                            error
                        } else {
                            error.context(format!("rank {rank}"))
                        });
                    }
                }
            }
        }
        match (first_error, root) {
            (Some(error), _) => Err(error),
            (None, Some(value)) => finish(value),
            (None, None) => Ok(Status::Success),
        }
    }

    fn run_as_rank<T>(
        &self,
        work: impl Fn(&mut RankComm) -> anyhow::Result<T>,
        finish: impl FnOnce(T) -> anyhow::Result<Status>,
    ) -> anyhow::Result<Status> {
        let world = MpiComm::with_chunks(self.chunk_bytes)?;
        if let Some(wanted) = self.ranks.first().copied().filter(|n| *n != world.size()) {
            let size = world.size();
            return end_with(
                RankComm::Mpi(Box::new(world)),
                UsageError(format!(
                    "--ranks {wanted}, but the launcher has started {size}: leave --ranks out, or \
                     start {wanted}"
                ))
                .into(),
            );
        }
        let color = world.rank() as u32 % self.groups;
        let first_group = color == 0;
        // The job's communicator is kept: it was made first, and ends MPI last.
        let (mut comm, _world) = if self.groups.get() == 1 {
            (Box::new(world), None)
        } else {
            let group = || world.split(color, 0);
            // Groups that came and went leave nothing behind.
            for _ in 0..GROUPS_BEFORE {
                group()?;
            }
            (Box::new(group()?), Some(world))
        };
        #[cfg(target_os = "linux")]
        if comm.rank() + 1 < comm.size() {
            comm.delay_after_collectives(Duration::from_millis(self.linger_ms));
        }
        let mut comm = RankComm::Mpi(comm);
        match work(&mut comm) {
            Ok(value) if first_group && comm.comm().rank() == 0 => finish(value),
            Ok(_) => Ok(Status::Success),
            Err(error) => end_with(comm, error),
        }
    }
}

/// Reports the error of a rank of an MPI job, and ends the job.
fn end_with(mut comm: RankComm, error: anyhow::Error) -> anyhow::Result<Status> {
    // In one write: all ranks write here, and separate writes would be interleaved.
    let line = format!("error: {}: {error:#}\n", comm.location());
    let _ = std::io::stderr().write_all(line.as_bytes());
    comm.comm().abort(&format!("{error:#}"));
    let status = if error.is::<UsageError>() { Status::Usage } else { Status::Failure };
    if let RankComm::Mpi(comm) = comm {
        comm.end_job(status as i32);
    }
    Ok(status)
}

/// Whether an error only says that another rank has one.
fn is_echo(error: &anyhow::Error) -> bool {
    let of_comm =
        |error: &CommError| matches!(error, CommError::Aborted { .. } | CommError::PeerLost { .. });
    error.chain().any(|cause| {
        cause.downcast_ref::<CommError>().is_some_and(of_comm)
            || matches!(
                cause.downcast_ref::<CompositeError>(),
                Some(CompositeError::Comm(inner)) if of_comm(inner)
            )
    })
}
