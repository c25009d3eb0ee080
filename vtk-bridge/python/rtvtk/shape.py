"""Points, cells, normals and texture coordinates of polygon data, in the library's layout.

Everything is a numpy view of VTK's own memory wherever the types allow. The library caches a converted shape as long as frames use it, so the
arrays are only read in the first frame with a key; later frames pass the key alone.
"""
import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkIdList, vtkVersion
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolygon

from . import library as rtv
from .arrays import floats, key_of, numbers

_WHOLE = {np.dtype(np.int64), np.dtype(np.int32)}
_REAL = [np.dtype(np.float64), np.dtype(np.float32)]
# VTK 9.7 triangulates polygons with so many corners that are not convex, and draws all others as fans; earlier versions draw fans only.
_DIVIDED_FROM = 5 if (vtkVersion.GetVTKMajorVersion(), vtkVersion.GetVTKMinorVersion()) >= (9, 7) else 1 << 62
# The measure by which it chooses ears: `vtkPolygon::DOT_PRODUCT`.
_EARS_BY = 1


class Shapes:
    """Tracks which shapes the library has: keys of this frame and of the previous one."""

    def __init__(self):
        # `_ready`: filled in for a surface that may still be rejected.
        self._known, self._added, self._ready = {}, {}, {}

    def given(self, key):
        """Records that the library received a surface with the shape of this key."""
        if key in self._ready:
            self._added[key] = self._ready[key]

    def frame_drawn(self):
        """Records that the library dropped the shapes that the drawn frame did not use."""
        self._known, self._added, self._ready = self._added, {}, {}

    def frame_not_drawn(self):
        self._known.update(self._added)
        self._added, self._ready = {}, {}

    def again(self, key):
        """True if the library has the shape of this key, so that the key alone is enough."""
        found = self._added if key in self._added else self._known
        if key in found:
            self._ready[key] = found[key]
        return key in found

    def add(self, surface, data, as_points, planes, keep):
        """Fills in the shape. Returns the source cell of each new cell (`None`: unchanged), for colours of cells."""
        points = data.GetPoints()
        coordinates = points.GetData()
        polys = data.GetPolys()
        all_cells = [data.GetVerts(), data.GetLines(), polys, data.GetStrips()]
        of_points = None if surface.property.flat else data.GetPointData().GetNormals()
        of_cells, texcoords = data.GetCellData().GetNormals(), data.GetPointData().GetTCoords()
        # The shader has a tangent frame for normal maps only if there are point normals.
        tangents = None if of_points is None else data.GetPointData().GetTangents()
        settings = surface.point_radius, surface.line_radius, surface.edges_only, surface.has_back, as_points
        clip = () if planes is None else tuple(planes.ravel().tolist())
        if as_points:
            key = key_of(points, coordinates, *settings, *clip)
        else:
            key = key_of(points, coordinates, *all_cells, of_points, of_cells, texcoords, tangents, *settings, *clip)
        surface.shape_key = key
        if planes is not None:
            keep.append(planes)
            surface.clip_planes = rtv.Array.of(planes)
        if self.again(key):
            # Only the number of points matters here.
            surface.points = rtv.Array.of(_some_memory(points.GetNumberOfPoints(), keep))
            return self._ready[key]
        xyz = numbers(coordinates, _REAL, keep).reshape(-1, 3)
        surface.points = rtv.Array.of(xyz)
        if as_points:
            ids = np.arange(points.GetNumberOfPoints() + 1, dtype=np.int64)
            keep.append(ids)
            surface.verts = rtv.Cells(rtv.Array.of(ids), rtv.Array.of(ids[:-1]))
            self._ready[key] = None
            return None
        runs = [_runs(c, keep) for c in all_cells]
        # When drawn as tubes, polygons show their own edges only.
        runs[2], became = (runs[2], None) if surface.edges_only else _divided(xyz, polys, runs[2])
        cell_map = None
        if became is not None:
            verts, lines, n_polys, strips = (c.GetNumberOfCells() for c in all_cells)
            first = verts + lines
            cell_map = np.concatenate([np.arange(first), first + became, first + n_polys + np.arange(strips)])
        surface.verts, surface.lines, surface.polys, surface.strips = (_cells(r, keep) for r in runs)
        surface.point_normals, surface.texcoords = floats(of_points, 3, keep), floats(texcoords, 2, keep)
        surface.cell_normals = floats(of_cells, 3, keep, cell_map)
        surface.tangents = floats(tangents, 3, keep)
        self._ready[key] = cell_map
        return cell_map


def _some_memory(n, keep):
    """An array of `n` points that is never read; the system allocates memory only for touched pages."""
    keep.append(np.empty((n, 3), np.float32))
    return keep[-1]


def _runs(array, keep):
    """Offsets and point numbers of cells, or `None` without cells."""
    if array is None or array.GetNumberOfCells() == 0:
        return None
    try:
        connectivity = vtk_to_numpy(array.GetConnectivityArray())
        if hasattr(array, "IsStorageFixedSize") and array.IsStorageFixedSize():
            # Cells of one size have no offsets in memory (VTK 9.6 and later).
            offsets = np.arange(array.GetNumberOfCells() + 1, dtype=np.int64) * array.GetCellSize(0)
        else:
            offsets = vtk_to_numpy(array.GetOffsetsArray())
        if offsets.dtype not in _WHOLE or connectivity.dtype not in _WHOLE:
            raise TypeError
    except (TypeError, AttributeError, AssertionError, ValueError):
        # Implicit arrays and others without their own memory.
        plain = vtkCellArray()
        plain.DeepCopy(array)
        plain.ConvertTo64BitStorage()
        offsets, connectivity = (vtk_to_numpy(a) for a in (plain.GetOffsetsArray(), plain.GetConnectivityArray()))
        keep.append(plain)
    return np.ascontiguousarray(offsets), np.ascontiguousarray(connectivity)


def _cells(runs, keep):
    if runs is None:
        return rtv.Cells()
    keep.extend(runs)
    return rtv.Cells(*(rtv.Array.of(r) for r in runs))


def _divided(xyz, array, runs):
    """The polygons, with non-convex ones cut into triangles as VTK does, and the old cell index of each new cell."""
    if runs is None or array.GetMaxCellSize() < _DIVIDED_FROM:
        return runs, None
    offsets, connectivity = runs
    sizes = np.diff(offsets)
    cut = {}
    for size in np.unique(sizes[sizes >= _DIVIDED_FROM]):
        which = np.flatnonzero(sizes == size)
        ids = connectivity[offsets[which][:, None] + np.arange(size)]
        inside = (ids >= 0).all(1) & (ids < len(xyz)).all(1)
        which, ids = which[inside], ids[inside]
        for cell, corners in zip(which[_bent(xyz[ids])], ids[_bent(xyz[ids])]):
            triangles = _ears(xyz[corners])
            if triangles is not None:
                cut[int(cell)] = corners[triangles]
    if not cut:
        return runs, None
    counts = np.ones(len(sizes), np.int64)
    pieces, new_sizes, start = [], [], 0
    for cell in sorted(cut):
        counts[cell] = len(cut[cell])
        pieces += [connectivity[offsets[start]:offsets[cell]], cut[cell].ravel()]
        new_sizes += [sizes[start:cell], np.full(len(cut[cell]), 3)]
        start = cell + 1
    pieces.append(connectivity[offsets[start]:offsets[-1]])
    new_sizes.append(sizes[start:])
    new_offsets = np.concatenate([[0], np.cumsum(np.concatenate(new_sizes))]).astype(np.int64)
    return (new_offsets, np.concatenate(pieces).astype(np.int64)), np.repeat(np.arange(len(sizes)), counts)


def _bent(corners):
    """Which of the polygons (m, n, 3) turn in both directions, so are not convex."""
    corners = corners.astype(np.float64) - corners[:, :1]
    sides = np.roll(corners, -1, 1) - corners
    turns = np.cross(sides, np.roll(sides, -1, 1))
    along = np.einsum("mij,mj->mi", turns, np.cross(corners, np.roll(corners, -1, 1)).sum(1))
    with np.errstate(invalid="ignore"):
        return (along < -1e-9 * np.abs(along).max(1, keepdims=True)).any(1)


def _ears(corners):
    """Corner indices of the triangles of one polygon, or `None` if it cannot be triangulated (it crosses itself)."""
    polygon, ids = vtkPolygon(), vtkIdList()
    polygon.GetPoints().SetNumberOfPoints(len(corners))
    polygon.GetPointIds().SetNumberOfIds(len(corners))
    for i, p in enumerate(corners):
        polygon.GetPoints().SetPoint(i, *map(float, p))
        polygon.GetPointIds().SetId(i, i)
    if not polygon.EarCutTriangulation(ids, _EARS_BY):
        return None
    return np.array([ids.GetId(i) for i in range(ids.GetNumberOfIds())]).reshape(-1, 3)
