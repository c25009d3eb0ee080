//! Reasons to distrust a measurement: a working tree that no commit matches, a busy machine, or a
//! build that is not a release build.
//!
//! Reports show these reasons next to every record, even old ones. `bench run --record` rejects
//! measurements that have any.

use crate::machine::Machine;
use crate::record::Record;
use std::time::Duration;

/// Maximum load per core for a valid measurement; above it, other processes compete for the cores.
pub const MOST_LOAD_PER_CORE: f64 = 0.75;

impl Machine {
    /// Whether the tree had uncommitted changes. Older records mark this with a `+` after the
    /// commit.
    pub fn is_dirty(&self) -> bool {
        self.dirty.unwrap_or(false) || self.commit.as_ref().is_some_and(|c| c.ends_with('+'))
    }

    /// Reasons to distrust measurements in this state, each with the cure.
    pub fn doubts(&self) -> Vec<String> {
        let mut doubts = Vec::new();
        match &self.commit {
            None => doubts.push(
                "the commit is not known, so nobody can build this program again; measure inside \
                 the repository, \
                 with git installed"
                    .into(),
            ),
            Some(commit) if self.is_dirty() => doubts.push(format!(
                "the tree had uncommitted changes on top of {}, so nobody can build this program \
                 again; commit \
                 them, build, and measure again",
                commit.trim_end_matches('+')
            )),
            Some(_) => {}
        }
        let most = MOST_LOAD_PER_CORE * self.cores as f64;
        match self.load_1_min {
            None => doubts.push("the load of the machine is not known".into()),
            Some(load) if load > most => doubts.push(format!(
                "the load of the machine was {load:.2} when it began, above {most:.2} for {} \
                 cores; end what else \
                 runs (`uptime` shows the load, `top` who makes it) and measure again",
                self.cores
            )),
            Some(_) => {}
        }
        if !self.optimised {
            doubts.push(
                "a debug build: its times mean nothing; build with --release and measure again"
                    .into(),
            );
        }
        doubts
    }
}

impl Record {
    /// Reasons to distrust this record.
    pub fn doubts(&self) -> Vec<String> {
        self.machine.doubts()
    }
}

/// Decision of `--record` before a measurement.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Admission {
    /// There are no objections.
    Clean,
    /// Recorded because the command line insists; the objections are stored in the record.
    Despite(Vec<String>),
    /// Not recorded, for these reasons.
    Refused(Vec<String>),
}

/// Decides which measurements are recorded.
pub struct Gate {
    /// Whether `--record-despite-doubts` was given.
    pub insist: bool,
    /// Returns the current state of the machine.
    pub state: Box<dyn FnMut() -> Machine>,
    /// Waits for the duration; returns false when the user interrupts the wait.
    pub pause: Box<dyn FnMut(Duration) -> bool>,
}

/// Time for the load of our own previous experiment to decay: the one-minute average contains it
/// and loses it after two minutes.
const OWN_LOAD_DECAY: Duration = Duration::from_secs(180);
const STEP: Duration = Duration::from_secs(5);

impl Gate {
    /// Decides whether the `nth` experiment of a run (from 0) may be recorded. The first experiment
    /// is judged by the current load. Before the others, the gate waits until the load of the
    /// previous experiment has decayed.
    pub fn admit(&mut self, nth: usize) -> Admission {
        let mut machine = (self.state)();
        let mut waited = Duration::ZERO;
        let busy = |m: &Machine| {
            m.load_1_min.is_some_and(|load| load > MOST_LOAD_PER_CORE * m.cores as f64)
        };
        while nth > 0
            && !self.insist
            && busy(&machine)
            && waited < OWN_LOAD_DECAY
            && (self.pause)(STEP)
        {
            waited += STEP;
            machine = (self.state)();
        }
        match machine.doubts() {
            doubts if doubts.is_empty() => Admission::Clean,
            doubts if self.insist => Admission::Despite(doubts),
            doubts => Admission::Refused(doubts),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;
    use std::rc::Rc;

    fn quiet() -> Machine {
        Machine {
            cores: 2,
            load_1_min: Some(0.3),
            commit: Some("4ed43ff1a2b3".into()),
            dirty: Some(false),
            optimised: true,
            ..Machine::describe()
        }
    }

    /// A gate with machines of these loads, and the number of its pauses.
    fn gate(insist: bool, machine: Machine, loads: &[f64]) -> (Gate, Rc<RefCell<u32>>) {
        let (pauses, seen) = (Rc::new(RefCell::new(0)), RefCell::new(0));
        let (counted, loads) = (pauses.clone(), loads.to_vec());
        let state = move || {
            let n = *seen.borrow();
            *seen.borrow_mut() += 1;
            Machine { load_1_min: Some(loads[n.min(loads.len() - 1)]), ..machine.clone() }
        };
        let pause = move |_| {
            *counted.borrow_mut() += 1;
            true
        };
        (Gate { insist, state: Box::new(state), pause: Box::new(pause) }, pauses)
    }

    #[test]
    fn a_clean_tree_on_a_quiet_machine_is_recorded() {
        let (mut g, pauses) = gate(false, quiet(), &[1.5]);
        assert_eq!((g.admit(0), *pauses.borrow()), (Admission::Clean, 0));
    }

    #[test]
    fn a_dirty_tree_is_refused_with_the_cure() {
        let (mut g, _) = gate(false, Machine { dirty: Some(true), ..quiet() }, &[0.1]);
        let Admission::Refused(why) = g.admit(0) else { panic!("kept") };
        assert_eq!(why.len(), 1);
        assert!(
            why[0].contains("uncommitted changes") && why[0].contains("commit them"),
            "{why:?}"
        );
    }

    #[test]
    fn a_tree_without_a_known_commit_and_a_debug_build_are_refused() {
        let (mut g, _) = gate(false, Machine { commit: None, optimised: false, ..quiet() }, &[0.1]);
        let Admission::Refused(why) = g.admit(0) else { panic!("kept") };
        assert!(
            why[0].contains("commit is not known") && why[1].contains("debug build"),
            "{why:?}"
        );
    }

    #[test]
    fn the_bearable_load_grows_with_the_cores() {
        for (cores, load, refused) in [
            (2, 1.5, false),
            (2, 1.51, true),
            (4, 3.0, false),
            (4, 3.1, true),
            (1, 0.8, true),
            (64, 40.0, false),
        ] {
            let (mut g, _) = gate(false, Machine { cores, ..quiet() }, &[load]);
            assert_eq!(
                matches!(g.admit(0), Admission::Refused(_)),
                refused,
                "{cores} cores, {load}"
            );
        }
        let (mut g, _) = gate(false, quiet(), &[3.25]);
        let Admission::Refused(why) = g.admit(0) else { panic!("kept") };
        assert!(
            why[0].contains("3.25") && why[0].contains("1.50") && why[0].contains("uptime"),
            "{why:?}"
        );
    }

    #[test]
    fn who_insists_gets_the_record_with_what_spoke_against_it() {
        let (mut g, _) = gate(true, Machine { dirty: Some(true), ..quiet() }, &[5.0]);
        let Admission::Despite(why) = g.admit(1) else { panic!("not kept, or as if clean") };
        assert_eq!(why.len(), 2, "{why:?}");
    }

    #[test]
    fn the_load_of_the_experiment_before_is_waited_for_and_that_of_others_is_not() {
        let (mut g, pauses) = gate(false, quiet(), &[2.0, 1.9, 1.6, 1.4]);
        assert_eq!((g.admit(1), *pauses.borrow()), (Admission::Clean, 3));
        let (mut g, pauses) = gate(false, quiet(), &[8.0]);
        assert!(matches!(g.admit(1), Admission::Refused(_)));
        assert_eq!(*pauses.borrow(), 36);
        let (mut g, pauses) = gate(false, quiet(), &[2.0, 1.0]);
        assert!(matches!(g.admit(0), Admission::Refused(_)), "the first meets it as it is");
        assert_eq!(*pauses.borrow(), 0);
    }

    #[test]
    fn old_records_say_it_with_a_plus() {
        let old = Machine { commit: Some("53342d595e91+".into()), dirty: None, ..quiet() };
        assert!(old.is_dirty() && old.doubts()[0].contains("on top of 53342d595e91,"));
        assert!(!Machine { dirty: None, ..quiet() }.is_dirty());
    }
}
