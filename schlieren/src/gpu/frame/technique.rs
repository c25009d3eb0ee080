//! A technique in WGSL: the source text that computes the energy of a photon, and its numbers.

use super::params::parts;
use crate::cutoff::knife::Open;
use crate::cutoff::{Cutoff, FilterImage, Kind, Passes};
use crate::optics::SourceImage;
use crate::technique::{Technique, schlieren::Schlieren};

/// Largest number of dots from the middle of the image, so that cells have whole numbers in f32.
const MOST_DOTS: f64 = 1e6;

/// The shader of a technique.
#[derive(Debug, Clone, Default)]
pub(super) struct TechniqueShader<'a> {
    /// Constants and functions, the last of which is `technique_energy`.
    pub(super) text: String,
    /// `Frame::technique`.
    pub(super) numbers: [[f32; 4]; 4],
    /// Seed of the dots of a background.
    pub(super) dots_seed: u32,
    /// The image of a filter.
    pub(super) image: Option<&'a FilterImage>,
}

impl<'a> TechniqueShader<'a> {
    /// `reach_m` is the largest coordinate of the image in the plane of focus.
    ///
    /// # Errors
    /// Why the device cannot compute the technique.
    pub(super) fn new(
        technique: &'a Technique,
        reach_m: f64,
    ) -> Result<TechniqueShader<'a>, String> {
        let mut shader = TechniqueShader::default();
        match technique {
            Technique::Shadowgraph(_) => shader.text += include_str!("technique/shadowgraph.wgsl"),
            Technique::Schlieren(s) => shader.schlieren(s),
            Technique::Interferogram(i) => {
                shader.text += include_str!("technique/interferogram.wgsl");
                let [waves, x, y] =
                    [i.waves_per_m, i.carrier_per_m[0], i.carrier_per_m[1]].map(parts);
                shader.numbers[0] = [waves[0], waves[1], x[0], x[1]];
                shader.numbers[1] = [y[0], y[1], i.visibility, 0.0];
            }
            Technique::Bos(b) => {
                let dots = b.dots;
                if reach_m / dots.spacing_m > MOST_DOTS {
                    return Err(format!(
                        "the background has more than {MOST_DOTS:e} dots along the image"
                    ));
                }
                shader.text += include_str!("technique/bos.wgsl");
                let per_m = parts(1.0 / dots.spacing_m);
                let radius = 0.5 * dots.diameter_m / dots.spacing_m;
                shader.numbers[0] = [per_m[0], per_m[1], (radius * radius) as f32, 0.0];
                shader.dots_seed = dots.seed;
            }
        }
        Ok(shader)
    }

    fn schlieren(&mut self, s: &'a Schlieren) {
        let (band, kind) = (s.band(), s.plane().kind());
        // A point has no area over which a circle could be averaged.
        let is_point = *s.plane().image() == SourceImage::Point;
        let circle_at_point = is_point && matches!(kind, Kind::Other(Cutoff::Aperture(_)));
        let averaged = !s.samples_the_source() && !circle_at_point;
        self.text += &format!("const AVERAGED = {averaged};\nconst BAND = {};\n", band.is_some());
        if let Some([r, g, b]) = band {
            self.numbers[3] = [r, g, b, 0.0];
        }
        match kind {
            Kind::Other(Cutoff::Open | Cutoff::Knife(_)) => {
                self.text += include_str!("technique/no_cutoff.wgsl");
            }
            Kind::Knife(edge) => {
                let (open, [p, q]) = match edge.open {
                    Open::Step => (0, [0.0; 2]),
                    Open::Linear { half_m } => (1, [half_m, 0.0]),
                    Open::Trapezoid { p, q } => (2, [p as f32, q as f32]),
                    Open::Disc { radius_m } => (3, [radius_m as f32, 0.0]),
                };
                self.text += &format!("const OPEN = {open}u;\n");
                self.text += include_str!("technique/arctangent.wgsl");
                self.text += include_str!("technique/knife.wgsl");
                let [x, y] = edge.direction;
                self.numbers[0] = [x, y, edge.edge_m, 0.0];
                self.numbers[1] = [p, q, 0.0, 0.0];
            }
            Kind::Other(Cutoff::Aperture(a)) => {
                self.text += include_str!("technique/arctangent.wgsl");
                self.text += include_str!("technique/circle.wgsl");
                let [x, y] = a.center_m.map(|c| c as f32);
                let inside = f32::from(a.passes == Passes::Inside);
                self.numbers[0] = [x, y, a.radius_m as f32, inside];
                self.numbers[1] = match *s.plane().image() {
                    SourceImage::Disc { radius_m } => [radius_m as f32, 0.0, 0.0, 0.0],
                    _ => [0.0; 4],
                };
            }
            Kind::Other(Cutoff::Color(c)) => {
                self.text += include_str!("technique/arctangent.wgsl");
                self.text += include_str!("technique/color_wheel.wgsl");
                let turn = (c.red_deg / 60.0).rem_euclid(6.0);
                self.numbers[0] = [c.radius_m as f32, turn as f32, 0.0, 0.0];
            }
            Kind::Other(Cutoff::Image(i)) => {
                self.text += include_str!("technique/image.wgsl");
                let ([w, h], [columns, rows]) = (i.size_m(), i.size_px());
                self.numbers[0] = [w as f32, h as f32, columns as f32, rows as f32];
                self.image = Some(i);
            }
        }
        self.text += include_str!("technique/schlieren.wgsl");
    }
}
