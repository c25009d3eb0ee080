//! Lists of point ids, and the geometry of VTK's cell types.

/// Point ids of many cells: cell `i` is `connectivity[offsets[i]..offsets[i + 1]]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Cells {
    /// Starts of the cells, followed by the end of the last one: one entry more than there are
    /// cells.
    offsets: Vec<usize>,
    /// Point ids. [`Cells::NO_POINT`] replaces ids in the file that do not fit in 32 bits.
    connectivity: Vec<u32>,
}

impl Default for Cells {
    fn default() -> Self {
        Cells { offsets: vec![0], connectivity: Vec::new() }
    }
}

/// Reports offsets and connectivity that do not form cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BadOffsets {
    /// Index of the cell.
    pub cell: usize,
    /// End of the cell as given.
    pub end: i64,
    /// Smallest and largest valid end.
    pub allowed: (usize, usize),
}

impl Cells {
    /// Id that stands for a point that cannot exist.
    pub const NO_POINT: u32 = u32::MAX;

    /// An empty list.
    pub fn new() -> Self {
        Self::default()
    }

    /// Builds cells from the end of each cell (`offsets` in VTK XML) and the ids.
    pub fn from_ends(
        ends: impl Iterator<Item = i64>,
        connectivity: Vec<u32>,
    ) -> Result<Self, BadOffsets> {
        let mut offsets = vec![0usize];
        let mut last = 0usize;
        for (cell, end) in ends.enumerate() {
            match usize::try_from(end) {
                Ok(e) if e >= last && e <= connectivity.len() => last = e,
                _ => return Err(BadOffsets { cell, end, allowed: (last, connectivity.len()) }),
            }
            offsets.push(last);
        }
        Ok(Cells { offsets, connectivity })
    }

    /// Builds cells of `n` points each; a remainder is dropped.
    pub fn uniform(n: usize, mut connectivity: Vec<u32>) -> Self {
        let count = connectivity.len().checked_div(n).unwrap_or(0);
        connectivity.truncate(count * n);
        Cells { offsets: (0..=count).map(|i| i * n).collect(), connectivity }
    }

    /// Converts an id as VTK writes it (signed 64 bits).
    #[inline]
    pub fn id(value: i64) -> u32 {
        u32::try_from(value).unwrap_or(Self::NO_POINT)
    }

    /// Removes all cells and keeps the memory.
    pub fn clear(&mut self) {
        self.offsets.truncate(1);
        self.connectivity.clear();
    }

    /// Appends a cell.
    pub fn push(&mut self, ids: impl IntoIterator<Item = u32>) {
        self.connectivity.extend(ids);
        self.offsets.push(self.connectivity.len());
    }

    /// Appends all cells of `other` with `shift` added to their ids.
    pub fn append(&mut self, other: &Cells, shift: usize) {
        let start = self.connectivity.len();
        self.connectivity.extend(
            other.connectivity.iter().map(|&k| {
                if k == Self::NO_POINT { k } else { Self::id(i64::from(k) + shift as i64) }
            }),
        );
        self.offsets.extend(other.offsets[1..].iter().map(|o| o + start));
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }
    /// True when there are no cells.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Point ids of cell `i`. Panics when `i` is out of range.
    #[inline]
    pub fn get(&self, i: usize) -> &[u32] {
        &self.connectivity[self.offsets[i]..self.offsets[i + 1]]
    }
    /// Point ids of each cell.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[u32]> + Clone {
        self.offsets.windows(2).map(|w| &self.connectivity[w[0]..w[1]])
    }
    /// All point ids.
    pub fn connectivity(&self) -> &[u32] {
        &self.connectivity
    }
    /// End of each cell in [`Self::connectivity`].
    pub fn ends(&self) -> &[usize] {
        &self.offsets[1..]
    }
}

/// How a cell of a VTK type is rendered (numbers from `vtkCellType.h`, point orders from the VTK
/// book, fig. 5-2). Higher-order cells are rendered by their linear corners, which VTK stores
/// first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellType {
    /// Nothing to draw (type 0).
    Empty,
    /// Single points.
    Vertices,
    /// A chain of line segments; the number of ids that belong to it (0: all).
    Line(usize),
    /// A triangle strip.
    Strip,
    /// A flat face with this many corners (0: all ids).
    Polygon(usize),
    /// A quad whose corners come in raster order.
    Pixel,
    /// A solid with these faces.
    Solid(&'static [&'static [u8]]),
    /// A solid whose faces are listed separately.
    Polyhedron,
    /// An unsupported type.
    Unknown,
}

// Faces with outward normals (right-hand rule).
const TETRA: &[&[u8]] = &[&[0, 1, 3], &[1, 2, 3], &[2, 0, 3], &[0, 2, 1]];
const HEXA: &[&[u8]] =
    &[&[0, 4, 7, 3], &[1, 2, 6, 5], &[0, 1, 5, 4], &[3, 7, 6, 2], &[0, 3, 2, 1], &[4, 5, 6, 7]];
const VOXEL: &[&[u8]] =
    &[&[0, 4, 6, 2], &[1, 3, 7, 5], &[0, 1, 5, 4], &[2, 6, 7, 3], &[0, 2, 3, 1], &[4, 5, 7, 6]];
const WEDGE: &[&[u8]] = &[&[0, 1, 2], &[3, 5, 4], &[0, 3, 4, 1], &[1, 4, 5, 2], &[2, 5, 3, 0]];
const PYRAMID: &[&[u8]] = &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]];
const PENTAGONAL_PRISM: &[&[u8]] = &[
    &[0, 4, 3, 2, 1],
    &[5, 6, 7, 8, 9],
    &[0, 1, 6, 5],
    &[1, 2, 7, 6],
    &[2, 3, 8, 7],
    &[3, 4, 9, 8],
    &[4, 0, 5, 9],
];
const HEXAGONAL_PRISM: &[&[u8]] = &[
    &[0, 5, 4, 3, 2, 1],
    &[6, 7, 8, 9, 10, 11],
    &[0, 1, 7, 6],
    &[1, 2, 8, 7],
    &[2, 3, 9, 8],
    &[3, 4, 10, 9],
    &[4, 5, 11, 10],
    &[5, 0, 6, 11],
];

impl CellType {
    /// The shape of VTK cell type `number`.
    pub fn of(number: u8) -> CellType {
        match number {
            0 => CellType::Empty,
            1 | 2 => CellType::Vertices,
            3 | 21 | 35 | 68 | 75 => CellType::Line(2),
            4 => CellType::Line(0),
            5 | 22 | 34 | 69 | 76 => CellType::Polygon(3),
            6 => CellType::Strip,
            7 => CellType::Polygon(0),
            8 => CellType::Pixel,
            9 | 23 | 28 | 30 | 70 | 77 => CellType::Polygon(4),
            10 | 24 | 71 | 78 => CellType::Solid(TETRA),
            11 => CellType::Solid(VOXEL),
            12 | 25 | 29 | 33 | 72 | 79 => CellType::Solid(HEXA),
            13 | 26 | 31 | 32 | 73 | 80 => CellType::Solid(WEDGE),
            14 | 27 | 37 | 74 | 81 => CellType::Solid(PYRAMID),
            15 => CellType::Solid(PENTAGONAL_PRISM),
            16 => CellType::Solid(HEXAGONAL_PRISM),
            // Quadratic polygon: the first half are the corners.
            36 => CellType::Polygon(usize::MAX),
            42 => CellType::Polyhedron,
            _ => CellType::Unknown,
        }
    }
}
