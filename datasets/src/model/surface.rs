//! Extracts the boundary surface of any data set as one triangle mesh.

use super::boundary_faces::{BoundaryFaces, Faces};
use super::polygon::{Division, triangulate};
use super::{
    Attributes, CellType, Cells, ColorBy, DataArray, Dataset, ModelError, PolyData, SharedFaces,
    UnstructuredGrid, coloring::linear_from_srgb8, extent_dims, lattice_counts,
};
use glam::{DVec3, Vec2, Vec3};
use rt_core::mesh::{Attribute, MeshError, TriMesh};

/// Statistics of a surface extraction: the cells that were drawn, left out or approximated.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SurfaceReport {
    /// Triangles in the mesh.
    pub triangles: usize,
    /// Cells that are lines or points: not part of a surface, see [`Dataset::to_lines`] and
    /// [`Dataset::to_points`].
    pub line_and_point_cells: usize,
    /// Cells left out because they are hidden or copies of another process's cells
    /// (`vtkGhostType`).
    pub ghost_cells: usize,
    /// Cells left out because a point id is out of range.
    pub bad_ids: usize,
    /// Cells left out because they have too few points for their type.
    pub too_few_points: usize,
    /// Cells left out because their type is unknown.
    pub unknown_type: usize,
    /// Polygons that are not convex but were divided as a fan (too many corners, or
    /// self-intersecting).
    pub fanned_polygons: usize,
    /// Higher-order cells drawn by their linear corners.
    pub straightened_cells: usize,
    /// Data sets of a collection that lack the requested array; their values are NaN.
    pub blocks_without_array: usize,
    /// Faces left out because another piece has them too
    /// ([`to_trimesh_between`](Dataset::to_trimesh_between)).
    pub shared_faces: usize,
}

impl SurfaceReport {
    /// Number of cells that should be visible but are missing.
    pub fn dropped(&self) -> usize {
        self.bad_ids + self.too_few_points + self.unknown_type
    }
    /// One line per problem that a user should know about; empty when there are none.
    pub fn warnings(&self) -> Vec<String> {
        let items = [
            (self.bad_ids, "cells left out: they name points that do not exist"),
            (self.too_few_points, "cells left out: too few points for their type"),
            (self.unknown_type, "cells left out: unknown cell type"),
            (
                self.fanned_polygons,
                "polygons that cross themselves or are too large were divided as a fan",
            ),
            (self.straightened_cells, "higher-order cells drawn with straight edges"),
            (self.blocks_without_array, "blocks lack the array to colour by; they get NaN"),
        ];
        items.iter().filter(|(n, _)| *n > 0).map(|(n, text)| format!("{n} {text}")).collect()
    }
}

impl Dataset {
    /// Extracts the boundary surface: polygons and strips, two-dimensional cells, those faces of
    /// solid cells that belong to one cell only, and the boundary faces of lattices. `color_by`
    /// fills [`TriMesh::scalars`], or [`TriMesh::colors`] when the array is 8-bit sRGB(A); see
    /// [`ColorBy`] for how to name components. Normals and texture coordinates are kept when the
    /// file marks some. Vertices that no triangle uses are left out.
    pub fn to_trimesh(
        &self,
        color_by: Option<&str>,
    ) -> Result<(TriMesh, SurfaceReport), ModelError> {
        self.to_trimesh_at(color_by, None)
    }

    /// [`Dataset::to_trimesh`] with positions relative to `origin`; without it, to one that is
    /// chosen for them. Pieces of one surface want one origin: relative to several, a point on
    /// their border would be rounded in several ways, and rays could pass between them.
    pub fn to_trimesh_at(
        &self,
        color_by: Option<&str>,
        origin: Option<DVec3>,
    ) -> Result<(TriMesh, SurfaceReport), ModelError> {
        self.to_trimesh_between(color_by, origin, None)
    }

    /// [`Dataset::to_trimesh_at`] of a piece, without the faces that it shares with other pieces:
    /// for pieces that have no ghost cells.
    pub fn to_trimesh_between(
        &self,
        color_by: Option<&str>,
        origin: Option<DVec3>,
        shared: Option<&SharedFaces>,
    ) -> Result<(TriMesh, SurfaceReport), ModelError> {
        self.check()?;
        let color = color_by.map(|name| ColorBy::find(self, name)).transpose()?;
        let mut out = Builder::new(color);
        for leaf in self.leaves() {
            let (points, _) = leaf.counts();
            if points >= u64::from(Cells::NO_POINT)
                && leaf.attributes().is_some_and(|a| !a.point.is_empty() || !a.cell.is_empty())
            {
                let limit = Cells::NO_POINT as usize - 1;
                return Err(MeshError::TooLarge {
                    what: "vertices",
                    found: points as usize,
                    limit,
                }
                .into());
            }
            out.begin(leaf);
            match leaf {
                Dataset::PolyData(d) => out.poly_data(d),
                Dataset::UnstructuredGrid(d) => out.unstructured(d, shared),
                Dataset::ImageData(d) => {
                    out.lattice(extent_dims(d.extent), &d.attributes, |i, j, k| d.point(i, j, k))
                }
                Dataset::RectilinearGrid(d) => {
                    let [x, y, z] = &d.coordinates;
                    out.lattice(extent_dims(d.extent), &d.attributes, |i, j, k| {
                        DVec3::new(x[i], y[j], z[k])
                    });
                }
                Dataset::StructuredGrid(d) => {
                    let dims = extent_dims(d.extent);
                    out.lattice(dims, &d.attributes, |i, j, k| {
                        d.points.get(i + dims[0] * (j + dims[1] * k))
                    });
                }
                Dataset::MultiBlock(_) => unreachable!("leaves() returns no collections"),
            }
        }
        out.finish(origin)
    }
}

/// `vtkGhostType` bit for cells (vtkDataSetAttributes.h): 1 = copy of another process's cell.
const COPIED_CELL: u8 = 1;
/// `vtkGhostType` bits for cells: 32 = hidden, 8 = covered by finer cells of another block.
const HIDDEN_CELL: u8 = 32 | 8;
/// `vtkGhostType` bit for points: 2 = hidden.
const HIDDEN_POINT: u8 = 2;

struct Builder {
    color: Option<ColorBy>,
    positions: Vec<DVec3>,
    indices: Vec<[u32; 3]>,
    vertex_scalars: Vec<f32>,
    face_scalars: Vec<f32>,
    vertex_colors: Vec<[f32; 4]>,
    face_colors: Vec<[f32; 4]>,
    normals: Vec<Vec3>,
    any_normals: bool,
    texcoords: Vec<Vec2>,
    any_texcoords: bool,
    direct_color: bool,
    /// Vertex of each point of the current data set; `NO_POINT` when it is not used yet.
    vertex_of_point: Vec<u32>,
    report: SurfaceReport,
}

/// The arrays of the current data set from which vertices take values.
#[derive(Clone, Copy, Default)]
struct Source<'a> {
    color: Option<&'a DataArray>,
    normals: Option<&'a DataArray>,
    texcoords: Option<&'a DataArray>,
}

impl Builder {
    fn new(color: Option<ColorBy>) -> Self {
        Builder {
            color,
            positions: Vec::new(),
            indices: Vec::new(),
            vertex_scalars: Vec::new(),
            face_scalars: Vec::new(),
            vertex_colors: Vec::new(),
            face_colors: Vec::new(),
            normals: Vec::new(),
            any_normals: false,
            texcoords: Vec::new(),
            any_texcoords: false,
            direct_color: false,
            vertex_of_point: Vec::new(),
            report: SurfaceReport::default(),
        }
    }

    fn begin(&mut self, leaf: &Dataset) {
        let array = self
            .color
            .as_ref()
            .zip(leaf.attributes())
            .and_then(|(c, a)| c.array(a).map(|a| (c, a)));
        match array {
            Some((c, a)) => self.direct_color |= c.is_direct_color(a),
            None => self.report.blocks_without_array += self.color.is_some() as usize,
        }
        self.vertex_of_point.clear();
    }

    fn source<'a>(&self, a: &'a Attributes) -> Source<'a> {
        let named = |marked: &Option<String>, usual: &str, ok: &dyn Fn(usize) -> bool| {
            a.point_array(marked.as_deref().unwrap_or(usual)).filter(|array| ok(array.components))
        };
        Source {
            color: self.color.as_ref().and_then(|c| c.array(a)),
            normals: named(&a.point_normals, "Normals", &|n| n == 3),
            texcoords: a
                .point_texcoords
                .as_ref()
                .and_then(|_| named(&a.point_texcoords, "", &|n| n >= 2)),
        }
    }

    /// Returns the vertex for point `id` and creates it on first use.
    fn vertex(&mut self, id: usize, position: DVec3, from: &Source<'_>) -> u32 {
        if self.vertex_of_point[id] != Cells::NO_POINT {
            return self.vertex_of_point[id];
        }
        let v = self.positions.len() as u32;
        self.vertex_of_point[id] = v;
        self.positions.push(position);
        if let Some(n) = from.normals {
            self.any_normals = true;
            self.normals.resize(v as usize, Vec3::ZERO);
            self.normals.push(Vec3::from_array(std::array::from_fn(|c| n.get(id, c) as f32)));
        }
        if let Some(t) = from.texcoords {
            self.any_texcoords = true;
            self.texcoords.resize(v as usize, Vec2::ZERO);
            self.texcoords.push(Vec2::new(t.get(id, 0) as f32, t.get(id, 1) as f32));
        }
        if let Some(c) = self.color.as_ref().filter(|c| c.per_point) {
            self.vertex_scalars.push(from.color.map_or(f32::NAN, |a| c.value(a, id)));
            self.vertex_colors.push(match from.color {
                Some(a) if c.is_direct_color(a) => linear_from_srgb8(a, id),
                _ => [1.0; 4],
            });
        }
        v
    }

    fn triangle(&mut self, corners: [u32; 3], cell: usize, from: &Source<'_>) {
        self.indices.push(corners);
        if let Some(c) = self.color.as_ref().filter(|c| !c.per_point) {
            self.face_scalars.push(from.color.map_or(f32::NAN, |a| c.value(a, cell)));
            self.face_colors.push(match from.color {
                Some(a) if c.is_direct_color(a) => linear_from_srgb8(a, cell),
                _ => [1.0; 4],
            });
        }
    }

    /// Adds one polygon of `cell`. Ids must be in range.
    fn polygon(
        &mut self,
        ids: &[u32],
        cell: usize,
        at: &dyn Fn(usize) -> DVec3,
        from: &Source<'_>,
    ) {
        if let [a, b, c] = *ids {
            let corners = [a, b, c].map(|k| self.vertex(k as usize, at(k as usize), from));
            return self.triangle(corners, cell, from);
        }
        let corners: Vec<DVec3> = ids.iter().map(|&k| at(k as usize)).collect();
        let mut triangles = Vec::with_capacity(ids.len());
        match triangulate(&corners, |t| triangles.push(t)) {
            Division::Exact => {}
            Division::Fanned => self.report.fanned_polygons += 1,
            Division::Nothing => {
                self.report.too_few_points += 1;
                return;
            }
        }
        for t in triangles {
            let corners = t.map(|k| self.vertex(ids[k] as usize, corners[k], from));
            self.triangle(corners, cell, from);
        }
    }

    fn strip(&mut self, ids: &[u32], cell: usize, at: &dyn Fn(usize) -> DVec3, from: &Source<'_>) {
        if ids.len() < 3 {
            self.report.too_few_points += 1;
        }
        for (i, w) in ids.windows(3).enumerate() {
            // Every second triangle of a strip has the opposite orientation.
            let order = if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] };
            let corners = order.map(|k| self.vertex(k as usize, at(k as usize), from));
            self.triangle(corners, cell, from);
        }
    }

    fn poly_data(&mut self, d: &PolyData) {
        let from = self.source(&d.attributes);
        let n = d.points.len();
        self.vertex_of_point.resize(n, Cells::NO_POINT);
        let hidden = GhostFlags::new(&d.attributes);
        let at = |i: usize| d.points.get(i);
        let first_poly = d.verts.len() + d.lines.len();
        self.report.line_and_point_cells += first_poly;
        let polys = d.polys.iter().map(|ids| (ids, false));
        let all = polys.chain(d.strips.iter().map(|ids| (ids, true)));
        for (i, (ids, is_strip)) in all.enumerate() {
            let cell = first_poly + i;
            if hidden.cell(cell) {
                self.report.ghost_cells += 1;
            } else if ids.iter().any(|&k| k as usize >= n) {
                self.report.bad_ids += 1;
            } else if is_strip {
                self.strip(ids, cell, &at, &from);
            } else {
                self.polygon(ids, cell, &at, &from);
            }
        }
    }

    fn unstructured(&mut self, d: &UnstructuredGrid, shared: Option<&SharedFaces>) {
        let from = self.source(&d.attributes);
        let n = d.points.len();
        self.vertex_of_point.resize(n, Cells::NO_POINT);
        let hidden = GhostFlags::new(&d.attributes);
        let at = |i: usize| d.points.get(i);

        let outside = BoundaryFaces::find(d, &hidden);
        let mut outer: Vec<Vec<u32>> = Vec::new();
        for cell in 0..d.cells.len() {
            let ids = d.cells.get(cell);
            let kind = CellType::of(d.types[cell]);
            if hidden.cell(cell) {
                self.report.ghost_cells += 1;
                continue;
            }
            if ids.iter().any(|&k| k as usize >= n) {
                self.report.bad_ids += 1;
                continue;
            }
            self.report.straightened_cells += (d.types[cell] > 16 && d.types[cell] != 42) as usize;
            match kind {
                CellType::Empty => {}
                CellType::Vertices | CellType::Line(_) => self.report.line_and_point_cells += 1,
                CellType::Strip => self.strip(ids, cell, &at, &from),
                CellType::Polygon(corners) => {
                    let corners = match corners {
                        0 => ids.len(),
                        usize::MAX => ids.len() / 2,
                        k => k,
                    };
                    match ids.get(..corners) {
                        Some(ids) => self.polygon(ids, cell, &at, &from),
                        None => self.report.too_few_points += 1,
                    }
                }
                CellType::Pixel => match *ids {
                    [a, b, c, e] => self.polygon(&[a, b, e, c], cell, &at, &from),
                    _ => self.report.too_few_points += 1,
                },
                CellType::Solid(_) | CellType::Polyhedron => {
                    match outside.of_cell(d, cell, &mut outer) {
                        Faces::Complete => {}
                        Faces::TooFewPoints => self.report.too_few_points += 1,
                        Faces::BadIds => self.report.bad_ids += 1,
                    }
                    if let Some(shared) = shared {
                        let found = outer.len();
                        outer.retain(|ids| !shared.contains(ids, &d.points));
                        self.report.shared_faces += found - outer.len();
                    }
                    outer.iter().for_each(|ids| self.polygon(ids, cell, &at, &from));
                }
                CellType::Unknown => self.report.unknown_type += 1,
            }
        }
    }

    /// Adds the faces of visible lattice cells that have no visible neighbour. A lattice one point
    /// thick is a sheet.
    fn lattice(
        &mut self,
        dims: [usize; 3],
        attributes: &Attributes,
        at: impl Fn(usize, usize, usize) -> DVec3,
    ) {
        let from = self.source(attributes);
        let hidden = GhostFlags::new(attributes);
        let Some((points, cells)) = lattice_counts(dims) else { return };
        if points == 0 {
            return;
        }
        if dims.iter().filter(|&&d| d > 1).count() < 2 {
            self.report.line_and_point_cells += cells as usize;
            return;
        }
        // A lattice of huge declared size without any array carries no information beyond its
        // corners.
        if attributes.point.is_empty()
            && attributes.cell.is_empty()
            && points > MAX_BARE_LATTICE_POINTS
        {
            let small = dims.map(|d| d.min(2));
            let end = |i: usize, a: usize| if i == 0 { 0 } else { dims[a] - 1 };
            self.vertex_of_point.clear();
            self.vertex_of_point.resize(8, Cells::NO_POINT);
            let corner = |i: usize| {
                let (i, j, k) = (i % small[0], i / small[0] % small[1], i / small[0] / small[1]);
                at(end(i, 0), end(j, 1), end(k, 2))
            };
            return self.lattice_faces(small, &hidden, &corner, &from);
        }
        self.vertex_of_point.resize(points as usize, Cells::NO_POINT);
        let position = |i: usize| at(i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]);
        self.lattice_faces(dims, &hidden, &position, &from);
    }

    fn lattice_faces(
        &mut self,
        dims: [usize; 3],
        hidden: &GhostFlags<'_>,
        at: &dyn Fn(usize) -> DVec3,
        from: &Source<'_>,
    ) {
        let cells = dims.map(|d| if d == 1 { 1 } else { d - 1 });
        let stride = [1, dims[0], dims[0] * dims[1]];
        let cell_stride = [1, cells[0], cells[0] * cells[1]];
        let blank = |cell: usize, low: usize| {
            hidden.is_blanked(cell)
                || hidden.any_points()
                    && (0..8).any(|c: usize| {
                        let step = (0..3)
                            .filter(|&a| dims[a] > 1 && c >> a & 1 == 1)
                            .map(|a| stride[a])
                            .sum::<usize>();
                        hidden.point(low + step)
                    })
        };
        for k in 0..cells[2] {
            for j in 0..cells[1] {
                for i in 0..cells[0] {
                    let index = [i, j, k];
                    // Only cells at the border or next to a hidden one can have boundary faces.
                    let rim = (0..3).any(|a| index[a] == 0 || index[a] + 1 == cells[a]);
                    if !rim && hidden.none() {
                        continue;
                    }
                    let cell = i + cell_stride[1] * j + cell_stride[2] * k;
                    let low = i + stride[1] * j + stride[2] * k;
                    if hidden.cell(cell) || blank(cell, low) {
                        self.report.ghost_cells += 1;
                        continue;
                    }
                    for axis in 0..3 {
                        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                        if dims[u] == 1 || dims[v] == 1 {
                            continue;
                        }
                        for high in [false, true] {
                            let sheet = dims[axis] == 1;
                            if sheet && !high {
                                continue; // a sheet has one face, not two at the same place
                            }
                            let at_rim = if high {
                                index[axis] + 1 == cells[axis]
                            } else {
                                index[axis] == 0
                            };
                            let open = at_rim || {
                                let (c, l) = (cell_stride[axis], stride[axis]);
                                if high {
                                    blank(cell + c, low + l)
                                } else {
                                    blank(cell - c, low - l)
                                }
                            };
                            if !open {
                                continue;
                            }
                            let base = low + if high && !sheet { stride[axis] } else { 0 };
                            let (a, b) =
                                if high { (stride[u], stride[v]) } else { (stride[v], stride[u]) };
                            let ids = [base, base + a, base + a + b, base + b].map(|k| k as u32);
                            self.polygon(&ids, cell, at, from);
                        }
                    }
                }
            }
        }
    }

    fn finish(mut self, origin: Option<DVec3>) -> Result<(TriMesh, SurfaceReport), ModelError> {
        let vertices = self.positions.len();
        self.report.triangles = self.indices.len();
        let mut mesh = match origin {
            None => TriMesh::from_f64_positions(&self.positions, self.indices),
            Some(origin) => {
                let positions = self.positions.iter().map(|p| (*p - origin).as_vec3()).collect();
                TriMesh { origin, ..TriMesh::new(positions, self.indices) }
            }
        };
        if self.any_normals {
            self.normals.resize(vertices, Vec3::ZERO);
            mesh.normals = Some(Attribute::per_vertex(self.normals));
        }
        if self.any_texcoords {
            self.texcoords.resize(vertices, Vec2::ZERO);
            mesh.texcoords = Some(self.texcoords);
        }
        if let Some(c) = &self.color {
            if self.direct_color {
                let (v, f) = (self.vertex_colors, self.face_colors);
                mesh.colors = Some(if c.per_point {
                    Attribute::per_vertex(v)
                } else {
                    Attribute::per_face(f)
                });
            } else {
                let (v, f) = (self.vertex_scalars, self.face_scalars);
                mesh.scalars = Some(if c.per_point {
                    Attribute::per_vertex(v)
                } else {
                    Attribute::per_face(f)
                });
            }
        }
        mesh.check()?;
        Ok((mesh, self.report))
    }
}

/// Lattices without arrays and with more points than this are drawn as their box: an extent in a
/// file header costs a few bytes and must not make the program build billions of faces.
const MAX_BARE_LATTICE_POINTS: u64 = 1 << 20;

/// The points and cells that `vtkGhostType` hides.
pub(crate) struct GhostFlags<'a> {
    cells: Option<&'a DataArray>,
    points: Option<&'a DataArray>,
}

impl<'a> GhostFlags<'a> {
    pub(crate) fn new(a: &'a Attributes) -> Self {
        GhostFlags { cells: a.cell_array("vtkGhostType"), points: a.point_array("vtkGhostType") }
    }
    fn none(&self) -> bool {
        self.cells.is_none() && self.points.is_none()
    }
    fn any_points(&self) -> bool {
        self.points.is_some()
    }
    /// Whether cell `i` is not drawn: it is hidden, or another process draws it.
    pub(crate) fn cell(&self, i: usize) -> bool {
        self.has(i, HIDDEN_CELL | COPIED_CELL)
    }
    /// Whether cell `i` is hidden and treated as absent.
    pub(crate) fn is_blanked(&self, i: usize) -> bool {
        self.has(i, HIDDEN_CELL)
    }
    fn has(&self, i: usize, bits: u8) -> bool {
        self.cells.is_some_and(|a| a.get(i, 0) as u8 & bits != 0)
    }
    fn point(&self, i: usize) -> bool {
        self.points.is_some_and(|a| a.get(i, 0) as u8 & HIDDEN_POINT != 0)
    }
}
