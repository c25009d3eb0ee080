//! Plots as data, drawn as SVG.
//!
//! The data is part of the record; [`Plot::to_svg`] draws it. No plotting library is used, because
//! a page needs only lines, bars, logarithmic axes, spreads and a legend, text that follows the
//! page's colours, and markers that distinguish series without colour.

mod scale;
mod svg;

pub(crate) use svg::escape;

use serde::{Deserialize, Serialize};

/// Mapping of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// Equal steps for equal differences.
    Linear,
    /// Equal steps for equal ratios; values that are not positive are left out.
    Log,
}

/// Kind of plot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Points joined by lines.
    Lines,
    /// Bars side by side: x is the index of a category; one bar per series.
    Bars,
}

/// An axis with its label.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Axis {
    /// The quantity.
    pub label: String,
    /// Its unit; empty for counts.
    pub unit: String,
    /// Linear or logarithmic.
    pub scale: Scale,
}

impl Axis {
    /// A linear axis.
    pub fn linear(label: &str, unit: &str) -> Axis {
        Axis { label: label.into(), unit: unit.into(), scale: Scale::Linear }
    }
    /// A logarithmic axis.
    pub fn log(label: &str, unit: &str) -> Axis {
        Axis { label: label.into(), unit: unit.into(), scale: Scale::Log }
    }
    fn caption(&self) -> String {
        if self.unit.is_empty() {
            self.label.clone()
        } else {
            format!("{} [{}]", self.label, self.unit)
        }
    }
}

/// A point with the range of its samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Value, or index of the category.
    pub x: f64,
    /// Median.
    pub y: f64,
    /// Lowest and highest sample, when known.
    pub range: Option<(f64, f64)>,
}

/// A line or a set of bars with one name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// The points, in the order in which lines join them.
    pub points: Vec<Point>,
}

impl Series {
    /// A series of points without ranges.
    pub fn new(name: impl Into<String>, points: Vec<(f64, f64)>) -> Series {
        let points = points.into_iter().map(|(x, y)| Point { x, y, range: None }).collect();
        Series { name: name.into(), points }
    }
}

/// One plot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plot {
    /// What it shows.
    pub title: String,
    /// Lines or bars.
    pub kind: Kind,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Names of the categories of [`Kind::Bars`].
    pub categories: Vec<String>,
    /// The data.
    pub series: Vec<Series>,
    /// A value to mark with a line across the plot, such as a ratio of 1.
    #[serde(default)]
    pub mark: Option<f64>,
}

impl Plot {
    /// An empty plot of lines.
    pub fn lines(title: &str, x: Axis, y: Axis) -> Plot {
        Plot {
            title: title.into(),
            kind: Kind::Lines,
            x,
            y,
            categories: vec![],
            series: vec![],
            mark: None,
        }
    }

    /// An empty plot of bars.
    pub fn bars(title: &str, y: Axis, categories: Vec<String>) -> Plot {
        Plot {
            title: title.into(),
            kind: Kind::Bars,
            x: Axis::linear("", ""),
            y,
            categories,
            series: vec![],
            mark: None,
        }
    }

    /// The plot as one `<svg>` element, 720 units wide, without references to anything outside.
    ///
    /// ```
    /// use bench::plot::{Axis, Plot, Series};
    /// let mut p = Plot::lines("Build", Axis::log("triangles", ""), Axis::log("time", "s"));
    /// p.series.push(Series::new("medium", vec![(1e5, 0.03), (1e6, 0.4)]));
    /// assert!(p.to_svg().starts_with("<svg ") && p.to_svg().contains("time [s]"));
    /// ```
    pub fn to_svg(&self) -> String {
        svg::draw(self)
    }
}
