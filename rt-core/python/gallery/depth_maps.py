"""Depth maps of an object from all sides, as a scanner takes them, put together to points.

Shows: `Scene.cast` with `out=`, so that no array is made anew for each view.
"""

import sys

import numpy as np
import rt_core
from matplotlib import pyplot

pyplot.switch_backend("Agg")

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

figure, (one, cloud) = pyplot.subplots(
    1, 2, figsize=(10.5, 4.4), layout="constrained", width_ratios=(1, 1.2)
)
depth = np.where(np.isfinite(maps[1]), maps[1], np.nan)
shown = one.imshow(depth, extent=(-4, 4, -4, 4), cmap="viridis_r")
one.set(title="one of six depth maps", xlabel="m", ylabel="m", facecolor="0.9")
figure.colorbar(shown, ax=one, label="depth in m", shrink=0.85)
picture = rt_core.render(
    rt_core.Spheres(points[::2], 0.035, scalars=points[::2, 2]),
    camera=rt_core.Camera((4.2, -9.5, 7), (0, 0, 0), fov=36),
    size=(640, 480),
    samples=8,
    ambient=0.5,
    lights=[(1, -1, 2)],
    ambient_occlusion=(2.0, 4),
)
cloud.imshow(picture.rgba8)
cloud.set_axis_off()
cloud.set_title(f"{len(points)} points of all six")
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "depth_maps.png", dpi=80)
