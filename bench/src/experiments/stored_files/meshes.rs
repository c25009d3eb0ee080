//! Meshes in pages: the wavelet, the interface of the mixing layer and the flux ropes of a plasma,
//! with room for all pages that rays meet, and with room for a quarter of the file.

use super::frames::{Pictured, Timed, frames};
use super::{BUDGET, Context, Folder, Opened, Sizes, open_or_make};
use crate::record::{Record, Row};
use crate::stored_data::{mixing_layer_pieces, store_wavelet, surface_pieces};
use anyhow::Context as _;
use datasets::catalogue::{self, SEED};
use datasets::generate::mixing_layer::MixingLayer;
use datasets::generate::plasma::{self, Plasma};
use datasets::isosurface::Options;
use datasets::stored_mesh;
use datasets::view::View;
use rt_core::glam::DVec3;
use rt_core::mesh::TriMesh;
use std::path::Path;
use std::sync::Arc;

/// Bytes for triangles that wait to be stored.
const STORING: usize = 4 << 30;
/// Parts of the file's size that the pages may take in the second measurement.
const QUARTER: u64 = 4;

/// A mesh that is stored.
#[derive(Clone, Copy)]
pub(super) enum Stored {
    Wavelet,
    MixingLayer,
    Plasma,
}

pub(super) const ALL: [Stored; 3] = [Stored::Wavelet, Stored::MixingLayer, Stored::Plasma];

impl Stored {
    pub(super) fn name(self, sizes: &Sizes) -> String {
        match self {
            Stored::Wavelet => format!("wavelet, {} million triangles", sizes.wavelet),
            Stored::MixingLayer => {
                format!("mixing layer, {} points along x, triangles", sizes.layer)
            }
            Stored::Plasma => format!("plasma, {} points along y, triangles", sizes.plasma),
        }
    }

    pub(super) fn file_name(self, sizes: &Sizes) -> String {
        match self {
            Stored::Wavelet => format!("wavelet-{}M.rtmesh", sizes.wavelet),
            Stored::MixingLayer => format!("mixing-layer-{}.rtmesh", sizes.layer),
            Stored::Plasma => format!("plasma-{}.rtmesh", sizes.plasma),
        }
    }

    /// How many triangles it has, about.
    pub(super) fn triangles(self, sizes: &Sizes) -> u64 {
        // Turbulent surfaces fold: of the layer, 6.8 million triangles have 512 points, and it
        // grows with the power 2.65; of the plasma 3.3, and the power is 2.5 (catalogue).
        let folded = |points: u32, at_512: f64, power: f64| {
            (at_512 * (f64::from(points) / 512.0).powf(power)) as u64
        };
        match self {
            Stored::Wavelet => u64::from(sizes.wavelet) * 1_000_000,
            Stored::MixingLayer => folded(sizes.layer, 6.8e6, 2.65),
            Stored::Plasma => folded(sizes.plasma, 3.3e6, 2.5),
        }
    }

    fn views(self) -> anyhow::Result<Vec<View>> {
        Ok(match self {
            Stored::Wavelet => catalogue::find("wavelet")?.views(),
            Stored::MixingLayer => MixingLayer::views(),
            Stored::Plasma => Plasma::views(),
        })
    }

    fn store(self, context: &mut Context<'_>, sizes: &Sizes, path: &Path) -> anyhow::Result<()> {
        if let Stored::Wavelet = self {
            store_wavelet(path, sizes.wavelet, STORING, &mut |surface| {
                let share = 0.4 + 0.5 * surface.share;
                context.report_share(format!("storing {}", surface.label), share)
            })?;
            return Ok(());
        }
        let mut writer = stored_mesh::create(path, DVec3::ZERO)?;
        writer.set_memory(STORING);
        let add = |mesh: TriMesh| -> anyhow::Result<()> { Ok(writer.add_mesh(&mesh)?) };
        let options = Options { normals: false, ..Options::default() };
        let mut progress = |done: u32, all: u32| {
            let share = 0.4 + 0.5 * f64::from(done) / f64::from(all);
            context.report_share(format!("storing plane {done} of {all}"), share)
        };
        if let Stored::MixingLayer = self {
            mixing_layer_pieces(sizes.layer, options, &mut progress, add)?;
        } else {
            let plasma = Plasma::new(sizes.plasma, SEED);
            surface_pieces(&plasma, plasma::ISO, options, &mut progress, add)?;
        }
        stored_mesh::finish(writer)?;
        Ok(())
    }
}

pub(super) fn measure(
    context: &mut Context<'_>,
    record: &mut Record,
    folder: &Folder,
    sizes: &Sizes,
    stored: Stored,
) -> anyhow::Result<()> {
    let path = folder.mesh(stored, sizes);
    let Opened { data, prepare_secs, open_secs } = open_or_make(
        &path,
        folder.is_kept,
        |path| stored_mesh::open(path, BUDGET),
        |path| stored.store(context, sizes, path),
    )?;
    let mesh = Arc::new(data);
    let report = mesh.report();
    let quarter = usize::try_from(report.bytes / QUARTER).context("a file for this machine")?;
    let in_quarter = Arc::new(stored_mesh::open(&path, quarter)?);
    let name = stored.name(sizes);
    let row = Row::new()
        .with("elements", report.triangles)
        .with("file", report.bytes as f64 / 1e6)
        .with("bytes_per_element", report.bytes as f64 / report.triangles as f64)
        .with("open", open_secs * 1e3);
    let part = row
        .clone()
        .with("data", format!("{name}, a quarter of the file in memory"))
        .with("budget", quarter as f64 / 1e6);
    let row = row.with("data", name);
    let row = prepare_secs.map_or(row.clone(), |secs| row.with("prepare", secs));
    let pictured = Pictured::shape(mesh.clone())?;
    let of_part = Pictured::shape(in_quarter.clone())?;
    let cameras = pictured.cameras(&stored.views()?, sizes)?;
    let used = || mesh.page_use();
    let used_of_part = || in_quarter.page_use();
    let all = Timed { pictured: &pictured, row, repeats: false, used: Some(&used) };
    let part = Timed { pictured: &of_part, row: part, repeats: true, used: Some(&used_of_part) };
    frames(context, record, sizes, &[all, part], &cameras)
}
