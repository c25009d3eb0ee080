//! The pictures of the report and of the README: the dissertation's data sets, each with the command that draws it.

use super::framing::Framing;
use super::look::Look;
use super::subject::{Subject, color_by_height};
use super::{Drawn, Wish, draw};
use anyhow::Context as _;
use datasets::catalogue::{self, Data};
use datasets::isosurface::Options;
use datasets::view::View;
use glam::{DVec3, Vec3};
use rt_core::accel::BuildOptions;
use rt_core::effects::Effects;
use rt_core::frame::Layers;

/// What the colours show.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Coloring {
    /// The data set's scalars: isovalues, field strength.
    Scalars,
    /// Height over the ground plane.
    Height,
    /// One colour, linear RGB.
    Plain([f32; 3]),
}

/// A picture of generated data.
#[derive(Debug)]
pub struct Entry {
    /// Name on the command line.
    pub name: &'static str,
    /// What it shows.
    pub caption: &'static str,
    /// Data sets of the catalogue with their sizes and colouring.
    data: &'static [(&'static str, &'static str, Coloring)],
    /// Name of the first data set's view, or a camera that fits everything.
    view: Option<&'static str>,
    /// Eye of a camera that looks at the origin, in place of a view.
    eye: Option<[f64; 3]>,
    effects: Effects,
    colors: &'static str,
    range: Option<[f32; 2]>,
    occlusion_radii: f64,
}

const SOFT: Effects = Effects::SOFT_SHADOWS.union(Effects::SHADOWS).union(Effects::AMBIENT_OCCLUSION);

/// All pictures.
pub const ALL: &[Entry] = &[
    Entry {
        name: "wavelet",
        caption: "Nested isosurfaces of the wavelet, one million triangles, coloured by isovalue, with soft shadows \
                  and ambient occlusion (the dissertation’s figures 3.5 and 3.6).",
        data: &[("wavelet", "1M", Coloring::Scalars)],
        view: None,
        eye: Some([247.0, -449.0, 224.0]),
        effects: SOFT,
        colors: "cool-warm",
        range: Some([90.0, 220.0]),
        occlusion_radii: 0.25,
    },
    Entry {
        name: "mixing-layer-outside",
        caption: "The turbulent interface of two gases from outside (RMO of table 4.1), coloured by height, with \
                  ambient occlusion and soft shadows.",
        data: &[("mixing-layer", "small", Coloring::Height)],
        view: Some("RMO"),
        eye: None,
        effects: SOFT,
        colors: "cool-warm",
        range: None,
        occlusion_radii: 0.15,
    },
    Entry {
        name: "mixing-layer-inside",
        caption: "The same interface from within (RMI of table 4.1).",
        data: &[("mixing-layer", "small", Coloring::Height)],
        view: Some("RMI"),
        eye: None,
        effects: SOFT,
        colors: "cool-warm",
        range: None,
        occlusion_radii: 0.15,
    },
    Entry {
        name: "plasma",
        caption: "Flux ropes of a reconnecting current sheet with magnetic field lines as tubes (VPIC of table 4.1), \
                  the tubes coloured by field strength.",
        data: &[
            ("plasma", "small", Coloring::Plain([0.55, 0.56, 0.58])),
            ("plasma-tubes", "small", Coloring::Scalars),
        ],
        view: Some("whole"),
        eye: None,
        effects: SOFT,
        colors: "viridis",
        range: None,
        occlusion_radii: 0.15,
    },
    Entry {
        name: "impact",
        caption: "A ball has hit a plate: crater, rim and ejecta (the fracture data of chapter 4), with soft shadows \
                  and ambient occlusion.",
        data: &[("impact", "small", Coloring::Plain([0.60, 0.50, 0.40]))],
        view: Some("whole"),
        eye: None,
        effects: SOFT,
        colors: "viridis",
        range: None,
        occlusion_radii: 0.15,
    },
    Entry {
        name: "star",
        caption: "Magnetic field lines of a star as tubes (the VAPOR star of table 4.1), coloured by field strength.",
        data: &[("star-field-lines", "small", Coloring::Scalars)],
        view: Some("whole"),
        eye: None,
        effects: SOFT,
        colors: "cool-warm",
        range: None,
        occlusion_radii: 0.2,
    },
    Entry {
        name: "glass",
        caption: "A closed isosurface of the wavelet as glass: refraction, total internal reflection and absorption.",
        data: &[("closed-wavelet", "small", Coloring::Plain([0.55, 0.85, 0.80]))],
        view: None,
        eye: None,
        effects: Effects::REFRACTION,
        colors: "viridis",
        range: None,
        occlusion_radii: 0.2,
    },
];

/// The picture of that name; the error lists the names.
pub fn find(name: &str) -> Result<&'static Entry, String> {
    ALL.iter().find(|e| e.name == name).ok_or_else(|| {
        let known: Vec<&str> = ALL.iter().map(|e| e.name).collect();
        format!("there is no picture `{name}`; there are: {}", known.join(", "))
    })
}

/// A picture with what it took.
pub struct Painted {
    /// The picture.
    pub drawn: Drawn,
    /// How it was wished.
    pub wish: Wish,
    /// What is in it, in words.
    pub contents: String,
    /// Wall time of generating the data.
    pub data_secs: f64,
}

impl Entry {
    /// Generates the data and draws them. `go_on` may end the work.
    pub fn paint(
        &self,
        size: [u32; 2],
        samples: u32,
        go_on: &mut dyn FnMut() -> anyhow::Result<()>,
    ) -> anyhow::Result<Painted> {
        let start = std::time::Instant::now();
        let mut subject = Subject::empty(DVec3::Z);
        let mut framing = Framing::Fitted;
        for &(name, size, coloring) in self.data {
            let entry = catalogue::find(name)?;
            let options = Options { normals: true, scalars: coloring == Coloring::Scalars };
            let mut stopped = Ok(());
            let generated = entry.generate(size, options, &mut |_, _| {
                stopped = go_on();
                stopped.is_ok()
            });
            stopped?;
            let mut data = generated?;
            if let (Data::Mesh(mesh), Coloring::Height) = (&mut data, coloring) {
                color_by_height(mesh, Vec3::Z);
            }
            let plain = if let Coloring::Plain(c) = coloring { c } else { [0.8; 3] };
            subject.add_generated(data, plain)?;
            if let (Some(wish), Framing::Fitted) = (self.view, &framing) {
                let view = entry.views().into_iter().find(|v| v.name == wish);
                framing = Framing::At(view.with_context(|| format!("{name} has no view `{wish}`"))?);
            }
        }
        if let Some(eye) = self.eye {
            framing = Framing::At(View::new(self.name, eye.into(), DVec3::ZERO));
        }
        let data_secs = start.elapsed().as_secs_f64();
        let contents = subject.contents.join(", ");
        let look = Look {
            effects: self.effects,
            colors: self.colors.into(),
            range: self.range,
            occlusion_radii: self.occlusion_radii,
            ..Look::default()
        };
        let wish =
            Wish { size, samples, look, framing, build: BuildOptions::default(), layers: Layers::COLOR };
        let drawn = draw(subject, &wish, go_on)?;
        Ok(Painted { drawn, wish, contents, data_secs })
    }

    /// The command that draws it.
    pub fn command(&self, size: [u32; 2], samples: u32) -> String {
        let [w, h] = size;
        format!("bench picture {} -o {}.png --size {w}x{h} --samples {samples}", self.name, self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_picture_shows_its_data_and_uses_its_effects() {
        for e in ALL.iter().filter(|e| e.name != "wavelet") {
            // Large enough for the star's thin tubes.
            let p = e.paint([144, 96], 1, &mut || Ok(())).unwrap();
            // Paths inside glass may be cut; the renderer says so.
            let expected = |w: &String| e.name == "glass" && w.contains("max_bounces");
            assert!(p.drawn.warnings.iter().all(expected), "{}: {:?}", e.name, p.drawn.warnings);
            assert!(p.drawn.report.effects.contains(e.effects.without(Effects::SHADOWS)), "{}", e.name);
            let colors: std::collections::BTreeSet<[u32; 4]> =
                p.drawn.frame.color.iter().map(|c| c.map(f32::to_bits)).collect();
            assert!(colors.len() > 200, "{}: {} colours", e.name, colors.len());
        }
    }

    #[test]
    fn unknown_pictures_list_what_there_is() {
        assert!(find("cornell-box").unwrap_err().contains("mixing-layer-inside"));
    }
}
