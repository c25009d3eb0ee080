//! Writes VTK's XML files: `.vtp .vti .vtu .vtr .vts`, collections as `.vtm`, time series as
//! `.pvd`.
//!
//! Data is written as ASCII or as appended base64, never as appended raw. Raw bytes make the file
//! invalid XML, which VTK 9.1 to 9.2.6 with newer versions of libexpat reject (VTK commit
//! db8f9efc).

use super::{WriteError, write_file};
use crate::model::{
    Attributes, Cells, DataArray, Dataset, PolyData, ScalarType, UnstructuredGrid, Values,
};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Encoding of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Encoding {
    /// Readable text; larger, and without NaN and infinity, which VTK cannot read back from text.
    Ascii,
    /// Base64 in one block at the end of the file.
    #[default]
    Base64,
}

/// Options for VTK files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct VtkOptions {
    /// Encoding of numbers.
    pub encoding: Encoding,
    /// Whether to compress with ZLib; only with base64.
    pub compress: bool,
}

/// Bytes per compressed block. Readers can unpack blocks one at a time.
const BLOCK_BYTES: usize = 1 << 20;

/// Writes a data set. The extension of `path` must be that of its kind (`.vtp` for PolyData and so
/// on). A collection becomes a `.vtm` file and a directory of the same name with its blocks.
pub fn write_vtk(
    path: impl AsRef<Path>,
    data: &Dataset,
    options: VtkOptions,
) -> Result<(), WriteError> {
    let path = path.as_ref();
    if options.compress && options.encoding == Encoding::Ascii {
        return Err(WriteError::refused(
            path,
            "ascii cannot be compressed",
            "choose base64, or no compression",
        ));
    }
    let wanted = match data {
        Dataset::PolyData(_) => "vtp",
        Dataset::UnstructuredGrid(_) => "vtu",
        Dataset::ImageData(_) => "vti",
        Dataset::RectilinearGrid(_) => "vtr",
        Dataset::StructuredGrid(_) => "vts",
        Dataset::MultiBlock(_) => "vtm",
    };
    if path.extension().is_none_or(|e| !e.eq_ignore_ascii_case(wanted)) {
        let what = format!("{} belongs in a .{wanted} file", data.kind());
        return Err(WriteError::refused(
            path,
            what,
            format!("name it {}", path.with_extension(wanted).display()),
        ));
    }
    data.check().map_err(|e| {
        WriteError::refused(path, e.to_string(), "make the arrays as long as the geometry")
    })?;
    if let Dataset::MultiBlock(blocks) = data {
        return write_blocks(path, blocks, options);
    }
    let mut out = Document {
        xml: String::new(),
        appended: Vec::new(),
        appended_len: 0,
        options,
        non_finite: None,
    };
    out.data_set(data).map_err(|what| {
        WriteError::refused(
            path,
            what,
            "leave those cells out: VTK would read past the end of the points",
        )
    })?;
    if let Some(name) = out.non_finite {
        let what = format!("array `{name}` holds NaN or infinity, which VTK cannot read from text");
        return Err(WriteError::refused(path, what, "write it with base64 encoding"));
    }
    write_file(path, |f| {
        let compressor =
            if options.compress { " compressor=\"vtkZLibDataCompressor\"" } else { "" };
        writeln!(f, "<?xml version=\"1.0\"?>")?;
        let kind = data.kind();
        writeln!(
            f,
            "<VTKFile type=\"{kind}\" version=\"1.0\" byte_order=\"LittleEndian\" \
             header_type=\"UInt64\"{compressor}>"
        )?;
        f.write_all(out.xml.as_bytes())?;
        if !out.appended.is_empty() {
            write!(f, "<AppendedData encoding=\"base64\">\n_")?;
            for piece in &out.appended {
                f.write_all(piece.as_bytes())?;
            }
            writeln!(f, "\n</AppendedData>")?;
        }
        writeln!(f, "</VTKFile>")
    })
}

/// Writes a time series: a list of files with their times. Names are written relative to the
/// directory of `path`.
pub fn write_pvd(path: impl AsRef<Path>, steps: &[(f64, PathBuf)]) -> Result<(), WriteError> {
    let path = path.as_ref();
    let directory = path.parent().unwrap_or(Path::new(""));
    write_file(path, |f| {
        writeln!(
            f,
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\">\n<Collection>"
        )?;
        for (time, file) in steps {
            let name = file.strip_prefix(directory).unwrap_or(file).to_string_lossy().into_owned();
            writeln!(f, "<DataSet timestep=\"{time}\" part=\"0\" file=\"{}\"/>", escaped(&name))?;
        }
        writeln!(f, "</Collection>\n</VTKFile>")
    })
}

fn write_blocks(
    path: &Path,
    blocks: &[crate::model::Block],
    options: VtkOptions,
) -> Result<(), WriteError> {
    let directory = path.with_extension("");
    std::fs::create_dir_all(&directory)
        .map_err(|source| WriteError::Io { path: directory.clone(), source })?;
    let stem = directory.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let mut lines = String::new();
    for (i, block) in blocks.iter().enumerate() {
        let extension = match &block.data {
            Dataset::PolyData(_) => "vtp",
            Dataset::UnstructuredGrid(_) => "vtu",
            Dataset::ImageData(_) => "vti",
            Dataset::RectilinearGrid(_) => "vtr",
            Dataset::StructuredGrid(_) => "vts",
            Dataset::MultiBlock(_) => {
                return Err(WriteError::refused(
                    path,
                    format!("block `{}` is a collection itself", block.name),
                    "write it to a file of its own",
                ));
            }
        };
        let file = format!("{stem}_{i}.{extension}");
        write_vtk(directory.join(&file), &block.data, options)?;
        let (name, file) = (escaped(&block.name), escaped(&format!("{stem}/{file}")));
        let _ = writeln!(lines, "<DataSet index=\"{i}\" name=\"{name}\" file=\"{file}\"/>");
    }
    write_file(path, |f| {
        write!(
            f,
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"vtkMultiBlockDataSet\" version=\"1.0\" \
             byte_order=\"LittleEndian\">\n\
             <vtkMultiBlockDataSet>\n{lines}</vtkMultiBlockDataSet>\n</VTKFile>\n"
        )
    })
}

fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            // Line ends in attributes would be read as spaces; other control characters are
            // invalid.
            '\n' | '\r' | '\t' => {
                let _ = write!(out, "&#{};", c as u32);
            }
            c if c.is_control() => out.push('?'),
            c => out.push(c),
        }
    }
    out
}

/// A file under construction. Writing to a `String` cannot fail.
struct Document {
    xml: String,
    appended: Vec<String>,
    appended_len: usize,
    options: VtkOptions,
    non_finite: Option<String>,
}

impl Document {
    fn line(&mut self, text: impl AsRef<str>) {
        self.xml.push_str(text.as_ref());
        self.xml.push('\n');
    }

    fn data_set(&mut self, data: &Dataset) -> Result<(), String> {
        let kind = data.kind();
        let (points, cells) = data.counts();
        let extent = |e: [i32; 6]| e.map(|x| x.to_string()).join(" ");
        let (set, piece) = match data {
            Dataset::PolyData(d) => {
                let [v, l, p, s] = [&d.verts, &d.lines, &d.polys, &d.strips].map(|c| c.len());
                let piece = format!(
                    "NumberOfPoints=\"{points}\" NumberOfVerts=\"{v}\" NumberOfLines=\"{l}\" \
                     NumberOfStrips=\"{s}\" NumberOfPolys=\"{p}\""
                );
                (String::new(), piece)
            }
            Dataset::UnstructuredGrid(_) => {
                (String::new(), format!("NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\""))
            }
            Dataset::ImageData(d) => {
                let e = extent(d.extent);
                let three = |v: glam::DVec3| format!("{:e} {:e} {:e}", v.x, v.y, v.z);
                let rows =
                    d.direction.transpose().to_cols_array().map(|x| format!("{x:e}")).join(" ");
                let set = format!(
                    " WholeExtent=\"{e}\" Origin=\"{}\" Spacing=\"{}\" Direction=\"{rows}\"",
                    three(d.origin),
                    three(d.spacing)
                );
                (set, format!("Extent=\"{e}\""))
            }
            Dataset::RectilinearGrid(d) => {
                let e = extent(d.extent);
                (format!(" WholeExtent=\"{e}\""), format!("Extent=\"{e}\""))
            }
            Dataset::StructuredGrid(d) => {
                let e = extent(d.extent);
                (format!(" WholeExtent=\"{e}\""), format!("Extent=\"{e}\""))
            }
            Dataset::MultiBlock(_) => return Err("a collection inside a file".into()),
        };
        self.line(format!("<{kind}{set}>"));
        if let Some(a) = data.attributes() {
            self.field_data(a);
        }
        self.line(format!("<Piece {piece}>"));
        if let Some(a) = data.attributes() {
            self.section(
                "PointData",
                &a.point,
                [
                    ("Scalars", &a.point_scalars),
                    ("Normals", &a.point_normals),
                    ("TCoords", &a.point_texcoords),
                ],
            );
            self.section(
                "CellData",
                &a.cell,
                [("Scalars", &a.cell_scalars), ("Normals", &a.cell_normals), ("TCoords", &None)],
            );
        }
        match data {
            Dataset::PolyData(d) => self.poly_data(d)?,
            Dataset::UnstructuredGrid(d) => self.unstructured(d)?,
            Dataset::RectilinearGrid(d) => {
                self.line("<Coordinates>");
                for (name, x) in ["x", "y", "z"].into_iter().zip(&d.coordinates) {
                    self.array(&DataArray::new(name, 1, Values::F64(x.clone())), "");
                }
                self.line("</Coordinates>");
            }
            Dataset::StructuredGrid(d) => self.points(d.points.to_array()),
            _ => {}
        }
        self.line(format!("</Piece>\n</{kind}>"));
        Ok(())
    }

    fn field_data(&mut self, a: &Attributes) {
        if a.field.is_empty() && a.text.is_empty() {
            return;
        }
        self.line("<FieldData>");
        for array in &a.field {
            self.array(array, &format!(" NumberOfTuples=\"{}\"", array.tuples()));
        }
        for (name, texts) in &a.text {
            // Characters as numbers; each text is terminated by a zero.
            let letters: Vec<String> =
                texts.iter().flat_map(|t| t.bytes().chain([0])).map(|b| b.to_string()).collect();
            let (name, n) = (escaped(name), texts.len());
            self.line(format!(
                "<Array type=\"String\" Name=\"{name}\" NumberOfTuples=\"{n}\" \
                 format=\"ascii\">{}</Array>",
                letters.join(" ")
            ));
        }
        self.line("</FieldData>");
    }

    fn section(&mut self, name: &str, arrays: &[DataArray], marks: [(&str, &Option<String>); 3]) {
        let mut tag = format!("<{name}");
        for (mark, array) in marks {
            if let Some(array) = array
                && arrays.iter().any(|a| a.name == *array)
            {
                let _ = write!(tag, " {mark}=\"{}\"", escaped(array));
            }
        }
        self.line(tag + ">");
        arrays.iter().for_each(|a| self.array(a, ""));
        self.line(format!("</{name}>"));
    }

    fn points(&mut self, array: DataArray) {
        self.line("<Points>");
        self.array(&array, "");
        self.line("</Points>");
    }

    fn poly_data(&mut self, d: &PolyData) -> Result<(), String> {
        self.points(d.points.to_array());
        for (name, cells) in
            [("Verts", &d.verts), ("Lines", &d.lines), ("Strips", &d.strips), ("Polys", &d.polys)]
        {
            self.line(format!("<{name}>"));
            self.cells(cells, d.points.len(), name)?;
            self.line(format!("</{name}>"));
        }
        Ok(())
    }

    fn cells(&mut self, cells: &Cells, points: usize, section: &str) -> Result<(), String> {
        if let Some(bad) = cells.connectivity().iter().find(|&&k| k as usize >= points) {
            return Err(format!("{section} name point {bad}, but there are {points}"));
        }
        let ids = cells.connectivity().iter().map(|&k| i64::from(k)).collect();
        self.array(&DataArray::new("connectivity", 1, Values::I64(ids)), "");
        let ends = cells.ends().iter().map(|&e| e as i64).collect();
        self.array(&DataArray::new("offsets", 1, Values::I64(ends)), "");
        Ok(())
    }

    fn unstructured(&mut self, d: &UnstructuredGrid) -> Result<(), String> {
        self.points(d.points.to_array());
        self.line("<Cells>");
        self.cells(&d.cells, d.points.len(), "Cells")?;
        self.array(&DataArray::new("types", 1, Values::U8(d.types.clone())), "");
        if d.faces_of_cell.iter().any(|r| !r.is_empty()) {
            // The layout that all versions of VTK read: per polyhedron its number of faces, then
            // the size and ids of each face.
            let (mut stream, mut ends) = (Vec::new(), Vec::new());
            for faces in &d.faces_of_cell {
                if faces.is_empty() {
                    ends.push(-1);
                    continue;
                }
                stream.push(faces.len() as i64);
                for f in faces.clone() {
                    let ids = d.polyhedron_faces.get(f);
                    stream.push(ids.len() as i64);
                    stream.extend(ids.iter().map(|&k| i64::from(k)));
                }
                ends.push(stream.len() as i64);
            }
            self.array(&DataArray::new("faces", 1, Values::I64(stream)), "");
            self.array(&DataArray::new("faceoffsets", 1, Values::I64(ends)), "");
        }
        self.line("</Cells>");
        Ok(())
    }

    fn array(&mut self, a: &DataArray, more: &str) {
        let (kind, name, n) = (a.values.kind().vtk_name(), escaped(&a.name), a.components);
        let head =
            format!("<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{n}\"{more}");
        if self.options.encoding == Encoding::Ascii {
            let is_real = matches!(a.values.kind(), ScalarType::F32 | ScalarType::F64);
            if is_real && (0..a.values.len()).any(|i| !a.values.get_f64(i).is_finite()) {
                self.non_finite.get_or_insert_with(|| a.name.clone());
            }
            self.line(head + " format=\"ascii\">");
            let row = a.components.max(1) * (12 / a.components.max(1)).max(1);
            crate::model::array::with_values!(&a.values, v => for chunk in v.chunks(row) {
                let words: Vec<String> = chunk.iter().map(shortest).collect();
                self.line(words.join(" "));
            });
            self.line("</DataArray>");
            return;
        }
        let offset = self.appended_len;
        self.line(format!("{head} format=\"appended\" offset=\"{offset}\"/>"));
        let pieces = packed(&a.values.to_le_bytes(), self.options.compress);
        self.appended_len += pieces.iter().map(String::len).sum::<usize>();
        self.appended.extend(pieces);
    }
}

/// The shortest text that parses to the same number. Large and small reals get an exponent.
fn shortest<T: std::fmt::Debug>(x: &T) -> String {
    format!("{x:?}")
}

/// Header and data in base64, as the reader in `read::vtk_xml::blocks` describes them.
fn packed(bytes: &[u8], compress: bool) -> Vec<String> {
    let number = |n: usize| (n as u64).to_le_bytes();
    if !compress {
        let mut all = number(bytes.len()).to_vec();
        all.extend_from_slice(bytes);
        return vec![base64::encode(&all)];
    }
    let mut data = Vec::new();
    let mut sizes = Vec::new();
    for block in bytes.chunks(BLOCK_BYTES) {
        let mut z = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
        // Writing to memory does not fail.
        let packed =
            std::io::Write::write_all(&mut z, block).and_then(|()| z.finish()).unwrap_or_default();
        sizes.push(packed.len());
        data.extend(packed);
    }
    let last = bytes.len() % BLOCK_BYTES;
    let header: Vec<u8> =
        [sizes.len(), BLOCK_BYTES, last].into_iter().chain(sizes).flat_map(number).collect();
    vec![base64::encode(&header), base64::encode(&data)]
}
