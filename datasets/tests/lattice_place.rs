//! The place of a lattice that a file does not say.

use datasets::model::Dataset;
use datasets::read::{OpenOptions, open_with};

/// Files that do not say where their lattice is take it from the options; files that do refuse.
#[test]
fn raw_nrrd_and_metaimage_without_a_place_take_one() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, head: &str| {
        let mut bytes = head.as_bytes().to_vec();
        bytes.extend([7u8; 27]);
        std::fs::write(dir.path().join(name), bytes).unwrap();
        dir.path().join(name)
    };
    let nrrd = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 3 3 3\nencoding: raw\n";
    let mhd = "ObjectType = Image\nNDims = 3\nDimSize = 3 3 3\nElementType = MET_UCHAR\n";
    let data = "ElementDataFile = LOCAL\n";
    let place = OpenOptions {
        spacing: Some([0.1, 0.2, 0.3]),
        origin: Some([1.0, 2.0, 3.0]),
        ..OpenOptions::default()
    };
    for (name, head, refused) in [
        ("a_3x3x3_uint8.raw", String::new(), false),
        ("a.nrrd", format!("{nrrd}\n"), false),
        ("b.nrrd", format!("{nrrd}spacings: 1 1 2\n\n"), true),
        ("a.mha", format!("{mhd}{data}"), false),
        ("b.mha", format!("{mhd}ElementSpacing = 1 1 2\n{data}"), true),
    ] {
        let path = write(name, &head);
        let opened = open_with(&path, &place);
        if refused {
            let text = opened.unwrap_err().to_string();
            assert!(text.contains("`spacing`") && text.contains("own coordinates"), "{text}");
            continue;
        }
        let opened = opened.unwrap_or_else(|e| panic!("{name}: {e}"));
        let Dataset::ImageData(image) = opened.dataset().unwrap() else { panic!("{name}") };
        assert_eq!(image.point(2, 1, 1), glam::DVec3::new(1.2, 2.2, 3.3), "{name}");
    }
    let wrong = OpenOptions { spacing: Some([0.1, 0.0, 0.1]), ..OpenOptions::default() };
    let text = open_with(dir.path().join("a_3x3x3_uint8.raw"), &wrong).unwrap_err().to_string();
    assert!(text.contains("above 0"), "{text}");
}
