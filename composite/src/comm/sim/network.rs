//! What a message costs: the LogGP model.

/// A network in the parameters of LogGP (Culler et al., "LogP", PPoPP 1993; Alexandrov et al., "LogGP", SPAA 1995), with a network
/// interface per rank that sends one message after the other, and receives one after the other. Between interfaces the network is perfect:
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

/// The two ends of a rank's interface: when each is free again.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Interface {
    out_free_secs: f64,
    in_free_secs: f64,
}

impl Network {
    /// Sends `bytes` at `now_secs`; returns when the last byte is there.
    pub(super) fn transfer(
        &self,
        interfaces: &mut [Interface],
        (from, to): (usize, usize),
        now_secs: f64,
        bytes: usize,
    ) -> f64 {
        if from == to {
            return now_secs;
        }
        let busy = (bytes as f64 * self.byte_secs).max(self.gap_secs);
        let out = &mut interfaces[from].out_free_secs;
        let start = now_secs.max(*out);
        *out = start + busy;
        let into = &mut interfaces[to].in_free_secs;
        let start = (start + self.latency_secs).max(*into);
        *into = start + busy;
        start + busy
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NETWORK: Network =
        Network { name: "test", overhead_secs: 0.0, latency_secs: 10.0, gap_secs: 1.0, byte_secs: 0.5 };

    #[test]
    fn a_lone_message_takes_latency_and_bytes() {
        let mut ends = [Interface::default(); 2];
        assert_eq!(NETWORK.transfer(&mut ends, (0, 1), 100.0, 8), 114.0);
        assert_eq!(NETWORK.transfer(&mut ends, (1, 1), 7.0, 800), 7.0, "nothing leaves the rank");
    }

    #[test]
    fn messages_queue_at_both_ends() {
        let mut ends = [Interface::default(); 3];
        // One sender: the second message waits until the first has left.
        assert_eq!(NETWORK.transfer(&mut ends, (0, 1), 0.0, 8), 14.0);
        assert_eq!(NETWORK.transfer(&mut ends, (0, 2), 0.0, 8), 18.0);
        // One receiver: the second message waits until the first is in.
        let mut ends = [Interface::default(); 3];
        assert_eq!(NETWORK.transfer(&mut ends, (0, 2), 0.0, 8), 14.0);
        assert_eq!(NETWORK.transfer(&mut ends, (1, 2), 0.0, 8), 18.0);
        // Short messages have a gap.
        let mut ends = [Interface::default(); 2];
        assert_eq!(NETWORK.transfer(&mut ends, (0, 1), 0.0, 0), 11.0);
        assert_eq!(NETWORK.transfer(&mut ends, (0, 1), 0.0, 0), 12.0);
    }
}
