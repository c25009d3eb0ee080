//! Time of this thread, this process and the wall clock.
//!
//! On a shared machine, wall-clock time includes the load of other users. A thread's CPU time does
//! not advance while the thread waits for a core, so it is used to compare single-threaded
//! variants. With several threads, the wall clock measures how long a user waits, and the process's
//! CPU time shows how much of the machine was used.

use rustix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// The clock that a comparison uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Clock {
    /// CPU time of the calling thread, for work on one thread.
    ThreadCpu,
    /// CPU time of all threads of the process.
    ProcessCpu,
    /// Wall-clock time, for work on several threads.
    Wall,
}

/// The duration of some work by all three clocks, in seconds.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Sample {
    /// Wall-clock time.
    pub wall_secs: f64,
    /// CPU time of the thread that ran the closure.
    pub thread_cpu_secs: f64,
    /// CPU time of all threads of the process.
    pub process_cpu_secs: f64,
}

impl Sample {
    /// The time by one clock.
    pub fn by(&self, clock: Clock) -> f64 {
        match clock {
            Clock::ThreadCpu => self.thread_cpu_secs,
            Clock::ProcessCpu => self.process_cpu_secs,
            Clock::Wall => self.wall_secs,
        }
    }
}

fn cpu_secs(clock: ClockId) -> f64 {
    let t = clock_gettime(clock);
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}

/// Runs `work` once and measures how long it took.
///
/// ```
/// let (sum, time) = bench::clock::measure(|| (0..1000u64).sum::<u64>());
/// assert_eq!(sum, 499_500);
/// assert!(time.wall_secs > 0.0);
/// ```
pub fn measure<T>(work: impl FnOnce() -> T) -> (T, Sample) {
    let wall = Instant::now();
    let (process, thread) = (cpu_secs(ClockId::ProcessCPUTime), cpu_secs(ClockId::ThreadCPUTime));
    let value = work();
    let thread_cpu_secs = cpu_secs(ClockId::ThreadCPUTime) - thread;
    let process_cpu_secs = cpu_secs(ClockId::ProcessCPUTime) - process;
    (value, Sample { wall_secs: wall.elapsed().as_secs_f64(), thread_cpu_secs, process_cpu_secs })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sleeping_costs_wall_time_but_no_cpu_time() {
        let (_, t) = measure(|| std::thread::sleep(std::time::Duration::from_millis(30)));
        assert!(t.wall_secs >= 0.03, "{t:?}");
        assert!(t.thread_cpu_secs < 0.01, "{t:?}");
    }

    #[test]
    fn work_of_another_thread_shows_in_the_process_clock_only() {
        let spin = || {
            let start = cpu_secs(ClockId::ThreadCPUTime);
            let mut x = 1u64;
            while cpu_secs(ClockId::ThreadCPUTime) - start < 0.02 {
                x = std::hint::black_box(x.wrapping_mul(3));
            }
            x
        };
        let (_, t) = measure(|| std::thread::scope(|s| s.spawn(spin).join().is_ok()));
        assert!(t.process_cpu_secs >= 0.02, "{t:?}");
        assert!(t.thread_cpu_secs < 0.015, "{t:?}");
        assert_eq!(t.by(Clock::Wall), t.wall_secs);
    }
}
