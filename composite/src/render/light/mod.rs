//! Photographs of a gas that ranks hold in bricks: schlieren images and shadowgraphs with rays that
//! are bent across the borders of bricks.
//!
//! Each rank has the density at the nodes of a box, with as many layers around its own cells as the
//! interpolant's [`Stencil`] needs: none for trilinear interpolation,
//! one for trilinear gradients. Where a ray leaves these cells, its state goes to the rank that has
//! the next one (72 bytes: `wire.rs`). Ranks work in rounds: each moves the first of the rays that
//! it has as far as it can, then all exchange what has left. A round has a share of the rays only,
//! so that a rank whose rays come from others begins while these still move theirs.
//!
//! Every step of a ray takes one sample, at a place that follows from its state
//! ([`schlieren::march::InBricks`]). So the picture has the same bits for any number of ranks and
//! any bricks, if the nodes that several ranks hold have the same values on all of them.
mod gas;
mod rays;
mod wire;

pub use gas::{Gas, GasBrick, GasValues, Strided};

use super::FrameError;
use super::distributed::agree_on;
use super::request_reply::RankChannel;
use super::volume_bricks::first_outside;
use crate::comm::Communicator;
use gas::Optical;
use rt_core::glam::{DVec3, UVec3};
use rt_core::volume::Brick;
use schlieren::cutoff::{Cutoff, Knife, KnifePosition};
use schlieren::film::Framing;
use schlieren::film::traced::expose_corners;
use schlieren::interpolate::Interpolant;
use schlieren::march::{InBricks, Stencil};
use schlieren::optics::{Optics, SourceShape};
use schlieren::path::{Exit, Status};
use schlieren::technique::Technique;
use schlieren::technique::schlieren::Schlieren;
use schlieren::view::View;
use std::time::Duration;

/// Most pixels along a side.
const LARGEST_SIDE: u32 = 1 << 14;

/// How light becomes a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightTechnique {
    /// A knife's edge in the cut-off plane of a schlieren bench with a slit as its source, focused
    /// on the centre of the gas.
    Knife {
        /// Deflections in this direction brighten the picture; counter-clockwise from its right.
        angle_deg: f64,
        /// Width of the slit, across the edge.
        slit_width_m: f64,
        /// Focal length of both lenses.
        focal_length_m: f64,
        /// Fraction of the slit's image that the knife leaves open: the brightness without gas.
        open_fraction: f64,
    },
    /// No cut-off: the film is focused on a plane.
    Shadowgraph {
        /// Distance of that plane from the centre of the gas, along the light.
        focus_m: f64,
    },
}

/// What is photographed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shot {
    /// Direction of the light, towards the film.
    pub direction: DVec3,
    /// What is up in the picture.
    pub up: DVec3,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Side of a pixel in the gas, metres; 0 for pixels that show the whole gas.
    pub pixel_m: f64,
    /// The bench.
    pub technique: LightTechnique,
    /// [`Interpolant::TrilinearGradient`] or [`Interpolant::Trilinear`].
    pub interpolant: Interpolant,
    /// Longest step of a ray, in distances of nodes.
    pub step_voxels: f64,
}

/// How ranks make a photograph together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightOptions {
    /// The rank that gets the picture; the same on all ranks.
    pub root: usize,
    /// Longest wait for one message.
    pub timeout: Duration,
    /// Use rayon's threads within a rank.
    pub parallel: bool,
}

impl Default for LightOptions {
    fn default() -> Self {
        LightOptions { root: 0, timeout: Duration::from_secs(60), parallel: false }
    }
}

/// What a photograph cost this rank, and what became of its light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct LightReport {
    /// Rays of the picture.
    pub rays: u64,
    /// Rays that this rank moved; one that came back counts again.
    pub rays_moved: u64,
    /// Rays that this rank sent to others.
    pub rays_sent: u64,
    /// Exchanges until no rank had a ray left.
    pub rounds: u32,
    /// Bytes that this rank sent.
    pub bytes_sent: u64,
    /// Rays that ended where a density is no finite number; on the root.
    pub masked: u64,
    /// Rays that were turned back; on the root.
    pub turned: u64,
}

/// One rank's result of a photograph.
#[derive(Clone, Debug)]
pub struct LightOutput {
    /// On the root: the picture row by row from the top, 1 for all light of the source.
    pub picture: Option<Vec<f32>>,
    /// On the root: the exits at the corners of the pixels, `width + 1` in each of `height + 1`
    /// rows.
    pub exits: Option<Vec<Exit>>,
    /// Costs and faults.
    pub report: LightReport,
}

/// Photographs a gas of which each rank gives a brick, or none. All ranks must call it.
///
/// # Errors
/// [`FrameError::Contradiction`] and [`FrameError::RankScene`] on every rank, when ranks give
/// different settings, one gives something unusable, or no rank has some of the cells: the
/// communicator can still be used then. Otherwise errors of messages and of the transport, after
/// which it cannot.
pub fn photograph<V: GasValues>(
    comm: &mut dyn Communicator,
    gas: &Gas,
    brick: Option<&GasBrick<'_, V>>,
    shot: &Shot,
    options: &LightOptions,
) -> Result<LightOutput, FrameError> {
    let mut channel = RankChannel::new(comm, options.timeout);
    let result = in_channel(&mut channel, gas, brick, shot, options);
    if let Err(error) = &result
        && !error.is_agreed()
    {
        channel.abort(&error.to_string());
    }
    let (film, report) = result?;
    let (picture, exits) = film.unzip();
    let report = LightReport { bytes_sent: channel.report.bytes_sent, ..report };
    Ok(LightOutput { picture, exits, report })
}

type Film = (Vec<f32>, Vec<Exit>);

fn in_channel<V: GasValues>(
    channel: &mut RankChannel<'_>,
    gas: &Gas,
    brick: Option<&GasBrick<'_, V>>,
    shot: &Shot,
    options: &LightOptions,
) -> Result<(Option<Film>, LightReport), FrameError> {
    agree_on(channel, &[("gas", gas), ("photograph", shot), ("root", &options.root)])?;
    // Of the same settings, all ranks make the same, or have the same error.
    let setup = Setup::new(gas, shot, options, channel.size())
        .map_err(|reason| FrameError::RankScene { rank: 0, reason })?;
    channel.agree_on_success(brick.map_or(Ok(()), |brick| brick.check(gas)))?;

    let own = brick.map_or([[0; 3]; 2], |brick| brick.cells(&setup.march));
    let words: Vec<u32> = own.as_flattened().iter().map(|c| *c as u32).collect();
    let bricks: Vec<Brick> = channel.all_gather(&words)?.iter().map(|w| brick_of(w)).collect();
    let whole = UVec3::from(setup.march.cells().map(|c| c as u32));
    if let Some(cell) = first_outside(Brick { first: UVec3::ZERO, end: whole }, &bricks) {
        let layers = match setup.march.stencil() {
            Stencil::Cell => "the eight nodes of each cell",
            Stencil::CellAndNeighbours => "one more layer of nodes around the cells of each brick",
        };
        let values = format!(
            "no rank has what light needs in cell {cell} of {whole}: that is {layers}, so bricks \
             of neighbours overlap"
        );
        let (what, field) = ("gas".to_owned(), "bricks".to_owned());
        return Err(FrameError::Contradiction { what, field, values });
    }

    let optical = brick.map(|brick| Optical::new(gas, brick, own, &setup.march, options.parallel));
    let (exits, mut report) = rays::trace(channel, &setup, &bricks, optical.as_ref(), options)?;
    let film = exits.map(|exits| developed(channel, &setup, exits, &mut report)).transpose()?;
    // A root that got what cannot be ends the photograph for all.
    channel.all_gather(&[0])?;
    Ok((film, report))
}

/// The picture of the exits.
fn developed(
    channel: &RankChannel<'_>,
    setup: &Setup,
    exits: Vec<Exit>,
    report: &mut LightReport,
) -> Result<Film, FrameError> {
    let (view, technique) = (*setup.march.view(), &setup.technique);
    let film = expose_corners::<1>(setup.framing, view, technique, exits.clone());
    let fault = || channel.message_error(channel.rank(), "exits of light", exits.len());
    let (film, _) = film.ok_or_else(fault)?;
    let count = |status| exits.iter().filter(|exit| exit.status == status).count() as u64;
    report.masked = count(Status::Masked);
    report.turned = count(Status::Turned);
    let picture = film.to_pixels(1.0).into_iter().map(|[grey]| grey).collect();
    Ok((picture, exits))
}

fn brick_of(words: &[u32]) -> Brick {
    let at = |k: usize| UVec3::new(words[k], words[k + 1], words[k + 2]);
    Brick { first: at(0), end: at(3) }
}

/// What all ranks make of the settings.
struct Setup {
    march: InBricks,
    framing: Framing,
    technique: Technique,
}

impl Setup {
    /// # Errors
    /// In words, what cannot be photographed.
    fn new(gas: &Gas, shot: &Shot, options: &LightOptions, ranks: usize) -> Result<Setup, String> {
        if options.root >= ranks {
            return Err(format!("root is {}, but there are {ranks} ranks", options.root));
        }
        let (width, height) = (shot.width, shot.height);
        if !(1..=LARGEST_SIDE).contains(&width) || !(1..=LARGEST_SIDE).contains(&height) {
            return Err(format!("a picture of {width}x{height}: give 1 to {LARGEST_SIDE} pixels"));
        }
        let lattice = gas.lattice()?;
        let view = View::new(shot.direction, shot.up, gas.centre_m()).map_err(|e| e.to_string())?;
        let march = InBricks::new(&lattice, view, shot.interpolant, shot.step_voxels)
            .map_err(|e| e.to_string())?;
        let framing = match shot.pixel_m {
            0.0 => Framing::fitted(width, height, gas.sides_m(&view)),
            pixel_m => Framing { width, height, pixel_m, center_m: [0.0; 2] },
        };
        if !framing.pixel_m.is_finite() || framing.pixel_m <= 0.0 {
            return Err(format!("pixel_m is {}: give metres, or 0", shot.pixel_m));
        }
        Ok(Setup { march, framing, technique: technique_of(&shot.technique)? })
    }
}

fn technique_of(technique: &LightTechnique) -> Result<Technique, String> {
    match *technique {
        LightTechnique::Knife { angle_deg, slit_width_m, focal_length_m, open_fraction } => {
            let lengths = [("slit_width_m", slit_width_m), ("focal_length_m", focal_length_m)];
            for (name, length) in lengths {
                if !(1e-9..=1e9).contains(&length) {
                    return Err(format!("{name} is {length}: give a length, in metres"));
                }
            }
            if !angle_deg.is_finite() {
                return Err(format!("angle_deg is {angle_deg}: give degrees"));
            }
            if !(0.0..=1.0).contains(&open_fraction) {
                return Err(format!("open_fraction is {open_fraction}: give 0 to 1"));
            }
            let source = SourceShape::Slit {
                width_m: slit_width_m,
                length_m: 5.0 * slit_width_m,
                angle_deg,
            };
            let optics = Optics {
                source,
                collimator_focal_length_m: focal_length_m,
                schlieren_focal_length_m: focal_length_m,
                focus_m: 0.0,
            };
            let position = KnifePosition::OpenFraction(open_fraction);
            let knife = Cutoff::Knife(Knife { angle_deg, position });
            Ok(Technique::Schlieren(Schlieren::new(optics, &knife, false)))
        }
        LightTechnique::Shadowgraph { focus_m } if focus_m.is_finite() => {
            Ok(Technique::Shadowgraph(Optics { focus_m, ..Optics::DEFAULT }))
        }
        LightTechnique::Shadowgraph { focus_m } => {
            Err(format!("focus_m is {focus_m}: give a distance, in metres"))
        }
    }
}
