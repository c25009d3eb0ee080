"""Ray queries for trimesh, in the place of those by Embree.

Examples
--------
>>> import trimesh
>>> from rt_core.trimesh import RayMeshIntersector
>>> mesh = trimesh.creation.box()
>>> mesh.ray = RayMeshIntersector(mesh)
>>> mesh.ray.intersects_any([[0, 0, 5], [3, 3, 5]], [[0, 0, -1], [0, 0, -1]])
array([ True, False])

`install` does so for every mesh that is made afterwards.
"""

import numpy as np

from rt_core._places import on_planes
from rt_core._scene import Scene


def install():
    """Makes trimesh use this module wherever it would use Embree.

    Meshes that exist keep what they have. Passing ``use_embree=False`` to trimesh still selects
    trimesh's own slow queries.
    """
    import sys

    import trimesh.ray

    here = sys.modules[__name__]
    trimesh.ray.ray_pyembree = here
    trimesh.ray.has_embree = True
    sys.modules["trimesh.ray.ray_pyembree"] = here


def _rows(name, values):
    array = np.asarray(values, dtype=np.float64)
    if array.size % 3 or array.ndim > 2 or (array.ndim == 2 and array.size and array.shape[1] != 3):
        raise ValueError(f"{name} has shape {array.shape}; give (n, 3)")
    return array.reshape(-1, 3)


class RayMeshIntersector:
    """Ray queries of one mesh, with the methods of trimesh's class of this name.

    As with Embree, a ray that starts on the surface meets it there.

    Parameters
    ----------
    geometry : trimesh.Trimesh
        When its vertices or faces change, the next query builds a new tree.
    scale_to_box : bool
        Ignored: rays are as exact in meshes of any size.
    """

    def __init__(self, geometry, scale_to_box=True):
        self.mesh = geometry
        self._scale_to_box = scale_to_box
        self._built = None

    @property
    def _scene(self):
        """The tree of the mesh as it is now."""
        state = hash(self.mesh)
        if self._built is None or self._built[0] != state:
            vertices = np.array(self.mesh.vertices, dtype=np.float64)
            faces = np.array(self.mesh.faces, dtype=np.uint32).reshape(-1, 3)
            self._built = (state, Scene(vertices, faces))
        return self._built[1]

    def _rays(self, ray_origins, ray_directions):
        """Rays that can be cast, their numbers (None: all of them), and how many there are."""
        origins = _rows("ray_origins", ray_origins)
        directions = _rows("ray_directions", ray_directions)
        if origins.shape != directions.shape:
            raise ValueError(
                f"ray_origins has {len(origins)} rows and ray_directions has {len(directions)}; "
                "give as many of both"
            )
        # Most calls are cast as they are.
        squares = np.einsum("ij,ij->i", directions, directions)
        if ((squares > 1e-30) & (squares < 1e30)).all() and np.isfinite(origins).all():
            return origins, directions, None, len(origins)
        # trimesh answers rays without a direction with a miss.
        lengths = np.linalg.norm(directions, axis=1, keepdims=True)
        usable = np.isfinite(origins).all(axis=1) & (lengths[:, 0] > 0) & np.isfinite(lengths[:, 0])
        numbers = np.flatnonzero(usable)
        return origins[usable], directions[usable] / lengths[usable], numbers, len(origins)

    def intersects_id(
        self,
        ray_origins,
        ray_directions,
        multiple_hits=True,
        max_hits=100,
        return_locations=False,
    ):
        """Triangles that rays hit.

        Parameters
        ----------
        ray_origins, ray_directions : array_like, shape (n, 3)
        multiple_hits : bool
            All hits of each ray, nearest first, or the first alone.
        max_hits : int
            Most hits of one ray.
        return_locations : bool

        Returns
        -------
        index_tri : ndarray of int64, shape (m,)
        index_ray : ndarray of int64, shape (m,)
        locations : ndarray of float64, shape (m, 3)
            Only with `return_locations`.
        """
        origins, directions, numbers, _ = self._rays(ray_origins, ray_directions)
        scene = self._scene
        if multiple_hits:
            hits = scene.all_hits(origins, directions)
            rays, t, triangles = hits.ray, hits.t, hits.primitive.astype(np.int64)
            uv = hits.uv
            if np.diff(hits.starts).max(initial=0) > max_hits:
                kept = np.arange(len(t)) - hits.starts[rays] < max_hits
                rays, t, triangles, uv = rays[kept], t[kept], triangles[kept], uv[kept]
        else:
            hits = scene.cast(origins, directions, normals=False)
            rays = np.flatnonzero(hits.hit)
            t, triangles = hits.t[rays], hits.primitive[rays].astype(np.int64)
            uv = hits.uv[rays]
        given = rays if numbers is None else numbers[rays]
        if not return_locations:
            return triangles, given
        locations = self._locations(origins[rays], directions[rays], t, triangles, uv)
        return triangles, given, locations

    def _locations(self, origins, directions, t, triangles, uv):
        """Where rays meet the planes of their triangles, in float64."""
        corners = np.asarray(self.mesh.triangles, dtype=np.float64)[triangles]
        return on_planes(origins, directions, t, uv, corners)

    def intersects_location(self, ray_origins, ray_directions, multiple_hits=True):
        """Where rays hit.

        Returns
        -------
        locations : ndarray of float64, shape (m, 3)
        index_ray : ndarray of int64, shape (m,)
        index_tri : ndarray of int64, shape (m,)
        """
        index_tri, index_ray, locations = self.intersects_id(
            ray_origins, ray_directions, multiple_hits=multiple_hits, return_locations=True
        )
        return locations, index_ray, index_tri

    def intersects_first(self, ray_origins, ray_directions):
        """The first triangle of each ray, -1 for none."""
        origins, directions, numbers, count = self._rays(ray_origins, ray_directions)
        hits = self._scene.cast(origins, directions, normals=False)
        first = np.where(hits.hit, hits.primitive.astype(np.int64), -1)
        if numbers is None:
            return first
        found = np.full(count, -1, dtype=np.int64)
        found[numbers] = first
        return found

    def intersects_any(self, ray_origins, ray_directions):
        """Whether each ray hits the mesh."""
        origins, directions, numbers, count = self._rays(ray_origins, ray_directions)
        occluded = self._scene.occluded(origins, directions)
        if numbers is None:
            return occluded
        found = np.zeros(count, dtype=bool)
        found[numbers] = occluded
        return found

    def contains_points(self, points):
        """Whether each point lies inside the mesh, which must be closed."""
        return self._scene.contains(_rows("points", points))

    def __getstate__(self):
        return {"mesh": self.mesh, "_scale_to_box": self._scale_to_box}

    def __setstate__(self, state):
        self.__init__(state["mesh"], state["_scale_to_box"])

    def __copy__(self, *args):
        return RayMeshIntersector(self.mesh, self._scale_to_box)

    __deepcopy__ = __copy__
