//! The test section: reads or takes the fields of each wavelength, the view, the bodies and the
//! media.

use super::RenderError;
use super::margin::ShiftCache;
use crate::field::Field;
use crate::gas_on_cells::GasOnCells;
use crate::input;
use crate::march::FieldCache;
use crate::media::Media;
use crate::path::PathQuantities;
use crate::scene::{Scene, TechniqueSpec};
use crate::solids::Solids;
use crate::view::View;
use datasets::model::Dataset;
use glam::DVec3;

/// The contents of the test section, between the lenses.
pub struct TestSection {
    /// The gas for the light of each wavelength, in the scene's order; empty when light is traced
    /// through the cells of a mesh.
    pub fields: Vec<Field>,
    /// The gas on the cells of a mesh for the light of each wavelength; empty when light is traced
    /// through a lattice.
    pub cells: Vec<GasOnCells>,
    /// The view, centred on the fields' middle.
    pub view: View,
    /// Bodies.
    pub solids: Option<Solids>,
    /// Absorption, emission and rotation by the gas.
    pub media: Option<Media>,
    /// How the field was read; `None` when it does not come from a file.
    pub input: Option<input::Report>,
    /// Warnings about what was repaired or left out, one sentence each.
    pub warnings: Vec<String>,
    /// Results that marches compute from each field, when they are kept.
    pub(super) caches: Vec<Caches>,
}

/// What marches compute from a field, what they copy to a device, and how far light is shifted.
#[derive(Default)]
pub(super) struct Caches {
    pub(super) field: FieldCache,
    #[cfg(feature = "gpu")]
    pub(super) device: crate::gpu::VolumeCache,
    #[cfg(feature = "gpu")]
    pub(super) media: crate::gpu::MediaCache,
    pub(super) shift: ShiftCache,
}

/// Refuses scenes that need a lattice and have none, before anything looks for it.
fn refuse_lattice_keys(scene: &Scene) -> Result<(), RenderError> {
    if scene.flow.on_cells { Ok(scene.check()?) } else { Ok(()) }
}

impl TestSection {
    /// Reads the files that the scene names. `read` is called with a description before each is
    /// read.
    ///
    /// # Errors
    /// If a file cannot be read, or does not define a field for each wavelength.
    pub fn open(scene: &Scene, mut read: impl FnMut(&str)) -> Result<TestSection, RenderError> {
        refuse_lattice_keys(scene)?;
        let (mut fields, mut cells) = (Vec::new(), Vec::new());
        let mut report: Option<input::Report> = None;
        for line in scene.lines() {
            let file = &scene.flow.file;
            read(&format!("reading {} for {} nm", file.display(), line.wavelength_nm));
            let options = scene.flow.options(line.wavelength_nm)?;
            if scene.flow.on_cells {
                let (gas, of_cells) = input::load_cells(file, &options)?;
                cells.push(gas);
                report.get_or_insert(of_cells);
            } else {
                let loaded = input::load(file, &options)?;
                fields.push(loaded.field);
                report.get_or_insert(loaded.report);
            }
        }
        let mut warnings = report.as_ref().map_or(Vec::new(), |r| r.warnings.clone());
        let mut solids = None;
        if !scene.solids.files.is_empty() {
            read("reading bodies");
            let (bodies, more) = Solids::open(&scene.solids.files)?;
            warnings.extend(more);
            solids = Some(bodies);
        }
        let mut section = TestSection::of_gas(scene, fields, cells, solids)?;
        (section.input, section.warnings) = (report, warnings);
        if !scene.media.is_empty() {
            read("reading absorption, emission or rotation");
            let options = scene.flow.options(scene.light.wavelengths_nm[0])?;
            let (file, field) = (&scene.flow.file, &section.fields[0]);
            let media = input::load_media(file, &options, &scene.media.quantities(), field)?;
            section = section.with_media(media);
        }
        Ok(section)
    }

    /// A test section of a data set in memory. The scene's `flow` gives its arrays their meaning;
    /// the file that it names is not read.
    ///
    /// # Errors
    /// If the data set does not define a field for each wavelength, or what the scene's `media`
    /// names.
    pub fn of_dataset(
        scene: &Scene,
        data: &Dataset,
        solids: Option<Solids>,
    ) -> Result<TestSection, RenderError> {
        let mut section = TestSection::of_gas_in(scene, data, solids)?;
        if !scene.media.is_empty() {
            let options = scene.flow.options(scene.light.wavelengths_nm[0])?;
            let quantities = scene.media.quantities();
            let media = input::media_from_dataset(data, &options, &quantities, &section.fields[0])?;
            section = section.with_media(media);
        }
        Ok(section)
    }

    /// The gas of a data set in memory, without its media.
    pub(crate) fn of_gas_in(
        scene: &Scene,
        data: &Dataset,
        solids: Option<Solids>,
    ) -> Result<TestSection, RenderError> {
        refuse_lattice_keys(scene)?;
        let (mut fields, mut cells) = (Vec::new(), Vec::new());
        let mut report = None::<input::Report>;
        for line in scene.lines() {
            let options = scene.flow.options(line.wavelength_nm)?;
            if scene.flow.on_cells {
                let (gas, of_cells) = input::cells_from_dataset(data, &options)?;
                cells.push(gas);
                report.get_or_insert(of_cells);
            } else {
                let loaded = input::from_dataset(data, &options)?;
                fields.push(loaded.field);
                report.get_or_insert(loaded.report);
            }
        }
        let mut section = TestSection::of_gas(scene, fields, cells, solids)?;
        section.warnings = report.as_ref().map_or(Vec::new(), |r| r.warnings.clone());
        section.input = report;
        Ok(section)
    }

    /// A test section of given fields, one per wavelength of the scene.
    ///
    /// # Errors
    /// If the number of fields is not that of wavelengths, or the view is invalid.
    pub fn of_fields(
        scene: &Scene,
        fields: Vec<Field>,
        solids: Option<Solids>,
    ) -> Result<TestSection, RenderError> {
        TestSection::of_gas(scene, fields, Vec::new(), solids)
    }

    /// A test section of gas on the cells of meshes, one for each wavelength of the scene.
    ///
    /// # Errors
    /// As [`TestSection::of_fields`].
    pub fn of_cells(
        scene: &Scene,
        cells: Vec<GasOnCells>,
        solids: Option<Solids>,
    ) -> Result<TestSection, RenderError> {
        TestSection::of_gas(scene, Vec::new(), cells, solids)
    }

    fn of_gas(
        scene: &Scene,
        fields: Vec<Field>,
        cells: Vec<GasOnCells>,
        solids: Option<Solids>,
    ) -> Result<TestSection, RenderError> {
        let (wanted, found) = (scene.light.wavelengths_nm.len(), fields.len().max(cells.len()));
        let of_cells = cells.first().map(GasOnCells::centre_m);
        let centre_m = fields.first().map(Field::centre_m).or(of_cells);
        let (Some(centre_m), true) = (centre_m, found == wanted) else {
            return Err(RenderError::Fields { wanted, found });
        };
        let view = scene.view.direction.view(centre_m)?;
        let (input, warnings, caches) = (None, Vec::new(), Vec::new());
        Ok(TestSection { fields, cells, view, solids, media: None, input, warnings, caches })
    }

    /// Keeps what marches compute from the fields (splines, projections), and the fields on a GPU,
    /// for further images. This takes as much memory as the fields again, and a second image then
    /// takes only the time of its light. Fields must not be replaced after this.
    #[must_use]
    pub fn with_caches(mut self) -> TestSection {
        self.caches = self.fields.iter().map(|_| Caches::default()).collect();
        self
    }

    /// Computes what the image of a scene will take from the caches of
    /// [`TestSection::with_caches`]: splines and projections, and the copy on a device. Errors are
    /// those of the image, so they are left to it.
    pub fn prepare(&self, scene: &Scene) {
        if self.caches.is_empty() || !scene.technique.follows_light() {
            return;
        }
        let against_light = matches!(scene.technique, TechniqueSpec::Bos { .. });
        let opd = matches!(scene.technique, TechniqueSpec::Interferogram { .. });
        for line in 0..self.caches.len().min(scene.light.wavelengths_nm.len()) {
            let _ = self.paths(scene, line, PathQuantities { opd }, against_light, false);
        }
    }

    /// Index of the reference medium for a line of the spectrum.
    pub fn n0(&self, line: usize) -> f64 {
        self.cells.get(line).map_or_else(|| self.fields[line].n0(), GasOnCells::n0)
    }

    /// Centre of the gas: of its lattice, or of the box of its mesh.
    pub fn centre_m(&self) -> DVec3 {
        self.cells.first().map_or_else(|| self.fields[0].centre_m(), GasOnCells::centre_m)
    }

    /// Size of the gas: of its lattice, or of the box of its mesh.
    pub fn size_m(&self) -> DVec3 {
        self.cells.first().map_or_else(|| self.fields[0].size_m(), GasOnCells::size_m)
    }

    /// Nodes of the lattice; `None` for the cells of a mesh.
    pub fn grid(&self) -> Option<[usize; 3]> {
        self.fields.first().map(Field::dims)
    }

    /// Replaces the gas by the same gas at rest, with the same bodies and blank places, and returns
    /// it.
    ///
    /// # Errors
    /// If a field cannot be made, which the fields themselves rule out.
    pub fn take_flow(&mut self) -> Result<(Vec<Field>, Vec<GasOnCells>), RenderError> {
        let fields = self.without_flow()?;
        let cells = self.cells.iter().map(GasOnCells::at_rest).collect();
        let flow = std::mem::replace(&mut self.fields, fields);
        Ok((flow, std::mem::replace(&mut self.cells, cells)))
    }

    /// The fields of the same gas at rest everywhere, with the same bodies and blank places.
    ///
    /// # Errors
    /// If a field cannot be made, which the fields themselves rule out.
    pub fn without_flow(&self) -> Result<Vec<Field>, RenderError> {
        let still = |f: &Field| {
            let eps = vec![0.0; f.eps().len()];
            let nodes = f.nodes().map(<[_]>::to_vec);
            Field::new(f.dims(), f.spacing_m(), f.origin_m(), eps, f.n0(), nodes)
        };
        self.fields.iter().map(|f| Ok(still(f).map_err(input::InputError::from)?)).collect()
    }

    /// Extent of the field along the view's right and up, in metres.
    pub fn sides_m(&self) -> [f64; 2] {
        let size = self.size_m();
        [self.view.right, self.view.up].map(|axis| axis.abs().dot(size))
    }

    /// Depth of the field along the light, in metres.
    pub fn depth_m(&self) -> f64 {
        self.view.forward.abs().dot(self.size_m())
    }
}
