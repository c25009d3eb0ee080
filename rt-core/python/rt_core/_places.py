"""Where rays meet triangles, more exactly than float32 tells."""

import numpy as np


def on_planes(origins, directions, t, uv, corners):
    """The points in which rays meet the planes of their triangles, in float64.

    Along a plane the quotient says nothing: the triangle's own coordinates do.

    Parameters
    ----------
    origins, directions : ndarray of float64, shape (N, 3)
    t : ndarray, shape (N,)
        The hits' distances, rounded.
    uv : ndarray, shape (N, 2)
    corners : ndarray of float64, shape (N, 3, 3)

    Returns
    -------
    ndarray of float64, shape (N, 3)
    """
    first = corners[:, 0]
    e1, e2 = corners[:, 1] - first, corners[:, 2] - first
    normals = np.cross(e1, e2)
    along = np.einsum("ij,ij->i", directions, normals)
    with np.errstate(divide="ignore", invalid="ignore"):
        exact = np.einsum("ij,ij->i", first - origins, normals) / along
    size = np.linalg.norm(normals, axis=1) * np.linalg.norm(directions, axis=1)
    steep = np.abs(along) > 1e-6 * size
    at_plane = origins + directions * np.where(steep, exact, t)[:, None]
    weights = uv.astype(np.float64)
    inside = first + e1 * weights[:, :1] + e2 * weights[:, 1:]
    return np.where(steep[:, None], at_plane, inside)
