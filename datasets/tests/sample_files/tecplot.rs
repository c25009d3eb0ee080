//! Small files of Tecplot: text, and binary files of any version and byte order.

/// Zones of every kind: points and blocks, repeat counts, cells, passive and shared variables,
/// elements that are shared, and two times.
pub(crate) const TEXT: &str = "\
# made by hand
TITLE = \"a # b\"
VARIABLES = \"X [m]\", \"Y\"
\"Z\", \"rho\" \"T\"
DATASETAUXDATA by = \"us\"
ZONE T = \"lattice\", I=3, J=2, K = 2, DATAPACKING=BLOCK, 
 VARLOCATION=([5]=CELLCENTERED), DT=(SINGLE)
 AUXDATA Note = \"free\" SOLUTIONTIME=1
 0 1 2 0 1 2 0 1 2 0 1 2
 3*0, 3*1.0, 3*0, 3*1
 6*0 6*1.0D0
 1 2 3 4 5 6 7 8 9 10 11 12
 2*300.5
ZONE T=\"bricks\" N=12 E=2 ET=BRICK F=FEBLOCK SOLUTIONTIME=1
 VARSHARELIST=([1-3]=1) PASSIVEVARLIST=[5]
 11 10 9 8 7 6 5 4 3 2 1 0
 1 2 5 4 7 8 11 10
 2 3 6 6 8 9 12 12
TEXT X=0.1, Y=0.2, T=\"a label\"
ZONE T=\"again\", NODES=12, ELEMENTS=2, ZONETYPE=FEBRICK, DATAPACKING=BLOCK,
 VARSHARELIST=([1,2,3]=2,[5]), PASSIVEVARLIST=[4], CONNECTIVITYSHAREZONE=2, SOLUTIONTIME=2
ZONE T=\"quads\", N=4, E=1, F=FEPOINT, ET=QUADRILATERAL, SOLUTIONTIME=2
 0 0 0 1 5
 1 0 0 2 6
 1 1 0 3 7
 0 1 0 4 8
 1 2 3 3
";

/// How a binary file is written.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plt {
    pub(crate) version: u32,
    pub(crate) big: bool,
    /// Point packing, which versions up to 111 know.
    pub(crate) by_point: bool,
}

struct Bytes {
    out: Vec<u8>,
    big: bool,
}

impl Bytes {
    fn put<const N: usize>(&mut self, mut le: [u8; N]) {
        if self.big {
            le.reverse();
        }
        self.out.extend(le);
    }
    fn ints(&mut self, list: &[i32]) {
        list.iter().for_each(|i| self.put(i.to_le_bytes()));
    }
    fn floats(&mut self, list: &[f32]) {
        list.iter().for_each(|x| self.put(x.to_le_bytes()));
    }
    fn doubles(&mut self, list: &[f64]) {
        list.iter().for_each(|x| self.put(x.to_le_bytes()));
    }
    fn text(&mut self, text: &str) {
        text.bytes().for_each(|b| self.ints(&[i32::from(b)]));
        self.ints(&[0]);
    }
}

/// A lattice of 3 x 2 x 2 points with x, y, z and rho at points (rho in double precision) and T at
/// its two cells, and two bricks over the same points, shared where the version can. In version
/// 75 and with point packing T is a value of points, 300 + point.
pub(crate) fn plt(how: Plt) -> Vec<u8> {
    let Plt { version, big, by_point } = how;
    let mut b = Bytes { out: format!("#!TDV{version:<3}").into_bytes(), big };
    let old = version == 75;
    let cells = !old && !by_point;
    b.ints(&[1]);
    if version >= 111 {
        b.ints(&[0]);
    }
    b.text("title");
    b.ints(&[5]);
    ["X", "Y", "Z", "rho", "T"].iter().for_each(|n| b.text(n));
    for (name, elements) in [("lattice", false), ("bricks", true)] {
        b.floats(&[299.0]);
        b.text(name);
        if old {
            b.ints(&[i32::from(by_point) + 2 * i32::from(elements), -1]);
            b.ints(if elements { &[12, 2, 3] } else { &[3, 2, 2] });
            continue;
        }
        if version >= 107 {
            b.ints(&[-1]);
        }
        if version >= 103 {
            b.ints(&[1]);
            b.doubles(&[0.5]);
        }
        b.ints(&[-1, if elements { 5 } else { 0 }]);
        if version < 112 {
            b.ints(&[i32::from(by_point)]);
        }
        if cells {
            b.ints(&[1, 0, 0, 0, 0, 1]);
        } else {
            b.ints(&[0]);
        }
        if version >= 108 {
            b.ints(&[0]);
        }
        b.ints(&[0]);
        b.ints(if elements { &[12, 2, 0, 0, 0] } else { &[3, 2, 2] });
        b.ints(&[1]);
        b.text("note");
        b.ints(&[0]);
        b.text("free");
        b.ints(&[0]);
    }
    if version >= 107 {
        b.floats(&[799.0]);
        b.text("by");
        b.ints(&[0]);
        b.text("us");
    }
    b.floats(&[357.0]);
    for elements in [false, true] {
        let shares = elements && !old && !by_point;
        b.floats(&[299.0]);
        if old {
            b.ints(&[0]);
        }
        b.ints(&[1, 1, 1, 2, 1]);
        if version >= 103 {
            b.ints(&[0]);
        }
        if !old {
            b.ints(if shares { &[1, 0, 0, 0, -1, -1] } else { &[0] });
            b.ints(&[-1]);
        }
        if version >= 103 {
            let own = if shares { 2 } else { 5 };
            (0..own).for_each(|_| b.doubles(&[0.0, 1.0]));
        }
        let point = |i: usize| [i % 3, i / 3 % 2, i / 6].map(|x| x as f32);
        let rho = |i: usize| 1.0 / 3.0 + i as f64;
        if by_point {
            for i in 0..12 {
                b.floats(&point(i));
                b.doubles(&[rho(i)]);
                b.floats(&[300.0 + i as f32]);
            }
        } else {
            if !shares {
                (0..3).for_each(|a| (0..12).for_each(|i| b.floats(&[point(i)[a]])));
            }
            (0..12).for_each(|i| b.doubles(&[rho(i)]));
            match (cells, elements) {
                (false, _) => (0..12).for_each(|i| b.floats(&[300.0 + i as f32])),
                (true, true) => b.floats(&[300.0, 301.0]),
                // The lattice has room for cells as if there were as many along I and J as points,
                // and before version 104 along K.
                (true, false) => {
                    b.floats(&[300.0, 301.0, -1.0, -1.0, -1.0, -1.0]);
                    if version < 104 {
                        b.floats(&[-1.0; 6]);
                    }
                }
            }
        }
        if elements {
            let first = i32::from(old);
            if old {
                b.ints(&[0]);
            }
            let ids = [0, 1, 4, 3, 6, 7, 10, 9, 1, 2, 5, 4, 7, 8, 11, 10];
            b.ints(&ids.map(|i| i + first));
        }
    }
    b.out
}

/// Every layout of a binary file.
pub(crate) fn layouts() -> Vec<Plt> {
    let mut all = Vec::new();
    for version in [75, 101, 102, 103, 104, 107, 108, 111, 112] {
        for big in [false, true] {
            for by_point in [false, true] {
                if version < 112 || !by_point {
                    all.push(Plt { version, big, by_point });
                }
            }
        }
    }
    all
}
