"""Streamlines around a ball as tubes, coloured by the speed.

Shows: `rt_core.Tubes` with many lines in one object, each tube met exactly and not as triangles.
"""

import sys

import numpy as np
import rt_core
from matplotlib import cm, colors, pyplot

pyplot.switch_backend("Agg")

RADIUS_M, WIND_M_S = 0.5, 10.0


def velocity(at):
    """Flow without friction around a ball, the wind along x."""
    r = np.linalg.norm(at, axis=-1, keepdims=True)
    dipole = (RADIUS_M / r) ** 3 / 2
    wind = np.array([WIND_M_S, 0.0, 0.0])
    return wind + dipole * (wind - 3 * at * (at @ wind)[..., None] / r**2)


# Lines begin on four rings upstream; Runge and Kutta's steps of fourth order.
rings, around, steps, step_s = (0.04, 0.2, 0.4, 0.6, 0.8), 10, 270, 0.0012
angles = np.linspace(0, 2 * np.pi, around, endpoint=False)
ring, angle = np.meshgrid(rings, angles, indexing="ij")
at = np.stack([np.full(ring.shape, -1.5), ring * np.cos(angle), ring * np.sin(angle)], axis=-1)
at = at.reshape(-1, 3)
lines = [at]
for _ in range(steps):
    k1 = velocity(at)
    k2 = velocity(at + step_s / 2 * k1)
    k3 = velocity(at + step_s / 2 * k2)
    k4 = velocity(at + step_s * k3)
    at = at + step_s / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    lines.append(at)
lines = np.stack(lines, axis=1)
speed = np.linalg.norm(velocity(lines), axis=-1)

# On a streamline the stream function stays the same.
from_axis2 = (lines[..., 1:] ** 2).sum(axis=-1)
stream = from_axis2 * (1 - (RADIUS_M / np.linalg.norm(lines, axis=-1)) ** 3)
drift = np.abs(stream / stream[:, :1] - 1).max()
print(
    f"{len(lines)} lines of {lines.shape[1]} points; fastest {speed.max():.2f} m/s, "
    f"lines drift by {drift:.1e}"
)
assert drift < 1e-3
# At the ball's widest place the flow is half as fast again as the wind.
assert 1.4 * WIND_M_S < speed.max() < 1.5 * WIND_M_S + 1e-9

span = (0, 1.5 * WIND_M_S)
picture = rt_core.render(
    rt_core.Tubes(
        lines.reshape(-1, 3),
        0.014,
        offsets=np.arange(len(lines) + 1) * lines.shape[1],
        scalars=speed.reshape(-1),
        range=span,
    ),
    rt_core.Spheres([[0, 0, 0]], RADIUS_M, color=(0.75, 0.75, 0.78)),
    camera=rt_core.Camera((-1.2, -4.4, 1.5), (0.1, 0, 0), fov=29),
    size=(900, 520),
    samples=9,
    lights=[(-0.5, -1, 1.4)],
    ambient=0.5,
    ambient_occlusion=(1.0, 8),
)
figure, ax = pyplot.subplots(figsize=(8.6, 4.8), layout="constrained")
ax.imshow(picture.rgba8)
ax.set_axis_off()
ax.set_title(f"wind of {WIND_M_S:.0f} m/s around a ball of {2 * RADIUS_M:.0f} m")
scale = cm.ScalarMappable(colors.Normalize(*span), "viridis")
figure.colorbar(scale, ax=ax, label="speed in m/s", shrink=0.8)
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "streamlines.png", dpi=80)
