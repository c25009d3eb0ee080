//! `composite check`: does every strategy give the bits of the serial reference over this machine's
//! transport? For tests it also injects faults.
use super::first_ranks::FirstRanks;
use super::hard_cases::{self, SLOW};
use super::ranks::{RankArgs, RankComm};
use crate::comm::Communicator;
use crate::compositor::{Compositor, Options, composite};
use crate::frame::Frame;
use crate::pixel::{Composite, DepthPixel, PremultipliedPixel};
use crate::reference::composite_serial;
use crate::strategies::Strategy;
use crate::workload::{SyntheticFrame, Workload};
use datasets::cli::{CommonArgs, Status, UsageError};
use serde::Serialize;
use std::ffi::OsString;
use std::time::{Duration, Instant};

/// Arguments of `composite check`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    composite check --ranks 5 --mpi\n  \
    composite check --ranks 9 --mpi --counts 1,2,3,5,9 --hard\n  \
    mpirun -n 64 --hostfile nodes composite check --mpi")]
pub(super) struct CheckArgs {
    #[command(flatten)]
    ranks: RankArgs,
    /// Groups of the first N ranks instead of all
    #[arg(long, value_name = "N,N,...", value_delimiter = ',')]
    counts: Vec<usize>,
    /// Also the hard cases: equal and unusual depths, every size from 1x1 to 67x5 (a share of them
    /// for each number of ranks), empty ranks
    #[arg(long)]
    hard: bool,
    /// With --hard: how often equal depths are composited
    #[arg(long, default_value_t = 1000, value_name = "TIMES")]
    repeats: u64,
    /// Let the highest rank fail in this way
    #[arg(long, hide = true)]
    fault: Option<Fault>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Fault {
    /// Ended by a signal, as when memory runs out.
    Killed,
    /// Alive, but does not communicate.
    Stalled,
    /// A panic.
    Panic,
    /// Composites another size.
    Size,
    /// Calls a barrier while the others composite.
    Order,
    /// Returns early and leaves.
    Leaves,
    /// A message of pixels arrives with a wrong bit.
    Corrupt,
    /// No fault: it renders for three timeouts, with signs of life.
    Slow,
}

/// Odd sizes, fewer pixels than ranks, and rows of more than one mask word.
const SIZES_PX: [(u32, u32); 4] = [(1, 1), (7, 3), (67, 5), (150, 41)];
const STRATEGIES: [Strategy; 5] = [
    Strategy::DirectSend,
    Strategy::Tree,
    Strategy::BinarySwap,
    Strategy::RadixK { k: 2 },
    Strategy::RadixK { k: 8 },
];

#[derive(Debug, Serialize)]
struct CheckReport {
    ranks: usize,
    transport: String,
    /// Number of machines that the ranks are on.
    nodes: usize,
    /// Numbers of ranks that were checked.
    counts: Vec<usize>,
    images: u64,
    images_differ: u64,
    /// Images that machines with several ranks merged in their memories before one rank of each
    /// sent messages; hard cases are not counted here.
    merged_by_machine: u64,
    /// Counts of the hard cases.
    hard_images: u64,
    hard_images_differ: u64,
}

pub(super) fn check(
    common: CommonArgs,
    args: &CheckArgs,
    arguments: &[OsString],
) -> anyhow::Result<Status> {
    args.ranks.run(
        common,
        arguments,
        |comm| {
            let timeout = args.ranks.timeout();
            if let Some(fault) = args.fault {
                fail(comm, fault, timeout)?;
            }
            let transport = comm.transport();
            let nodes = comm.nodes();
            let is_a_process = comm.is_a_process();
            let size = comm.comm().size();
            let counts = if args.counts.is_empty() { vec![size] } else { args.counts.clone() };
            if let Some(wrong) = counts.iter().find(|c| !(1..=size).contains(*c)) {
                let cure = format!(
                    "--counts {wrong}: there are {size} ranks; give numbers from 1 \
                                    to {size}"
                );
                return Err(UsageError(cure).into());
            }
            let (mut images, mut images_differ, mut hard) = (0, 0, [0; 2]);
            let mut merged_by_machine = 0;
            for &count in &counts {
                if counts.len() > 1 {
                    comm.comm().barrier(timeout)?;
                }
                let Some(mut group) = FirstRanks::new(comm.comm(), count) else { continue };
                for scene in Workload::ALL {
                    for size_px in SIZES_PX {
                        let options = |strategy, in_memory, order: Option<Vec<usize>>| Options {
                            strategy,
                            in_memory,
                            order,
                            timeout,
                            ..Options::default()
                        };
                        let order = Some(scene.front_to_back(1, count));
                        let mut all: Vec<Options> =
                            STRATEGIES.map(|s| options(s, true, order.clone())).into();
                        if group.shared_segments().is_some() {
                            all.push(options(Strategy::DirectSend, false, order));
                            // In the order of ranks, in which those of a machine are neighbours.
                            all.push(options(Strategy::Automatic, true, None));
                        }
                        for options in all {
                            for image in one_frame(&mut group, scene, size_px, options)? {
                                images += 1;
                                images_differ += u64::from(!image.same);
                                merged_by_machine += u64::from(image.machines > 1);
                            }
                        }
                    }
                }
                big_messages(&mut group, is_a_process, timeout)?;
                if args.hard {
                    let most = counts.len().max(1);
                    let [all, differ] = hard_cases::run(
                        &mut group,
                        &STRATEGIES,
                        true,
                        most,
                        args.repeats,
                        timeout,
                    )?;
                    hard = [hard[0] + all, hard[1] + differ];
                    if group.shared_segments().is_some() {
                        let direct = [Strategy::DirectSend];
                        let [all, differ] =
                            hard_cases::run(&mut group, &direct, false, most, 1, timeout)?;
                        hard = [hard[0] + all, hard[1] + differ];
                        let automatic = [Strategy::Automatic];
                        let [all, differ] =
                            hard_cases::run(&mut group, &automatic, true, most, 1, timeout)?;
                        hard = [hard[0] + all, hard[1] + differ];
                    }
                }
            }
            // No rank leaves while others still composite.
            comm.comm().barrier(timeout)?;
            let [hard_images, hard_images_differ] = hard;
            Ok(CheckReport {
                ranks: size,
                transport,
                nodes,
                counts,
                images,
                images_differ,
                merged_by_machine,
                hard_images,
                hard_images_differ,
            })
        },
        |checked| {
            common.result(&checked, || {
                let CheckReport {
                    ranks,
                    transport,
                    images,
                    images_differ,
                    hard_images,
                    hard_images_differ,
                    ..
                } = &checked;
                let mut text = format!(
                    "{ranks} ranks over {transport}: {images} images, {images_differ} differ from \
                     the serial reference"
                );
                if args.hard {
                    text += &format!(
                        "; hard cases: {hard_images} images, {hard_images_differ} \
                                      differ"
                    );
                }
                text
            })?;
            Ok(if checked.images_differ + checked.hard_images_differ == 0 {
                Status::Success
            } else {
                Status::Failure
            })
        },
    )
}

/// An image on rank 0.
struct CheckedImage {
    /// Whether it has the bits of the reference.
    same: bool,
    /// See [`crate::Report::machines`].
    machines: usize,
}

/// Composites one workload with depth and blended. Returns what rank 0 finds.
fn one_frame(
    comm: &mut dyn Communicator,
    scene: Workload,
    (width_px, height_px): (u32, u32),
    options: Options,
) -> anyhow::Result<Vec<CheckedImage>> {
    let (rank, ranks) = (comm.rank(), comm.size());
    let draw = |rank: usize| {
        let mut drawn = SyntheticFrame::new(width_px, height_px);
        scene.draw(1, rank, ranks, &mut drawn);
        let mut glass = Vec::new();
        drawn.premultiplied(&mut glass);
        (drawn, glass)
    };
    let (drawn, glass) = draw(rank);
    let order = options.order.clone().unwrap_or_else(|| (0..ranks).collect());
    // All ranks' frames, in the order of compositing, on the rank that compares.
    let everybody: Vec<_> =
        if rank == 0 { order.iter().map(|&rank| draw(rank)).collect() } else { Vec::new() };
    let frame = Frame::<DepthPixel<[u8; 4]>>::with_depth(
        width_px,
        height_px,
        &drawn.colors,
        &drawn.depths,
    )?;
    let depth = Compositor::new(options.clone()).with_network(SLOW).composite(comm, &frame)?;
    let frame = Frame::<PremultipliedPixel<[f32; 4]>>::premultiplied(width_px, height_px, &glass)?;
    let blend = Compositor::new(options).with_network(SLOW).composite(comm, &frame)?;

    let mut images = Vec::new();
    let mut found = |same, machines| images.push(CheckedImage { same, machines });
    if let Some(image) = depth.image {
        let frames: Result<Vec<_>, _> = everybody
            .iter()
            .map(|(drawn, _)| Frame::with_depth(width_px, height_px, &drawn.colors, &drawn.depths))
            .collect();
        found(bits_are_equal(&image, &composite_serial(&frames?)?), depth.report.machines);
    }
    if let Some(image) = blend.image {
        let frames: Result<Vec<_>, _> = everybody
            .iter()
            .map(|(_, glass)| Frame::premultiplied(width_px, height_px, glass))
            .collect();
        found(bits_are_equal(&image, &composite_serial(&frames?)?), blend.report.machines);
    }
    Ok(images)
}

fn bits_are_equal<P: Composite>(a: &crate::Image<P>, b: &crate::Image<P>) -> bool {
    a.to_bytes() == b.to_bytes()
}

/// Most memory that a receive may take before anything has arrived: what the allocator and the
/// library take in addition to its chunk.
const MOST_ROOM_BYTES: u64 = 1 << 28;

/// Bytes of this process's address space; 0 where the system does not report it.
fn address_space_bytes() -> u64 {
    let pages = std::fs::read_to_string("/proc/self/statm").ok();
    let pages = pages.and_then(|text| text.split(' ').next()?.parse::<u64>().ok());
    pages.unwrap_or(0) * 4096
}

/// Sends messages of many lengths around the ring and checks each byte.
fn big_messages(
    comm: &mut dyn Communicator,
    is_a_process: bool,
    timeout: Duration,
) -> anyhow::Result<()> {
    let (rank, size) = (comm.rank(), comm.size());
    let byte = |rank: usize, at: usize| (at.wrapping_mul(31) ^ rank ^ (at >> 8)) as u8;
    let (next, previous) = ((rank + 1) % size, (rank + size - 1) % size);
    const LENGTHS: [usize; 9] = [0, 1, 999, 1000, 1001, 2000, 65_536, 100_000, 3_000_000];
    // A posted message that does not arrive takes no memory.
    let before = address_space_bytes();
    let announced = comm.post_recv(previous, 78, 1 << 40)?;
    comm.send(next, 78, vec![rank as u8; 3])?;
    // If ranks share a process, the memory cannot be attributed to one of them.
    let more = if is_a_process { address_space_bytes().saturating_sub(before) } else { 0 };
    anyhow::ensure!(
        more <= MOST_ROOM_BYTES,
        "a message of 3 bytes was made room of {more} bytes for"
    );
    let came = comm.wait_any(&mut vec![announced], timeout)?.message;
    anyhow::ensure!(came == [previous as u8; 3], "{came:?} from rank {previous}");
    // All are posted before the first is sent, and received in the order of arrival. Behind a long
    // message, short ones could be complete before it.
    let mut reversed = LENGTHS;
    reversed.reverse();
    for (tag, lengths) in [(77, LENGTHS), (79, reversed), (77, reversed)] {
        let mut posted = Vec::new();
        for length in lengths {
            posted.push(comm.post_recv(previous, tag, length)?);
        }
        for length in lengths {
            comm.send(next, tag, (0..length).map(|at| byte(rank, at)).collect())?;
        }
        let mut seen = Vec::new();
        while !posted.is_empty() {
            let message = comm.wait_any(&mut posted, timeout)?.message;
            let good = message.iter().enumerate().all(|(at, &found)| found == byte(previous, at));
            anyhow::ensure!(
                good,
                "a message of {} bytes from rank {previous} has changed",
                message.len()
            );
            seen.push(message.len());
            comm.recycle(message);
        }
        anyhow::ensure!(seen == lengths, "messages came as {seen:?} instead of {lengths:?}");
    }
    Ok(())
}

/// The faults of the highest rank.
fn fail(comm: &mut RankComm, fault: Fault, timeout: Duration) -> anyhow::Result<()> {
    let comm = comm.comm();
    let culprit = comm.rank() + 1 == comm.size();
    if fault == Fault::Corrupt {
        // All ranks composite the same frame.
        let frame =
            Frame::<DepthPixel<[u8; 4]>>::with_depth(150, 41, &[[1; 4]; 6150], &[0.5; 6150])?;
        let options = Options { timeout, verify: true, in_memory: false, ..Options::default() };
        if culprit {
            composite(&mut FirstRanks::damaged(comm), &frame, &options)?;
        } else {
            composite(comm, &frame, &options)?;
        }
        return Ok(());
    }
    if !culprit {
        return Ok(());
    }
    match fault {
        Fault::Killed => {
            let me = std::process::id().to_string();
            std::process::Command::new("kill").args(["-9", &me]).status()?;
            Ok(())
        }
        Fault::Stalled => {
            std::thread::sleep(10 * timeout);
            Ok(())
        }
        Fault::Panic => panic!("on purpose"),
        Fault::Size => {
            let frame = Frame::<DepthPixel<[u8; 4]>>::with_depth(2, 1, &[[1; 4]; 2], &[0.5; 2])?;
            composite(comm, &frame, &Options { timeout, ..Options::default() })?;
            Ok(())
        }
        Fault::Slow => {
            let begin = Instant::now();
            while begin.elapsed() < 3 * timeout {
                std::thread::sleep(timeout / 50);
                comm.alive()?;
            }
            Ok(())
        }
        Fault::Order => Ok(comm.barrier(timeout)?),
        Fault::Corrupt | Fault::Leaves => anyhow::bail!("this rank has had enough"),
    }
}
