//! Arguments of `composite demo`.
use super::ranks::RankArgs;
use crate::workload::Workload;
use std::path::PathBuf;

/// Arguments of `composite demo`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    composite demo -n 8\n  \
    mpirun -n 8 composite demo data.pvtu -o out.png\n  \
    composite demo -n 4 density.pvti --array rho -o out.png\n  \
    composite demo -n 5 --data mixing-layer --view RMI --headlight\n  \
    composite demo -n 4 --mpi --data part.vtp --grey\n  \
    composite demo -n 8 --scene discs\n  \
    composite demo -n 8 --mpi --size 2048 --out frames")]
pub(super) struct DemoArgs {
    #[command(flatten)]
    pub(super) ranks: RankArgs,
    /// A file with surfaces, or a list of pieces of which every rank reads its own and no other
    /// (.pvtu .pvtp .pvts .pvtr .vtm); .pvti is shown as a volume
    #[arg(value_name = "FILE", conflicts_with = "data")]
    pub(super) file: Option<String>,
    /// The data set: one of the catalogue of `datasets`, or a file with surfaces (VTK, OBJ, glTF,
    /// PLY, STL)
    #[arg(long, default_value = "wavelet", value_name = "NAME")]
    pub(super) data: String,
    /// Its size; the smallest if not given
    #[arg(long, value_name = "SIZE")]
    pub(super) data_size: Option<String>,
    /// One of its views; the first if not given
    #[arg(long, value_name = "VIEW")]
    pub(super) view: Option<String>,
    /// The array of the pieces to colour by, or that the volume shows
    #[arg(long, value_name = "NAME", requires = "file")]
    pub(super) array: Option<String>,
    /// A headlight instead of a lamp with shadows and ambient occlusion
    #[arg(long)]
    pub(super) headlight: bool,
    /// One grey for all parts instead of a colour for each rank
    #[arg(long)]
    pub(super) grey: bool,
    /// Parts of equal work for this view instead of equal numbers of triangles
    #[arg(long)]
    pub(super) cut_by_view: bool,
    /// Width and height of the image, in pixels
    #[arg(long, default_value_t = 1024, value_name = "PIXELS")]
    pub(super) size: u32,
    /// Frames generated without a renderer, instead of a data set
    #[arg(long, value_name = "discs|dense|frag", conflicts_with_all = ["data", "file", "data_size", "view", "headlight", "grey", "cut_by_view"])]
    pub(super) scene: Option<Workload>,
    /// Number of frames; the last is shown
    #[arg(long, default_value_t = 5, value_name = "N")]
    pub(super) frames: u64,
    /// The image (.png); the plot is written beside it as .svg
    #[arg(long, short = 'o', value_name = "FILE", conflicts_with = "out")]
    pub(super) output: Option<PathBuf>,
    /// Folder for the image and the plot
    #[arg(long, default_value = ".", value_name = "FOLDER")]
    pub(super) out: PathBuf,
}

impl DemoArgs {
    /// The name of the data.
    pub(super) fn data(&self) -> &str {
        self.file.as_deref().unwrap_or(&self.data)
    }

    /// Files of the image and of the plot, in a folder that exists after this call.
    pub(super) fn output_files(&self) -> anyhow::Result<[PathBuf; 2]> {
        use anyhow::Context as _;
        let picture = self.output.clone().unwrap_or_else(|| self.out.join("composite_demo.png"));
        if let Some(folder) = picture.parent().filter(|f| !f.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder)
                .with_context(|| format!("cannot make the folder {}", folder.display()))?;
        }
        let plot = picture.with_extension("svg");
        Ok([picture, plot])
    }
}
