//! Says what the nodes without values are: gas, bodies, or places without data.

use super::{Options, Outside, OutsideReport, Report, Role};
use crate::field::Node;
use datasets::resample::{Mark, Walls};

/// A smaller part of the border that nothing tells of is not worth a warning.
const LEAST_UNDECIDED_PERCENT: f64 = 1.0;

/// The kinds of the nodes; `None` if all are gas with values. `bodies` says of nodes outside the
/// mesh whether they are in bodies, if that was found out.
pub(super) fn nodes_of(
    marks: &[Mark],
    bodies: Option<&[bool]>,
    options: &Options,
    report: &mut Report,
) -> Option<Vec<Node>> {
    if marks.iter().all(|m| *m == Mark::Inside) {
        return None;
    }
    let [open, behind_wall] = options.outside.roles();
    let in_body = |i: usize| bodies.is_some_and(|b| b[i]);
    let node = |(i, m): (usize, &Mark)| match m {
        Mark::Inside => Node::Gas,
        Mark::Outside if in_body(i) => behind_wall.node(),
        Mark::Outside => open.node(),
        Mark::Hidden => options.hidden.node(),
        Mark::NotFinite => Node::Blank,
    };
    let nodes: Vec<Node> = marks.iter().enumerate().map(node).collect();
    let percent = |n: usize| 100.0 * n as f64 / marks.len() as f64;
    let share = |m: Mark| percent(marks.iter().filter(|x| **x == m).count());
    let outside = share(Mark::Outside);
    if outside > 0.0 {
        let found = report.outside.get_or_insert_default();
        found.percent = outside;
        found.bodies_percent = bodies.map(|b| percent(b.iter().filter(|x| **x).count()));
        let found = found.clone();
        report.warnings.extend(found.warning(options.outside, "lattice"));
    }
    let bad = share(Mark::NotFinite);
    if bad > 0.0 {
        report
            .warnings
            .push(format!("{bad:.2} % of the lattice have no finite index and are blank"));
    }
    Some(nodes)
}

impl Role {
    pub(super) fn node(self) -> Node {
        match self {
            Role::Blank => Node::Blank,
            Role::Solid => Node::Solid,
            Role::Gas => Node::Gas,
        }
    }
}

impl OutsideReport {
    pub(super) fn set_walls(&mut self, walls: &Walls) {
        self.walls_by = walls.evidence().to_vec();
        self.undecided_percent = 100.0 * walls.undecided();
    }

    /// What a user has to check, and how to change it. `of` is what the percentage is of.
    pub(super) fn warning(&self, outside: Outside, of: &str) -> Option<String> {
        let OutsideReport { percent, bodies_percent, walls_by, undecided_percent } = self;
        let is = format!("{percent:.1} % of the {of} lie outside the mesh");
        match (outside, &walls_by[..]) {
            (Outside::Auto, []) => Some(format!(
                "{is}, and no wall is found: they are taken as gas, continued from that beside \
                 them; where a body is there, set --outside solid or give it as --solid FILE"
            )),
            (Outside::Auto, by) => {
                let bodies =
                    bodies_percent.map_or(String::new(), |b| format!("; {b:.1} % are bodies"));
                let undecided = match *undecided_percent {
                    u if u >= LEAST_UNDECIDED_PERCENT => format!(
                        ". Nothing tells what is behind {u:.0} % of the border, which is taken as \
                         open: where a body is there, give it as --solid FILE or set --outside \
                         solid"
                    ),
                    _ => String::new(),
                };
                Some(format!(
                    "{is}: behind walls are bodies, and behind the rest of the border gas{bodies}. \
                     The walls are known by {}; if that is wrong, set --outside{undecided}",
                    by.join(" and ")
                ))
            }
            (Outside::Blank, _) => Some(format!("{is} and are blank, as --outside says")),
            (Outside::Gas, _) => Some(format!(
                "{is} and are taken as undisturbed flow; where a body is there, set --outside solid"
            )),
            (Outside::Solid, _) => None,
        }
    }
}
