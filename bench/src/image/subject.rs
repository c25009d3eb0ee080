//! The subject of an image: geometry with its own colours, from a file or from the catalogue.

use super::cell_contour::contour_of_cells;
use super::framing::corners_of_box;
use super::materials::SceneMaterials;
use anyhow::Context as _;
use datasets::catalogue::Data;
use datasets::model::{ColorBy, Dataset, SharedFaces};
use datasets::read::{Content, LoadedFile, SceneModel};
use glam::{DVec3, UVec3, Vec3};
use rt_core::bvh::{Geometry, StoredMesh};
use rt_core::grid::Grid;
use rt_core::material::Material;
use rt_core::mesh::{Attribute, TriMesh};
use rt_core::shapes::{
    Isosurface, IsosurfaceNormals, IsosurfaceOptions, Radii, Shape, Spheres, Tubes,
};
use rt_core::stored_volume::{StoredIsosurface, StoredVolume};
use std::sync::Arc;

/// Where a part's colour comes from.
#[derive(Debug, Clone)]
pub enum PartColoring {
    /// The geometry's scalars mapped to colours.
    Scalars,
    /// The geometry's own colours, or else this one (linear RGB).
    Color([f32; 3]),
    /// Glass that transmits this fraction of white light over the subject's radius (linear RGB).
    Glass([f32; 3]),
    /// A material from the file.
    FileMaterial(Material),
}

/// One geometry.
#[derive(Clone)]
pub struct Part {
    /// Triangles or a shape.
    pub geometry: Geometry,
    /// Its colour.
    pub coloring: PartColoring,
    /// World points that bound a shape; empty for meshes, which have vertices.
    outline: Vec<DVec3>,
}

impl Part {
    fn mesh(mesh: Arc<TriMesh>, coloring: PartColoring) -> Part {
        Part { geometry: Geometry::Mesh(mesh), coloring, outline: vec![] }
    }

    fn shape(shape: Arc<dyn Shape>, coloring: PartColoring, outline: Vec<DVec3>) -> Part {
        Part { geometry: Geometry::Shape(shape), coloring, outline }
    }
}

/// A field drawn as a glowing medium.
#[derive(Clone)]
pub struct VolumeField {
    /// The scalars.
    pub values: FieldValues,
    /// Their smallest and largest finite value.
    pub range: [f32; 2],
}

/// Where the scalars of a field are.
#[derive(Clone)]
pub enum FieldValues {
    /// In memory.
    Grid(Arc<Grid>),
    /// In a file.
    Stored {
        /// The file.
        volume: Arc<StoredVolume>,
        /// Bytes for the parts of the medium that rays have met last.
        memory: usize,
    },
}

impl VolumeField {
    /// World positions of the first and the last point.
    pub fn corners(&self) -> [DVec3; 2] {
        match &self.values {
            FieldValues::Grid(grid) => [grid.origin(), grid.max_corner()],
            FieldValues::Stored { volume, .. } => {
                let layout = volume.layout();
                let size = (layout.dims - UVec3::ONE).as_dvec3() * layout.spacing;
                [layout.origin, layout.origin + size]
            }
        }
    }
}

/// All geometry and volumes of an image.
#[derive(Clone)]
pub struct Subject {
    /// The parts.
    pub parts: Vec<Part>,
    /// The field for direct volume rendering.
    pub volume: Option<VolumeField>,
    /// Range of all scalars.
    pub scalar_range: Option<[f32; 2]>,
    /// Upward direction in the world.
    pub up: DVec3,
    /// What was left out or chosen automatically, one sentence each.
    pub warnings: Vec<String>,
    /// Descriptions of the kinds of geometry.
    pub contents: Vec<String>,
}

/// Options for loading a file as a subject.
#[derive(Debug, Clone, Default)]
pub struct LoadOptions {
    /// The array to colour by; `None` for the one that the file marks, if any.
    pub color_by: Option<String>,
    /// Isovalue for image data; `None` for the middle of the range, or for no isosurface when there
    /// is a volume.
    pub isovalue: Option<f32>,
    /// Whether image data is drawn as a volume.
    pub volume: VolumeChoice,
    /// What positions of surfaces of data sets are relative to; `None` to choose it. For pieces of
    /// one surface.
    pub origin: Option<DVec3>,
    /// Whether points of a data set without triangles and lines are left out. A piece that lies
    /// inside of a volume has no surface, and its points are none of the picture's.
    pub without_points: bool,
    /// Faces between this piece and others, which are left out.
    pub shared_faces: Option<Arc<SharedFaces>>,
}

/// Selects the field for volume rendering.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum VolumeChoice {
    /// None.
    #[default]
    No,
    /// The array to colour by, or else the one that the file marks, or else the first.
    Marked,
    /// This array.
    Named(String),
}

/// Colour of geometry without one, linear.
const DEFAULT_COLOR: [f32; 3] = [0.62, 0.60, 0.56];
/// Radius of tubes and points, as a fraction of the diagonal.
const TUBE_RADIUS: f64 = 0.002;
const POINT_RADIUS: f64 = 0.004;

impl Subject {
    /// An empty subject.
    pub fn empty(up: DVec3) -> Subject {
        Subject {
            parts: vec![],
            volume: None,
            scalar_range: None,
            up,
            warnings: vec![],
            contents: vec![],
        }
    }

    /// Number of triangles of all parts.
    pub fn triangles(&self) -> usize {
        let count = |p: &Part| match &p.geometry {
            Geometry::Mesh(m) => m.num_triangles(),
            Geometry::Shape(_) | Geometry::Slices(_) => 0,
        };
        self.parts.iter().map(count).sum()
    }

    /// Calls `point` with world points that bound the subject: vertices, points of lines, corners
    /// of boxes.
    pub(super) fn outline(&self, point: &mut dyn FnMut(DVec3)) {
        for part in &self.parts {
            match &part.geometry {
                Geometry::Mesh(m) => {
                    let used =
                        m.indices.iter().flatten().filter_map(|&k| m.positions.get(k as usize));
                    used.filter(|p| p.is_finite()).for_each(|p| point(m.origin + p.as_dvec3()));
                }
                Geometry::Shape(_) | Geometry::Slices(_) => {
                    part.outline.iter().for_each(|p| point(*p))
                }
            }
        }
        if let Some(v) = &self.volume {
            let [low, high] = v.corners();
            corners_of_box(low, high).into_iter().for_each(point);
        }
    }

    /// Adds triangles; scalars, if any, are mapped to colours.
    pub fn add_mesh(&mut self, mesh: TriMesh, otherwise: [f32; 3]) {
        let coloring = match &mesh.scalars {
            Some(s) => {
                self.extend_scalar_range(&s.values);
                PartColoring::Scalars
            }
            None => PartColoring::Color(otherwise),
        };
        self.contents.push(format!("{} triangles", mesh.num_triangles()));
        self.parts.push(Part::mesh(Arc::new(mesh), coloring));
    }

    /// Adds a generated data set. Lines become tubes with their own radii.
    pub fn add_generated(&mut self, data: Data, otherwise: [f32; 3]) -> anyhow::Result<()> {
        match data {
            Data::Mesh(mesh) => self.add_mesh(mesh, otherwise),
            Data::Lines(lines) => {
                self.contents.push(format!("{} tube segments", lines.num_segments()));
                self.extend_scalar_range(&lines.scalars);
                let outline = lines.points.iter().map(|p| p.as_dvec3()).collect();
                self.parts.push(Part::shape(
                    Arc::new(lines.into_tubes()?),
                    PartColoring::Scalars,
                    outline,
                ));
            }
        }
        Ok(())
    }

    /// Builds a subject from all visible content of a file.
    pub fn from_file(opened: &LoadedFile, load_options: &LoadOptions) -> anyhow::Result<Subject> {
        let mut subject = match &opened.content {
            Content::Scene(_) if load_options.volume != VolumeChoice::No => {
                anyhow::bail!("{} files hold meshes; a volume needs a uniform grid", opened.format)
            }
            Content::Scene(_) if load_options.isovalue.is_some() => {
                anyhow::bail!("{} files hold meshes; --isovalue needs cells", opened.format)
            }
            Content::Scene(model) => from_scene(model, load_options)?,
            Content::Data(data) => from_data(data, load_options)?,
        };
        let own = std::mem::take(&mut subject.warnings);
        subject.warnings = opened.warnings.iter().cloned().chain(own).collect();
        if opened.time_steps.len() > 1 {
            let (n, first) = (opened.time_steps.len(), &opened.time_steps[0]);
            subject.warnings.push(format!(
                "the file lists {n} steps; this is the first (time {}): give another step’s own \
                 file for that",
                first.time
            ));
        }
        Ok(subject)
    }

    /// The triangles of a file that is larger than memory.
    pub fn from_stored_mesh(mesh: &Arc<StoredMesh>) -> Subject {
        let mut subject = Subject::empty(DVec3::Z);
        let report = mesh.report();
        subject.contents.push(format!("{} stored triangles", report.triangles));
        if report.skipped > 0 {
            subject.warnings.push(format!(
                "{} triangles were left out when the mesh was stored",
                report.skipped
            ));
        }
        // The corners of the pages' boxes: those of the box around all would frame it too small.
        let at = |corner: Vec3| mesh.origin() + corner.as_dvec3();
        let pages = (0..mesh.num_primitives() as u32).map(|page| mesh.bounds(page));
        let outline = pages.filter(|b| !b.is_empty());
        let outline = outline.flat_map(|b| corners_of_box(at(b.min), at(b.max))).collect();
        let scalars = mesh.attributes().scalars;
        let coloring = if let Some(range) = scalars {
            subject.extend_scalar_range(&range);
            PartColoring::Scalars
        } else {
            PartColoring::Color(DEFAULT_COLOR)
        };
        subject.parts.push(Part::shape(mesh.clone(), coloring, outline));
        subject
    }

    /// A volume that is larger than memory: a medium whose parts in memory take `medium` bytes, if
    /// any, and an isosurface, unless there is a medium and no isovalue. Without either, the
    /// isovalue is in the middle of the range.
    ///
    /// # Errors
    /// When there is no such surface, or no finite value.
    pub fn from_stored_volume(
        volume: &Arc<StoredVolume>,
        isovalue: Option<f32>,
        medium: Option<usize>,
    ) -> anyhow::Result<Subject> {
        let mut subject = Subject::empty(DVec3::Z);
        if let Some(memory) = medium {
            let range = volume.range();
            let (lo, hi) = range.context("no value is finite: as a volume it would be empty")?;
            subject.contents.push(format!("volume of {} points", volume.report().points));
            subject.extend_scalar_range(&[lo, hi]);
            let non_finite = volume.report().non_finite;
            if non_finite > 0 && isovalue.is_none() {
                subject.warnings.push(format!(
                    "{non_finite} values are not finite: the cells around them are transparent"
                ));
            }
            let values = FieldValues::Stored { volume: volume.clone(), memory };
            subject.volume = Some(VolumeField { values, range: [lo, hi] });
            if isovalue.is_none() {
                return Ok(subject);
            }
        }
        let isovalue = isovalue_in(volume.range(), isovalue)?;
        let normals = IsosurfaceNormals::Smooth;
        let surface = StoredIsosurface::new(volume.clone(), &[isovalue], normals)?;
        let report = volume.report();
        if report.non_finite > 0 {
            subject.warnings.push(format!(
                "{} values are not finite: the surface ends at the cells around them",
                report.non_finite
            ));
        }
        let (points, bricks) = (report.points, surface.num_primitives());
        subject.contents.push(format!(
            "isosurface at {isovalue} of {points} points, in {bricks} of {} stored bricks",
            report.bricks
        ));
        // The corners of the bricks' boxes: those of the lattice would frame it too small.
        let at = |corner: Vec3| surface.origin() + corner.as_dvec3();
        let boxes = (0..bricks as u32).map(|brick| surface.bounds(brick));
        let outline = boxes.filter(|b| !b.is_empty());
        let outline = outline.flat_map(|b| corners_of_box(at(b.min), at(b.max))).collect();
        let coloring = PartColoring::Color(DEFAULT_COLOR);
        subject.parts.push(Part::shape(Arc::new(surface), coloring, outline));
        Ok(subject)
    }

    fn extend_scalar_range(&mut self, scalars: &[f32]) {
        for &v in scalars.iter().filter(|v| v.is_finite()) {
            let [lo, hi] = self.scalar_range.unwrap_or([v, v]);
            self.scalar_range = Some([lo.min(v), hi.max(v)]);
        }
    }
}

// ---- data sets ----------------------------------------------------------------------------------
fn from_data(data: &Dataset, load_options: &LoadOptions) -> anyhow::Result<Subject> {
    let mut subject = Subject::empty(DVec3::Z);
    let color = load_options.color_by.clone().or_else(|| marked_array(data));
    if let Some(request) = &load_options.color_by {
        ColorBy::find(data, request)?;
    }
    if load_options.volume != VolumeChoice::No {
        add_volume(&mut subject, data, &color, load_options)?;
        if load_options.isovalue.is_none() {
            return Ok(subject);
        }
    }
    if let Some(grid) = lattice(data, &color, &mut subject)? {
        return isosurface(subject, data, grid, load_options);
    }
    if let Some(isovalue) = load_options.isovalue {
        let array = marked_or_first_array(data).context("--isovalue: the file has no array")?;
        let LoadOptions { color_by, origin, .. } = load_options;
        let found = contour_of_cells(data, &array, isovalue, color_by.as_deref(), *origin)?;
        subject.warnings.extend(found.warnings);
        subject.contents.push(found.content);
        subject.add_mesh(found.mesh, DEFAULT_COLOR);
        return Ok(subject);
    }
    let (shared, origin) = (load_options.shared_faces.as_deref(), load_options.origin);
    let (mesh, report) = data.to_trimesh_between(color.as_deref(), origin, shared)?;
    subject.warnings.extend(report.warnings());
    if mesh.num_triangles() > 0 {
        subject.add_mesh(mesh, DEFAULT_COLOR);
    }
    let (lines, dropped) = data.to_lines(color.as_deref())?;
    if dropped > 0 {
        subject
            .warnings
            .push(format!("{dropped} lines left out: too few points, or points that do not exist"));
    }
    if !lines.is_empty() {
        add_tubes(&mut subject, &lines)?;
    }
    if subject.parts.is_empty() && !load_options.without_points {
        add_points(&mut subject, data, color.as_deref())?;
    }
    Ok(subject)
}

fn add_volume(
    subject: &mut Subject,
    data: &Dataset,
    color: &Option<String>,
    load_options: &LoadOptions,
) -> anyhow::Result<()> {
    let array = match &load_options.volume {
        VolumeChoice::Named(name) => Some(name.clone()),
        _ => color.clone().or_else(|| first_array(data)),
    };
    let array = array.context("no array can be drawn as a volume: the file has none")?;
    let leaf = match data.leaves()[..] {
        [leaf] => leaf,
        ref leaves => {
            anyhow::bail!("the file has {} parts; a volume needs one uniform grid", leaves.len())
        }
    };
    ColorBy::find(leaf, &array)?;
    let grid =
        leaf.to_grid(&array).with_context(|| format!("`{array}` cannot be drawn as a volume"))?;
    let Some((lo, hi)) = grid.range() else {
        anyhow::bail!("`{array}` has no finite value: as a volume it would be empty");
    };
    if load_options.isovalue.is_none()
        && let Some(request) = load_options.color_by.as_ref().filter(|request| **request != array)
    {
        subject.warnings.push(format!(
            "`{request}` colours nothing: a volume has the colours of its own scalars, and there \
             is no isosurface without --isovalue"
        ));
    }
    subject.contents.push(format!(
        "`{array}` as a volume of {} points",
        grid.dims().as_u64vec3().element_product()
    ));
    subject.extend_scalar_range(&[lo, hi]);
    subject.volume =
        Some(VolumeField { values: FieldValues::Grid(Arc::new(grid)), range: [lo, hi] });
    Ok(())
}

/// The array that a file marks as its scalars.
pub fn marked_array(data: &Dataset) -> Option<String> {
    let a = data.leaves().into_iter().find_map(|d| d.attributes())?;
    a.point_scalars.clone().or_else(|| a.cell_scalars.clone())
}

/// The array that a file marks as its scalars, or else the first.
pub fn marked_or_first_array(data: &Dataset) -> Option<String> {
    marked_array(data).or_else(|| first_array(data))
}

/// The first array of a file; arrays on points come before those on cells.
fn first_array(data: &Dataset) -> Option<String> {
    let attributes = data.leaves().first()?.attributes()?;
    let first = attributes.point.first().or_else(|| attributes.cell.first());
    first.map(|a| a.name.clone())
}

/// The field of image data; `None` if there is none, or if only its boundary surface can be drawn.
fn lattice(
    data: &Dataset,
    color: &Option<String>,
    subject: &mut Subject,
) -> anyhow::Result<Option<Arc<Grid>>> {
    let leaf = match data.leaves()[..] {
        [leaf @ (Dataset::ImageData(_) | Dataset::RectilinearGrid(_))] => leaf,
        _ => return Ok(None),
    };
    let Some(array) = color.clone().or_else(|| first_array(data)) else { return Ok(None) };
    match leaf.to_grid(&array) {
        Ok(grid) if grid.dims().min_element() >= 2 => Ok(Some(Arc::new(grid))),
        Ok(_) => Ok(None),
        Err(e) => {
            subject
                .warnings
                .push(format!("drawn as its boundary surface, without an isosurface: {e}"));
            Ok(None)
        }
    }
}

/// The isovalue that was asked for, or that in the middle of the range of a field.
///
/// # Errors
/// When the field has no finite value, or no surface at that isovalue.
pub fn isovalue_in(range: Option<(f32, f32)>, isovalue: Option<f32>) -> anyhow::Result<f32> {
    let Some((lo, hi)) = range else {
        anyhow::bail!("the field has no finite value: there is no isosurface to draw");
    };
    let iso = isovalue.unwrap_or(0.5 * lo + 0.5 * hi);
    anyhow::ensure!(
        lo < iso && iso <= hi,
        "no isosurface at {iso}: the field ranges from {lo} to {hi}; choose --isovalue in between"
    );
    Ok(iso)
}

fn isosurface(
    mut subject: Subject,
    data: &Dataset,
    colors: Arc<Grid>,
    load_options: &LoadOptions,
) -> anyhow::Result<Subject> {
    // The isosurface is that of the field that the file marks; another array colours it.
    let marked = data.leaves()[0].attributes().and_then(|a| {
        a.point_scalars
            .clone()
            .or_else(|| a.point.iter().find(|p| p.components == 1).map(|p| p.name.clone()))
    });
    let field = match (&load_options.color_by, marked) {
        (Some(request), Some(marked)) if *request != marked => {
            Arc::new(data.leaves()[0].to_grid(&marked)?)
        }
        _ => colors.clone(),
    };
    let iso = isovalue_in(field.range(), load_options.isovalue)?;
    let options = IsosurfaceOptions { normals: IsosurfaceNormals::Smooth, ..Default::default() };
    let mut surface = Isosurface::new(field.clone(), &[iso], &options)?;
    let missing = surface.report().cells_non_finite;
    if missing > 0 {
        subject.warnings.push(format!(
            "{missing} cells have a value that is not finite: the surface has holes there"
        ));
    }
    let coloring = if Arc::ptr_eq(&field, &colors) {
        PartColoring::Color(DEFAULT_COLOR)
    } else {
        if let Some((lo, hi)) = colors.range() {
            subject.extend_scalar_range(&[lo, hi]);
        }
        surface = surface.with_color_by(colors);
        PartColoring::Scalars
    };
    subject.contents.push(format!(
        "isosurface at {iso} of {} points",
        field.dims().as_u64vec3().element_product()
    ));
    let outline = corners_of_box(field.origin(), field.max_corner()).to_vec();
    subject.parts.push(Part::shape(Arc::new(surface), coloring, outline));
    Ok(subject)
}

fn diagonal(points: impl Iterator<Item = DVec3>) -> f64 {
    let far = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (lo, hi) = points.filter(|p| p.is_finite()).fold(far, |(lo, hi), p| (lo.min(p), hi.max(p)));
    let d = (hi - lo).length();
    if d.is_finite() && d > 0.0 { d } else { 1.0 }
}

fn add_tubes(subject: &mut Subject, lines: &[datasets::model::Polyline]) -> anyhow::Result<()> {
    let points: Vec<DVec3> = lines.iter().flat_map(|l| l.points.iter().copied()).collect();
    let mut offsets = vec![0u32];
    for l in lines {
        offsets.push(offsets[offsets.len() - 1] + l.points.len() as u32);
    }
    let radius = (TUBE_RADIUS * diagonal(points.iter().copied())) as f32;
    let mut tubes = Tubes::from_f64_points(&points, &offsets, Radii::Common(radius))?;
    let mut coloring = PartColoring::Color(DEFAULT_COLOR);
    if lines.iter().all(|l| l.scalars.is_some()) {
        let scalars: Vec<f32> =
            lines.iter().filter_map(|l| l.scalars.as_ref()).flatten().copied().collect();
        subject.extend_scalar_range(&scalars);
        tubes = tubes.with_scalars(scalars)?;
        coloring = PartColoring::Scalars;
    }
    subject.contents.push(format!("{} lines as tubes", lines.len()));
    subject.parts.push(Part::shape(Arc::new(tubes), coloring, points));
    Ok(())
}

fn add_points(subject: &mut Subject, data: &Dataset, color: Option<&str>) -> anyhow::Result<()> {
    let set = data.to_points(color)?;
    let radius = (POINT_RADIUS * diagonal(set.points.iter().copied())) as f32;
    let mut spheres = Spheres::from_f64_centers(&set.points, Radii::Common(radius))?;
    let mut coloring = PartColoring::Color(DEFAULT_COLOR);
    if let Some(scalars) = set.scalars {
        subject.extend_scalar_range(&scalars);
        spheres = spheres.with_scalars(scalars)?;
        coloring = PartColoring::Scalars;
    }
    subject.contents.push(format!("{} points as spheres", set.points.len()));
    subject.parts.push(Part::shape(Arc::new(spheres), coloring, set.points));
    Ok(())
}

// ---- meshes with materials ----------------------------------------------------------------------
/// Scenes have y up, as glTF requires and most OBJ files use.
fn from_scene(model: &SceneModel, load_options: &LoadOptions) -> anyhow::Result<Subject> {
    let mut subject = Subject::empty(DVec3::Y);
    if let Some(request) = &load_options.color_by {
        subject.warnings.push(format!(
            "`{request}` is not used: the file holds meshes with materials and no arrays"
        ));
    }
    let mut scene_materials = SceneMaterials::of(model);
    let materials: Vec<Material> = model
        .materials
        .iter()
        .map(|m| scene_materials.material(m))
        .collect::<anyhow::Result<_>>()?;
    for m in &model.meshes {
        let coloring = match m.material {
            Some(i) => PartColoring::FileMaterial(materials[i].clone()),
            None => PartColoring::Color(DEFAULT_COLOR),
        };
        subject.parts.push(Part::mesh(Arc::new(m.mesh.clone()), coloring));
    }
    subject.contents.push(format!(
        "{} meshes, {} triangles",
        model.meshes.len(),
        model.num_triangles()
    ));
    Ok(subject)
}

/// Sets the height as the scalar of a mesh.
pub fn color_by_height(mesh: &mut TriMesh, up: Vec3) {
    mesh.scalars = Some(Attribute::per_vertex(mesh.positions.iter().map(|p| p.dot(up)).collect()));
}
