"""Exact ray queries and ray traced pictures of triangle meshes in numpy arrays.

A :class:`Scene` answers which triangle a ray meets, and more. No ray passes
between triangles that share an edge or a vertex. Answers do not depend on
the number of threads, nor on what else is asked in the same call.

Examples
--------
>>> import numpy as np
>>> import rt_core
>>> vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=np.float32)
>>> triangles = np.array([[0, 1, 2]], dtype=np.uint32)
>>> scene = rt_core.Scene(vertices, triangles)
>>> t, primitive, uv, normal = scene.cast([[0.25, 0.5, 3]], [[0, 0, -1]])
>>> t, primitive, uv
(array([3.]), array([0], dtype=uint32), array([[0.25, 0.5 ]], dtype=float32))
>>> normal
array([[0., 0., 1.]], dtype=float32)
"""

from rt_core._rt_core import NO_HIT, count_threads
from rt_core._camera import Camera
from rt_core._pictures import (
    Isosurface,
    Mesh,
    Picture,
    Spheres,
    Tubes,
    Volume,
    render,
)
from rt_core._scene import AllHits, ClosestPoints, Hits, Scene

__version__ = "0.1.0"
__all__ = [
    "NO_HIT",
    "AllHits",
    "Camera",
    "ClosestPoints",
    "Hits",
    "Isosurface",
    "Mesh",
    "Picture",
    "Scene",
    "Spheres",
    "Tubes",
    "Volume",
    "count_threads",
    "render",
]
