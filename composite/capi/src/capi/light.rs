//! Photographs of a gas of which every rank has a brick.

use super::compositing::timeout_of;
use super::group::collective;
use super::light_types::*;
use super::memory::{Owners, at, check_pointer, check_size, flag, put, read, unused};
use super::scene_types::*;
use super::status::{Failure, guarded};
use super::tuples::FLOATS;
use super::types::*;
use super::volumes::strides_of;
use composite::render::light::{
    Gas, GasBrick, GasValues, LightOptions, LightTechnique, Shot, photograph,
};
use rt_core::glam::{DVec3, UVec3};
use schlieren::interpolate::Interpolant;
use std::ffi::c_void;

/// Densities in memory of the program.
struct Densities {
    data: *const c_void,
    strides: [i64; 3],
    is_float: bool,
}

// SAFETY: the memory is read alone, and the program leaves it as it is during the call.
unsafe impl Sync for Densities {}

impl GasValues for Densities {
    #[inline]
    fn density(&self, node: UVec3) -> f64 {
        let [sx, sy, sz] = self.strides;
        let row = at(at(self.data, node.z.into(), sz), node.y.into(), sy);
        let number = at(row, node.x.into(), sx);
        // SAFETY: a node of the brick, whose numbers are readable by the program's promise, at any
        // alignment.
        unsafe {
            match self.is_float {
                true => number.cast::<f32>().read_unaligned().into(),
                false => number.cast::<f64>().read_unaligned(),
            }
        }
    }

    #[inline(always)]
    fn row<const N: usize>(&self, first: UVec3) -> [f64; N] {
        let [sx, sy, sz] = self.strides;
        let number =
            at(at(at(self.data, first.z.into(), sz), first.y.into(), sy), first.x.into(), sx);
        let mut row = [0.0; N];
        // SAFETY: nodes of the brick, as above; those of a row follow each other without gaps
        // where their stride is the size of a number.
        unsafe {
            match (self.is_float, sx) {
                (true, 4) => {
                    let values = number.cast::<[f32; N]>().read_unaligned();
                    for (value, number) in row.iter_mut().zip(values) {
                        *value = number.into();
                    }
                }
                (false, 8) => row = number.cast::<[f64; N]>().read_unaligned(),
                _ => {
                    for (n, value) in row.iter_mut().enumerate() {
                        *value = self.density(UVec3 { x: first.x + n as u32, ..first });
                    }
                }
            }
        }
        row
    }
}

/// Fills a shot; `struct_bytes` is sizeof of the structure.
///
/// # Safety
/// `shot` is null or points to `struct_bytes` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_shot_init(
    shot: *mut RtsvCompositeShot,
    struct_bytes: u64,
) -> RtsvCompositeStatus {
    guarded(|| {
        check_size::<RtsvCompositeShot>(struct_bytes)?;
        let value = RtsvCompositeShot {
            struct_bytes,
            width: 512,
            height: 512,
            technique: RTSV_COMPOSITE_KNIFE,
            interpolant: RTSV_COMPOSITE_TRILINEAR_GRADIENT,
            root: 0,
            threads: 0,
            direction: [0.0, 0.0, 1.0],
            up: [0.0, 1.0, 0.0],
            pixel_m: 0.0,
            step_voxels: 1.0,
            angle_deg: 0.0,
            slit_width_m: 1e-3,
            focal_length_m: 1.5,
            open_fraction: 0.5,
            focus_m: 0.0,
            timeout_secs: 60.0,
        };
        // SAFETY: the caller's promise.
        unsafe { put(shot, "shot", value) }
    })
}

fn shot_of(s: &RtsvCompositeShot) -> Result<Shot, Failure> {
    let other = |member: &str, value: u32, name: &str| {
        let text =
            format!("{member} of RtsvCompositeShot is {value}: give {name} or one beside it");
        Failure::value(text)
    };
    Ok(Shot {
        direction: DVec3::from(s.direction),
        up: DVec3::from(s.up),
        width: s.width,
        height: s.height,
        pixel_m: s.pixel_m,
        technique: match s.technique {
            RTSV_COMPOSITE_KNIFE => LightTechnique::Knife {
                angle_deg: s.angle_deg,
                slit_width_m: s.slit_width_m,
                focal_length_m: s.focal_length_m,
                open_fraction: s.open_fraction,
            },
            RTSV_COMPOSITE_SHADOWGRAPH => LightTechnique::Shadowgraph { focus_m: s.focus_m },
            value => return Err(other("technique", value, "RTSV_COMPOSITE_KNIFE")),
        },
        interpolant: match s.interpolant {
            RTSV_COMPOSITE_TRILINEAR_GRADIENT => Interpolant::TrilinearGradient,
            RTSV_COMPOSITE_TRILINEAR => Interpolant::Trilinear,
            value => return Err(other("interpolant", value, "RTSV_COMPOSITE_TRILINEAR_GRADIENT")),
        },
        step_voxels: s.step_voxels,
    })
}

/// Collective: photographs a gas of which every rank gives a brick (or null for none): light that
/// is bent by differences of density, also across the borders of bricks. Bricks of neighbours share
/// the points between them, and overlap by one layer of points more on either side for
/// RTSV_COMPOSITE_TRILINEAR_GRADIENT; points that several ranks have are the same on all. `values`
/// of a brick are densities, kg/m^3, which are read where they are and not copied, and may have any
/// strides; what is no finite number blocks light. The picture has the bits of one process.
///
/// # Safety
/// `gas`, `shot` and `photograph` are null or valid; `brick` is null or valid, with values as it
/// describes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtsv_composite_photograph(
    comm: *mut RtsvCompositeComm,
    gas: *const RtsvCompositeGas,
    brick: *const RtsvCompositeBrick,
    shot: *const RtsvCompositeShot,
    photograph: *mut RtsvCompositePhotograph,
) -> RtsvCompositeStatus {
    guarded(|| {
        let brick = match brick.is_null() {
            true => None,
            // SAFETY: the caller's promise, also below.
            false => Some(unsafe { read(brick, "brick") }?),
        };
        let _owners = Owners::of(&brick.map_or(Vec::new(), |b| vec![b.values]));
        collective(comm.addr(), |comm| {
            // SAFETY: as above.
            let (gas, given, out) = unsafe {
                let out = read(photograph.cast_const(), "photograph")?;
                (read(gas, "gas")?, read(shot, "shot")?, out)
            };
            unused(gas.reserved, "RtsvCompositeGas")?;
            let options = LightOptions {
                root: given.root as usize,
                timeout: timeout_of(given.timeout_secs, "RtsvCompositeShot")?,
                parallel: flag(given.threads, "threads of RtsvCompositeShot")?,
            };
            let pixels = u64::from(given.width) * u64::from(given.height);
            if comm.rank() == options.root {
                check_pointer(out.grey, "grey")?;
                if out.grey_count < pixels {
                    let count = out.grey_count;
                    return Err(Failure::value(format!(
                        "grey_count of RtsvCompositePhotograph is {count}, but there are {pixels} \
                         pixels"
                    )));
                }
            }
            let gas = Gas {
                dims: UVec3::from(gas.dims),
                origin_m: DVec3::from(gas.origin_m),
                spacing_m: DVec3::from(gas.spacing_m),
                gladstone_dale_m3_per_kg: gas.gladstone_dale,
                reference_density: gas.reference_density,
            };
            let densities = brick.as_ref().map(densities_of).transpose()?.flatten();
            let brick = brick.zip(densities.as_ref()).map(|(brick, values)| GasBrick {
                first: UVec3::from(brick.first),
                dims: UVec3::from(brick.dims),
                values,
            });
            let made = self::photograph(comm, &gas, brick.as_ref(), &shot_of(&given)?, &options)?;
            if let Some(picture) = &made.picture {
                // SAFETY: memory of the program for as many floats, which is not ours.
                unsafe { out.grey.copy_from_nonoverlapping(picture.as_ptr(), picture.len()) };
            }
            let report = made.report;
            let filled = RtsvCompositePhotograph {
                rays_sent: report.rays_sent,
                masked: report.masked,
                turned: report.turned,
                bytes_sent: report.bytes_sent,
                rounds: report.rounds,
                copies: 0,
                ..out
            };
            // SAFETY: as above.
            unsafe { put(photograph, "photograph", filled) }
        })
    })
}

/// The values of a brick where they are; `None` for a brick without points.
fn densities_of(brick: &RtsvCompositeBrick) -> Result<Option<Densities>, Failure> {
    unused(brick.reserved, "RtsvCompositeBrick")?;
    unused(brick.volume, "RtsvCompositeBrick, as its volume,")?;
    let strides =
        strides_of(brick, FLOATS).map_err(|f| Failure::value(format!("gas: brick: {}", f.text)))?;
    Ok(strides.map(|strides| Densities {
        data: brick.values.data,
        strides,
        is_float: brick.values.kind == RTSV_COMPOSITE_F32,
    }))
}
