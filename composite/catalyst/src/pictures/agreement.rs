//! What ranks tell each other before a picture: whether each can go on, and what all have together.

use composite::render::FrameError;
use composite::{CommError, Communicator};
use rt_core::glam::DVec3;
use std::time::Duration;

/// Most bytes that a rank tells.
const LONGEST: usize = 1 << 20;

/// The ranks, how long they wait for each other, and what each may use.
pub struct Group<'c> {
    /// The ranks.
    pub comm: &'c mut dyn Communicator,
    /// Longest wait for another rank that gives no sign of life.
    pub timeout: Duration,
    /// A rank uses all processors that it may, and not one.
    pub threads: bool,
}

/// Why there is no picture. Every rank has an error then.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// What a rank has cannot be drawn, or its file cannot be written. The ranks can go on.
    #[error("rank {rank}: {reason}")]
    Rank {
        /// Which one.
        rank: usize,
        /// What is wrong.
        reason: String,
    },
    /// What ranks have does not fit together. The ranks can go on.
    #[error("{reason}")]
    Contradiction {
        /// What does not fit.
        reason: String,
    },
    /// There is no such view. The ranks can go on.
    #[error("the view: {reason}")]
    Camera {
        /// What is wrong.
        reason: String,
    },
    /// Rendering.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The transport.
    #[error(transparent)]
    Comm(#[from] CommError),
}

impl PictureError {
    /// Whether the ranks can make the next picture.
    pub fn is_agreed(&self) -> bool {
        match self {
            PictureError::Frame(e) => {
                matches!(e, FrameError::Contradiction { .. } | FrameError::RankScene { .. })
            }
            PictureError::Comm(_) => false,
            _ => true,
        }
    }
}

impl Group<'_> {
    /// What all ranks give, in their order; or, on all ranks, the failure of the first that has
    /// one.
    pub(super) fn agree(
        &mut self,
        mine: &Result<Vec<u8>, String>,
    ) -> Result<Vec<Vec<u8>>, PictureError> {
        let (kind, content) = match mine {
            Ok(bytes) => (0, &bytes[..]),
            // Texts of a line or two; their first part will do.
            Err(reason) => (1, &reason.as_bytes()[..reason.len().min(LONGEST - 1)]),
        };
        let message = [&[kind], content].concat();
        let all = self.comm.all_gather(&message, LONGEST, self.timeout)?;
        let mut contents = Vec::with_capacity(all.len());
        for (rank, message) in all.into_iter().enumerate() {
            match message.split_first() {
                Some((0, content)) => contents.push(content.to_vec()),
                Some((_, reason)) => {
                    let reason = String::from_utf8_lossy(reason).into_owned();
                    return Err(PictureError::Rank { rank, reason });
                }
                None => return Err(unusable(rank)),
            }
        }
        Ok(contents)
    }

    /// Sums over all ranks.
    pub(super) fn totals(&mut self, mine: &Result<Totals, String>) -> Result<Totals, PictureError> {
        let mine = mine.as_ref().map(|t| t.to_bytes()).map_err(String::clone);
        let mut sum = Totals::NOTHING;
        for (rank, bytes) in self.agree(&mine)?.iter().enumerate() {
            sum = sum.with(&Totals::from_bytes(bytes).ok_or_else(|| unusable(rank))?);
        }
        Ok(sum)
    }
}

fn unusable(rank: usize) -> PictureError {
    let reason = "it told what no rank can have; all ranks must run the same version".into();
    PictureError::Rank { rank, reason }
}

/// Bounds and values, of one rank or of all.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Totals {
    pub(super) low: DVec3,
    pub(super) high: DVec3,
    /// Finite values of the array.
    pub(super) range: [f64; 2],
    /// Whether some values belong to points, and some to cells.
    pub(super) values_of: [bool; 2],
}

impl Totals {
    pub(super) const NOTHING: Totals = Totals {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
        range: [f64::INFINITY, f64::NEG_INFINITY],
        values_of: [false; 2],
    };
    const BYTES: usize = 8 * 8 + 2;

    pub(super) fn is_nothing(&self) -> bool {
        !(self.low.is_finite() && self.high.is_finite())
    }

    /// With the bounds of a box; one that is none adds nothing.
    pub(super) fn with_box(mut self, [low, high]: [DVec3; 2]) -> Totals {
        if low.is_finite() && high.is_finite() {
            (self.low, self.high) = (self.low.min(low), self.high.max(high));
        }
        self
    }

    /// With values; those that are not finite add nothing.
    pub(super) fn with_values(mut self, values: impl Iterator<Item = f64>) -> Totals {
        for v in values.filter(|v| v.is_finite()) {
            self.range = [self.range[0].min(v), self.range[1].max(v)];
        }
        self
    }

    /// The sum of both.
    pub(super) fn with(&self, other: &Totals) -> Totals {
        let ends = other.range.into_iter();
        let sum = self.with_box([other.low, other.high]).with_values(ends);
        let values_of = std::array::from_fn(|k| self.values_of[k] || other.values_of[k]);
        Totals { values_of, ..sum }
    }

    /// The values, as the ends of a map of colours: two different numbers.
    pub(super) fn color_range(&self, given: Option<[f32; 2]>) -> [f32; 2] {
        if let Some(range) = given {
            return range;
        }
        let [low, high] = self.range.map(|v| v as f32);
        match (low < high, low.is_finite()) {
            (true, true) => [low, high],
            (false, true) => [low, (low + low.abs().max(1.0)).min(f32::MAX)],
            (_, false) => [0.0, 1.0],
        }
    }

    fn to_bytes(self) -> Vec<u8> {
        let [a, b] = [self.low, self.high].map(|v| v.to_array());
        let numbers = [&a[..], &b, &self.range].concat();
        let bytes = numbers.iter().flat_map(|v| v.to_le_bytes());
        bytes.chain(self.values_of.map(u8::from)).collect()
    }

    fn from_bytes(bytes: &[u8]) -> Option<Totals> {
        let bytes: &[u8; Self::BYTES] = bytes.try_into().ok()?;
        let (numbers, flags) = bytes.split_at(64);
        let n: Vec<f64> = numbers.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
        if n.iter().any(|v| v.is_nan()) {
            return None;
        }
        Some(Totals {
            low: DVec3::new(n[0], n[1], n[2]),
            high: DVec3::new(n[3], n[4], n[5]),
            range: [n[6], n[7]],
            values_of: [flags[0] != 0, flags[1] != 0],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn totals_survive_the_wire_and_reject_what_cannot_be() {
        let t = Totals::NOTHING.with_box([DVec3::ZERO, DVec3::ONE]).with_values([2.0].into_iter());
        assert_eq!(Totals::from_bytes(&t.to_bytes()), Some(t));
        assert_eq!(Totals::from_bytes(&Totals::NOTHING.to_bytes()), Some(Totals::NOTHING));
        assert_eq!(Totals::from_bytes(&[0; 3]), None);
        let mut bytes = t.to_bytes();
        bytes[..8].copy_from_slice(&f64::NAN.to_le_bytes());
        assert_eq!(Totals::from_bytes(&bytes), None);
    }

    #[test]
    fn colours_have_two_different_ends() {
        let of =
            |values: &[f64]| Totals::NOTHING.with_values(values.iter().copied()).color_range(None);
        assert_eq!(of(&[]), [0.0, 1.0]);
        assert_eq!(of(&[3.0, f64::NAN, 3.0]), [3.0, 6.0]);
        assert_eq!(of(&[1e9, 1e9]), [1e9, 2e9]);
        assert_eq!(of(&[2.0, -1.0]), [-1.0, 2.0]);
    }
}
