//! How the rows of a call are shared out to threads. Answers do not depend on it.

use crate::work::Length;
use rayon::prelude::*;

/// Calls of so few rows run on the thread that calls: to wake others takes some 50 µs, and half of
/// these rows little more.
const FEW: usize = 1024;
/// Calls of so many rows take long.
const MANY: usize = 1 << 14;

/// Rows that a thread takes at a time: a set of rays that go in turns, or several.
pub(crate) fn part_size(rows: usize) -> usize {
    match rows {
        0..=FEW => FEW,
        _ if rows < MANY / 2 => 256,
        _ => 1024,
    }
}

pub(crate) fn length_of(rows: usize) -> Length {
    match rows {
        0..=FEW => Length::Immediate,
        _ if rows < MANY => Length::Short,
        _ => Length::Long,
    }
}

/// Points that a thread takes at a time: their way to the closest surface takes longer than a ray.
pub(crate) const POINTS: usize = 32;

pub(crate) fn length_of_points(points: usize) -> Length {
    match points {
        0..=POINTS => Length::Immediate,
        _ if points < MANY => Length::Short,
        _ => Length::Long,
    }
}

/// Does the work of each part, with what each thread has for itself; on this thread alone where
/// there is only one part.
pub(crate) fn for_each<P: Send, S>(
    parts: Vec<P>,
    scratch: impl Fn() -> S + Sync + Send,
    work: impl Fn(&mut S, P) + Sync + Send,
) {
    if parts.len() > 1 {
        parts.into_par_iter().for_each_init(scratch, work);
    } else {
        let mut own = scratch();
        parts.into_iter().for_each(|part| work(&mut own, part));
    }
}

/// The answers to `count` questions, in order.
pub(crate) fn map<R: Send>(count: usize, work: impl Fn(usize) -> R + Sync + Send) -> Vec<R> {
    if count > 1 {
        (0..count).into_par_iter().map(work).collect()
    } else {
        (0..count).map(work).collect()
    }
}
