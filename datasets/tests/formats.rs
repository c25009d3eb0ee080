//! Interpretation of each format, tested with small files of known content.

mod sample_files;
#[path = "formats/scenes.rs"]
mod scenes;

use datasets::model::{
    Dataset, ImageData, Points, PolyData, StructuredGrid, UnstructuredGrid, Values,
};
use datasets::read::plot3d::{self, Plot3dOptions};
use datasets::read::{Content, LoadedFile, SceneModel, open};
use datasets::write::{Encoding, VtkOptions, write_obj, write_ply, write_pvd, write_vtk};
use glam::{DVec3, Vec3};
use rt_core::mesh::{Attribute, PerElement, TriMesh};
use std::io::Write as _;

fn opened(name: &str, bytes: &[u8]) -> LoadedFile {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    open(&path).unwrap_or_else(|e| panic!("{e}"))
}

fn data(o: LoadedFile) -> Dataset {
    match o.content {
        Content::Data(d) => d,
        Content::Scene(_) => panic!("a scene"),
    }
}
fn scene(o: LoadedFile) -> SceneModel {
    match o.content {
        Content::Scene(s) => s,
        Content::Data(_) => panic!("a data set"),
    }
}
fn image(o: LoadedFile) -> ImageData {
    match data(o) {
        Dataset::ImageData(d) => d,
        other => panic!("{}", other.kind()),
    }
}
fn poly(o: LoadedFile) -> PolyData {
    match data(o) {
        Dataset::PolyData(d) => d,
        other => panic!("{}", other.kind()),
    }
}

/// Volume inside a closed mesh by the divergence theorem: positive when all triangles face
/// outwards.
fn volume(m: &TriMesh) -> f64 {
    (0..m.num_triangles())
        .map(|i| m.triangle(i).map(|p| p.as_dvec3()))
        .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
        .sum()
}

#[test]
fn plot3d_layouts_are_distinguished_by_size() {
    for multi in [false, true] {
        for records in [false, true] {
            for big in [false, true] {
                for iblank in [false, true] {
                    let blocks = if multi { vec![[4, 3, 2], [2, 5, 3]] } else { vec![[4, 3, 2]] };
                    let (grid, q) = sample_files::plot3d(&blocks, multi, records, big, iblank);
                    let dir = tempfile::tempdir().unwrap();
                    std::fs::write(dir.path().join("flowxyz.bin"), grid).unwrap();
                    std::fs::write(dir.path().join("flowq.bin"), q).unwrap();
                    let o = open(dir.path().join("flowxyz.bin")).unwrap();
                    assert_eq!((o.format, o.warnings.len()), ("PLOT3D", 0), "{:?}", o.warnings);
                    let d = data(o);
                    let leaves = d.leaves();
                    assert_eq!(leaves.len(), blocks.len());
                    for (b, leaf) in leaves.iter().enumerate() {
                        let Dataset::StructuredGrid(g) = leaf else { panic!() };
                        check_block(g, blocks[b], b, iblank);
                    }
                    // Opening the solution finds the grid.
                    assert_eq!(data(open(dir.path().join("flowq.bin")).unwrap()), d);
                }
            }
        }
    }
}

fn check_block(g: &StructuredGrid, d: [u32; 3], b: usize, iblank: bool) {
    let n = (d[0] * d[1] * d[2]) as usize;
    assert_eq!(g.points.len(), n);
    let last =
        DVec3::new(f64::from(d[0] - 1), f64::from(d[1] - 1), f64::from(d[2] - 1)) + 10.0 * b as f64;
    assert_eq!(g.points.get(n - 1), last, "x runs fastest");
    let density = g.attributes.point_array("Density").unwrap();
    assert_eq!((density.get(0, 0), density.get(n - 1, 0)), (0.0, (n - 1) as f64));
    let momentum = g.attributes.point_array("Momentum").unwrap();
    assert_eq!(
        (0..3).map(|c| momentum.get(1, c)).collect::<Vec<_>>(),
        [1, 2, 3].map(|k| (k * n + 1) as f64)
    );
    assert_eq!(g.attributes.point_array("StagnationEnergy").unwrap().get(0, 0), 4.0 * n as f64);
    assert!((g.attributes.field_array("Mach").unwrap().get(0, 0) - 2.95).abs() < 1e-6);
    let (_, report) = Dataset::StructuredGrid(g.clone()).to_trimesh(Some("Density")).unwrap();
    assert_eq!(
        report.ghost_cells,
        usize::from(iblank),
        "the cell at the blanked corner is left out"
    );
}

#[test]
fn plot3d_padding_at_the_end_is_no_fault() {
    let (grid, mut q) = sample_files::plot3d(&[[4, 3, 2]], false, false, true, false);
    q.resize(q.len() + 484, 0);
    let o =
        plot3d::read_from_bytes("a".as_ref(), &grid, Some(&q), &Plot3dOptions::default()).unwrap();
    assert!(o.dataset().unwrap().attributes().unwrap().point_array("Density").is_some());
}

#[test]
fn plot3d_solution_of_another_grid_is_refused() {
    let (grid, _) = sample_files::plot3d(&[[4, 3, 2]], false, false, true, false);
    let (_, q) = sample_files::plot3d(&[[4, 2, 3]], false, false, true, false);
    let e = plot3d::read_from_bytes("a".as_ref(), &grid, Some(&q), &Plot3dOptions::default())
        .unwrap_err()
        .to_string();
    assert!(e.contains("[4, 2, 3]") && e.contains("[4, 3, 2]"), "{e}");
}

/// The real data set, on machines that have it: `RTSV_BLUNT_FIN` names bluntfinxyz.bin, with
/// bluntfinq.bin in the same directory.
#[test]
fn blunt_fin_has_its_known_free_stream_and_shock() {
    let Some(path) = std::env::var_os("RTSV_BLUNT_FIN") else {
        let reason = "skipped: blunt_fin_has_its_known_free_stream_and_shock needs RTSV_BLUNT_FIN \
                      to name bluntfinxyz.bin";
        writeln!(std::io::stderr(), "{reason}").unwrap();
        return;
    };
    let Dataset::StructuredGrid(g) = data(open(path).unwrap()) else { panic!() };
    assert_eq!(datasets::model::extent_dims(g.extent), [40, 32, 32]);
    let a = &g.attributes;
    assert!((a.field_array("Mach").unwrap().get(0, 0) - 2.95).abs() < 1e-6);
    let density = a.point_array("Density").unwrap();
    let (lo, hi) = density.range().unwrap();
    // Normal shock at Mach 2.95: density ratio 3.81; isentropic stagnation adds to 4.6 (NACA 1135).
    assert!(lo > 0.1 && hi > 3.8 && hi < 6.0, "{lo} {hi}");
}

#[test]
fn nrrd_and_metaimage_agree_on_the_same_volume() {
    let text = (0..12i32).map(|i| (i * 100 - 300).to_string()).collect::<Vec<_>>().join(" ");
    let files = [
        ("a.nrrd", sample_files::nrrd("raw", sample_files::shorts())),
        ("b.nrrd", sample_files::nrrd("gzip", sample_files::gzip(&sample_files::shorts()))),
        ("c.nrrd", sample_files::nrrd("ascii", text.into_bytes())),
        ("d.mha", sample_files::mha()),
    ];
    for (name, bytes) in files {
        let d = image(opened(name, &bytes));
        assert_eq!(
            (d.dims(), d.origin, d.spacing),
            ([3, 2, 2], DVec3::new(1., 2., 3.), DVec3::new(0.5, 2.0, 1.0)),
            "{name}"
        );
        assert_eq!(
            d.attributes.point[0].values,
            Values::I16((0..12).map(|i| i * 100 - 300).collect()),
            "{name}"
        );
        let array = d.attributes.point[0].name.clone();
        let grid = Dataset::ImageData(d).to_grid(&array).unwrap();
        assert_eq!((grid.at(2, 0, 0), grid.at(0, 1, 1)), (-100.0, 600.0), "{name}");
    }
}

#[test]
fn detached_headers_find_their_data() {
    let dir = tempfile::tempdir().unwrap();
    let mut data = vec![9; 5];
    data.extend(sample_files::shorts());
    std::fs::write(dir.path().join("values.raw"), &data).unwrap();
    let nhdr = "NRRD0001\ntype: int16\ndimension: 3\nsizes: 3 2 2\nendian: big\nencoding: \
                raw\nbyte skip: 5\ndata file: values.raw\n";
    let mhd = "NDims = 3\nDimSize = 3 2 2\nElementType = MET_SHORT\nElementByteOrderMSB = \
               True\nHeaderSize = -1\nElementDataFile = values.raw\n";
    let toml = "dims = [3, 2, 2]\ntype = \"i16\"\nendian = \"big\"\nskip_bytes = 5\nspacing = \
                [1.0, 2.0, 3.0]\nname = \"ct\"\n";
    for (name, text) in [("a.nhdr", nhdr), ("a.mhd", mhd), ("values.toml", toml)] {
        std::fs::write(dir.path().join(name), text).unwrap();
        let d = image(open(dir.path().join(name)).unwrap());
        assert_eq!(
            d.attributes.point[0].values,
            Values::I16((0..12).map(|i| i * 100 - 300).collect()),
            "{name}"
        );
    }
    assert_eq!(
        image(open(dir.path().join("values.raw")).unwrap()).spacing,
        DVec3::new(1.0, 2.0, 3.0)
    );
    std::fs::write(
        dir.path().join("values.toml"),
        "dims = [3, 2, 2]\ntype = \"i16\"\nendianness = \"big\"\n",
    )
    .unwrap();
    let e = open(dir.path().join("values.raw")).unwrap_err().to_string();
    assert!(e.contains("values.toml") && e.contains("line 3") && e.contains("endianness"), "{e}");
}

#[test]
fn raw_without_description_tells_the_cure() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("thing.raw");
    std::fs::write(&path, [0; 10]).unwrap();
    let e = open(&path).unwrap_err().to_string();
    assert!(e.contains("thing.toml") && e.contains("dims = [nx, ny, nz]"), "{e}");
    let named = opened("bonsai_2x3x4_uint8.raw", &[7; 24]);
    assert_eq!(image(named).dims(), [2, 3, 4]);
}

#[test]
fn stl_corners_are_welded_and_solid_does_not_mean_text() {
    for bytes in [sample_files::STL_TEXT.as_bytes().to_vec(), sample_files::stl_binary()] {
        let d = poly(opened("a.stl", &bytes));
        assert_eq!((d.points.len(), d.polys.len()), (4, 2), "-0 and 0 are one place");
    }
}

#[test]
fn ply_properties_arrive_as_arrays() {
    let o = opened("a.ply", sample_files::PLY_TEXT.as_bytes());
    assert!(o.warnings.iter().any(|w| w.contains("edge")), "{:?}", o.warnings);
    let d = poly(o);
    assert_eq!(
        d.attributes.point_array("quality").unwrap().values,
        Values::F32(vec![0.5, 0.25, 1.0, 2.0])
    );
    assert_eq!(d.attributes.cell_array("part").unwrap().values, Values::I32(vec![7, 8]));
    let (mesh, _) = Dataset::PolyData(d).to_trimesh(Some("RGB")).unwrap();
    assert_eq!(mesh.num_triangles(), 3);
    let colors = mesh.colors.unwrap();
    assert_eq!((colors.per, colors.values[0]), (PerElement::Vertex, [1.0, 0.0, 0.0, 1.0]));
    for big in [false, true] {
        let d = poly(opened("b.ply", &sample_files::ply_binary(big)));
        assert_eq!(d.points.get(2), DVec3::new(0.0, 1.0, 1e-3));
    }
}

#[test]
fn surfaces_of_solids_are_closed_and_face_outwards() {
    let d = Dataset::UnstructuredGrid(sample_files::unstructured());
    let (mesh, report) = d.to_trimesh(Some("c")).unwrap();
    assert_eq!(report.dropped(), 0);
    assert!((volume(&mesh) - (1.0 / 6.0 + 1.0 + 1.0)).abs() < 1e-6, "{}", volume(&mesh));
    let scalars = mesh.scalars.unwrap();
    assert_eq!((scalars.per, scalars.values.len()), (PerElement::Face, 4 + 12 + 12));
    let (mesh, _) = Dataset::ImageData(sample_files::image()).to_trimesh(Some("p")).unwrap();
    assert!((volume(&mesh) - 1.5 * 2.0 * 2.0).abs() < 1e-5);
}

#[test]
fn wedges_and_pyramids_keep_their_faces_outwards_in_a_vtu() {
    let points = [
        // A wedge of height 2 whose first triangle faces down, and a pyramid on a square.
        [0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 0.0, 2.0],
        [0.0, 1.0, 2.0],
        [1.0, 0.0, 2.0],
        [3.0, 0.0, 0.0],
        [4.0, 0.0, 0.0],
        [4.0, 1.0, 0.0],
        [3.0, 1.0, 0.0],
        [3.5, 0.5, 3.0],
    ];
    let mut grid = UnstructuredGrid { points: Points::F64(points.to_vec()), ..Default::default() };
    grid.types = vec![13, 14];
    grid.cells.push([0, 1, 2, 3, 4, 5]);
    grid.cells.push([6, 7, 8, 9, 10]);
    let data = Dataset::UnstructuredGrid(grid);
    let dir = tempfile::tempdir().unwrap();
    for (encoding, compress) in
        [(Encoding::Ascii, false), (Encoding::Base64, false), (Encoding::Base64, true)]
    {
        let path = dir.path().join("cells.vtu");
        write_vtk(&path, &data, VtkOptions { encoding, compress }).unwrap();
        let again = open(&path).unwrap();
        let again = again.dataset().unwrap();
        assert_eq!(again, &data);
        let (mesh, report) = again.to_trimesh(None).unwrap();
        assert_eq!((report.dropped(), mesh.num_triangles()), (0, 8 + 6));
        assert!((volume(&mesh) - 2.0).abs() < 1e-6, "{}", volume(&mesh));
    }
}

#[test]
fn faces_shared_by_two_cells_are_inside() {
    let mut d = sample_files::unstructured();
    // A second hexahedron on the far side of the first one.
    let far = d.points.len() as u32;
    let shifted = |p: [f64; 3]| [p[0], p[1], p[2] + 1.0];
    let top: Vec<[f64; 3]> = (8..12).map(|i| shifted(d.points.get(i).to_array())).collect();
    d.points.append(&datasets::model::Points::F64(top));
    d.cells.push((8..12).chain(far..far + 4));
    d.types.push(12);
    d.faces_of_cell.push(0..0);
    d.attributes.cell.clear();
    let (mesh, _) = Dataset::UnstructuredGrid(d).to_trimesh(None).unwrap();
    assert_eq!(mesh.num_triangles(), 4 + 10 * 2 + 12);
    assert!((volume(&mesh) - (1.0 / 6.0 + 3.0)).abs() < 1e-6);
}

#[test]
fn bad_cells_are_counted_not_lost() {
    let mut d = sample_files::poly();
    d.polys.push([0, 1, 99]);
    d.polys.push([0, 1]);
    d.attributes.cell.clear();
    let (mesh, report) = Dataset::PolyData(d).to_trimesh(None).unwrap();
    assert_eq!(
        (mesh.num_triangles(), report.bad_ids, report.too_few_points, report.line_and_point_cells),
        (5, 1, 1, 2)
    );
    assert_eq!(report.warnings().len(), 2);
}

#[test]
fn missing_arrays_and_components_are_named() {
    let d = Dataset::ImageData(sample_files::image());
    let e = d.to_trimesh(Some("pressure")).unwrap_err().to_string();
    assert!(
        e.contains("`pressure`") && e.contains("`p` (points)") && e.contains("`c` (cells)"),
        "{e}"
    );
    let e = d.to_grid("v:7").unwrap_err().to_string();
    assert!(e.contains("`v` has 3 components"), "{e}");
    let grid = d.to_grid("v:y").unwrap();
    assert_eq!(grid.values()[1], 4f64.sin() as f32);
    let cells = d.to_grid("c").unwrap();
    assert_eq!((cells.dims().to_array(), cells.origin()), ([3, 2, 1], DVec3::new(1.25, -1.5, 1.5)));
}

#[test]
fn axes_that_run_backwards_are_turned_round() {
    let mut d = sample_files::image();
    d.spacing.x = -0.5;
    let grid = Dataset::ImageData(d).to_grid("p").unwrap();
    assert_eq!((grid.spacing().x, grid.origin().x), (0.5, -0.5));
    assert_eq!(grid.values()[..4], [-1.5, -2.0, -2.5, -3.0]);
}

#[test]
fn uneven_steps_do_not_become_a_uniform_grid() {
    let e =
        Dataset::RectilinearGrid(sample_files::rectilinear()).to_grid("p").unwrap_err().to_string();
    assert!(
        e.contains("along x are not equal (first at index 1)") && e.contains("resample"),
        "{e}"
    );
}

#[test]
fn lines_and_points_keep_their_scalars() {
    let d = Dataset::PolyData(sample_files::poly());
    let (lines, dropped) = d.to_lines(Some("t")).unwrap();
    assert_eq!((lines.len(), dropped), (1, 0));
    assert_eq!(lines[0].scalars.as_deref(), Some(&[1.0, 5.0, 3.0][..]));
    let points = d.to_points(Some("t")).unwrap();
    assert_eq!((points.points.len(), points.scalars.unwrap()[3]), (5, -4.0));
    assert!(d.to_points(Some("id <&\">")).unwrap_err().to_string().contains("per cell"));
}

#[test]
fn far_meshes_survive_ply_and_vtp() {
    let positions =
        [DVec3::new(6e6, 0.0, 1.0), DVec3::new(6e6 + 0.001, 0.0, 1.0), DVec3::new(6e6, 0.001, 1.0)];
    let mut mesh = TriMesh::from_f64_positions(&positions, vec![[0, 1, 2]]);
    mesh.scalars = Some(Attribute::per_vertex(vec![1.0, f32::NAN, 3.0]));
    mesh.normals = Some(Attribute::per_vertex(vec![Vec3::Z; 3]));
    let dir = tempfile::tempdir().unwrap();
    let (ply, vtp) = (dir.path().join("a.ply"), dir.path().join("a.vtp"));
    write_ply(&ply, &mesh).unwrap();
    let data = Dataset::PolyData(PolyData::from_trimesh(&mesh));
    write_vtk(&vtp, &data, VtkOptions::default()).unwrap();
    for (path, name) in [(ply, "scalar"), (vtp.clone(), "scalars")] {
        let (again, _) = open(path).unwrap().dataset().unwrap().to_trimesh(Some(name)).unwrap();
        for (p, q) in again.positions.iter().zip(&positions) {
            assert!(
                (again.origin + p.as_dvec3()).distance(*q) < 2e-9,
                "nanometres at six thousand kilometres"
            );
        }
        assert_eq!(again.normals, mesh.normals);
        let s = again.scalars.unwrap().values;
        assert!(s[0] == 1.0 && s[1].is_nan() && s[2] == 3.0);
    }
    // VTK cannot read NaN from text: the writer rejects it with a cure, and leaves no partial file.
    let text = dir.path().join("b.vtp");
    let e = write_vtk(&text, &data, VtkOptions { encoding: Encoding::Ascii, compress: false })
        .unwrap_err()
        .to_string();
    assert!(e.contains("`scalars`") && e.contains("base64") && !text.exists(), "{e}");
    assert!(
        write_obj(dir.path().join("a.obj"), &mesh).unwrap_err().to_string().contains("PLY or VTP")
    );
}

#[test]
fn collections_and_series_come_back() {
    let dir = tempfile::tempdir().unwrap();
    let blocks: Vec<datasets::model::Block> = sample_files::data_sets()
        .into_iter()
        .map(|(n, data)| datasets::model::Block { name: n.into(), data })
        .collect();
    let all = Dataset::MultiBlock(blocks);
    write_vtk(dir.path().join("all.vtm"), &all, VtkOptions::default()).unwrap();
    assert_eq!(data(open(dir.path().join("all.vtm")).unwrap()), all);
    let steps = [(0.0, dir.path().join("all/all_0.vti")), (1.5, dir.path().join("all/all_0.vti"))];
    write_pvd(dir.path().join("t.pvd"), &steps).unwrap();
    let o = open(dir.path().join("t.pvd")).unwrap();
    assert_eq!(o.time_steps.iter().map(|s| s.time).collect::<Vec<_>>(), [0.0, 1.5]);
    assert_eq!(image(o), sample_files::image());
    let e = write_vtk(
        dir.path().join("a.vtu"),
        &Dataset::ImageData(sample_files::image()),
        VtkOptions::default(),
    );
    assert!(e.unwrap_err().to_string().contains("a.vti"));
}

#[test]
fn content_beats_a_wrong_name() {
    let o = opened("a.stl", sample_files::PLY_TEXT.as_bytes());
    assert_eq!(o.format, "PLY");
    assert!(o.warnings.iter().any(|w| w.contains("the name says Stl")), "{:?}", o.warnings);
}

#[test]
fn legacy_binary_and_text_mean_what_they_say() {
    let d = poly(opened("b.vtk", &sample_files::legacy_binary()));
    assert_eq!(d.polys.get(1), [0, 2, 3]);
    assert_eq!(d.attributes.point_array("temp").unwrap().values, Values::I16(vec![1, -2, 300, 4]));
    let Dataset::UnstructuredGrid(g) = data(opened("a.vtk", sample_files::LEGACY_GRID.as_bytes()))
    else {
        panic!()
    };
    assert_eq!((g.types.as_slice(), g.cells.get(1)), (&[10u8, 5][..], &[1u32, 2, 4][..]));
    assert_eq!(g.attributes.cell_array("id").unwrap().values, Values::I32(vec![7, 8]));
    assert_eq!(g.attributes.point_scalars.as_deref(), Some("s"));
    // Files of version 1 have an empty line after the title.
    let old = sample_files::LEGACY_GRID.replacen("Version 3.0", "Version 1.0", 1);
    let old = old.replacen("ASCII\n", "\nASCII\n\n", 1);
    assert_eq!(data(opened("old.vtk", old.as_bytes())), Dataset::UnstructuredGrid(g));
}

#[test]
fn copies_of_other_processes_close_no_hole_and_open_none() {
    // Three hexahedra in a row; the last is first a copy of another process's (bit 1), then hidden
    // (bit 32).
    let mut d = datasets::model::UnstructuredGrid::default();
    let mut points = Vec::new();
    for x in 0..4 {
        for [y, z] in [[0.0f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
            points.push([x as f32, y, z]);
        }
    }
    d.points = datasets::model::Points::F32(points);
    (0..3u32).for_each(|c| d.cells.push(4 * c..4 * c + 8));
    d.types = vec![12; 3];
    for (ghost, triangles) in [(0u8, 28), (1, 18), (32, 20)] {
        d.attributes.cell =
            vec![datasets::model::DataArray::new("vtkGhostType", 1, Values::U8(vec![0, 0, ghost]))];
        let (mesh, report) = Dataset::UnstructuredGrid(d.clone()).to_trimesh(None).unwrap();
        assert_eq!(
            (mesh.num_triangles(), report.ghost_cells),
            (triangles, usize::from(ghost > 0)),
            "ghost {ghost}"
        );
    }
}
