//! `composite demo`: its images over threads, simulated ranks and MPI, and the input it rejects.

use super::program::{peer, run};
use super::simulated_program;
use std::path::Path;

#[test]
fn demo_rejects_impossible_input_and_renders_unusual_input() {
    let folder = std::env::temp_dir().join(format!("composite-strange-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let file = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).expect("a file");
        path.to_str().expect("a path in UTF-8").to_owned()
    };
    let out = folder.to_str().expect("a path in UTF-8");
    let demo = |more: &[&str]| {
        let ran =
            run(&[&["demo", "--size", "40", "--frames", "1", "--out", out], more].concat(), &[]);
        (ran.code, ran.text)
    };
    let triangle = |a: &str| format!("v {a}\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 2 3 4\n");
    // ---- Unusual but rendered: more ranks than triangles, a corner with NaN, far from everything,
    // without any size.
    let (code, text) = demo(&["-n", "64", "--data", &file("few.obj", &triangle("0 0 0"))]);
    assert_eq!(code, Some(0), "{text}");
    assert!(!text.contains("-0.00"), "no time is less than nothing: {text}");
    let (code, text) = demo(&["-n", "3", "--data", &file("nan.obj", &triangle("nan 0 0"))]);
    assert!(code == Some(0) && text.contains("left out: 1 primitives"), "{text}");
    let huge = "v 1e30 0 0\nv -1e30 0 0\nv 0 1e30 0\nf 1 2 3\n";
    assert_eq!(demo(&["-n", "2", "--data", &file("huge.obj", huge)]).0, Some(0));
    let point = "v 5 5 5\nv 5 5 5\nv 5 5 5\nf 1 2 3\n";
    let (code, text) = demo(&["-n", "3", "--data", &file("point.obj", point)]);
    assert_eq!(code, Some(0), "{text}");
    // ---- Rejected, with the reason.
    let known = file("known.obj", &triangle("0 0 0"));
    let missing = folder.join("missing.vtp").to_str().expect("a path in UTF-8").to_owned();
    for (arguments, words) in [
        (vec!["-n", "3", "--data", &file("empty.obj", "")], "no vertices and no faces"),
        (vec!["-n", "3", "--data", &file("corner.obj", "v 1 2 3\n")], "holds no triangle"),
        (vec!["--data", &missing], "there is no file"),
        (vec!["--data", "wavelett"], "there are: wavelet"),
        (vec!["--data", &known, "--view", "inside"], "has no view `inside`"),
        (vec!["--data", &known, "--data-size", "1M"], "has no size `1M`"),
        (vec!["--scene", "discs", "--data", &known], "cannot be used with"),
        (vec!["--scene", "cubes"], "cubes"),
        (vec!["-n", "0"], "at least 1"),
        (vec!["-n", "5000"], "at most 4096"),
        (vec!["-n", "2,4"], "one number of ranks"),
    ] {
        let (code, text) = demo(&arguments);
        assert!(
            code == Some(2) && text.contains(words) && !text.contains("error: rank"),
            "{arguments:?}: {code:?} {text}"
        );
    }
    let nowhere = format!("{known}/below");
    let ran = run(&["demo", "--data", &known, "--size", "40", "--out", &nowhere], &[]);
    assert!(ran.code == Some(1) && ran.text.contains("cannot make the folder"), "{}", ran.text);
    std::fs::remove_dir_all(&folder).expect("the folder");
}

#[test]
fn demo_draws_a_bar_for_every_rank() {
    let folder = std::env::temp_dir().join(format!("composite-demo-{}", std::process::id()));
    let out = folder.to_str().expect("a path in UTF-8");
    let ran =
        run(&["demo", "-n", "5", "--size", "120", "--frames", "1", "--json", "--out", out], &[]);
    assert_eq!(ran.code, Some(0), "{}", ran.text);
    let shown: serde_json::Value =
        serde_json::from_str(ran.stdout.trim()).expect("one line of JSON");
    assert_eq!(shown["ranks"].as_array().map(Vec::len), Some(5));
    let plot = std::fs::read_to_string(folder.join("composite_demo.svg")).expect("the plot");
    let png = std::fs::read(folder.join("composite_demo.png")).expect("the image");
    std::fs::remove_dir_all(&folder).expect("the folder");
    for rank in 0..5 {
        assert!(plot.contains(&format!(">rank {rank}<")));
    }
    assert!(png.starts_with(b"\x89PNG"));
}

/// `composite demo` of this data set: its image and its output.
fn demo_of(data: &str, more: &[&str], variables: &[(&str, &Path)]) -> (Vec<u8>, serde_json::Value) {
    let name = format!("composite-demo-{}-{}", std::process::id(), more.join("").replace('-', "_"));
    let folder = std::env::temp_dir().join(name);
    let out = folder.to_str().expect("a path in UTF-8");
    let common = [
        "demo", "--data", data, "--grey", "--size", "160", "--frames", "2", "--json", "--out", out,
    ];
    let ran = run(&[&common, more].concat(), variables);
    assert_eq!(ran.code, Some(0), "{}", ran.text);
    let png = std::fs::read(folder.join("composite_demo.png")).expect("the image");
    std::fs::remove_dir_all(&folder).expect("the folder");
    (png, serde_json::from_str(ran.stdout.trim()).expect("one line of JSON"))
}

#[test]
fn a_file_rendered_in_parts_by_threads_models_and_mpi_ranks_is_the_image_of_one_rank() {
    let Some(mpirun) = peer("RTSV_MPIRUN") else { return };
    let file = std::env::temp_dir().join(format!("composite-part-{}.obj", std::process::id()));
    let mut obj = String::new();
    for k in 0..400 {
        let (x, y) = (f64::from(k % 20), f64::from(k / 20));
        let z = 3.0 * (0.9 * x).sin() * (0.7 * y).cos();
        obj += &format!("v {x} {y} {z}\nv {} {y} {z}\nv {x} {} {}\n", x + 1.4, y + 1.4, z + 0.6);
        obj += &format!("f {} {} {}\n", 3 * k + 1, 3 * k + 2, 3 * k + 3);
    }
    std::fs::write(&file, obj).expect("a file");
    let data = file.to_str().expect("a path in UTF-8");
    let (alone, one) = demo_of(data, &["--threads", "-n", "1"], &[]);
    let (parts, four) = demo_of(data, &["--mpi", "-n", "4"], &[("COMPOSITE_MPIRUN", &mpirun)]);
    let (headlight, _) = demo_of(data, &["--threads", "-n", "3", "--headlight"], &[]);
    for more in [&["--threads", "-n", "64"][..], &["--model", "-n", "8", "--cut-by-view"]] {
        let (others, _) = demo_of(data, more, &[]);
        assert!(alone == others, "{more:?}: the images differ");
    }
    if let Some(mpich) = peer("RTSV_MPIRUN_MPICH") {
        let (three, shown) = demo_of(data, &["--mpi", "-n", "3"], &[("COMPOSITE_MPIRUN", &mpich)]);
        assert!(
            alone == three && shown["transport"].as_str().is_some_and(|t| t.contains("MPICH")),
            "{shown}"
        );
    }
    std::fs::remove_file(&file).expect("the file");
    assert!(alone == parts, "the images differ");
    assert!(four["transport"].as_str().is_some_and(|t| t.contains("Open MPI")), "{four}");
    let triangles = |shown: &serde_json::Value| -> Vec<u64> {
        shown["ranks"]
            .as_array()
            .expect("ranks")
            .iter()
            .filter_map(|r| r["triangles"].as_u64())
            .collect()
    };
    assert_eq!(triangles(&one), [400]);
    assert_eq!(triangles(&four), [100; 4]);
    assert!(headlight != alone, "shadows are there");
}

/// Columns of a wavy sheet of quadrilaterals, as VTK writes them.
fn vtu_piece(first: usize, cells: usize) -> String {
    let (mut points, mut ids, mut heights) = (String::new(), String::new(), String::new());
    for j in 0..=8 {
        for i in 0..=cells {
            let (x, y) = ((first + i) as f64, f64::from(j));
            let z = 1.5 * (0.8 * x).sin() * (0.6 * y).cos();
            points += &format!("{x} {y} {z} ");
            heights += &format!("{z} ");
        }
    }
    for j in 0..8 {
        for i in 0..cells {
            let k = j * (cells + 1) + i;
            ids += &format!("{k} {} {} {} ", k + 1, k + cells + 2, k + cells + 1);
        }
    }
    let n = 8 * cells;
    let ends: String = (1..=n).map(|k| format!("{} ", 4 * k)).collect();
    format!(
        r#"<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian">
        <UnstructuredGrid><Piece NumberOfPoints="{}" NumberOfCells="{n}">
        <PointData><DataArray type="Float64" Name="height" format="ascii">{heights}</DataArray>
        </PointData>
        <Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">{points}</DataArray>
        </Points><Cells>
        <DataArray type="Int64" Name="connectivity" format="ascii">{ids}</DataArray>
        <DataArray type="Int64" Name="offsets" format="ascii">{ends}</DataArray>
        <DataArray type="UInt8" Name="types" format="ascii">{}</DataArray>
        </Cells></Piece></UnstructuredGrid></VTKFile>"#,
        9 * (cells + 1),
        "9 ".repeat(n)
    )
}

/// Layers of a lattice.
fn vti_piece(first: usize, end: usize) -> String {
    let mut values = String::new();
    for k in 0..=12 {
        for j in 0..=14 {
            for i in first..=end {
                let [x, y, z] = [i, j, k].map(|c| 0.45 * c as f64);
                values += &format!("{} ", x.sin() * y.cos() + z.sin());
            }
        }
    }
    format!(
        r#"<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian">
        <ImageData WholeExtent="0 20 0 14 0 12" Origin="1 0 0" Spacing="0.5 0.5 0.5">
        <Piece Extent="{first} {end} 0 14 0 12"><PointData>
        <DataArray type="Float32" Name="rho" format="ascii">{values}</DataArray>
        </PointData></Piece></ImageData></VTKFile>"#
    )
}

#[test]
fn pieces_that_ranks_read_by_themselves_give_one_picture_over_every_transport() {
    let folder = std::env::temp_dir().join(format!("composite-pieces-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).expect("a file");
        path.to_str().expect("a path in UTF-8").to_owned()
    };
    for k in 0..5 {
        write(&format!("sheet{k}.vtu"), &vtu_piece(4 * k, 4));
        write(&format!("rho{k}.vti"), &vti_piece(4 * k, 4 * k + 4));
    }
    let list = |kind: &str, ending: &str, more: &str| {
        let piece = |k: usize| match kind {
            "ImageData" => format!(
                r#"<Piece Extent="{} {} 0 14 0 12" Source="rho{k}.vti"/>"#,
                4 * k,
                4 * k + 4
            ),
            _ => format!(r#"<Piece Source="sheet{k}.vtu"/>"#),
        };
        let pieces: String = (0..5).map(piece).collect();
        write(
            &format!("all.{ending}"),
            &format!(
                r#"<VTKFile type="P{kind}" version="1.0"><P{kind} {more}>{pieces}</P{kind}></VTKFile>"#
            ),
        )
    };
    let lattice = r#"WholeExtent="0 20 0 14 0 12" Origin="1 0 0" Spacing="0.5 0.5 0.5""#;
    let blocks: String =
        (0..5).map(|k| format!(r#"<DataSet index="{k}" file="sheet{k}.vtu"/>"#)).collect();
    let (pvtu, pvti) = (list("UnstructuredGrid", "pvtu", ""), list("ImageData", "pvti", lattice));
    let vtm = write(
        "all.vtm",
        &format!(
            "<VTKFile type=\"vtkMultiBlockDataSet\" version=\"1.0\"><vtkMultiBlockDataSet>{blocks}\
             </vtkMultiBlockDataSet></VTKFile>"
        ),
    );
    let picture = |file: &str, more: &[&str], variables: &[(&str, &Path)]| {
        let out = folder.join("out.png");
        let path = out.to_str().expect("a path in UTF-8");
        let common = ["demo", file, "--size", "120", "--frames", "1", "--json", "-o", path];
        let ran = run(&[&common, more].concat(), variables);
        assert_eq!(ran.code, Some(0), "{}", ran.text);
        let shown: serde_json::Value =
            serde_json::from_str(ran.stdout.trim()).expect("one line of JSON");
        assert!(folder.join("out.svg").is_file(), "the plot lies beside the image");
        (std::fs::read(&out).expect("the image"), shown)
    };
    for (file, more) in [
        (&pvtu, &["--grey"][..]),
        (&pvtu, &["--array", "height"]),
        (&vtm, &["--grey"]),
        (&pvti, &[]),
        (&pvti, &["--array", "rho", "--headlight"]),
    ] {
        let (one, alone) = picture(file, &[&["--threads", "-n", "1"], more].concat(), &[]);
        assert_eq!(alone["ranks"][0]["files"].as_u64(), Some(5), "{alone}");
        let (three, shown) = picture(file, &[&["--threads", "-n", "3"], more].concat(), &[]);
        assert!(one == three, "{file} {more:?}: the images differ");
        let of_ranks = |key: &str| -> Vec<u64> {
            let ranks = shown["ranks"].as_array().expect("ranks");
            ranks.iter().filter_map(|r| r[key].as_u64()).collect()
        };
        assert_eq!(of_ranks("files"), [1, 2, 2], "{shown}");
        assert!(of_ranks("bytes_received").iter().sum::<u64>() > 0, "{shown}");
        // More ranks than files: some have nothing.
        let (eight, _) = picture(file, &[&["--threads", "-n", "8"], more].concat(), &[]);
        assert!(one == eight, "{file} {more:?}: the images differ");
        for (variable, name) in [("RTSV_MPIRUN", "Open MPI"), ("RTSV_MPIRUN_MPICH", "MPICH")] {
            let Some(mpirun) = peer(variable) else { continue };
            let launcher = [("COMPOSITE_MPIRUN", mpirun.as_path())];
            let (over_mpi, shown) =
                picture(file, &[&["--mpi", "-n", "3"], more].concat(), &launcher);
            assert!(shown["transport"].as_str().is_some_and(|t| t.contains(name)), "{shown}");
            assert!(one == over_mpi, "{file} {more:?} over {name}: the images differ");
        }
        if peer("RTSV_SMPIRUN").is_some() {
            let library = simulated_program();
            let variables: Vec<(&str, &Path)> =
                library.iter().map(|(name, path)| (*name, path.as_path())).collect();
            let simulated = [&["--smpi", "-n", "16"], more].concat();
            let (sixteen, shown) = picture(file, &simulated, &variables);
            assert_eq!(shown["ranks"].as_array().map(Vec::len), Some(16), "{shown}");
            assert!(one == sixteen, "{file} {more:?} on 16 ranks of SMPI: the images differ");
        }
    }
    // ---- Errors name the rank and the file.
    write("sheet4.vtu", "<VTKFile");
    let ran = run(&["demo", &pvtu, "-n", "3", "--threads", "--size", "40"], &[]);
    assert!(
        ran.code == Some(1) && ran.text.contains("rank 2 gives") && ran.text.contains("sheet4.vtu"),
        "{}",
        ran.text
    );
    for (arguments, words) in [
        (vec![pvtu.as_str(), "--view", "front"], "has no other view"),
        (vec![pvtu.as_str(), "--cut-by-view"], "has no cut by view"),
    ] {
        let ran = run(&[&["demo"][..], &arguments].concat(), &[]);
        assert!(ran.code == Some(2) && ran.text.contains(words), "{arguments:?}: {}", ran.text);
    }
    std::fs::remove_dir_all(&folder).expect("the folder");
}
