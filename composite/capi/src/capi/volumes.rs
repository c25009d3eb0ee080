//! Volumes of a scene, and this rank's bricks of them.

use super::handles;
use super::memory::{Owners, at, flag, is_addressable, put, read, text, unused};
use super::scene::SceneObject;
use super::scene_types::*;
use super::status::{Failure, guarded};
use super::tuples::{FLOATS, NUMBERS, Tuples};
use super::types::*;
use composite::render::{DistributedVolume, PointBrick};
use rt_core::colormap::ColorMap;
use rt_core::glam::{DAffine3, DVec3, UVec3};
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{GridExtent, Interpolation, VolumeOptions};

/// Why no array of a volume can be borrowed.
const GRIDS_OWN: &str = "bricks own their values, as float, x fastest and without gaps";
/// Why tables are not borrowed.
const TABLES_OWN: &str = "transfer functions are kept in another form";

/// Adds a volume without values; `number` gets its number, which counts from 0. All ranks add the
/// same ones in the same order.
///
/// # Safety
/// `volume` is null or valid, with arrays as it describes; `number` is null (not asked for) or
/// points to a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_scene_volume(
    scene: *mut RtsvCompositeScene,
    volume: *const RtsvCompositeVolume,
    number: *mut u32,
) -> RtsvCompositeStatus {
    guarded(|| {
        // SAFETY: the caller's promise, also below.
        let v = unsafe { read(volume, "volume") }?;
        let _owners = Owners::of(&[v.colors, v.opacities]);
        handles::with(scene.addr(), |object: &mut SceneObject| {
            // SAFETY: as above.
            let name = unsafe { text(v.name, "name") }?;
            let shown = format!("volume `{name}`");
            let fault = |text: String| Failure::value(format!("{shown}: {text}"));
            let table = |array, what, components| {
                let found = Tuples::new(array, what, components, FLOATS);
                found
                    .map_err(|f| fault(f.text))?
                    .ok_or_else(|| fault(format!("{what}: none: give at least one")))
            };
            let colors = table(&v.colors, "colors", 3)?;
            let opacities = table(&v.opacities, "opacities", 2)?;
            let copies =
                [colors, opacities].map(|tuples| tuples.copied(&shown, TABLES_OWN)).concat();
            // SAFETY: as above.
            let (colors, opacities) =
                unsafe { (colors.values::<f32, 3>(), opacities.values::<f32, 2>()) };
            let colors = colors.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect();
            let colors = ColorMap::new(colors, v.range);
            let transfer =
                TransferFunction::from_opacity(colors, &opacities, v.unit_distance as f32);
            let interpolation = match flag(v.nearest, "nearest of RtsvCompositeVolume")? {
                true => Interpolation::Nearest,
                false => Interpolation::default(),
            };
            let (origin, spacing) = (DVec3::from(v.origin), DVec3::from(v.spacing));
            object.scene.volume(DistributedVolume {
                name,
                whole: GridExtent { dims: UVec3::from(v.dims), origin, spacing },
                transfer: transfer.map_err(|e| fault(e.to_string()))?,
                options: VolumeOptions { interpolation, ..VolumeOptions::default() },
                world_from_object: DAffine3::IDENTITY,
                bricks: Vec::new(),
            });
            object.copies += &copies;
            let added = object.scene.volumes_mut().len() - 1;
            if number.is_null() {
                return Ok(());
            }
            // SAFETY: as above.
            unsafe { put(number, "number", added as u32) }
        })
    })
}

/// Adds this rank's values on a box of points of a volume, any number of times.
///
/// # Safety
/// `brick` is null or valid, with values as it describes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_scene_brick(
    scene: *mut RtsvCompositeScene,
    brick: *const RtsvCompositeBrick,
) -> RtsvCompositeStatus {
    guarded(|| {
        // SAFETY: the caller's promise, also below.
        let b = unsafe { read(brick, "brick") }?;
        let _owners = Owners::of(&[b.values]);
        handles::with(scene.addr(), |object: &mut SceneObject| {
            unused(b.reserved, "RtsvCompositeBrick")?;
            let count = object.scene.volumes_mut().len();
            let Some(volume) = object.scene.volumes_mut().get_mut(b.volume as usize) else {
                return Err(Failure::value(format!(
                    "a brick of volume {}, but the scene has {count}: add the volume first",
                    b.volume
                )));
            };
            let shown = format!("volume `{}`", volume.name);
            let fault = |text: String| Failure::value(format!("{shown}: brick: {text}"));
            let strides = strides_of(&b, NUMBERS).map_err(|f| fault(f.text))?;
            let row = Tuples::new(&b.values, "values", 1, NUMBERS)?;
            let Some(([_, along_y, along_z], values)) = strides.zip(row) else { return Ok(()) };
            let [nx, ny, nz] = b.dims.map(u64::from);
            let mut numbers = Vec::with_capacity(b.values.count as usize);
            for z in 0..nz {
                for y in 0..ny {
                    let data = at(at(b.values.data, z, along_z), y, along_y);
                    let row = RtsvCompositeArray { data, count: nx, ..b.values };
                    let Some(row) = Tuples::new(&row, "values", 1, NUMBERS)? else { continue };
                    // SAFETY: as above.
                    numbers.extend((0..nx).map(|x| unsafe { row.value::<f32>(x, 0) }));
                }
            }
            object.copies += &values.copied(&shown, GRIDS_OWN);
            volume.bricks.push(PointBrick {
                first: UVec3::from(b.first),
                dims: UVec3::from(b.dims),
                values: numbers.into(),
            });
            Ok(())
        })
    })
}

/// Bytes from a value of a brick to the next along x, y and z, with numbers of `kinds`; `None` for
/// a brick without points.
pub(crate) fn strides_of(
    b: &RtsvCompositeBrick,
    kinds: &[u32],
) -> Result<Option<[i64; 3]>, Failure> {
    let [nx, ny, nz] = b.dims.map(u64::from);
    let points = nx.checked_mul(ny).and_then(|n| n.checked_mul(nz));
    if points != Some(b.values.count) {
        let (dims, count) = (b.dims, b.values.count);
        return Err(Failure::value(format!(
            "{count} values for {dims:?} points: give one for each"
        )));
    }
    // The strides of an array in three axes are not that of a list, which could not be addressed
    // where values have gaps and rows overlap.
    let row = RtsvCompositeArray { count: nx.min(b.values.count), ..b.values };
    let Some(along_x) = Tuples::new(&row, "values", 1, kinds)?.map(|row| row.stride()) else {
        return Ok(None);
    };
    let or_without_gaps = |given: i64, below: Option<i64>, count: u64| match given {
        0 => below.and_then(|stride| stride.checked_mul(count as i64)),
        given => Some(given),
    };
    let along_y = or_without_gaps(b.row_bytes, Some(along_x), nx);
    let along_z = or_without_gaps(b.slice_bytes, along_y, ny);
    let (Some(along_y), Some(along_z)) = (along_y, along_z) else {
        return Err(Failure::value("no memory is so large"));
    };
    let strides = [along_x, along_y, along_z];
    if !is_addressable(&[nx, ny, nz], &strides, 8) {
        return Err(Failure::value(format!(
            "rows {along_y} and slices {along_z} bytes apart: no memory is so large"
        )));
    }
    Ok(Some(strides))
}
