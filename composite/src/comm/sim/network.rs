//! What a message costs: the LogGP model.

/// A network in the parameters of LogGP (Culler et al., "LogP", PPoPP 1993; Alexandrov et al., "LogGP", SPAA 1995), with a network
/// interface per rank, whose two directions are shared fairly by the messages that are under way. Between interfaces the network is perfect:
/// nothing is in the way of anything else.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Network {
    /// For reports.
    pub name: &'static str,
    /// o: seconds a processor is busy with sending or receiving a message.
    pub overhead_secs: f64,
    /// L: seconds until the first byte is at the other end.
    pub latency_secs: f64,
    /// g: least seconds between messages of one interface.
    pub gap_secs: f64,
    /// G: seconds per byte.
    pub byte_secs: f64,
}

impl Network {
    /// 4X QDR InfiniBand, the network of the dissertation's cluster: 3.2 GB/s.
    pub const QDR: Network = Network {
        name: "QDR InfiniBand, 3.2 GB/s",
        overhead_secs: 0.4e-6,
        latency_secs: 1.0e-6,
        gap_secs: 0.1e-6,
        byte_secs: 1.0 / 3.2e9,
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
    };

    /// No costs: for what is left when messages are free.
    pub const FREE: Network =
        Network { name: "free", overhead_secs: 0.0, latency_secs: 0.0, gap_secs: 0.0, byte_secs: 0.0 };
}
