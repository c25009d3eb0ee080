//! A plotfile of AMReX with two levels.

use std::path::Path;

const NATIVE: &str = "((8, (64 11 52 0 1 12 0 1023)),(8, (8 7 6 5 4 3 2 1)))";

/// Name within the folder, and content. 4 x 2 x 2 cells of the size 0.5 from (1, 0, 0) on, in two
/// boxes of which the second has a ghost cell around it; on the second level 4 x 2 x 2 cells of the
/// size 0.25 over two cells of the first box. `rho` is x of the centre, `T` is 300 + level.
pub(crate) fn plotfile() -> Vec<(String, Vec<u8>)> {
    let header = "HyperCLaw-V1.1\n2\nrho\nT\n3\n0.125\n1\n1 0 0\n3 1 1\n2\n\
        ((0,0,0) (3,1,1) (0,0,0)) ((0,0,0) (7,3,3) (0,0,0))\n3 3\n0.5 0.5 0.5\n0.25 0.25 0.25\n\
        0\n0\n0 2 0.125\n3\n1 2\n0 1\n0 1\n2 3\n0 1\n0 1\nLevel_0/Cell\n\
        1 1 0.125\n3\n1 2\n0 0.5\n0 0.5\nLevel_1/Cell\n";
    let box_line = |low: [i64; 3], high: [i64; 3]| {
        let t = |v: [i64; 3]| format!("({},{},{})", v[0], v[1], v[2]);
        format!("({} {} (0,0,0))", t(low), t(high))
    };
    let fab = |low: [i64; 3], high: [i64; 3], size: f64, t: f64| {
        let mut out = format!("FAB {NATIVE}{} 2\n", box_line(low, high)).into_bytes();
        for variable in 0..2 {
            for _ in low[2]..=high[2] {
                for _ in low[1]..=high[1] {
                    for i in low[0]..=high[0] {
                        let x = 1.0 + size * (i as f64 + 0.5);
                        let value: f64 = if variable == 0 { x } else { t };
                        out.extend(value.to_le_bytes());
                    }
                }
            }
        }
        out
    };
    let first = fab([0, 0, 0], [1, 1, 1], 0.5, 300.0);
    let second = fab([1, -1, -1], [4, 2, 2], 0.5, 300.0);
    let list = |boxes: &[([i64; 3], [i64; 3])], offsets: &[usize]| {
        let mut text = format!("1\n1\n2\n0\n({} 0\n", boxes.len());
        boxes.iter().for_each(|b| text += &format!("{}\n", box_line(b.0, b.1)));
        text += &format!(")\n{}\n", boxes.len());
        offsets.iter().for_each(|o| text += &format!("FabOnDisk: Cell_D_00000 {o}\n"));
        text.into_bytes()
    };
    let boxes = [([0, 0, 0], [1, 1, 1]), ([2, 0, 0], [3, 1, 1])];
    let fine = ([0, 0, 0], [3, 1, 1]);
    vec![
        ("Header".into(), header.into()),
        ("Level_0/Cell_H".into(), list(&boxes, &[0, first.len()])),
        ("Level_0/Cell_D_00000".into(), [first, second].concat()),
        ("Level_1/Cell_H".into(), list(&[fine], &[0])),
        ("Level_1/Cell_D_00000".into(), fab(fine.0, fine.1, 0.25, 301.0)),
    ]
}

/// Writes the files into a folder.
pub(crate) fn write(folder: &Path, files: &[(String, Vec<u8>)]) {
    for (name, bytes) in files {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
}
