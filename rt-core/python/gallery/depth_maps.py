"""Depth maps of an object from all sides, as a scanner takes them, put together to points.

Shows: `Scene.cast` with `out=`, so that no array is made anew for each view.
"""

import sys

import numpy as np
import rt_core

# The object: a knotted tube of triangles.
turns, around = 400, 24
s = np.linspace(0, 2 * np.pi, turns, endpoint=False)
line = np.stack([np.sin(s) + 2 * np.sin(2 * s), np.cos(s) - 2 * np.cos(2 * s), -np.sin(3 * s)], 1)
along = np.roll(line, -1, 0) - np.roll(line, 1, 0)
along /= np.linalg.norm(along, axis=1, keepdims=True)
side = np.cross(along, [0.0, 0.0, 1.0])
side /= np.linalg.norm(side, axis=1, keepdims=True)
a = np.linspace(0, 2 * np.pi, around, endpoint=False)[None, :, None]
ring = np.cos(a) * side[:, None] + np.sin(a) * np.cross(along, side)[:, None]
vertices = (line[:, None] + 0.45 * ring).reshape(-1, 3)
i, j = np.meshgrid(np.arange(turns), np.arange(around), indexing="ij")
corner = lambda di, dj: ((i + di) % turns * around + (j + dj) % around).ravel()  # noqa: E731
triangles = np.concatenate(
    [
        np.stack([corner(0, 0), corner(1, 0), corner(1, 1)], 1),
        np.stack([corner(0, 0), corner(1, 1), corner(0, 1)], 1),
    ]
)
scene = rt_core.Scene(vertices, triangles)

# Six views; each pixel is a ray along the view.
pixels = 200
u, v = np.meshgrid(np.linspace(-4, 4, pixels), np.linspace(4, -4, pixels))
hits, scanned, maps = None, [], []
for angle in np.arange(6) * np.pi / 3:
    ahead = np.array([-np.cos(angle), -np.sin(angle), 0.0])
    right = np.array([-np.sin(angle), np.cos(angle), 0.0])
    origins = (u[..., None] * right + v[..., None] * [0, 0, 1] - 8 * ahead).reshape(-1, 3)
    directions = np.broadcast_to(ahead, origins.shape)
    hits = scene.cast(origins, directions, out=hits)
    met = hits.hit
    scanned.append(origins[met] + hits.t[met, None] * ahead)
    maps.append(hits.t.reshape(pixels, pixels).copy())
points = np.concatenate(scanned)

# Every scanned point lies on the object.
error = scene.closest_point(points).distance.max()
print(f"{len(points)} points of 6 views; farthest from the surface {error:.1e}")
assert len(points) > 30_000 and error < 1e-5

size = 0.02
picture = rt_core.render(
    rt_core.Spheres(points[::4], size, scalars=points[::4, 2]),
    size=(480, 360),
    samples=4,
    ambient=0.3,
    lights=[(1, -1, 2)],
)
picture.save(sys.argv[1] if len(sys.argv) > 1 else "depth_maps.png")
