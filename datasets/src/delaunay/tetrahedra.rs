//! Tetrahedra with their neighbours, and the hole that a new point makes in them.

use super::predicates::{Place, conflicts, orientation};

/// The corner at infinity: a tetrahedron with it stands behind each triangle of the convex hull, so
/// that every face has two sides.
pub(super) const INFINITE: u32 = u32::MAX;

/// A triangulation of space. Neighbour `i` of a tetrahedron lies behind the face that its corner
/// `i` is not part of.
#[derive(Debug)]
pub(super) struct Tetrahedra {
    pub(super) corners: Vec<[u32; 4]>,
    neighbours: Vec<[u32; 4]>,
    /// The step that last visited a tetrahedron, and whether the point of that step is in conflict
    /// with it.
    visited: Vec<(u32, bool)>,
    free: Vec<u32>,
    step: u32,
    /// A finite tetrahedron near the last point.
    last: u32,
    // Kept from point to point for their memory.
    cavity: Vec<u32>,
    border: Vec<(u32, usize)>,
    made: Vec<u32>,
}

impl Tetrahedra {
    /// The triangulation of four points, whose orientation is 1.
    pub(super) fn of_one(corners: [u32; 4], points: usize) -> Tetrahedra {
        let mut all = Tetrahedra {
            corners: Vec::with_capacity(7 * points),
            neighbours: Vec::with_capacity(7 * points),
            visited: Vec::with_capacity(7 * points),
            free: Vec::new(),
            step: 0,
            last: 0,
            cavity: Vec::new(),
            border: Vec::new(),
            made: Vec::new(),
        };
        all.add(corners);
        for i in 0..4 {
            // Seen from outside, the face is turned: swapping two corners does that.
            let mut outer = corners;
            outer[i] = INFINITE;
            outer.swap((i + 1) & 3, (i + 2) & 3);
            all.add(outer);
        }
        for t in 0..5 {
            for i in 0..4 {
                let mut face = all.corners[t];
                face[i] = face[(i + 1) & 3];
                let shares = |other: &[u32; 4]| face.iter().all(|c| other.contains(c));
                let found = (0..5).find(|&o| o != t && shares(&all.corners[o]));
                all.neighbours[t][i] = found.unwrap_or(t) as u32;
            }
        }
        all
    }

    fn add(&mut self, corners: [u32; 4]) -> u32 {
        if let Some(t) = self.free.pop() {
            self.corners[t as usize] = corners;
            self.visited[t as usize] = (0, false);
            return t;
        }
        self.corners.push(corners);
        self.neighbours.push([0; 4]);
        self.visited.push((0, false));
        (self.corners.len() - 1) as u32
    }

    /// Finite tetrahedra.
    pub(super) fn finite(&self) -> impl Iterator<Item = [u32; 4]> + '_ {
        let mut dead = vec![false; self.corners.len()];
        self.free.iter().for_each(|t| dead[*t as usize] = true);
        let alive = self.corners.iter().zip(dead).filter(|(_, dead)| !dead).map(|(c, _)| *c);
        alive.filter(|c| !c.contains(&INFINITE))
    }

    /// Adds a point at a place where there is none.
    pub(super) fn insert(&mut self, places: &[Place], point: u32) {
        let start = self.walk(places, places[point as usize]);
        self.find_cavity(places, start, point);
        self.fill_cavity(point);
    }

    /// A tetrahedron that contains the place, or one behind a face of the hull that is visible from
    /// it. The walk steps through any face with the place on its other side; in a Delaunay
    /// triangulation it cannot run in circles (Edelsbrunner 1990).
    fn walk(&self, places: &[Place], to: Place) -> u32 {
        let (mut at, mut from) = (self.last, u32::MAX);
        'walk: loop {
            let corners = self.corners[at as usize];
            if corners.contains(&INFINITE) {
                return at;
            }
            let p = corners.map(|c| places[c as usize]);
            for i in 0..4 {
                let next = self.neighbours[at as usize][i];
                if next == from {
                    continue;
                }
                let mut with = p;
                with[i] = to;
                if orientation(with[0], with[1], with[2], with[3]) < 0 {
                    (from, at) = (at, next);
                    continue 'walk;
                }
            }
            return at;
        }
    }

    /// Whether the sphere of a tetrahedron contains the point. Behind the hull, the sphere is the
    /// half space outside of the face; in the plane of the face, it is that of the finite
    /// neighbour.
    fn is_in_conflict(&self, places: &[Place], t: u32, point: u32) -> bool {
        let corners = self.corners[t as usize];
        let Some(i) = corners.iter().position(|c| *c == INFINITE) else {
            return conflicts(places, corners, point);
        };
        let mut with = corners;
        with[i] = point;
        let p = with.map(|c| places[c as usize]);
        match orientation(p[0], p[1], p[2], p[3]) {
            0 => {
                let inner = self.neighbours[t as usize][i];
                conflicts(places, self.corners[inner as usize], point)
            }
            sign => sign > 0,
        }
    }

    /// Collects all tetrahedra in conflict with the point, and the faces around them.
    fn find_cavity(&mut self, places: &[Place], start: u32, point: u32) {
        self.step += 1;
        self.cavity.clear();
        self.border.clear();
        self.visited[start as usize] = (self.step, true);
        self.cavity.push(start);
        let mut next = 0;
        while next < self.cavity.len() {
            let t = self.cavity[next];
            next += 1;
            for i in 0..4 {
                let other = self.neighbours[t as usize][i];
                let conflict = match self.visited[other as usize] {
                    (step, conflict) if step == self.step => conflict,
                    _ => {
                        let conflict = self.is_in_conflict(places, other, point);
                        self.visited[other as usize] = (self.step, conflict);
                        if conflict {
                            self.cavity.push(other);
                        }
                        conflict
                    }
                };
                if !conflict {
                    self.border.push((t, i));
                }
            }
        }
    }

    /// Replaces the tetrahedra of the cavity by those between its border and the point.
    fn fill_cavity(&mut self, point: u32) {
        let border = std::mem::take(&mut self.border);
        self.made.clear();
        for &(t, i) in &border {
            let mut corners = self.corners[t as usize];
            corners[i] = point;
            let made = self.add(corners);
            let outer = self.neighbours[t as usize][i];
            self.neighbours[made as usize][i] = outer;
            let back = self.neighbours[outer as usize].iter().position(|n| *n == t);
            self.neighbours[outer as usize][back.unwrap_or(0)] = made;
            // The old tetrahedron leads to the new one now, which the rounds below end at.
            self.neighbours[t as usize][i] = made;
            self.made.push(made);
        }
        for (k, &(t, i)) in border.iter().enumerate() {
            for j in (0..4).filter(|j| *j != i) {
                self.neighbours[self.made[k] as usize][j] = self.beyond_edge(t, i, j);
            }
        }
        let finite = |t: &&u32| !self.corners[**t as usize].contains(&INFINITE);
        self.last = self.made.iter().find(finite).copied().unwrap_or(self.last);
        self.free.extend_from_slice(&self.cavity);
        self.border = border;
    }

    /// The new tetrahedron at the other side of an edge: the one without corners `i` and `j` of
    /// `t`, whose face `i` is in the border. Goes round the edge inside the cavity.
    fn beyond_edge(&self, t: u32, i: usize, j: usize) -> u32 {
        let (mut t, mut i, mut j) = (t, i, j);
        loop {
            let next = self.neighbours[t as usize][j];
            if self.visited[next as usize] != (self.step, true) {
                return next;
            }
            let shared = self.corners[t as usize][i];
            let corners = self.corners[next as usize];
            let entered = self.neighbours[next as usize].iter().position(|n| *n == t);
            j = corners.iter().position(|c| *c == shared).unwrap_or(0);
            i = entered.unwrap_or(0);
            t = next;
        }
    }
}
