//! Flows by name, for schlieren images.
//!
//! ```
//! use datasets::catalogue::flows::find;
//! use datasets::generate::flow::Fields;
//! let flow = find("wedge")?.generate("tiny", Fields::Density)?;
//! assert_eq!((flow.fields[0].name, flow.fields[0].unit), ("density", "kg/m³"));
//! assert!(flow.body.is_some());
//! # Ok::<(), datasets::catalogue::CatalogueError>(())
//! ```

use super::{CatalogueError, SEED};
use crate::generate::blunt_body::BluntBody;
use crate::generate::coal_fire::{self, CoalFire};
use crate::generate::combustion_jet::{self, CombustionJet};
use crate::generate::cone_shock::Cone;
use crate::generate::fire::{self, Fire};
use crate::generate::flow::{Fields, Flow, FlowError};
use crate::generate::helium_plume::{self, HeliumPlume};
use crate::generate::multifield_jet::multifield_jet;
use crate::generate::oblique_shock::Wedge;
use crate::generate::sample_fields::SampleField;
use crate::generate::thermal_plume::ThermalPlume;
use glam::UVec3;

/// A named flow.
#[derive(Debug)]
pub struct FlowEntry {
    /// Name on the command line.
    pub name: &'static str,
    /// What it shows.
    pub description: &'static str,
    /// Where the flow appears in the thesis.
    pub thesis: &'static str,
    /// Number of points at full size.
    pub full_dims: UVec3,
    source: Source,
}

#[derive(Debug, Clone, Copy)]
enum Source {
    CombustionJet,
    MultifieldJet,
    Fire,
    HeliumPlume,
    CoalFire,
    BluntBody,
    Wedge,
    Cone,
    ThermalPlume,
    Sample(SampleField),
}

/// The sizes of every flow, ascending: full size divided by 8, 4 and 2 along each axis, and full
/// size.
pub const SIZES: [(&str, u32); 4] = [("tiny", 8), ("small", 4), ("medium", 2), ("thesis", 1)];

const fn flow(
    name: &'static str,
    description: &'static str,
    thesis: &'static str,
    full_dims: UVec3,
    source: Source,
) -> FlowEntry {
    FlowEntry { name, description, thesis, full_dims, source }
}

static FLOWS: [FlowEntry; 12] = [
    flow(
        "combustion-jet",
        "turbulent plane jet of CO and H2 burning between two streams of oxidiser",
        "the combustion data set of table 5.1",
        combustion_jet::THESIS_DIMS,
        Source::CombustionJet,
    ),
    flow(
        "multifield-jet",
        "the combustion jet as density and five fields: chi, hr, mixfrac, vort, Y_OH",
        "the multifield data of section 5.7",
        combustion_jet::THESIS_DIMS,
        Source::MultifieldJet,
    ),
    flow(
        "heptane-fire",
        "pool fire of heptane, 0.3 m, in a cubic metre of air",
        "the heptane fire of table 5.1",
        fire::THESIS_DIMS,
        Source::Fire,
    ),
    flow(
        "helium-plume",
        "helium rising from a disc of one metre into air",
        "the helium plume of table 5.1",
        helium_plume::THESIS_DIMS,
        Source::HeliumPlume,
    ),
    flow(
        "coal-fire",
        "round jet flame of coal volatiles in hot air",
        "the coal fire of table 5.1",
        coal_fire::THESIS_DIMS,
        Source::CoalFire,
    ),
    flow(
        "blunt-body",
        "sphere-cone at Mach 6: bow shock, shock layer, wake; with its body",
        "the re-entry vehicle of table 5.1",
        UVec3::splat(256),
        Source::BluntBody,
    ),
    flow(
        "wedge",
        "wedge of 10 degrees at Mach 2: exact oblique shocks and expansion fans; with its body",
        "none (validation: theta-beta-M)",
        UVec3::new(384, 320, 64),
        Source::Wedge,
    ),
    flow(
        "cone",
        "cone of 20 degrees at Mach 3: exact conical flow; with its body",
        "none (validation: Taylor-Maccoll)",
        UVec3::new(256, 256, 256),
        Source::Cone,
    ),
    flow(
        "thermal-plume",
        "mean plume above 100 W of heat",
        "none (validation: closed form)",
        UVec3::splat(256),
        Source::ThermalPlume,
    ),
    flow(
        "gaussian",
        "blob of refractive index 1 + 1e-4 exp(-r²/2σ²), σ 0.12 m in a cube of 1 m; as \
         index_minus_one",
        "none (validation: closed form)",
        UVec3::splat(256),
        Source::Sample(SampleField::Gaussian { amplitude: 1e-4, sigma_m: 0.12 }),
    ),
    flow(
        "luneburg",
        "Luneburg's lens of radius 1 m in a cube of 2.5 m; as refractive_index",
        "none (validation: closed form)",
        UVec3::splat(256),
        Source::Sample(SampleField::Luneburg),
    ),
    flow(
        "fish-eye",
        "Maxwell's fish-eye 2 / (1 + r²) in a cube of 2.5 m; as refractive_index",
        "none (validation: closed form)",
        UVec3::splat(256),
        Source::Sample(SampleField::Maxwell { n0: 2.0, radius_m: 1.0 }),
    ),
];

/// All flows.
pub fn entries() -> &'static [FlowEntry] {
    &FLOWS
}

/// The flow of that name.
pub fn find(name: &str) -> Result<&'static FlowEntry, CatalogueError> {
    FLOWS.iter().find(|e| e.name == name).ok_or_else(|| CatalogueError::UnknownName {
        name: name.into(),
        known: FLOWS.iter().map(|e| e.name).collect::<Vec<_>>().join(", "),
    })
}

impl FlowEntry {
    /// Number of points at a named size.
    pub fn dims(&self, size: &str) -> Result<UVec3, CatalogueError> {
        let divisor = SIZES.iter().find(|s| s.0.eq_ignore_ascii_case(size)).ok_or_else(|| {
            CatalogueError::UnknownSize {
                name: self.name,
                size: size.into(),
                known: SIZES.map(|s| s.0).join(", "),
            }
        })?;
        Ok((self.full_dims / divisor.1).max(UVec3::splat(8)))
    }

    /// Generates the flow at a named size.
    pub fn generate(&self, size: &str, fields: Fields) -> Result<Flow, CatalogueError> {
        Ok(self.generate_at(self.dims(size)?, fields)?)
    }

    /// Generates the flow on any number of points. With [`Fields::Density`], only the first field
    /// of the sample fields and the multifield jet is kept.
    pub fn generate_at(&self, dims: UVec3, fields: Fields) -> Result<Flow, FlowError> {
        let seed = SEED;
        match self.source {
            Source::CombustionJet => CombustionJet { dims, seed }.flow(fields),
            Source::MultifieldJet => match fields {
                Fields::All => multifield_jet(CombustionJet { dims, seed }),
                Fields::Density => CombustionJet { dims, seed }.flow(fields),
            },
            Source::Fire => Fire { dims, seed }.flow(fields),
            Source::HeliumPlume => HeliumPlume { dims, seed }.flow(fields),
            Source::CoalFire => CoalFire { dims, seed }.flow(fields),
            Source::BluntBody => BluntBody::default().flow(dims, fields),
            Source::Wedge => Wedge::default().flow(dims, fields),
            Source::Cone => Cone::default().flow(dims, fields),
            Source::ThermalPlume => ThermalPlume::default().flow(dims, fields),
            Source::Sample(sample @ SampleField::Gaussian { .. }) => {
                sample.index_minus_one(dims, 0.5)
            }
            Source::Sample(sample) => sample.flow(dims, 1.25),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flow_generates_and_can_be_written_as_vtk() {
        for (i, e) in entries().iter().enumerate() {
            assert!(entries()[..i].iter().all(|o| o.name != e.name), "{} twice", e.name);
            let dims = (e.full_dims / 16).max(UVec3::splat(8));
            let flow = e.generate_at(dims, Fields::All).unwrap();
            assert_eq!(flow.dims, dims, "{}", e.name);
            for f in &flow.fields {
                let (low, high) =
                    f.range().unwrap_or_else(|| panic!("{}: {} has no value", e.name, f.name));
                assert!(low < high || f.name == "pressure", "{}: {} is constant", e.name, f.name);
                assert!(
                    f.name.starts_with("Y_") || low >= 0.0 || f.name == "index_minus_one",
                    "{}: {}",
                    e.name,
                    f.name
                );
            }
            let alone = e.generate_at(dims, Fields::Density).unwrap();
            assert_eq!(alone.fields.len(), 1, "{}", e.name);
            let same = alone.fields[0].values.iter().zip(&flow.fields[0].values);
            assert!(
                same.map(|(a, b)| (a.to_bits(), b.to_bits())).all(|(a, b)| a == b),
                "{}",
                e.name
            );
            assert!(flow.into_dataset().check().is_ok());
        }
    }

    #[test]
    fn thesis_sizes_are_those_of_table_5_1() {
        let dims = |name| find(name).unwrap().dims("thesis").unwrap().to_array();
        assert_eq!(dims("combustion-jet"), [480, 720, 100]);
        assert_eq!(dims("heptane-fire"), [293, 293, 293]);
        assert_eq!(dims("helium-plume"), [227, 302, 302]);
        assert_eq!(dims("coal-fire"), [402, 162, 162]);
        assert_eq!(dims("blunt-body"), [256, 256, 256]);
        assert!(find("x38").unwrap_err().to_string().contains("blunt-body"));
        assert!(find("wedge").unwrap().dims("huge").unwrap_err().to_string().contains("medium"));
    }
}
