//! Tests published flows from file to field. Their files are not part of this repository: the
//! folder is `RTSV_FLOWS`, or `shared/data/flow` next to the workspace. Without it these tests
//! print that they are skipped.

use datasets::resample::Resolution;
use glam::DVec3;
use schlieren::field::Node;
use schlieren::input::{Depth, LoadedField, Medium, Options, Outside, Quantity, load};
use schlieren::measure::{Mark, Photograph, SearchFrom};
use schlieren::render::{Control, Layers, TestSection, render};
use schlieren::scene::Scene;
use std::io::Write;
use std::path::{Path, PathBuf};

fn flow(name: &str) -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/flow");
    let folder = std::env::var_os("RTSV_FLOWS").map_or(beside, PathBuf::from);
    let path = folder.join(name);
    if !path.is_file() {
        let _ = writeln!(std::io::stderr(), "skipped: {} is not there", path.display());
        return None;
    }
    Some(path)
}

/// NASA Ames (Hung and Buning): Mach 2.95 past a blunt fin on a plate. The leading edge has radius
/// R = 0.5, and its stagnation line is at x = 0 in the plane y = 0. Billig (1967) for a cylinder:
/// stand-off d/R = 0.386 exp(4.67/M²) = 0.660.
#[test]
fn blunt_fin_has_its_bow_shock_where_theory_puts_it() {
    let Some(path) = flow("bluntfinxyz.bin") else { return };
    let medium =
        Medium::Density { density: Quantity::array("Density").scaled(1.2), species: vec![] };
    let whole = load(&path, &Options::new(medium.clone())).unwrap();
    let r = whole.report.resampling.unwrap();
    assert!(
        whole.report.warnings.iter().any(|w| w.contains("outside the mesh")),
        "{:?}",
        whole.report.warnings
    );
    // At the fin the stretched mesh is finer than any lattice over the whole mesh, but the error is
    // still small.
    assert!(
        r.resampling_error.compared > 20_000
            && r.resampling_error.rms < 0.03 * r.resampling_error.range,
        "{r:?}"
    );
    let [low, high] = whole.report.density_range_kg_m3.unwrap();
    assert!(
        (low - 1.2 * 0.1926).abs() < 0.01 && (high - 1.2 * 4.9775).abs() < 0.01,
        "{low} {high}"
    );

    // The nose, which the light of the image crosses.
    let options = Options {
        bounds: Some([DVec3::new(-1.5, 0.0, 1.0), DVec3::new(0.5, 1.0, 5.5)]),
        resolution: Resolution::Spacing(0.025),
        outside: Outside::Solid,
        ..Options::new(medium)
    };
    let LoadedField { field, report } = load(&path, &options).unwrap();
    let error = report.resampling.unwrap().resampling_error;
    assert!(error.rms < 0.006 * error.range, "{error:?}");
    let nodes = field.nodes().unwrap();
    let [nx, ny, nz] = field.dims();
    let h = field.spacing_m()[0];
    for z in [1.4, 3.1, 5.0] {
        let k = ((z - field.origin_m().z) / field.spacing_m()[2]).round() as usize;
        assert!(k < nz);
        let row = nx * ny * k..nx * ny * k + nx;
        let (eps, kinds) = (&field.eps()[row.clone()], &nodes[row]);
        let fin = kinds.iter().position(|n| *n == Node::Solid).unwrap();
        // Position of the shock: the first moment of the density's rise around its steepest step.
        let steps: Vec<f64> =
            eps[..fin].windows(2).map(|w| f64::from(w[1] - w[0]).max(0.0)).collect();
        let steepest = (0..steps.len()).max_by(|&a, &b| steps[a].total_cmp(&steps[b])).unwrap();
        let near = steepest.saturating_sub(8)..(steepest + 9).min(steps.len());
        let (sum, moment) =
            near.fold((0.0, 0.0), |(s, m), i| (s + steps[i], m + steps[i] * (i as f64 + 0.5)));
        let stand_off = (fin as f64 - 0.5 - moment / sum) * h / 0.5;
        let _ = writeln!(std::io::stderr(), "z = {z}: d/R = {stand_off:.3}");
        assert!((stand_off - 0.66).abs() <= 0.15, "z = {z}: d/R = {stand_off}");
    }
}

/// The same flow as a photograph, with light along the span and an upright knife. Every row of the
/// image away from the plate shows the bow shock ahead of the fin's dark edge. The distance between
/// them is the stand-off.
///
/// The tolerance has two causes: the shock is curved around the fin, so that the light crosses only
/// its foremost part edge-on, and the mesh, 0.15 R coarse there, smears it over three cells. The
/// stream has 0.1 kg/m³, as in a tunnel at Mach 3 that draws air from the room. The image reaches
/// from grey to nearly white without saturation.
#[test]
fn blunt_fin_stand_off_is_measured_in_our_schlieren_image() {
    let Some(path) = flow("bluntfinxyz.bin") else { return };
    let (stream, radius) = (0.1, 0.5);
    let options = Options {
        wavelength_nm: 633.0,
        // The fin, the shock and the light's path past them, from above the plate's influence to
        // the mesh's upper end.
        bounds: Some([DVec3::new(-1.5, 0.0, 1.0), DVec3::new(0.3, 1.5, 5.7)]),
        resolution: Resolution::Spacing(0.03),
        length_unit_m: 0.02,
        outside: Outside::Solid,
        ..Options::new(Medium::Density {
            density: Quantity::array("Density").scaled(stream),
            species: vec![],
        })
    };
    let field = load(&path, &options).unwrap().field;
    let unit_m = options.length_unit_m;
    let scene = "[flow]\nfile = \"\"\ndensity = \"-\"\n[view]\ndirection = \"y\"\n[film]\nsize = \
                 [180, 470]\n[technique]\nkind = \"schlieren\"";
    let scene = Scene::from_toml(scene).unwrap();
    let centre_m = field.centre_m();
    let section = TestSection::of_fields(&scene, vec![field], None).unwrap();
    let image = render(&scene, &section, Layers { map: true, ..Layers::NONE }, &Control::default())
        .unwrap();
    let photograph = Photograph::from_render(&image).unwrap();
    let framing = photograph.framing;

    // The edge of the fin's silhouette: the last dark pixel of the row, from the right.
    let width = framing.width as usize;
    let edge_m = |z_m: f64| {
        let row = (0.5 * f64::from(framing.height) - (z_m - framing.center_m[1]) / framing.pixel_m)
            as usize;
        let dark = (0..width).rev().take_while(|i| !photograph.lit[i + row * width]).last();
        dark.map(|i| framing.plane_from_pixel(i as f64, 0.0)[0])
    };
    let fronts = photograph.fronts_m(SearchFrom::Left, Mark::Band { undisturbed: 0.5 }, 0.1, 2);
    let mut stand_offs = vec![];
    for [x_m, up_m] in fronts {
        let z = (centre_m.z + up_m) / unit_m;
        if (2.0..5.5).contains(&z) {
            let edge_m = edge_m(up_m).expect("a row of the fin");
            // The leading edge is found at x = 0 within a node of the lattice.
            assert!(
                ((centre_m.x + edge_m) / unit_m).abs() < 0.06,
                "{}",
                (centre_m.x + edge_m) / unit_m
            );
            stand_offs.push((edge_m - x_m) / unit_m / radius);
        }
    }
    assert!(stand_offs.len() > 300, "{} rows", stand_offs.len());
    stand_offs.sort_by(f64::total_cmp);
    let at = |share: f64| stand_offs[(share * (stand_offs.len() - 1) as f64) as usize];
    let (low, median, high) = (at(0.0), at(0.5), at(1.0));
    let _ =
        writeln!(std::io::stderr(), "d/R in the image: median {median:.3}, {low:.3} to {high:.3}");
    assert!((low - 0.66).abs() <= 0.15 && (high - 0.66).abs() <= 0.15, "{low} {median} {high}");
}

/// Only the density of this flow is physical (0.198 to 0.710 of its reference).
#[test]
fn combustor_is_read_and_resampled() {
    let Some(path) = flow("combxyz.bin") else { return };
    let LoadedField { field, report } =
        load(&path, &Options::new(Medium::density("Density"))).unwrap();
    let r = report.resampling.unwrap();
    // Two of its cells are really folded.
    assert_eq!((r.cells, r.folded_cells), (56 * 32 * 24, 2));
    assert!(
        r.inside > 100_000
            && r.resampling_error.compared > 20_000
            && r.resampling_error.rms < 0.02 * r.resampling_error.range,
        "{r:?}"
    );
    let [low, high] = report.density_range_kg_m3.unwrap();
    assert!((low - 0.198).abs() < 1e-3 && (high - 0.710).abs() < 1e-3);
    assert!(field.eps().iter().all(|e| e.is_finite() && e.abs() < 2e-4));
}

/// Air from a converging nozzle at 60 psi gauge into one atmosphere (Ladenburg's interferometer
/// experiment), computed with OpenFOAM as an axisymmetric wedge; the file holds cell centres.
#[test]
fn ladenburgs_jet_is_revolved() {
    let Some(path) = flow("ladenburg_jet_60psi.csv") else { return };
    let medium = Medium::temperature_pressure(Quantity::array("T_K"), Quantity::array("p_Pa"));
    let options = Options { depth: Some(Depth::Revolve), ..Options::new(medium) };
    let LoadedField { field, report } = load(&path, &options).unwrap();
    let r = report.resampling.unwrap();
    // The jet is as cold as 130 K, outside Ciddor's range, so there is a warning.
    assert_eq!(report.formula, "gladstone-dale");
    assert!(
        report.warnings.iter().any(|w| w.contains("not all in -40..100 C")),
        "{:?}",
        report.warnings
    );
    assert!(r.resampling_error.rms < 0.02 * r.resampling_error.range, "{r:?}");
    // The field is round: eps is the same at points a quarter turn apart around the axis.
    let [nx, ny, nz] = field.dims();
    assert_eq!(ny, nz);
    let eps = |i: usize, j: usize, k: usize| field.eps()[i + nx * (j + ny * k)];
    let (i, middle) = (nx / 3, ny / 2);
    let quarter = ny / 4;
    let around = [
        eps(i, quarter, middle),
        eps(i, ny - 1 - quarter, ny - 1 - middle),
        eps(i, middle, quarter),
    ];
    let spread = around.iter().fold(0.0f32, |s, e| s.max((e - around[0]).abs()));
    assert!(spread < 1e-3 * 1e-3, "{around:?}");
    // The nozzle exit has 2.7 bar and 247 K, so n − 1 is about three times that of the room.
    let exit = f64::from(eps(0, middle, middle)) + report.reference_n_minus_1;
    assert!((exit / (0.227e-3 * 269.4e3 / (287.05 * 246.5)) - 1.0).abs() < 0.03, "{exit}");
}
