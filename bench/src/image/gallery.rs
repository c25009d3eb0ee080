//! The images of the report and of the README: the dissertation's data sets, each with the command
//! that renders it.

use super::framing::Framing;
use super::style::{BACKGROUNDS, RenderStyle};
use super::subject::{PartColoring, Subject, color_by_height};
use super::{RenderControl, RenderRequest, RenderedImage, draw};
use anyhow::Context as _;
use datasets::catalogue::{self, Data};
use datasets::isosurface::Options;
use datasets::view::View;
use glam::{DVec3, Vec3};
use rt_core::bvh::BuildOptions;
use rt_core::effects::Effects;
use rt_core::frame::Layers;

/// Meaning of the colours.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Coloring {
    /// The data set's scalars: isovalues, field strength.
    Scalars,
    /// Height over the ground plane.
    Height,
    /// One colour, linear RGB.
    Plain([f32; 3]),
    /// Clear glass that transmits this fraction of light, linear RGB.
    Glass([f32; 3]),
}

/// An image of generated data.
#[derive(Debug)]
pub struct Entry {
    /// Name on the command line.
    pub name: &'static str,
    /// What it shows.
    pub caption: &'static str,
    /// Data sets of the catalogue with their sizes and colouring.
    data: &'static [(&'static str, &'static str, Coloring)],
    from: Viewpoint,
    effects: Effects,
    colors: &'static str,
    range: Option<[f32; 2]>,
    background: &'static str,
    occlusion_radii: f64,
    /// Factor on the radii of the data's tubes; with the original radii they would be thinner than
    /// a pixel.
    tubes: f32,
}

/// The camera position of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Viewpoint {
    /// The whole subject, viewed from this direction.
    Direction([f64; 3]),
    /// The view with this name of the first data set.
    View(&'static str),
    /// Eye and target.
    Eye([f64; 3], [f64; 3]),
}

/// Defaults that all images share.
const PLAIN: Entry = Entry {
    name: "",
    caption: "",
    data: &[],
    from: Viewpoint::Direction([-0.5, -0.7, 0.45]),
    effects: SOFT,
    colors: "cool-warm",
    range: None,
    background: "gradient",
    occlusion_radii: 0.15,
    tubes: 1.0,
};

const SOFT: Effects =
    Effects::SOFT_SHADOWS.union(Effects::SHADOWS).union(Effects::AMBIENT_OCCLUSION);

/// All images.
pub const ALL: &[Entry] = &[
    Entry {
        name: "wavelet",
        caption: "Nested isosurfaces of the wavelet, one million triangles, coloured by isovalue, \
                  with soft shadows \
                  and ambient occlusion (the dissertation’s figures 3.5 and 3.6).",
        data: &[("wavelet", "1M", Coloring::Scalars)],
        from: Viewpoint::Direction([247.0, -449.0, 224.0]),
        range: Some([90.0, 220.0]),
        occlusion_radii: 0.25,
        ..PLAIN
    },
    Entry {
        name: "mixing-layer-outside",
        caption: "The turbulent interface of two gases from outside (RMO of table 4.1), coloured \
                  by height, with \
                  ambient occlusion and soft shadows.",
        data: &[("mixing-layer", "small", Coloring::Height)],
        from: Viewpoint::Direction([-0.25, -1.0, 0.5]),
        ..PLAIN
    },
    Entry {
        name: "mixing-layer-inside",
        caption: "The same interface from within (RMI of table 4.1).",
        data: &[("mixing-layer", "small", Coloring::Height)],
        from: Viewpoint::View("RMI"),
        ..PLAIN
    },
    Entry {
        name: "plasma",
        caption: "Flux ropes of a reconnecting current sheet with magnetic field lines as tubes \
                  (VPIC of table 4.1), \
                  the tubes coloured by field strength.",
        data: &[
            ("plasma", "small", Coloring::Plain([0.55, 0.56, 0.58])),
            ("plasma-tubes", "small", Coloring::Scalars),
        ],
        from: Viewpoint::Direction([-0.2, -1.0, 0.75]),
        colors: "viridis",
        tubes: 1.5,
        ..PLAIN
    },
    Entry {
        name: "impact",
        caption: "A ball has hit a plate: crater, rim and ejecta (the fracture data of chapter 4), \
                  with soft shadows \
                  and ambient occlusion.",
        data: &[("impact", "small", Coloring::Plain([0.60, 0.50, 0.40]))],
        from: Viewpoint::Direction([0.38, -1.0, 0.5]),
        ..PLAIN
    },
    Entry {
        name: "star",
        caption: "Magnetic field lines of a star as tubes (the VAPOR star of table 4.1), coloured \
                  by field strength, \
                  around the star itself.",
        data: &[
            ("star-field-lines", "small", Coloring::Scalars),
            ("icosphere", "medium", Coloring::Plain([0.95, 0.62, 0.28])),
        ],
        from: Viewpoint::Eye([8.5, -12.5, 4.5], [0.0, 0.0, 0.0]),
        colors: "viridis",
        background: "black",
        tubes: 3.0,
        ..PLAIN
    },
    Entry {
        name: "glass",
        caption: "The same star as a ball of glass: the field lines behind it are seen through it, \
                  upside down \
                  (refraction and absorption).",
        data: &[
            ("star-field-lines", "small", Coloring::Scalars),
            ("icosphere", "medium", Coloring::Glass([0.30, 0.75, 0.70])),
        ],
        from: Viewpoint::Eye([3.6, -5.4, 1.4], [0.0, 0.0, 0.0]),
        effects: SOFT.union(Effects::REFRACTION),
        colors: "viridis",
        tubes: 1.5,
        ..PLAIN
    },
];

/// The image of that name. The error lists the names.
pub fn find(name: &str) -> Result<&'static Entry, String> {
    ALL.iter().find(|e| e.name == name).ok_or_else(|| {
        let known: Vec<&str> = ALL.iter().map(|e| e.name).collect();
        format!("there is no image `{name}`; there are: {}", known.join(", "))
    })
}

/// An image with its request and its cost.
pub struct GalleryImage {
    /// The rendered image.
    pub rendered: RenderedImage,
    /// The request that made it.
    pub request: RenderRequest,
    /// Description of the contents.
    pub contents: String,
    /// Wall time of generating the data.
    pub data_secs: f64,
}

impl Entry {
    /// Generates the data and draws it, see [`draw`].
    pub fn render(
        &self,
        size: [u32; 2],
        samples: u32,
        control: &mut RenderControl<'_>,
    ) -> anyhow::Result<GalleryImage> {
        let start = std::time::Instant::now();
        let mut subject = Subject::empty(DVec3::Z);
        for &(name, size, coloring) in self.data {
            let entry = catalogue::find(name)?;
            let options = Options { normals: true, scalars: coloring == Coloring::Scalars };
            let generated = entry.generate(size, options, &mut |_, _| control.check().is_ok());
            control.check()?;
            let mut data = generated?;
            if let (Data::Mesh(mesh), Coloring::Height) = (&mut data, coloring) {
                color_by_height(mesh, Vec3::Z);
            }
            if let Data::Lines(lines) = &mut data {
                lines.radii.iter_mut().for_each(|r| *r *= self.tubes);
            }
            let plain = if let Coloring::Plain(c) = coloring { c } else { [0.8; 3] };
            subject.add_generated(data, plain)?;
            if let (Coloring::Glass(c), Some(part)) = (coloring, subject.parts.last_mut()) {
                part.coloring = PartColoring::Glass(c);
            }
        }
        let framing = match self.from {
            Viewpoint::Direction(backward) => Framing::FittedFrom(backward.into()),
            Viewpoint::Eye(eye, target) => {
                Framing::At(View::new(self.name, eye.into(), target.into()))
            }
            Viewpoint::View(name) => {
                let views = catalogue::find(self.data[0].0)?.views();
                let view = views.into_iter().find(|v| v.name == name);
                Framing::At(
                    view.with_context(|| format!("{} has no view `{name}`", self.data[0].0))?,
                )
            }
        };
        let data_secs = start.elapsed().as_secs_f64();
        let contents = subject.contents.join(", ");
        let style = RenderStyle {
            effects: self.effects,
            colors: self.colors.into(),
            range: self.range,
            glass_parts_only: true,
            occlusion_radii: self.occlusion_radii,
            background: BACKGROUNDS
                .iter()
                .find(|b| b.0 == self.background)
                .map_or(BACKGROUNDS[0].1, |b| b.1),
            ..RenderStyle::default()
        };
        let request = RenderRequest {
            size,
            samples,
            style,
            framing,
            build: BuildOptions::default(),
            layers: Layers::COLOR,
        };
        let rendered = draw(subject, &request, control)?;
        Ok(GalleryImage { rendered, request, contents, data_secs })
    }

    /// The command that draws the image.
    pub fn command(&self, size: [u32; 2], samples: u32) -> String {
        let [w, h] = size;
        format!(
            "bench picture {} -o {}.png --size {w}x{h} --samples {samples}",
            self.name, self.name
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_image_shows_its_data_and_uses_its_effects() {
        for e in ALL.iter().filter(|e| e.name != "wavelet") {
            // Large enough for the star's thin tubes.
            let p = e.render([144, 96], 1, &mut RenderControl::default()).unwrap();
            // Paths inside glass may be truncated, which the renderer reports.
            let expected = |w: &String| e.name == "glass" && w.contains("max_bounces");
            assert!(
                p.rendered.warnings.iter().all(expected),
                "{}: {:?}",
                e.name,
                p.rendered.warnings
            );
            assert!(
                p.rendered.report.effects.contains(e.effects.without(Effects::SHADOWS)),
                "{}",
                e.name
            );
            let colors: std::collections::BTreeSet<[u32; 4]> =
                p.rendered.frame.color.iter().map(|c| c.map(f32::to_bits)).collect();
            assert!(colors.len() > 200, "{}: {} colours", e.name, colors.len());
        }
    }

    #[test]
    fn an_unknown_image_lists_the_known_ones() {
        assert!(find("cornell-box").unwrap_err().contains("mixing-layer-inside"));
    }
}
