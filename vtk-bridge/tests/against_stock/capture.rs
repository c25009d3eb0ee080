//! Output of `scripts/capture.py` for one window: image, window depth, facts, and the bridge's
//! report if there was one.

use serde_json::Value;
use std::path::Path;

/// An image with its depths. Rows start at the bottom, as in OpenGL.
#[derive(Debug, Clone)]
pub(crate) struct Capture {
    /// Pixels in a row.
    pub(crate) width: usize,
    /// Channels from 0 to 255.
    pub(crate) height: usize,
    /// 0 to 255.
    pub(crate) rgb: Vec<[u8; 3]>,
    /// Window depth, 0 to 1; empty if only the colours were stored.
    pub(crate) depth: Vec<f32>,
    /// Picks, selections, counts.
    pub(crate) facts: Value,
    /// The report in `RTV_REPORT` after this frame.
    pub(crate) report: Option<Value>,
}

impl Capture {
    /// Reads `NAME.png` and the files that belong to it in the same folder.
    pub(crate) fn read(folder: &Path, name: &str) -> Result<Capture, String> {
        let file = |extension: &str| folder.join(format!("{name}.{extension}"));
        let decoded = image::open(file("png"))
            .map_err(|e| format!("{}: {e}", file("png").display()))?
            .into_rgb8();
        let (width, height) = (decoded.width() as usize, decoded.height() as usize);
        let rows = decoded.as_raw().chunks_exact(3 * width).rev();
        let rgb = rows.flat_map(|row| row.chunks_exact(3).map(|p| [p[0], p[1], p[2]])).collect();
        let depth =
            if file("npy").is_file() { read_npy(&file("npy"), width * height)? } else { vec![] };
        let json = |extension: &str| -> Result<Option<Value>, String> {
            let Ok(text) = std::fs::read_to_string(file(extension)) else { return Ok(None) };
            serde_json::from_str(&text)
                .map(Some)
                .map_err(|e| format!("{}: {e}", file(extension).display()))
        };
        let facts = json("json")?.unwrap_or(Value::Null);
        Ok(Capture { width, height, rgb, depth, facts, report: json("report.json")? })
    }

    /// The list `renderers` of the report.
    pub(crate) fn renderers(&self) -> &[Value] {
        self.report.as_ref().and_then(|r| r["renderers"].as_array()).map_or(&[], Vec::as_slice)
    }

    /// Number of traced triangles in the report, over all renderers.
    pub(crate) fn traced_elements(&self) -> u64 {
        let lists = self.renderers().iter().filter_map(|r| r["traced"].as_array());
        lists.flatten().flat_map(|t| [t["triangles"].as_u64(), t["cells"].as_u64()]).flatten().sum()
    }

    /// Names or reasons of the props that OpenGL draws.
    pub(crate) fn passed(&self, key: &str) -> Vec<String> {
        let lists = self.renderers().iter().filter_map(|r| r["passed"].as_array());
        lists.flatten().filter_map(|p| p[key].as_str().map(str::to_owned)).collect()
    }

    /// Who draws where the picture is the same either way, and why, as the last renderer says.
    pub(crate) fn choice(&self) -> String {
        let last = self.renderers().last().and_then(|r| r["choice"].as_str());
        last.unwrap_or_default().to_owned()
    }

    /// The reasons that the script expects, in the order of its props.
    pub(crate) fn expected_reasons(&self) -> Vec<String> {
        let reasons = self.facts["reasons"].as_array().map_or(&[][..], Vec::as_slice);
        reasons.iter().filter_map(|r| r.as_str().map(str::to_owned)).collect()
    }

    /// All warnings.
    pub(crate) fn warnings(&self) -> Vec<String> {
        let lists = self.renderers().iter().filter_map(|r| r["warnings"].as_array());
        lists.flatten().filter_map(|w| w.as_str().map(str::to_owned)).collect()
    }

    /// Mean colour, 0 to 255, of the rectangle `[left, bottom, right, top]`, in fractions of the
    /// image.
    pub(crate) fn color(&self, part: [f64; 4]) -> [f64; 3] {
        let x = |f: f64| ((f * self.width as f64) as usize).min(self.width);
        let y = |f: f64| ((f * self.height as f64) as usize).min(self.height);
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for row in y(part[1])..y(part[3]) {
            for p in &self.rgb[row * self.width + x(part[0])..row * self.width + x(part[2])] {
                (0..3).for_each(|c| sum[c] += f64::from(p[c]));
                count += 1.0;
            }
        }
        assert!(count > 0.0, "the rectangle {part:?} has no pixel");
        sum.map(|s| s / count)
    }

    /// Mean colour of 3 by 3 pixels around a position that the script named in its facts.
    pub(crate) fn at(&self, place: &str) -> [f64; 3] {
        let [x, y] = self.pixel(place);
        let (w, h) = (self.width as f64, self.height as f64);
        let [x, y] = [x as f64, y as f64];
        self.color([(x - 0.5) / w, (y - 0.5) / h, (x + 2.5) / w, (y + 2.5) / h])
    }

    /// The pixel of such a position.
    pub(crate) fn pixel(&self, place: &str) -> [usize; 2] {
        [0, 1].map(|i| {
            let v = self.facts[place][i].as_u64();
            v.unwrap_or_else(|| panic!("the script named no pixel for {place}: {}", self.facts))
                as usize
        })
    }
}

/// Mean of the channels.
pub(crate) fn bright(color: [f64; 3]) -> f64 {
    color.iter().sum::<f64>() / 3.0
}

/// A `.npy` file of version 1 with little-endian `f32`.
fn read_npy(path: &Path, length: usize) -> Result<Vec<f32>, String> {
    let bytes = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let fault = |what: &str| format!("{}: {what}", path.display());
    if bytes.len() < 10 || !bytes.starts_with(b"\x93NUMPY\x01\x00") {
        return Err(fault("not a .npy file of version 1"));
    }
    let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let values: Vec<f32> = bytes
        .get(start..)
        .unwrap_or_default()
        .chunks_exact(4)
        .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        .collect();
    if values.len() == length {
        Ok(values)
    } else {
        Err(fault(&format!("{} values, not {length}", values.len())))
    }
}
