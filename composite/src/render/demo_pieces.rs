//! A file that names pieces (`.pvtu .pvtp .pvti .vtm` ...), of which every rank reads its own.
use super::demo::{Demo, rank_color};
use super::demo_error::DemoError;
use super::demo_model::{middle_and_radius_of, whole};
use super::request_reply::RankChannel;
use super::{DataParallel, DistributedVolume, FrameError, FrameOptions, PointBrick, RankScene};
use crate::comm::Communicator;
use datasets::model::{ColorBy, Dataset, ImageData, extent_dims};
use datasets::read;
use datasets::read::vtk_xml::{PieceFiles, piece_files};
use rt_core::camera::Camera;
use rt_core::colormap::ColorMap;
use rt_core::environment::Background;
use rt_core::glam::{DAffine3, DMat3, DVec3, I64Vec3};
use rt_core::material::{ColorSource, Material};
use rt_core::mesh::{Attribute, PerElement, TriMesh};
use rt_core::render::RenderOptions;
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{GridExtent, Interpolation, VolumeOptions};
use std::path::{Path, PathBuf};

/// Blue, green, orange: from the lowest to the highest value.
const COLORS: [[f32; 4]; 3] =
    [[0.02, 0.1, 0.55, 1.0], [0.08, 0.5, 0.4, 1.0], [0.9, 0.4, 0.04, 1.0]];

/// A list of pieces, to be read by the ranks.
pub struct PieceDemo {
    file: PathBuf,
    pieces: PieceFiles,
    /// The array to colour by; `None` for the colours of ranks, or for the first array of image
    /// data.
    pub array: Option<String>,
}

/// A scene that all ranks have made together.
pub struct PiecesOfRank {
    /// This rank, ready to render.
    pub renderer: DataParallel,
    /// The view of the whole.
    pub camera: Camera,
    /// The frame.
    pub options: RenderOptions,
    /// Files that this rank has read.
    pub files: usize,
    /// What the readers left out or repaired, on this rank.
    pub warnings: Vec<String>,
}

/// What this rank has read.
#[derive(Default)]
struct ReadPieces {
    meshes: Vec<TriMesh>,
    bricks: Vec<PointBrick>,
    /// Whether values of bricks are those of cells.
    of_cells: Option<bool>,
    warnings: Vec<String>,
}

/// Sums over all ranks.
struct Totals {
    low: DVec3,
    high: DVec3,
    /// Of the values to colour by.
    range: [f64; 2],
    /// Of any rank's bricks: bit 0 for points, bit 1 for cells.
    values_of: u32,
}

impl PieceDemo {
    /// Reads the list in `file`; `None` for a file that is none.
    ///
    /// # Errors
    /// A file that cannot be read, or names no pieces.
    pub fn open(file: &Path) -> Result<Option<PieceDemo>, DemoError> {
        // Other formats are not XML.
        let is_xml = file.extension().and_then(|e| e.to_str()).is_some_and(|e| {
            let e = e.to_ascii_lowercase();
            e.starts_with("pvt") || matches!(&*e, "vtm" | "vtpd" | "vtpc")
        });
        let pieces = if is_xml && file.is_file() { piece_files(file)? } else { None };
        let Some(pieces) = pieces else { return Ok(None) };
        if pieces.files.is_empty() {
            return Err(DemoError::NoPieces { file: file.display().to_string() });
        }
        Ok(Some(PieceDemo { file: file.into(), pieces, array: None }))
    }

    /// Reads this rank's pieces and makes the scene together with all other ranks: surfaces, or a
    /// volume where the pieces are image data. Everybody calls it with the same arguments.
    ///
    /// # Errors
    /// [`DemoError::Frame`] with [`FrameError::RankScene`] on every rank when one cannot read its
    /// pieces; [`DemoError::OptionOfPieces`].
    pub fn prepare(
        &self,
        comm: &mut dyn Communicator,
        demo: &Demo,
        options: FrameOptions,
    ) -> Result<PiecesOfRank, DemoError> {
        let shown = || self.file.display().to_string();
        for (given, what) in [
            (demo.view.is_some(), "other view than that of the whole"),
            (demo.size.is_some(), "sizes"),
            (demo.cut_by_view, "cut by view"),
        ] {
            if given {
                return Err(DemoError::OptionOfPieces { file: shown(), what });
            }
        }
        let (rank, ranks) = (comm.rank(), comm.size());
        let files = &self.pieces.files;
        let own = &files[files.len() * rank / ranks..files.len() * (rank + 1) / ranks];
        let mut channel = RankChannel::new(comm, options.timeout);
        let read = self.read(own);
        let found = read.as_ref().map(|_| ()).map_err(String::clone);
        let agreed = channel.agree_on_success(found).and_then(|()| {
            let read = read.unwrap_or_default();
            Ok((totals(&mut channel, &self.lattice(), &read)?, read))
        });
        if let Err(error) = &agreed
            && !error.is_agreed()
        {
            channel.abort(&error.to_string());
        }
        let (totals, read) = agreed?;
        let middle = middle_and_radius_of([totals.low, totals.high]);
        let view = whole(middle);
        let mut scene = RankScene::new();
        let (lights, ambient_occlusion) = demo.light(&view, middle.0, middle.1);
        (scene.lights, scene.ambient_occlusion) = (lights, ambient_occlusion);
        scene.background = Background::Constant([1.0; 4]);
        let warnings = read.warnings.clone();
        if self.lattice().is_some() {
            scene.volume(self.volume(&totals, read, middle.1)?);
        } else {
            self.surface(&mut scene, &totals, read, demo.color_by_rank.then_some(rank));
        }
        let renderer = DataParallel::distributed(comm, scene, options)?;
        let camera = demo.camera(&view, middle.0, middle.1)?;
        let options = demo.render_options();
        Ok(PiecesOfRank { renderer, camera, options, files: own.len(), warnings })
    }

    fn lattice(&self) -> Option<([i32; 6], DVec3, DVec3)> {
        self.pieces.lattice
    }

    /// Reads some files.
    fn read(&self, files: &[PathBuf]) -> Result<ReadPieces, String> {
        let mut out = ReadPieces::default();
        for path in files {
            let opened = read::open(path).map_err(|e| e.to_string())?;
            let named = |w: &String| format!("{}: {w}", path.display());
            out.warnings.extend(opened.warnings.iter().map(named));
            let in_file = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
            if let Some(lattice) = self.lattice() {
                let data = opened.dataset().map_err(|e| in_file(&e))?;
                for leaf in data.leaves() {
                    let Dataset::ImageData(image) = leaf else {
                        return Err(in_file(&format!("it is {}, not ImageData", leaf.kind())));
                    };
                    let (brick, of_cells) =
                        self.brick(data, image, lattice).map_err(|e| in_file(&e))?;
                    if *out.of_cells.get_or_insert(of_cells) != of_cells {
                        return Err(in_file(&"its array belongs to cells, others' to points"));
                    }
                    out.bricks.push(brick);
                }
            } else {
                let (model, report) =
                    opened.to_meshes(self.array.as_deref()).map_err(|e| in_file(&e))?;
                out.warnings.extend(report.warnings().iter().map(named));
                out.meshes.extend(model.meshes.into_iter().map(|m| m.mesh));
            }
        }
        Ok(out)
    }

    /// The brick of a piece of image data, and whether its values are those of cells.
    fn brick(
        &self,
        data: &Dataset,
        image: &ImageData,
        (whole, origin, spacing): ([i32; 6], DVec3, DVec3),
    ) -> Result<(PointBrick, bool), String> {
        if image.direction != DMat3::IDENTITY {
            return Err("its axes are rotated (Direction): resample it along x, y, z".into());
        }
        if image.origin != origin || image.spacing != spacing {
            return Err(format!(
                "its Origin {} and Spacing {} differ from {origin} and {spacing} of {}",
                image.origin,
                image.spacing,
                self.file.display()
            ));
        }
        let first_array = || {
            let of = &image.attributes;
            of.point.first().or(of.cell.first()).map(|a| a.name.clone())
        };
        let name = self.array.clone().or_else(first_array).ok_or("it has no array")?;
        let by = ColorBy::find(data, &name).map_err(|e| e.to_string())?;
        let array = by.array(&image.attributes).ok_or_else(|| format!("it lacks `{name}`"))?;
        let low = |e: [i32; 6]| I64Vec3::new(e[0].into(), e[2].into(), e[4].into());
        let first = low(image.extent) - low(whole);
        let mut dims = extent_dims(image.extent);
        if !by.per_point {
            dims = dims.map(|points| points.saturating_sub(1));
        }
        let number = |n: i64| u32::try_from(n).map_err(|_| "its Extent leaves WholeExtent");
        let [x, y, z] = first.to_array();
        let [i, j, k] = dims.map(|n| n as i64);
        let values = (0..array.tuples()).map(|at| by.value(array, at)).collect();
        let brick = PointBrick {
            first: [number(x)?, number(y)?, number(z)?].into(),
            dims: [number(i)?, number(j)?, number(k)?].into(),
            values,
        };
        Ok((brick, !by.per_point))
    }

    /// All surfaces of this rank as one mesh.
    fn surface(
        &self,
        scene: &mut RankScene,
        totals: &Totals,
        read: ReadPieces,
        hue: Option<usize>,
    ) {
        let mut material = Material::matte([0.8; 3]);
        if self.array.is_some() {
            let range = totals.range.map(|v| v as f32);
            material.color_source =
                ColorSource::Scalars(ColorMap::new(COLORS.to_vec(), range).into());
        }
        let number = scene.material(material);
        // Far from zero, positions keep their digits relative to the middle of all pieces.
        let middle = 0.5 * (totals.low + totals.high);
        let size = (totals.high - totals.low).max_element();
        let far = middle.is_finite() && middle.abs().max_element() > 4.0 * size;
        let origin = if far { middle.as_vec3().as_dvec3() } else { DVec3::ZERO };
        let mut mesh = TriMesh { origin, ..TriMesh::default() };
        let mut scalars = Vec::new();
        for piece in read.meshes {
            let first = mesh.positions.len() as u32;
            let shift = piece.origin - origin;
            mesh.positions.extend(piece.positions.iter().map(|p| (shift + p.as_dvec3()).as_vec3()));
            if self.array.is_some() {
                scalars.extend(scalars_of_vertices(&piece));
            }
            let moved = |t: &[u32; 3]| t.map(|k| k.saturating_add(first));
            mesh.indices.extend(piece.indices.iter().map(moved));
        }
        if self.array.is_some() {
            mesh.scalars = Some(Attribute::per_vertex(scalars));
        } else if let Some(rank) = hue {
            mesh.colors = Some(Attribute::per_face(vec![rank_color(rank); mesh.indices.len()]));
        }
        scene.mesh("surface", mesh, number);
    }

    fn volume(
        &self,
        totals: &Totals,
        read: ReadPieces,
        radius: f64,
    ) -> Result<DistributedVolume, DemoError> {
        let (extent, origin, spacing) = self.lattice().unwrap_or(([0; 6], DVec3::ZERO, DVec3::ONE));
        let name = self.array.clone().unwrap_or_else(|| "volume".into());
        let fault = |reason: String| FrameError::RankScene { rank: 0, reason };
        if totals.values_of == 3 {
            let reason = format!("`{name}` belongs to cells in some pieces, to points in others");
            return Err(fault(reason).into());
        }
        let of_cells = totals.values_of == 2;
        let mut dims = extent_dims(extent).map(|n| n as u32);
        let low = DVec3::new(extent[0].into(), extent[2].into(), extent[4].into());
        let mut first = origin + spacing * low;
        if of_cells {
            dims = dims.map(|points| points.saturating_sub(1));
            first += 0.5 * spacing;
        }
        let [a, b] = totals.range.map(|v| v as f32);
        let (a, b) = if a < b { (a, b) } else { (a, a + 1.0) };
        // Clear at the lowest value; at the highest, a sixteenth of the radius takes 0.9 of the
        // light.
        let colors = ColorMap::new(COLORS.to_vec(), [a, b]);
        let points = [[a, 0.0], [b, 0.9]];
        let transfer = TransferFunction::from_opacity(colors, &points, (radius / 16.0) as f32)
            .map_err(|e| fault(format!("`{name}` has values from {a} to {b}: {e}")))?;
        let nearest = VolumeOptions { interpolation: Interpolation::Nearest, ..Default::default() };
        Ok(DistributedVolume {
            name,
            whole: GridExtent { dims: dims.into(), origin: first, spacing },
            transfer,
            options: if of_cells { nearest } else { VolumeOptions::default() },
            world_from_object: DAffine3::IDENTITY,
            bricks: read.bricks,
        })
    }
}

/// One value for each vertex; those of faces go to their corners.
fn scalars_of_vertices(mesh: &TriMesh) -> Vec<f32> {
    match &mesh.scalars {
        Some(scalars) if scalars.per == PerElement::Vertex => scalars.values.clone(),
        Some(scalars) => {
            let mut values = vec![f32::NAN; mesh.positions.len()];
            for (corners, value) in mesh.indices.iter().zip(&scalars.values) {
                for &k in corners {
                    if let Some(v) = values.get_mut(k as usize) {
                        *v = *value;
                    }
                }
            }
            values
        }
        None => vec![f32::NAN; mesh.positions.len()],
    }
}

/// Bounds and ranges over all ranks.
fn totals(
    channel: &mut RankChannel<'_>,
    lattice: &Option<([i32; 6], DVec3, DVec3)>,
    read: &ReadPieces,
) -> Result<Totals, FrameError> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    if let Some((e, origin, spacing)) = lattice {
        let at = |i: usize| DVec3::new(e[i].into(), e[i + 2].into(), e[i + 4].into());
        (low, high) = (origin + spacing * at(0), origin + spacing * at(1));
    }
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    let mut grow = |values: &[f32]| {
        for v in values.iter().filter(|v| v.is_finite()) {
            range = [range[0].min((*v).into()), range[1].max((*v).into())];
        }
    };
    for mesh in read.meshes.iter().filter(|m| !m.bounds().is_empty()) {
        let b = mesh.bounds();
        low = low.min(mesh.origin + b.min.as_dvec3());
        high = high.max(mesh.origin + b.max.as_dvec3());
        grow(mesh.scalars.as_ref().map_or(&[], |s| &s.values));
    }
    read.bricks.iter().for_each(|b| grow(&b.values));
    let numbers = [low.x, low.y, low.z, high.x, high.y, high.z, range[0], range[1]];
    let mut mine: Vec<u32> =
        numbers.iter().flat_map(|n| [n.to_bits() as u32, (n.to_bits() >> 32) as u32]).collect();
    mine.push(read.of_cells.map_or(0, |cells| 1 + u32::from(cells)));
    let all = channel.all_gather(&mine)?;
    let mut out = Totals {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
        range: [f64::INFINITY, f64::NEG_INFINITY],
        values_of: 0,
    };
    for (from, words) in all.iter().enumerate() {
        let number =
            |k: usize| f64::from_bits(u64::from(words[2 * k]) | u64::from(words[2 * k + 1]) << 32);
        let n: [f64; 8] = std::array::from_fn(number);
        if n.iter().any(|v| v.is_nan()) {
            return Err(channel.announced_error(from, format!("bounds of its pieces: {n:?}")));
        }
        out.low = out.low.min(DVec3::new(n[0], n[1], n[2]));
        out.high = out.high.max(DVec3::new(n[3], n[4], n[5]));
        out.range = [out.range[0].min(n[6]), out.range[1].max(n[7])];
        out.values_of |= words[16] & 3;
    }
    if out.range[0] > out.range[1] {
        out.range = [0.0, 1.0];
    }
    Ok(out)
}
