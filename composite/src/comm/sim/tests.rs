use super::*;

const LONG: Duration = Duration::from_secs(1000);
const NETWORK: Network = Network {
    name: "test",
    overhead_secs: 1.0,
    latency_secs: 10.0,
    gap_secs: 0.0,
    byte_secs: 0.5,
    corrections: &[],
};

fn results<T: Send>(size: usize, work: impl Fn(SimComm) -> T + Sync) -> Vec<T> {
    run(size, NETWORK, Compute::Given, work).into_iter().map(Result::unwrap).collect()
}

#[test]
fn times_are_those_of_the_model() {
    let ends = results(2, |mut comm| {
        if comm.rank() == 0 {
            comm.compute(5.0);
            comm.send(1, 3, vec![0; 8]).unwrap();
        } else {
            comm.recv(0, 3, 8, LONG).unwrap();
        }
        comm.now()
    });
    // 5 computing, 1 sending; 10 latency, 4 bytes, 1 receiving.
    assert_eq!(ends, [6.0, 21.0]);
}

#[test]
fn who_lets_messages_leave_waits_for_as_many_as_it_must() {
    let ends = results(2, |mut comm| {
        let mut ends = Vec::new();
        if comm.rank() == 0 {
            comm.send(1, 3, vec![0; 8]).unwrap();
            comm.send(1, 3, vec![0; 8]).unwrap();
            for (tag, most) in [(4, 0), (3, 2), (3, 1), (3, 0)] {
                comm.throttle_sends(tag, most, LONG);
                ends.push(comm.now());
            }
        } else {
            for _ in 0..2 {
                comm.recv(0, 3, 8, LONG).unwrap();
            }
        }
        ends
    });
    // Sent at 1 and 2, four seconds of wire each: alone for a second, then shared. The first has
    // three seconds left at 2, so it ends at 8, and the second, which then has one left, at 9.
    assert_eq!(ends[0], [2.0, 2.0, 8.0, 9.0]);
}

#[test]
fn a_message_sent_later_in_real_time_but_earlier_in_virtual_time_is_taken_first() {
    for _ in 0..20 {
        let order = results(3, |mut comm| {
            match comm.rank() {
                0 => {
                    let mut posted: Vec<_> =
                        [1, 2].map(|r| comm.post_recv(r, 0, 8).unwrap()).into();
                    let first = comm.wait_any(&mut posted, LONG).unwrap().source;
                    let second = comm.wait_any(&mut posted, LONG).unwrap().source;
                    return vec![first, second];
                }
                // At once on the wall clock, late on its own.
                1 => comm.compute(100.0),
                // Late on the wall clock, early on its own.
                _ => std::thread::sleep(Duration::from_millis(2)),
            }
            comm.send(0, 0, vec![1]).unwrap();
            vec![]
        });
        assert_eq!(order[0], [2, 1]);
    }
}

#[test]
fn the_same_program_has_the_same_times_every_time() {
    let program = || {
        results(13, |mut comm| {
            let (rank, size) = (comm.rank(), comm.size());
            for round in 1..6 {
                comm.compute(((rank * 7 + round * 3) % 11) as f64);
                let to = (rank * round + 1) % size;
                let sizes: Vec<Vec<u8>> = comm.all_gather(&[to as u8], 1, LONG).unwrap();
                comm.send(to, 5, vec![0; rank * round]).unwrap();
                let mut posted: Vec<Receive> = (0..size)
                    .filter(|&from| usize::from(sizes[from][0]) == rank)
                    .map(|from| comm.post_recv(from, 5, 1000).unwrap())
                    .collect();
                while !posted.is_empty() {
                    comm.wait_any(&mut posted, LONG).unwrap();
                }
            }
            comm.barrier(LONG).unwrap();
            comm.now().to_bits()
        })
    };
    let first = program();
    for _ in 0..10 {
        assert_eq!(program(), first);
    }
}

#[test]
fn measured_computing_is_processor_time_not_waiting_time() {
    let ends: Vec<f64> = run(4, Network::FREE, Compute::Measured(1.0), |comm| {
        std::thread::sleep(Duration::from_millis(50));
        comm.now()
    })
    .into_iter()
    .map(Result::unwrap)
    .collect();
    assert!(ends.iter().all(|&secs| secs < 0.02), "{ends:?}");
}

#[test]
fn silence_and_lost_ranks_and_aborts_are_errors_and_not_hangs() {
    let outcomes = results(3, |mut comm| match comm.rank() {
        0 => comm.recv(1, 7, 8, Duration::from_secs(2)).map(|_| 0.0).or_else(|error| {
            assert_eq!(error, CommError::Timeout { rank: 0, peer: 1, tag: 7, waited_ms: 2000 });
            // Two seconds have passed, on its own clock.
            Ok::<_, CommError>(comm.now())
        }),
        1 => comm.recv(0, 8, 8, LONG).map(|_| 0.0),
        _ => Ok(0.0),
    });
    assert_eq!(outcomes[0], Ok(2.0));
    assert_eq!(outcomes[1], Err(CommError::PeerLost { rank: 1, peer: 0 }));
    let outcomes = run(4, NETWORK, Compute::Given, |mut comm| {
        if comm.rank() == 2 {
            comm.abort("out of memory");
        }
        comm.recv(2, 0, 8, LONG)
    });
    for outcome in outcomes {
        assert_eq!(outcome, Ok(Err(CommError::Aborted { by: 2, reason: "out of memory".into() })));
    }
    let outcomes = run(3, NETWORK, Compute::Given, |mut comm| {
        assert!(comm.rank() != 1, "on purpose");
        comm.recv(1, 0, 8, LONG)
    });
    assert_eq!(outcomes[0], Ok(Err(CommError::PeerLost { rank: 0, peer: 1 })));
    assert_eq!(outcomes[1], Err(CommError::Panicked { rank: 1, message: "on purpose".into() }));
}

#[test]
fn a_message_longer_than_its_receive_is_an_error() {
    let outcomes = results(2, |mut comm| {
        if comm.rank() == 0 {
            comm.send(1, 0, vec![0; 9]).unwrap();
            return None;
        }
        comm.recv(0, 0, 8, LONG).err()
    });
    assert_eq!(outcomes[1], Some(CommError::TooLong { rank: 1, peer: 0, tag: 0, capacity: 8 }));
}

#[test]
fn a_slow_modelled_rank_that_gives_signs_of_life_is_waited_for_beyond_the_timeout() {
    let patience = Duration::from_secs(2);
    let results = run(3, Network::QDR_AS_SMPI, Compute::Given, |mut comm| match comm.rank() {
        0 => comm.recv(1, 1, 8, patience).map(|_| ()),
        1 => {
            let came = comm.recv(2, 1, 8, patience)?;
            comm.send(0, 1, came)
        }
        _ => {
            for _ in 0..10 {
                comm.compute(1.0);
                comm.alive()?;
            }
            comm.send(1, 1, vec![1])
        }
    });
    assert!(results.into_iter().all(|result| result == Ok(Ok(()))));
    // Without a sign of life it times out.
    let results = run(2, Network::QDR_AS_SMPI, Compute::Given, |mut comm| match comm.rank() {
        0 => comm.recv(1, 1, 8, patience).map(|_| ()),
        _ => {
            comm.compute(10.0);
            comm.send(0, 1, vec![1])
        }
    });
    assert!(matches!(results[0], Ok(Err(CommError::Timeout { .. }))), "{:?}", results[0]);
}
