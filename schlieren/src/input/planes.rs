//! Reads a large volume (NRRD, MetaImage, raw) plane by plane as averages over blocks of nodes, so
//! that it is never in memory as a whole.
//!
//! The lattice of averages has every b-th node. Its values are means over the b nodes around, along
//! each axis, with half weights at both ends where b is even: exact for a linear field. Where the
//! field ends, there are as many nodes on both sides as on the shorter one.

use super::{InputError, Options};
use datasets::free_memory::available_bytes;
use datasets::model::{DataArray, Dataset, ImageData, Values};
use datasets::read::volume_planes::VolumePlanes;
use datasets::resample::Resolution;
use glam::DVec3;
use std::path::Path;

/// Volumes of more nodes are averaged when fewer are asked for: half a GiB in single precision.
/// Smaller ones are reconstructed from all their nodes.
const MOST_NODES: u64 = 1 << 27;

/// Bytes that a node takes while a field is made of it: what the file has, the index in double
/// precision, and the field.
const BYTES_PER_NODE: u64 = 20;

/// The averages of a file's volume, and what to tell of them; `None` for a file that is to be read
/// as a whole.
///
/// # Errors
/// If the file cannot be read, or is known not to fit the memory that is free.
pub(super) fn averaged(
    path: &Path,
    options: &Options,
) -> Result<Option<(Dataset, Vec<String>)>, InputError> {
    averaged_above(path, options, MOST_NODES)
}

fn averaged_above(
    path: &Path,
    options: &Options,
    most_nodes: u64,
) -> Result<Option<(Dataset, Vec<String>)>, InputError> {
    // What the reader refuses, it refuses by name.
    let is_asked_of_reader = options.file.time.is_some() || options.file.gap.is_some();
    let is_plain = options.bounds.is_none() && options.depth.is_none() && !is_asked_of_reader;
    let (true, Some(planes)) = (is_plain, VolumePlanes::open(path)?) else { return Ok(None) };
    let dims = planes.layout().dims.to_array().map(|n| n as usize);
    let nodes = dims.iter().map(|n| *n as u64).product::<u64>();
    if nodes <= most_nodes {
        return Ok(None);
    }
    check_lattice(options)?;
    let longest = dims.into_iter().max().unwrap_or(1);
    match options.resolution {
        Resolution::Longest(wanted) if wanted >= 2 && wanted < longest => {
            let block = (longest - 1).div_ceil(wanted - 1);
            if let Some(short) = dims.into_iter().find(|n| *n > 1 && *n <= block) {
                return Err(InputError::Option {
                    what: format!("averages over {block} nodes leave one of {short} along an axis"),
                    cure: "ask for more nodes with --resample (flow.resample_nodes)",
                });
            }
            averages(planes, block, options).map(Some)
        }
        _ => {
            let need = nodes.saturating_mul(BYTES_PER_NODE);
            match available_bytes().filter(|free| *free < need) {
                Some(free) => Err(too_large(nodes, need, free)),
                None => Ok(None),
            }
        }
    }
}

/// What the reader of a whole file checks, too.
fn check_lattice(options: &Options) -> Result<(), InputError> {
    let is_finite = |v: Option<[f64; 3]>| v.is_none_or(|v| v.iter().all(|x| x.is_finite()));
    let (spacing, origin) = (options.file.spacing, options.file.origin);
    if !is_finite(spacing) || !spacing.is_none_or(|v| v.iter().all(|x| *x > 0.0)) {
        return Err(InputError::Option {
            what: format!("the spacing is {:?}", spacing.unwrap_or_default()),
            cure: "give finite numbers above 0",
        });
    }
    if !is_finite(origin) {
        return Err(InputError::Option {
            what: format!("the origin is {:?}", origin.unwrap_or_default()),
            cure: "give finite numbers",
        });
    }
    Ok(())
}

fn too_large(nodes: u64, need: u64, free: u64) -> InputError {
    let gib = |bytes: u64| bytes as f64 / f64::from(1 << 30);
    InputError::Option {
        what: format!(
            "a field of the file's {nodes} nodes takes {:.1} GiB, and {:.1} GiB are free",
            gib(need),
            gib(free)
        ),
        cure: "ask for fewer nodes, which are averages: --resample NODES (flow.resample_nodes)",
    }
}

/// Fine nodes of a coarse one along an axis: from `first` to `last`, the ends by half if `halved`.
#[derive(Clone, Copy)]
struct Window {
    first: usize,
    last: usize,
    halved: bool,
}

impl Window {
    fn new(coarse: usize, block: usize, nodes: usize) -> Window {
        let middle = coarse * block;
        let reach = (block / 2).min(middle).min(nodes - 1 - middle);
        // Near the faces, fewer whole nodes.
        let halved = block.is_multiple_of(2) && reach == block / 2;
        Window { first: middle - reach, last: middle + reach, halved }
    }

    fn weight(&self, fine: usize) -> f64 {
        if self.halved && (fine == self.first || fine == self.last) { 0.5 } else { 1.0 }
    }

    fn nodes(&self) -> impl Iterator<Item = (usize, f64)> + use<> {
        let window = *self;
        (self.first..=self.last).map(move |fine| (fine, window.weight(fine)))
    }
}

/// Sums of values and weights, of nodes that have a value.
#[derive(Clone, Copy, Default)]
struct Sum {
    values: f64,
    weights: f64,
}

impl Sum {
    fn add(&mut self, other: Sum, weight: f64) {
        self.values += weight * other.values;
        self.weights += weight * other.weights;
    }
}

fn averages(
    mut planes: VolumePlanes,
    block: usize,
    options: &Options,
) -> Result<(Dataset, Vec<String>), InputError> {
    let layout = planes.layout();
    let [nx, ny, nz] = layout.dims.to_array().map(|n| n as usize);
    let coarse = [nx, ny, nz].map(|n| (n - 1) / block + 1);
    let [mx, my, mz] = coarse;
    let windows = |nodes: usize, count: usize| -> Vec<Window> {
        (0..count).map(|c| Window::new(c, block, nodes)).collect()
    };
    let [of_x, of_y, of_z] = [windows(nx, mx), windows(ny, my), windows(nz, mz)];
    let mut values = vec![f32::NAN; mx * my * mz];
    // Layers that have begun and not ended, with their sums.
    let mut layers: Vec<(usize, Vec<Sum>)> = Vec::new();
    // Nodes without a value in the middle of a block have none of their own.
    let mut known = vec![false; mx * my * mz];
    for k in 0..nz {
        let plane = planes.next_numbers().ok_or_else(|| ends_early(k, nz))??;
        let sums = of_plane(&plane, [nx, ny], &of_x, &of_y);
        if k % block == 0 && k / block < mz {
            let c = k / block;
            for (j, i) in (0..my).flat_map(|j| (0..mx).map(move |i| (j, i))) {
                known[i + mx * (j + my * c)] = plane[i * block + nx * j * block].is_finite();
            }
        }
        // Windows of neighbours share at most a plane.
        for c in [k / block, k / block + 1].into_iter().filter(|c| *c < mz) {
            let window = of_z[c];
            if !(window.first..=window.last).contains(&k) {
                continue;
            }
            let at = match layers.iter().position(|l| l.0 == c) {
                Some(at) => at,
                None => {
                    layers.push((c, vec![Sum::default(); mx * my]));
                    layers.len() - 1
                }
            };
            for (sum, of_plane) in layers[at].1.iter_mut().zip(&sums) {
                sum.add(*of_plane, window.weight(k));
            }
            if k == window.last {
                let (c, sums) = layers.swap_remove(at);
                for (n, sum) in sums.iter().enumerate() {
                    let to = n + mx * my * c;
                    if known[to] && sum.weights > 0.0 {
                        values[to] = (sum.values / sum.weights) as f32;
                    }
                }
            }
        }
    }
    let spacing = options.file.spacing.map_or(layout.spacing, DVec3::from_array);
    let origin = options.file.origin.map_or(layout.origin, DVec3::from_array);
    let dims = coarse.map(|n| n as u32);
    let mut image = ImageData::new(dims, origin, spacing * block as f64);
    let array = DataArray::new(planes.name().to_owned(), 1, Values::F32(values));
    image.attributes.point_scalars = Some(array.name.clone());
    image.attributes.point.push(array);
    let mut warnings = planes.warnings().to_vec();
    warnings.push(said([nx, ny, nz], coarse, block));
    Ok((Dataset::ImageData(image), warnings))
}

/// Sums over blocks of a plane, for each coarse node of it.
fn of_plane(plane: &[f32], [nx, ny]: [usize; 2], of_x: &[Window], of_y: &[Window]) -> Vec<Sum> {
    use rayon::prelude::*;
    // Sums along the rows first, then of rows.
    let rows: Vec<Vec<Sum>> = (0..ny)
        .into_par_iter()
        .map(|j| {
            let row = &plane[j * nx..(j + 1) * nx];
            let of = |window: &Window| {
                let mut sum = Sum::default();
                for (i, weight) in window.nodes() {
                    let value = f64::from(row[i]);
                    if value.is_finite() {
                        sum.add(Sum { values: value, weights: 1.0 }, weight);
                    }
                }
                sum
            };
            of_x.iter().map(of).collect()
        })
        .collect();
    let mut sums = vec![Sum::default(); of_x.len() * of_y.len()];
    sums.par_chunks_mut(of_x.len()).zip(of_y).for_each(|(sums, window)| {
        for (j, weight) in window.nodes() {
            sums.iter_mut().zip(&rows[j]).for_each(|(s, r)| s.add(*r, weight));
        }
    });
    sums
}

fn ends_early(plane: usize, of: usize) -> InputError {
    InputError::Option {
        what: format!("the file has {plane} of {of} planes"),
        cure: "write it again",
    }
}

fn said(fine: [usize; 3], coarse: [usize; 3], block: usize) -> String {
    let size = |d: [usize; 3]| format!("{} x {} x {}", d[0], d[1], d[2]);
    let mut text = format!(
        "the file's {} nodes were read plane by plane, and became averages over {block}³ of them: {} \
         nodes",
        size(fine),
        size(coarse)
    );
    let left = [0, 1, 2].map(|a| fine[a] - 1 - (coarse[a] - 1) * block);
    if left != [0; 3] {
        let [x, y, z] = left;
        text += &format!("; the last {x}, {y} and {z} nodes along x, y and z are left out");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::Medium;
    use datasets::read::OpenOptions;
    use proptest::prelude::*;
    use std::path::PathBuf;

    fn write_nrrd(folder: &Path, dims: [usize; 3], value: impl Fn([usize; 3]) -> f32) -> PathBuf {
        let path = folder.join("flow.nrrd");
        let [nx, ny, nz] = dims;
        let mut bytes = format!(
            "NRRD0004\ntype: float\ndimension: 3\nsizes: {nx} {ny} {nz}\nspacings: 0.5 0.25 \
             1\nencoding: raw\nendian: little\n\n"
        )
        .into_bytes();
        for n in 0..nx * ny * nz {
            let at = [n % nx, n / nx % ny, n / (nx * ny)];
            bytes.extend(value(at).to_le_bytes());
        }
        std::fs::write(&path, bytes).unwrap();
        path
    }

    fn options(nodes: usize) -> Options {
        let resolution = Resolution::Longest(nodes);
        Options { resolution, ..Options::new(Medium::density("flow")) }
    }

    fn image(made: Option<(Dataset, Vec<String>)>) -> (ImageData, Vec<f64>, Vec<String>) {
        let Some((Dataset::ImageData(image), warnings)) = made else { panic!("no averages") };
        let array = &image.attributes.point[0];
        let values = (0..array.tuples()).map(|i| array.get(i, 0)).collect();
        (image, values, warnings)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        /// Averages of a linear field are its values, for any size and any block, and a constant
        /// stays one around places without data.
        #[test]
        fn averages_keep_what_is_linear(
            dims in prop::array::uniform3(2usize..14),
            wanted in 2usize..9,
            hole in prop::option::of(prop::array::uniform3(0usize..14)),
        ) {
            let folder = tempfile::tempdir().unwrap();
            let linear = |[x, y, z]: [usize; 3]| 3.0 + 0.5 * x as f32 - 0.25 * y as f32 + z as f32;
            let value = |at: [usize; 3]| match hole {
                Some(hole) if at == hole => f32::NAN,
                Some(_) => 7.0,
                None => linear(at),
            };
            let path = write_nrrd(folder.path(), dims, value);
            let made = averaged_above(&path, &options(wanted), 1);
            let longest = dims.into_iter().max().unwrap();
            if wanted >= longest {
                prop_assert!(made.unwrap().is_none());
                return Ok(());
            }
            let block = (longest - 1).div_ceil(wanted - 1);
            if dims.into_iter().any(|n| n <= block) {
                prop_assert!(made.unwrap_err().to_string().contains("leave one of"));
                return Ok(());
            }
            let (image, values, warnings) = image(made.unwrap());
            let [mx, my, _] = image.dims();
            prop_assert!(image.dims().into_iter().max().unwrap() <= wanted);
            prop_assert_eq!(image.spacing, DVec3::new(0.5, 0.25, 1.0) * block as f64);
            for (n, found) in values.into_iter().enumerate() {
                let at = [n % mx, n / mx % my, n / (mx * my)].map(|i| i * block);
                let expected = value(at);
                prop_assert_eq!(found.is_nan(), expected.is_nan());
                prop_assert!(found.is_nan() || (found - f64::from(expected)).abs() < 1e-5);
            }
            prop_assert!(warnings[0].contains("plane by plane"));
        }
    }

    #[test]
    fn what_is_finer_than_a_block_is_averaged_away() {
        let folder = tempfile::tempdir().unwrap();
        // A wave of two nodes.
        let path = write_nrrd(folder.path(), [33; 3], |[x, ..]| if x % 2 == 0 { 1.0 } else { 3.0 });
        let (image, values, warnings) = image(averaged_above(&path, &options(9), 1).unwrap());
        assert_eq!(image.dims(), [9; 3]);
        let inner = |n: &usize| (1..8).contains(&(n % 9));
        assert!((0..values.len()).filter(inner).all(|n| (values[n] - 2.0).abs() < 1e-6));
        assert!(!warnings[0].contains("left out"), "{warnings:?}");
    }

    #[test]
    fn small_files_are_read_as_a_whole_and_large_ones_without_a_size_only_if_they_fit() {
        let folder = tempfile::tempdir().unwrap();
        let path = write_nrrd(folder.path(), [9; 3], |_| 1.2);
        assert!(averaged(&path, &options(4)).unwrap().is_none());
        let all = Options { resolution: Resolution::Auto, ..options(2) };
        assert!(averaged_above(&path, &all, 1).unwrap().is_none(), "it fits");
        let error = too_large(1 << 33, 20 << 33, 8 << 30).to_string();
        assert!(error.contains("160.0 GiB") && error.contains("--resample NODES"), "{error}");
    }

    #[test]
    fn options_of_the_reader_are_kept_or_refused_as_it_does() {
        let folder = tempfile::tempdir().unwrap();
        let path = write_nrrd(folder.path(), [9; 3], |_| 1.2);
        let with = |file| averaged_above(&path, &Options { file, ..options(5) }, 1);
        let spacing = Some([2.0; 3]);
        let (image, ..) = image(with(OpenOptions { spacing, ..Default::default() }).unwrap());
        assert_eq!(image.spacing, DVec3::splat(4.0));
        for wrong in [[0.0, 1.0, 1.0], [1.0, f64::NAN, 1.0]] {
            let file = OpenOptions { spacing: Some(wrong), ..Default::default() };
            assert!(with(file).unwrap_err().to_string().contains("above 0"));
        }
        // A time is left to the reader, which refuses it.
        let time = Some(1.0);
        assert!(with(OpenOptions { time, ..Default::default() }).unwrap().is_none());
    }

    #[test]
    fn a_file_that_is_cut_is_an_error_that_names_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = write_nrrd(folder.path(), [9; 3], |_| 1.2);
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 5]).unwrap();
        let error = averaged_above(&path, &options(4), 1).unwrap_err().to_string();
        assert!(error.contains("flow.nrrd"), "{error}");
    }
}
