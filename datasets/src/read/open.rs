//! Detects the format of a file by its first bytes, or else by the extension of its name.

use super::error::{At, Fault, io_error, read_bytes, refuse_pointer};
use super::{
    LoadedFile, OpenOptions, ReadError, amrex, cgns, csv, csv_file, ensight, gltf, hdf5, mhd,
    netcdf, npy, nrrd, obj, openfoam, plot3d, ply, raw, stl, tecplot, time_axis, vtk_legacy,
    vtk_xml, vtkhdf, xdmf,
};
use rt_core::bvh::StoredMesh;
use rt_core::stored_volume::StoredVolume;
use std::io::Read;
use std::path::Path;

/// The supported formats, for messages.
pub const KNOWN: &str = "VTK XML (.vti .vtp .vtu .vtr .vts, their parallel forms, .pvd, .vtm, \
                         .vthb, .series), VTK legacy (.vtk), VTKHDF (.vtkhdf), NetCDF (.nc), \
                         Exodus II (.e .exo), XDMF (.xdmf .xmf), CGNS (.cgns), \
                         PLOT3D (.xyz .x .g .q .bin), NRRD (.nrrd .nhdr), MetaImage (.mhd .mha), \
                         raw with TOML (.raw), NumPy (.npy .npz), OpenFOAM cases (folders, .foam), \
                         Tecplot (.dat .tec .plt), EnSight Gold (.case), \
                         AMReX plotfiles (folders), tables of points (.csv .tsv .txt), OBJ, \
                         glTF, PLY, STL";

/// Number of bytes examined.
const HEAD_BYTES: u64 = 1024;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    VtkXml,
    VtkSeries,
    VtkLegacy,
    VtkHdf,
    NetCdf,
    Xdmf,
    Plot3d,
    Nrrd,
    MetaImage,
    Raw,
    Numpy,
    Obj,
    Gltf,
    Ply,
    Stl,
    Tecplot,
    EnSight,
    Cgns,
    Csv,
}

impl Format {
    /// Whether a file may hold several times.
    fn may_have_times(self) -> bool {
        use Format::*;
        matches!(
            self,
            VtkXml | VtkSeries | VtkHdf | NetCdf | Xdmf | Numpy | Tecplot | EnSight | Cgns
        )
    }

    /// Its name, for messages.
    fn name(self) -> &'static str {
        match self {
            Format::VtkXml => vtk_xml::FORMAT,
            Format::VtkSeries => vtk_xml::series::FORMAT,
            Format::VtkLegacy => vtk_legacy::FORMAT,
            Format::VtkHdf => vtkhdf::FORMAT,
            Format::NetCdf => netcdf::FORMAT,
            Format::Xdmf => xdmf::FORMAT,
            Format::Plot3d => plot3d::FORMAT,
            Format::Nrrd => nrrd::FORMAT,
            Format::MetaImage => mhd::FORMAT,
            Format::Raw => raw::FORMAT,
            Format::Numpy => npy::FORMAT,
            Format::Obj => obj::FORMAT,
            Format::Gltf => gltf::FORMAT,
            Format::Ply => ply::FORMAT,
            Format::Stl => stl::FORMAT,
            Format::Tecplot => tecplot::FORMAT,
            Format::EnSight => ensight::FORMAT,
            Format::Cgns => cgns::FORMAT,
            Format::Csv => csv::FORMAT,
        }
    }
}

/// Reads a file of any format that this crate supports. The content decides; for formats without a
/// signature (OBJ, raw, PLOT3D), the file extension does. A name that contradicts the content gives
/// a warning, not an error.
///
/// ```
/// let dir = tempfile::tempdir()?;
/// let path = dir.path().join("triangle.stl");
/// std::fs::write(&path, "solid t\n facet normal 0 0 1\n outer loop\n vertex 0 0 0\n vertex 1 0 0\n vertex 0 1 0\n \
///                        endloop\n endfacet\nendsolid t\n")?;
/// let opened = datasets::read::open(&path)?;
/// let (mesh, report) = opened.dataset()?.to_trimesh(None)?;
/// assert_eq!((opened.format, mesh.num_triangles(), report.dropped()), ("STL", 1, 0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn open(path: impl AsRef<Path>) -> Result<LoadedFile, ReadError> {
    open_with(path, &OpenOptions::default())
}

/// As [`open`], with what the file does not say itself, or one of its times.
///
/// # Errors
/// Also if an option means nothing to the format of the file.
pub fn open_with(path: impl AsRef<Path>, options: &OpenOptions) -> Result<LoadedFile, ReadError> {
    let path = path.as_ref();
    if amrex::header_of(path).is_some() {
        options.refuse_gap().map_err(|f| f.in_file(path, amrex::FORMAT))?;
        return amrex::read(path, options);
    }
    if openfoam::is_case(path) || path.is_dir() {
        options.refuse_gap().map_err(|f| f.in_file(path, openfoam::FORMAT))?;
        return openfoam::read(path, options);
    }
    if let Some((file, time)) = time_axis::time_of_file(path) {
        options.refuse_time().map_err(|f| f.in_file(path, "series"))?;
        return open_with(file, &OpenOptions { time: Some(time), ..*options });
    }
    let mut head = Vec::new();
    let file = std::fs::File::open(path).map_err(|e| io_error(path, e))?;
    let length = file.metadata().map_err(|e| io_error(path, e))?.len();
    file.take(HEAD_BYTES).read_to_end(&mut head).map_err(|e| io_error(path, e))?;

    refuse_pointer(path, &head)?;
    refuse_stored(path, &head)?;
    let by_content = match head.starts_with(hdf5::MAGIC) || head.get(512..520) == Some(hdf5::MAGIC)
    {
        true => Some(from_hdf5(path)?),
        false => from_content(&head, length),
    };
    let by_name = from_name(path);
    let format = match (by_content, by_name) {
        (Some(f), _) | (None, Some(f)) => f,
        (None, None) => {
            // Binary files with extensions such as .bin or .dat: PLOT3D if the sizes add up.
            if !head.is_empty() && plot3d::looks_like_plot3d(&read_bytes(path)?) {
                Format::Plot3d
            } else {
                return Err(unknown(path, &head));
            }
        }
    };
    let takes_lattice =
        [Format::Numpy, Format::NetCdf, Format::Nrrd, Format::MetaImage, Format::Raw];
    if !takes_lattice.contains(&format) {
        options.refuse_lattice().map_err(|f| f.in_file(path, format.name()))?;
    }
    if format != Format::Csv {
        options.refuse_gap().map_err(|f| f.in_file(path, format.name()))?;
    }
    if !format.may_have_times() {
        options.refuse_time().map_err(|f| f.in_file(path, format.name()))?;
    }
    let mut opened = match format {
        Format::VtkXml => vtk_xml::read_at(path, options.time),
        Format::VtkSeries => vtk_xml::series::read(path, options.time),
        Format::VtkLegacy => vtk_legacy::read(path),
        Format::VtkHdf => vtkhdf::read(path, options),
        Format::NetCdf => netcdf::read(path, options),
        Format::Xdmf => xdmf::read(path, options),
        Format::Plot3d => plot3d::read(path, &plot3d::Plot3dOptions::default()),
        Format::Nrrd => nrrd::read_with(path, options),
        Format::MetaImage => mhd::read_with(path, options),
        Format::Raw => raw::read_with(path, options),
        Format::Numpy => npy::read(path, options),
        Format::Obj => obj::read(path),
        Format::Gltf => gltf::read(path),
        Format::Ply => ply::read(path),
        Format::Stl => stl::read(path),
        Format::Tecplot => tecplot::read(path, options),
        Format::EnSight => ensight::read(path, options),
        Format::Cgns => cgns::read(path, options),
        Format::Csv => csv_file::read(path, options),
    }?;
    // `.g` is PLOT3D's and Exodus II's.
    if let (Some(content), Some(name)) = (by_content, by_name)
        && content != name
        && content != Format::NetCdf
    {
        opened.warnings.push(format!("the name says {name:?}, the content is {}", opened.format));
    }
    Ok(opened)
}

fn from_content(head: &[u8], length: u64) -> Option<Format> {
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
    let contains = |what: &[u8]| text.windows(what.len()).any(|w| w == what);
    if text.to_ascii_lowercase().starts_with(b"# vtk datafile") {
        Some(Format::VtkLegacy)
    } else if text.starts_with(b"<") && contains(b"<VTKFile") {
        Some(Format::VtkXml)
    } else if text.starts_with(b"<") && (contains(b"<Xdmf") || contains(b"<xdmf")) {
        Some(Format::Xdmf)
    } else if text.starts_with(b"{") && contains(b"\"file-series-version\"") {
        Some(Format::VtkSeries)
    } else if head.starts_with(b"CDF") && head.get(3).is_some_and(|v| [1, 2, 5].contains(v)) {
        Some(Format::NetCdf)
    } else if cgns::begins_as_adf(head) {
        Some(Format::Cgns)
    } else if head.starts_with(npy::MAGIC) {
        Some(Format::Numpy)
    } else if tecplot::begins_as_tecplot(text) {
        Some(Format::Tecplot)
    } else if ensight::begins_as_case(text) {
        Some(Format::EnSight)
    } else if text.starts_with(b"NRRD000") {
        Some(Format::Nrrd)
    } else if text.starts_with(b"ply\n") || text.starts_with(b"ply\r") {
        Some(Format::Ply)
    } else if text.starts_with(b"glTF") || text.starts_with(b"{") && contains(b"\"asset\"") {
        Some(Format::Gltf)
    } else if text.starts_with(b"ObjectType") || text.starts_with(b"NDims") && contains(b"DimSize")
    {
        Some(Format::MetaImage)
    } else if text.starts_with(b"solid") && contains(b"facet") || stl_size(head, length) {
        Some(Format::Stl)
    } else {
        None
    }
}

/// What an HDF5 file holds, by the names in it.
fn from_hdf5(path: &Path) -> Result<Format, ReadError> {
    let file = hdf5::Hdf5File::open(path, hdf5::FORMAT)?;
    let of_names = || {
        let names = file.root()?.names()?;
        if names.iter().any(|n| n == cgns::VERSION_NODE) {
            return Ok(Some(Format::Cgns));
        }
        if names.iter().any(|n| n == vtkhdf::ROOT) {
            return Ok(Some(Format::VtkHdf));
        }
        Ok(netcdf::is_netcdf4(&file)?.then_some(Format::NetCdf))
    };
    let found = of_names().map_err(|f: Fault| f.in_file(path, hdf5::FORMAT))?;
    found.ok_or_else(|| {
        let what = "an HDF5 file that is neither VTKHDF, NetCDF-4 nor CGNS: describe it with an \
                    .xdmf file, or save it as .vtu with ParaView";
        ReadError::UnknownFormat { path: path.to_path_buf(), what: what.into(), known: KNOWN }
    })
}

/// Refuses files of stored meshes and volumes: they may be larger than memory.
fn refuse_stored(path: &Path, head: &[u8]) -> Result<(), ReadError> {
    let (format, cure) = if StoredMesh::recognizes(head) {
        ("stored mesh", "draw it with `bench render`, or open it by `datasets::stored_mesh::open`")
    } else if StoredVolume::recognizes(head) {
        let cure = "draw it with `bench render`, or open it by `datasets::stored_volume::open`";
        ("stored volume", cure)
    } else {
        return Ok(());
    };
    let what = "data that stay in their file";
    Err(Fault::unsupported(At::Byte(0), what, cure).in_file(path, format))
}

/// True if the number of triangles in the header of a binary STL file matches its length.
fn stl_size(head: &[u8], length: u64) -> bool {
    let n = head.get(80..84).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    n.is_some_and(|n| n > 0 && 84 + 50 * u64::from(n) == length)
}

fn from_name(path: &Path) -> Option<Format> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    Some(match extension.as_str() {
        "vti" | "vtp" | "vtu" | "vtr" | "vts" | "pvti" | "pvtp" | "pvtu" | "pvtr" | "pvts"
        | "pvd" | "vtm" | "vth" | "vthb" => Format::VtkXml,
        "series" => Format::VtkSeries,
        "vtk" => Format::VtkLegacy,
        "xdmf" | "xmf" | "xdmf2" | "xdmf3" => Format::Xdmf,
        "vtkhdf" => Format::VtkHdf,
        "nc" | "nc4" | "cdf" | "e" | "exo" | "ex2" | "exii" => Format::NetCdf,
        "xyz" | "x" | "g" | "grid" | "p3d" | "q" | "sol" => Format::Plot3d,
        "nrrd" | "nhdr" => Format::Nrrd,
        "mhd" | "mha" => Format::MetaImage,
        "raw" | "toml" => Format::Raw,
        "npy" | "npz" => Format::Numpy,
        "obj" => Format::Obj,
        "gltf" | "glb" => Format::Gltf,
        "ply" => Format::Ply,
        "stl" => Format::Stl,
        "tec" | "plt" => Format::Tecplot,
        "case" | "encas" => Format::EnSight,
        "cgns" => Format::Cgns,
        "csv" | "tsv" | "txt" => Format::Csv,
        _ => return None,
    })
}

fn unknown(path: &Path, head: &[u8]) -> ReadError {
    let extension =
        path.extension().map_or_else(|| "none".into(), |e| format!(".{}", e.to_string_lossy()));
    let what = if head.is_empty() {
        "the file is empty".to_string()
    } else if head.starts_with(&[0x1f, 0x8b]) {
        "compressed by gzip: unpack it first, for example with `gunzip --keep`".to_string()
    } else {
        let shown: String = head.iter().take(8).map(|b| format!("{b:02x}")).collect();
        format!("ending {extension}, first bytes {shown}")
    };
    ReadError::UnknownFormat { path: path.to_path_buf(), what, known: KNOWN }
}
