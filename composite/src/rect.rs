//! Half-open rectangles of pixels: what a rank drew, the tile it owns, the rectangle of a message.

/// Pixels with `x0 <= x < x1` and `y0 <= y < y1`; empty where an end is not above its beginning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Hash)]
pub struct Rect {
    /// First column.
    pub x0: u32,
    /// First row.
    pub y0: u32,
    /// One past the last column.
    pub x1: u32,
    /// One past the last row.
    pub y1: u32,
}

impl Rect {
    /// No pixel.
    pub const EMPTY: Self = Self { x0: 0, y0: 0, x1: 0, y1: 0 };

    /// All pixels of an image.
    pub fn of_size(width_px: u32, height_px: u32) -> Self {
        Self { x0: 0, y0: 0, x1: width_px, y1: height_px }
    }

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.x1.saturating_sub(self.x0) as usize
    }

    /// Number of rows.
    pub fn height(&self) -> usize {
        self.y1.saturating_sub(self.y0) as usize
    }

    /// Number of pixels; cannot overflow where `usize` has 64 bits.
    pub fn pixels(&self) -> usize {
        self.width() * self.height()
    }

    /// Whether it contains no pixel.
    pub fn is_empty(&self) -> bool {
        self.x1 <= self.x0 || self.y1 <= self.y0
    }

    /// The common pixels of both; [`Rect::EMPTY`] if there are none.
    pub fn intersection(&self, other: &Self) -> Self {
        let both = Self {
            x0: self.x0.max(other.x0),
            y0: self.y0.max(other.y0),
            x1: self.x1.min(other.x1),
            y1: self.y1.min(other.y1),
        };
        if both.is_empty() { Self::EMPTY } else { both }
    }

    /// The smallest rectangle around both.
    pub fn around(&self, other: &Self) -> Self {
        match (self.is_empty(), other.is_empty()) {
            (true, true) => Self::EMPTY,
            (true, false) => *other,
            (false, true) => *self,
            (false, false) => Self {
                x0: self.x0.min(other.x0),
                y0: self.y0.min(other.y0),
                x1: self.x1.max(other.x1),
                y1: self.y1.max(other.y1),
            },
        }
    }

    /// Whether every pixel of `other` is in this one.
    pub fn contains(&self, other: &Self) -> bool {
        other.is_empty()
            || (self.x0 <= other.x0
                && self.y0 <= other.y0
                && self.x1 >= other.x1
                && self.y1 >= other.y1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_rectangles_are_neutral_around_and_absorbing_in_intersections() {
        let some = Rect { x0: 2, y0: 3, x1: 7, y1: 4 };
        let inside_out = Rect { x0: 9, y0: 3, x1: 1, y1: 4 };
        assert!(inside_out.is_empty());
        assert_eq!(inside_out.pixels(), 0);
        assert_eq!(some.around(&inside_out), some);
        assert_eq!(inside_out.around(&some), some);
        assert_eq!(some.intersection(&inside_out), Rect::EMPTY);
        assert!(some.contains(&inside_out));
        assert_eq!(some.intersection(&Rect::of_size(3, 100)), Rect { x0: 2, y0: 3, x1: 3, y1: 4 });
    }

    #[test]
    fn the_largest_image_has_more_than_two_to_the_31_pixels() {
        let all = Rect::of_size(u32::MAX, u32::MAX);
        assert_eq!(all.pixels(), 0xffff_fffe_0000_0001);
    }
}
