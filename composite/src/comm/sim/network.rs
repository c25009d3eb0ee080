//! Network parameters: the LogGP model.

/// A network in the parameters of LogGP (Culler et al., "LogP", PPoPP 1993; Alexandrov et al.,
/// "LogGP", SPAA 1995), with one network interface per rank. The messages in flight share both
/// directions of an interface fairly. Between interfaces the network is perfect, without
/// contention.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Network {
    /// Name in reports.
    pub name: &'static str,
    /// o: seconds a processor is busy with sending or receiving a message.
    pub overhead_secs: f64,
    /// L: seconds until the first byte is at the other end.
    pub latency_secs: f64,
    /// g: least seconds between messages of one interface.
    pub gap_secs: f64,
    /// G: seconds per byte.
    pub byte_secs: f64,
    /// Corrections for messages from a number of bytes on, longest first: factors of the latency
    /// and of the seconds per byte.
    pub corrections: &'static [(usize, f64, f64)],
}

/// SimGrid 3.32's default corrections for MPI (`smpi/lat-factor`, `smpi/bw-factor`): measured on
/// gigabit Ethernet, where TCP and the protocols of MPI delay long messages. The factors of bytes
/// are the inverse of those of bandwidth.
const SMPI: &[(usize, f64, f64)] = &[
    (65_472, 11.6436, 1.0 / 0.940_694),
    (15_424, 3.48845, 1.0 / 0.697_866),
    (9376, 2.59299, 1.0 / 0.58729),
    (5776, 2.18796, 1.0 / 1.08739),
    (3484, 1.88101, 1.0 / 0.77493),
    (1426, 1.61075, 1.0 / 0.608_902),
    (732, 1.9503, 1.0 / 0.341_987),
    (257, 1.95341, 1.0 / 0.338_112),
    (0, 2.01467, 1.0 / 0.812_084),
];

impl Network {
    /// 4X QDR InfiniBand, the network of the dissertation's cluster: 3.2 GB/s.
    pub const QDR: Network = Network {
        name: "QDR InfiniBand, 3.2 GB/s",
        overhead_secs: 0.4e-6,
        latency_secs: 1.0e-6,
        gap_secs: 0.1e-6,
        byte_secs: 1.0 / 3.2e9,
        corrections: &[],
    };

    /// The same with SimGrid's corrections, to compare times with those under SMPI.
    pub const QDR_AS_SMPI: Network = Network {
        name: "QDR InfiniBand, 3.2 GB/s, with SMPI's corrections",
        corrections: SMPI,
        ..Network::QDR
    };

    /// 4X HDR InfiniBand: 24 GB/s.
    pub const HDR: Network = Network {
        name: "HDR InfiniBand, 24 GB/s",
        latency_secs: 0.6e-6,
        byte_secs: 1.0 / 24e9,
        ..Network::QDR
    };

    /// Gigabit Ethernet.
    pub const GIGABIT: Network = Network {
        name: "gigabit Ethernet",
        overhead_secs: 5e-6,
        latency_secs: 25e-6,
        gap_secs: 1e-6,
        byte_secs: 1.0 / 125e6,
        corrections: &[],
    };

    /// No costs: measures what remains when messages are free.
    pub const FREE: Network = Network {
        name: "free",
        overhead_secs: 0.0,
        latency_secs: 0.0,
        gap_secs: 0.0,
        byte_secs: 0.0,
        corrections: &[],
    };

    /// Factors of latency and of seconds per byte for a message.
    pub(super) fn factors(&self, bytes: usize) -> (f64, f64) {
        let found = self.corrections.iter().find(|correction| bytes >= correction.0);
        found.map_or((1.0, 1.0), |&(_, latency, byte)| (latency, byte))
    }
}
