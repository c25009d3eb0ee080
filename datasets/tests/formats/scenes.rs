//! Scenes: OBJ and glTF files.

use super::{opened, sample_files, scene};
use datasets::read::{AlphaMode, LoadedFile, open};
use glam::DVec3;

/// The error of a file with this content.
fn refused(name: &str, bytes: &[u8]) -> String {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    let error = anyhow::Error::from(open(&path).expect_err("a file that is refused"));
    format!("{error:#}")
}

#[test]
fn obj_concave_faces_materials_and_far_coordinates() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("m.mtl"), "newmtl red\nKd 1 0 0\nd 0.5\nNs 98\nNi 1.33\n")
        .unwrap();
    let obj = sample_files::OBJ
        .replace("none.mtl", "m.mtl")
        .replace("v 2 2 0 0 0 1", "v 6000002.001 2 0 0 0 1");
    std::fs::write(dir.path().join("a.obj"), obj).unwrap();
    let s = scene(open(dir.path().join("a.obj")).unwrap());
    let m = &s.materials[s.meshes[0].material.unwrap()];
    assert_eq!((m.base_color, m.ior), ([1.0, 0.0, 0.0, 0.5], 1.33));
    assert!((m.roughness - 0.02f32.powf(0.25)).abs() < 1e-6);

    // The five corners form an arrow head. A fan would cover area outside its inner corner: area 3.
    let o = opened("b.obj", sample_files::OBJ.as_bytes());
    assert!(
        o.warnings.iter().any(|w| w.contains("none.mtl"))
            && o.warnings.iter().any(|w| w.contains("lines")),
        "{:?}",
        o.warnings
    );
    let s = scene(o);
    let mesh = &s.meshes[0].mesh;
    let areas: Vec<f32> = (0..mesh.num_triangles())
        .map(|i| mesh.triangle(i))
        .map(|[a, b, c]| 0.5 * (b - a).cross(c - a).z)
        .collect();
    assert!(
        areas.iter().all(|&a| a >= 0.0) && (areas.iter().sum::<f32>() - 2.5).abs() < 1e-6,
        "{areas:?}"
    );
    assert!(mesh.normals.is_some() && mesh.texcoords.is_some() && mesh.colors.is_some());

    // Millimetres at a distance of six thousand kilometres.
    let far = "v 6000000.001 0 0\nv 6000000.002 0 0\nv 6000000.001 0.001 0\nf 1 2 3\n";
    let mesh = scene(opened("c.obj", far.as_bytes())).meshes.remove(0).mesh;
    let [a, b, _] = mesh.triangle(0).map(|p| p.as_dvec3());
    assert!((b.x - a.x - 0.001).abs() < 1e-9, "{}", b.x - a.x);
}

#[test]
fn obj_text_in_other_encodings_keeps_its_vertices() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 9 9 9\nf 1 2 \\\n 3\n";
    let utf_16 = |unit: fn(u16) -> [u8; 2], mark: [u8; 2]| {
        [mark.to_vec(), text.encode_utf16().flat_map(unit).collect()].concat()
    };
    for bytes in [
        text.as_bytes().to_vec(),
        ["\u{feff}".as_bytes(), text.as_bytes()].concat(),
        utf_16(u16::to_le_bytes, [0xff, 0xfe]),
        utf_16(u16::to_be_bytes, [0xfe, 0xff]),
        [b"# f\xfcr\n", text.as_bytes()].concat(),
    ] {
        let mesh = scene(opened("a.obj", &bytes)).meshes.remove(0).mesh;
        let corners = mesh.triangle(0).map(|p| mesh.origin + p.as_dvec3());
        assert_eq!(corners, [DVec3::ZERO, DVec3::X, DVec3::Y], "{bytes:?}");
    }
}

#[test]
fn obj_materials_that_the_format_allows_are_read_and_others_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(dir.path().join(name), bytes).unwrap();
    write("gr\u{fc}n.mtl", b"newmtl gr\xfcn\nKd 0.5\nKs 0\nTr 0.25\nKe red\nillum 2\n");
    write("b c.mtl", b"newmtl b\nKd 0 0 1\n");
    write(
        "a.obj",
        b"mtllib gr\xfcn.mtl\nmtllib b c.mtl\nv 0 0 0\nv 1 0 0 # right\nv 0 1 0 1 0 0\n\
          usemtl gr\xfcn\nf 1 2 3\nusemtl b\nf 3 2 1\nusemtl\nf 1 3 2\n",
    );
    let file = open(dir.path().join("a.obj")).unwrap();
    let told = |what: &str| file.warnings.iter().any(|w| w.contains(what));
    assert!(told("line 5: `Ke red` left out"), "{:?}", file.warnings);
    assert!(told("colours left out: 1 of 3 vertices have one"), "{:?}", file.warnings);
    assert_eq!(file.warnings.len(), 2, "{:?}", file.warnings);
    let s = scene(file);
    let colors: Vec<_> =
        s.meshes.iter().map(|m| m.material.map(|k| s.materials[k].base_color)).collect();
    assert_eq!(
        colors,
        [Some([0.5, 0.5, 0.5, 0.75]), Some([0.0, 0.0, 1.0, 1.0]), None],
        "one number stands for three"
    );
}

#[test]
fn obj_errors_name_the_line_and_files_without_faces_are_not_silent() {
    for (text, named) in [
        ("v 0 0 0\nv 0,5 0 0\n", "in line 2: `0,5` is not a number"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 9\n", "in line 5: `9` names number 9 of 3"),
        ("solid of another kind\n", "no vertices and no faces"),
        ("", "no vertices and no faces"),
    ] {
        let error = refused("a.obj", text.as_bytes());
        assert!(error.contains(named), "{error}");
    }
    let points = opened("a.obj", b"v 0 0 0\nv 1 0 0\n");
    assert_eq!(points.warnings, ["no faces: 2 vertices left out"]);
}

#[test]
fn pointers_of_git_lfs_are_named() {
    let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 5\n";
    for name in ["a.obj", "a.vtu", "a.stl", "a.unknown"] {
        let error = refused(name, pointer);
        assert!(error.contains("git lfs pull"), "{name}: {error}");
    }
}

#[test]
fn gltf_of_version_1_and_packed_meshes_are_named_and_bounds_may_be_missing() {
    let text = String::from_utf8(sample_files::gltf()).unwrap();
    let mut json: serde_json::Value = serde_json::from_str(&text).unwrap();
    for accessor in json["accessors"].as_array_mut().unwrap() {
        accessor.as_object_mut().unwrap().retain(|key, _| key != "min" && key != "max");
    }
    assert_eq!(scene(opened("a.gltf", json.to_string().as_bytes())).meshes.len(), 2);
    for accessor in json["accessors"].as_array_mut().unwrap() {
        accessor.as_object_mut().unwrap().retain(|key, _| key != "count");
    }
    assert!(refused("a.gltf", json.to_string().as_bytes()).contains("count"));

    let old = br#"{"asset": {"version": "1.0"}, "meshes": {"a": {}}}"#;
    let old_binary = b"glTF\x01\0\0\0\x20\0\0\0\x0c\0\0\0\0\0\0\0{          }";
    let packed = br#"{"asset": {"version": "2.0"}, "accessors": [{"componentType": 5126,
        "count": 3, "type": "VEC3"}], "extensionsRequired": ["KHR_draco_mesh_compression"],
        "extensionsUsed": ["KHR_draco_mesh_compression"]}"#;
    for (name, bytes, named) in [
        ("a.gltf", &old[..], "glTF 1.0; convert it"),
        ("a.glb", old_binary, "glTF 1.0; convert it"),
        ("a.gltf", packed, "meshes packed by KHR_draco_mesh_compression"),
    ] {
        let error = refused(name, bytes);
        assert!(error.contains(named), "{error}");
    }
}

/// A glTF file of one triangle with the positions of accessor 0, accessors and views as given, and
/// a buffer.
fn triangle(more: &str, mesh: &str, accessors: &str, views: &str, data: &[u8]) -> Vec<u8> {
    let (bytes, text) = (data.len(), base64::encode(data));
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}]{more},
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}{mesh}}}],"weights":[0.5,0]}}],
"accessors":[{accessors}],"bufferViews":[{views}],
"buffers":[{{"byteLength":{bytes},"uri":"data:application/octet-stream;base64,{text}"}}]}}"#
    )
    .into_bytes()
}

fn corners(file: Vec<u8>) -> [DVec3; 3] {
    let mesh = scene(opened("a.gltf", &file)).meshes.remove(0).mesh;
    mesh.triangle(0).map(|p| mesh.origin + p.as_dvec3())
}

#[test]
fn gltf_sparse_accessors_replace_elements_of_a_view_or_zeros() {
    let floats: Vec<u8> = [0f32, 0., 0., 1., 0., 0., 0., 1., 0., 5., 6., 7.]
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    let data = [&floats[..], &[1, 0]].concat();
    let views = r#"{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":12},
                   {"buffer":0,"byteOffset":48,"byteLength":2}"#;
    let accessor = |view: &str, number: &str| {
        format!(
            r#"{{{view}"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[9,9,9],
"sparse":{{"count":1,"indices":{{"bufferView":2,"byteOffset":{number},"componentType":5121}},
"values":{{"bufferView":1}}}}}}"#
        )
    };
    let file = |view, number| triangle("", "", &accessor(view, number), views, &data);
    let new = DVec3::new(5.0, 6.0, 7.0);
    assert_eq!(corners(file(r#""bufferView":0,"#, "0")), [DVec3::ZERO, new, DVec3::Y]);
    assert_eq!(corners(file(r#""bufferView":0,"#, "1")), [new, DVec3::X, DVec3::Y]);
    assert_eq!(corners(file("", "0")), [DVec3::ZERO, new, DVec3::ZERO]);
    let far = [&floats[..], &[3, 0]].concat();
    let file = triangle("", "", &accessor("", "0"), views, &far);
    assert!(refused("a.gltf", &file).contains("a sparse value for element 3 of 3"));
    let many = accessor("", "0").replace("\"count\":3", "\"count\":4000000000");
    assert!(refused("a.gltf", &triangle("", "", &many, views, &data)).contains("without data"));
}

#[test]
fn gltf_quantised_positions_are_read_also_where_they_are_required() {
    let numbers = [0_i16, 0, 0, 0, 32767, 0, 0, 0, 0, 32767, 0, 0];
    let data: Vec<u8> = numbers.iter().flat_map(|v| v.to_le_bytes()).collect();
    let accessor = r#"{"bufferView":0,"componentType":5122,"normalized":true,"count":3,
                       "type":"VEC3","min":[0,0,0],"max":[32767,32767,0]}"#;
    let view = r#"{"buffer":0,"byteLength":24,"byteStride":8}"#;
    let required = |name: &str| {
        let more = format!(r#","extensionsRequired":["{name}"],"extensionsUsed":["{name}"]"#);
        triangle(&more, "", accessor, view, &data)
    };
    let expected = [DVec3::ZERO, DVec3::X, DVec3::Y];
    assert_eq!(corners(required("KHR_mesh_quantization")), expected);
    let unlit = opened("a.gltf", &required("KHR_materials_unlit"));
    assert_eq!(unlit.warnings, ["extensions that are not read: KHR_materials_unlit"]);
    assert!(refused("a.gltf", &required("EXT_of_another")).contains("Unsupported"));
}

#[test]
fn gltf_morph_targets_have_the_weights_of_the_file() {
    let floats = [0f32, 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 2., 0., 0., 4., 0., 0., 0.];
    let data: Vec<u8> = floats.iter().flat_map(|v| v.to_le_bytes()).collect();
    let accessor = |view: u8| {
        format!(
            r#"{{"bufferView":{view},"componentType":5126,"count":3,"type":"VEC3",
"min":[0,0,0],"max":[9,9,9]}}"#
        )
    };
    let accessors = [accessor(0), accessor(1)].join(",");
    let views = r#"{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":36}"#;
    let targets = r#","targets":[{"POSITION":1},{"POSITION":1}]"#;
    let file = triangle("", targets, &accessors, views, &data);
    assert_eq!(corners(file), [DVec3::Z, DVec3::new(1.0, 0.0, 2.0), DVec3::Y]);
}

#[test]
fn gltf_transforms_turn_mirrored_triangles_back() {
    for (name, bytes) in [("a.gltf", sample_files::gltf()), ("a.glb", sample_files::glb())] {
        let s = scene(opened(name, &bytes));
        assert_eq!(s.meshes.len(), 2, "{name}");
        let m = &s.materials[0];
        assert_eq!((m.base_color, m.metallic, m.roughness), ([0.5, 0.25, 1.0, 1.0], 0.75, 0.5));
        let world = |k: usize| {
            let mesh = &s.meshes[k].mesh;
            mesh.triangle(0).map(|p| mesh.origin + p.as_dvec3())
        };
        assert_eq!(world(0)[0], DVec3::new(10.0, 0.0, 0.0));
        let [a, b, c] = world(1);
        assert!(
            [a, b, c].contains(&DVec3::new(8.0, 0.0, 0.0)),
            "scaled by -2, then moved: {a} {b} {c}"
        );
        assert!((b - a).cross(c - a).z > 0.0, "still seen from +z");
        assert_eq!(s.meshes[0].mesh.colors.as_ref().unwrap().values[1], [0.0, 1.0, 0.0, 1.0]);
    }
}

/// A triangle with every kind of texture; `alpha` is the material's alpha mode.
fn gltf_with_textures(dir: &std::path::Path, alpha: serde_json::Value) -> LoadedFile {
    let mut bytes: Vec<u8> = Vec::new();
    let mut floats = |values: &[f32]| values.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    floats(&[-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 1.0, 1.0, 0.0]);
    floats(&[0.0, 1.0, 1.0, 1.0, 1.0, 0.0]);
    floats(&[1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0]);
    std::fs::write(dir.join("a.bin"), &bytes).unwrap();
    for (name, texel) in [
        ("color", [255, 0, 0, 100]),
        ("rough", [10, 20, 30, 255]),
        ("normal", [128, 128, 255, 255]),
    ] {
        ::image::RgbaImage::from_pixel(2, 1, ::image::Rgba(texel))
            .save(dir.join(name).with_extension("png"))
            .unwrap();
    }
    let mut json = serde_json::json!({
        "asset": {"version": "2.0"}, "extensionsUsed": ["KHR_materials_sheen"], "scenes": [{"nodes": [0]}], "scene": 0,
        "nodes": [{"mesh": 0, "scale": [-1.0, 1.0, 1.0]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1, "TANGENT": 2}, "material": 0}]}],
        "buffers": [{"uri": "a.bin", "byteLength": bytes.len()}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 24}, {"buffer": 0, "byteOffset": 60, "byteLength": 48}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [-1, -1, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC4"}],
        "images": [{"uri": "color.png"}, {"uri": "rough.png"}, {"uri": "normal.png"}, {"uri": "gone.png"}],
        "samplers": [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}],
        "textures": [{"source": 0, "sampler": 0}, {"source": 1}, {"source": 2}, {"source": 3}],
        "materials": [{
            "name": "all",
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1}},
            "normalTexture": {"index": 2, "scale": 0.5}, "occlusionTexture": {"index": 1, "strength": 0.25},
            "emissiveTexture": {"index": 3}, "emissiveFactor": [1, 1, 1]}]
    });
    for (key, value) in alpha.as_object().unwrap() {
        json["materials"][0][key] = value.clone();
    }
    let path = dir.join("a.gltf");
    std::fs::write(&path, json.to_string()).unwrap();
    open(&path).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn gltf_materials_have_all_their_textures_and_samplers() {
    use rt_core::texture::{Filter, Wrap};
    let dir = tempfile::tempdir().unwrap();
    let o = gltf_with_textures(
        dir.path(),
        serde_json::json!({"alphaMode": "MASK", "alphaCutoff": 0.25}),
    );
    let warnings = o.warnings.clone();
    let s = scene(o);
    let m = &s.materials[0];
    assert_eq!((m.alpha, m.normal_scale, m.occlusion_strength), (AlphaMode::Mask(0.25), 0.5, 0.25));
    assert_eq!(m.metallic_roughness_texture, m.occlusion_texture, "read once");
    let texture = |index: Option<usize>| &s.textures[index.unwrap()];
    let color = texture(m.base_color_texture);
    assert_eq!(
        (color.wrap, color.filter, color.rgba8[1]),
        ([Wrap::Clamp, Wrap::Mirror], Filter::Nearest, [255, 0, 0, 100])
    );
    let rough = texture(m.metallic_roughness_texture);
    assert_eq!(
        (rough.wrap, rough.filter, rough.rgba8[0]),
        ([Wrap::Repeat; 2], Filter::Bilinear, [10, 20, 30, 255])
    );
    assert_eq!(texture(m.normal_texture).rgba8[0], [128, 128, 255, 255]);
    assert_eq!(m.emissive_texture, None);
    let told = |what: &str| warnings.iter().any(|w| w.contains(what));
    assert!(warnings.len() == 2 && told("gone.png") && told("KHR_materials_sheen"), "{warnings:?}");
    // The reflection transforms tangents and reverses the handedness of their frame.
    assert_eq!(
        s.meshes[0].mesh.tangents.as_ref().unwrap()[0],
        glam::Vec4::new(-1.0, 0.0, 0.0, -1.0)
    );
    let o = gltf_with_textures(dir.path(), serde_json::json!({}));
    assert_eq!(scene(o).materials[0].alpha, AlphaMode::Opaque);
}
