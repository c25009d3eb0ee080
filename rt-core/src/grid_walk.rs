//! Traversal of the cells of a uniform grid along a ray. Every traversal of any part of the grid
//! finds the same cells.
//!
//! The ray parameter at which a grid plane is crossed is a pure function of the ray and the plane's
//! number. The order of planes crossed at the same parameter is fixed (x before y before z). Hence
//! blocks of cells that are traversed separately agree to the last bit on the sequence of cells and
//! on the parameters between them: a ray that leaves one block enters the next at the same
//! parameter. (Amanatides and Woo 1987 add increments instead; their sums differ between blocks.)

use glam::DVec3;

/// A ray in continuous grid indices: point (i,j,k) of the grid is at (i,j,k).
#[derive(Debug, Clone, Copy)]
pub(crate) struct IndexRay {
    pub(crate) o: [f64; 3],
    pub(crate) d: [f64; 3],
    inverse: [f64; 3],
}

/// The part of the ray inside one cell.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Crossing {
    /// Lowest point of the cell.
    pub(crate) cell: [i64; 3],
    pub(crate) t0: f64,
    pub(crate) t1: f64,
    /// Axis of the face through which the ray enters; `None` where the ray's range begins inside
    /// the cell.
    pub(crate) entry: Option<usize>,
    /// Axis of the face through which the ray leaves; `None` where the ray's range ends inside the
    /// cell.
    pub(crate) exit: Option<usize>,
}

impl IndexRay {
    /// Converts a ray relative to the grid's point (0,0,0).
    #[inline]
    pub(crate) fn new(o: DVec3, d: DVec3, spacing: DVec3) -> Self {
        let d = d / spacing;
        IndexRay { o: (o / spacing).to_array(), d: d.to_array(), inverse: d.recip().to_array() }
    }

    /// One of several rays that were converted together: `inverse` are the reciprocals of `d`.
    #[inline(always)]
    pub(crate) fn of_parts(o: [f64; 3], d: [f64; 3], inverse: [f64; 3]) -> Self {
        IndexRay { o, d, inverse }
    }

    /// Whether all its numbers and their reciprocals are finite, and it moves.
    #[inline]
    pub(crate) fn is_plain(&self) -> bool {
        let mut plain = self.d != [0.0; 3];
        for a in 0..3 {
            // The reciprocal of an infinite number is zero.
            let finite = self.inverse[a].is_finite() && self.inverse[a] != 0.0;
            plain &= self.o[a].is_finite() && (self.d[a] == 0.0 || finite);
        }
        plain
    }

    /// Parameter at which the ray crosses plane number `i` of `axis`. Undefined for axes along
    /// which the ray does not move.
    #[inline]
    fn plane(&self, axis: usize, i: i64) -> f64 {
        self.plane_at(axis, i as f64)
    }

    /// [`IndexRay::plane`] for the number of a plane as a float.
    #[inline(always)]
    pub(crate) fn plane_at(&self, axis: usize, i: f64) -> f64 {
        (i - self.o[axis]) * self.inverse[axis]
    }

    /// The continuous index at `t`.
    #[inline(always)]
    pub(crate) fn at(&self, t: f64) -> [f64; 3] {
        let at = |a: usize| self.o[a] + t * self.d[a];
        [at(0), at(1), at(2)]
    }

    /// Entry and exit position of a crossing inside its cell, 0..=1. The coordinate perpendicular
    /// to a face is exactly 0 or 1, and the other coordinates are the same numbers for both cells
    /// of the face.
    #[inline(always)]
    pub(crate) fn fractions(&self, c: &Crossing, size: i64) -> ([f64; 3], [f64; 3]) {
        let scale = 1.0 / size as f64;
        let (mut p, mut q) = (self.at(c.t0), self.at(c.t1));
        for a in 0..3 {
            let cell = c.cell[a] as f64;
            p[a] = ((p[a] - cell) * scale).clamp(0.0, 1.0);
            q[a] = ((q[a] - cell) * scale).clamp(0.0, 1.0);
        }
        if let Some(a) = c.entry {
            p[a] = if self.d[a] > 0.0 { 0.0 } else { 1.0 };
        }
        if let Some(a) = c.exit {
            q[a] = if self.d[a] > 0.0 { 1.0 } else { 0.0 };
        }
        (p, q)
    }

    /// Visits the cells of `lo..hi` that the ray crosses within `[t_min, t_max]`, in order, until
    /// `visit` returns false. Cells are `size` grid cells wide (`lo` must be a multiple of it; `hi`
    /// may cut the last one short). `last` is the number of cells of the whole grid per axis: a ray
    /// exactly in the grid's last plane belongs to the cell before it.
    #[inline]
    pub(crate) fn walk(
        &self,
        lo: [i64; 3],
        hi: [i64; 3],
        last: [i64; 3],
        size: i64,
        t_min: f64,
        t_max: f64,
        mut visit: impl FnMut(&Crossing) -> bool,
    ) {
        // Parameters and faces at which the ray enters and leaves the box. Of planes crossed at the
        // same parameter, the last is the entry and the first the exit.
        let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
        let (mut entry, mut exit) = (0, 0);
        for a in 0..3 {
            if self.d[a] == 0.0 {
                if self.o[a] < 0.0 || self.o[a] > last[a] as f64 {
                    return;
                }
                let cell = (self.o[a].floor() as i64).min(last[a] - 1);
                if cell < lo[a] || cell >= hi[a] {
                    return;
                }
                continue;
            }
            let (near, far) = if self.d[a] > 0.0 { (lo[a], hi[a]) } else { (hi[a], lo[a]) };
            let (near, far) = (self.plane(a, near), self.plane(a, far));
            if near >= enter {
                (enter, entry) = (near, a);
            }
            if far < leave {
                (leave, exit) = (far, a);
            }
        }
        let passes = enter < leave || (enter == leave && entry < exit);
        if !passes || enter >= t_max || leave <= t_min {
            return;
        }

        // The cell where the traversal starts. Planes that the ray has crossed by then are behind
        // it.
        let starts_inside = enter <= t_min;
        let start = if starts_inside { t_min } else { enter };
        let behind = |a: usize, i: i64| {
            let t = self.plane(a, i);
            t < start || (t == start && (starts_inside || a < entry))
        };
        let mut cell = [0i64; 3];
        // The next plane along each axis: its number and parameter.
        let mut plane = [0i64; 3];
        let mut next = [f64::INFINITY; 3];
        for a in 0..3 {
            let guess = (self.o[a] + start * self.d[a])
                .floor()
                .clamp(lo[a] as f64, (hi[a] - 1) as f64) as i64;
            let mut c = guess.div_euclid(size) * size;
            let end = |c: i64| (c + size).min(hi[a]);
            if self.d[a] > 0.0 {
                if !starts_inside && a == entry {
                    c = lo[a];
                } else {
                    while c > lo[a] && !behind(a, c) {
                        c -= size;
                    }
                    while end(c) < hi[a] && behind(a, end(c)) {
                        c += size;
                    }
                }
                plane[a] = end(c);
            } else if self.d[a] < 0.0 {
                if !starts_inside && a == entry {
                    c = (hi[a] - 1).div_euclid(size) * size;
                } else {
                    while end(c) < hi[a] && !behind(a, end(c)) {
                        c += size;
                    }
                    while c > lo[a] && behind(a, c) {
                        c -= size;
                    }
                }
                plane[a] = c;
            } else {
                c = (self.o[a].floor() as i64).min(last[a] - 1).div_euclid(size) * size;
            }
            cell[a] = c;
            if self.d[a] != 0.0 {
                next[a] = self.plane(a, plane[a]);
            }
        }

        // Steps from face to face.
        let mut crossing = Crossing {
            cell,
            t0: start,
            t1: start,
            entry: (!starts_inside).then_some(entry),
            exit: None,
        };
        // All three axes are computed and one is taken: an axis that is looked up by its number
        // would keep the arrays in memory, and a branch on it cannot be predicted.
        let forward: [bool; 3] = std::array::from_fn(|b| self.d[b] > 0.0);
        loop {
            let (a, leaves_at) = if next[0] <= next[1] && next[0] <= next[2] {
                (0, next[0])
            } else if next[1] <= next[2] {
                (1, next[1])
            } else {
                (2, next[2])
            };
            let ends_inside = leaves_at > t_max;
            crossing.t1 = if ends_inside { t_max } else { leaves_at.max(crossing.t0) };
            crossing.exit = (!ends_inside).then_some(a);
            if !visit(&crossing) || ends_inside {
                return;
            }
            let mut done = false;
            for b in 0..3 {
                let at_end = if forward[b] { plane[b] >= hi[b] } else { plane[b] <= lo[b] };
                let back = crossing.cell[b] - size;
                let cell = if forward[b] { plane[b] } else { back };
                let beyond = if forward[b] { (plane[b] + size).min(hi[b]) } else { back };
                let crossed_at = self.plane(b, beyond);
                let is_crossed = b == a;
                done |= is_crossed & at_end;
                crossing.cell[b] = if is_crossed { cell } else { crossing.cell[b] };
                plane[b] = if is_crossed { beyond } else { plane[b] };
                next[b] = if is_crossed { crossed_at } else { next[b] };
            }
            if done {
                return;
            }
            crossing.t0 = crossing.t1;
            crossing.entry = Some(a);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn collect(ray: &IndexRay, lo: [i64; 3], hi: [i64; 3], size: i64, t_min: f64) -> Vec<Crossing> {
        let mut all = Vec::new();
        ray.walk(lo, hi, [8; 3], size, t_min, 1e30, |c| {
            all.push(*c);
            true
        });
        all
    }

    /// Rays through cell corners, edges and faces, in both directions along every axis.
    fn awkward_rays() -> Vec<IndexRay> {
        let mut rays = Vec::new();
        for dx in [-1.0, -0.0, 0.0, 1.0, 0.5, 1e-12] {
            for dy in [-1.0, 0.0, 1.0, -0.25] {
                for dz in [-1.0, -0.0, 1.0, 0.125] {
                    if dx == 0.0 && dy == 0.0 && dz == 0.0 {
                        continue;
                    }
                    for through in
                        [[4.0, 4.0, 4.0], [2.0, 3.5, 5.0], [0.0, 8.0, 8.0], [1.0, 1.0 + 1e-15, 7.3]]
                    {
                        let d = DVec3::new(dx, dy, dz);
                        rays.push(IndexRay::new(DVec3::from(through) - 16.0 * d, d, DVec3::ONE));
                        rays.push(IndexRay::new(DVec3::from(through) - 17.3 * d, d, DVec3::ONE));
                    }
                }
            }
        }
        rays
    }

    #[test]
    fn blocks_walked_separately_give_the_cells_of_the_whole() {
        for (n, ray) in awkward_rays().iter().enumerate() {
            for t_min in [0.0, 16.0, 16.25] {
                let whole = collect(ray, [0; 3], [8; 3], 1, t_min);
                for w in whole.windows(2) {
                    assert_eq!(w[0].t1.to_bits(), w[1].t0.to_bits());
                    assert_eq!(w[0].exit, w[1].entry);
                    let apart: i64 = (0..3).map(|a| (w[0].cell[a] - w[1].cell[a]).abs()).sum();
                    assert_eq!(apart, 1, "one face at a time");
                }
                let mut parts = Vec::new();
                for b in 0..8i64 {
                    // Blocks of unequal size.
                    let (mut lo, mut hi) = ([0; 3], [0; 3]);
                    for a in 0..3 {
                        (lo[a], hi[a]) =
                            if b >> a & 1 == 0 { (0, 3 + a as i64) } else { (3 + a as i64, 8) };
                    }
                    parts.extend(collect(ray, lo, hi, 1, t_min));
                }
                assert_eq!(parts.len(), whole.len(), "ray {n} {ray:?} from {t_min}");
                for w in &whole {
                    let same = parts.iter().any(|p| {
                        p.cell == w.cell
                            && p.t0 == w.t0
                            && p.t1 == w.t1
                            && p.entry == w.entry
                            && p.exit == w.exit
                    });
                    assert!(same, "ray {n}: {w:?}");
                }
            }
        }
    }

    #[test]
    fn coarse_blocks_cover_the_same_stretch() {
        for ray in awkward_rays() {
            let fine = collect(&ray, [0; 3], [8; 3], 1, 0.0);
            let coarse = collect(&ray, [0; 3], [8; 3], 3, 0.0);
            assert_eq!(fine.first().map(|c| c.t0), coarse.first().map(|c| c.t0));
            assert_eq!(fine.last().map(|c| c.t1), coarse.last().map(|c| c.t1));
            for c in &fine {
                let block = c.cell.map(|i| i / 3 * 3);
                let holds = coarse.iter().any(|b| b.cell == block && b.t0 <= c.t0 && c.t1 <= b.t1);
                assert!(holds, "{ray:?} {c:?}");
            }
        }
    }

    #[test]
    fn visited_cells_contain_their_stretch_of_the_ray() {
        for ray in awkward_rays() {
            for c in collect(&ray, [0; 3], [8; 3], 1, 0.0) {
                let p = ray.at(0.5 * (c.t0 + c.t1));
                for a in 0..3 {
                    let low = c.cell[a] as f64;
                    assert!(p[a] > low - 1e-9 && p[a] < low + 1.0 + 1e-9, "{ray:?} {c:?} {p:?}");
                }
            }
        }
    }
}
