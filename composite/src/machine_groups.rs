//! Ranks on several machines, several on each: those of one machine merge in its memory first, and
//! one of each sends the result to the other machines.
//!
//! So a machine sends each pixel once, and with k ranks on each machine there are k² times fewer
//! messages. (Howison, Bethel and Childs, "MPI-hybrid parallelism for volume rendering on large,
//! multi-core systems", EGPGV 2010, measured this with threads in place of processes.)
use crate::comm::Communicator;
use crate::network_costs::{LOCAL_BYTE_SECS, LOCAL_MESSAGE_SECS, NetworkCosts};
use crate::pixel::{Composite, PixelFormat};
use crate::rect::Rect;
use std::ops::Range;

/// The ranks of one machine, which are neighbours in the order of compositing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct MachineGroup {
    /// Their order indices.
    pub(crate) members: Range<usize>,
    /// The one that gets the merged frame: the root of the image, else the first.
    pub(crate) leader: usize,
}

impl MachineGroup {
    /// The smallest rectangle around what its ranks drew.
    pub(crate) fn drawn(&self, drawn: &[Rect]) -> Rect {
        drawn[self.members.clone()].iter().fold(Rect::EMPTY, |all, rect| all.around(rect))
    }
}

/// The machines in the order of compositing, if their ranks share memory and merging them first
/// does not change a bit of the image. `order` has the ranks, of which the one at `root` gets the
/// image. The same on all ranks.
pub(crate) fn by_machine<P: PixelFormat>(
    comm: &dyn Communicator,
    order: &[usize],
    root: Option<usize>,
) -> Option<Vec<MachineGroup>> {
    let machines = comm.machines_with_shared_memory()?;
    let groups = groups_of(order, machines, root?)?;
    (P::HAS_DEPTH || keeps_grouping(&groups)).then_some(groups)
}

/// Whether a model finds it faster that machines merge first. `drawn` has the rectangles of all
/// ranks. With `root`, the image is collected.
pub(crate) fn pays<P: Composite>(
    groups: &[MachineGroup],
    network: &NetworkCosts,
    drawn: &[Rect],
    root: bool,
) -> bool {
    let secs = |network: &NetworkCosts, drawn: &[Rect], root| network.best::<P>(drawn, root).1;
    // The ranks of a machine share its wire, except for the image, which one rank collects.
    let ranks = groups.iter().map(|group| group.members.len()).max().unwrap_or(1);
    let shared = NetworkCosts { byte_secs: network.byte_secs * ranks as f64, ..*network };
    // Each rank copies what it drew, all merge it, and the leader copies the result. Each byte is
    // read and written, between two barriers.
    let merging = |group: &MachineGroup| {
        let bytes = |rect: &Rect| (rect.pixels() * P::BYTES) as f64;
        let of_ranks = drawn[group.members.clone()].iter().map(bytes);
        let (most, sum) = of_ranks.fold((0.0_f64, 0.0), |(m, s), bytes| (m.max(bytes), s + bytes));
        let copied = most + sum / group.members.len() as f64 + bytes(&group.drawn(drawn));
        2.0 * (LOCAL_BYTE_SECS * copied + LOCAL_MESSAGE_SECS)
    };
    let merged: Vec<Rect> = groups.iter().map(|group| group.drawn(drawn)).collect();
    let merging = groups.iter().map(merging).fold(0.0, f64::max);
    let sent = f64::max(secs(network, drawn, root), secs(&shared, drawn, false));
    merging + secs(network, &merged, root) < sent
}

/// `None` where ranks of a machine are not neighbours in the order: at equal depths the last rank
/// wins, which cannot be told from a pixel that was merged.
fn groups_of(order: &[usize], machines: &[usize], root: usize) -> Option<Vec<MachineGroup>> {
    let mut groups: Vec<MachineGroup> = Vec::new();
    let mut known = Vec::new();
    for (index, rank) in order.iter().enumerate() {
        let machine = *machines.get(*rank)?;
        match groups.last_mut() {
            Some(group) if known.last() == Some(&machine) => group.members.end = index + 1,
            _ if known.contains(&machine) => return None,
            _ => {
                known.push(machine);
                groups.push(MachineGroup { members: index..index + 1, leader: index });
            }
        }
        if let Some(group) = groups.last_mut().filter(|_| index == root) {
            group.leader = root;
        }
    }
    // With one rank on each machine there is nothing to merge.
    (groups.len() < order.len()).then_some(groups)
}

/// Whether blending machine by machine groups ranks as blending them in a row does: a balanced
/// tree over a power of two.
fn keeps_grouping(groups: &[MachineGroup]) -> bool {
    let size = groups.first().map_or(0, |group| group.members.len());
    groups.len() == 1
        || (groups.iter().all(|group| group.members.len() == size)
            && size.is_power_of_two()
            && groups.len().is_power_of_two())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn group(members: Range<usize>, leader: usize) -> MachineGroup {
        MachineGroup { members, leader }
    }

    #[test]
    fn neighbours_on_one_machine_are_a_group_and_the_root_leads_its_own() {
        let groups = groups_of(&[0, 1, 2, 3, 4], &[0, 0, 1, 1, 1], 3);
        assert_eq!(groups, Some(vec![group(0..2, 0), group(2..5, 3)]));
        // The order of compositing counts, not that of ranks.
        let groups = groups_of(&[3, 1, 0, 2], &[0, 1, 0, 1], 0);
        assert_eq!(groups, Some(vec![group(0..2, 0), group(2..4, 2)]));
        assert_eq!(groups_of(&[0, 1], &[0, 0], 1), Some(vec![group(0..2, 1)]));
    }

    #[test]
    fn ranks_that_take_turns_on_machines_and_single_ones_are_no_groups() {
        assert_eq!(groups_of(&[0, 1, 2, 3], &[0, 1, 0, 1], 0), None);
        assert_eq!(groups_of(&[0, 1, 2], &[0, 1, 2], 0), None);
        assert_eq!(groups_of(&[0, 1], &[0], 0), None);
    }

    #[test]
    fn the_model_merges_many_dense_ranks_of_a_machine_first_but_not_a_few_far_apart() {
        use crate::pixel::DepthPixel;
        let pays = |machines: usize, each: usize, rect: fn(usize) -> Rect| {
            let groups: Vec<_> =
                (0..machines).map(|m| group(m * each..(m + 1) * each, m * each)).collect();
            let drawn: Vec<_> = (0..machines * each).map(rect).collect();
            super::pays::<DepthPixel<[u8; 4]>>(&groups, &NetworkCosts::QDR, &drawn, true)
        };
        assert!(pays(8, 32, |_| Rect::of_size(1024, 1024)));
        // Each rank has a strip of its own: there is nothing to merge.
        let strip = |rank: usize| Rect {
            x0: 0,
            y0: 128 * rank as u32,
            x1: 1024,
            y1: 128 * (rank as u32 + 1),
        };
        assert!(!pays(4, 2, strip));
    }

    #[test]
    fn blending_by_machines_needs_equal_powers_of_two() {
        let by = |sizes: &[usize]| {
            let mut begin = 0;
            let next = |size: &usize| {
                begin += size;
                group(begin - size..begin, begin - size)
            };
            keeps_grouping(&sizes.iter().map(next).collect::<Vec<_>>())
        };
        assert!(by(&[2, 2, 2, 2]) && by(&[4, 4]) && by(&[5]));
        assert!(!by(&[2, 2, 2]) && !by(&[3, 3]) && !by(&[2, 4]));
    }
}
