//! Tells walls from open borders: cases of OpenFOAM whose mesh ends at a ramp below and at a
//! slanting border above, in a lattice and on cells.

mod program;

use program::{schlieren, text};
use schlieren::field::{Field, Node};
use schlieren::input::{LoadedField, Medium, Options, Outside, load, load_cells};
use schlieren::march::OnCells;
use schlieren::path::{Exit, LightPaths, PathQuantities, Start, Status};
use schlieren::view::{Axis, View};
use std::fmt::Write as _;
use std::path::Path;

/// Cells along x, y and z.
const N: [usize; 3] = [16, 12, 4];

/// The border below at x, a ramp from the middle on, and the border above.
fn below(x: f64) -> f64 {
    0.4 * (x - 0.5).max(0.0)
}
fn above(x: f64) -> f64 {
    1.0 - 0.2 * x
}

fn header(class: &str, object: &str) -> String {
    format!("FoamFile\n{{\n version 2.0;\n format ascii;\n class {class};\n object {object};\n}}\n")
}

/// Writes a case whose border below has this name and type.
fn write_case(root: &Path, name: &str, kind: &str) {
    let [nx, ny, nz] = N;
    let point = |i: usize, j: usize, k: usize| i + (nx + 1) * (j + (ny + 1) * k);
    let cell = |i: usize, j: usize, k: usize| i + nx * (j + ny * k);
    let mut points = String::new();
    for k in 0..=nz {
        for j in 0..=ny {
            for i in 0..=nx {
                let x = i as f64 / nx as f64;
                let y = below(x) + (above(x) - below(x)) * j as f64 / ny as f64;
                let _ = writeln!(points, "({x} {y} {})", k as f64 / nz as f64);
            }
        }
    }
    // A face of the side `axis` of a cell's lower corner, with the normal along the axis.
    let face = |axis: usize, i: usize, j: usize, k: usize| match axis {
        0 => [point(i, j, k), point(i, j + 1, k), point(i, j + 1, k + 1), point(i, j, k + 1)],
        1 => [point(i, j, k), point(i, j, k + 1), point(i + 1, j, k + 1), point(i + 1, j, k)],
        _ => [point(i, j, k), point(i + 1, j, k), point(i + 1, j + 1, k), point(i, j + 1, k)],
    };
    let (mut faces, mut owner, mut neighbour) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let mut inner = |axis: usize, at: [usize; 3], other: usize| {
                    faces.push(face(axis, at[0], at[1], at[2]));
                    owner.push(cell(i, j, k));
                    neighbour.push(other);
                };
                if i + 1 < nx {
                    inner(0, [i + 1, j, k], cell(i + 1, j, k));
                }
                if j + 1 < ny {
                    inner(1, [i, j + 1, k], cell(i, j + 1, k));
                }
                if k + 1 < nz {
                    inner(2, [i, j, k + 1], cell(i, j, k + 1));
                }
            }
        }
    }
    let mut patches = String::new();
    let mut patch = |name: &str, kind: &str, of: Vec<([usize; 4], usize)>| {
        let _ = writeln!(
            patches,
            "{name} {{ type {kind}; nFaces {}; startFace {}; }}",
            of.len(),
            faces.len()
        );
        for (f, c) in of {
            faces.push(f);
            owner.push(c);
        }
    };
    // The order of the corners of these faces does not matter here.
    let across = |axis: usize, at_end: bool| {
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut found = Vec::new();
        for u in 0..N[a] {
            for v in 0..N[b] {
                let mut at = [0; 3];
                (at[a], at[b], at[axis]) = (u, v, if at_end { N[axis] } else { 0 });
                let f = face(axis, at[0], at[1], at[2]);
                at[axis] = if at_end { N[axis] - 1 } else { 0 };
                found.push((f, cell(at[0], at[1], at[2])));
            }
        }
        found
    };
    patch("inlet", "patch", across(0, false));
    patch("outlet", "patch", across(0, true));
    patch(name, kind, across(1, false));
    patch("farfield", "patch", across(1, true));
    patch("sides", "symmetryPlane", [across(2, false), across(2, true)].concat());

    let mesh = root.join("constant/polyMesh");
    std::fs::create_dir_all(&mesh).unwrap();
    std::fs::create_dir_all(root.join("1")).unwrap();
    let write = |at: &Path, class: &str, count: usize, items: String| {
        let object = at.file_name().unwrap().to_str().unwrap();
        std::fs::write(at, format!("{}{count}\n(\n{items})\n", header(class, object))).unwrap();
    };
    let labels = |list: &[usize]| list.iter().map(|l| format!("{l}\n")).collect::<String>();
    write(&mesh.join("points"), "vectorField", (nx + 1) * (ny + 1) * (nz + 1), points);
    let list = |f: &[usize; 4]| format!("4({} {} {} {})\n", f[0], f[1], f[2], f[3]);
    write(&mesh.join("faces"), "faceList", faces.len(), faces.iter().map(list).collect());
    write(&mesh.join("owner"), "labelList", owner.len(), labels(&owner));
    write(&mesh.join("neighbour"), "labelList", neighbour.len(), labels(&neighbour));
    write(&mesh.join("boundary"), "polyBoundaryMesh", 5, patches);
    let cells = nx * ny * nz;
    let rho: String = (0..cells).map(|c| format!("{}\n", 1.2 + 1e-3 * (c % nx) as f64)).collect();
    std::fs::write(
        root.join("1/rho"),
        format!(
            "{}dimensions [1 -3 0 0 0 0 0];\ninternalField nonuniform List<scalar> {cells}\n(\n\
             {rho});\nboundaryField {{ }}\n",
            header("volScalarField", "rho")
        ),
    )
    .unwrap();
}

/// Shares of the nodes below the ramp, and above the border, that are solid.
fn solid_shares(field: &Field) -> [f64; 2] {
    // A field of gas alone has no list of nodes.
    let Some(nodes) = field.nodes() else { return [0.0; 2] };
    let [nx, ny, _] = field.dims();
    let (mut solid, mut all) = ([0.0; 2], [0.0; 2]);
    for (i, node) in nodes.iter().enumerate() {
        let at = [i % nx, i / nx % ny].map(|n| n as f64);
        let [x, y] = [0, 1].map(|a| field.origin_m()[a] + at[a] * field.spacing_m()[a]);
        // Away from the border by rounding.
        for (side, outside) in [y < below(x) - 1e-3, y > above(x) + 1e-3].into_iter().enumerate() {
            if outside {
                all[side] += 1.0;
                solid[side] += f64::from(u8::from(*node == Node::Solid));
                assert_ne!(*node, Node::Blank);
            }
        }
    }
    assert!(all.iter().all(|n| *n > 50.0), "{all:?}");
    [solid[0] / all[0], solid[1] / all[1]]
}

#[test]
fn a_ramp_is_a_body_and_a_slanting_open_border_is_gas() {
    let options = || Options::new(Medium::density("rho"));
    for (name, kind, expected) in [
        ("ramp", "wall", 1.0),
        ("bottom", "wall", 1.0),
        // Cases of inviscid flows.
        ("obstacle", "patch", 1.0),
        ("rampSurface", "symmetryPlane", 1.0),
        ("bottom", "patch", 0.0),
    ] {
        let dir = tempfile::tempdir().unwrap();
        write_case(dir.path(), name, kind);
        let LoadedField { field, report } = load(dir.path(), &options()).unwrap();
        assert_eq!(solid_shares(&field), [expected, 0.0], "{name} {kind}");
        let outside = report.outside.unwrap();
        assert_eq!(outside.walls_by.is_empty(), expected == 0.0, "{outside:?}");
        let warned = report.warnings.iter().find(|w| w.contains("outside the mesh")).unwrap();
        let words = if expected == 1.0 { "patches that are walls" } else { "no wall is found" };
        assert!(warned.contains(words), "{warned}");

        // On the cells of the same case, light along x, which leaves through the ramp, the outlet
        // and the border above.
        let (gas, _) = load_cells(dir.path(), &options()).unwrap();
        let view = View::along(Axis::X, gas.centre_m());
        let start = |y: f64| {
            let from_centre = glam::DVec3::new(0.5, y, 0.4) - gas.centre_m();
            let position_m = [view.right, view.up].map(|axis| axis.dot(from_centre) as f32);
            Start { position_m, tilt_rad: [0.0; 2] }
        };
        let starts = [start(0.05), start(0.5), start(0.95)];
        let mut exits = [Exit::UNDISTURBED; 3];
        OnCells::new(&gas, view, PathQuantities::default(), 1).trace(&starts, &mut exits);
        let ramp = if expected == 1.0 { Status::Blocked } else { Status::Free };
        assert_eq!(exits.map(|e| e.status), [ramp, Status::Free, Status::Free], "{name} {kind}");
    }
}

#[test]
fn the_option_overrides_the_walls() {
    let dir = tempfile::tempdir().unwrap();
    write_case(dir.path(), "ramp", "wall");
    for (outside, expected) in [(Outside::Gas, [0.0; 2]), (Outside::Solid, [1.0; 2])] {
        let options = Options { outside, ..Options::new(Medium::density("rho")) };
        let field = load(dir.path(), &options).unwrap().field;
        assert_eq!(solid_shares(&field), expected);
    }
}

#[test]
fn the_program_says_what_was_decided_and_why() {
    let dir = tempfile::tempdir().unwrap();
    write_case(dir.path(), "ramp", "wall");
    let (case, png) = (dir.path().to_str().unwrap(), dir.path().join("a.png"));
    let png = png.to_str().unwrap();
    let base = ["render", case, "--density", "rho", "--size", "40x40", "-o", png, "--json"];
    let o = schlieren(&base);
    assert_eq!(o.status.code(), Some(0), "{}", text(&o.stderr));
    let json: serde_json::Value = serde_json::from_slice(&o.stdout).unwrap();
    let outside = &json["outside"];
    assert!(outside["percent"].as_f64().unwrap() > 5.0, "{outside}");
    assert!(outside["bodies_percent"].as_f64().unwrap() > 2.0, "{outside}");
    assert_eq!(outside["walls_by"][0], "the boundary's patches that are walls");
    assert!(text(&o.stderr).contains("set --outside"), "{}", text(&o.stderr));
    let o = schlieren(&[&base[..], &["--outside", "fluid"]].concat());
    assert!(text(&o.stderr).contains("auto, blank, solid, gas"), "{}", text(&o.stderr));
}
