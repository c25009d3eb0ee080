//! Tables of points in no order: files as programs export them, and what is said about them.

use datasets::model::{Dataset, RectilinearGrid, UnstructuredGrid};
use datasets::read::{LoadedFile, OpenOptions, open, open_with};
use proptest::prelude::*;
use std::f64::consts::TAU;
use std::fmt::Write as _;

fn read_with(name: &str, text: &str, gap: Option<f64>) -> Result<LoadedFile, String> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, text).unwrap();
    open_with(&path, &OpenOptions { gap, ..OpenOptions::default() }).map_err(|e| e.to_string())
}

fn read(text: &str) -> Result<LoadedFile, String> {
    read_with("points.csv", text, None)
}

fn mesh(file: &LoadedFile) -> &UnstructuredGrid {
    let data = file.dataset().unwrap();
    data.check().unwrap();
    match data {
        Dataset::UnstructuredGrid(g) => g,
        other => panic!("{}", other.kind()),
    }
}

fn lattice(file: &LoadedFile) -> &RectilinearGrid {
    match file.dataset().unwrap() {
        Dataset::RectilinearGrid(g) => g,
        other => panic!("{}", other.kind()),
    }
}

/// Numbers from 0 to 1 that look random.
fn scatter(i: u32) -> f64 {
    let mut h = u64::from(i + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    h = (h ^ (h >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    h = (h ^ (h >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((h ^ (h >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// A table of random points in the unit square or cube, with a linear density.
fn cloud(count: u32, dimensions: u32) -> String {
    let mut text = String::from(if dimensions == 2 { "x,y,rho\n" } else { "x,y,z,rho\n" });
    for i in 0..count {
        let p: Vec<f64> = (0..dimensions).map(|a| scatter(dimensions * i + a)).collect();
        let rho = 1.0 + p.iter().sum::<f64>();
        p.iter().for_each(|x| write!(text, "{x},").unwrap());
        writeln!(text, "{rho}").unwrap();
    }
    text
}

fn shuffled(text: &str) -> String {
    let mut lines: Vec<&str> = text.lines().collect();
    lines[1..].sort_by_key(|l| l.bytes().fold(7u32, |h, b| h.wrapping_mul(31) ^ u32::from(b)));
    lines.join("\n")
}

/// Area of triangles, or volume of tetrahedra.
fn measure(g: &UnstructuredGrid) -> f64 {
    let of = |ids: &[u32]| {
        let p = |i: usize| g.points.get(ids[i] as usize);
        let normal = (p(1) - p(0)).cross(p(2) - p(0));
        if ids.len() == 3 { 0.5 * normal.length() } else { normal.dot(p(3) - p(0)) / 6.0 }
    };
    g.cells.iter().map(of).sum()
}

#[test]
fn clouds_become_triangles_and_tetrahedra_with_their_values() {
    for (dimensions, kind, least) in [(2, 5, 0.94), (3, 10, 0.85)] {
        let text = cloud(3000, dimensions);
        let file = read(&text).unwrap();
        let g = mesh(&file);
        assert_eq!((g.points.len(), g.types[0]), (3000, kind));
        let filled = measure(g);
        assert!(filled > least && filled <= 1.0, "{dimensions}: {filled}");
        for i in 0..g.points.len() {
            let p = g.points.get(i);
            let expected = 1.0 + p.element_sum();
            assert!((g.attributes.point[0].get(i, 0) - expected).abs() < 1e-12);
        }
        // The order of rows does not matter, and a second time is the same.
        let again = read(&shuffled(&text)).unwrap();
        assert!(mesh(&again) == g && again.warnings == file.warnings);
        let said = &file.warnings[0];
        assert!(said.starts_with("3000 points in no order"), "{said}");
        assert!(said.contains(&format!("became {} t", g.cells.len())), "{said}");
        // The whole hull.
        let hull = read_with("points.csv", &text, Some(f64::INFINITY)).unwrap();
        assert!(mesh(&hull).cells.len() > g.cells.len() && hull.warnings[0].contains("; 0 more"));
    }
}

#[test]
fn a_shuffled_lattice_is_the_lattice_and_one_with_missing_points_is_a_mesh() {
    let mut text = String::from("x;y;z;T\n");
    for i in 0..5 * 4 * 3 {
        writeln!(text, "{};{};{};{i}", f64::from(i % 5) * 0.1, i / 5 % 4, i / 20).unwrap();
    }
    let shuffled = shuffled(&text);
    assert_ne!(shuffled.lines().nth(1), text.lines().nth(1));
    let file = read(&shuffled).unwrap();
    assert!(file.warnings.is_empty(), "{:?}", file.warnings);
    assert_eq!(lattice(&file).extent, [0, 4, 0, 3, 0, 2]);
    assert_eq!(lattice(&file), lattice(&read(&text).unwrap()));
    let cut: Vec<&str> = shuffled.lines().take(60).collect();
    let file = read(&cut.join("\n")).unwrap();
    assert_eq!(mesh(&file).points.len(), 59);
}

#[test]
fn a_body_between_layers_stays_a_hole() {
    // Fluent's names and blanks; millimetres far from the origin.
    let mut text = String::from("nodenumber   x-coordinate   y-coordinate   density\n");
    for i in 0..200 * 25 {
        let (angle, layer) = (TAU * f64::from(i % 200) / 200.0, i / 200);
        let r = 10.0 + 0.005 * (1.3f64.powi(layer) - 1.0) / 0.3;
        let (x, y) = (5e4 + r * angle.cos(), -3e3 + r * angle.sin());
        writeln!(text, "  {}  {x:.9e} {y:.9e}  1.2", i + 1).unwrap();
    }
    let file = read_with("points.txt", &text, None).unwrap();
    let g = mesh(&file);
    let outer = 10.0 + 0.005 * (1.3f64.powi(24) - 1.0) / 0.3;
    let ring = 0.5 * TAU * (outer * outer - 100.0);
    assert!((measure(g) / ring - 1.0).abs() < 0.02, "{} of {ring}", measure(g));
    let middle = g.cells.iter().filter(|c| {
        let p = c.iter().map(|i| g.points.get(*i as usize)).sum::<glam::DVec3>() / 3.0;
        (p.x - 5e4).hypot(p.y + 3e3) < 9.9
    });
    assert_eq!(middle.count(), 0);
    let names: Vec<&str> = g.attributes.point.iter().map(|a| a.name.as_str()).collect();
    assert_eq!(names, ["nodenumber", "density"]);
}

#[test]
fn a_radius_is_the_second_axis_of_a_plane_unless_there_is_another() {
    // Scattered, as CFD-Post and Fluent name the columns, and as COMSOL does.
    for (along, radius, unit) in [
        ("x", "r", ""),
        ("X [ m ]", "Radial Coordinate [ m ]", ""),
        ("x-coordinate", "radius (mm)", "in mm by their names"),
        ("axial-coordinate", "radial-coordinate", ""),
        ("Z", "R", ""),
    ] {
        let text = cloud(300, 2).replace("x,y,rho", &format!("{radius},{along},rho"));
        let file = read(&text).unwrap();
        let g = mesh(&file);
        assert_eq!((g.types[0], file.dataset().unwrap().is_axisymmetric()), (5, true), "{along}");
        let names: Vec<&str> = g.attributes.point.iter().map(|a| a.name.as_str()).collect();
        assert_eq!(names, ["rho"]);
        // The columns are exchanged: x is the second.
        let (first, second) = (scatter(0), scatter(1));
        let at = glam::DVec3::new(second, first, 0.0);
        assert!((0..300).any(|i| g.points.get(i) == at), "{along}");
        let said = file.warnings.join("\n");
        let words = format!("x is `{along}`, along the axis, and y is `{radius}`, the distance");
        assert!(said.contains(&words) && said.contains(unit), "{said}");
    }
    // A lattice.
    let file = read("x,r,T\n0,0,1\n0,2,2\n1,0,3\n1,2,4\n").unwrap();
    assert_eq!(lattice(&file).coordinates, [vec![0.0, 1.0], vec![0.0, 2.0], vec![0.0]]);
    assert!(file.dataset().unwrap().is_axisymmetric());
    // With y, or with x and z, a radius is a value.
    for header in ["x,y,r", "x,z,r"] {
        let file = read(&cloud(300, 2).replace("x,y,rho", header)).unwrap();
        assert_eq!(mesh(&file).attributes.point[0].name, "r");
        assert!(!file.dataset().unwrap().is_axisymmetric(), "{header}");
    }
    // All around the axis.
    let error = read("x,r,theta\n0,1,0\n1,1,90\n0,2,180\n").unwrap_err();
    assert!(error.contains("angles `theta`; write x, y and z of the points"), "{error}");
    assert!(mesh(&read("x,r,theta\n0,1,0\n1,1,0\n0,2,0\n").unwrap()).types == [5]);
}

#[test]
fn rows_are_joined_left_out_and_marked_and_all_is_counted() {
    let text = "X (mm),Y (mm),Z (mm),T\n0,0,5,1\n4,0,5,2\n0,4,5,3\n4,3,5,4\n1,2,5,5\n1,2,5,9\n\
                4,0,5,2\n,1,5,1\nnan,1,5,1\n2,1,5,\n";
    let file = read(text).unwrap();
    let g = mesh(&file);
    assert_eq!((g.points.len(), g.types[0]), (6, 5));
    let at = |x, y| (0..6).find(|i| g.points.get(*i) == glam::DVec3::new(x, y, 5.0)).unwrap();
    let value = |i| g.attributes.point[0].get(i, 0);
    assert_eq!((value(at(1.0, 2.0)), value(at(4.0, 0.0))), (7.0, 2.0));
    assert!(value(at(2.0, 1.0)).is_nan());
    let said = file.warnings.join("\n");
    for words in [
        "6 points in no order in a plane",
        "2 rows without a coordinate",
        "2 rows at the place of another one",
        "1 of the joined rows have other values",
        "1 values are missing",
        "in mm by their names",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
}

/// Points of the unit square in a plane that slants, bent by so much, with so many digits.
fn slanting(count: u32, bend: f64, digits: usize) -> String {
    let [u, v] = [[0.8, 0.36, 0.48], [-0.6, 0.48, 0.64]];
    let normal = [0.0, -0.8, 0.6];
    let mut text = String::from("x,y,z,rho\n");
    for i in 0..count {
        let [a, b] = [scatter(2 * i), scatter(2 * i + 1)];
        for axis in 0..3 {
            let x = 5.0 + a * u[axis] + b * v[axis] + bend * a * a * normal[axis];
            write!(text, "{x:.digits$},").unwrap();
        }
        writeln!(text, "{}", 1.0 + a + b).unwrap();
    }
    text
}

#[test]
fn points_of_a_plane_that_slants_are_triangles_in_it() {
    // All digits, and as many as ParaView writes.
    for digits in [15, 5] {
        let text = slanting(3000, 0.0, digits);
        let file = read(&text).unwrap();
        let g = mesh(&file);
        assert_eq!((g.points.len(), g.types[0]), (3000, 5), "{digits}");
        let filled = measure(g);
        assert!(filled > 0.94 && filled < 1.001, "{digits}: {filled}");
        let said = &file.warnings[0];
        let plane = "in the plane with the normal (";
        assert!(said.starts_with("3000 points in no order") && said.contains(plane), "{said}");
        assert!(said.contains("0.000000, 0.800000, -0.600000") || digits < 15, "{said}");
        // They lie in it, whatever the file rounds them to.
        let at = |i: usize| g.points.get(i);
        let normal = (0..2990).map(|i| (at(i + 1) - at(i)).cross(at(i + 2) - at(i)));
        let normal = normal.max_by(|a, b| a.length().total_cmp(&b.length())).unwrap().normalize();
        let off = (0..3000).map(|i| (at(i) - at(0)).dot(normal).abs()).fold(0.0, f64::max);
        assert!(off < 1e-13, "{digits}: {off}");
        let again = read(&shuffled(&text)).unwrap();
        assert!(mesh(&again) == g && again.warnings == file.warnings, "{digits}");
    }
}

#[test]
fn points_nearly_in_a_plane_are_in_space_and_how_far_they_are_off_is_said() {
    let file = read(&slanting(1000, 2e-3, 9)).unwrap();
    assert_eq!(mesh(&file).types[0], 10);
    let said = file.warnings.join("\n");
    assert!(said.contains("they are nearly in a plane, but in none: the farthest is"), "{said}");
    assert!(said.contains("and 1e-4 would do"), "{said}");
    let file = read(&cloud(1000, 3)).unwrap();
    assert!(!file.warnings.join("\n").contains("nearly"), "a cube is none");
}

#[test]
fn what_has_no_mesh_is_refused_with_file_line_and_cure() {
    for (text, words) in [
        ("x,y,T\n0,0,1\n1,1,2\n", "2 different points, all on one line; give points"),
        ("x,y,z,T\n0,0,0,1\n1,1,1,2\n2,2,2,2\n3,3,3,1\n", "all on one line"),
        ("x,y,T\n1,1,1\n1,1,1\n", "1 different points, all on one line"),
        ("x,y,T\n,1,1\n", "0 different points"),
        ("x,y,T\n", "0 different points"),
        (
            "a,b\n1,2\n",
            "no column with coordinates among `a`, `b`; name those x, y and z, or x and r",
        ),
        ("x,y,T\n0,0,1\n1,far,2\n", "in line 3: column `y`: `far` is not a number; write"),
        ("x,y,T\n0,0,1\n1,1e999,2\n", "in line 3: column `y`: `1e999` is not a number"),
    ] {
        let error = read(text).unwrap_err();
        assert!(error.contains("points.csv") && error.contains(words), "{text:?}: {error}");
    }
    let error = read_with("points.csv", "x,y\n0,0\n1,0\n0,2\n", Some(-1.0)).unwrap_err();
    assert!(error.contains("option `gap`: it is -1; give a number above 0"), "{error}");
    let error = read_with("mesh.stl", "solid\nfacet\n", Some(2.0)).unwrap_err();
    assert!(error.contains("the option `gap`") && error.contains("leave it out"), "{error}");
    assert!(open("no/such/points.csv").is_err());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]
    #[test]
    fn any_rows_are_a_mesh_a_lattice_or_an_error(
        rows in prop::collection::vec(
            prop::collection::vec(
                prop::sample::select(vec![
                    "0", "1", "-1", "2", "0.1", "1e300", "-1e300", "1e-310", "nan", "", "x", "inf",
                ]),
                4,
            ),
            0..25,
        ),
        separator in prop::sample::select(vec![",", ";", "\t", " "]),
        gap in prop::sample::select(vec![1e-3, 1.0, 2.7, f64::INFINITY]),
    ) {
        let mut text = ["x", "y", "z", "rho"].join(separator) + "\n";
        rows.iter().for_each(|r| text += &(r.join(separator) + "\n"));
        match read_with("points.csv", &text, Some(gap)) {
            Ok(file) => file.dataset().unwrap().check().unwrap(),
            Err(e) => prop_assert!(e.contains("points.csv") && e.contains("; "), "{}", e),
        }
    }

    #[test]
    fn damaged_tables_are_read_or_refused(
        at in 0.0f64..1.0,
        bytes in prop::collection::vec(any::<u8>(), 1..6),
        cut: bool,
    ) {
        let mut text = cloud(60, 3).into_bytes();
        let at = (at * text.len() as f64) as usize;
        if cut {
            text.truncate(at);
        } else {
            text.splice(at..(at + bytes.len()).min(text.len()), bytes);
        }
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("points.csv");
        std::fs::write(&path, text).unwrap();
        match open(&path) {
            Ok(file) => file.dataset().unwrap().check().unwrap(),
            Err(e) => prop_assert!(e.to_string().contains("points.csv"), "{}", e),
        }
    }
}
