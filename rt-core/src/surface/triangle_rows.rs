//! Reads the triangles of sixteen hits into rows: from a mesh in memory, so that sixteen waits for
//! memory overlap, or from a stored one, whose pages are looked up once for all.

use super::{ResolvedInstance, Source};
use crate::bvh::StoredMesh;
use crate::material::{ColorSource, ColorTransfer};
use crate::mesh::{Attribute, PerElement, TriMesh};
use crate::ray::{HitBlock, LANES, RayBlock};
use crate::simd::vectors::{Row, Rows3, Vec3x16};
use fearless_simd::{Simd, SimdBase, f32x16};
use glam::Vec3;

/// Sixteen [`super::triangle::HitTriangle`]s, one row per component. Lanes without a hit have any
/// values.
#[repr(C, align(64))]
pub(super) struct TriangleRows {
    pub(super) corners: [Rows3; 3],
    pub(super) normals: Rows3,
    pub(super) colors: [Row; 4],
    /// Whether there are normals for shading.
    pub(super) has_normals: bool,
    /// Whether there are colours other than the material's.
    pub(super) has_colors: bool,
}

/// Vertex indices of sixteen triangles, one row per corner.
type Corners = [[u32; LANES]; 3];

impl TriangleRows {
    pub(super) fn new() -> TriangleRows {
        TriangleRows {
            corners: [Rows3::ZERO; 3],
            normals: Rows3::ZERO,
            colors: [[0.0; LANES]; 4],
            has_normals: false,
            has_colors: false,
        }
    }
}

impl ResolvedInstance<'_> {
    /// The triangles of the hits of `lanes`, which all are on this instance. Returns the lanes that
    /// it has found: none of shapes other than stored meshes.
    pub(super) fn triangle_rows<S: Simd>(
        &self,
        simd: S,
        lanes: u16,
        rays: &RayBlock,
        hits: &HitBlock,
        out: &mut TriangleRows,
    ) -> u16 {
        match self.source {
            Source::Mesh(mesh) => {
                self.mesh_rows(simd, mesh, lanes, hits, out);
                lanes
            }
            Source::Stored(mesh) => self.stored_rows(mesh, lanes, rays, hits, out),
            Source::Shape(_) => 0,
        }
    }

    /// As [`ResolvedInstance::triangle_rows`], the corners alone.
    pub(super) fn corner_rows(
        &self,
        lanes: u16,
        rays: &RayBlock,
        hits: &HitBlock,
        corners: &mut [Rows3; 3],
    ) -> u16 {
        match self.source {
            Source::Mesh(mesh) => {
                // Lanes without a hit repeat one that has a hit.
                let first = lanes.trailing_zeros() as usize & 15;
                for lane in 0..LANES {
                    let from = if lanes >> lane & 1 != 0 { lane } else { first };
                    let [a, b, c] = mesh.indices[hits.prim[from] as usize];
                    corners[0].set(lane, mesh.positions[a as usize]);
                    corners[1].set(lane, mesh.positions[b as usize]);
                    corners[2].set(lane, mesh.positions[c as usize]);
                }
                lanes
            }
            Source::Stored(mesh) => {
                let mut found = 0;
                let rays = std::array::from_fn(|lane| self.object_ray(&rays.get(lane)));
                mesh.triangle_hits(lanes, &rays, hits, false, |lane, triangle| {
                    found |= 1 << lane;
                    (0..3).for_each(|k| corners[k].set(lane, triangle.corners[k]));
                });
                found
            }
            Source::Shape(_) => 0,
        }
    }

    #[inline(never)]
    fn stored_rows(
        &self,
        mesh: &StoredMesh,
        lanes: u16,
        rays: &RayBlock,
        hits: &HitBlock,
        out: &mut TriangleRows,
    ) -> u16 {
        let (mut found, mut with_normal) = (0u16, 0u16);
        let colored =
            !matches!(self.material.color_source, ColorSource::Constant | ColorSource::Texture(_));
        let rays = std::array::from_fn(|lane| self.object_ray(&rays.get(lane)));
        let wanted = colored || !self.material.flat;
        mesh.triangle_hits(lanes, &rays, hits, wanted, |lane, triangle| {
            found |= 1 << lane;
            (0..3).for_each(|k| out.corners[k].set(lane, triangle.corners[k]));
            let a = triangle.attributes;
            if let Some(normal) = a.normal.filter(|_| !self.material.flat) {
                with_normal |= 1 << lane;
                out.normals.set(lane, normal);
            }
            if colored {
                let color = self.shape_color(hits.prim[lane], a.color, a.scalar);
                (0..4).for_each(|c| out.colors[c][lane] = color[c]);
            }
        });
        (out.has_normals, out.has_colors) = (with_normal != 0, colored);
        // A page whose attributes cannot be read has none: its hits are looked at one by one.
        if with_normal == 0 { found } else { found & with_normal }
    }

    #[inline(never)]
    fn mesh_rows<S: Simd>(
        &self,
        simd: S,
        mesh: &TriMesh,
        lanes: u16,
        hits: &HitBlock,
        out: &mut TriangleRows,
    ) {
        simd.vectorize(
            #[inline(always)]
            || self.mesh_rows_body(simd, mesh, lanes, hits, out),
        );
    }

    #[inline(always)]
    fn mesh_rows_body<S: Simd>(
        &self,
        simd: S,
        mesh: &TriMesh,
        lanes: u16,
        hits: &HitBlock,
        out: &mut TriangleRows,
    ) {
        let v = |x: f32| f32x16::splat(simd, x);
        // Lanes without a hit repeat one that has a hit, so the code below needs no checks.
        let first = lanes.trailing_zeros() as usize & 15;
        let mut prims = hits.prim;
        for lane in 0..LANES {
            prims[lane] = if lanes >> lane & 1 != 0 { prims[lane] } else { prims[first] };
        }
        let mut corners: Corners = [[0; LANES]; 3];
        for lane in 0..LANES {
            let t = mesh.indices[prims[lane] as usize];
            (corners[0][lane], corners[1][lane], corners[2][lane]) = (t[0], t[1], t[2]);
        }
        for k in 0..3 {
            for lane in 0..LANES {
                out.corners[k].set(lane, mesh.positions[corners[k][lane] as usize]);
            }
        }
        let (u, w2) = (f32x16::from_slice(simd, &hits.u), f32x16::from_slice(simd, &hits.v));
        let weights = [v(1.0) - u - w2, u, w2];

        // ---- Shading normal.
        let normals = self.shading_normals(mesh);
        out.has_normals = normals.is_some();
        if let Some(normals) = normals {
            let n = match normals.per {
                PerElement::Vertex => {
                    let p = gather3(simd, &normals.values, &corners[0]).scale(weights[0]);
                    let p = p.add(gather3(simd, &normals.values, &corners[1]).scale(weights[1]));
                    p.add(gather3(simd, &normals.values, &corners[2]).scale(weights[2]))
                }
                PerElement::Face => gather3(simd, &normals.values, &prims),
            };
            n.store(&mut out.normals);
        }

        // ---- Colour.
        let rgba = &mut out.colors;
        out.has_colors = match &self.material.color_source {
            ColorSource::Attribute => match self.colors {
                Some(colors) => {
                    mix_colors(simd, colors, &corners, &prims, weights, rgba);
                    true
                }
                None => false,
            },
            ColorSource::Constant => false,
            ColorSource::Scalars(map) => match self.scalars {
                Some(scalars) => {
                    let value = match scalars.per {
                        PerElement::Vertex => {
                            let [x, y, z] = [
                                gather1(simd, &scalars.values, &corners[0]),
                                gather1(simd, &scalars.values, &corners[1]),
                                gather1(simd, &scalars.values, &corners[2]),
                            ];
                            x * weights[0] + y * weights[1] + z * weights[2]
                        }
                        PerElement::Face => gather1(simd, &scalars.values, &prims),
                    };
                    map.lookup_block(simd, value, rgba);
                    true
                }
                None => false,
            },
            ColorSource::Texture(_) => {
                for lane in 0..LANES {
                    let corner =
                        [corners[0][lane], corners[1][lane], corners[2][lane]].map(|k| k as usize);
                    let w = [weights[0][lane], weights[1][lane], weights[2][lane]];
                    let color = self.mesh_color(mesh, corner, prims[lane], w);
                    for c in 0..4 {
                        rgba[c][lane] = color[c];
                    }
                }
                true
            }
        };
        let by_texture = matches!(self.material.color_source, ColorSource::Texture(_));
        if out.has_colors && !by_texture && self.material.color_transfer != ColorTransfer::Linear {
            for lane in 0..LANES {
                let color = rgba.map(|row| row[lane]);
                let linear = self.material.color_transfer.apply(color);
                (0..4).for_each(|c| rgba[c][lane] = linear[c]);
            }
        }
    }
}

#[inline(always)]
fn gather1<S: Simd>(simd: S, values: &[f32], at: &[u32; LANES]) -> f32x16<S> {
    let mut row = [0.0; LANES];
    for lane in 0..LANES {
        row[lane] = values[at[lane] as usize];
    }
    f32x16::from_slice(simd, &row)
}

#[inline(always)]
fn gather3<S: Simd>(simd: S, values: &[Vec3], at: &[u32; LANES]) -> Vec3x16<S> {
    let mut rows = Rows3::ZERO;
    for lane in 0..LANES {
        rows.set(lane, values[at[lane] as usize]);
    }
    Vec3x16::load(simd, &rows)
}

#[inline(always)]
fn gather4(values: &[[f32; 4]], at: &[u32; LANES], rows: &mut [Row; 4]) {
    for lane in 0..LANES {
        let color = values[at[lane] as usize];
        for c in 0..4 {
            rows[c][lane] = color[c];
        }
    }
}

#[inline(always)]
fn mix_colors<S: Simd>(
    simd: S,
    colors: &Attribute<[f32; 4]>,
    corners: &Corners,
    prims: &[u32; LANES],
    [w, u, v]: [f32x16<S>; 3],
    out: &mut [Row; 4],
) {
    if colors.per == PerElement::Face {
        gather4(&colors.values, prims, out);
        return;
    }
    let mut rows = [[[0.0; LANES]; 4]; 3];
    for k in 0..3 {
        gather4(&colors.values, &corners[k], &mut rows[k]);
    }
    for c in 0..4 {
        let [x, y, z] = [
            f32x16::from_slice(simd, &rows[0][c]),
            f32x16::from_slice(simd, &rows[1][c]),
            f32x16::from_slice(simd, &rows[2][c]),
        ];
        (x * w + y * u + z * v).store_slice(&mut out[c]);
    }
}
