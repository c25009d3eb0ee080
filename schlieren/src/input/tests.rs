use super::*;
use crate::field::Node;
use crate::index::ciddor::{Ciddor, MoistAir};
use crate::index::multifield::{Rule, TransferFunction};
use datasets::model::{
    Attributes, Block, DataArray, ImageData, Points, RectilinearGrid, StructuredGrid, Values,
};

/// K of dry air at 532 nm, m³/kg (golden table: 0.227027 cm³/g).
const K_AIR: f64 = 0.227e-3;

fn image(n: [u32; 3], arrays: Vec<(&str, bool, Vec<f64>)>) -> Dataset {
    let mut d = ImageData::new(n, DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.1, 0.2, 0.3));
    for (name, per_point, values) in arrays {
        let a = DataArray::new(name, 1, Values::F64(values));
        if per_point { d.attributes.point.push(a) } else { d.attributes.cell.push(a) }
    }
    Dataset::ImageData(d)
}

fn ramp(count: usize, from: f64, step: f64) -> Vec<f64> {
    (0..count).map(|i| from + step * i as f64).collect()
}

fn close(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() <= relative * b.abs()
}

#[test]
fn uniform_data_keeps_its_lattice_in_metres() {
    let data = image([4, 3, 2], vec![("rho", true, ramp(24, 1.2, 0.01))]);
    let options = Options { length_unit_m: 1e-3, ..Options::new(Medium::density("rho")) };
    let LoadedField { field, report } = from_dataset(&data, &options).unwrap();
    assert_eq!((field.dims(), field.origin_m()), ([4, 3, 2], DVec3::new(1e-3, 2e-3, 3e-3)));
    assert!(close(field.spacing_m()[2], 3e-4, 1e-12));
    assert!(
        report.resampling.is_none()
            && report.formula == "gladstone-dale"
            && report.warnings.is_empty(),
        "{report:?}"
    );
    assert_eq!(report.density_range_kg_m3, Some([1.2, 1.43]));
    let [a, b] = [field.eps()[0], field.eps()[1]].map(f64::from);
    assert!(close((b - a) * field.n0(), K_AIR * 0.01, 1e-3));
}

#[test]
fn differences_of_a_billionth_keep_their_digits() {
    // Without subtracting the background in f64, an f32 of n − 1 has steps of 3e-11, 3 % of these
    // differences.
    let data = image([4, 4, 4], vec![("n1", true, ramp(64, 2.7e-4, 1e-11))]);
    let options = Options::new(Medium::NMinus1(Quantity::array("n1")));
    let field = from_dataset(&data, &options).unwrap().field;
    for (i, pair) in field.eps().windows(2).enumerate() {
        assert!(close(f64::from(pair[1] - pair[0]) * field.n0(), 1e-11, 1e-5), "{i}: {pair:?}");
    }
}

#[test]
fn axes_that_run_backwards_and_cell_arrays() {
    let data = image([4, 3, 3], vec![("rho", false, ramp(12, 1.0, 0.1))]);
    let cells = from_dataset(&data, &Options::new(Medium::density("rho"))).unwrap().field;
    // The nodes are the corners of the cells.
    assert_eq!(cells.dims(), [4, 3, 3]);
    assert!((cells.origin_m() - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12);
    // A body of a cell without value has the cell's faces: the nodes are the centres.
    let mut with_hole = ramp(12, 1.0, 0.1);
    with_hole[4] = f64::NAN;
    let data = image([4, 3, 3], vec![("rho", false, with_hole)]);
    let cells = from_dataset(&data, &Options::new(Medium::density("rho"))).unwrap().field;
    assert_eq!(cells.dims(), [3, 2, 2]);
    assert!((cells.origin_m() - DVec3::new(1.05, 2.1, 3.15)).length() < 1e-12);
    let grid = RectilinearGrid {
        extent: [0, 2, 0, 1, 0, 1],
        coordinates: [vec![2.0, 1.0, 0.0], vec![0.0, 1.0], vec![0.0, 1.0]],
        attributes: Attributes {
            point: vec![DataArray::new("rho", 1, Values::F64(ramp(12, 1.5, 0.1)))],
            ..Default::default()
        },
    };
    let field =
        from_dataset(&Dataset::RectilinearGrid(grid), &Options::new(Medium::density("rho")))
            .unwrap()
            .field;
    assert_eq!((field.dims(), field.origin_m()), ([3, 2, 2], DVec3::ZERO));
    assert!(
        field.eps()[0] > field.eps()[1] && field.eps()[1] > field.eps()[2],
        "{:?}",
        field.eps()
    );
}

#[test]
fn temperature_and_pressure_choose_the_formula() {
    let cold =
        image([3, 3, 3], vec![("T", true, ramp(27, 290.0, 0.1)), ("p", true, vec![101_325.0; 27])]);
    let medium = || Medium::temperature_pressure(Quantity::array("T"), Quantity::array("p"));
    let LoadedField { field, report } = from_dataset(&cold, &Options::new(medium())).unwrap();
    assert_eq!((report.formula, report.warnings.len()), ("ciddor", 0));
    let at = |t: f64| {
        let air = MoistAir { temperature_c: t - 273.15, ..Default::default() };
        Ciddor::new(0.532).unwrap().n_minus_1(&air).unwrap()
    };
    assert!(close(report.n_minus_1_range[1], at(290.0), 1e-12));
    let expected = (at(290.0) - at(292.6)) / field.n0();
    assert!(close(f64::from(field.eps()[0] - field.eps()[26]), expected, 1e-5));

    // A flame: one hot point selects Gladstone-Dale everywhere, so that there is no seam.
    let flame = image([3, 3, 3], vec![("T", true, ramp(27, 290.0, 60.0))]);
    let constant_p = Medium::temperature_pressure(Quantity::array("T"), "101325".parse().unwrap());
    let report = from_dataset(&flame, &Options::new(constant_p.clone())).unwrap().report;
    assert_eq!(report.formula, "gladstone-dale");
    assert!(
        report.warnings.iter().any(|w| w.contains("name the species")),
        "{:?}",
        report.warnings
    );
    let forced = Options { model: Model::Ciddor, ..Options::new(constant_p) };
    let report = from_dataset(&flame, &forced).unwrap().report;
    assert!(
        report.warnings.iter().any(|w| w.contains("is outside -40..100 C")),
        "{:?}",
        report.warnings
    );
    let text = from_dataset(
        &cold,
        &Options { model: Model::Ciddor, ..Options::new(Medium::density("T")) },
    );
    assert!(text.unwrap_err().to_string().contains("not a density"));
}

#[test]
fn species_by_mass_fraction() {
    // Helium into air at constant temperature and pressure.
    let y = ramp(27, 0.0, 1.0 / 26.0);
    let data = image([3, 3, 3], vec![("Y", true, y), ("T", true, vec![300.0; 27])]);
    let mut medium =
        Medium::temperature_pressure(Quantity::array("T"), Quantity::constant(101_325.0));
    if let Medium::TemperaturePressure { species, .. } = &mut medium {
        species.push((Quantity::array("Y"), "He".parse().unwrap()));
    }
    let report = from_dataset(&data, &Options::new(medium)).unwrap().report;
    assert!(
        close(report.n_minus_1_range[0], 3.19e-5, 0.01)
            && close(report.n_minus_1_range[1], 2.67e-4, 0.01),
        "{report:?}"
    );
    assert!(report.warnings.iter().any(|w| w.contains("the rest is taken as air")));
    // Mole per cent instead of mass fractions.
    let percent =
        image([3, 3, 3], vec![("Y", true, vec![40.0; 27]), ("rho", true, ramp(27, 0.5, 0.01))]);
    let medium = Medium::Density {
        density: Quantity::array("rho"),
        species: vec![(Quantity::array("Y"), "He".parse().unwrap())],
    };
    let report = from_dataset(&percent, &Options::new(medium)).unwrap().report;
    assert!(
        report.warnings.iter().any(|w| w.contains("sum to up to 40.0000")),
        "{:?}",
        report.warnings
    );
}

#[test]
fn numbers_that_cannot_be_true_are_named_with_their_cure() {
    let warned = |arrays: Vec<(&str, bool, Vec<f64>)>, medium: Medium, word: &str| {
        let loaded = from_dataset(&image([3, 3, 3], arrays), &Options::new(medium)).unwrap();
        assert!(
            loaded.report.warnings.iter().any(|w| w.contains(word)),
            "{word}: {:?}",
            loaded.report.warnings
        );
    };
    warned(vec![("r", true, ramp(27, 1100.0, 5.0))], Medium::density("r"), "density 1230 kg/m^3");
    let mut normalised = vec![1.0; 27];
    normalised[13] = 3.8;
    warned(
        vec![("r", true, normalised.clone())],
        Medium::density("r"),
        "normalised by the free stream",
    );
    let tp = |t: Quantity, p: Quantity| Medium::temperature_pressure(t, p);
    warned(
        vec![("T", true, ramp(27, 19.0, 0.2))],
        tp(Quantity::array("T"), Quantity::constant(1e5)),
        "degrees Celsius",
    );
    warned(
        vec![("p", true, ramp(27, -3.0, 0.2))],
        tp(Quantity::constant(300.0), Quantity::array("p")),
        "set flow.pressure_zero_pa to 101325",
    );
    // The suggested corrections work.
    let data = image([3, 3, 3], vec![("r", true, normalised)]);
    let scaled = Medium::Density { density: Quantity::array("r").scaled(1.2), species: vec![] };
    assert_eq!(
        from_dataset(&data, &Options::new(scaled)).unwrap().report.warnings,
        Vec::<String>::new()
    );
    let data = image([3, 3, 3], vec![("T", true, ramp(27, 19.0, 0.2))]);
    let celsius = tp(Quantity::array("T").shifted(273.15), Quantity::constant(1e5));
    assert_eq!(
        from_dataset(&data, &Options::new(celsius)).unwrap().report.warnings,
        Vec::<String>::new()
    );
}

#[test]
fn nan_places_are_blank_and_negative_densities_too() {
    let mut rho = ramp(27, 1.1, 0.01);
    rho[3] = f64::NAN;
    rho[4] = -0.5;
    let LoadedField { field, report } = from_dataset(
        &image([3, 3, 3], vec![("rho", true, rho)]),
        &Options::new(Medium::density("rho")),
    )
    .unwrap();
    assert_eq!(field.count(Node::Blank), 2);
    assert!(
        report.warnings.iter().any(|w| w.starts_with("1 of 27 values of `rho` give no index")),
        "{:?}",
        report.warnings
    );
    let none = image([3, 3, 3], vec![("rho", true, vec![f64::NAN; 27])]);
    let text = from_dataset(&none, &Options::new(Medium::density("rho"))).unwrap_err().to_string();
    assert!(text.contains("no value of `rho` gives an index"), "{text}");
}

/// A half annulus with finer cells near the inner radius and a density that decreases outwards.
fn annulus() -> Dataset {
    let n = [12, 24, 5];
    let (mut points, mut rho) = (Vec::new(), Vec::new());
    for k in 0..n[2] {
        for j in 0..n[1] {
            for i in 0..n[0] {
                let r = 1.0 + (i as f64 / 11.0).powi(2);
                let angle = std::f64::consts::PI * j as f64 / 23.0;
                points.push([r * angle.cos(), r * angle.sin(), k as f64 / 4.0]);
                rho.push(3.0 - r);
            }
        }
    }
    let attributes = Attributes {
        point: vec![DataArray::new("rho", 1, Values::F64(rho))],
        ..Default::default()
    };
    Dataset::StructuredGrid(StructuredGrid {
        extent: [0, 11, 0, 23, 0, 4],
        points: Points::F64(points),
        attributes,
    })
}

#[test]
fn curvilinear_data_is_resampled_with_mask_and_error() {
    let options = Options {
        resolution: Resolution::Longest(64),
        reference: Reference::Given { n_minus_1: K_AIR },
        outside: Outside::Blank,
        ..Options::new(Medium::density("rho"))
    };
    let LoadedField { field, report } = from_dataset(&annulus(), &options).unwrap();
    let r = report.resampling.unwrap();
    assert_eq!(field.dims()[0], 64);
    assert!(r.outside > 0 && field.count(Node::Blank) == r.outside && r.hidden == 0, "{r:?}");
    // Linear interpolation between radii up to 0.17 apart, and back, has an error of half a per
    // cent of the range.
    assert!(
        r.resampling_error.rms / r.resampling_error.range < 5e-3
            && r.resampling_error.compared > 700,
        "{r:?}"
    );
    assert!(report.warnings.iter().any(|w| w.contains("outside the mesh and are blank")));
    for (outside, node) in [(Outside::Solid, Node::Solid), (Outside::Gas, Node::Gas)] {
        let other = from_dataset(&annulus(), &Options { outside, ..options.clone() }).unwrap();
        assert!(other.field.count(node) >= r.outside);
        assert_eq!(other.field.count(Node::Blank), 0);
        assert!(other.field.eps().iter().all(|e| e.is_finite()));
    }
    // In the gas, eps = K (ρ − 1) at the node's radius.
    let [nx, ny, _] = field.dims();
    let nodes = field.nodes().unwrap();
    for (i, e) in field.eps().iter().enumerate().filter(|(i, _)| nodes[*i] == Node::Gas) {
        let p = field.origin_m()
            + DVec3::from(field.spacing_m())
                * DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / nx / ny) as f64);
        let expected = K_AIR * (2.0 - p.truncate().length());
        assert!(
            (f64::from(*e) - expected).abs() < 0.02 * K_AIR,
            "{e} instead of {expected} at {p}"
        );
    }
}

#[test]
fn bounds_units_spans_and_smoothing() {
    let bounds = Some([DVec3::new(-0.5, 1.0, 0.2), DVec3::new(0.5, 9.0, 0.8)]);
    let options = Options {
        bounds,
        resolution: Resolution::Longest(33),
        ..Options::new(Medium::density("rho"))
    };
    let field = from_dataset(&annulus(), &options).unwrap().field;
    assert!((field.origin_m() - DVec3::new(-0.5, 1.0, 0.2)).length() < 1e-12);
    assert!((field.size_m() - DVec3::new(1.0, 1.0, 0.6)).length() < 0.02, "{}", field.size_m());
    let nowhere = Some([DVec3::splat(50.0), DVec3::splat(60.0)]);
    assert!(from_dataset(&annulus(), &Options { bounds: nowhere, ..options }).is_err());

    let flat = image(
        [9, 9, 1],
        vec![("rho", true, (0..81).map(|i| if i % 9 < 4 { 1.2 } else { 3.6 }).collect())],
    );
    let options = Options::new(Medium::density("rho"));
    let text = from_dataset(&flat, &options).unwrap_err().to_string();
    assert!(text.contains("it is a plane"), "{text}");
    let options =
        Options { depth: Some(Depth::Span(0.5)), resolution: Resolution::Longest(17), ..options };
    let sharp = from_dataset(&flat, &options).unwrap();
    assert_eq!(sharp.field.dims()[2], 8);
    assert!((sharp.field.size_m().z - 0.5).abs() < 1e-9);
    let smooth = from_dataset(&flat, &Options { smoothing_nodes: 1.4, ..options }).unwrap();
    let steepest = |f: &Field| {
        let along_x = f.eps()[..f.dims()[0]].windows(2);
        along_x.map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max)
    };
    assert!(smooth.report.smoothing_rms > 0.0 && sharp.report.smoothing_rms == 0.0);
    assert!(steepest(&smooth.field) < 0.7 * steepest(&sharp.field));
}

#[test]
fn references_and_series() {
    let mut rho = vec![2.0; 125];
    for k in 1..4 {
        for j in 1..4 {
            for i in 1..4 {
                rho[i + 5 * (j + 5 * k)] = 1.0;
            }
        }
    }
    rho[0] = 9.0;
    let data = image([5, 5, 5], vec![("rho", true, rho)]);
    let with = |reference| {
        from_dataset(&data, &Options { reference, ..Options::new(Medium::density("rho")) })
            .unwrap()
            .field
    };
    assert!(close(with(Reference::Border).n0() - 1.0, 2.0 * K_AIR, 1e-3));
    assert!(close(with(Reference::Median).n0() - 1.0, 2.0 * K_AIR, 1e-3));
    let given = with(Reference::Given { n_minus_1: K_AIR });
    assert!(close(given.n0() - 1.0, K_AIR, 1e-9) && close(f64::from(given.eps()[1]), K_AIR, 1e-2));
    assert!(
        from_dataset(
            &data,
            &Options {
                reference: Reference::Given { n_minus_1: f64::NAN },
                ..Options::new(Medium::density("rho"))
            }
        )
        .is_err()
    );
    let steps = series(&["a.vti".into(), "b.vti".into()]).unwrap();
    assert_eq!((steps.len(), steps[1].time, steps[1].path.as_path()), (2, 1.0, Path::new("b.vti")));
    assert!(series(&["nothere.pvd".into()]).unwrap_err().to_string().contains("nothere.pvd"));
}

#[test]
fn plasma_and_multifield() {
    let data = image(
        [3, 3, 3],
        vec![("ne", true, ramp(27, 0.0, 1e23)), ("mix", true, ramp(27, 0.0, 0.04))],
    );
    let report = from_dataset(&data, &Options::new(Medium::Electrons(Quantity::array("ne"))))
        .unwrap()
        .report;
    assert_eq!((report.formula, report.n_minus_1_range[1]), ("plasma", 0.0));
    assert!(close(report.n_minus_1_range[0], -0.5 * 2.6e24 * 0.532 * 0.532 / 1.11485e27, 1e-3));
    let curve = TransferFunction::linear(1e-4, 0.0, 1.0).unwrap();
    let medium =
        Medium::Multifield { parts: vec![(Quantity::array("mix"), curve, 2.0)], rule: Rule::Sum };
    let report = from_dataset(&data, &Options::new(medium)).unwrap().report;
    assert!(close(report.n_minus_1_range[1], 2e-4, 1e-12));
}

#[test]
fn errors_name_the_array_the_file_and_the_cure() {
    let data = image([3, 3, 3], vec![("rho", true, vec![1.0; 27])]);
    let text =
        from_dataset(&data, &Options::new(Medium::density("density"))).unwrap_err().to_string();
    assert!(text.contains("no array `density`") && text.contains("`rho`"), "{text}");
    let text = from_dataset(&data, &Options::new(Medium::density("Rho"))).unwrap_err().to_string();
    assert!(text.contains("did you mean `rho`?"), "{text}");
    let constant = Medium::Density { density: Quantity::constant(1.2), species: vec![] };
    let text = from_dataset(&data, &Options::new(constant)).unwrap_err().to_string();
    assert!(text.contains("name the array"), "{text}");
    let bad_unit = Options { length_unit_m: 0.0, ..Options::new(Medium::density("rho")) };
    assert!(from_dataset(&data, &bad_unit).unwrap_err().to_string().contains("metres per unit"));
    let text = load(Path::new("no/such/flow.vti"), &Options::new(Medium::density("rho")))
        .unwrap_err()
        .to_string();
    assert!(text.contains("no/such/flow.vti"), "{text}");
    let zero = Medium::Density { density: Quantity::array("rho").scaled(0.0), species: vec![] };
    assert!(from_dataset(&data, &Options::new(zero)).is_err());
}

#[test]
fn blocks_without_the_array_are_blank() {
    let with = image([3, 3, 3], vec![("rho", true, vec![1.5; 27])]);
    let Dataset::ImageData(mut other) = image([3, 3, 3], vec![]) else {
        unreachable!("image makes ImageData")
    };
    other.origin.x += 0.2;
    let blocks = vec![
        Block { name: "a".into(), data: with },
        Block { name: "b".into(), data: Dataset::ImageData(other) },
    ];
    let options =
        Options { resolution: Resolution::Dims([9, 5, 5]), ..Options::new(Medium::density("rho")) };
    let LoadedField { field, report } =
        from_dataset(&Dataset::MultiBlock(blocks), &options).unwrap();
    assert_eq!(field.count(Node::Blank), 4 * 25);
    assert!(report.warnings.iter().any(|w| w.contains("no finite index")), "{:?}", report.warnings);
}

/// An error and its causes, outermost first.
fn chain(error: &dyn std::error::Error) -> Vec<String> {
    std::iter::successors(Some(error), |e| e.source()).map(ToString::to_string).collect()
}

#[test]
fn no_error_repeats_its_cause() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("flow.csv");
    std::fs::write(&file, "x,rho\n0,1\n1,1\n").unwrap();
    let missing = folder.path().join("missing.vti");
    for (path, option, causes) in [
        // The file is missing: the cause is the system's error.
        (&missing, "rho", 2),
        // The file lacks the array.
        (&file, "density", 2),
    ] {
        let error = load(path, &Options::new(Medium::density(option))).unwrap_err();
        let texts = chain(&error);
        assert_eq!(texts.len(), causes, "{texts:?}");
        assert!(texts[0].starts_with(&path.display().to_string()), "{texts:?}");
        for pair in texts.windows(2) {
            assert!(!pair[0].contains(&pair[1]), "{texts:?}");
        }
        // Conversion to a render error adds no text.
        assert_eq!(chain(&crate::render::RenderError::from(error)), texts);
    }
}

#[test]
fn an_index_that_no_medium_has_is_refused_and_does_not_trace_for_ever() {
    let data = image([4; 3], vec![("rho", true, ramp(64, 1e30, 1e29))]);
    let refused = from_dataset(&data, &Options::new(Medium::density("rho"))).unwrap_err();
    assert!(refused.to_string().contains("no medium has that"), "{refused}");
}

#[test]
fn a_lattice_that_is_too_coarse_is_named_with_what_makes_it_finer() {
    // Sixty-four cells along x, and nine nodes.
    let place = |i: usize| [i % 65, i / 65 % 3, i / 65 / 3].map(|x| x as f64);
    let data = Dataset::StructuredGrid(StructuredGrid {
        extent: [0, 64, 0, 2, 0, 2],
        points: Points::F64((0..9 * 65).map(place).collect()),
        attributes: Attributes {
            point: vec![DataArray::new("rho", 1, Values::F64(ramp(9 * 65, 1.0, 1e-4)))],
            ..Attributes::default()
        },
    });
    let resolution = Resolution::Dims([9, 2, 2]);
    let options = Options { resolution, ..Options::new(Medium::density("rho")) };
    let warnings = from_dataset(&data, &options).unwrap().report.warnings;
    for cure in ["flow.resample_nodes", "flow.resample_samples"] {
        assert!(warnings.iter().any(|w| w.contains(cure)), "{cure}: {warnings:?}");
    }
}

#[test]
fn a_span_takes_no_nodes_from_its_plane_however_long_it_is() {
    for upright in [false, true] {
        // The plane is 1 wide and 0.25 high, in x and y or in x and z.
        let n = if upright { [81, 1, 21] } else { [81, 21, 1] };
        let mut flat = image(n, vec![("rho", true, ramp(81 * 21, 1.0, 1e-4))]);
        if let Dataset::ImageData(i) = &mut flat {
            i.spacing = DVec3::splat(0.0125);
        }
        let dims = |span: f64| {
            let depth = Some(Depth::Span(span));
            let options = Options { depth, ..Options::new(Medium::density("rho")) };
            let field = from_dataset(&flat, &options).unwrap().field;
            let along = if upright { field.size_m().y } else { field.size_m().z };
            assert!((along - span).abs() < 1e-9 * span, "{span}: {}", field.size_m());
            field.dims()
        };
        let [nx, ny, nz] = dims(0.01);
        assert!(nx >= 81 && (if upright { nz } else { ny }) >= 21, "{nx} {ny} {nz}");
        // As long as the plane is high, as wide as it is, and longer.
        for span in [0.25, 1.0, 40.0] {
            assert_eq!(dims(span), [nx, ny, nz], "{span}, upright: {upright}");
        }
    }
}

#[test]
fn outside_a_revolved_flow_without_walls_is_gas() {
    for low in [0.0, 0.5] {
        let mut flat = image([33, 17, 1], vec![("rho", true, ramp(33 * 17, 1.0, 1e-4))]);
        if let Dataset::ImageData(i) = &mut flat {
            i.spacing = DVec3::splat(0.1);
            i.origin.y = low;
        }
        let depth = Some(Depth::Revolve);
        let options = Options { depth, ..Options::new(Medium::density("rho")) };
        let loaded = from_dataset(&flat, &options).unwrap();
        let outside = loaded.report.outside.expect("a cylinder leaves corners");
        assert_eq!(outside.bodies_percent, Some(0.0), "{low}: {outside:?}");
        assert!(outside.percent > 15.0, "{low}: {outside:?}");
    }
}
