//! Makes the panels from the exits of rays through the corners of pixels.

use super::{Panel, PanelBench};
use crate::cutoff::Rgb;
use crate::drawing::{Canvas, Overlay, Style, Vectors, draw_overlay, in_unit};
use crate::film::Framing;
use crate::film::traced::{expose_corners, start_of_corner};
use crate::path::{Exit, Status};
use crate::render::{
    Map, PlannedPaths, RenderError, TestSection, apparent_displacements, technique,
};
use crate::scene::{CutoffSpec, Scene, SourceSpec, TechniqueSpec};
use crate::technique::bos::Dots;

/// Samples along a pixel's side of the dots of BOS.
const DOT_SAMPLES: usize = 4;
/// Diameter of a dot, in pixels.
const DOT_PX: f64 = 3.0;

/// A length as the program takes it.
fn option(length_m: f64) -> String {
    in_unit(length_m, "m").replace(' ', "").replace('µ', "u")
}

/// One panel of light: its name, labels, scene and options.
struct Setup {
    name: &'static str,
    labels: [String; 2],
    scene: Scene,
    options: Vec<String>,
}

fn setups(base: &Scene, bench: &PanelBench) -> Vec<Setup> {
    let words = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
    let with = |technique: TechniqueSpec, source: Option<SourceSpec>, focus_m: Option<f64>| {
        let mut scene = Scene { technique, ..base.clone() };
        scene.light.source = source;
        scene.film.focus_m = focus_m;
        scene.film.exposure = None;
        scene
    };
    let slit = SourceSpec::Slit { width_m: bench.slit_m, length_m: 5e-3, angle_deg: None };
    let knife = |name, title: &str, angle_deg: f64| Setup {
        name,
        labels: [
            format!("schlieren, {title}"),
            format!("slit {}, half cut", in_unit(bench.slit_m, "m")),
        ],
        scene: with(
            TechniqueSpec::Schlieren {
                cutoff: CutoffSpec::Knife { angle_deg, open: 0.5, open_m: None },
            },
            Some(slit),
            None,
        ),
        options: words(&format!(
            "--technique schlieren --cutoff knife --cutoff-angle {angle_deg} --source slit:{},5mm",
            option(bench.slit_m)
        )),
    };
    let (color_m, spot_m) = (bench.color_radius_m, bench.spot_radius_m);
    let fringe = |name, spacing: Option<f64>| {
        let spacing_words = spacing
            .map_or("infinite fringes".to_owned(), |s| format!("fringes at {}", in_unit(s, "m")));
        Setup {
            name,
            labels: [
                "interferogram".into(),
                format!("{spacing_words}, {} nm", base.light.wavelengths_nm[0]),
            ],
            scene: with(
                TechniqueSpec::Interferogram {
                    visibility: 1.0,
                    fringe_spacing_m: spacing,
                    fringe_angle_deg: None,
                },
                None,
                None,
            ),
            options: words(&match spacing {
                None => "--technique interferogram".to_owned(),
                Some(s) => format!("--technique interferogram --fringe-spacing {}", option(s)),
            }),
        }
    };
    vec![
        knife("knife-x", "upright knife", 0.0),
        knife("knife-y", "level knife", 90.0),
        Setup {
            name: "color",
            labels: [
                "schlieren, colour filter".into(),
                format!("radius {}, red to the right", in_unit(color_m, "m")),
            ],
            scene: with(
                TechniqueSpec::Schlieren {
                    cutoff: CutoffSpec::Color { radius_m: color_m, red_deg: 0.0 },
                },
                Some(SourceSpec::Point {}),
                None,
            ),
            options: words(&format!(
                "--technique schlieren --cutoff color --cutoff-radius {} --source point",
                option(color_m)
            )),
        },
        Setup {
            name: "dark-field",
            labels: [
                "schlieren, dark field".into(),
                format!("spot and source {}", in_unit(2.0 * spot_m, "m")),
            ],
            scene: with(
                TechniqueSpec::Schlieren {
                    cutoff: CutoffSpec::ComplementedCircle { radius_m: spot_m, center_m: [0.0; 2] },
                },
                Some(SourceSpec::Circle { diameter_m: 2.0 * spot_m }),
                None,
            ),
            options: words(&format!(
                "--technique schlieren --cutoff complemented-circle --cutoff-radius {} --source \
                 circle:{}",
                option(spot_m),
                option(2.0 * spot_m)
            )),
        },
        Setup {
            name: "shadowgraph",
            labels: [
                "shadowgraph".into(),
                format!("film {} behind the middle", in_unit(bench.film_m, "m")),
            ],
            scene: with(TechniqueSpec::Shadowgraph {}, None, Some(bench.film_m)),
            options: words(&format!(
                "--technique shadowgraph --film-distance {}",
                option(bench.film_m)
            )),
        },
        fringe("interferogram", None),
        fringe("interferogram-fringes", Some(bench.fringes_m)),
    ]
}

/// The panels of the techniques that follow light, and its map. `wide` is the frame with the margin
/// around it.
pub(super) fn of_light(
    base: &Scene,
    section: &TestSection,
    bench: &PanelBench,
    wide: &Framing,
    margin: u32,
    exits: Vec<Exit>,
    planned: &PlannedPaths<'_>,
) -> Result<(Vec<Panel>, Map), RenderError> {
    let mut panels = Vec::new();
    let n0 = section.n0(0);
    let view = *planned.paths.view();
    for setup in setups(base, bench) {
        setup.scene.check()?;
        let technique = technique(&setup.scene, 0, wide, n0, false)?;
        let exposure = setup.scene.exposure() as f32;
        let cut = |film: Vec<Rgb>| inner(&film, wide, margin);
        let film: Option<Vec<Rgb>> = if technique.is_colored() {
            let exposed = expose_corners::<3>(*wide, view, &technique, exits.clone());
            exposed.map(|(f, _)| f.to_pixels(1.0))
        } else {
            let exposed = expose_corners::<1>(*wide, view, &technique, exits.clone());
            exposed.map(|(f, _)| f.to_pixels(1.0).into_iter().map(|p| [p[0]; 3]).collect())
        };
        let Some(film) = film else { unreachable!("the exits are those of the corners") };
        let pixels = cut(film.into_iter().map(|p| p.map(|v| v * exposure)).collect());
        panels.push(Panel {
            name: setup.name,
            labels: setup.labels,
            options: setup.options,
            pixels: Some(pixels),
        });
    }
    let map = map_of_corners(base, wide, margin, &exits, n0);
    let frame = without_margin(wide, margin);
    let overlay = Overlay { style: Style::Lic, vectors: Some(Vectors::Deflection) };
    panels.push(overlaid("deflection", "deflection, lines along it", &map, overlay, &frame, None));
    Ok((panels, map))
}

fn without_margin(wide: &Framing, margin: u32) -> Framing {
    Framing { width: wide.width - 2 * margin, height: wide.height - 2 * margin, ..*wide }
}

fn inner<T: Copy>(of: &[T], wide: &Framing, margin: u32) -> Vec<T> {
    let (width, m) = (wide.width as usize, margin as usize);
    let rows = m..wide.height as usize - m;
    rows.flat_map(|y| of[y * width + m..(y + 1) * width - m].iter().copied()).collect()
}

/// A panel with an overlay on a picture, or on black.
fn overlaid(
    name: &'static str,
    title: &str,
    map: &Map,
    overlay: Overlay,
    frame: &Framing,
    on: Option<&[Rgb]>,
) -> Panel {
    let mut canvas = Canvas::new(frame.width as usize, frame.height as usize, [0.0; 3]);
    if let Some(picture) = on {
        canvas.pixels.copy_from_slice(picture);
    }
    draw_overlay(&mut canvas, map, overlay);
    let largest = match overlay.vectors {
        Some(Vectors::Deflection) => in_unit(map.largest_deflection_rad, "rad"),
        _ => {
            let size = |u: &[f32; 2]| f64::from(u[0]).hypot(f64::from(u[1]));
            let all = map.apparent_m.iter().map(size).filter(|s| s.is_finite());
            let largest = all.fold(0.0, f64::max);
            format!("{}, {:.1} px", in_unit(largest, "m"), largest / frame.pixel_m)
        }
    };
    let pixels = Some(canvas.pixels);
    let labels = [title.into(), format!("up to {largest}")];
    Panel { name, labels, options: Vec::new(), pixels }
}

/// The map at the pixels' centres: means of their corners.
fn map_of_corners(scene: &Scene, wide: &Framing, margin: u32, exits: &[Exit], n0: f64) -> Map {
    let optics = scene.optics();
    let frame = without_margin(wide, margin);
    let wavelength_m = scene.light.wavelengths_nm[0] * 1e-9;
    let columns = wide.width as usize + 1;
    let mut map = Map::default();
    let size = |v: [f32; 2]| f64::from(v[0]).hypot(f64::from(v[1]));
    for y in 0..frame.height as usize {
        for x in 0..frame.width as usize {
            let first = (y + margin as usize) * columns + x + margin as usize;
            let four = [first, first + 1, first + columns, first + columns + 1];
            let arrived = |k: &usize| {
                let e = &exits[*k];
                e.status != Status::Turned
                    && e.transmission > 0.0
                    && e.deflection_rad.iter().all(|d| d.is_finite())
            };
            if !four.iter().all(arrived) {
                map.dark += 1;
                map.transmission.push(0.0);
                map.deflection_rad.push([0.0; 2]);
                map.displacement_m.push([0.0; 2]);
                map.waves.push(0.0);
                continue;
            }
            let mean = |f: &dyn Fn(usize) -> f32| 0.25 * four.iter().map(|k| f(*k)).sum::<f32>();
            let pair = |f: &dyn Fn(usize) -> [f32; 2]| [0, 1].map(|c| mean(&|k| f(k)[c]));
            let deflection = pair(&|k| exits[k].deflection_rad);
            let shift = |k: usize| optics.film_shift_m(&start_of_corner(wide, k), &exits[k]);
            let path = |k: usize| optics.film_path_difference_m(&exits[k], n0 as f32);
            let exit_shift = pair(&|k| exits[k].displacement_m);
            map.transmission.push(mean(&|k| exits[k].transmission));
            map.deflection_rad.push(deflection);
            map.displacement_m.push(pair(&shift));
            map.waves.push((f64::from(mean(&path)) / wavelength_m) as f32);
            map.largest_deflection_rad = map.largest_deflection_rad.max(size(deflection));
            map.largest_displacement_m = map.largest_displacement_m.max(size(exit_shift));
        }
    }
    map
}

/// The scene of the BOS panels.
pub(super) fn scene_of_bos(base: &Scene, bench: &PanelBench) -> Scene {
    let mut scene = base.clone();
    scene.technique = TechniqueSpec::Bos { dot_diameter_m: None, dot_spacing_m: None, seed: 0 };
    scene.film.focus_m = Some(bench.background_m);
    scene
}

fn bos_labels(bench: &PanelBench) -> [[String; 2]; 2] {
    [
        ["BOS, undisturbed".into(), "the background without the flow".into()],
        [
            "BOS".into(),
            format!("background {} behind the middle", in_unit(bench.background_m, "m")),
        ],
    ]
}

/// Adds the panels of BOS: both pictures, and the displacement as arrows and as lines.
pub(super) fn of_background(
    scene: &Scene,
    bench: &PanelBench,
    frame: &Framing,
    exits: &[Exit],
    panels: &mut Vec<Panel>,
) -> Map {
    let mut map = map_of_corners(scene, frame, 0, exits, 1.0);
    map.waves.clear();
    map.apparent_m = apparent_displacements(frame, &map.displacement_m, &map.transmission);
    let diameter_m = DOT_PX * frame.pixel_m;
    let dots = Dots { diameter_m, spacing_m: 2.0 * diameter_m, seed: 0 };
    let [still_labels, labels] = bos_labels(bench);
    let still = vec![Exit::UNDISTURBED; exits.len()];
    let options: Vec<String> = ["--technique", "bos", "--film-distance"]
        .map(str::to_owned)
        .into_iter()
        .chain([option(bench.background_m)])
        .collect();
    let mut pictures = Vec::new();
    for (name, labels, exits) in
        [("bos-undisturbed", still_labels, &still[..]), ("bos", labels, exits)]
    {
        let pixels = dotted(scene, frame, &dots, exits);
        pictures.push(pixels.clone());
        panels.push(Panel { name, labels, options: options.clone(), pixels: Some(pixels) });
    }
    if let Some(p) = panels.iter_mut().find(|p| p.name == "bos-undisturbed") {
        p.options.extend(["--reference".into(), "undisturbed.png".into()]);
    }
    let of = Some(Vectors::Displacement);
    let arrows = Overlay { style: Style::Arrows, vectors: of };
    let lic = Overlay { style: Style::Lic, vectors: of };
    let title = "BOS, displacement of dots";
    panels.push(overlaid(
        "bos-arrows",
        title,
        &map,
        arrows,
        frame,
        pictures.get(1).map(|p| &p[..]),
    ));
    panels.push(overlaid("bos-lines", title, &map, lic, frame, None));
    map
}

/// Places for the panels of BOS in a sheet that was interrupted.
pub(super) fn without_background(bench: &PanelBench, panels: &mut Vec<Panel>) {
    let [still, labels] = bos_labels(bench);
    let moved = ["BOS, displacement of dots".to_owned(), String::new()];
    for (name, labels) in [
        ("bos-undisturbed", still),
        ("bos", labels),
        ("bos-arrows", moved.clone()),
        ("bos-lines", moved),
    ] {
        panels.push(Panel { name, labels, options: Vec::new(), pixels: None });
    }
}

/// The picture of a dotted background, with shifts that are linear between the corners of a pixel.
fn dotted(scene: &Scene, frame: &Framing, dots: &Dots, exits: &[Exit]) -> Vec<Rgb> {
    use rayon::prelude::*;
    let optics = scene.optics();
    let columns = frame.width as usize + 1;
    let pixel = |i: usize| -> Rgb {
        let (x, y) = (i % frame.width as usize, i / frame.width as usize);
        let first = y * columns + x;
        let four = [first, first + 1, first + columns, first + columns + 1];
        let left = four.map(|k| exits[k].transmission);
        if left.iter().any(|t| *t <= 0.0) {
            return [0.0; 3];
        }
        let shifts =
            four.map(|k| optics.film_shift_m(&start_of_corner(frame, k), &exits[k]).map(f64::from));
        let mut sum = 0.0;
        for n in 0..DOT_SAMPLES * DOT_SAMPLES {
            let [s, t] =
                [n % DOT_SAMPLES, n / DOT_SAMPLES].map(|k| (k as f64 + 0.5) / DOT_SAMPLES as f64);
            let weights = [(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t];
            let at = frame.plane_from_pixel(x as f64 + s, y as f64 + t);
            let shifted = [0, 1]
                .map(|c| at[c] + weights.iter().zip(&shifts).map(|(w, v)| w * v[c]).sum::<f64>());
            sum += dots.brightness(shifted);
        }
        let mean = 0.25 * left.iter().sum::<f32>();
        [mean * sum / (DOT_SAMPLES * DOT_SAMPLES) as f32; 3]
    };
    (0..frame.pixels()).into_par_iter().map(pixel).collect()
}
