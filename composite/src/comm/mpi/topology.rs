//! Which machine each rank is on, according to MPI (`MPI_Comm_split_type`, MPI 3.1, section 6.4.2)
//! and to the system.
//!
//! Two ranks are on one machine if MPI reports that they share memory and everything else that is
//! known of their machines is equal: the kernel's boot id, the name, and the value of the variable
//! [`NODE_VARIABLE`]. If MPI cannot tell, the boot id must be known. Variables of launchers are not
//! used, because not every launcher sets them.
use super::Communicator as _;
use super::library::{Handle, Mpi};
use std::ffi::c_int;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};

/// Ranks with different values of this variable do not share memory, wherever they are.
const NODE_VARIABLE: &str = "COMPOSITE_NODE";

/// Bytes of a rank's machine id.
const BYTES: usize = 12;
/// Replaces the lowest rank of this machine where MPI cannot tell.
const UNKNOWN: u32 = u32::MAX;

/// This rank's machine id: equal bytes, same machine.
pub(super) fn id_of_this_rank(mpi: &Mpi, comm: Handle, rank: usize, name: &str) -> [u8; BYTES] {
    let boot = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").ok();
    let node = std::env::var_os(NODE_VARIABLE);
    machine_id(lowest_in_memory(mpi, comm, rank), boot.as_deref(), name, node.as_deref(), rank)
}

fn machine_id(
    lowest: Option<u32>,
    boot: Option<&str>,
    name: &str,
    node: Option<&std::ffi::OsStr>,
    rank: usize,
) -> [u8; BYTES] {
    let mut hasher = DefaultHasher::new();
    // A rank whose machine is unknown is alone.
    let alone = (lowest.is_none() && boot.is_none()).then_some(rank);
    (boot, name, node, alone).hash(&mut hasher);
    let mut bytes = [0; BYTES];
    bytes[..4].copy_from_slice(&lowest.unwrap_or(UNKNOWN).to_le_bytes());
    bytes[4..].copy_from_slice(&hasher.finish().to_le_bytes());
    bytes
}

/// The lowest rank that shares memory with this one according to MPI; all ranks must call it.
/// `None` if the library has no such function or it fails.
fn lowest_in_memory(mpi: &Mpi, comm: Handle, rank: usize) -> Option<u32> {
    let (split, free) = (mpi.split_type?, mpi.comm_free?);
    let mut here: Handle = 0;
    // SAFETY: every rank of `comm` calls this, with constants of the library's ABI.
    let code = unsafe {
        split(comm, mpi.constants.type_shared, rank as c_int, mpi.info_null, &raw mut here)
    };
    if code != 0 {
        return None;
    }
    let mut size: c_int = 0;
    // SAFETY: a communicator that was just made. Its errors return, as those of `comm` do (MPI 3.1,
    // section 8.3).
    let code = unsafe { (mpi.functions.comm_size)(here, &raw mut size) };
    let count = usize::try_from(size).ok().filter(|_| code == 0)?;
    let own = (rank as u32).to_le_bytes();
    let mut all = vec![0_u8; 4 * count];
    // SAFETY: every rank of `here` calls this with four bytes, and `all` has room for those of
    // each.
    let code = unsafe {
        (mpi.functions.allgather)(
            own.as_ptr().cast(),
            4,
            mpi.byte,
            all.as_mut_ptr().cast(),
            4,
            mpi.byte,
            here,
        )
    };
    // SAFETY: a communicator of this function's own, used no more.
    unsafe { free(&raw mut here) };
    if code != 0 {
        return None;
    }
    all.as_chunks::<4>().0.iter().map(|rank| u32::from_le_bytes(*rank)).min()
}

/// Numbers the machines in the order of their first ranks.
pub(super) fn numbered_nodes(ids: &[Vec<u8>]) -> Vec<usize> {
    let mut found: Vec<&[u8]> = Vec::new();
    ids.iter()
        .map(|one| {
            found.iter().position(|known| known == one).unwrap_or_else(|| {
                found.push(one);
                found.len() - 1
            })
        })
        .collect()
}

impl super::MpiComm {
    /// The machine of every rank, numbered in the order of their first ranks. Ranks count as
    /// separate unless MPI or the system says that they share a machine. The same on all ranks.
    pub fn nodes(&self) -> &[usize] {
        &self.nodes
    }

    /// The name of the machine this rank runs on.
    pub fn processor_name(&self) -> String {
        let mut text = vec![0_u8; 4096];
        let mut length: c_int = 0;
        // SAFETY: the buffer is longer than MPI_MAX_PROCESSOR_NAME of every ABI (256 at most).
        unsafe { (self.mpi.functions.processor_name)(text.as_mut_ptr().cast(), &raw mut length) };
        text.truncate(usize::try_from(length).unwrap_or(0));
        String::from_utf8_lossy(&text).trim_end_matches('\0').to_string()
    }

    /// Finds out which ranks share a machine.
    pub(super) fn find_nodes(&mut self) -> Result<(), super::CommError> {
        let mine =
            id_of_this_rank(&self.mpi, self.transfers.comm(), self.rank, &self.processor_name());
        let all = self.all_gather(&mine, mine.len(), super::STARTUP_TIMEOUT)?;
        self.nodes = numbered_nodes(&all);
        // More ranks than processors: a rank that spins takes the processor from the one it waits
        // for.
        let here = self.nodes.iter().filter(|&&node| node == self.nodes[self.rank]).count();
        self.oversubscribed = here > super::launcher::processors_here();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::OsStr;

    #[test]
    fn ranks_share_a_machine_only_if_something_says_so() {
        let of = |lowest, boot, name, node: Option<&str>, rank| {
            machine_id(lowest, boot, name, node.map(OsStr::new), rank).to_vec()
        };
        let same = |a: &Vec<u8>, b: &Vec<u8>| numbered_nodes(&[a.clone(), b.clone()]) == [0, 0];
        let first = of(Some(0), Some("b0"), "host", None, 0);
        assert!(same(&first, &of(Some(0), Some("b0"), "host", None, 1)));
        for other in [
            of(Some(1), Some("b0"), "host", None, 1),
            of(Some(0), Some("b1"), "host", None, 1),
            of(Some(0), Some("b0"), "other", None, 1),
            of(Some(0), Some("b0"), "host", Some("a"), 1),
        ] {
            assert!(!same(&first, &other));
        }
        // Without MPI's answer, the boot id decides; without that too, every rank is alone.
        let by_boot = |rank| of(None, Some("b0"), "host", None, rank);
        assert!(same(&by_boot(0), &by_boot(1)));
        let by_name = |rank| of(None, None, "localhost", None, rank);
        assert!(!same(&by_name(0), &by_name(1)));
        // Where /proc cannot be read, MPI's answer is enough.
        let by_mpi = |rank| of(Some(0), None, "host", None, rank);
        assert!(same(&by_mpi(0), &by_mpi(1)));
    }

    #[test]
    fn machines_are_numbered_in_the_order_of_their_first_ranks() {
        let ids = ["b", "a", "b", "c", "a"].map(|one| one.as_bytes().to_vec());
        assert_eq!(numbered_nodes(&ids), [0, 1, 0, 2, 1]);
        assert_eq!(numbered_nodes(&[]), [0_usize; 0]);
    }
}
