"""Ray queries of PyVista's meshes.

The functions have the parameters and results of `pyvista.PolyData`'s methods of the same names.
`multi_ray_trace` needs neither trimesh nor Embree, and no second pass for rays that were lost.

Examples
--------
>>> import pyvista
>>> import rt_core.pyvista
>>> ball = pyvista.Sphere()
>>> points, rays, cells = rt_core.pyvista.multi_ray_trace(
...     ball, [[0, 0, 0], [9, 9, 9]], [[1, 0, 0], [1, 0, 0]], first_point=True
... )
>>> points.round(2).tolist(), rays
([[0.5, 0.0, 0.0]], array([0]))
"""

from collections import OrderedDict

import numpy as np

from rt_core._places import on_planes
from rt_core._scene import Scene

#: Trees that are kept, those used last.
_KEPT = 8
_built = OrderedDict()


class Surface:
    """The triangles of a mesh, and which cell each comes from.

    Parameters
    ----------
    mesh : pyvista.DataSet
        Polygons are cut into triangles; of other data sets the surface is taken.

    Attributes
    ----------
    scene : Scene
    cells : ndarray of int64 or None
        The mesh's cell of each triangle; None where their numbers are the same.
    """

    def __init__(self, mesh):
        self.cells = None
        surface = mesh
        if not hasattr(mesh, "regular_faces"):
            surface = mesh.extract_surface(algorithm="dataset_surface")
            self.cells = np.asarray(surface.cell_data["vtkOriginalCellIds"])
        only_triangles = surface.is_all_triangles and surface.n_cells == len(surface.regular_faces)
        if not only_triangles:
            number = np.arange(surface.n_cells) if self.cells is None else self.cells
            surface = surface.copy(deep=False)
            surface.cell_data["rt_core cell"] = number
            surface = surface.triangulate()
            faces = surface.regular_faces
            # Only polygons are left; they are in the order of their cells.
            self.cells = np.asarray(surface.cell_data["rt_core cell"])[-len(faces) or None :]
        self._points, self._faces = np.asarray(surface.points), surface.regular_faces
        self.scene = Scene(self._points, self._faces)

    def places(self, origins, directions, t, primitive, uv):
        """Where rays meet their triangles, in float64."""
        # Without triangles there are no faces of three.
        corners = self._points[self._faces.reshape(-1, 3)[primitive]].astype(np.float64)
        return on_planes(origins, directions, t, uv, corners)


def surface_of(mesh):
    """The `Surface` of a mesh, from the last call if the mesh has not changed since."""
    key, time = id(mesh), mesh.GetMTime()
    points = getattr(mesh, "GetPoints", lambda: None)()
    if points is not None:
        time = max(time, points.GetMTime())
    kept = _built.pop(key, None)
    if kept is None or kept[0] is not mesh or kept[1] != time:
        kept = (mesh, time, Surface(mesh))
    _built[key] = kept
    while len(_built) > _KEPT:
        _built.popitem(last=False)
    return kept[2]


def forget():
    """Lets go of the meshes and trees of earlier calls."""
    _built.clear()


def ray_trace(mesh, origin, end_point, first_point=False):
    """Where a segment crosses a mesh, nearest to its start first.

    PyVista 0.49 orders crossings by their coordinates instead, so that its `first_point` need not
    be the nearest.

    Parameters
    ----------
    mesh : pyvista.DataSet
    origin, end_point : three floats
    first_point : bool
        Only the first crossing.

    Returns
    -------
    intersection_points : ndarray of float, shape (M, 3), or (3,) with `first_point`
    intersection_cells : ndarray of int64, shape (M,)
        As in PyVista, all cells also with `first_point`.
    """
    ends = [np.asarray(e, dtype=np.float64) for e in (origin, end_point)]
    for name, end in zip(("origin", "end_point"), ends):
        if end.shape != (3,):
            raise ValueError(f"{name} has shape {end.shape}; give three numbers")
        if not np.isfinite(end).all():
            raise ValueError(f"{name} is {end.tolist()}; give finite numbers")
    start, way = ends[0], ends[1] - ends[0]
    if not way.any():
        # Nothing is crossed on the way to the same place.
        return np.empty((0, 3)), np.empty(0, dtype=np.int64)
    surface = surface_of(mesh)
    # The end belongs to the segment.
    limit = np.nextafter(1.0, 2.0)
    hits = surface.scene.all_hits(start[None], way[None], t_max=limit)
    of_hits = (len(hits.t), 3)
    starts, ways = np.broadcast_to(start, of_hits), np.broadcast_to(way, of_hits)
    points = surface.places(starts, ways, hits.t, hits.primitive, hits.uv)
    cells = _cells(surface, hits.primitive)
    if first_point and len(points):
        points = points[0]
    return points, cells


def multi_ray_trace(mesh, origins, directions, first_point=False, retry=False):
    """Where rays meet a mesh.

    Parameters
    ----------
    mesh : pyvista.DataSet
    origins, directions : array_like, shape (N, 3)
    first_point : bool
        Only the first hit of each ray.
    retry : bool
        Changes nothing: no ray is lost.

    Returns
    -------
    intersection_points : ndarray of float64, shape (M, 3)
    intersection_rays, intersection_cells : ndarray of int64, shape (M,)
        In the order of the rays, and nearest first within each.
    """
    origins = np.asarray(origins, dtype=np.float64)
    directions = np.asarray(directions, dtype=np.float64)
    surface = surface_of(mesh)
    if first_point:
        hits = surface.scene.cast(origins, directions, normals=False)
        rays = np.flatnonzero(hits.hit)
        t, primitive, uv = hits.t[rays], hits.primitive[rays], hits.uv[rays]
    else:
        hits = surface.scene.all_hits(origins, directions)
        rays, t, primitive, uv = hits.ray, hits.t, hits.primitive, hits.uv
    # An empty list has one dimension.
    starts, ways = origins.reshape(-1, 3)[rays], directions.reshape(-1, 3)[rays]
    points = surface.places(starts, ways, t, primitive, uv)
    return points, rays, _cells(surface, primitive)


def install():
    """Makes the methods of `pyvista.PolyData` with these names use this module."""
    import pyvista

    def traced(self, origin, end_point, first_point=False, plot=False, off_screen=None):
        if plot:
            return original(
                self, origin, end_point, first_point=first_point, plot=True, off_screen=off_screen
            )
        return ray_trace(self, origin, end_point, first_point)

    if pyvista.PolyData.multi_ray_trace is multi_ray_trace:
        return
    original = pyvista.PolyData.ray_trace
    pyvista.PolyData.ray_trace = traced
    pyvista.PolyData.multi_ray_trace = multi_ray_trace


def _cells(surface, primitive):
    primitive = primitive.astype(np.int64)
    return primitive if surface.cells is None else surface.cells[primitive].astype(np.int64)
