"""How thick is a part? Rays inwards from every triangle of a trimesh.

Shows: `rt_core.trimesh` in the place of Embree, and a picture coloured by an answer.
"""

import sys

import numpy as np
import rt_core
import trimesh
from rt_core.trimesh import RayMeshIntersector

part = trimesh.creation.annulus(r_min=0.7, r_max=1.0, height=1.5)
part = part.subdivide().subdivide().subdivide()
part.ray = RayMeshIntersector(part)

# From a little below each triangle's middle, against its normal.
inwards = -part.face_normals
starts = part.triangles_center + 1e-4 * part.scale * inwards
places, ray, _ = part.ray.intersects_location(starts, inwards, multiple_hits=False)
thickness = np.full(len(part.faces), np.nan)
thickness[ray] = np.linalg.norm(places - starts[ray], axis=1)

assert len(ray) == len(part.faces), "a closed part has a back behind every triangle"
print(f"{len(ray)} rays; thinnest {thickness.min():.3f}, thickest {thickness.max():.3f}")
assert 0.28 < thickness.min() < 0.31

picture = rt_core.render(
    rt_core.Mesh(part.vertices, part.faces, scalars=thickness),
    size=(480, 360),
    samples=4,
    ambient=0.4,
)
picture.save(sys.argv[1] if len(sys.argv) > 1 else "wall_thickness.png")
