"""Scenes of triangle meshes."""

from typing import NamedTuple

import numpy as np

from rt_core import _arrays
from rt_core._rt_core import NO_HIT, World


class Hits(NamedTuple):
    """The closest hits of rays, one row for each.

    Attributes
    ----------
    t : ndarray of float, shape (N,)
        Distance in units of the direction's length; infinite for a miss. Of the type of the rays.
    primitive : ndarray of uint32, shape (N,)
        The triangle; `rt_core.NO_HIT` for a miss. With several meshes, triangles are numbered
        through: see `Scene.split`.
    uv : ndarray of float32, shape (N, 2)
        Weights of the triangle's second and third corner; the first has the rest.
    normal : ndarray of float32, shape (N, 3)
        Unit normal of the triangle, on the side where its corners are seen counter-clockwise;
        zero for a miss.
    """

    t: np.ndarray
    primitive: np.ndarray
    uv: np.ndarray
    normal: np.ndarray

    @property
    def hit(self):
        """Which rays hit anything."""
        return self.primitive != NO_HIT


class AllHits(NamedTuple):
    """All hits of rays, the list of one ray after the other (CSR).

    Attributes
    ----------
    starts : ndarray of int64, shape (N + 1,)
        Hits ``starts[i]`` up to ``starts[i + 1]`` are those of ray i, nearest first.
    t : ndarray of float, shape (H,)
    primitive : ndarray of uint32, shape (H,)
    uv : ndarray of float32, shape (H, 2)
    """

    starts: np.ndarray
    t: np.ndarray
    primitive: np.ndarray
    uv: np.ndarray

    @property
    def ray(self):
        """The ray of each hit."""
        return np.repeat(np.arange(len(self.starts) - 1), np.diff(self.starts))


class ClosestPoints(NamedTuple):
    """The points of the surfaces that are closest to others.

    Attributes
    ----------
    point : ndarray of float64, shape (N, 3)
        NaN where nothing lies within the largest distance.
    distance : ndarray of float32, shape (N,)
    primitive : ndarray of uint32, shape (N,)
    uv : ndarray of float32, shape (N, 2)
    """

    point: np.ndarray
    distance: np.ndarray
    primitive: np.ndarray
    uv: np.ndarray


def _check_t_min(value):
    return _arrays.scalar("t_min", value, "0 or more", lambda v: 0 <= v < np.inf)


class Scene:
    """Triangle meshes that rays and points can be compared with.

    Parameters
    ----------
    vertices : array_like of float32 or float64, shape (V, 3)
        float32 in C order is not copied. float64 is converted to float32, relative to a point
        near the vertices when they lie far from zero.
    triangles : array_like of int, shape (M, 3)
        Indices of vertices. uint32 and int32 in C order are not copied.
    quality : {"balanced", "fast", "best"}
        Effort of the build: more takes longer and makes rays faster.
    robustness : {"watertight", "fast"}
        Whether it is excluded that a ray passes between triangles that share an edge or a vertex.
    storage : {"plain", "compact"}
        "compact" takes a quarter of the tree's memory, and rays take longer.
    threads : int, optional
        Threads of the build; all of the machine by default.

    Notes
    -----
    The scene keeps the arrays, and takes normals from them. Do not change them while it lives.

    Examples
    --------
    >>> import numpy as np
    >>> from rt_core import Scene
    >>> scene = Scene([[0, 0, 0], [2, 0, 0], [0, 2, 0]], [[0, 1, 2]])
    >>> scene.copied
    ('vertices: int64 to float32', 'triangles: int64 to uint32')
    >>> scene.occluded([[0.5, 0.5, 1], [5, 5, 1]], [[0, 0, -1], [0, 0, -1]])
    array([ True, False])
    """

    def __init__(
        self,
        vertices,
        triangles,
        *,
        quality="balanced",
        robustness="watertight",
        storage="plain",
        threads=None,
    ):
        self._build([_mesh(vertices, triangles)], (quality, robustness, storage), threads)

    @classmethod
    def from_meshes(
        cls,
        meshes,
        *,
        quality="balanced",
        robustness="watertight",
        storage="plain",
        threads=None,
    ):
        """A scene of several meshes.

        Parameters
        ----------
        meshes : sequence of (vertices, triangles)
            As `Scene` takes them. Their triangles are numbered through.
        quality, robustness, storage, threads
            As of `Scene`.

        Returns
        -------
        Scene

        Examples
        --------
        >>> corner = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
        >>> raised = [[0, 0, 1], [1, 0, 1], [0, 1, 1]]
        >>> scene = Scene.from_meshes([(corner, [[0, 1, 2]]), (raised, [[0, 1, 2]])])
        >>> hits = scene.cast([[0.2, 0.2, 5]], [[0, 0, -1]])
        >>> scene.split(hits.primitive)
        (array([1]), array([0]))
        """
        try:
            meshes = list(meshes)
        except TypeError:
            raise TypeError(
                f"meshes is {meshes!r}; give a list of pairs of vertices and triangles"
            ) from None
        made = []
        for number, mesh in enumerate(meshes):
            if not isinstance(mesh, (tuple, list)) or len(mesh) != 2:
                raise TypeError(
                    f"mesh {number} is of type {type(mesh).__name__}; give a pair of vertices and "
                    "triangles"
                )
            vertices, triangles = mesh
            try:
                made.append(_mesh(vertices, triangles))
            except (TypeError, ValueError, IndexError) as error:
                raise type(error)(f"mesh {number}: {error}") from None
        scene = cls.__new__(cls)
        scene._build(made, (quality, robustness, storage), threads)
        return scene

    def _build(self, meshes, options, threads):
        for name, value in zip(("quality", "robustness", "storage"), options):
            if not isinstance(value, str):
                raise TypeError(f"{name} is {value!r}; give a word")
        self._meshes = [(positions, faces, origin) for positions, faces, origin, _ in meshes]
        self._options = options
        #: What was copied, and why; empty if nothing was.
        self.copied = tuple(text for *_, copied in meshes for text in copied)
        self._world = World(self._meshes, *options, _arrays.threads(threads))
        self._firsts = np.array(self._world.firsts, dtype=np.int64)

    def __reduce__(self):
        return (_restore, (self._meshes, self._options, self.copied))

    def __repr__(self):
        return f"<rt_core.Scene of {len(self._meshes)} meshes, {self.num_triangles} triangles>"

    @property
    def num_triangles(self):
        """Number of triangles of all meshes."""
        return self._world.triangles

    @property
    def num_meshes(self):
        """Number of meshes."""
        return len(self._meshes)

    @property
    def bounds(self):
        """The smallest and the largest corner as a (2, 3) array; None without triangles."""
        bounds = self._world.bounds
        return None if bounds is None else np.array(bounds)

    @property
    def nbytes(self):
        """Bytes of the tree, without the arrays that it was built from."""
        return self._world.bytes

    @property
    def build_seconds(self):
        """Seconds that the tree took to build."""
        return self._world.build_seconds

    def split(self, primitive):
        """Mesh and triangle within the mesh for the numbers that answers have.

        Parameters
        ----------
        primitive : array_like of uint32

        Returns
        -------
        mesh, triangle : ndarray of int64
            -1 where `primitive` is `rt_core.NO_HIT`.

        Raises
        ------
        IndexError
            For a number that no triangle of this scene has.
        """
        primitive = np.asarray(primitive)
        if primitive.dtype.kind not in "iu" and primitive.size:
            raise TypeError(f"primitive has dtype {primitive.dtype}; give an integer type")
        primitive = primitive.astype(np.int64)
        wrong = (primitive != NO_HIT) & ((primitive < 0) | (primitive >= self.num_triangles))
        if wrong.any():
            raise IndexError(
                f"primitive has {primitive[wrong].flat[0]}, and there are {self.num_triangles} "
                "triangles; give numbers that this scene has answered"
            )
        mesh = np.searchsorted(self._firsts, primitive, side="right") - 1
        missed = primitive == NO_HIT
        triangle = primitive - self._firsts[np.minimum(mesh, len(self._meshes))]
        return np.where(missed, -1, mesh), np.where(missed, -1, triangle)

    def cast(
        self, origins, directions, *, t_min=0.0, t_max=None, normals=True, out=None, threads=None
    ):
        """The closest hit of each ray.

        Parameters
        ----------
        origins, directions : array_like, shape (N, 3)
            float32 or float64; what is neither or not in C order is copied. Directions need not
            have unit length.
        t_min : float
            The smallest `t` that counts.
        t_max : float or array_like of shape (N,), optional
            Hits at or behind it do not count.
        normals : bool
            Without them `normal` has no rows, and the call takes less time.
        out : Hits, optional
            Arrays to write to, as an earlier call returned them.
        threads : int, optional
            All of the machine by default. Answers do not depend on it.

        Returns
        -------
        Hits
            ``t, primitive, uv, normal``.

        Raises
        ------
        ValueError
            For shapes that do not fit, numbers that are not finite, and zero directions.
        TypeError
            For arrays that hold no numbers, and an `out` of other types.
        KeyboardInterrupt
            After Ctrl-C, also in the middle of a long call.
        """
        origins, directions, t_min, t_max = _rays(origins, directions, t_min, t_max)
        rows = len(origins)
        if out is not None and not (isinstance(out, tuple) and len(out) == 4):
            raise TypeError("out is no tuple of four arrays; give what an earlier cast() returned")
        given = out if out is not None else (None,) * 4
        hits = Hits(
            _arrays.output("out.t", given[0], (rows,), origins.dtype),
            _arrays.output("out.primitive", given[1], (rows,), np.uint32),
            _arrays.output("out.uv", given[2], (rows, 2), np.float32),
            _arrays.output("out.normal", given[3], (rows if normals else 0, 3), np.float32),
        )
        threads = _arrays.threads(threads)
        self._world.cast(origins, directions, t_min, t_max, tuple(hits), threads)
        return hits

    def occluded(self, origins, directions, *, t_min=0.0, t_max=None, out=None, threads=None):
        """Whether each ray hits anything; faster than `cast`.

        Parameters
        ----------
        origins, directions, t_min, t_max, threads
            As of `cast`.
        out : ndarray of bool, shape (N,), optional
            Array to write to.

        Returns
        -------
        ndarray of bool, shape (N,)
        """
        origins, directions, t_min, t_max = _rays(origins, directions, t_min, t_max)
        out = _arrays.output("out", out, (len(origins),), np.bool_)
        threads = _arrays.threads(threads)
        self._world.occluded(origins, directions, t_min, t_max, out, threads)
        return out

    def count(self, origins, directions, *, t_min=0.0, t_max=None, out=None, threads=None):
        """How many surfaces each ray crosses; an edge that triangles share counts once.

        Parameters
        ----------
        origins, directions, t_min, t_max, threads
            As of `cast`.
        out : ndarray of uint32, shape (N,), optional
            Array to write to.

        Returns
        -------
        ndarray of uint32, shape (N,)
        """
        origins, directions, t_min, t_max = _rays(origins, directions, t_min, t_max)
        out = _arrays.output("out", out, (len(origins),), np.uint32)
        threads = _arrays.threads(threads)
        self._world.count(origins, directions, t_min, t_max, out, threads)
        return out

    def all_hits(
        self, origins, directions, *, t_min=0.0, t_max=None, max_hits=100_000_000, threads=None
    ):
        """All surfaces that each ray crosses.

        Parameters
        ----------
        origins, directions, t_min, t_max, threads
            As of `cast`.
        max_hits : int
            More hits than this, of all rays together, are an error.

        Returns
        -------
        AllHits
            ``starts, t, primitive, uv``.

        Examples
        --------
        >>> layers = [[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 1], [9, 0, 1], [0, 9, 1]]
        >>> scene = Scene(layers, [[0, 1, 2], [3, 4, 5]])
        >>> hits = scene.all_hits([[2, 2, 5], [8, 8, 5]], [[0, 0, -1], [0, 0, -1]])
        >>> hits.starts, hits.t, hits.primitive
        (array([0, 2, 2]), array([4., 5.]), array([1, 0], dtype=uint32))
        """
        origins, directions, t_min, t_max = _rays(origins, directions, t_min, t_max)
        if isinstance(max_hits, bool) or not isinstance(max_hits, (int, np.integer)):
            raise TypeError(f"max_hits is {max_hits!r}; give a whole number")
        if not 0 <= max_hits < 2**62:
            raise ValueError(f"max_hits is {max_hits}; give 0 or more")
        threads = _arrays.threads(threads)
        starts, t, primitive, uv = self._world.all_hits(
            origins, directions, t_min, t_max, int(max_hits), threads
        )
        return AllHits(starts, t, primitive, uv.reshape(-1, 2))

    def contains(self, points, *, threads=None):
        """Whether each point lies inside a mesh, which must be closed.

        Parameters
        ----------
        points : array_like, shape (N, 3)
        threads : int, optional
            All of the machine by default.

        Returns
        -------
        ndarray of bool, shape (N,)
        """
        return self._world.contains(_points(points), _arrays.threads(threads))

    def closest_point(self, points, *, max_distance=np.inf, threads=None):
        """The point of all surfaces that is closest to each of some points.

        Parameters
        ----------
        points : array_like, shape (N, 3)
        max_distance : float
            Surfaces farther away do not count.
        threads : int, optional
            All of the machine by default.

        Returns
        -------
        ClosestPoints
            ``point, distance, primitive, uv``.

        Examples
        --------
        >>> scene = Scene([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
        >>> found = scene.closest_point([[0.25, 0.25, 2]])
        >>> found.point, found.distance
        (array([[0.25, 0.25, 0.  ]]), array([2.], dtype=float32))
        """
        limit = _arrays.scalar("max_distance", max_distance, "0 or more", lambda v: v >= 0)
        point, distance, primitive, uv = self._world.closest_point(
            _points(points), limit, _arrays.threads(threads)
        )
        return ClosestPoints(point.reshape(-1, 3), distance, primitive, uv.reshape(-1, 2))

    def signed_distance(self, points, *, threads=None):
        """Distance to the closest surface, below zero inside closed meshes.

        Parameters
        ----------
        points : array_like, shape (N, 3)
        threads : int, optional
            All of the machine by default.

        Returns
        -------
        ndarray of float32, shape (N,)
            NaN for a scene without triangles.
        """
        return self._world.signed_distance(_points(points), _arrays.threads(threads))


def _mesh(vertices, triangles):
    positions, origin, copied = _arrays.vertices(vertices)
    faces, faces_copied = _arrays.triangles(triangles, len(positions))
    return positions, faces, origin, copied + faces_copied


def _restore(meshes, options, copied):
    scene = Scene.__new__(Scene)
    # Scenes that were pickled before there was a choice of storage have two options.
    scene._build([(*mesh, []) for mesh in meshes], (*options, "plain")[:3], None)
    scene.copied = copied
    return scene


def _rays(origins, directions, t_min, t_max):
    origins = _arrays.rows_of_three("origins", origins)
    directions = _arrays.rows_of_three("directions", directions)
    if len(origins) != len(directions):
        raise ValueError(
            f"origins has {len(origins)} rows and directions has {len(directions)}; give as many "
            "of both"
        )
    dtype = _arrays.float_type(origins, directions)
    origins = _arrays.contiguous(origins, dtype)
    directions = _arrays.contiguous(directions, dtype)
    if t_max is not None:
        limits = _arrays.numbers("t_max", t_max)
        if limits.ndim == 0:
            limits = np.full(len(origins), limits, dtype=dtype) if limits != np.inf else None
        elif limits.shape != (len(origins),):
            raise ValueError(f"t_max has shape {limits.shape}; give one number, or one per ray")
        t_max = limits if limits is None else _arrays.contiguous(limits, dtype)
    return origins, directions, _check_t_min(t_min), t_max


def _points(points):
    points = _arrays.rows_of_three("points", points)
    return _arrays.contiguous(points, _arrays.float_type(points))
