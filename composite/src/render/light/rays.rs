//! Rays that go from brick to brick: rounds of moving the first of those at hand and exchanging
//! those that left.
use super::gas::{GasValues, Optical};
use super::wire::{EXIT_WORDS, RAY_WORDS, push_exit, push_ray, read_exit, read_ray};
use super::{LightOptions, LightReport, Setup};
use crate::render::FrameError;
use crate::render::request_reply::{RankChannel, Tag};
use rayon::prelude::*;
use rt_core::glam::{DVec3, UVec3};
use rt_core::volume::Brick;
use schlieren::film::traced::{corners, start_of_corner};
use schlieren::march::{Progress, RayState};
use schlieren::path::{Exit, Start};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Rays between two signs of life.
const BATCH: usize = 512;

/// Rounds in which a rank would move the rays of all corners. With few, ranks wait for those that
/// have the rays first: with one, bricks one behind the other along the light work one after the
/// other. With many, ranks wait for each other more often, for as long as a small message takes.
const SHARES: usize = 32;

/// A ray that this rank has: its number, and its state.
type Ray = (u32, RayState);

/// Traces the rays of all corners. The root gets their exits.
///
/// # Errors
/// Of messages and of the transport.
pub(super) fn trace<V: GasValues>(
    channel: &mut RankChannel<'_>,
    setup: &Setup,
    bricks: &[Brick],
    own: Option<&Optical<'_, V>>,
    options: &LightOptions,
) -> Result<(Option<Vec<Exit>>, LightReport), FrameError> {
    let (rank, size) = (channel.rank(), channel.size());
    let count = corners(&setup.framing);
    let start = |number: u32| start_of_corner(&setup.framing, number as usize);
    let mut report = LightReport { rays: count as u64, ..LightReport::default() };
    let mut rays: VecDeque<Ray> =
        own.map_or(Vec::new(), |_| first_rays(setup, bricks, rank)).into();
    let mut left = Vec::new();
    let share = count.div_ceil(SHARES).max(BATCH);
    // Rays are moved in the order in which they came, and a rank never has more than all. So each
    // takes a sample at least every so many rounds, and honest ranks need no more rounds than this.
    let most_rounds = count.div_ceil(share) as u64 * u64::from(setup.march.most_samples());
    loop {
        // ---- The first rays at hand, as far as this brick goes.
        let round: Vec<Ray> = rays.drain(..rays.len().min(share)).collect();
        report.rays_moved += round.len() as u64;
        let moved = match own {
            Some(own) => move_rays(channel, setup, own, round, options),
            None => Vec::new(),
        };
        let mut outgoing: Vec<Vec<u32>> = vec![Vec::new(); size];
        for ((number, state), progress) in moved {
            match progress {
                Progress::Left(exit) => push_exit(&mut left, number, &exit),
                Progress::NeedsCell(cell) => {
                    // Together the bricks have every cell, which all ranks have checked.
                    let to = owner(bricks, cell).unwrap_or(rank);
                    push_ray(&mut outgoing[to], number, &state);
                    report.rays_sent += 1;
                }
            }
        }
        // ---- Those that left it.
        let mut lengths: Vec<u32> = outgoing.iter().map(|words| words.len() as u32).collect();
        lengths.push(rays.len() as u32);
        let lengths = channel.all_gather(&lengths)?;
        if lengths.iter().flatten().all(|length| *length == 0) {
            break;
        }
        if u64::from(report.rounds) >= most_rounds {
            let from = lengths.iter().position(|l| l.iter().any(|n| *n > 0)).unwrap_or(rank);
            let reason = format!("rays of light after {most_rounds} rounds: no ray needs so many");
            return Err(channel.announced_error(from, reason));
        }
        report.rounds += u32::from(size > 1);
        for step in 1..size {
            let to = (rank + step) % size;
            if !outgoing[to].is_empty() {
                channel.send_request(to, &outgoing[to])?;
            }
        }
        let mut sources = Vec::new();
        for (from, to) in lengths.iter().enumerate().filter(|(from, _)| *from != rank) {
            let words = to[rank] as usize;
            if !words.is_multiple_of(RAY_WORDS) || words / RAY_WORDS > count {
                let reason = format!("{words} words for rays of light, of which there are {count}");
                return Err(channel.announced_error(from, reason));
            }
            if words > 0 {
                sources.push((from, words));
            }
        }
        channel.receive_requests("rays of light", sources, |channel, from, words| {
            let fault = || channel.message_error(from, "rays of light", words.len());
            for chunk in words.as_chunks().0 {
                let (number, state) = read_ray(chunk);
                let is_ray = (number as usize) < count
                    && rays.len() < count
                    && own.is_some()
                    && setup.march.is_possible(&start(number), &state);
                if !is_ray {
                    return Err(fault());
                }
                rays.push_back((number, state));
            }
            Ok(())
        })?;
    }
    Ok((collect(channel, setup, options.root, count, &left)?, report))
}

/// The first rank that has a cell.
fn owner(bricks: &[Brick], cell: [usize; 3]) -> Option<usize> {
    let cell = UVec3::from(cell.map(|c| c as u32));
    bricks.iter().position(|brick| brick.contains(cell))
}

/// The rays that begin in this rank's cells.
fn first_rays(setup: &Setup, bricks: &[Brick], rank: usize) -> Vec<Ray> {
    let (march, framing) = (&setup.march, &setup.framing);
    let Some([columns, rows]) = shadow(setup, &bricks[rank]) else { return Vec::new() };
    let mut rays = Vec::new();
    for row in rows[0]..rows[1] {
        for column in columns[0]..columns[1] {
            let number = row * (framing.width + 1) + column;
            let start = start_of_corner(framing, number as usize);
            let begins = march.entry_cell(&start).and_then(|cell| owner(bricks, cell));
            if begins == Some(rank) {
                rays.push((number, RayState::default()));
            }
        }
    }
    rays
}

/// The columns and rows of corners whose straight rays meet a brick, and some around them.
fn shadow(setup: &Setup, brick: &Brick) -> Option<[[u32; 2]; 2]> {
    if brick.is_empty() {
        return None;
    }
    let (view, framing) = (setup.march.view(), &setup.framing);
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for k in 0..8 {
        let pick = |c: usize| if k >> c & 1 == 0 { brick.first[c] } else { brick.end[c] };
        let node = UVec3::new(pick(0), pick(1), pick(2)).as_dvec3();
        let at = setup.march.position_m(node) - view.centre_m;
        let along = |axis: DVec3, centre: f64| (at.dot(axis) - centre) / framing.pixel_m;
        let column = along(view.right, framing.center_m[0]) + 0.5 * f64::from(framing.width);
        let row = 0.5 * f64::from(framing.height) - along(view.up, framing.center_m[1]);
        for (c, v) in [column, row].into_iter().enumerate() {
            (low[c], high[c]) = (low[c].min(v), high[c].max(v));
        }
    }
    let corners = [framing.width + 1, framing.height + 1].map(f64::from);
    let range = |c: usize| {
        [(low[c] - 1.0).floor(), (high[c] + 2.0).ceil()].map(|v| v.clamp(0.0, corners[c]) as u32)
    };
    Some([range(0), range(1)])
}

/// Moves rays through this rank's brick.
fn move_rays<V: GasValues>(
    channel: &mut RankChannel<'_>,
    setup: &Setup,
    own: &Optical<'_, V>,
    rays: Vec<Ray>,
    options: &LightOptions,
) -> Vec<(Ray, Progress)> {
    let advance = |rays: &[Ray]| {
        let started = |&(number, state): &Ray| {
            let start: Start = start_of_corner(&setup.framing, number as usize);
            (start, state)
        };
        let mut states: Vec<(Start, RayState)> = rays.iter().map(started).collect();
        let mut progress = vec![None; rays.len()];
        setup.march.advance_all(&mut states, own, |i, how_far| progress[i] = Some(how_far));
        let moved = rays.iter().zip(states).zip(progress);
        moved
            .filter_map(|((ray, (_, state)), how_far)| Some(((ray.0, state), how_far?)))
            .collect::<Vec<_>>()
    };
    if options.parallel {
        return channel.in_background(|steps: &AtomicUsize| {
            let batch = |rays: &[Ray]| {
                steps.fetch_add(1, Ordering::Relaxed);
                advance(rays)
            };
            rays.par_chunks(BATCH).flat_map_iter(batch).collect()
        });
    }
    let mut moved = Vec::with_capacity(rays.len());
    for batch in rays.chunks(BATCH) {
        moved.extend(advance(batch));
        channel.alive();
    }
    moved
}

/// The exits of all rays, on the root.
fn collect(
    channel: &mut RankChannel<'_>,
    setup: &Setup,
    root: usize,
    count: usize,
    left: &[u32],
) -> Result<Option<Vec<Exit>>, FrameError> {
    let rank = channel.rank();
    let lengths = channel.all_gather(&[left.len() as u32])?;
    if rank != root {
        if !left.is_empty() {
            channel.send(root, Tag::Tiles, left)?;
        }
        return Ok(None);
    }
    let mut sources = Vec::new();
    for (from, length) in lengths.iter().enumerate().filter(|(from, _)| *from != rank) {
        let words = length[0] as usize;
        if !words.is_multiple_of(EXIT_WORDS) || words / EXIT_WORDS > count {
            let reason = format!("{words} words for exits of light, of which there are {count}");
            return Err(channel.announced_error(from, reason));
        }
        if words > 0 {
            sources.push((from, words));
        }
    }
    let start = |number: usize| start_of_corner(&setup.framing, number);
    let mut exits = vec![None; count];
    let mut take = |words: &[u32]| {
        let (chunks, rest) = words.as_chunks();
        rest.is_empty()
            && chunks.iter().all(|chunk| {
                let Some((number, exit)) = read_exit(chunk) else { return false };
                let slot = exits.get_mut(number as usize).filter(|slot| slot.is_none());
                let exit_depth_m = setup.march.exit_depth_m(&start(number as usize)) as f32;
                slot.map(|slot| *slot = Some(Exit { exit_depth_m, ..exit })).is_some()
            })
    };
    let mut is_right = take(left);
    channel.receive(Tag::Tiles, "exits of light", sources, |channel, from, words| {
        is_right &= take(&words) && words.len() == lengths[from][0] as usize;
        match is_right {
            true => Ok(()),
            false => Err(channel.message_error(from, "exits of light", words.len())),
        }
    })?;
    // Rays beside the gas are nobody's; all others must have arrived.
    let mut all = Vec::with_capacity(count);
    for (number, exit) in exits.into_iter().enumerate() {
        let is_beside = || setup.march.entry_cell(&start(number)).is_none();
        match exit {
            Some(exit) => all.push(exit),
            None if is_beside() => all.push(Exit::UNDISTURBED),
            None => return Err(channel.message_error(rank, "exits of light", left.len())),
        }
    }
    Ok(Some(all))
}
