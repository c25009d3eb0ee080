//! Options about the file to read.

use clap::Args;
use datasets::read::OpenOptions;

/// What the file does not say itself, or which of its times is meant.
#[derive(Debug, Clone, Args)]
pub(super) struct OpenArgs {
    /// The time to read from a series, an OpenFOAM or EnSight case, or a file with several times
    /// [default: the last of an OpenFOAM case, otherwise the first]
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    time: Option<f64>,
    /// Distance between the points of a file that does not say it: NumPy, raw, NRRD, MetaImage,
    /// NetCDF without coordinates
    #[arg(long, value_name = "DX,DY,DZ", value_parser = three)]
    spacing: Option<[f64; 3]>,
    /// Position of the first point of such a file
    #[arg(long, value_name = "X,Y,Z", value_parser = three, allow_hyphen_values = true)]
    origin: Option<[f64; 3]>,
    /// For a table of points in no order (.csv .tsv .txt): how many times as wide as the cells
    /// around it a place without points is a hole; `inf` keeps the whole convex hull [default: 2.7]
    #[arg(long, value_name = "SPACINGS")]
    gap: Option<f64>,
}

impl OpenArgs {
    /// Whether a time was asked for.
    pub(super) fn has_time(&self) -> bool {
        self.time.is_some()
    }

    pub(super) fn options(&self) -> OpenOptions {
        let OpenArgs { time, spacing, origin, gap } = *self;
        OpenOptions { time, spacing, origin, gap }
    }
}

fn three(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    numbers
        .and_then(|n| n.try_into().ok())
        .ok_or_else(|| "give three numbers, such as 0.1,0.1,0.2".into())
}
