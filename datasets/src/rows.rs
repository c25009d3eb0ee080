//! Lists of numbers, one after the other in memory.

/// Rows of different lengths.
pub(crate) struct Rows {
    starts: Vec<usize>,
    values: Vec<u32>,
}

impl Rows {
    /// No rows.
    pub(crate) fn new() -> Rows {
        Rows { starts: vec![0], values: vec![] }
    }

    pub(crate) fn push(&mut self, row: &[u32]) {
        self.values.extend(row);
        self.starts.push(self.values.len());
    }

    pub(crate) fn row(&self, i: usize) -> &[u32] {
        &self.values[self.starts[i]..self.starts[i + 1]]
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &[u32]> + Clone {
        self.starts.windows(2).map(|ends| &self.values[ends[0]..ends[1]])
    }

    /// For each number below `count`, the rows that it is in, in order: of the corners of cells,
    /// the cells around points.
    pub(crate) fn inverse<'a>(rows: impl Iterator<Item = &'a [u32]> + Clone, count: usize) -> Rows {
        let mut starts = vec![0usize; count + 1];
        rows.clone().flatten().for_each(|&v| starts[v as usize + 1] += 1);
        for i in 0..count {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut values = vec![0u32; starts[count]];
        for (row, number) in rows.zip(0u32..) {
            for &v in row {
                values[next[v as usize]] = number;
                next[v as usize] += 1;
            }
        }
        Rows { starts, values }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_has_each_row_once_for_each_of_its_numbers() {
        let mut rows = Rows::new();
        for row in [&[2, 0][..], &[], &[0, 3], &[2, 0]] {
            rows.push(row);
        }
        let inverse = Rows::inverse(rows.iter(), 5);
        let expected: [&[u32]; 5] = [&[0, 2, 3], &[], &[0, 3], &[2], &[]];
        assert!(inverse.iter().eq(expected));
        assert_eq!(inverse.row(2), [0, 3]);
        assert!(Rows::inverse(inverse.iter(), 4).iter().eq([&[0, 2][..], &[], &[0, 3], &[0, 2]]));
    }
}
