//! A walk along rays that collects what the medium does to light on the way.

use super::paraxial::{Packet, Sampled, walk16};
use super::{Collected, Media, Property, Volume, full};
use crate::at_level;
use crate::field::{Field, Node};
use crate::interpolate::{BSpline, LANES, Trilinear};
use crate::march::{BlankCells, Frame, Prepared};
use crate::path::Start;
use crate::plan::Mode;
use crate::view::View;
use fearless_simd::Level;

/// How the walk's rays bend.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Bend {
    /// Not at all, as line of sight.
    Straight,
    /// As light in gases: `f32`, sixteen rays at a time, by the trilinear gradient of eps.
    Paraxial,
    /// As light in lenses and liquids: `f64`, PEFRL, by the gradient of the spline.
    Full,
}

impl From<Mode> for Bend {
    fn from(mode: Mode) -> Bend {
        match mode {
            Mode::LineOfSight => Bend::Straight,
            Mode::Paraxial => Bend::Paraxial,
            Mode::Full => Bend::Full,
        }
    }
}

enum Way<'a> {
    Straight,
    Paraxial(Trilinear<'a>),
    Full(BSpline),
}

/// Collects [`Collected`] along rays of a view.
pub struct Walk<'a> {
    pub(super) field: &'a Field,
    pub(super) frame: Frame,
    pub(super) wanted: [Option<&'a Volume>; 3],
    pub(super) blank: BlankCells,
    pub(super) step_voxels: f64,
    way: Way<'a>,
    level: Level,
}

impl<'a> Walk<'a> {
    /// Through `field` with `media`, as far as they are `wanted`. `step_voxels` is the march's step; it is shortened where a property's lattice is finer than
    /// the field's.
    pub fn new(
        field: &'a Field,
        view: View,
        media: &'a Media,
        wanted: &[Property],
        bend: Bend,
        step_voxels: f64,
        blank: BlankCells,
    ) -> Walk<'a> {
        let frame = Frame::new(field, view);
        let wanted = Property::ALL.map(|p| media.get(p).filter(|_| wanted.contains(&p)));
        let finest = wanted.iter().flatten().map(|v| (v.spacing_m / frame.spacing_m).min_element());
        let step_voxels = step_voxels * finest.fold(1.0, f64::min);
        let way = match bend {
            Bend::Straight => Way::Straight,
            Bend::Paraxial => Way::Paraxial(Trilinear::new(field)),
            Bend::Full => Way::Full(BSpline::new(field)),
        };
        let step_voxels = if bend == Bend::Full { step_voxels } else { step_voxels.min(1.0) };
        Walk { field, frame, wanted, blank, step_voxels, way, level: Level::new() }
    }

    /// The view in whose frame starts are given.
    pub fn view(&self) -> &View {
        &self.frame.view
    }

    /// Walks from where each start's ray enters the field to where it leaves it, meets a solid or opaque node, or has come as far as `ends_m` says: distances along the
    /// undisturbed ray from the plane through the view's centre, such as those of bodies.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn collect(&self, starts: &[Start], ends_m: Option<&[f64]>, out: &mut [Collected]) {
        assert_eq!(starts.len(), out.len(), "one answer per start");
        assert!(ends_m.is_none_or(|e| e.len() == starts.len()), "one end per start");
        let end_m = |i: usize| ends_m.map_or(f64::INFINITY, |e| e[i]);
        let rows = match &self.way {
            Way::Full(spline) => {
                let mut known = None;
                for (i, (start, to)) in starts.iter().zip(out).enumerate() {
                    *to = full::collect(self, spline, start, end_m(i), &mut known);
                }
                return;
            }
            Way::Paraxial(trilinear) => Some(trilinear.rows()),
            Way::Straight => None,
        };
        let sampled = Sampled::new(self, rows);
        let mut known = None;
        for (chunk, (starts, out)) in starts.chunks(LANES).zip(out.chunks_mut(LANES)).enumerate() {
            let mut packet = Packet::new();
            let mut any = false;
            for (l, start) in starts.iter().enumerate() {
                let mut ray = Prepared::new(&self.frame, start, &mut known);
                if ray.meets_field() {
                    let steps = ray.steps(self.step_voxels);
                    packet.set(l, &mut ray, &self.frame, steps, end_m(chunk * LANES + l));
                    any = true;
                }
            }
            if any {
                at_level!(self.level, simd => walk16(simd, &sampled, &mut packet));
            }
            for (l, to) in out.iter_mut().enumerate() {
                *to = packet.collected[l].rounded();
            }
        }
    }

    /// [`Walk::collect`] on all threads of the current rayon pool. The result does not depend on their number.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn collect_parallel(&self, starts: &[Start], ends_m: Option<&[f64]>, out: &mut [Collected]) {
        use rayon::prelude::*;
        assert_eq!(starts.len(), out.len(), "one answer per start");
        // A multiple of the packets' size; a few milliseconds of work.
        const CHUNK: usize = 1024;
        starts.par_chunks(CHUNK).zip(out.par_chunks_mut(CHUNK)).enumerate().for_each(|(i, (s, o))| {
            self.collect(s, ends_m.map(|e| &e[i * CHUNK..i * CHUNK + s.len()]), o);
        });
    }

    /// Whether a node of this kind is where the walk ends.
    pub(super) fn stops(&self, kind: u8) -> bool {
        kind == Node::Solid as u8 || (kind != Node::Gas as u8 && self.blank == BlankCells::Opaque)
    }
}

/// Sums of one ray, in `f64`: hundreds of small terms.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sums {
    optical_depth: f64,
    emission: f64,
    rotation_rad: f64,
}

impl Sums {
    /// A piece of path of `length_m` with even values of the properties, in the order of [`Property::ALL`].
    #[inline(always)]
    pub(super) fn add(&mut self, values: [f32; 3], length_m: f64) {
        let [absorption, emission, rotation] = values.map(f64::from);
        let depth = absorption * length_m;
        if emission != 0.0 {
            // Of the light that the piece emits, (1 - exp(-a))/a leaves it, and exp(-τ) of that reaches the eye.
            let leaves = if depth == 0.0 { 1.0 } else { -(-depth).exp_m1() / depth };
            self.emission += emission * length_m * leaves * (-self.optical_depth).exp();
        }
        self.optical_depth += depth;
        self.rotation_rad += rotation * length_m;
    }

    pub(super) fn rounded(self) -> Collected {
        Collected {
            optical_depth: self.optical_depth as f32,
            emission: self.emission as f32,
            rotation_rad: self.rotation_rad as f32,
        }
    }
}
