//! Collective calls made of messages. Any [`Communicator`] has them without further code, with the
//! same timeouts.
use super::{CommError, Communicator, FIRST_RESERVED_TAG};
use std::time::Duration;

const BARRIER_TAG: u32 = FIRST_RESERVED_TAG;
pub(super) const GATHER_TAG: u32 = FIRST_RESERVED_TAG + 1;
/// Added to the timeout of each later round. The rank that waits for the stalled one directly then
/// gives up first, and the group's error names the stalled rank instead of one that waits too.
const ROUND_GRACE: Duration = Duration::from_millis(50);

/// A dissemination barrier (D. Hensgen, R. Finkel, U. Manber, "Two Algorithms for Barrier
/// Synchronization", 1988): in round j every rank signals the one 2^j above it. After log2 p rounds
/// every rank has heard, directly or not, from all others.
///
/// # Errors
/// As [`Communicator::barrier`].
pub fn barrier<C: Communicator + ?Sized>(comm: &mut C, timeout: Duration) -> Result<(), CommError> {
    let (rank, size) = (comm.rank(), comm.size());
    let mut patience = timeout;
    let mut distance = 1;
    while distance < size {
        comm.send((rank + distance) % size, BARRIER_TAG, Vec::new())?;
        let below = (rank + size - distance) % size;
        comm.recv(below, BARRIER_TAG, 0, patience).map_err(|error| match error {
            CommError::Timeout { rank, peer, waited_ms, .. } => {
                CommError::BarrierTimeout { rank, missing: peer, waited_ms }
            }
            other => other,
        })?;
        patience += ROUND_GRACE;
        distance *= 2;
    }
    Ok(())
}

/// The all-gather of J. Bruck et al. ("Efficient Algorithms for All-to-All Communications in
/// Multiport Message-Passing Systems", 1997): in round j every rank sends all it knows to the one
/// 2^j below, so log2 p rounds are enough for any p.
///
/// # Errors
/// As [`Communicator::all_gather`].
pub fn all_gather<C: Communicator + ?Sized>(
    comm: &mut C,
    mine: &[u8],
    longest: usize,
    timeout: Duration,
) -> Result<Vec<Vec<u8>>, CommError> {
    let (rank, size) = (comm.rank(), comm.size());
    let too_long = |peer| CommError::TooLong { rank, peer, tag: GATHER_TAG, capacity: longest };
    if mine.len() > longest {
        return Err(too_long(rank));
    }
    // Known strings, each preceded by its length: first that of this rank, then those of the ranks
    // above it.
    let block = 8 + longest;
    let mut known = comm.buffer(block.saturating_mul(size));
    known.extend_from_slice(&(mine.len() as u64).to_le_bytes());
    known.extend_from_slice(mine);
    let mut count = 1;
    let mut patience = timeout;
    while count < size {
        let more = count.min(size - count);
        let (below, above) = ((rank + size - count) % size, (rank + count) % size);
        let receive = comm.post_recv(above, GATHER_TAG, block.saturating_mul(more))?;
        // If the count is no power of two, the last round sends only some of the strings.
        let end = end_of(&known, more, longest).ok_or_else(|| too_long(rank))?;
        let mut message = comm.buffer(end);
        message.extend_from_slice(&known[..end]);
        comm.send(below, GATHER_TAG, message)?;
        let came = comm.wait_any(&mut vec![receive], patience)?.message;
        if end_of(&came, more, longest) != Some(came.len()) {
            return Err(too_long(above));
        }
        known.extend_from_slice(&came);
        comm.recycle(came);
        patience += ROUND_GRACE;
        count += more;
    }

    // Reorder from "this rank first" to rank order.
    let mut all = vec![Vec::new(); size];
    let mut at = 0;
    for step in 0..size {
        let (start, end) = block_at(&known, at).ok_or_else(|| too_long(rank))?;
        all[(rank + step) % size] = known[start..end].to_vec();
        at = end;
    }
    comm.recycle(known);
    Ok(all)
}

/// Start and end of the string whose length is stored at `at`.
pub(super) fn block_at(bytes: &[u8], at: usize) -> Option<(usize, usize)> {
    let length = bytes.get(at..at.checked_add(8)?)?;
    let length = usize::try_from(u64::from_le_bytes(length.try_into().ok()?)).ok()?;
    let end = (at + 8).checked_add(length)?;
    (end <= bytes.len()).then_some((at + 8, end))
}

/// Where the first `count` strings end; `None` if some are missing or one is longer than `longest`.
fn end_of(bytes: &[u8], count: usize, longest: usize) -> Option<usize> {
    (0..count).try_fold(0, |at, _| {
        let (start, end) = block_at(bytes, at)?;
        (end - start <= longest).then_some(end)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comm::threads;

    const LONG: Duration = Duration::from_secs(20);

    #[test]
    fn every_rank_gets_the_strings_of_all_in_rank_order_also_when_lengths_differ() {
        for size in 1..=19 {
            let expected: Vec<Vec<u8>> = (0..size).map(|rank| vec![rank as u8; rank % 4]).collect();
            let results = threads::run(size, |mut comm| {
                let mine = vec![comm.rank() as u8; comm.rank() % 4];
                // Twice, so that a message of one call mistaken for one of the next would show.
                let first = all_gather(&mut comm, &mine, 3, LONG).unwrap();
                assert_eq!(first, all_gather(&mut comm, &mine, 3, LONG).unwrap());
                first
            });
            for result in results {
                assert_eq!(result.unwrap(), expected, "{size} ranks");
            }
        }
    }

    #[test]
    fn a_string_longer_than_agreed_is_named_by_its_rank() {
        let mut comm = threads::group(1).remove(0);
        let error = all_gather(&mut comm, &[0; 5], 4, LONG).unwrap_err();
        assert!(
            matches!(error, CommError::TooLong { rank: 0, peer: 0, capacity: 4, .. }),
            "{error}"
        );
    }

    #[test]
    fn the_barrier_of_messages_holds_everybody_until_the_last_has_come() {
        use std::sync::atomic::{AtomicUsize, Ordering};
        for size in [1, 2, 3, 5, 8] {
            let arrived = AtomicUsize::new(0);
            let results = threads::run(size, |mut comm| {
                (1..=20).all(|round| {
                    arrived.fetch_add(1, Ordering::SeqCst);
                    barrier(&mut comm, LONG).unwrap();
                    arrived.load(Ordering::SeqCst) >= size * round
                })
            });
            assert!(results.into_iter().all(|complete| complete.unwrap()), "{size} ranks");
        }
    }

    #[test]
    fn a_rank_that_does_not_come_to_the_barrier_of_messages_is_named_by_the_first_who_gives_up() {
        let results = threads::run(5, |mut comm| {
            use crate::Communicator;
            if comm.rank() == 3 {
                // Alive, but not at the barrier.
                return comm.recv(0, 7, 1, LONG).map(|_| ()).unwrap_err().to_string();
            }
            let error = barrier(&mut comm, Duration::from_millis(100)).unwrap_err();
            comm.abort(&error.to_string());
            error.to_string()
        });
        for text in results {
            let text = text.unwrap();
            assert!(text.contains("rank 3 did not come"), "{text}");
        }
    }
}
