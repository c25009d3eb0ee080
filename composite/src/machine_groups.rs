//! Ranks on several machines, several on each: those of one machine merge in its memory first, and
//! one of each sends the result to the other machines.
//!
//! This sends what a machine shows instead of what each of its ranks drew, in the square of the
//! number of ranks a machine fewer messages. (The two levels of Wang, Yu and Ma, "Massively
//! parallel volume rendering using 2-3 swap image compositing", 2008, and of TOD-Tree, for
//! processes.)
use crate::comm::Communicator;
use crate::compositor::CompositingOrder;
use crate::pixel::PixelFormat;
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
/// does not change a bit of the image. The same on all ranks.
pub(crate) fn machine_groups<P: PixelFormat>(
    comm: &dyn Communicator,
    order: &CompositingOrder,
) -> Option<Vec<MachineGroup>> {
    let root = order.root_index?;
    let machines = comm.machines_with_shared_memory()?;
    let groups = groups_of(&order.ranks, machines, root)?;
    (P::HAS_DEPTH || keeps_grouping(&groups)).then_some(groups)
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
