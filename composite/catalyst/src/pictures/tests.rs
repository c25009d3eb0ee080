//! Pictures of the same gas in one domain and in several, on one rank and on several.

use super::*;
use crate::settings::{Between, Settings};
use composite::{Communicator, threads};
use std::path::PathBuf;
use std::time::Duration;

/// Points along each axis.
const N: usize = 16;

fn value([x, y, z]: [usize; 3]) -> f64 {
    let at = |k: usize| (k as f64 / (N - 1) as f64 - 0.5).powi(2);
    1.2 - 0.6 * (-12.0 * (at(x) + at(y) + at(z))).exp()
}

/// A slab of planes of the lattice.
struct Slab {
    values: Vec<f64>,
    numbers: [Vec<f64>; 7],
}

impl Slab {
    fn new(planes: std::ops::Range<usize>) -> Slab {
        let point = |k: usize| [k % N, k / N % N, planes.start + k / (N * N)];
        let values = (0..N * N * planes.len()).map(|k| value(point(k))).collect();
        let h = 1.0 / (N - 1) as f64;
        let one = |v: f64| vec![v];
        let numbers = [
            one(N as f64),
            one(N as f64),
            one(planes.len() as f64),
            one(planes.start as f64 * h),
            one(h),
            one(h),
            one(h),
        ];
        Slab { values, numbers }
    }

    fn mesh(&self) -> Node<'_> {
        const NAMES: [&str; 7] =
            ["dims/i", "dims/j", "dims/k", "origin/z", "spacing/dx", "spacing/dy", "spacing/dz"];
        let mut mesh = Node::default();
        mesh.set("coordsets/c/type", "uniform".into());
        for (name, number) in NAMES.iter().zip(&self.numbers) {
            mesh.set(&format!("coordsets/c/{name}"), Node::from(&number[..]));
        }
        mesh.set("topologies/t/type", "uniform".into());
        mesh.set("topologies/t/coordset", "c".into());
        mesh.set("fields/density/association", "vertex".into());
        mesh.set("fields/density/topology", "t".into());
        mesh.set("fields/density/values", Node::from(&self.values[..]));
        mesh
    }
}

/// Slabs of `parts` parts, with `ghosts` planes of the neighbours.
fn slabs(parts: usize, ghosts: usize) -> Vec<Slab> {
    let slab = |k: usize| {
        let (a, b) = (N * k / parts, N * (k + 1) / parts);
        Slab::new(a.saturating_sub(ghosts)..(b + ghosts).min(N))
    };
    (0..parts).map(slab).collect()
}

fn params<'a>(slabs: &'a [&Slab]) -> Node<'a> {
    let mut params = Node::default();
    params.set("catalyst/channels/gas/type", "multimesh".into());
    params.set("catalyst/channels/gas/data", Node::Children(Vec::new()));
    for (k, slab) in slabs.iter().enumerate() {
        params.set(&format!("catalyst/channels/gas/data/{k}"), slab.mesh());
    }
    params
}

fn file(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join("catalyst-rtsv-tests");
    std::fs::create_dir_all(&folder).expect("a folder");
    folder.join(format!("{}-{name}.png", std::process::id()))
}

/// Makes something on `ranks` ranks, of which rank r has the slabs r, r + ranks, ...
fn made(
    ranks: usize,
    slabs: &[Slab],
    make: impl Fn(&mut Group<'_>, &Node<'_>) -> Result<Vec<String>, PictureError> + Sync,
) -> Vec<Result<Vec<String>, String>> {
    let outputs = threads::run(ranks, |mut comm| {
        let own: Vec<&Slab> = slabs.iter().skip(comm.rank()).step_by(ranks).collect();
        let mut group = Group { comm: &mut comm, timeout: Duration::from_secs(60), threads: false };
        make(&mut group, &params(&own)).map_err(|e| e.to_string())
    });
    outputs.into_iter().map(|o| o.expect("no rank panics")).collect()
}

fn settings(text: &str) -> Settings {
    Settings::parse(text, Path::new("test.toml")).expect("settings")
}

fn bytes_of(name: &str, ranks: usize, slabs: &[Slab], wanted: &Picture) -> Vec<u8> {
    let file = file(name);
    for output in made(ranks, slabs, |group, params| picture(group, params, wanted, &file)) {
        output.expect(name);
    }
    let bytes = std::fs::read(&file).expect(name);
    std::fs::remove_file(&file).expect(name);
    bytes
}

#[test]
fn pictures_have_the_bytes_of_one_process() {
    let text = "
        [[picture]]
        show = \"volume\"
        array = \"density\"
        size = [40, 30]
        [[picture]]
        show = \"isosurface\"
        array = \"density\"
        isovalues = [0.8, 1.0]
        size = [40, 30]
        opacity = 0.5
        middle = [0.5, 0.5, 0.5]
        radius = 0.5";
    for (k, wanted) in settings(text).picture.iter().enumerate() {
        let name = |ranks: usize, parts: usize| format!("{k}-{ranks}-{parts}");
        let one = bytes_of(&name(1, 1), 1, &slabs(1, 0), wanted);
        for (ranks, parts) in [(1, 3), (2, 2), (3, 5), (5, 3)] {
            let cut = cut_at_shared_planes(parts);
            let many = bytes_of(&name(ranks, parts), ranks, &cut, wanted);
            assert!(one == many, "{:?} on {ranks} ranks in {parts} domains", wanted.show);
        }
    }
}

/// Slabs that share the plane between them, as domains of cells do.
fn cut_at_shared_planes(parts: usize) -> Vec<Slab> {
    let end = |k: usize| (N - 1) * k / parts;
    (0..parts).map(|k| Slab::new(end(k)..end(k + 1) + 1)).collect()
}

#[test]
fn photographs_have_the_bytes_of_one_process() {
    let text = "[[photograph]]\nsize = [24, 20]\ndirection = [1, 0, 0]\nup = [0, 0, 1]";
    let wanted = settings(text).photograph.remove(0);
    let bytes = |ranks: usize, slabs: &[Slab], wanted: &Photograph| {
        let file = file(&format!("photograph-{ranks}"));
        for output in made(ranks, slabs, |group, params| photograph(group, params, wanted, &file)) {
            output.expect("a photograph");
        }
        let bytes = std::fs::read(&file).expect("the file");
        std::fs::remove_file(&file).expect("the file");
        bytes
    };
    let one = bytes(1, &slabs(1, 0), &wanted);
    for ranks in [2, 3] {
        assert!(one == bytes(ranks, &slabs(ranks, 2), &wanted), "{ranks} ranks");
    }
    // Without planes of the neighbours, the reason is said on all ranks, and linear interpolation
    // does without.
    let shared = cut_at_shared_planes(2);
    let file = file("photograph-none");
    for output in made(2, &shared, |group, params| photograph(group, params, &wanted, &file)) {
        let said = output.expect_err("no layers");
        assert!(said.contains("one more layer of nodes"), "{said}");
    }
    let linear = Photograph { interpolant: Between::Trilinear, ..wanted };
    assert!(bytes(1, &slabs(1, 0), &linear) == bytes(2, &shared, &linear));
}

#[test]
fn surfaces_of_all_domains_are_drawn_and_coloured() {
    let wanted = settings("[[picture]]\narray = \"density\"\nsize = [40, 30]").picture.remove(0);
    let one = bytes_of("surface-1", 1, &slabs(1, 0), &wanted);
    let many = bytes_of("surface-3", 3, &cut_at_shared_planes(5), &wanted);
    assert!(one == many);
    let grey = bytes_of("surface-grey", 1, &slabs(1, 0), &Picture { array: None, ..wanted });
    assert!(one != grey);
}

#[test]
fn a_rank_with_what_cannot_be_drawn_is_named_on_all() {
    let file = file("faults");
    let all = slabs(2, 0);
    let cases = [
        ("[[picture]]\narray = \"pressure\"", "rank 0: no array `pressure`"),
        ("[[picture]]\nchannel = \"solid\"", "there is no channel `solid`; there are: gas"),
        ("[[picture]]\nshow = \"volume\"\narray = \"p\"", "an array (there are: density)"),
        ("[[picture]]\ntopology = \"main\"", "there is no topology `main`; there are: t"),
    ];
    for (text, part) in cases {
        let wanted = settings(text).picture.remove(0);
        for output in made(2, &all, |group, params| picture(group, params, &wanted, &file)) {
            let said = output.expect_err(text);
            assert!(said.contains(part), "{text}: {said}");
        }
    }
    // A folder that is not there.
    let wanted = settings("[[picture]]\nsize = [8, 8]").picture.remove(0);
    let nowhere = Path::new("/nowhere/at/all.png");
    for output in made(2, &all, |group, params| picture(group, params, &wanted, nowhere)) {
        assert!(output.expect_err("no folder").contains("/nowhere/at"));
    }
}

#[test]
fn domains_off_the_lattice_are_refused() {
    let mut all = slabs(2, 0);
    all[1].numbers[3][0] += 0.01;
    let text = "[[picture]]\nshow = \"volume\"\narray = \"density\"\nsize = [8, 8]";
    let wanted = settings(text).picture.remove(0);
    let file = file("off");
    for output in made(2, &all, |group, params| picture(group, params, &wanted, &file)) {
        let said = output.expect_err("off the lattice");
        assert!(said.contains("a domain of rank 1 begins at") && said.contains("steps"), "{said}");
    }
}

#[test]
fn a_simulation_without_cells_has_an_empty_picture() {
    let wanted = settings("[[picture]]\nsize = [8, 8]").picture.remove(0);
    let file = file("empty");
    let outputs = made(2, &[], |group, params| picture(group, params, &wanted, &file));
    let warnings: Vec<String> = outputs.into_iter().flat_map(|o| o.expect("a picture")).collect();
    assert!(warnings.len() == 1 && warnings[0].contains("nothing is to be seen"), "{warnings:?}");
    std::fs::remove_file(file).expect("the picture");
}

#[test]
fn flat_lattices_are_surfaces_and_are_refused_as_volumes() {
    let flat = [Slab::new(7..8)];
    let wanted = settings("[[picture]]\narray = \"density\"\nsize = [24, 24]").picture.remove(0);
    let drawn = bytes_of("flat", 1, &flat, &wanted);
    let nothing = Picture { middle: Some([9.0; 3]), radius: Some(0.1), ..wanted.clone() };
    assert!(drawn != bytes_of("flat-away", 1, &flat, &nothing));
    let volume = Picture { show: Show::Volume, ..wanted };
    let file = file("flat-volume");
    for output in made(2, &flat, |group, params| picture(group, params, &volume, &file)) {
        let said = output.expect_err("a volume without thickness");
        assert!(said.contains("it needs 2 on each axis"), "{said}");
    }
}

#[test]
fn ranks_without_cells_take_part() {
    let text = "
        [[picture]]
        array = \"density\"
        size = [24, 24]
        [[picture]]
        show = \"volume\"
        array = \"density\"
        size = [24, 24]";
    for (k, wanted) in settings(text).picture.iter().enumerate() {
        let one = bytes_of(&format!("some-{k}-1"), 1, &slabs(1, 0), wanted);
        assert!(one == bytes_of(&format!("some-{k}-3"), 3, &slabs(1, 0), wanted));
    }
}

#[test]
fn triangles_without_a_place_are_counted() {
    let x = [0.0, 1.0, 0.0, f64::NAN];
    let y = [0.0, 0.0, 1.0, 1.0];
    let ids = [0_i64, 1, 2, 1, 2, 3];
    let mut params = Node::default();
    params.set("catalyst/channels/a/type", "mesh".into());
    let at = "catalyst/channels/a/data";
    params.set(&format!("{at}/coordsets/c/type"), "explicit".into());
    params.set(&format!("{at}/coordsets/c/values/x"), Node::from(&x[..]));
    params.set(&format!("{at}/coordsets/c/values/y"), Node::from(&y[..]));
    params.set(&format!("{at}/topologies/t/type"), "unstructured".into());
    params.set(&format!("{at}/topologies/t/coordset"), "c".into());
    params.set(&format!("{at}/topologies/t/elements/shape"), "tri".into());
    params.set(&format!("{at}/topologies/t/elements/connectivity"), Node::from(&ids[..]));
    let wanted = settings("[[picture]]\nsize = [8, 8]").picture.remove(0);
    let file = file("no-place");
    let mut alone = threads::group(1).remove(0);
    let mut group = Group { comm: &mut alone, timeout: Duration::from_secs(60), threads: false };
    let warnings = picture(&mut group, &params, &wanted, &file).expect("a picture");
    assert!(warnings.iter().any(|w| w.starts_with("1 triangles are left out")), "{warnings:?}");
    std::fs::remove_file(file).expect("the picture");
}

/// Hexahedra between some planes of the lattice.
struct Hexahedra {
    places: [Vec<f64>; 3],
    ids: Vec<i64>,
    values: Vec<f64>,
    cell_values: Vec<f64>,
    ghosts: Vec<u8>,
}

impl Hexahedra {
    /// Cells between the planes, of which those outside `own` are copies.
    fn new(planes: std::ops::Range<usize>, own: std::ops::Range<usize>) -> Hexahedra {
        let h = 1.0 / (N - 1) as f64;
        let point = |k: usize| [k % N, k / N % N, planes.start + k / (N * N)];
        let count = N * N * planes.len();
        let places = [0, 1, 2].map(|a| (0..count).map(|k| point(k)[a] as f64 * h).collect());
        let mut all = Hexahedra {
            places,
            ids: Vec::new(),
            values: (0..count).map(|k| value(point(k))).collect(),
            cell_values: Vec::new(),
            ghosts: Vec::new(),
        };
        for k in 0..(N - 1) * (N - 1) * (planes.len() - 1) {
            let [x, y, z] = [k % (N - 1), k / (N - 1) % (N - 1), k / (N - 1) / (N - 1)];
            let first = (x + N * (y + N * z)) as i64;
            let (n, up) = (N as i64, (N * N) as i64);
            let eight = [0, 1, 1 + n, n, up, 1 + up, 1 + n + up, n + up];
            all.ids.extend(eight.map(|step| first + step));
            all.cell_values.push(value([x, y, planes.start + z]));
            all.ghosts.push(u8::from(!own.contains(&(planes.start + z))));
        }
        all
    }

    fn params(&self) -> Node<'_> {
        let mut mesh = Node::default();
        mesh.set("coordsets/c/type", "explicit".into());
        for (name, values) in ["x", "y", "z"].iter().zip(&self.places) {
            mesh.set(&format!("coordsets/c/values/{name}"), Node::from(&values[..]));
        }
        mesh.set("topologies/t/type", "unstructured".into());
        mesh.set("topologies/t/coordset", "c".into());
        mesh.set("topologies/t/elements/shape", "hex".into());
        mesh.set("topologies/t/elements/connectivity", Node::from(&self.ids[..]));
        for (name, of, values) in [
            ("density", "vertex", Node::from(&self.values[..])),
            ("of_cells", "element", Node::from(&self.cell_values[..])),
            ("vtkGhostType", "element", Node::from(&self.ghosts[..])),
        ] {
            mesh.set(&format!("fields/{name}/association"), of.into());
            mesh.set(&format!("fields/{name}/topology"), "t".into());
            mesh.set(&format!("fields/{name}/values"), values);
        }
        let mut params = Node::default();
        params.set("catalyst/channels/cells/type", "mesh".into());
        params.set("catalyst/channels/cells/data", mesh);
        params
    }
}

#[test]
fn isosurfaces_and_slices_of_cells_have_the_bytes_of_one_process() {
    let text = "
        [[picture]]
        show = \"isosurface\"
        array = \"density\"
        isovalues = [0.8, 1.0]
        size = [40, 30]
        [[picture]]
        show = \"isosurface\"
        array = \"of_cells\"
        isovalues = [0.9]
        color_array = \"density\"
        size = [40, 30]
        [[picture]]
        show = \"slice\"
        array = \"density\"
        slice_point = [0.5, 0.4, 0.5]
        slice_normal = [0.3, 1, 0.2]
        size = [40, 30]";
    for (k, wanted) in settings(text).picture.iter().enumerate() {
        let drawn = |ranks: usize| {
            let file = file(&format!("cells-{k}-{ranks}"));
            let outputs = threads::run(ranks, |mut comm| {
                let end = |r: usize| (N - 1) * r / ranks;
                let own = end(comm.rank())..end(comm.rank() + 1);
                // With a layer of the neighbours' cells, for means of cells.
                let planes = own.start.saturating_sub(1)..(own.end + 2).min(N);
                let cells = Hexahedra::new(planes, own);
                let mut group =
                    Group { comm: &mut comm, timeout: Duration::from_secs(60), threads: false };
                picture(&mut group, &cells.params(), wanted, &file).map_err(|e| e.to_string())
            });
            for output in outputs {
                output.expect("no rank panics").expect("a picture");
            }
            let bytes = std::fs::read(&file).expect("the picture");
            std::fs::remove_file(&file).expect("the picture");
            bytes
        };
        let one = drawn(1);
        for ranks in [2, 4] {
            assert!(one == drawn(ranks), "picture {k} on {ranks} ranks");
        }
    }
}

#[test]
fn hidden_cells_of_a_lattice_have_no_isosurface() {
    let slab = Slab::new(0..N);
    let ghosts = vec![32_u8; (N - 1).pow(3)];
    let text = "[[picture]]\nshow = \"isosurface\"\narray = \"density\"\nisovalues = [0.9]";
    let wanted = Picture { size: [16, 16], ..settings(text).picture.remove(0) };
    let drawn = |hidden: bool| {
        let one = [&slab];
        let mut params = params(&one);
        if hidden {
            let at = "catalyst/channels/gas/data/0/fields/vtkGhostType";
            params.set(&format!("{at}/association"), "element".into());
            params.set(&format!("{at}/values"), Node::from(&ghosts[..]));
        }
        let file = file(&format!("hidden-{hidden}"));
        let mut alone = threads::group(1).remove(0);
        let mut group =
            Group { comm: &mut alone, timeout: Duration::from_secs(60), threads: false };
        picture(&mut group, &params, &wanted, &file).expect("a picture");
        let bytes = std::fs::read(&file).expect("the picture");
        std::fs::remove_file(file).expect("the picture");
        bytes
    };
    let [seen, hidden] = [false, true].map(drawn);
    let nothing = Picture { isovalues: vec![99.0], ..wanted.clone() };
    assert!(seen != hidden && hidden == bytes_of("hidden-none", 1, &slabs(1, 0), &nothing));
}
