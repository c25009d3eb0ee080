//! Files that `bench store` reads in pieces.

use super::{ball, bench, files, refused};
use datasets::model::{Block, DataArray, Dataset, Points, PolyData, UnstructuredGrid, Values};
use datasets::write::{VtkOptions, write_vtk};
use serde_json::Value;

#[test]
fn pieces_of_stl_ply_obj_and_parallel_files_are_stored_one_after_the_other() {
    let dir = tempfile::tempdir().unwrap();
    let of = |name: &str| dir.path().join(name).display().to_string();
    let (mesh, stored) = (ball(), of("ball.rtmesh"));
    let store = |file: &str| -> Value {
        let made = bench(&["store", file, "-o", &stored, "--json"]);
        assert!(made.status.success(), "{file}: {}", String::from_utf8_lossy(&made.stderr));
        serde_json::from_slice(&made.stdout).unwrap()
    };
    let mut stl = vec![0; 80];
    stl.extend((mesh.num_triangles() as u32).to_le_bytes());
    for t in 0..mesh.num_triangles() {
        stl.extend([0; 12]);
        let corners: [glam::Vec3; 3] = mesh.triangle(t);
        stl.extend(corners.iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes));
        stl.extend([0; 2]);
    }
    std::fs::write(of("ball.stl"), &stl).unwrap();
    let said = store(&of("ball.stl"));
    assert_eq!((&said["triangles"], &said["attribute_bytes"]), (&1280.into(), &0.into()));
    let said = bench(&["store", &of("ball.stl"), "-o", &stored, "--normal-tolerance", "1"]);
    let text = String::from_utf8_lossy(&said.stderr).into_owned();
    assert!(text.contains("--normal-tolerance has no effect"), "{text}");
    // Cut, it is no binary file any more, and the reader of whole files says what is wrong.
    std::fs::write(of("cut.stl"), &stl[..5000]).unwrap();
    let cut = bench(&["store", &of("cut.stl"), "-o", &stored]);
    let text = String::from_utf8_lossy(&cut.stderr).into_owned();
    assert!(cut.status.code() == Some(1) && text.contains("cut.stl"), "{text}");

    files(dir.path());
    let said = store(&of("ball.ply"));
    assert_eq!(said["triangles"], 1280);
    assert!(said["attribute_bytes"].as_u64().unwrap() > 0, "{said}");

    let said = store(&of("ball.obj"));
    assert_eq!(said["triangles"], 1280);
    // Normals of its vertices, of which pieces say that they have no texture and no material.
    assert!(said["attribute_bytes"].as_u64().unwrap() > 0, "{said}");
    for option in ["--isovalue", "--array"] {
        let of_volume = ["store", &of("ball.stl"), "-o", &stored, option, "3"];
        refused(&of_volume, [option, "belongs to volumes"]);
    }
    std::fs::write(of("bad.obj"), "v 0 0 0\nv 1 0 0\nf 1 2 9\n").unwrap();
    let bad = of("bad.obj");
    refused(&["store", &bad, "-o", &stored], ["line 3", "`9` names no vertex"]);

    // Two halves, the second far from the first.
    let mut far = mesh.clone();
    far.positions.iter_mut().for_each(|p| p.x += 3.0);
    for (name, mesh) in [("a.vtp", &mesh), ("b.vtp", &far)] {
        let poly = Dataset::PolyData(PolyData::from_trimesh(mesh));
        write_vtk(dir.path().join(name), &poly, VtkOptions::default()).unwrap();
    }
    // A process without triangles writes an empty piece, here without the arrays of the others.
    let none = Dataset::PolyData(PolyData::default());
    write_vtk(dir.path().join("none.vtp"), &none, VtkOptions::default()).unwrap();
    let list = r#"<VTKFile type="PPolyData"><PPolyData><Piece Source="none.vtp"/>
        <Piece Source="a.vtp"/><Piece Source="b.vtp"/></PPolyData></VTKFile>"#;
    std::fs::write(of("both.pvtp"), list).unwrap();
    let made = bench(&["store", &of("both.pvtp"), "-o", &stored, "--color-by", "scalars"]);
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let said = store(&of("both.pvtp"));
    assert_eq!(said["triangles"], 2560);
    assert!(said["attribute_bytes"].as_u64().unwrap() > 0, "{said}");
}

#[test]
fn pieces_of_solid_cells_are_stored_one_by_one_with_the_surface_of_the_whole() {
    let dir = tempfile::tempdir().unwrap();
    let of = |name: &str| dir.path().join(name).display().to_string();
    // Two cubes that share a face, each with a copy of the other where `copies` says so, and then
    // a piece that has copies alone.
    let corner = |i: u32| [i % 3, i / 3 % 2, i / 6].map(f64::from);
    let cube = |x: u32| [0, 1, 4, 3, 6, 7, 10, 9].map(|i| i + x);
    let write_pieces = |copies: bool| {
        let of_piece = |own: u32| vec![(own, 0), (1 - own, 1)];
        let pieces =
            [("left.vtu", of_piece(0)), ("none.vtu", vec![(0, 1)]), ("right.vtu", of_piece(1))];
        for (name, mut cells) in pieces {
            cells.retain(|(_, ghost)| copies || *ghost == 0);
            let points = (0..12).map(corner).collect();
            let mut grid =
                UnstructuredGrid { points: Points::F64(points), ..UnstructuredGrid::default() };
            for (x, _) in &cells {
                grid.cells.push(cube(*x));
                grid.types.push(12);
            }
            if copies {
                let ghost = Values::U8(cells.iter().map(|(_, ghost)| *ghost).collect());
                grid.attributes.cell.push(DataArray::new("vtkGhostType", 1, ghost));
            }
            let grid = Dataset::UnstructuredGrid(grid);
            write_vtk(dir.path().join(name), &grid, VtkOptions::default()).unwrap();
        }
    };
    let list = r#"<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid><Piece Source="left.vtu"/>
        <Piece Source="none.vtu"/><Piece Source="right.vtu"/></PUnstructuredGrid></VTKFile>"#;
    std::fs::write(of("both.pvtu"), list).unwrap();
    for copies in [false, true] {
        write_pieces(copies);
        let made = bench(&["store", &of("both.pvtu"), "-o", &of("both.rtmesh"), "--json"]);
        let text = String::from_utf8_lossy(&made.stderr).into_owned();
        assert!(made.status.success(), "{text}");
        let said: Value = serde_json::from_slice(&made.stdout).unwrap();
        assert_eq!(said["triangles"], 20, "copies: {copies}");
        assert!(text.is_empty(), "{text}");
    }
    refused(
        &["store", &of("both.pvtu"), "-o", &of("both.rtmesh"), "--isovalue", "1"],
        ["--isovalue", "image data"],
    );
}

/// A cube of hexahedra with a value on each point.
fn cube_of_cells() -> Dataset {
    const EDGE: usize = 12;
    let n = EDGE + 1;
    let point = |i: usize| [i % n, i / n % n, i / (n * n)].map(|x| x as f64 * 0.1);
    let points: Vec<[f64; 3]> = (0..n * n * n).map(point).collect();
    let heat = points.iter().map(|[x, y, z]| (3.0 * x).sin() + y * z).collect();
    let mut grid = UnstructuredGrid { points: Points::F64(points), ..UnstructuredGrid::default() };
    grid.attributes.point.push(DataArray::new("heat", 1, Values::F64(heat)));
    grid.attributes.point_scalars = Some("heat".into());
    for cell in 0..EDGE * EDGE * EDGE {
        let low = cell % EDGE + n * (cell / EDGE % EDGE + n * (cell / (EDGE * EDGE)));
        let square = [low, low + 1, low + 1 + n, low + n];
        grid.cells.push(square.into_iter().chain(square.map(|k| k + n * n)).map(|k| k as u32));
        grid.types.push(12);
    }
    Dataset::UnstructuredGrid(grid)
}

#[test]
fn parts_of_one_file_have_the_surface_and_the_picture_of_the_whole() {
    let dir = tempfile::tempdir().unwrap();
    let of = |name: &str| dir.path().join(name).display().to_string();
    write_vtk(dir.path().join("cube.vtu"), &cube_of_cells(), VtkOptions::default()).unwrap();
    let store = |file: &str, out: &str, options: &[&str]| -> (Value, String) {
        let words = ["store", &of(file), "-o", &of(out), "--json"];
        let made = bench(&words.iter().chain(options).copied().collect::<Vec<_>>());
        let text = String::from_utf8_lossy(&made.stderr).into_owned();
        assert!(made.status.success(), "{text}");
        (serde_json::from_slice(&made.stdout).unwrap(), text)
    };
    let picture = |stored: &str| {
        let (file, image) = (of(stored), of("picture.png"));
        let words = ["render", &file, "-o", &image, "--size", "200x150"];
        let made = bench(&words);
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        std::fs::read(image).unwrap()
    };
    // With 1 MB, 1024 of its 1728 cells are read at once.
    let pictures = [("whole.rtmesh", "512"), ("parts.rtmesh", "1")].map(|(out, memory)| {
        let (said, text) = store("cube.vtu", out, &["--memory", memory]);
        assert_eq!((&said["triangles"], &*text), (&1728.into(), ""));
        assert!(said["attribute_bytes"].as_u64().unwrap() > 0, "{said}");
        picture(out)
    });
    assert!(pictures[0] == pictures[1], "the pictures differ");
    refused(
        &["store", &of("cube.vtu"), "-o", &of("no.rtmesh"), "--memory", "1", "--color-by", "cold"],
        ["cold", "heat"],
    );

    // Blocks are stored one by one; the first names the array, which the second does not have.
    let named = |name: &str, data: Dataset| Block { name: name.into(), data };
    let ball = Dataset::PolyData(PolyData::from_trimesh(&ball()));
    let blocks = vec![named("cube", cube_of_cells()), named("ball", ball)];
    let blocks = Dataset::MultiBlock(blocks);
    write_vtk(dir.path().join("both.vtm"), &blocks, VtkOptions::default()).unwrap();
    for memory in ["1", "512"] {
        let (said, text) = store("both.vtm", "both.rtmesh", &["--memory", memory]);
        assert_eq!(said["triangles"], 1728 + 1280);
        assert!(text.contains("blocks lack the array"), "{text}");
    }
    refused(
        &["store", &of("both.vtm"), "-o", &of("no.rtmesh"), "--color-by", "cold"],
        ["cold", "both"],
    );
}
