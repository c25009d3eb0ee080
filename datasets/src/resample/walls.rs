//! Finds which parts of a mesh's border are walls, so that a body can be told from an open border.
//!
//! Files say it in different ways, or not at all. Sources of evidence, the strongest first:
//!
//! 1. Points that the reader lists as those of walls ([`WALL_POINTS`]): patches of OpenFOAM.
//! 2. Blocks of surfaces or lines with the name of a body, such as `wall` or `cylinder`. Their
//!    points are points of the mesh.
//! 3. A velocity of exactly zero at points whose cells have gas in motion: a wall without slip.
//! 4. A part of the border that is closed in itself within the mesh's box: a hole in the flow.
//!
//! A wall of an inviscid flow that reaches the side of the box is not found without the first two.
//! Its velocity along the border is no evidence, because gas also flows along open borders.

use super::mesh::Mesh;
use super::on_cells::{Kind, Neighbours, OUTSIDE};
use super::reconstruct::first_at_place;
use crate::model::{Attributes, Dataset, WALL_POINTS, is_name_of_body};
use glam::DVec3;
use std::collections::HashSet;

/// Names of velocities and momenta, in lower case.
const VELOCITIES: [&str; 8] =
    ["u", "v", "vel", "velocity", "momentum", "rhou", "umean", "velocities"];

/// A speed below this part of the largest is zero: what a solver writes for a wall without slip.
const AT_REST: f64 = 1e-9;
/// Gas beside a wall that moves is faster than this part of the largest speed. Gas at rest far from
/// a jet is slower.
const IN_MOTION: f64 = 1e-6;
/// Points nearer to a side of the box than this part of its size lie in it.
const ON_SIDE: f64 = 1e-6;

/// The border of a mesh, with its walls.
#[derive(Debug, Clone, Default)]
pub struct Walls {
    /// Flag per point of the mesh.
    of_points: Vec<bool>,
    /// Corners of the faces of the border, one after the other.
    rings: Vec<u32>,
    faces: Vec<BorderFace>,
    evidence: Vec<String>,
}

/// A face of the border that does not lie in a side of the mesh's box.
#[derive(Debug, Clone, Copy)]
struct BorderFace {
    /// End of its corners.
    end: usize,
    cell: u32,
    /// Its number among the faces of the cell.
    number: u32,
    is_wall: bool,
}

impl Walls {
    /// Finds the walls of a mesh made of `data`. `revolved`: the plane will be revolved about the x
    /// axis, so that a hole may end at the axis.
    pub fn find(mesh: &Mesh, data: &Dataset, revolved: bool) -> Walls {
        let kinds: Vec<Kind> = (0..mesh.num_cells())
            .map(|c| if mesh.is_hidden(c) { Kind::Hidden } else { Kind::Gas })
            .collect();
        let same = first_at_place(mesh);
        let neighbours = Neighbours::of(mesh, &same, &kinds);
        let mut walls = Walls { of_points: vec![false; mesh.num_points()], ..Walls::default() };
        let listed = walls.add_listed(mesh, data);
        if !listed {
            walls.add_blocks(mesh, data);
            walls.add_without_slip(mesh, data);
        }
        let sides = Sides::of(mesh, revolved);
        for cell in 0..mesh.num_cells() {
            let beyond = neighbours.of_cell(cell);
            if !beyond.contains(&OUTSIDE) {
                continue;
            }
            let corners = mesh.corners(cell);
            let mut next = 0;
            corners.shape.each_face(|ring| {
                let number = next;
                next += 1;
                let ids = || ring.iter().map(|&i| corners.ids[i as usize]);
                if beyond[number] != OUTSIDE
                    || sides.hold(mesh, ids())
                    || is_face_of_plane(mesh, ids())
                {
                    return;
                }
                let is_wall = mesh.is_hidden(cell) || ids().all(|i| walls.of_points[i as usize]);
                walls.rings.extend(ids());
                let (end, cell, number) = (walls.rings.len(), cell as u32, number as u32);
                walls.faces.push(BorderFace { end, cell, number, is_wall });
            });
        }
        walls.add_holes(mesh, &same, &sides);
        walls
    }

    /// What the walls were found by, in words; empty if there are none.
    pub fn evidence(&self) -> &[String] {
        &self.evidence
    }

    /// Calls `f` with the corners of each face of the border that does not lie in a side of the
    /// mesh's box, and whether it is a wall.
    pub(super) fn each_face(&self, mut f: impl FnMut(&[u32], bool)) {
        let mut first = 0;
        for face in &self.faces {
            f(&self.rings[first..face.end], face.is_wall);
            first = face.end;
        }
    }

    /// The walls: cells, and numbers of faces among those of the cell.
    pub(super) fn of_cells(&self) -> impl Iterator<Item = (u32, u32)> {
        self.faces.iter().filter(|f| f.is_wall).map(|f| (f.cell, f.number))
    }

    /// The points that a reader lists. Returns whether there is a list, which may be empty.
    fn add_listed(&mut self, mesh: &Mesh, data: &Dataset) -> bool {
        let leaves = data.leaves();
        let list = |leaf: usize| leaves.get(leaf)?.attributes()?.field_array(WALL_POINTS);
        let (mut any, mut found) = (false, 0);
        mesh.each_leaf(|leaf, points| {
            let Some(ids) = list(leaf) else { return };
            any = true;
            // A plane has its points twice.
            let layers = if mesh.side_of_plane(points.start).is_some() { 2 } else { 1 };
            let count = points.len() / layers;
            for id in (0..ids.tuples()).map(|i| ids.get(i, 0) as usize).filter(|i| *i < count) {
                (0..layers).for_each(|l| self.of_points[points.start + l * count + id] = true);
                found += 1;
            }
        });
        if found > 0 {
            self.evidence.push("the boundary's patches that are walls".into());
        }
        any
    }

    /// The points of blocks with the name of a body.
    fn add_blocks(&mut self, mesh: &Mesh, data: &Dataset) {
        let mut names = Vec::new();
        let mut places: HashSet<[u64; 3]> = HashSet::new();
        let place = |p: DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
        each_named(data, false, &mut |name, leaf| {
            let points = match leaf {
                Dataset::PolyData(d) => &d.points,
                Dataset::UnstructuredGrid(d) if super::extrude::has_no_solids(d) => &d.points,
                _ => return,
            };
            names.push(format!("`{name}`"));
            places.extend((0..points.len()).map(|i| place(points.get(i))));
        });
        if places.is_empty() {
            return;
        }
        let mut found = 0;
        for i in 0..mesh.num_points() {
            if places.contains(&place(mesh.point(i))) {
                self.of_points[i] = true;
                found += 1;
            }
        }
        if found > 0 {
            self.evidence.push(format!("the surfaces {}", names.join(", ")));
        }
    }

    /// Points at rest beside gas in motion.
    fn add_without_slip(&mut self, mesh: &Mesh, data: &Dataset) {
        let is_velocity = |a: &&crate::model::DataArray| {
            let name = a.name.to_lowercase();
            let end = name.find(['[', '(', ' ']).unwrap_or(name.len());
            (2..=3).contains(&a.components) && VELOCITIES.contains(&name[..end].trim())
        };
        let of_leaf =
            |d: &&Dataset| Some(d.attributes()?.point.iter().find(is_velocity)?.name.clone());
        let Some(name) = data.leaves().iter().find_map(of_leaf) else { return };
        let speed =
            |a: &Attributes, i: usize| a.point_array(&name).map_or(f64::NAN, |a| a.magnitude(i));
        let speeds = mesh.gather_points(data, speed);
        let largest = speeds.iter().copied().filter(|s| s.is_finite()).fold(0.0, f64::max);
        let mut found = false;
        for cell in (0..mesh.num_cells()).filter(|c| !mesh.is_hidden(*c)) {
            let ids = mesh.corners(cell).ids;
            if ids.iter().any(|&i| speeds[i as usize] > IN_MOTION * largest) {
                for &i in &ids {
                    let rest = speeds[i as usize] <= AT_REST * largest;
                    self.of_points[i as usize] |= rest;
                    found |= rest;
                }
            }
        }
        if found {
            self.evidence.push(format!("`{name}` being zero, as at a wall without slip"));
        }
    }

    /// Parts of the border that are closed in themselves and touch no side of the box.
    fn add_holes(&mut self, mesh: &Mesh, same: &[u32], sides: &Sides) {
        let mut parent: Vec<u32> = (0..mesh.num_points() as u32).collect();
        let root = |parent: &mut Vec<u32>, mut i: u32| {
            while parent[i as usize] != i {
                parent[i as usize] = parent[parent[i as usize] as usize];
                i = parent[i as usize];
            }
            i
        };
        // The two layers of a plane are joined by faces.
        self.each_face(|ring, _| {
            let first = root(&mut parent, same[ring[0] as usize]);
            for &i in ring {
                let other = root(&mut parent, same[i as usize]);
                parent[other as usize] = first;
            }
        });
        let mut open = vec![false; mesh.num_points()];
        let mut at_border = vec![false; mesh.num_points()];
        self.each_face(|ring, _| {
            for &i in ring {
                at_border[i as usize] = true;
                let part = root(&mut parent, same[i as usize]) as usize;
                open[part] |= sides.touch(mesh.point(i as usize));
            }
        });
        let mut first = 0;
        let mut found = false;
        for k in 0..self.faces.len() {
            let part = root(&mut parent, same[self.rings[first] as usize]) as usize;
            let face = &mut self.faces[k];
            if !open[part] {
                found |= !face.is_wall;
                face.is_wall = true;
            }
            first = face.end;
        }
        if found {
            self.evidence.push("holes that the mesh encloses".into());
        }
    }
}

/// Calls `f` with each leaf below a block with the name of a body.
fn each_named(data: &Dataset, below: bool, f: &mut dyn FnMut(&str, &Dataset)) {
    let Dataset::MultiBlock(blocks) = data else { return };
    for block in blocks {
        let named = below || is_name_of_body(&block.name);
        match &block.data {
            Dataset::MultiBlock(_) => each_named(&block.data, named, f),
            leaf if named => f(&block.name, leaf),
            _ => {}
        }
    }
}

/// Whether a face is the polygon itself of a plane that got depth.
fn is_face_of_plane(mesh: &Mesh, mut ids: impl Iterator<Item = u32>) -> bool {
    let Some(first) = ids.next().and_then(|i| mesh.side_of_plane(i as usize)) else { return false };
    ids.all(|i| mesh.side_of_plane(i as usize) == Some(first))
}

/// The sides of the mesh's box at which a border is open.
struct Sides {
    low: DVec3,
    high: DVec3,
    near: DVec3,
    /// Whether a border that ends at the low or high side of an axis is open there.
    open: [[bool; 2]; 3],
}

impl Sides {
    fn of(mesh: &Mesh, revolved: bool) -> Sides {
        let (low, high) = mesh.bounds();
        let near = ON_SIDE * (high - low);
        let mut open = [[true; 2]; 3];
        if mesh.is_plane_with_depth() {
            // Along the depth, all points lie in a side.
            for axis in 0..3 {
                let flat = (0..mesh.num_points()).all(|i| {
                    let x = mesh.point(i)[axis];
                    !(x - low[axis] > near[axis] && high[axis] - x > near[axis])
                });
                open[axis] = [!flat; 2];
            }
        }
        open[1][0] &= !revolved;
        Sides { low, high, near, open }
    }

    /// Whether a point lies in a side at which a border is open.
    fn touch(&self, p: DVec3) -> bool {
        (0..3).any(|a| {
            self.open[a][0] && p[a] - self.low[a] <= self.near[a]
                || self.open[a][1] && self.high[a] - p[a] <= self.near[a]
        })
    }

    /// Whether all corners of a face lie in one side of the box.
    fn hold(&self, mesh: &Mesh, ids: impl Iterator<Item = u32> + Clone) -> bool {
        (0..3).any(|a| {
            let x = || ids.clone().map(|i| mesh.point(i as usize)[a]);
            x().all(|x| x - self.low[a] <= self.near[a])
                || x().all(|x| self.high[a] - x <= self.near[a])
        })
    }
}
