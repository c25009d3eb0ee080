//! Every kind of mesh, and what is wrong with meshes.

use super::*;
use datasets::model::{Points, ScalarType, Values};
use proptest::prelude::*;

/// A mesh with the children of `text`: lines `path = value`, where a value is a word in quotes or
/// numbers.
fn mesh<'a>(text: &str, arrays: &'a [(&str, Vec<f64>)], ids: &'a [(&str, Vec<i64>)]) -> Node<'a> {
    let mut node = Node::default();
    for line in text.lines().filter(|l| !l.trim().is_empty()) {
        let (path, value) = line.split_once('=').expect("a path and a value");
        node.set(path.trim(), value.trim().into());
    }
    for (path, values) in arrays {
        node.set(path, Node::from(&values[..]));
    }
    for (path, values) in ids {
        node.set(path, Node::from(&values[..]));
    }
    node
}

fn read(mesh: Node<'_>) -> Result<(Dataset, Vec<String>), String> {
    let mut channel = Node::default();
    channel.set("type", "mesh".into());
    channel.set("data", mesh);
    let domains = domains(&channel, "grid").map_err(|e| e.to_string())?;
    let one = domains.first().ok_or("no domain")?;
    dataset(one, None).map_err(|e| e.to_string())?.ok_or_else(|| "no topology".to_owned())
}

const UNIFORM: &str = "
    coordsets/c/type = uniform
    topologies/t/type = uniform
    topologies/t/coordset = c
    fields/p/association = vertex
    fields/p/topology = t";
const EXPLICIT: &str = "
    coordsets/c/type = explicit
    topologies/t/type = unstructured
    topologies/t/coordset = c";

/// The corners of a unit cube, with x, y and z of a point side by side.
fn corners() -> Vec<f64> {
    let corner = |k: usize| [k & 1, k >> 1 & 1, k >> 2 & 1].map(|b| b as f64);
    (0..8).flat_map(corner).collect()
}

fn with_corners<'a>(text: &str, corners: &'a [f64], ids: &'a [(&str, Vec<i64>)]) -> Node<'a> {
    let mut node = mesh(text, &[], ids);
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let bytes: &[u8] = bytemuck::cast_slice(&corners[axis..]);
        let numbers = crate::node::Numbers::strided(bytes, ScalarType::F64, corners.len() / 3, 24);
        node.set(&format!("coordsets/c/values/{name}"), Node::Numbers(numbers.unwrap()));
    }
    node
}

#[test]
fn uniform_points_become_image_data() {
    let arrays = [
        ("coordsets/c/origin/y", vec![2.0]),
        ("coordsets/c/spacing/dx", vec![0.5]),
        ("fields/p/values", (0..6).map(f64::from).collect()),
    ];
    let dims = [("coordsets/c/dims/i", vec![3]), ("coordsets/c/dims/j", vec![2])];
    let (data, warnings) = read(mesh(UNIFORM, &arrays, &dims)).unwrap();
    let Dataset::ImageData(image) = &data else { panic!("{}", data.kind()) };
    assert_eq!(image.dims(), [3, 2, 1]);
    assert_eq!(image.point(2, 1, 0).to_array(), [1.0, 3.0, 0.0]);
    let array = image.attributes.point_array("p").unwrap();
    assert_eq!(array.values, Values::F64(vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0]));
    assert!(warnings.is_empty(), "{warnings:?}");
}

#[test]
fn rectilinear_and_structured_points_become_lattices() {
    let text = UNIFORM.replace("uniform", "rectilinear");
    let arrays = [
        ("coordsets/c/values/x", vec![0.0, 1.0, 4.0]),
        ("coordsets/c/values/y", vec![0.0, 2.0]),
        ("fields/p/values", vec![1.0; 6]),
    ];
    let (data, _) = read(mesh(&text, &arrays, &[])).unwrap();
    assert!(matches!(data, Dataset::RectilinearGrid(_)) && data.counts() == (6, 2));

    let text = EXPLICIT.replace("unstructured", "structured");
    let dims = [
        ("topologies/t/elements/dims/i", vec![1]),
        ("topologies/t/elements/dims/j", vec![1]),
        ("topologies/t/elements/dims/k", vec![1]),
    ];
    let corners = corners();
    let (data, _) = read(with_corners(&text, &corners, &dims)).unwrap();
    assert!(matches!(data, Dataset::StructuredGrid(_)) && data.counts() == (8, 1));
    assert_eq!(data.to_trimesh(None).unwrap().0.num_triangles(), 12);
}

#[test]
fn cells_of_every_shape_have_their_surface() {
    // In the order of the corners of a cube: x fastest.
    let hex = vec![0, 1, 3, 2, 4, 5, 7, 6];
    let cases = [
        ("hex", hex, 12),
        ("tet", vec![0, 1, 2, 4], 4),
        ("wedge", vec![0, 1, 2, 4, 5, 6], 8),
        ("pyramid", vec![0, 1, 3, 2, 4], 6),
        ("quad", vec![0, 1, 3, 2], 2),
        ("tri", vec![0, 1, 2, 1, 3, 2], 2),
    ];
    let corners = corners();
    for (shape, ids, triangles) in cases {
        let text = format!("{EXPLICIT}\n topologies/t/elements/shape = {shape}");
        let ids = [("topologies/t/elements/connectivity", ids)];
        let (data, _) = read(with_corners(&text, &corners, &ids)).unwrap();
        let (surface, report) = data.to_trimesh(None).unwrap();
        assert_eq!((surface.num_triangles(), report.dropped()), (triangles, 0), "{shape}");
    }
}

#[test]
fn mixed_cells_and_lists_of_shapes_are_the_same() {
    let corners = corners();
    let mixed = format!("{EXPLICIT}\n topologies/t/elements/shape = mixed");
    let of_mixed = [
        ("topologies/t/elements/shape_map/tet", vec![10]),
        ("topologies/t/elements/shape_map/tri", vec![5]),
        ("topologies/t/elements/shapes", vec![10, 5]),
        ("topologies/t/elements/sizes", vec![4, 3]),
        ("topologies/t/elements/offsets", vec![0, 4]),
        ("topologies/t/elements/connectivity", vec![0, 1, 2, 4, 3, 5, 6]),
    ];
    let lists = format!(
        "{EXPLICIT}\n topologies/t/elements/a/shape = tet\n topologies/t/elements/b/shape = tri"
    );
    let of_lists = [
        ("topologies/t/elements/a/connectivity", vec![0, 1, 2, 4]),
        ("topologies/t/elements/b/connectivity", vec![3, 5, 6]),
    ];
    let [a, b] = [(&mixed, &of_mixed[..]), (&lists, &of_lists[..])]
        .map(|(text, ids)| read(with_corners(text, &corners, ids)).unwrap().0);
    assert_eq!(a, b);
    assert_eq!(a.counts(), (8, 2));
}

#[test]
fn polygons_and_polyhedra_have_their_faces() {
    let corners = corners();
    let text = format!("{EXPLICIT}\n topologies/t/elements/shape = polygonal");
    let ids = [
        ("topologies/t/elements/sizes", vec![4, 3]),
        ("topologies/t/elements/connectivity", vec![0, 1, 3, 2, 4, 5, 7]),
    ];
    let (data, _) = read(with_corners(&text, &corners, &ids)).unwrap();
    assert_eq!(data.to_trimesh(None).unwrap().0.num_triangles(), 3);

    let text = format!(
        "{EXPLICIT}\n topologies/t/elements/shape = polyhedral\n \
         topologies/t/subelements/shape = polygonal"
    );
    let faces = vec![0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5];
    let ids = [
        ("topologies/t/elements/sizes", vec![6]),
        ("topologies/t/elements/connectivity", (0..6).collect()),
        ("topologies/t/subelements/sizes", vec![4; 6]),
        ("topologies/t/subelements/connectivity", faces),
    ];
    let (data, _) = read(with_corners(&text, &corners, &ids)).unwrap();
    assert_eq!(data.to_trimesh(None).unwrap().0.num_triangles(), 12);
}

#[test]
fn vectors_and_copies_of_other_ranks_cells_are_known() {
    let corners = corners();
    let text = format!(
        "{EXPLICIT}\n topologies/t/elements/shape = tet
        fields/v/association = vertex\n fields/v/topology = t
        fields/ghost/association = element\n fields/ghost/topology = t
        fields/other/association = element\n fields/other/topology = else"
    );
    let ids = [
        ("topologies/t/elements/connectivity", vec![0, 1, 2, 4, 1, 2, 3, 5]),
        ("fields/ghost/values", vec![0, 1]),
        ("fields/other/values", vec![0]),
    ];
    let [u, w] = [vec![3.0; 8], vec![4.0; 8]];
    let mut node = with_corners(&text, &corners, &ids);
    node.set("fields/v/values/u", Node::from(&u[..]));
    node.set("fields/v/values/w", Node::from(&w[..]));
    let mut channel = Node::default();
    channel.set("type", "mesh".into());
    channel.set("data", node);
    channel.set("state/metadata/vtk_fields/ghost/attribute_type", "Ghosts".into());
    let all = domains(&channel, "grid").unwrap();
    let (data, _) = dataset(&all[0], None).unwrap().unwrap();
    let arrays = data.attributes().unwrap();
    assert_eq!(arrays.point_array("v").unwrap().magnitude(0), 5.0);
    assert_eq!(arrays.cell_array("vtkGhostType").unwrap().values, Values::U8(vec![0, 1]));
    assert!(arrays.cell_array("other").is_none());
    let (_, report) = data.to_trimesh(None).unwrap();
    assert_eq!(report.ghost_cells, 1);
}

#[test]
fn all_domains_of_a_multimesh_are_found_and_empty_ranks_have_none() {
    let ids = [("coordsets/c/dims/i", vec![2])];
    let one = || mesh(UNIFORM, &[], &ids);
    let mut channel = Node::default();
    channel.set("type", "multimesh".into());
    channel.set("data/left", one());
    channel.set("data/right/0", one());
    channel.set("data/right/1", one());
    channel.set("data/none", Node::default());
    let paths: Vec<String> = domains(&channel, "g").unwrap().into_iter().map(|d| d.path).collect();
    assert_eq!(paths, ["g/data/left", "g/data/right/0", "g/data/right/1"]);
}

#[test]
fn single_precision_points_stay_so() {
    let x = [0.0_f32, 1.0, 0.5];
    let text = EXPLICIT.replace("unstructured", "points");
    let mut node = mesh(&text, &[], &[]);
    node.set("coordsets/c/values/x", Node::from(&x[..]));
    let (data, _) = read(node).unwrap();
    let Dataset::PolyData(points) = data else { panic!("{}", data.kind()) };
    assert!(matches!(points.points, Points::F32(_)) && points.verts.len() == 3);
}

#[test]
fn faults_name_their_place() {
    let dims = [("coordsets/c/dims/i", vec![3])];
    let good = || mesh(UNIFORM, &[], &dims);
    let changed = |path: &str, value: Node<'static>| {
        let mut node = good();
        node.set(path, value);
        read(node).map(|_| ()).unwrap_err()
    };
    static NEGATIVE: [i64; 1] = [-3];
    static WORD: &str = "hexagonal";
    let cases = [
        (changed("coordsets/c/type", WORD.into()), "grid/data/topologies/t: a topology of type"),
        (changed("coordsets/c/dims/i", Node::from(&NEGATIVE[..])), "coordsets/c/dims/i"),
        (changed("coordsets/c/origin/x", WORD.into()), "coordsets/c/origin/x: a finite number"),
        (changed("topologies/t/coordset", "d".into()), "grid/data/coordsets/d: coordinates"),
        (changed("topologies/t/type", WORD.into()), "topologies/t/type: `hexagonal`"),
    ];
    for (said, part) in cases {
        assert!(said.contains(part), "{said}");
    }
    let mut wrong = Node::default();
    wrong.set("type", "amrmesh".into());
    wrong.set("data", good());
    let said = domains(&wrong, "grid").unwrap_err().to_string();
    assert!(said.contains("grid/type: `amrmesh` is not supported"), "{said}");
    // A field of another length.
    let two = [("fields/p/values", vec![1.0, 2.0])];
    let said = read(mesh(UNIFORM, &two, &dims)).unwrap_err();
    assert!(said.contains("`p`") && said.contains('3') && said.contains('2'), "{said}");
}

#[test]
fn fields_that_cannot_be_read_are_left_out_by_name() {
    let text = format!("{UNIFORM}\n fields/q/basis = H1_3D_P2\n fields/q/topology = t");
    let dims = [("coordsets/c/dims/i", vec![2]), ("fields/q/values", vec![1, 2, 3])];
    let values = [("fields/p/values", vec![1.0, 2.0])];
    let (data, warnings) = read(mesh(&text, &values, &dims)).unwrap();
    assert_eq!(data.attributes().unwrap().point.len(), 1);
    assert!(warnings[0].contains("fields/q: left out: it has a basis"), "{warnings:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    /// Whatever numbers a simulation gives as sizes, offsets and ids, there is a surface or an
    /// error.
    #[test]
    fn no_list_of_cells_ends_in_a_panic(
        shape in prop::sample::select(vec![
            "hex", "tet", "mixed", "polygonal", "polyhedral", "line", "point", "cube",
        ]),
        connectivity in prop::collection::vec(-2_i64..12, 0..24),
        sizes in prop::option::of(prop::collection::vec(-1_i64..9, 0..6)),
        offsets in prop::option::of(prop::collection::vec(-1_i64..30, 0..6)),
        shapes in prop::collection::vec(0_i64..4, 0..6),
        faces in prop::collection::vec(0_i64..9, 0..24),
        extreme in prop::sample::select(vec![0, i64::MAX, i64::MIN, 1 << 32]),
    ) {
        let corners = corners();
        let text = format!("{EXPLICIT}\n topologies/t/elements/shape = {shape}");
        let mut ids = vec![
            ("topologies/t/elements/connectivity", connectivity),
            ("topologies/t/elements/shapes", shapes),
            ("topologies/t/elements/shape_map/tet", vec![1]),
            ("topologies/t/elements/shape_map/polygonal", vec![2]),
            ("topologies/t/subelements/connectivity", faces.clone()),
            ("topologies/t/subelements/sizes", faces),
        ];
        if let Some(first) = ids[0].1.first_mut() {
            *first += extreme.saturating_sub(*first) * i64::from(extreme != 0);
        }
        ids.extend(sizes.map(|s| ("topologies/t/elements/sizes", s)));
        ids.extend(offsets.map(|o| ("topologies/t/elements/offsets", o)));
        if let Ok((data, _)) = read(with_corners(&text, &corners, &ids)) {
            let _ = data.to_trimesh(None);
        }
    }
}
