//! Milliseconds per frame over threads, by workload, format and instruction set, with IceT's
//! columns.
//!
//! Ranks are threads of this process and share its cores, so the numbers are costs of computation
//! and copying, not of a network. Variants of one line run alternately, frame by frame, so that
//! other load on the machine affects all of them equally.
//!
//! `cargo bench -p composite --bench paths -- [SIZE] [RANKS…] [WORDS…]`
use composite::{
    Communicator, CompositeError, Compositor, DepthPixel, Frame, Image, Options,
    PremultipliedPixel, Rect, Report, SimdLevel, Strategy, composite_shared, shared_memory_group,
    threads,
};
use mix64::mix64;
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

#[path = "../src/mix64.rs"]
mod mix64;

/// One rank's frame: colours, depths, where it drew.
struct Picture {
    colors: Vec<[u8; 4]>,
    floats: Vec<[f32; 4]>,
    depths: Vec<f32>,
    bounds: Rect,
}

/// `dense`: every pixel of every rank; `discs`: a disc per rank, about two layers deep; `frag`: a
/// sixth of their pixels, in runs of three.
fn picture(scene: &str, rank: usize, ranks: usize, size: u32) -> Picture {
    let n = size as usize;
    let mut made = Picture {
        colors: vec![[0; 4]; n * n],
        floats: vec![[0.0; 4]; n * n],
        depths: vec![1.0; n * n],
        bounds: Rect::EMPTY,
    };
    let side = (1..).find(|s: &usize| s * s * s >= ranks).unwrap_or(1);
    let (i, j, k) = (rank % side, rank / side % side, rank / side / side);
    let center = |index: usize| ((index as f32 + 0.5) / side as f32 - 0.5) * 0.8;
    let (cx, cy) = (0.5 + center(i) + 0.2 * center(k), 0.5 + center(j) + 0.1 * center(k));
    let radius = 0.5 / side as f32;
    for y in 0..n {
        for x in 0..n {
            let (u, v) = ((x as f32 / n as f32 - cx) / radius, (y as f32 / n as f32 - cy) / radius);
            let inside = match scene {
                "dense" => true,
                "discs" => u * u + v * v < 1.0,
                _ => {
                    u * u + v * v < 1.0
                        && mix64(((y * n + x) / 3) as u64 * 131 + rank as u64).is_multiple_of(6)
                }
            };
            if inside {
                let at = y * n + x;
                let depth = 0.5
                    + 0.1 * (u * v).sin() * 0.1
                    + 0.3 * mix64(rank as u64) as f32 / u64::MAX as f32;
                made.depths[at] = depth;
                made.colors[at] = [rank as u8, x as u8, y as u8, 255];
                made.floats[at] = [0.1, 0.2, depth * 0.3, 0.4];
                let pixel = Rect { x0: x as u32, y0: y as u32, x1: x as u32 + 1, y1: y as u32 + 1 };
                made.bounds = made.bounds.around(&pixel);
            }
        }
    }
    made
}

/// Milliseconds of processor time of all threads of this process.
fn cpu_ms() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 / 1e6
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn z_frame(size: u32, picture: &Picture) -> Result<Frame<'_, DepthPixel<[u8; 4]>>, CompositeError> {
    Frame::with_depth(size, size, &picture.colors, &picture.depths)?.with_bounds(picture.bounds)
}

fn f32_frame(
    size: u32,
    picture: &Picture,
) -> Result<Frame<'_, PremultipliedPixel<[f32; 4]>>, CompositeError> {
    Frame::premultiplied(size, size, &picture.floats)?.with_bounds(picture.bounds)
}

/// The variant in which one call merges all frames in shared memory, while the ranks wait.
const SHARED: &str = "shared merge";

fn main() {
    let cores = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    let arguments = || std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned());
    let numbers: Vec<usize> = arguments().filter_map(|word| word.parse().ok()).collect();
    // Other words select lines whose workload or variant contains them.
    let words: Vec<String> =
        arguments().filter(|w| w.parse::<usize>().is_err() && w != "--bench").collect();
    let size = numbers.first().copied().unwrap_or(1024) as u32;
    let counts = if numbers.len() > 1 { numbers[1..].to_vec() } else { vec![2, 4, 8] };
    let frames = 24;
    println!(
        "{size}x{size}, {frames} frames, medians in ms; columns of rank 0: compress, blend, send, \
         collect"
    );
    for scene in ["discs", "frag", "dense"] {
        for &ranks in &counts {
            let base = Options { depth: false, ..Options::default() };
            let mut variants: Vec<(String, bool, Options)> = Vec::new();
            for level in SimdLevel::available() {
                variants.push((
                    format!("z {}", level.name()),
                    false,
                    Options { simd: Some(level), ..base.clone() },
                ));
            }
            for strategy in [Strategy::BinarySwap, Strategy::RadixK { k: 8 }] {
                variants.push((
                    format!("z {strategy:?}"),
                    false,
                    Options { strategy, ..base.clone() },
                ));
            }
            variants.push(("z checksums".into(), false, Options { verify: true, ..base.clone() }));
            for slice_px in [1 << 14, 1 << 18, usize::MAX] {
                variants.push((
                    format!("z slice {slice_px}"),
                    false,
                    Options { slice_px: Some(slice_px), ..base.clone() },
                ));
            }
            variants.push((format!("z {SHARED}"), false, base.clone()));
            variants.push(("z table".into(), false, base.clone()));
            variants.push(("f32 blend".into(), true, base.clone()));
            variants.push((format!("f32 blend {SHARED}"), true, base.clone()));
            variants.push((
                "f32 blend avx2".into(),
                true,
                Options { simd: Some(SimdLevel::Avx2), ..base.clone() },
            ));
            variants.retain(|v| words.iter().all(|word| format!("{scene} {}", v.0).contains(word)));
            if variants.is_empty() {
                continue;
            }
            let pictures: Vec<Picture> =
                (0..ranks).map(|rank| picture(scene, rank, ranks, size)).collect();
            let times = Mutex::new(vec![Vec::<(f64, f64, Report)>::new(); variants.len()]);
            let members: Vec<_> = shared_memory_group(ranks)
                .into_iter()
                .map(|shared_rank| Mutex::new(Some(shared_rank)))
                .collect();
            let images: Vec<Arc<Image<DepthPixel<[u8; 4]>>>> = pictures
                .iter()
                .map(|p| {
                    Arc::new(
                        Image::from_planes(size, size, p.colors.clone(), p.depths.clone()).unwrap(),
                    )
                })
                .collect();
            let results = threads::run(ranks, |mut comm| {
                let mut own_shared_rank = None;
                let rank = comm.rank();
                let picture = &pictures[rank];
                let (z, f) = (z_frame(size, picture)?, f32_frame(size, picture)?);
                let (mut z_spare, mut f_spare) = (None, None);
                let mut of_z: Vec<Compositor<DepthPixel<[u8; 4]>>> =
                    variants.iter().map(|v| Compositor::new(v.2.clone())).collect();
                let mut of_f: Vec<Compositor<PremultipliedPixel<[f32; 4]>>> =
                    variants.iter().map(|v| Compositor::new(v.2.clone())).collect();
                for frame in 0..frames + 2 {
                    for (index, (name, blend, options)) in variants.iter().enumerate() {
                        comm.barrier(options.timeout)?;
                        let (begin, cpu_begin) = (comm.now(), cpu_ms());
                        let report = if name.ends_with(SHARED) {
                            if rank == 0 {
                                if *blend {
                                    let frames = pictures
                                        .iter()
                                        .map(|p| f32_frame(size, p))
                                        .collect::<Result<Vec<_>, _>>()?;
                                    f_spare = Some(composite_shared(
                                        &frames,
                                        cores,
                                        false,
                                        f_spare.take(),
                                    )?);
                                } else {
                                    let frames = pictures
                                        .iter()
                                        .map(|p| z_frame(size, p))
                                        .collect::<Result<Vec<_>, _>>()?;
                                    z_spare = Some(composite_shared(
                                        &frames,
                                        cores,
                                        false,
                                        z_spare.take(),
                                    )?);
                                }
                            }
                            Report::default()
                        } else if name == "z table" {
                            let shared_rank = own_shared_rank.get_or_insert_with(|| {
                                members[rank].lock().unwrap().take().unwrap()
                            });
                            let done = shared_rank.composite(
                                &mut comm,
                                &images[rank],
                                picture.bounds,
                                options,
                            )?;
                            if let Some(image) = done.image {
                                shared_rank.recycle(image);
                            }
                            done.report
                        } else if *blend {
                            let done = of_f[index].composite(&mut comm, &f)?;
                            if let Some(image) = done.image {
                                of_f[index].recycle(image);
                            }
                            done.report
                        } else {
                            let done = of_z[index].composite(&mut comm, &z)?;
                            if let Some(image) = done.image {
                                of_z[index].recycle(image);
                            }
                            done.report
                        };
                        let elapsed = comm.now() - begin;
                        comm.barrier(options.timeout)?;
                        let cpu = cpu_ms() - cpu_begin;
                        if rank == 0 && frame >= 2 {
                            times.lock().unwrap()[index].push((elapsed, cpu, report));
                        }
                    }
                }
                Ok::<_, CompositeError>(())
            });
            for result in results {
                result.unwrap().unwrap();
            }
            for ((name, ..), times) in variants.iter().zip(times.into_inner().unwrap()) {
                let of = |column: fn(&Report) -> f64| {
                    1e3 * median(times.iter().map(|(.., r)| column(r)).collect())
                };
                println!(
                    "{scene:6} p={ranks:<3} {name:24} {:7.2} cpu {:7.2} | {:6.2} {:6.2} {:6.2} \
                     {:6.2} | {:.2} MB sent by rank 0",
                    1e3 * median(times.iter().map(|t| t.0).collect()),
                    median(times.iter().map(|t| t.1).collect()),
                    of(|r| r.compress_secs),
                    of(|r| r.blend_secs),
                    of(|r| r.exchange_secs),
                    of(|r| r.collect_secs),
                    times[0].2.bytes_sent as f64 / 1e6,
                );
            }
        }
    }
    if words.is_empty() || words.iter().any(|word| word == "stream") {
        counts.iter().for_each(|&ranks| streamed(ranks, size));
    }
}

/// A frame whose rendering only waits (as for another device or other cores), in 16 tiles: rendered
/// and then composited, or streamed.
fn streamed(ranks: usize, size: u32) {
    const RENDER: Duration = Duration::from_millis(48);
    let pictures: Vec<Picture> =
        (0..ranks).map(|rank| picture("dense", rank, ranks, size)).collect();
    let times = Mutex::new([Vec::new(), Vec::new(), Vec::new()]);
    let results = threads::run(ranks, |mut comm| {
        let rank = comm.rank();
        let frame = z_frame(size, &pictures[rank])?;
        let mut compositor = Compositor::new(Options { depth: false, ..Options::default() });
        for repeat in 0..10 {
            for kind in 0..3 {
                comm.barrier(Duration::from_secs(60))?;
                let begin = Instant::now();
                let image = if kind < 2 {
                    if kind == 0 {
                        std::thread::sleep(RENDER);
                    }
                    compositor.composite(&mut comm, &frame)?.image
                } else {
                    let mut stream =
                        compositor.stream(&mut comm, (size, size), Rect::of_size(size, size))?;
                    for tile in 0..16 {
                        // The time of compositing does not delay rendering, which continues
                        // elsewhere.
                        std::thread::sleep(
                            (RENDER * (tile + 1) / 16).saturating_sub(begin.elapsed()),
                        );
                        let row = |i: u32| size * i / 16;
                        stream.tile_done(
                            &frame,
                            Rect { x0: 0, y0: row(tile), x1: size, y1: row(tile + 1) },
                        )?;
                    }
                    stream.finish(&frame)?.image
                };
                comm.barrier(Duration::from_secs(60))?;
                if rank == 0 && repeat > 1 {
                    times.lock().unwrap()[kind].push(1e3 * begin.elapsed().as_secs_f64());
                }
                if let Some(image) = image {
                    compositor.recycle(image);
                }
            }
        }
        Ok::<_, CompositeError>(())
    });
    results.into_iter().for_each(|result| result.unwrap().unwrap());
    let [after, alone, streamed] = times.into_inner().unwrap().map(median);
    println!(
        "stream dense p={ranks:<3} rendering {:.0} ms, compositing {alone:.1} ms; one after the \
         other {after:.1} ms, streamed {streamed:.1} ms",
        RENDER.as_secs_f64() * 1e3
    );
}
