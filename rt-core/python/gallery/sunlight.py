"""Hours of sunlight between the houses of a block, on a day of equal day and night.

Shows: `Scene.occluded` for many points and directions at once, and a picture coloured by the
answer. The same loop adds up any dose that comes in straight lines: ultraviolet light of a lamp,
radio from a mast, what a camera sees.
"""

import sys

import numpy as np
import rt_core
from matplotlib import pyplot

pyplot.switch_backend("Agg")

# Houses of a block: x and y from, x and y to, height, in metres. North is up.
HOUSES = [
    (-40, 18, 40, 30, 14), (-40, -30, -28, 10, 14), (28, -30, 40, 10, 10), (-12, -30, 12, -20, 22),
    (-4, -4, 6, 4, 5),
]  # fmt: skip
CORNERS = np.array([[i >> 0 & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)])
SIDES = np.array(
    [[0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4],
     [2, 6, 7], [2, 7, 3], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5]]
)  # fmt: skip


def boxes():
    """All houses as one mesh."""
    vertices, triangles = [], []
    for x0, y0, x1, y1, height in HOUSES:
        triangles.append(SIDES + 8 * len(vertices))
        vertices.append(np.array([x0, y0, 0]) + CORNERS * [x1 - x0, y1 - y0, height])
    return np.concatenate(vertices).astype(float), np.concatenate(triangles)


# Directions to the sun every six minutes: on that day it goes along a great circle from east to
# west, which leans to the south by the latitude.
LATITUDE = np.radians(52)
MINUTES = 6
turned = np.pi * (np.arange(12 * 60 // MINUTES) + 0.5) / (12 * 60 // MINUTES)
to_sun = np.stack(
    [np.cos(turned), -np.sin(LATITUDE) * np.sin(turned), np.cos(LATITUDE) * np.sin(turned)], axis=1
)

# The ground, in squares of half a metre.
half, side = (55, 45), 0.5
x = np.arange(-half[0], half[0], side) + side / 2
y = np.arange(-half[1], half[1], side) + side / 2
ground = np.stack(np.meshgrid(x, y, indexing="xy"), axis=-1).reshape(-1, 2)
points = np.column_stack([ground, np.zeros(len(ground))])

scene = rt_core.Scene(*boxes())
hours = np.zeros(len(points))
for direction in to_sun:
    directions = np.broadcast_to(direction, points.shape)
    hours += ~scene.occluded(points, directions) * MINUTES / 60
inside = np.zeros(len(points), dtype=bool)
for x0, y0, x1, y1, _ in HOUSES:
    inside |= (ground > [x0, y0]).all(axis=1) & (ground < [x1, y1]).all(axis=1)
hours[inside] = np.nan

print(
    f"{len(points) * len(to_sun)} rays; in the open {np.nanmax(hours):.1f} h of sun, "
    f"in the court {np.nanmedian(hours[(np.abs(ground) < [25, 15]).all(axis=1)]):.1f} h"
)
# South of all houses nothing stands before the sun, and close to a wall's north side the sun is
# seen at most while it is in the north, which on this day is never.
south = ground[:, 1] < -31
assert np.allclose(hours[south], 12)
north = (np.abs(ground[:, 0]) < 20) & (ground[:, 1] > 30) & (ground[:, 1] < 31)
assert np.nanmax(hours[north]) < 0.5

figure, (above, beside) = pyplot.subplots(
    1, 2, figsize=(11, 4.6), layout="constrained", width_ratios=(1, 1.1)
)
extent = (-half[0], half[0], -half[1], half[1])
shown = above.imshow(
    hours.reshape(len(y), len(x)), origin="lower", extent=extent, cmap="viridis", vmin=0, vmax=12
)
above.set(xlabel="east in m", ylabel="north in m", facecolor="0.75", title="from above")

# The same as a picture: a square of the ground is two triangles.
columns, rows = len(x) + 1, len(y) + 1
i, j = (a.ravel() for a in np.meshgrid(np.arange(len(x)), np.arange(len(y)), indexing="xy"))
corner = j * columns + i
lattice = np.stack(
    np.meshgrid(
        np.linspace(-half[0], half[0], columns), np.linspace(-half[1], half[1], rows), indexing="xy"
    ),
    axis=-1,
).reshape(-1, 2)
squares = np.stack(
    [corner, corner + 1, corner + columns + 1, corner, corner + columns + 1, corner + columns], 1
)
plate = rt_core.Mesh(
    np.column_stack([lattice, np.zeros(len(lattice))]),
    squares.reshape(-1, 3),
    scalars=np.repeat(np.nan_to_num(hours), 2),
    range=(0, 12),
)
picture = rt_core.render(
    rt_core.Mesh(*boxes(), color=(0.7, 0.66, 0.6)),
    plate,
    camera=rt_core.Camera((32, -120, 95), (-2, -4, 0), fov=41),
    size=(720, 540),
    samples=8,
    lights=[(-0.3, -0.6, 0.8)],
    ambient=0.6,
    ambient_occlusion=(30.0, 8),
)
beside.imshow(picture.rgba8)
beside.set(xticks=[], yticks=[], title="from the south, lit in the early afternoon")
figure.colorbar(shown, ax=beside, label="sunlight in hours of the day")
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "sunlight.png", dpi=80)
