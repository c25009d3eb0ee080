//! Costs of messages and strategies: the LogGP model of A. Alexandrov, M. Ionescu, K. Schauser, C.
//! Scheiman (SPAA 1995), measured once over the communicator itself, and the time of each strategy
//! that follows from it.
use crate::comm::sim::Network;
use crate::comm::{CommError, Communicator};
use crate::pixel::Composite;
use crate::rank_order::Folding;
use crate::rect::Rect;
use crate::strategies::Strategy;
use crate::strategies::direct_send;
use crate::strategies::folding::bounds_of_slots;
use crate::strategies::radix_k::share;
use crate::tiles::SLICE_BYTES;
use std::time::Duration;

/// Costs of messages between two ranks, in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetworkCosts {
    /// From the beginning of a send until a short message has been received (LogGP: L + 2o).
    pub latency_secs: f64,
    /// Time a rank is busy with one message, on either side (LogGP: o, with the gap g).
    pub overhead_secs: f64,
    /// Time for each byte of a long message (LogGP: G).
    pub byte_secs: f64,
}

const PING_TAG: u32 = 11;
const ROUNDS: usize = 8;
const LONG_BYTES: usize = 1 << 18;
/// Time to read or write a byte of a message on one core, about; measured on a server of 2023. Only
/// its ratio to the network matters.
pub(crate) const LOCAL_BYTE_SECS: f64 = 1.5e-10;
/// Time that a rank spends on each message besides its pixels (a buffer, a header, masks, checking
/// whether it has been sent), about. From 16 to 128 simulated ranks, dense frames by direct send
/// take 15 µs more for each rank, which is one message more to send, to receive and to collect.
pub(crate) const LOCAL_MESSAGE_SECS: f64 = 5e-6;

impl NetworkCosts {
    /// InfiniBand QDR as in the thesis' cluster: 3.2 GB/s, about a microsecond.
    pub const QDR: Self = Self::of(&Network::QDR);

    /// What [`NetworkCosts::measure`] would find on a network whose parameters are known, without
    /// corrections for the lengths of messages.
    pub const fn of(network: &Network) -> Self {
        Self {
            latency_secs: network.latency_secs + 2.0 * network.overhead_secs,
            overhead_secs: network.overhead_secs + network.gap_secs,
            byte_secs: network.byte_secs,
        }
    }

    /// Measures with messages between the first and the last rank. All ranks must call it, and all
    /// get the values of rank 0.
    ///
    /// # Errors
    /// As the calls of the communicator.
    pub fn measure(comm: &mut dyn Communicator, timeout: Duration) -> Result<Self, CommError> {
        let (rank, last) = (comm.rank(), comm.size() - 1);
        let mut measured = [0.0_f64; 3];
        if last > 0 && (rank == 0 || rank == last) {
            let peer = last - rank;
            for (slot, bytes) in [(0, 8), (2, LONG_BYTES)] {
                let mut best = f64::INFINITY;
                for _ in 0..ROUNDS {
                    let begin = comm.now();
                    if rank == 0 {
                        let mut ping = comm.buffer(bytes);
                        ping.resize(bytes, 1);
                        let sending = comm.now();
                        comm.send(peer, PING_TAG, ping)?;
                        if slot == 0 {
                            measured[1] += (comm.now() - sending) / ROUNDS as f64;
                        }
                    }
                    let pong = comm.recv(peer, PING_TAG, bytes, timeout)?;
                    if rank == 0 {
                        comm.recycle(pong);
                    } else {
                        comm.send(peer, PING_TAG, pong)?;
                    }
                    best = best.min((comm.now() - begin) / 2.0);
                }
                measured[slot] = best;
            }
        }
        // Use the values of rank 0, so that all ranks choose the same strategy.
        let mine: &[u8] = bytemuck::cast_slice(&measured);
        let all = comm.all_gather(mine, size_of_val(&measured), timeout)?;
        let Some(of_first) = all.first().filter(|bytes| bytes.len() == mine.len()) else {
            return Ok(Self::QDR);
        };
        let number = |i: usize| bytemuck::pod_read_unaligned::<f64>(&of_first[8 * i..8 * i + 8]);
        let (latency_secs, long_secs) = (number(0).max(0.0), number(2).max(0.0));
        Ok(Self {
            latency_secs,
            overhead_secs: number(1).clamp(0.0, latency_secs / 2.0),
            byte_secs: ((long_secs - latency_secs) / LONG_BYTES as f64).max(1e-12),
        })
    }

    /// A number for fingerprints.
    pub(crate) fn code(&self) -> u64 {
        let numbers = [self.latency_secs, self.overhead_secs, self.byte_secs];
        numbers.into_iter().map(f64::to_bits).fold(3, crate::codec::mix)
    }

    /// Estimated seconds of a frame, from the rectangles that ranks drew in, as if these were
    /// dense. With `root`, the image is collected.
    ///
    /// One exchange costs the latency, the overhead of a rank's messages, and the bytes of the rank
    /// that sends or receives most. Encoding and merging overlap with the transfer, except for the
    /// first message of each round; in direct send, which works slice by slice, they overlap
    /// completely. There collecting overlaps too, except for the last of a tile's slices: the
    /// collecting rank merges nothing, so it receives the first slices while the next are
    /// exchanged.
    pub fn estimate_secs<P: Composite>(
        &self,
        strategy: Strategy,
        drawn: &[Rect],
        root: bool,
    ) -> f64 {
        let ranks = drawn.len();
        let whole = drawn.iter().fold(Rect::EMPTY, |all, rect| all.around(rect));
        if ranks < 2 || whole.is_empty() {
            return 0.0;
        }
        let bytes = |rect: &Rect| (rect.pixels() * P::BYTES) as f64;
        let collect = |messages: usize, pixels: f64| {
            let color_bytes = pixels * size_of::<P::Color>() as f64;
            if root { self.exchange_secs(messages as f64, color_bytes, color_bytes) } else { 0.0 }
        };
        let folding = Folding::new(ranks);
        match strategy {
            Strategy::DirectSend | Strategy::Automatic => {
                let plan = direct_send::Plan::new::<P>(drawn, usize::MAX, root.then_some(0));
                // Bytes sent, bytes received and messages of each rank; each pair is visited once.
                let mut traffic = vec![(0.0_f64, 0.0_f64, 0.0_f64); ranks];
                for (owner, tiles) in plan.slices.iter().enumerate() {
                    for (giver, its_rect) in
                        drawn.iter().enumerate().filter(|(giver, _)| *giver != owner)
                    {
                        let given: f64 =
                            tiles.iter().map(|tile| bytes(&its_rect.intersection(tile))).sum();
                        if given > 0.0 {
                            traffic[giver].0 += given;
                            traffic[owner].1 += given;
                            traffic[giver].2 += 1.0;
                            traffic[owner].2 += 1.0;
                        }
                    }
                }
                let worst = traffic
                    .iter()
                    .map(|&(sent, received, messages)| {
                        self.sliced_secs(messages, f64::max(sent, received))
                    })
                    .fold(0.0, f64::max);
                let largest = plan.slices.iter().flatten().map(Rect::pixels).max().unwrap_or(0);
                let most_slices = (largest * P::BYTES).div_ceil(SLICE_BYTES).max(1);
                let collect =
                    collect(ranks - 1, whole.pixels() as f64 * (ranks - 1) as f64 / ranks as f64);
                worst.max(collect) + worst.min(collect) / most_slices as f64
            }
            Strategy::Tree => {
                let mut total = self.fold_secs::<P>(&folding, drawn);
                let mut stride = 1;
                while stride < folding.slots {
                    let of_slot = |slot| bytes(&bounds_of_slots(drawn, &folding, slot, stride));
                    let most = (stride..folding.slots)
                        .step_by(2 * stride)
                        .map(of_slot)
                        .fold(0.0, f64::max);
                    total += self.exchange_secs(1.0, most, most);
                    stride *= 2;
                }
                total
            }
            Strategy::BinarySwap | Strategy::RadixK { .. } => {
                let k = if let Strategy::RadixK { k } = strategy { k } else { 2 };
                let mut total = self.fold_secs::<P>(&folding, drawn);
                let (mut stride, mut parts) = (1, 1);
                while stride < folding.slots {
                    let members = k.min(folding.slots / stride);
                    // Shares of one round are about equal: the first and the middle one represent
                    // all.
                    let mut most = 0.0_f64;
                    for index in [0, parts * members / 2] {
                        let part = share(&whole, index, parts * members);
                        for base in (0..folding.slots).step_by(stride * members) {
                            let of = |m: usize| {
                                bytes(
                                    &bounds_of_slots(drawn, &folding, base + m * stride, stride)
                                        .intersection(&part),
                                )
                            };
                            most = most.max((1..members).map(of).sum());
                        }
                    }
                    let partners = (members - 1) as f64;
                    total += self.exchange_secs(2.0 * partners, most, most / partners);
                    (stride, parts) = (stride * members, parts * members);
                }
                total
                    + collect(
                        folding.slots - 1,
                        whole.pixels() as f64 * (folding.slots - 1) as f64 / folding.slots as f64,
                    )
            }
        }
    }

    /// The strategy with the smallest estimate.
    pub(crate) fn choose<P: Composite>(&self, drawn: &[Rect], root: bool) -> Strategy {
        self.best::<P>(drawn, root).0
    }

    /// The strategy with the smallest estimate, and that, in seconds.
    pub(crate) fn best<P: Composite>(&self, drawn: &[Rect], root: bool) -> (Strategy, f64) {
        let mut best =
            (Strategy::DirectSend, self.estimate_secs::<P>(Strategy::DirectSend, drawn, root));
        for strategy in [
            Strategy::RadixK { k: 16 },
            Strategy::RadixK { k: 8 },
            Strategy::BinarySwap,
            Strategy::Tree,
        ] {
            let secs = self.estimate_secs::<P>(strategy, drawn, root);
            if secs < best.1 {
                best = (strategy, secs);
            }
        }
        best
    }

    /// Seconds of a round of `messages` with `bytes`. The bytes of the first message are encoded
    /// before any other is sent, and those of the last are merged after it arrives (together
    /// `first_bytes`).
    fn exchange_secs(&self, messages: f64, bytes: f64, first_bytes: f64) -> f64 {
        self.sliced_secs(messages, bytes - first_bytes)
            + first_bytes * (self.byte_secs + 2.0 * LOCAL_BYTE_SECS)
    }

    /// The same where one slice is encoded and merged while another is in flight: the slower of
    /// both counts.
    fn sliced_secs(&self, messages: f64, bytes: f64) -> f64 {
        self.latency_secs
            + messages * (self.overhead_secs + LOCAL_MESSAGE_SECS)
            + bytes * self.byte_secs.max(2.0 * LOCAL_BYTE_SECS)
    }

    fn fold_secs<P: Composite>(&self, folding: &Folding, drawn: &[Rect]) -> f64 {
        let handed = |pair: usize| (drawn[2 * pair + 1].pixels() * P::BYTES) as f64;
        let most = (0..folding.pairs).map(handed).fold(0.0, f64::max);
        if folding.pairs == 0 { 0.0 } else { self.exchange_secs(1.0, most, most) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comm::threads;
    use crate::pixel::{DepthPixel, PremultipliedPixel};

    type P = DepthPixel<[u8; 4]>;

    #[test]
    fn all_ranks_measure_the_same_network_and_it_is_one() {
        for size in [1, 2, 5] {
            let found = threads::run(size, |mut comm| {
                NetworkCosts::measure(&mut comm, Duration::from_secs(20)).unwrap()
            });
            let found: Vec<NetworkCosts> =
                found.into_iter().map(|network| network.unwrap()).collect();
            assert!(found.iter().all(|network| *network == found[0]), "{found:?}");
            if size > 1 {
                assert!(
                    found[0].latency_secs > 0.0
                        && found[0].latency_secs < 1.0
                        && found[0].byte_secs > 0.0
                );
            }
        }
    }

    #[test]
    fn costs_measured_on_a_simulated_network_are_those_of_its_parameters() {
        use crate::comm::sim::{Compute, run};
        for network in [Network::QDR, Network::HDR, Network::GIGABIT] {
            let found = run(2, network, Compute::Given, |mut comm| {
                NetworkCosts::measure(&mut comm, Duration::from_secs(20)).expect("a measurement")
            });
            let (found, known) = (found[0].as_ref().expect("a rank"), NetworkCosts::of(&network));
            let near = |a: f64, b: f64| (a / b - 1.0).abs() < 0.1;
            assert!(near(found.latency_secs, known.latency_secs), "{found:?} {known:?}");
            assert!(near(found.byte_secs, known.byte_secs), "{found:?} {known:?}");
        }
    }

    #[test]
    fn the_choice_follows_the_network() {
        let dense = vec![Rect::of_size(1024, 1024); 64];
        // Bandwidth counts: every byte once.
        assert_eq!(NetworkCosts::QDR.choose::<P>(&dense[..8], true), Strategy::DirectSend);
        // Measured 8.1 ms against 12.6 by radix-k, which collects only when all is merged.
        let blended = NetworkCosts::QDR.choose::<PremultipliedPixel<[f32; 4]>>(&dense[..8], true);
        assert_eq!(blended, Strategy::DirectSend);
        // 127 messages to each of 128 ranks cost more than sending a seventh of the bytes again:
        // measured 7.6 ms against 5.9.
        let many = vec![Rect::of_size(1024, 1024); 128];
        assert!(matches!(NetworkCosts::QDR.choose::<P>(&many, true), Strategy::RadixK { .. }));
        // Messages count: few of them.
        let slow_messages =
            NetworkCosts { overhead_secs: 1e-3, latency_secs: 2e-3, byte_secs: 1e-12 };
        assert!(matches!(slow_messages.choose::<P>(&dense, true), Strategy::Tree));
        // Messages count, but so do bytes: groups.
        let both = NetworkCosts { overhead_secs: 2e-4, latency_secs: 4e-4, byte_secs: 3e-9 };
        assert!(matches!(
            both.choose::<P>(&dense, true),
            Strategy::RadixK { .. } | Strategy::BinarySwap
        ));
    }

    #[test]
    fn estimates_grow_with_bytes_and_are_zero_without_partners() {
        let network = NetworkCosts::QDR;
        let small = vec![Rect::of_size(100, 100); 8];
        let large = vec![Rect::of_size(1000, 1000); 8];
        for strategy in
            [Strategy::DirectSend, Strategy::Tree, Strategy::BinarySwap, Strategy::RadixK { k: 4 }]
        {
            assert!(
                network.estimate_secs::<P>(strategy, &small, true)
                    < network.estimate_secs::<P>(strategy, &large, true)
            );
            assert_eq!(network.estimate_secs::<P>(strategy, &large[..1], true), 0.0);
        }
        // The physical limit of dense images: 8 MB in over 3.2 GB/s, while colours go to the
        // root. Simulated by SMPI it takes 3.5 ms.
        let secs = network.estimate_secs::<P>(Strategy::DirectSend, &large, true);
        assert!(secs > 2.5e-3 && secs < 4.5e-3, "{secs}");
    }
}
