"""How thick is a part? Rays inwards from every triangle of a trimesh.

Shows: `rt_core.trimesh` in the place of Embree, and a picture coloured by an answer.
"""

import sys

import numpy as np
import rt_core
import trimesh
from matplotlib import cm, colors, pyplot
from rt_core.trimesh import RayMeshIntersector

pyplot.switch_backend("Agg")

# A bush whose bore is not in the middle: the wall is 2 mm thick on one side and 5 mm on the other.
OUTER, BORE, OFF, LENGTH = 10.0, 6.5, 1.5, 14.0
part = trimesh.creation.annulus(r_min=BORE, r_max=OUTER, height=LENGTH, sections=96)
vertices = part.vertices.copy()
vertices[np.linalg.norm(vertices[:, :2], axis=1) < 0.5 * (BORE + OUTER), 0] += OFF
part = trimesh.Trimesh(vertices, part.faces).subdivide().subdivide()
part.ray = RayMeshIntersector(part)

# From a little below each triangle's middle, against its normal.
inwards = -part.face_normals
starts = part.triangles_center + 1e-4 * part.scale * inwards
places, ray, _ = part.ray.intersects_location(starts, inwards, multiple_hits=False)
thickness = np.full(len(part.faces), np.nan)
thickness[ray] = np.linalg.norm(places - starts[ray], axis=1)

assert len(ray) == len(part.faces), "a closed part has a back behind every triangle"
# The ends are as far apart as the part is long.
wall = thickness[np.abs(part.face_normals[:, 2]) < 0.5]
print(f"{len(ray)} rays; the wall is {wall.min():.2f} mm to {wall.max():.2f} mm thick")
assert abs(wall.min() - (OUTER - BORE - OFF)) < 0.05
assert 4.9 < wall.max() < 6

span = (2.0, 5.5)
picture = rt_core.render(
    rt_core.Mesh(part.vertices, part.faces, scalars=thickness, range=span),
    camera=rt_core.Camera((2, -44, 36), (0, 0, -0.6), fov=33),
    size=(700, 560),
    samples=8,
    lights=[(-0.6, -1, 1.6)],
    ambient=0.6,
    ambient_occlusion=(10.0, 8),
)
figure, ax = pyplot.subplots(figsize=(7, 4.8), layout="constrained")
ax.imshow(picture.rgba8)
ax.set_axis_off()
ax.set_title("a bush of 20 mm with its bore off the middle")
scale = cm.ScalarMappable(colors.Normalize(*span), "viridis")
figure.colorbar(scale, ax=ax, label="thickness in mm", extend="max", shrink=0.85)
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "wall_thickness.png", dpi=80)
