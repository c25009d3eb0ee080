//! Converts grids of scalars to rt-core's volumes and caches them until their scalars change. Also
//! computes the depth of a volume in the window.

use crate::input::{Scalars, View, Volume as Input, VolumeBlend};
use rayon::prelude::*;
use rt_core::colormap::ColorMap;
use rt_core::glam::{DAffine3, DMat3, DMat4, DVec3, DVec4, UVec3};
use rt_core::grid::Grid;
use rt_core::scene::VolumeInstance;
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{
    Blend, ClipPlane, Cropping, GradientOpacity, Interpolation, Volume, VolumeHighlight,
    VolumeLight, VolumeOptions, VolumeShading,
};
use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

/// Opacity 1 would mean infinite extinction.
const MAX_OPACITY: f32 = 0.999_999;
/// Number of values per task.
const CHUNK: usize = 1 << 14;

/// The cached volume of one grid.
struct CachedVolume {
    volume: Arc<Volume>,
    /// Hash of everything except the scalars.
    appearance: u64,
    used: bool,
}

/// The cached volumes of a renderer.
#[derive(Default)]
pub(crate) struct VolumeCache {
    kept: HashMap<u64, CachedVolume>,
    placed: Vec<VolumeInstance>,
}

impl VolumeCache {
    /// Starts a new frame.
    pub(crate) fn begin(&mut self) {
        self.placed.clear();
        self.kept.values_mut().for_each(|m| m.used = false);
    }

    /// See [`crate::bridge::Bridge::has_volume`].
    pub(crate) fn has(&self, key: u64) -> bool {
        key != 0 && self.kept.contains_key(&key)
    }

    /// The volumes of this frame.
    pub(crate) fn placed(&self) -> &[VolumeInstance] {
        &self.placed
    }

    /// Drops grids that were not added in this frame.
    pub(crate) fn forget_unused(&mut self) {
        self.kept.retain(|_, m| m.used);
    }

    /// Adds `v` at `place` and hashes its appearance into `content`. Returns the number of cells
    /// and an optional note for the user.
    pub(crate) fn add(
        &mut self,
        v: &Input<'_>,
        place: DAffine3,
        content: &mut DefaultHasher,
    ) -> Result<(u64, Option<String>), String> {
        // Lights are stored in the volume's axes, so a rotated volume has a different appearance.
        let lights = lights(v, place)?;
        let appearance = appearance_hash(v, &lights);
        let place = place * DAffine3::from_translation(-border(v));
        let seen = Seen::of(v, place);
        (v.key, appearance).hash(content);
        format!("{seen:?}{place:?}").hash(content);
        let kept = self.kept.get_mut(&v.key).filter(|_| v.key != 0);
        let volume = match kept {
            Some(kept) if kept.appearance == appearance => {
                kept.used = true;
                if !seen.is_of(&kept.volume) {
                    kept.volume = seen.applied(&kept.volume)?;
                }
                Arc::clone(&kept.volume)
            }
            Some(kept) => {
                let grid = Arc::clone(kept.volume.grid());
                *kept = CachedVolume {
                    volume: Arc::new(medium(v, seen, grid, lights)?),
                    appearance,
                    used: true,
                };
                Arc::clone(&kept.volume)
            }
            None => {
                let volume = Arc::new(medium(v, seen, Arc::new(grid(v)?), lights)?);
                self.kept.insert(
                    v.key,
                    CachedVolume { volume: Arc::clone(&volume), appearance, used: true },
                );
                volume
            }
        };
        let report = volume.report();
        let bad = report.cells_non_finite;
        let warning = (bad > 0).then(|| {
            format!("{bad} cells have a corner that is not a number; nothing is drawn in them")
        });
        self.placed.push(VolumeInstance { volume, world_from_object: place });
        Ok((report.cells, warning))
    }
}

/// From the first point of a volume's grid to that of its data: half a cell for scalars of cells,
/// whose grid has one more around them.
fn border(v: &Input<'_>) -> DVec3 {
    if v.cells { 0.5 * DVec3::from_array(v.spacing) } else { DVec3::ZERO }
}

/// The grid of the scalars. Scalars of cells are at their centres; around them are those of the
/// outermost cells again, so that between the centres and the bounds nothing changes.
fn grid(v: &Input<'_>) -> Result<Grid, String> {
    let scalars = values(&v.scalars);
    let dims = UVec3::from_array(v.dims);
    let (dims, scalars) = if v.cells {
        let cells = dims.saturating_sub(UVec3::ONE);
        let [wanted, given] = [cells.as_u64vec3().element_product(), scalars.len() as u64];
        if wanted == 0 || wanted != given {
            return Err(format!("a volume of {dims} points with {given} scalars of cells"));
        }
        (cells + 2, with_border(cells, &scalars))
    } else {
        (dims, scalars)
    };
    let [x, y, z] = v.spacing;
    Grid::new(dims, DVec3::ZERO, DVec3::new(x, y, z), scalars).map_err(|e| format!("a volume: {e}"))
}

/// A lattice of numbers with the outermost ones twice on each side; `dims` are not zero.
fn with_border(dims: UVec3, inner: &[f32]) -> Vec<f32> {
    let [nx, ny, nz] = dims.as_usizevec3().to_array();
    let mut out = Vec::with_capacity((nx + 2) * (ny + 2) * (nz + 2));
    let within = |i: usize, n: usize| i.saturating_sub(1).min(n - 1);
    for z in 0..nz + 2 {
        for y in 0..ny + 2 {
            let first = (within(z, nz) * ny + within(y, ny)) * nx;
            let row = &inner[first..first + nx];
            out.push(row[0]);
            out.extend_from_slice(row);
            out.push(row[nx - 1]);
        }
    }
    out
}

/// What changes with the view or while the user cuts the volume, in the axes of its grid.
#[derive(Debug, Clone, PartialEq)]
struct Seen {
    viewer: Option<DVec3>,
    clip_planes: Vec<ClipPlane>,
    cropping: Option<Cropping>,
}

impl Seen {
    /// For a grid at `place`.
    fn of(v: &Input<'_>, place: DAffine3) -> Seen {
        let from_world = place.inverse();
        let viewer = v.viewer.filter(|_| v.shading.is_some());
        // Planes in coordinates of texels are stretched from the middle of the grid.
        let points = UVec3::from_array(v.dims).max(UVec3::splat(2)).as_dvec3();
        let middle = border(v) + 0.5 * (points - 1.0) * DVec3::from_array(v.spacing);
        let stretch = |in_texels: bool| {
            if in_texels && !v.cells { points / (points - 1.0) } else { DVec3::ONE }
        };
        let moved = |point: DVec3, stretch: DVec3| middle + (point - middle) * stretch;
        let of_clipping = stretch(v.clipping_in_texels);
        let clip_planes = v
            .clip_planes
            .iter()
            .map(|&[x, y, z, nx, ny, nz]| ClipPlane {
                point: moved(from_world.transform_point3(DVec3::new(x, y, z)), of_clipping),
                normal: place.matrix3.transpose() * DVec3::new(nx, ny, nz) / of_clipping,
            })
            .collect();
        let of_cropping = stretch(v.cropping_in_texels);
        let cropping = v.cropping.map(|c| Cropping {
            planes: c.planes.map(|corner| moved(corner + border(v), of_cropping)),
            ..c
        });
        Seen { viewer: viewer.map(|eye| from_world.transform_point3(eye)), clip_planes, cropping }
    }

    fn is_of(&self, volume: &Volume) -> bool {
        let o = volume.options();
        o.viewer == self.viewer && o.clip_planes == self.clip_planes && o.cropping == self.cropping
    }

    fn applied(self, volume: &Volume) -> Result<Arc<Volume>, String> {
        let mut changed = volume.clone();
        changed
            .set_viewer(self.viewer)
            .and_then(|()| changed.set_clipping(self.clip_planes, self.cropping))
            .map_err(|e| format!("a volume: {e}"))?;
        Ok(Arc::new(changed))
    }
}

/// Hash of everything except the scalars, the transform and what [`Seen`] holds.
fn appearance_hash(v: &Input<'_>, lights: &[VolumeLight]) -> u64 {
    let mut h = DefaultHasher::new();
    let tables = v.colors.iter().flatten().chain(v.opacities).chain(v.gradient_opacities);
    tables.for_each(|x| x.to_bits().hash(&mut h));
    format!("{:?}{:?}{:?}{:?}{:?}", v.nearest, v.range, v.unit_distance, v.shading, v.spacing)
        .hash(&mut h);
    format!("{:?}{:?}{:?}{lights:?}{}", v.steepest, v.blend, v.sample_distance, v.cells)
        .hash(&mut h);
    h.finish()
}

/// Converts lights to the axes of a volume at `place`.
fn lights(v: &Input<'_>, place: DAffine3) -> Result<Vec<VolumeLight>, String> {
    let to_volume = place.matrix3.transpose();
    // Only rotation and uniform scale are supported: any other transform does not preserve right
    // angles.
    let square = to_volume * place.matrix3;
    let scale = square.x_axis.x;
    let even = square.abs_diff_eq(DMat3::from_diagonal(DVec3::splat(scale)), 1e-6 * scale.abs());
    let fixed = |l: &[f32; 6]| l[..3] != [0.0; 3];
    if v.shading.is_some() && !even && v.lights.iter().any(fixed) {
        return Err("a shaded volume under several lights that is stretched".to_owned());
    }
    let light = |l: &[f32; 6]| {
        let towards = to_volume * DVec3::new(l[0].into(), l[1].into(), l[2].into());
        let direction = fixed(l).then(|| towards.normalize_or_zero().as_vec3());
        VolumeLight {
            direction,
            color: [l[3], l[4], l[5]].map(|c| if c.is_finite() { c.max(0.0) } else { 0.0 }),
        }
    };
    Ok(v.lights.iter().map(light).collect())
}

fn values(scalars: &Scalars<'_>) -> Vec<f32> {
    fn convert<T: Copy + Sync>(from: &[T], to: impl Fn(T) -> f32 + Sync) -> Vec<f32> {
        from.par_iter().with_min_len(CHUNK).map(|v| to(*v)).collect()
    }
    match scalars {
        Scalars::U8(v) => convert(v, f32::from),
        Scalars::I32(v) => convert(v, |x| x as f32),
        Scalars::I64(v) => convert(v, |x| x as f32),
        Scalars::F32(v) => v.to_vec(),
        Scalars::F64(v) => convert(v, |x| x as f32),
    }
}

fn medium(
    v: &Input<'_>,
    seen: Seen,
    grid: Arc<Grid>,
    lights: Vec<VolumeLight>,
) -> Result<Volume, String> {
    let finite = |x: f32| if x.is_finite() { x.max(0.0) } else { 0.0 };
    let [low, high] = v.range.map(|r| r as f32);
    let high = if high > low { high } else { low.next_up() };
    if v.colors.is_empty() || v.opacities.is_empty() {
        return Err("a volume without colours or opacities".to_owned());
    }
    if !(v.unit_distance > 0.0 && v.unit_distance.is_finite()) {
        return Err(format!("a volume whose opacity unit distance is {}", v.unit_distance));
    }
    let colors = v.colors.iter().map(|&[r, g, b]| [finite(r), finite(g), finite(b), 1.0]).collect();
    let last = (v.opacities.len() - 1).max(1) as f32;
    let point = |(i, a): (usize, &f32)| {
        let sigma = match v.blend {
            VolumeBlend::Composite => {
                -f64::from(-finite(*a).min(MAX_OPACITY)).ln_1p() / v.unit_distance
            }
            VolumeBlend::Additive => f64::from(finite(*a)) / v.unit_distance,
            _ => f64::from(finite(*a)),
        };
        [low + (high - low) * (i as f32 / last), sigma as f32]
    };
    let extinction = v.opacities.iter().enumerate().map(point).collect();
    let transfer = TransferFunction::new(ColorMap::new(colors, [low, high]), straight(extinction));
    let unit = |x: f32| finite(x).min(1.0);
    let shading = v.shading.map(|s| VolumeShading {
        ambient: unit(s.ambient),
        diffuse: unit(s.diffuse),
        specular: finite(s.specular),
        shininess: finite(s.specular_power),
        highlight: if s.mirrored { VolumeHighlight::Mirrored } else { VolumeHighlight::Halfway },
        ..VolumeShading::default()
    });
    let interpolation = if v.nearest { Interpolation::Nearest } else { Interpolation::Linear };
    let transfer = transfer.map_err(|e| format!("a volume: {e}"))?;
    let gradient_opacity = (!v.gradient_opacities.is_empty()).then(|| GradientOpacity {
        factors: v.gradient_opacities.iter().map(|f| unit(*f)).collect(),
        steepest: v.steepest as f32,
    });
    let blend = match v.blend {
        VolumeBlend::Composite => Blend::Composite,
        VolumeBlend::Maximum => Blend::Maximum,
        VolumeBlend::Minimum => Blend::Minimum,
        VolumeBlend::Average => Blend::Average,
        VolumeBlend::Additive => Blend::Additive,
        VolumeBlend::Isosurfaces(values) => {
            Blend::Isosurfaces(values.iter().map(|v| *v as f32).collect())
        }
    };
    // As in OpenGL's textures.
    let clamped_gradients = true;
    if !(v.sample_distance >= 0.0 && v.sample_distance.is_finite()) {
        return Err(format!("a volume whose sample distance is {}", v.sample_distance));
    }
    let options = VolumeOptions {
        sample_distance: (v.sample_distance > 0.0).then_some(v.sample_distance),
        shading,
        interpolation,
        blend,
        lights,
        gradient_opacity,
        clamped_gradients,
        viewer: seen.viewer,
        bounds: v.cells.then(|| {
            let cells = UVec3::from_array(v.dims).saturating_sub(UVec3::ONE).as_dvec3();
            [border(v), border(v) + cells * DVec3::from_array(v.spacing)]
        }),
        clip_planes: seen.clip_planes,
        cropping: seen.cropping,
    };
    Volume::new(grid, transfer, options).map_err(|e| format!("a volume: {e}"))
}

/// Drops points that lie on the line between their neighbours. Fewer bends mean fewer integration
/// steps.
fn straight(points: Vec<[f32; 2]>) -> Vec<[f32; 2]> {
    let mut out: Vec<[f32; 2]> = Vec::with_capacity(points.len());
    for p in points {
        if let [.., a, b] = out[..] {
            let on_line = a[1] + (p[1] - a[1]) * ((b[0] - a[0]) / (p[0] - a[0]));
            if (on_line - b[1]).abs() <= 1e-6 * b[1].abs() {
                out.pop();
            }
        }
        out.push(p);
    }
    out
}

/// Sets the window depth of pixels that show a volume to the middle of the ray's segment through
/// it, where that is in front of `depth`. What OpenGL draws nearer appears in front of the volume;
/// what it draws further away is seen through the volume.
pub(crate) fn place_in_depth(volumes: &[VolumeInstance], view: &View, depth: &mut [f32]) {
    let boxes: Vec<BoxInClip<'_>> = volumes.iter().map(|v| BoxInClip::new(v, view)).collect();
    let width = view.width as usize;
    depth.par_chunks_mut(width.max(1)).enumerate().for_each(|(row, depth)| {
        let y = 1.0 - 2.0 * (row as f64 + 0.5) / f64::from(view.height);
        for b in &boxes {
            let ends = [-1.0, 1.0].map(|z| b.object_from_clip * DVec4::new(0.0, y, z, 1.0));
            for (column, depth) in depth.iter_mut().enumerate() {
                let x = 2.0 * (column as f64 + 0.5) / f64::from(view.width) - 1.0;
                if let Some(middle) = b.middle(ends, x) {
                    *depth = depth.min(middle);
                }
            }
        }
    });
}

/// The box of what is drawn of a volume, for rays through pixels.
struct BoxInClip<'a> {
    object_from_clip: DMat4,
    clip_from_object: DMat4,
    min: DVec3,
    max: DVec3,
    clip_planes: &'a [ClipPlane],
}

impl BoxInClip<'_> {
    fn new<'a>(v: &'a VolumeInstance, view: &View) -> BoxInClip<'a> {
        let b = v.volume.bounds();
        let [mut min, mut max] = [b.min.as_dvec3(), b.max.as_dvec3()];
        if let Some(c) = v.volume.options().cropping.filter(Cropping::is_box) {
            (min, max) = (min.max(c.planes[0]), max.min(c.planes[1]));
        }
        let to_object =
            DAffine3::from_translation(-v.volume.origin()) * v.world_from_object.inverse();
        let object_from_clip = DMat4::from(to_object) * view.clip_from_world.inverse();
        BoxInClip {
            object_from_clip,
            clip_from_object: view.clip_from_world * DMat4::from(to_object.inverse()),
            min,
            max,
            clip_planes: &v.volume.options().clip_planes,
        }
    }

    /// Window depth of the middle of the ray's segment in the box, for the ray through `x` of a row
    /// whose ends at `x` = 0 are `ends`.
    #[inline]
    fn middle(&self, ends: [DVec4; 2], x: f64) -> Option<f32> {
        let [a, b] = ends.map(|end| {
            let end = end + x * self.object_from_clip.x_axis;
            end.truncate() * end.w.recip()
        });
        let along = b - a;
        let inverse = along.recip();
        let (u, v) = ((self.min - a) * inverse, (self.max - a) * inverse);
        let (mut near, mut far) = (0.0f64, 1.0f64);
        for axis in 0..3 {
            // For rays parallel to the face, NaN and infinities either leave both ends unchanged or
            // make the interval empty, as intended.
            near = near.max(u[axis].min(v[axis]));
            far = far.min(u[axis].max(v[axis]));
        }
        for plane in self.clip_planes {
            let (before, slope) = (plane.normal.dot(plane.point - a), plane.normal.dot(along));
            // For rays along the plane, infinities do as above.
            let t = before / slope;
            if slope < 0.0 { far = far.min(t) } else { near = near.max(t) }
        }
        (near < far).then(|| {
            let middle = a + along * (0.5 * (near + far));
            let clip = self.clip_from_object * middle.extend(1.0);
            (0.5 * clip.z / clip.w + 0.5) as f32
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_keeps_its_corners_only() {
        let tent: Vec<[f32; 2]> =
            (0..=100).map(|i| [i as f32, (50 - i32::abs(i - 50)) as f32]).collect();
        let corners = straight(tent);
        assert!(corners.len() <= 5, "{corners:?}");
        assert!(corners.contains(&[50.0, 50.0]));
    }

    #[test]
    fn a_volume_lies_in_the_middle_of_its_box() {
        use rt_core::glam::DMat4;
        let clip_from_world = DMat4::from_cols_array(&[
            0.5, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, -0.2, -1.0, 0.0, 0.0, 0.0, 1.0,
        ])
        .transpose();
        let grid = Grid::new(UVec3::splat(2), DVec3::ZERO, DVec3::ONE, vec![1.0; 8]).unwrap();
        let transfer =
            TransferFunction::new(ColorMap::new(vec![[1.0; 4]], [0.0, 1.0]), vec![[0.0, 1.0]])
                .unwrap();
        let volume =
            Arc::new(Volume::new(Arc::new(grid), transfer, VolumeOptions::default()).unwrap());
        let placed = VolumeInstance {
            volume,
            world_from_object: DAffine3::from_translation(DVec3::new(-0.5, -0.5, -5.0)),
        };
        let view = View {
            clip_from_world,
            viewer: None,
            width: 3,
            height: 3,
            background: [[0.0; 3]; 2],
            interactive: false,
            shadows: false,
            samples: 0,
            window_samples: 0,
            one_layer: false,
            lens: None,
        };
        let mut depth = vec![1.0; 9];
        place_in_depth(&[placed], &view, &mut depth);
        assert!((depth[4] - 0.45).abs() < 1e-6 && depth[0] == 1.0, "{depth:?}");
    }
}
