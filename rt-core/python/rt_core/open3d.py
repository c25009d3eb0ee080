"""Open3D's `RaycastingScene` with rt_core's rays, on numpy arrays.

Methods, shapes and dictionaries are those of `open3d.t.geometry.RaycastingScene`; results are numpy
arrays, and arguments may be Open3D's tensors.

Examples
--------
>>> import numpy as np
>>> from rt_core.open3d import RaycastingScene
>>> scene = RaycastingScene()
>>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=np.float32)
>>> scene.add_triangles(corners, np.array([[0, 1, 2]], dtype=np.uint32))
0
>>> answer = scene.cast_rays([[0.25, 0.25, 2, 0, 0, -1], [5, 5, 2, 0, 0, -1]])
>>> answer["t_hit"], answer["geometry_ids"]
(array([ 2., inf], dtype=float32), array([         0, 4294967295], dtype=uint32))
"""

import numpy as np

from rt_core import _arrays
from rt_core._rt_core import NO_HIT
from rt_core._scene import Scene


def _array(name, values, columns):
    """float32 rows of an array or a tensor, and the shape of what stands in front of them."""
    array = np.asarray(values.numpy() if hasattr(values, "numpy") else values)
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{name} has dtype {array.dtype}; give float32")
    if array.ndim < 1 or array.shape[-1] != columns:
        raise ValueError(f"{name} has shape {array.shape}; give (..., {columns})")
    return np.ascontiguousarray(array, dtype=np.float32).reshape(-1, columns), array.shape[:-1]


class RaycastingScene:
    """Triangle meshes that rays and points can be compared with.

    Parameters
    ----------
    nthreads : int
        Threads of builds; 0 for all of the machine.
    """

    #: What ids are where nothing was hit.
    INVALID_ID = NO_HIT

    def __init__(self, nthreads=0, device=None):
        self._threads = nthreads or None
        self._meshes = []
        self._scene = None

    def add_triangles(self, vertex_positions, triangle_indices=None):
        """Adds a mesh, and returns its id.

        Parameters
        ----------
        vertex_positions : array_like, shape (V, 3), or open3d.t.geometry.TriangleMesh
        triangle_indices : array_like of int, shape (M, 3)
            Not given with a mesh.
        """
        if triangle_indices is None:
            mesh = vertex_positions
            vertex_positions = mesh.vertex.positions
            triangle_indices = mesh.triangle.indices
        vertices, shape = _array("vertex_positions", vertex_positions, 3)
        if len(shape) != 1:
            raise ValueError(f"vertex_positions has shape {(*shape, 3)}; give (V, 3)")
        triangles = triangle_indices
        triangles = np.asarray(triangles.numpy() if hasattr(triangles, "numpy") else triangles)
        # Arguments are checked now, not when the tree is built.
        _arrays.vertices(vertices)
        _arrays.triangles(triangles, len(vertices))
        self._meshes.append((vertices, triangles))
        self._scene = None
        return len(self._meshes) - 1

    @property
    def _built(self):
        if self._scene is None:
            self._scene = Scene.from_meshes(self._meshes, threads=self._threads)
        return self._scene

    def cast_rays(self, rays, nthreads=0):
        """The first hit of each ray.

        Parameters
        ----------
        rays : array_like, shape (..., 6)
            Origin and direction of each.
        nthreads : int
            0 for all of the machine.

        Returns
        -------
        dict
            ``t_hit``, ``geometry_ids``, ``primitive_ids``, ``primitive_uvs`` and
            ``primitive_normals``, each of the shape of the rays.
        """
        rays, shape = _array("rays", rays, 6)
        hits = self._built.cast(rays[:, :3], rays[:, 3:], threads=nthreads or None)
        geometry, primitive = self._ids(hits.primitive)
        return {
            "t_hit": hits.t.reshape(shape),
            "geometry_ids": geometry.reshape(shape),
            "primitive_ids": primitive.reshape(shape),
            "primitive_uvs": hits.uv.reshape(*shape, 2),
            "primitive_normals": hits.normal.reshape(*shape, 3),
        }

    def test_occlusions(self, rays, tnear=0.0, tfar=np.inf, nthreads=0):
        """Whether each ray hits anything between `tnear` and `tfar`."""
        rays, shape = _array("rays", rays, 6)
        found = self._built.occluded(
            rays[:, :3], rays[:, 3:], t_min=tnear, t_max=tfar, threads=nthreads or None
        )
        return found.reshape(shape)

    def count_intersections(self, rays, nthreads=0):
        """How many surfaces each ray crosses, as int32."""
        rays, shape = _array("rays", rays, 6)
        found = self._built.count(rays[:, :3], rays[:, 3:], threads=nthreads or None)
        return found.astype(np.int32).reshape(shape)

    def list_intersections(self, rays, nthreads=0):
        """All hits of all rays.

        Returns
        -------
        dict
            ``ray_splits``: hits ``ray_splits[i]`` up to ``ray_splits[i + 1]`` are those of ray i;
            ``ray_ids``, ``t_hit``, ``geometry_ids``, ``primitive_ids``, ``primitive_uvs``.
        """
        rays, _ = _array("rays", rays, 6)
        hits = self._built.all_hits(rays[:, :3], rays[:, 3:], threads=nthreads or None)
        geometry, primitive = self._ids(hits.primitive)
        return {
            "ray_splits": hits.starts.astype(np.uint32),
            "ray_ids": hits.ray.astype(np.uint32),
            "t_hit": hits.t,
            "geometry_ids": geometry,
            "primitive_ids": primitive,
            "primitive_uvs": hits.uv,
        }

    def compute_closest_points(self, query_points, nthreads=0):
        """The closest point of all surfaces.

        Returns
        -------
        dict
            ``points``, ``geometry_ids``, ``primitive_ids``, ``primitive_uvs``,
            ``primitive_normals``.
        """
        points, shape = _array("query_points", query_points, 3)
        found = self._built.closest_point(points, threads=nthreads or None)
        geometry, primitive = self._ids(found.primitive)
        return {
            "points": found.point.astype(np.float32).reshape(*shape, 3),
            "geometry_ids": geometry.reshape(shape),
            "primitive_ids": primitive.reshape(shape),
            "primitive_uvs": found.uv.reshape(*shape, 2),
            "primitive_normals": self._normals(geometry, primitive).reshape(*shape, 3),
        }

    def compute_distance(self, query_points, nthreads=0):
        """Distance to the closest surface."""
        points, shape = _array("query_points", query_points, 3)
        found = self._built.closest_point(points, threads=nthreads or None)
        return found.distance.reshape(shape)

    def compute_signed_distance(self, query_points, nthreads=0, nsamples=1):
        """Distance to the closest surface, below zero inside closed meshes.

        `nsamples` changes nothing: one decision is exact.
        """
        points, shape = _array("query_points", query_points, 3)
        return self._built.signed_distance(points, threads=nthreads or None).reshape(shape)

    def compute_occupancy(self, query_points, nthreads=0, nsamples=1):
        """1 inside closed meshes and 0 outside, as float32."""
        points, shape = _array("query_points", query_points, 3)
        inside = self._built.contains(points, threads=nthreads or None)
        return inside.astype(np.float32).reshape(shape)

    @staticmethod
    def create_rays_pinhole(
        intrinsic_matrix=None,
        extrinsic_matrix=None,
        width_px=None,
        height_px=None,
        *,
        fov_deg=None,
        center=None,
        eye=None,
        up=None,
    ):
        """Rays of a pinhole camera, (height_px, width_px, 6).

        Either by its matrices, (3, 3) and (4, 4) from the world to the camera, or by `fov_deg`
        (horizontal), `center`, `eye` and `up`. Directions reach to depth 1.
        """
        if width_px is None or height_px is None or width_px < 1 or height_px < 1:
            raise ValueError(f"the image has {width_px} x {height_px} pixels; give 1 or more each")
        if fov_deg is not None:
            intrinsic_matrix, extrinsic_matrix = _pinhole(
                fov_deg, center, eye, up, width_px, height_px
            )
        if intrinsic_matrix is None or extrinsic_matrix is None:
            raise TypeError("give both matrices, or fov_deg, center, eye and up")
        intrinsic = np.asarray(intrinsic_matrix, dtype=np.float64)
        extrinsic = np.asarray(extrinsic_matrix, dtype=np.float64)
        turn, shift = extrinsic[:3, :3], extrinsic[:3, 3]
        x, y = np.meshgrid(np.arange(width_px) + 0.5, np.arange(height_px) + 0.5)
        pixels = np.stack([x, y, np.ones_like(x)], axis=-1)
        directions = pixels @ np.linalg.inv(intrinsic).T @ turn
        origins = np.broadcast_to(-turn.T @ shift, directions.shape)
        return np.concatenate([origins, directions], axis=-1).astype(np.float32)

    def _ids(self, primitive):
        mesh, triangle = self._built.split(primitive)
        missed = primitive == NO_HIT
        return tuple(
            np.where(missed, NO_HIT, ids).astype(np.uint32) for ids in (mesh, triangle)
        )

    def _normals(self, geometry, primitive):
        normals = np.zeros((len(primitive), 3), dtype=np.float32)
        for number, (vertices, triangles) in enumerate(self._meshes):
            of_mesh = np.flatnonzero(geometry == number)
            corners = vertices[triangles[primitive[of_mesh]]].astype(np.float64)
            normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            length = np.linalg.norm(normal, axis=1, keepdims=True)
            normals[of_mesh] = normal / np.where(length > 0, length, 1)
        return normals


def _pinhole(fov_deg, center, eye, up, width, height):
    """Open3D's matrices of a camera that looks from `eye` at `center`."""
    center, eye, up = (np.asarray(v, dtype=np.float64) for v in (center, eye, up))
    focal = 0.5 * width / np.tan(0.5 * np.radians(fov_deg))
    intrinsic = np.array([[focal, 0, 0.5 * width], [0, focal, 0.5 * height], [0, 0, 1]])
    ahead = (center - eye) / np.linalg.norm(center - eye)
    # As in Open3D, rows of the image go along `up`, and columns to the left.
    left = np.cross(up, ahead)
    left /= np.linalg.norm(left)
    turn = np.stack([left, np.cross(ahead, left), ahead])
    extrinsic = np.eye(4)
    extrinsic[:3, :3], extrinsic[:3, 3] = turn, -turn @ eye
    return intrinsic, extrinsic
