//! Files that h5py wrote (`tests/files/make.py`), in the oldest and the newest form.

use super::*;

fn open(name: &str) -> Hdf5File {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files").join(name);
    Hdf5File::open(&path, FORMAT).unwrap_or_else(|e| panic!("{e}"))
}

/// In every dataset, element `i` is `i % 100`, counted with the last axis fastest.
fn check(object: &Object<'_>) {
    let values = object.values().unwrap_or_else(|f| panic!("{f:?}"));
    let count: u64 = object.shape().unwrap().iter().product();
    assert_eq!(values.len() as u64, count, "{}", object.path);
    for i in 0..values.len() {
        assert_eq!(values.get_f64(i), (i % 100) as f64, "{} at {i}", object.path);
    }
}

const FILES: [&str; 2] = ["old.h5", "new.h5"];

#[test]
fn every_layout_of_h5py_in_the_oldest_and_newest_form() {
    for (name, expected) in FILES.into_iter().zip([9, 13]) {
        let file = open(name);
        let children = file.root().unwrap().children(&mut Vec::new()).unwrap();
        let datasets: Vec<_> = children.into_iter().filter(|c| c.1.is_dataset()).collect();
        assert_eq!(datasets.len(), expected, "{name}");
        datasets.iter().for_each(|(_, d)| check(d));
    }
}

#[test]
fn boxes_of_chunks_and_of_contiguous_values() {
    for name in FILES {
        let file = open(name);
        for path in ["chunked", "contiguous", "filtered"] {
            let d = file.root().unwrap().find(path).unwrap().unwrap();
            let [rows, columns] = d.shape().unwrap()[..] else { panic!("{path}") };
            for (start, count) in
                [([0, 0], [rows, columns]), ([1, 2], [2, 3]), ([rows - 1, 0], [1, columns])]
            {
                let values = d.values_in(&start, &count).unwrap();
                let cell = |i: u64| (start[0] + i / count[1]) * columns + start[1] + i % count[1];
                for i in 0..count[0] * count[1] {
                    assert_eq!(values.get_f64(i as usize), (cell(i) % 100) as f64, "{path} {i}");
                }
            }
            let beyond = d.values_in(&[1, 0], &[rows, columns]).unwrap_err();
            assert!(beyond.what.contains("values from [1, 0]"), "{beyond:?}");
        }
    }
}

#[test]
fn groups_links_attributes_and_texts() {
    for name in FILES {
        let file = open(name);
        for count in [3, 20] {
            let group = file.root().unwrap().find(&format!("group of {count}")).unwrap().unwrap();
            assert_eq!(group.names().unwrap().len(), count, "{name}");
            assert_eq!(group.attributes().unwrap().len(), count, "{name}");
            let last = count - 1;
            let value = group.numbers(&format!("attribute {last}")).unwrap().unwrap();
            assert_eq!(value, [last as f64, 0.5]);
            check(&group.get(&format!("member {last}")).unwrap());
        }
        let texts = file.root().unwrap().find("group of 3").unwrap().unwrap();
        check(&file.root().unwrap().find("soft/member 1").unwrap().unwrap());
        assert_eq!(file.root().unwrap().find("soft/no such").unwrap().map(|o| o.path), None);
        let error = texts.get("no such").unwrap_err();
        assert!(error.what.contains("`member 0`"), "{error:?}");
        let t = file.root().unwrap().find("texts").unwrap().unwrap();
        assert_eq!(t.text("fixed").unwrap().as_deref(), Some("m/s"));
        assert_eq!(t.text("variable").unwrap().as_deref(), Some("ümlaut"));
        let Some(Data::Texts(list)) = t.attribute("list").unwrap() else { panic!() };
        assert_eq!(list, ["a", "", "bc"]);
        let external = file.root().unwrap().find("elsewhere/x").unwrap_err();
        assert!(external.what.contains("other.h5"), "{external:?}");
    }
}

#[test]
fn what_is_not_read_is_refused_by_name() {
    let file = open("new.h5");
    let refused = file.root().unwrap().find("refused").unwrap().unwrap();
    for (name, word) in
        [("lzf", "lzf"), ("compound", "compound"), ("virtual", "virtual"), ("half", "floats")]
    {
        let fault = refused.get(name).unwrap().values().unwrap_err();
        assert!(fault.what.contains(word), "{fault:?}");
        assert_eq!(fault.kind, crate::read::error::FaultKind::Unsupported, "{fault:?}");
    }
}

/// Reads everything in a file; faults are allowed, panics and hangs are not.
fn read_all(object: &Object<'_>, depth: usize) -> Result<(), Fault> {
    let _ = object.attributes();
    if object.is_dataset() {
        let _ = object.read();
    } else if depth < 4 {
        for (_, child) in object.children(&mut Vec::new())? {
            let _ = read_all(&child, depth + 1);
        }
    }
    Ok(())
}

#[test]
fn every_damaged_byte_ends_in_values_or_in_a_fault() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("damaged.h5");
    for name in FILES {
        let whole = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files").join(name);
        let whole = std::fs::read(whole).unwrap();
        let mut random = rt_core::math::SplitMix64::new(7);
        for _ in 0..400 {
            let mut bytes = whole.clone();
            for _ in 0..1 + random.bits() % 3 {
                let at = (random.bits() % bytes.len() as u64) as usize;
                let new = [0, 1, 0xff, random.bits() as u8][(random.bits() % 4) as usize];
                let end = (at + 1 + (random.bits() % 8) as usize).min(bytes.len());
                bytes[at..end].fill(new);
            }
            if random.bits().is_multiple_of(4) {
                bytes.truncate((random.bits() % bytes.len() as u64) as usize);
            }
            std::fs::write(&path, bytes).unwrap();
            if let Ok(file) = Hdf5File::open(&path, FORMAT)
                && let Ok(root) = file.root()
            {
                let _ = read_all(&root, 0);
            }
        }
    }
}
