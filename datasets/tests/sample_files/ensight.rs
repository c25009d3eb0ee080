//! A small EnSight Gold case in each encoding: parts of every kind, and two times.

use std::path::Path;

/// How the files are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encoding {
    Text,
    C { big: bool },
    Fortran { big: bool },
}

pub(crate) const ENCODINGS: [Encoding; 5] = [
    Encoding::Text,
    Encoding::C { big: false },
    Encoding::C { big: true },
    Encoding::Fortran { big: false },
    Encoding::Fortran { big: true },
];

const CASE: &str = "\
FORMAT
type: ensight gold
GEOMETRY
model: 1 a.geo***
VARIABLE
scalar per node: 1 rho a.rho***
vector per node: vel a.vel
scalar per element: T a.T
constant per case: gamma 1.4
TIME
time set: 1
number of steps: 2
filename start number: 3
filename increment: 2
time values: 0.5
1.5
";

struct File {
    out: Vec<u8>,
    encoding: Encoding,
}

impl File {
    fn new(encoding: Encoding) -> Self {
        File { out: Vec::new(), encoding }
    }

    fn record(&mut self, bytes: &[u8]) {
        let mark = (bytes.len() as u32).to_le_bytes();
        match self.encoding {
            Encoding::Fortran { big } => {
                let mark = if big { [mark[3], mark[2], mark[1], mark[0]] } else { mark };
                self.out.extend([&mark, bytes, &mark].concat());
            }
            _ => self.out.extend(bytes),
        }
    }

    fn text(&mut self, text: &str) {
        match self.encoding {
            Encoding::Text => self.out.extend(format!("{text}\n").bytes()),
            _ => self.record(format!("{text:80}").as_bytes()),
        }
    }

    fn numbers(&mut self, words: Vec<[u8; 4]>) {
        let big =
            matches!(self.encoding, Encoding::C { big: true } | Encoding::Fortran { big: true });
        let turned = words.into_iter().flat_map(|mut w| {
            if big {
                w.reverse();
            }
            w
        });
        let bytes: Vec<u8> = turned.collect();
        self.record(&bytes);
    }

    /// Whole numbers, in text so many on a line.
    fn ints(&mut self, per_line: usize, list: &[i32]) {
        if self.encoding == Encoding::Text {
            for line in list.chunks(per_line) {
                let line: String = line.iter().map(|i| format!("{i:10}")).collect();
                self.text(&line);
            }
        } else {
            self.numbers(list.iter().map(|i| i.to_le_bytes()).collect());
        }
    }

    fn reals(&mut self, list: impl IntoIterator<Item = f32>) {
        let list: Vec<f32> = list.into_iter().collect();
        if self.encoding == Encoding::Text {
            list.iter().for_each(|x| self.text(&format!("{x:12.5e}")));
        } else {
            self.numbers(list.iter().map(|x| x.to_le_bytes()).collect());
        }
    }

    fn part(&mut self, number: i32, word: &str) {
        self.text("part");
        self.ints(1, &[number]);
        self.text(word);
    }
}

fn point(i: usize) -> [f32; 3] {
    [i % 3, i / 3 % 2, i / 6].map(|x| x as f32)
}

fn geometry(encoding: Encoding, shift: f32) -> Vec<u8> {
    let mut g = File::new(encoding);
    match encoding {
        Encoding::Text => {}
        Encoding::C { .. } => g.text("C Binary"),
        Encoding::Fortran { .. } => g.text("Fortran Binary"),
    }
    ["made", "by us", "node id given", "element id assign"].iter().for_each(|t| g.text(t));
    g.part(1, "mixed");
    g.text("coordinates");
    g.ints(1, &[12]);
    g.ints(1, &(1..13).collect::<Vec<i32>>());
    (0..3).for_each(|a| g.reals((0..12).map(|i| point(i)[a] + if a == 0 { shift } else { 0.0 })));
    for (name, ids) in [
        ("hexa8", &[1, 2, 5, 4, 7, 8, 11, 10][..]),
        ("penta6", &[2, 3, 6, 8, 9, 12]),
        ("tetra4", &[2, 6, 5, 8]),
    ] {
        g.text(name);
        g.ints(1, &[1]);
        g.ints(ids.len(), ids);
    }
    g.text("nsided");
    g.ints(1, &[2]);
    g.ints(1, &[3, 4]);
    g.ints(7, &[1, 2, 5, 7, 8, 11, 10]);
    g.text("nfaced");
    g.ints(1, &[1]);
    g.ints(1, &[4]);
    g.ints(1, &[3, 3, 3, 3]);
    g.ints(3, &[2, 5, 8, 2, 6, 5, 5, 6, 8, 6, 2, 8]);
    g.part(4, "curved");
    g.text("block iblanked");
    g.ints(3, &[3, 2, 2]);
    (0..3).for_each(|a| g.reals((0..12).map(|i| point(i)[a])));
    g.ints(1, &[1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0]);
    g.part(7, "rectilinear");
    g.text("block rectilinear");
    g.ints(3, &[3, 2, 1]);
    g.reals([0.0, 1.0, 4.0]);
    g.reals([0.0, 2.0]);
    g.reals([5.0]);
    g.part(8, "uniform");
    g.text("block uniform");
    g.ints(3, &[2, 2, 2]);
    g.reals([1.0, 2.0, 3.0]);
    g.reals([0.5, 0.25, 0.125]);
    g.out
}

/// Names and contents of the files of the case.
pub(crate) fn case(encoding: Encoding) -> Vec<(String, Vec<u8>)> {
    let mut files = vec![("a.case".to_string(), CASE.as_bytes().to_vec())];
    for (step, number) in [(0.0, 3), (1.0, 5)] {
        files.push((format!("a.geo{number:03}"), geometry(encoding, 0.25 * step)));
        let mut rho = File::new(encoding);
        rho.text("rho");
        for (part, word, n) in [(1, "coordinates", 12), (4, "block", 12), (7, "block", 6)] {
            rho.part(part, word);
            rho.reals((0..n).map(|i| i as f32 + 100.0 * part as f32 + step));
        }
        rho.part(8, "block undef");
        rho.reals([-1.0]);
        rho.reals([0.0, 1.0, 2.0, -1.0, 4.0, 5.0, 6.0, 7.0]);
        files.push((format!("a.rho{number:03}"), rho.out));
    }
    let mut vel = File::new(encoding);
    vel.text("vel");
    vel.part(1, "coordinates");
    (0..3).for_each(|a| vel.reals((0..12).map(|i| (i + 1000 * a) as f32)));
    files.push(("a.vel".into(), vel.out));
    let mut t = File::new(encoding);
    t.text("T");
    t.text("part");
    t.ints(1, &[1]);
    for (name, values) in [
        ("hexa8", &[300.0][..]),
        ("penta6", &[301.0]),
        ("tetra4", &[302.0]),
        ("nsided", &[303.0, 304.0]),
        ("nfaced", &[305.0]),
    ] {
        t.text(name);
        t.reals(values.iter().copied());
    }
    t.part(4, "block");
    t.reals([310.0, 311.0]);
    files.push(("a.T".into(), t.out));
    files
}

/// Writes the files into a folder.
pub(crate) fn write(folder: &Path, files: &[(String, Vec<u8>)]) {
    files.iter().for_each(|(name, bytes)| std::fs::write(folder.join(name), bytes).unwrap());
}
