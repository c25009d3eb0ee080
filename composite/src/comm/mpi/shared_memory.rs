//! Memory that the processes of one machine share: a small table for collective calls without
//! messages, and a segment for each rank's pixels.
//!
//! The table and each segment are files without a name (`memfd_create`). Other ranks open them
//! through the process that made them, so nothing is left behind whatever happens to a process.
//! Ranks wait on a word of the table (`futex`) and sleep until they are woken, which matters where
//! ranks share processors. There, a rank that polls for messages takes the processor from those it
//! waits for, and Linux (6.18) moves a process that yields behind all others, so that it is
//! scheduled last when its message has arrived.
use crate::comm::{CommError, SharedSegments};
use rustix::fs::{FallocateFlags, MemfdFlags, fallocate, memfd_create};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use rustix::thread::futex;
use std::cell::Cell;
use std::fs::{File, OpenOptions};
use std::os::fd::AsRawFd as _;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// Words of 32 bits in a rank's entry: one cache line.
const ENTRY: usize = 16;
/// Words of a rank's contribution to a collective call ([`SharedMemory::slot`]): the number of the
/// call, its kind or length, and 248 bytes.
const STRING: usize = 64;
/// Value of the length in a barrier.
const BARRIER: u32 = u32::MAX;
/// Longest string that the table holds.
pub(super) const LONGEST: usize = 4 * (STRING - 2);

// The head of the table.
const EPOCH: usize = 0;
const ARRIVED: usize = 1;
const NEXT_BAND: usize = 2;
const NONCE: usize = 3;
// A rank's entry.
const ARRIVALS: usize = 0;
const PROCESS: usize = 1;
const FILE: usize = 2;
const GENERATION: usize = 3;
const KIB: usize = 4;
const REFUSED: usize = 5;
/// The collective call after which its segment was last written.
const PUBLISHED: usize = 6;

/// Where the table is: process and file of the machine's first rank, and a nonce in the table, so
/// that a process with the same number in another container is not mistaken for it.
pub(super) type Address = [u32; 3];

struct Mapping {
    at: *mut u8,
    bytes: usize,
}

impl Mapping {
    /// Maps a whole file, which must have at least this length. With `fill` its pages are allocated
    /// at once.
    fn of(file: &File, bytes: usize, fill: bool) -> std::io::Result<Self> {
        if file.metadata()?.len() < bytes as u64 {
            return Err(std::io::ErrorKind::UnexpectedEof.into());
        }
        let flags = if fill { MapFlags::SHARED | MapFlags::POPULATE } else { MapFlags::SHARED };
        // SAFETY: a new mapping at an address that the system chooses.
        let at = unsafe {
            mmap(std::ptr::null_mut(), bytes, ProtFlags::READ | ProtFlags::WRITE, flags, file, 0)
        }?;
        Ok(Self { at: at.cast(), bytes })
    }

    /// # Safety
    /// During the life of the slice nobody, here or in another process, writes these bytes.
    unsafe fn read(&self, from: usize, bytes: usize) -> &[u8] {
        assert!(
            from.checked_add(bytes).is_some_and(|end| end <= self.bytes),
            "beyond a rank's room"
        );
        // SAFETY: within the mapping, and not written, as the caller promises.
        unsafe { std::slice::from_raw_parts(self.at.add(from), bytes) }
    }

    /// # Safety
    /// During the life of the slice nobody else, here or in another process, reads or writes these
    /// bytes.
    #[allow(
        clippy::mut_from_ref,
        reason = "the memory belongs to several processes, so exclusiveness is the caller's to see \
                  to"
    )]
    unsafe fn write(&self, from: usize, bytes: usize) -> &mut [u8] {
        assert!(
            from.checked_add(bytes).is_some_and(|end| end <= self.bytes),
            "beyond a rank's room"
        );
        // SAFETY: within the mapping, and nobody else's, as the caller promises.
        unsafe { std::slice::from_raw_parts_mut(self.at.add(from), bytes) }
    }

    fn word(&self, index: usize) -> &AtomicU32 {
        assert!(4 * index + 4 <= self.bytes, "beyond the table");
        // SAFETY: within the mapping, which begins at a page; words of the table are only used as
        // atomics, by every process.
        unsafe { &*self.at.cast::<AtomicU32>().add(index) }
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: made by `mmap` with this length; nothing borrowed from it outlives it.
        let _ = unsafe { munmap(self.at.cast(), self.bytes) };
    }
}

fn nameless_file(bytes: usize) -> std::io::Result<File> {
    let file = File::from(memfd_create("composite", MemfdFlags::CLOEXEC)?);
    // Reserved, so that missing memory is an error here and not a fault later.
    fallocate(&file, FallocateFlags::empty(), 0, bytes as u64)?;
    Ok(file)
}

fn file_of(process: u32, file: u32) -> std::io::Result<File> {
    OpenOptions::new().read(true).write(true).open(format!("/proc/{process}/fd/{file}"))
}

fn is_alive(process: u32) -> bool {
    std::path::Path::new("/proc").join(process.to_string()).exists()
}

/// A rank's segment as mapped in this process.
struct Segment {
    generation: u32,
    mapping: Mapping,
}

/// The table and the segments of the ranks of a machine; see the module page.
pub(super) struct SharedMemory {
    /// The ranks of this machine, ascending. Entries of the table are in this order.
    ranks: Vec<usize>,
    /// This rank's place among them.
    place: usize,
    table: Mapping,
    /// Kept open, so that others can open it.
    own_file: Option<File>,
    _table_file: Option<File>,
    segments: Vec<Option<Segment>>,
    /// How many collective calls (barriers or all-gathers) this rank has entered.
    arrivals: Cell<u32>,
    /// The collective call after which it last published its pixels.
    published: Cell<u32>,
}

fn table_bytes(size: usize) -> usize {
    (4 * (ENTRY * (size + 1) + 2 * STRING * size)).next_multiple_of(4096)
}

impl SharedMemory {
    /// The table that the first of these ranks makes for all, and its address.
    pub(super) fn make(ranks: Vec<usize>) -> std::io::Result<(Self, Address)> {
        let file = nameless_file(table_bytes(ranks.len()))?;
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        let nonce = now.map_or(0, |since| since.subsec_nanos() ^ since.as_secs() as u32) | 1;
        let address = [std::process::id(), file.as_raw_fd() as u32, nonce];
        let node = Self::of(0, ranks, file)?;
        node.table.word(NONCE).store(nonce, Ordering::Release);
        Ok((node, address))
    }

    /// The table that the first of `ranks` has made; `rank` must be one of them.
    pub(super) fn map(
        rank: usize,
        ranks: Vec<usize>,
        [process, file, nonce]: Address,
    ) -> std::io::Result<Self> {
        let place = ranks.iter().position(|&one| one == rank);
        let place = place.ok_or(std::io::ErrorKind::InvalidInput)?;
        let node = Self::of(place, ranks, file_of(process, file)?)?;
        let same = node.table.word(NONCE).load(Ordering::Acquire) == nonce;
        if same { Ok(node) } else { Err(std::io::ErrorKind::NotFound.into()) }
    }

    fn of(place: usize, ranks: Vec<usize>, file: File) -> std::io::Result<Self> {
        Ok(Self {
            place,
            table: Mapping::of(&file, table_bytes(ranks.len()), true)?,
            own_file: None,
            _table_file: (place == 0).then_some(file),
            segments: ranks.iter().map(|_| None).collect(),
            arrivals: Cell::new(0),
            published: Cell::new(0),
            ranks,
        })
    }

    fn places(&self) -> std::ops::Range<usize> {
        0..self.ranks.len()
    }

    /// The segment of a rank, if it is on this machine and has been opened.
    fn segment_of(&self, rank: usize) -> Option<&Segment> {
        let place = self.ranks.iter().position(|&one| one == rank)?;
        self.segments[place].as_ref()
    }

    fn entry(&self, place: usize, word: usize) -> &AtomicU32 {
        self.table.word(ENTRY * (place + 1) + word)
    }

    /// Enters the next collective call: a barrier, or (with a string) an all-gather. Wakes all
    /// ranks if this is the last one.
    ///
    /// The string can be read after the call is complete. There are two sets of strings, and a rank
    /// is at most one call ahead of another, so no rank overwrites what another still reads, and a
    /// rank that is ahead is not mistaken for one in the current call.
    pub(super) fn arrive(&self, string: Option<&[u8]>) {
        let number = self.arrivals.get().wrapping_add(1);
        self.arrivals.set(number);
        let first = self.slot(self.place);
        self.table.word(first).store(number, Ordering::Relaxed);
        let length = string.map_or(BARRIER, |string| string.len() as u32);
        self.table.word(first + 1).store(length, Ordering::Relaxed);
        for (index, four) in string.unwrap_or_default().chunks(4).enumerate() {
            let mut word = [0; 4];
            word[..four.len()].copy_from_slice(four);
            self.table.word(first + 2 + index).store(u32::from_ne_bytes(word), Ordering::Relaxed);
        }
        self.entry(self.place, ARRIVALS).store(number, Ordering::Release);
        if self.table.word(ARRIVED).fetch_add(1, Ordering::AcqRel) + 1 == self.ranks.len() as u32 {
            self.table.word(ARRIVED).store(0, Ordering::Relaxed);
            self.table.word(EPOCH).store(number, Ordering::Release);
            let _ = futex::wake(self.table.word(EPOCH), futex::Flags::empty(), i32::MAX as u32);
        }
    }

    /// Whether all ranks have entered the call that this rank is in.
    pub(super) fn passed(&self) -> bool {
        self.table.word(EPOCH).load(Ordering::Acquire) == self.arrivals.get()
    }

    /// Sleeps until all ranks have arrived or the time has passed; may also wake spuriously.
    pub(super) fn sleep(&self, most: Duration) {
        let before = self.arrivals.get().wrapping_sub(1);
        let most = futex::Timespec {
            tv_sec: most.as_secs() as i64,
            tv_nsec: i64::from(most.subsec_nanos()),
        };
        let _ = futex::wait(self.table.word(EPOCH), futex::Flags::empty(), before, Some(&most));
    }

    /// Ranks that have not arrived.
    pub(super) fn missing(&self) -> impl Iterator<Item = usize> {
        let here = self.arrivals.get();
        let is_missing =
            move |place: &usize| self.entry(*place, ARRIVALS).load(Ordering::Acquire) != here;
        self.places().filter(is_missing).map(|place| self.ranks[place])
    }

    /// The strings of all ranks in the completed call; empty for a barrier.
    ///
    /// # Errors
    /// [`CommError::OutOfStep`] if some ranks called a barrier and others an all-gather.
    pub(super) fn gathered(&self) -> Result<Vec<Vec<u8>>, CommError> {
        let length = |place| self.table.word(self.slot(place) + 1).load(Ordering::Relaxed);
        let (waiting, gathering): (Vec<usize>, Vec<usize>) =
            self.places().partition(|&place| length(place) == BARRIER);
        if gathering.is_empty() {
            return Ok(Vec::new());
        }
        if !waiting.is_empty() {
            let rank = self.ranks[self.place];
            let [gathering, waiting] = [gathering, waiting]
                .map(|places| places.into_iter().map(|place| self.ranks[place]).collect());
            return Err(CommError::OutOfStep { rank, gathering, waiting });
        }
        let strings = self.places().map(|place| {
            let first = self.slot(place) + 2;
            let length = (length(place) as usize).min(LONGEST);
            let words = (first..first + length.div_ceil(4))
                .map(|word| self.table.word(word).load(Ordering::Relaxed).to_ne_bytes());
            let mut string: Vec<u8> = words.flatten().collect();
            string.truncate(length);
            string
        });
        Ok(strings.collect())
    }

    /// First word of a rank's contribution to the call that this rank is in.
    fn slot(&self, place: usize) -> usize {
        let (set, count) = (self.arrivals.get() as usize % 2, self.ranks.len());
        ENTRY * (count + 1) + STRING * (set * count + place)
    }

    /// Makes a segment of at least `bytes` for this rank.
    fn make_segment(&mut self, bytes: usize) -> std::io::Result<()> {
        if self.segments[self.place].as_ref().is_some_and(|segment| segment.mapping.bytes >= bytes)
        {
            return Ok(());
        }
        // A little more than needed: frames are similar but not equal.
        let bytes = (bytes + bytes / 4).next_multiple_of(1 << 16);
        let file = nameless_file(bytes)?;
        let mapping = Mapping::of(&file, bytes, true)?;
        let generation = self.entry(self.place, GENERATION).load(Ordering::Relaxed).wrapping_add(1);
        for (word, value) in [
            (PROCESS, std::process::id()),
            (FILE, file.as_raw_fd() as u32),
            (KIB, (bytes / 1024) as u32),
            (GENERATION, generation),
        ] {
            self.entry(self.place, word).store(value, Ordering::Relaxed);
        }
        self.segments[self.place] = Some(Segment { generation, mapping });
        self.own_file = Some(file);
        Ok(())
    }
}

impl SharedSegments for SharedMemory {
    fn publish(&mut self, bytes: usize, used: usize, fill: &mut dyn FnMut(&mut [u8])) {
        let made = self.make_segment(bytes.max(1));
        self.entry(self.place, REFUSED).store(u32::from(made.is_err()), Ordering::Relaxed);
        self.published.set(self.arrivals.get());
        self.entry(self.place, PUBLISHED).store(self.arrivals.get(), Ordering::Relaxed);
        if self.place == 0 {
            // Ranks that took bands of the last frame have reached a barrier since, and no rank
            // takes one before the next.
            self.table.word(NEXT_BAND).store(0, Ordering::Relaxed);
        }
        if let (Ok(()), Some(segment)) = (made, &self.segments[self.place]) {
            // SAFETY: between the all-gather of a frame and its barrier only its owner uses a
            // segment.
            fill(unsafe { segment.mapping.write(0, used) });
        }
    }

    fn reserve(&mut self, bytes: usize) {
        // A failure shows in what is reserved.
        let _ = self.make_segment(bytes);
    }

    fn reserved(&self) -> usize {
        self.segments[self.place].as_ref().map_or(0, |segment| segment.mapping.bytes)
    }

    fn attach(&mut self) -> Result<bool, CommError> {
        let rank = self.ranks[self.place];
        let failed = |place: usize, reason: String| CommError::Transport {
            rank,
            call: format!("opening the memory of rank {}", self.ranks[place]),
            reason,
        };
        let unpublished = |place: &usize| {
            self.entry(*place, PUBLISHED).load(Ordering::Relaxed) != self.published.get()
        };
        if let Some(place) = self.places().find(unpublished) {
            let reason =
                "it has laid down nothing for this frame: do all ranks make the same calls?";
            return Err(failed(place, reason.to_string()));
        }
        let refused = |place| self.entry(place, REFUSED).load(Ordering::Relaxed) != 0;
        if self.places().any(refused) {
            return Ok(false);
        }
        for place in self.places() {
            let generation = self.entry(place, GENERATION).load(Ordering::Relaxed);
            if self.segments[place].as_ref().is_some_and(|segment| segment.generation == generation)
            {
                continue;
            }
            let [process, file, kib] =
                [PROCESS, FILE, KIB].map(|word| self.entry(place, word).load(Ordering::Relaxed));
            let mapping = file_of(process, file)
                .and_then(|file| Mapping::of(&file, kib as usize * 1024, true));
            let mapping = match mapping {
                Ok(mapping) => mapping,
                // A segment exists as long as its process.
                Err(_) if !is_alive(process) => {
                    return Err(CommError::PeerLost { rank, peer: self.ranks[place] });
                }
                Err(error) => return Err(failed(place, error.to_string())),
            };
            self.segments[place] = Some(Segment { generation, mapping });
        }
        Ok(true)
    }

    fn segment(&self, rank: usize, bytes: usize) -> &[u8] {
        let Some(segment) = self.segment_of(rank) else { return &[] };
        let bytes = bytes.min(segment.mapping.bytes);
        // SAFETY: after the barrier that follows `publish` nobody writes the published pixels until
        // all ranks have entered the next collective call.
        unsafe { segment.mapping.read(0, bytes) }
    }

    fn next_band(&self) -> usize {
        self.table.word(NEXT_BAND).fetch_add(1, Ordering::Relaxed) as usize
    }

    fn write_band(&self, rank: usize, from: usize, bytes: usize, write: &mut dyn FnMut(&mut [u8])) {
        if let Some(segment) = self.segment_of(rank) {
            // SAFETY: only the rank that has taken a band writes it, and it is read after the next
            // barrier.
            write(unsafe { segment.mapping.write(from, bytes) });
        }
    }

    fn band(&self, rank: usize, from: usize, bytes: usize) -> &[u8] {
        let Some(segment) = self.segment_of(rank) else { return &[] };
        // SAFETY: after the barrier that follows the bands nobody writes them.
        unsafe { segment.mapping.read(from, bytes) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three ranks in one process, which opens its own files as other processes would.
    fn three() -> [SharedMemory; 3] {
        of_ranks([0, 1, 2])
    }

    fn of_ranks(ranks: [usize; 3]) -> [SharedMemory; 3] {
        let (first, address) = SharedMemory::make(ranks.to_vec()).unwrap();
        let other = |rank| SharedMemory::map(rank, ranks.to_vec(), address).unwrap();
        [first, other(ranks[1]), other(ranks[2])]
    }

    #[test]
    fn a_rank_at_a_barrier_is_not_taken_for_one_at_an_all_gather_though_it_runs_ahead() {
        let nodes = three();
        for node in &nodes {
            node.arrive((node.place < 2).then_some(&b"drawn"[..]));
        }
        assert!(nodes.iter().all(SharedMemory::passed));
        // Rank 2 is fast: before the others have read a word, it contributes what they expect.
        let expected =
            |rank| Err(CommError::OutOfStep { rank, gathering: vec![0, 1], waiting: vec![2] });
        assert_eq!(nodes[2].gathered(), expected(2));
        nodes[2].arrive(Some(b"drawn"));
        for rank in [0, 1] {
            assert_eq!(nodes[rank].gathered(), expected(rank));
        }
        let text = nodes[0].gathered().unwrap_err().to_string();
        assert!(
            text.contains("ranks 0, 1 came to an all-gather and rank 2 to a barrier"),
            "{text}"
        );
    }

    #[test]
    fn ranks_of_one_machine_among_several_keep_their_numbers() {
        let nodes = of_ranks([2, 5, 7]);
        nodes[0].arrive(Some(b"drawn"));
        assert_eq!(nodes[0].missing().collect::<Vec<_>>(), [5, 7]);
        nodes[1].arrive(Some(b"drawn"));
        nodes[2].arrive(None);
        let error = CommError::OutOfStep { rank: 5, gathering: vec![2, 5], waiting: vec![7] };
        assert_eq!(nodes[1].gathered(), Err(error));
        assert!(nodes[0].segment(5, 8).is_empty() && nodes[0].segment(6, 8).is_empty());
    }

    #[test]
    fn gathered_messages_stay_readable_during_the_next_collective() {
        let nodes = three();
        for number in 0..5_u8 {
            for node in &nodes {
                node.arrive(Some(&[number, node.place as u8]));
            }
            let expected = (0..3).map(|rank| vec![number, rank]).collect::<Vec<_>>();
            assert_eq!(nodes[1].gathered().as_ref(), Ok(&expected));
            assert_eq!(nodes[2].gathered().as_ref(), Ok(&expected));
            // Two go on to a barrier before the first rank reads.
            nodes[1].arrive(None);
            nodes[2].arrive(None);
            assert_eq!(nodes[0].gathered().as_ref(), Ok(&expected));
            nodes[0].arrive(None);
            assert!(nodes.iter().all(|node| node.passed() && node.gathered() == Ok(Vec::new())));
        }
    }

    #[test]
    fn a_rank_that_laid_nothing_down_is_named_and_not_looked_for_in_the_file_system() {
        let mut nodes = three();
        nodes[0].arrive(Some(&[]));
        nodes[1].arrive(Some(&[]));
        nodes[2].arrive(Some(&[]));
        for node in &mut nodes[..2] {
            node.publish(8, 8, &mut |segment| segment.fill(7));
        }
        let text = nodes[0].attach().unwrap_err().to_string();
        assert!(text.contains("rank 2 failed: it has laid down nothing for this frame"), "{text}");
        nodes[2].publish(8, 8, &mut |segment| segment.fill(9));
        assert_eq!(nodes[0].attach(), Ok(true));
        assert_eq!(nodes[0].segment(2, 8), [9; 8]);
    }
}
