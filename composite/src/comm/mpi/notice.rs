//! Notices about the group itself: a rank gives up, has left, requests a sign of life or gives one.
//! They use a communicator of their own, and waiting ranks poll for them.
use super::heartbeat::Heartbeat;
use super::library::{Handle, Mpi, Status};
use std::ffi::c_int;

const TAG: c_int = 1;
const LEFT: u8 = 0;
const ABORTED: u8 = 1;
const HEARTBEAT_REQUEST: u8 = 2;
const HEARTBEAT: u8 = 3;
/// Longer reasons are cut; a notice must be small enough to arrive without its receiver's help.
const LONGEST: usize = 2000;

/// A received notice.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Notice {
    Left {
        rank: usize,
    },
    Aborted {
        by: usize,
        reason: String,
    },
    /// The rank requests a sign of life.
    HeartbeatRequest {
        rank: usize,
    },
    /// The rank, or one it waits for, has made a number of steps.
    Heartbeat {
        rank: usize,
        heartbeat: Heartbeat,
    },
}

pub(super) struct Notices {
    comm: Handle,
    /// Notices that MPI may still be reading.
    sent: Vec<(Handle, Vec<u8>)>,
}

impl Notices {
    pub(super) fn new(comm: Handle) -> Self {
        Self { comm, sent: Vec::new() }
    }

    pub(super) fn comm(&self) -> Handle {
        self.comm
    }

    pub(super) fn send_left(&mut self, mpi: &Mpi, others: impl Iterator<Item = usize>) {
        self.send(mpi, others, vec![LEFT]);
    }

    pub(super) fn send_aborted(
        &mut self,
        mpi: &Mpi,
        others: impl Iterator<Item = usize>,
        reason: &str,
    ) {
        let mut end = reason.len().min(LONGEST);
        while !reason.is_char_boundary(end) {
            end -= 1;
        }
        self.send(mpi, others, [&[ABORTED], &reason.as_bytes()[..end]].concat());
    }

    pub(super) fn request_heartbeats(&mut self, mpi: &Mpi, others: impl Iterator<Item = usize>) {
        self.send(mpi, others, vec![HEARTBEAT_REQUEST]);
    }

    pub(super) fn send_heartbeats(&mut self, mpi: &Mpi, heartbeats: Vec<(usize, Heartbeat)>) {
        for (rank, Heartbeat { origin, steps }) in heartbeats {
            let mut message = vec![HEARTBEAT];
            message.extend_from_slice(&(origin as u32).to_le_bytes());
            message.extend_from_slice(&steps.to_le_bytes());
            self.send(mpi, std::iter::once(rank), message);
        }
    }

    fn send(&mut self, mpi: &Mpi, others: impl Iterator<Item = usize>, message: Vec<u8>) {
        self.delivered(mpi);
        for rank in others {
            let message = message.clone();
            let mut request: Handle = 0;
            // SAFETY: `sent` owns the bytes from here on and they are leaked rather than freed
            // while MPI may read them.
            let code = unsafe {
                (mpi.functions.isend)(
                    message.as_ptr().cast(),
                    message.len() as c_int,
                    mpi.byte,
                    rank as c_int,
                    TAG,
                    self.comm,
                    &raw mut request,
                )
            };
            // A failure to send a notice changes nothing: its receivers have their timeouts.
            if code == 0 {
                self.sent.push((request, message));
            }
        }
    }

    /// Whether all notices have been sent.
    pub(super) fn delivered(&mut self, mpi: &Mpi) -> bool {
        self.sent.retain_mut(|(request, _)| {
            let mut flag: c_int = 0;
            // SAFETY: a request of MPI_Isend that has not been completed.
            let code = unsafe {
                (mpi.functions.test)(&raw mut *request, &raw mut flag, mpi.status_ignore())
            };
            code == 0 && flag == 0
        });
        self.sent.is_empty()
    }

    /// The next notice that has arrived.
    pub(super) fn receive(&mut self, mpi: &Mpi) -> Option<Notice> {
        let mut status: Status = [0; 8];
        let mut flag: c_int = 0;
        // SAFETY: looks for a message on this object's communicator; a status is at most as large
        // as `Status`.
        let code = unsafe {
            (mpi.functions.iprobe)(
                mpi.constants.any_source,
                TAG,
                self.comm,
                &raw mut flag,
                &raw mut status,
            )
        };
        if code != 0 || flag == 0 {
            return None;
        }
        // SAFETY: MPI_SOURCE is an int at this offset of a status of this ABI.
        let source = unsafe {
            status.as_ptr().cast::<u8>().add(mpi.constants.status_source).cast::<c_int>().read()
        };
        let mut message = vec![0_u8; LONGEST + 1];
        let mut bytes: c_int = 0;
        // SAFETY: the probed message is from another `Notices`, so it is not longer than the
        // buffer.
        let code = unsafe {
            (mpi.functions.get_count)(&raw const status, mpi.byte, &raw mut bytes);
            (mpi.functions.recv)(
                message.as_mut_ptr().cast(),
                message.len() as c_int,
                mpi.byte,
                source,
                TAG,
                self.comm,
                mpi.status_ignore(),
            )
        };
        message.truncate(usize::try_from(bytes).unwrap_or(0));
        let rank = usize::try_from(source).ok().filter(|_| code == 0)?;
        match message.split_first() {
            Some((&ABORTED, reason)) => Some(Notice::Aborted {
                by: rank,
                reason: String::from_utf8_lossy(reason).into_owned(),
            }),
            Some((&HEARTBEAT_REQUEST, _)) => Some(Notice::HeartbeatRequest { rank }),
            Some((&HEARTBEAT, rest)) => {
                let (origin, steps) = rest.split_first_chunk::<4>()?;
                let (steps, _) = steps.split_first_chunk::<8>()?;
                let origin = u32::from_le_bytes(*origin) as usize;
                Some(Notice::Heartbeat {
                    rank,
                    heartbeat: Heartbeat { origin, steps: u64::from_le_bytes(*steps) },
                })
            }
            _ => Some(Notice::Left { rank }),
        }
    }
}

impl Drop for Notices {
    fn drop(&mut self) {
        std::mem::forget(std::mem::take(&mut self.sent));
    }
}
