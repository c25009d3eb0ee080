//! Parses and writes directions of view.

use crate::view::{Axis, View, ViewError};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// `x`, `y`, `z`, or `AZIMUTH,ELEVATION` of the light in degrees (see [`View::from_angles_deg`]).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum Direction {
    /// Light along an axis.
    Axis(Axis),
    /// Light in an oblique direction.
    Angles {
        /// Angle from +x towards +y.
        azimuth_deg: f64,
        /// Angle above the x-y plane.
        elevation_deg: f64,
    },
}

impl Default for Direction {
    fn default() -> Self {
        Direction::Axis(Axis::Z)
    }
}

impl Direction {
    /// The view in this direction, centred on `centre_m`.
    ///
    /// # Errors
    /// As [`View::from_angles_deg`].
    pub fn view(self, centre_m: DVec3) -> Result<View, ViewError> {
        match self {
            Direction::Axis(axis) => Ok(View::along(axis, centre_m)),
            Direction::Angles { azimuth_deg, elevation_deg } => {
                View::from_angles_deg(azimuth_deg, elevation_deg, centre_m)
            }
        }
    }
}

impl FromStr for Direction {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "`{text}` is not a view; write x, y, z, or AZIMUTH,ELEVATION in degrees such as \
                 30,15 (elevation -90 to 90)"
            )
        };
        match text.trim().to_ascii_lowercase().as_str() {
            "x" => return Ok(Direction::Axis(Axis::X)),
            "y" => return Ok(Direction::Axis(Axis::Y)),
            "z" => return Ok(Direction::Axis(Axis::Z)),
            _ => {}
        }
        let (a, e) = text.split_once(',').ok_or_else(wrong)?;
        let number =
            |t: &str| t.trim().parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(wrong);
        let direction = Direction::Angles { azimuth_deg: number(a)?, elevation_deg: number(e)? };
        direction.view(DVec3::ZERO).map_err(|_| wrong())?;
        Ok(direction)
    }
}

impl fmt::Display for Direction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Direction::Axis(Axis::X) => f.write_str("x"),
            Direction::Axis(Axis::Y) => f.write_str("y"),
            Direction::Axis(Axis::Z) => f.write_str("z"),
            Direction::Angles { azimuth_deg, elevation_deg } => {
                write!(f, "{azimuth_deg},{elevation_deg}")
            }
        }
    }
}

impl From<Direction> for String {
    fn from(d: Direction) -> String {
        d.to_string()
    }
}

impl TryFrom<String> for Direction {
    type Error = String;
    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        for text in ["x", "y", "z", "30,15", "-90,0.5"] {
            assert_eq!(text.parse::<Direction>().unwrap().to_string(), text);
        }
        for wrong in ["w", "30", "30,95", "nan,0", ""] {
            assert!(
                wrong.parse::<Direction>().unwrap_err().contains("AZIMUTH,ELEVATION"),
                "{wrong}"
            );
        }
    }
}
