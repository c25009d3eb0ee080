//! Memory for the parts of stored data, and for what waits to be stored.

use datasets::free_memory::available_bytes;

/// Megabytes where memory is ample, unless the user gives others.
const AMPLE: u64 = 1024;

/// The bytes that `--memory` names; without it, 1024 MB, or half of what this process can still
/// take where that is less: a job or a container that may have 1 GB is killed at more.
pub(super) fn bytes(megabytes: Option<u64>) -> usize {
    let bytes = match megabytes {
        Some(megabytes) => megabytes.saturating_mul(1 << 20),
        None => by_default(available_bytes()),
    };
    usize::try_from(bytes).unwrap_or(usize::MAX)
}

fn by_default(available: Option<u64>) -> u64 {
    available.map_or(u64::MAX, |bytes| bytes / 2).min(AMPLE << 20)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_job_takes_half_of_what_it_has() {
        assert_eq!(by_default(Some(600 << 20)), 300 << 20);
        assert_eq!(by_default(Some(64 << 30)), 1024 << 20);
        assert_eq!(by_default(None), 1024 << 20);
        assert_eq!(bytes(Some(3)), 3 << 20);
    }
}
