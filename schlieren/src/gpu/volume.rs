//! Copies the field to the device: its nodes or the coefficients of its spline, in slabs of layers
//! that fit a binding.

use super::bricks::DeviceBricks;
use super::kernel::{FIRST_SLAB, FieldLayout};
use super::projection::DeviceProjection;
use super::rows::{self, Rows};
use super::{Gpu, GpuError};
use crate::field::{Field, Node};
use crate::interpolate::{BSpline, Interpolant, TrilinearGradient};
use crate::march::{FieldCache, LineOfSight};
use std::sync::{Arc, Mutex, PoisonError};

/// Keeps a field on the device for the next image of it. The owner must pass the same field to
/// every call.
#[derive(Default)]
pub struct VolumeCache {
    kept: Mutex<Option<Kept>>,
    projection: Mutex<Option<KeptProjection>>,
}

struct Kept {
    gpu: Arc<Gpu>,
    interpolant: Interpolant,
    skip: bool,
    volume: Arc<DeviceVolume>,
}

struct KeptProjection {
    gpu: Arc<Gpu>,
    sight: Arc<LineOfSight>,
    volume: Arc<DeviceVolume>,
}

impl VolumeCache {
    /// A projection of the field on a device, and the number of bytes that were copied there for
    /// it. The newest is kept.
    ///
    /// # Errors
    /// If it does not fit, or the device fails.
    pub(super) fn projection(
        &self,
        gpu: &Arc<Gpu>,
        sight: &Arc<LineOfSight>,
    ) -> Result<(Arc<DeviceVolume>, u64), GpuError> {
        let mut kept = self.projection.lock().unwrap_or_else(PoisonError::into_inner);
        let is_this =
            |k: &&KeptProjection| Arc::ptr_eq(&k.gpu, gpu) && Arc::ptr_eq(&k.sight, sight);
        if let Some(kept) = kept.as_ref().filter(is_this) {
            return Ok((Arc::clone(&kept.volume), 0));
        }
        let volume = Arc::new(DeviceVolume::projected(gpu, sight)?);
        let (gpu, sight) = (Arc::clone(gpu), Arc::clone(sight));
        *kept = Some(KeptProjection { gpu, sight, volume: Arc::clone(&volume) });
        let bytes = volume.bytes;
        Ok((volume, bytes))
    }

    /// The field on a device, and the number of bytes that were copied there for it. The newest is
    /// kept.
    ///
    /// # Errors
    /// If it does not fit, or the device fails.
    pub(super) fn volume(
        &self,
        gpu: &Arc<Gpu>,
        field: &Field,
        (interpolant, skip): (Interpolant, bool),
        cache: &FieldCache,
    ) -> Result<(Arc<DeviceVolume>, u64), GpuError> {
        let lock = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let is_this =
            |k: &&Kept| Arc::ptr_eq(&k.gpu, gpu) && k.interpolant == interpolant && k.skip == skip;
        if let Some(kept) = lock().as_ref().filter(is_this) {
            return Ok((Arc::clone(&kept.volume), 0));
        }
        // No lock is held meanwhile: all threads take part in the spline.
        let values = match interpolant {
            Interpolant::BSpline => NodeValues::BSpline(cache.spline(field)),
            Interpolant::Trilinear => NodeValues::Trilinear,
            Interpolant::TrilinearGradient => {
                NodeValues::TrilinearGradient(TrilinearGradient::new(field))
            }
        };
        let bricks =
            skip.then(|| DeviceBricks::new(gpu, field, &cache.spline(field), false)).transpose()?;
        let volume = Arc::new(DeviceVolume::new(gpu, field, &values, bricks)?);
        let (gpu, kept) = (Arc::clone(gpu), Arc::clone(&volume));
        *lock() = Some(Kept { gpu, interpolant, skip, volume: kept });
        let bytes = volume.bytes;
        Ok((volume, bytes))
    }
}

/// What an interpolant reads at the nodes of a field.
pub(super) enum NodeValues {
    /// Coefficients.
    BSpline(Arc<BSpline>),
    /// The field's own values.
    Trilinear,
    /// Central differences and eps.
    TrilinearGradient(TrilinearGradient),
}

impl NodeValues {
    /// Computed by the calling thread alone, which waits for no other thread.
    pub(super) fn on_this_thread(field: &Field, interpolant: Interpolant) -> NodeValues {
        match interpolant {
            Interpolant::BSpline => NodeValues::BSpline(Arc::new(BSpline::on_this_thread(field))),
            Interpolant::Trilinear => NodeValues::Trilinear,
            Interpolant::TrilinearGradient => {
                NodeValues::TrilinearGradient(TrilinearGradient::on_this_thread(field))
            }
        }
    }

    /// The numbers, how many of them a node has, and the strides of neighbours along y and z, in
    /// nodes.
    fn numbers<'a>(&'a self, field: &'a Field) -> (&'a [f32], usize, [usize; 2]) {
        match self {
            NodeValues::BSpline(spline) => {
                let (coefficients, stride) = spline.coefficients();
                (coefficients, 1, stride)
            }
            NodeValues::Trilinear => {
                let [nx, ny, _] = field.dims();
                (field.eps(), 1, [nx, nx * ny])
            }
            NodeValues::TrilinearGradient(gradient) => {
                let (nodes, stride) = gradient.nodes();
                (nodes, 4, stride)
            }
        }
    }

    /// Number of layers of nodes that a slab holds beyond its cells.
    fn halo(&self) -> usize {
        match self {
            NodeValues::BSpline(_) => 3,
            NodeValues::Trilinear | NodeValues::TrilinearGradient(_) => 1,
        }
    }
}

/// The numbers of a field on the device.
pub(super) enum Values {
    /// Slabs along z. Neighbouring slabs share the layers that cells at their border need.
    Slabs(Vec<wgpu::Buffer>),
    /// Coefficients of the spline, each with the three that follow.
    Rows(Rows),
    /// Its projection along the light.
    Projection(DeviceProjection),
}

impl Values {
    pub(super) fn layout(&self) -> FieldLayout {
        match self {
            Values::Slabs(slabs) => FieldLayout::Slabs(slabs.len() as u32),
            Values::Rows(Rows::Texture(_)) => FieldLayout::RowTexture,
            Values::Rows(Rows::Buffer(_)) => FieldLayout::RowBuffer,
            Values::Projection(projection) => projection.layout(),
        }
    }

    /// What a kernel binds.
    pub(super) fn bindings(&self) -> Vec<(u32, wgpu::BindingResource<'_>)> {
        match self {
            Values::Slabs(slabs) => {
                let resources = slabs.iter().map(wgpu::Buffer::as_entire_binding);
                (FIRST_SLAB..).zip(resources).collect()
            }
            Values::Rows(Rows::Texture(view)) => {
                vec![(FIRST_SLAB, wgpu::BindingResource::TextureView(view))]
            }
            Values::Rows(Rows::Buffer(rows)) => vec![(FIRST_SLAB, rows.as_entire_binding())],
            Values::Projection(projection) => projection.bindings(),
        }
    }
}

/// A field on the device.
pub(super) struct DeviceVolume {
    /// Its nodes or coefficients.
    pub(super) values: Values,
    /// Kinds of the nodes, two bits each, if not all are gas.
    pub(super) kinds: Option<wgpu::Buffer>,
    /// Bricks, if rays skip them.
    pub(super) bricks: Option<DeviceBricks>,
    /// Strides of neighbours along y and z.
    pub(super) stride: [usize; 2],
    /// Number of layers of cells in a slab.
    pub(super) layers: usize,
    /// Memory on the device in bytes.
    pub(super) bytes: u64,
}

impl DeviceVolume {
    /// Uploads what an interpolant of the field reads.
    pub(super) fn new(
        gpu: &Gpu,
        field: &Field,
        values: &NodeValues,
        bricks: Option<DeviceBricks>,
    ) -> Result<DeviceVolume, GpuError> {
        let [nx, ny, nz] = field.dims();
        let is_spline = matches!(values, NodeValues::BSpline(_));
        let halo = values.halo();
        let (values, per_node, stride) = values.numbers(field);
        let too_large = |what, need, available| GpuError::TooLarge {
            what,
            dims: field.dims(),
            need,
            available,
            adapter: gpu.name(),
        };
        let words = field.nodes().map(packed);
        if let Some(w) = words.as_ref().filter(|w| size_of_val(&w[..]) as u64 > gpu.binding_bytes())
        {
            let (need, available) =
                (bytes_of(size_of_val(&w[..]) as u64), bytes_of(gpu.binding_bytes()));
            return Err(too_large("the mask", need, available));
        }
        let kinds = words.map(|w| gpu.upload(bytemuck::cast_slice(&w))).transpose()?;
        let of_others = [kinds.as_ref(), bricks.as_ref().map(|b| &b.buffer)]
            .into_iter()
            .flatten()
            .map(wgpu::Buffer::size)
            .sum::<u64>();
        // Skipping takes two bindings.
        let most_slabs = gpu.slabs().saturating_sub(if bricks.is_some() { 2 } else { 0 });
        if is_spline && let Some(rows) = rows::upload(gpu, values, [nx + 2, ny + 2, nz + 2])? {
            let (rows, stride, of_rows) = rows;
            let (values, bytes) = (Values::Rows(rows), of_others + of_rows);
            return Ok(DeviceVolume { values, kinds, bricks, stride, layers: nz - 1, bytes });
        }
        let layer = per_node * stride[1];
        let Some((count, layers)) =
            cut(nz - 1, halo, (4 * layer) as u64, gpu.binding_bytes(), most_slabs)
        else {
            let need = bytes_of(size_of_val(values) as u64);
            let available = format!("{most_slabs} bindings of {}", bytes_of(gpu.binding_bytes()));
            return Err(too_large("a field", need, available));
        };
        let slabs = (0..count)
            .map(|s| {
                let first = s * layers;
                let last = (first + layers).min(nz - 1) + halo;
                gpu.upload(bytemuck::cast_slice(&values[first * layer..last * layer]))
            })
            .collect::<Result<Vec<_>, _>>()?;
        let bytes = of_others + slabs.iter().map(wgpu::Buffer::size).sum::<u64>();
        Ok(DeviceVolume { values: Values::Slabs(slabs), kinds, bricks, stride, layers, bytes })
    }
}

impl DeviceVolume {
    /// Uploads the field's projection along the light.
    ///
    /// # Errors
    /// If it does not fit, or the device fails.
    pub(super) fn projected(gpu: &Gpu, sight: &LineOfSight) -> Result<DeviceVolume, GpuError> {
        let projection = DeviceProjection::new(gpu, sight)?;
        let map = sight.projection().0;
        let node = |kind: &u8| match kind {
            0 => Node::Gas,
            1 => Node::Blank,
            _ => Node::Solid,
        };
        let kinds = map.kinds.as_ref().map(|k| packed(&k.iter().map(node).collect::<Vec<_>>()));
        let kinds = kinds.map(|k| gpu.upload(bytemuck::cast_slice(&k))).transpose()?;
        let bytes = projection.bytes() + kinds.as_ref().map_or(0, wgpu::Buffer::size);
        let values = Values::Projection(projection);
        Ok(DeviceVolume { values, kinds, bricks: None, stride: [map.row, 0], layers: 0, bytes })
    }
}

/// Number of slabs and layers of cells in each, so that every slab fits a binding. The last slab
/// may have fewer layers. `None` if this needs more than `most` slabs.
fn cut(
    cells: usize,
    halo: usize,
    layer_bytes: u64,
    binding_bytes: u64,
    most: u32,
) -> Option<(usize, usize)> {
    let layers = usize::try_from(binding_bytes / layer_bytes).ok()?.checked_sub(halo)?.min(cells);
    if layers == 0 {
        return None;
    }
    let count = cells.div_ceil(layers);
    (count <= most as usize).then_some((count, layers))
}

/// Packs two bits per node, sixteen nodes per word.
fn packed(nodes: &[Node]) -> Vec<u32> {
    let word = |w: &[Node]| w.iter().enumerate().fold(0, |a, (i, n)| a | (*n as u32) << (2 * i));
    nodes.chunks(16).map(word).collect()
}

fn bytes_of(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slabs_hold_all_cells_and_no_more_than_a_binding() {
        assert_eq!(cut(255, 1, 1000, 256_000, 8), Some((1, 255)), "fits as a whole");
        assert_eq!(cut(255, 1, 1000, 255_999, 8), Some((2, 254)), "one cell too many");
        assert_eq!(cut(255, 3, 1000, 43_999, 8), Some((7, 40)));
        assert_eq!(cut(255, 3, 1000, 20_000, 8), None, "too many slabs");
        assert_eq!(cut(255, 3, 1000, 3_999, 1000), None, "not even one layer of cells");
        assert_eq!(cut(255, 3, 1000, 0, 1000), None);
    }

    #[test]
    fn nodes_are_packed_from_the_lowest_bits() {
        let mut nodes = [Node::Gas; 18];
        (nodes[1], nodes[15], nodes[17]) = (Node::Blank, Node::Solid, Node::Solid);
        assert_eq!(packed(&nodes), [0x8000_0004, 0x8]);
    }
}
