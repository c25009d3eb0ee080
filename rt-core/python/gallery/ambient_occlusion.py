"""A PyVista mesh with ambient occlusion, which brings out its hollows.

Shows: meshes of PyVista in `rt_core.render`, and their cells met by rays.
"""

import sys

import numpy as np
import pyvista
import rt_core
import rt_core.pyvista

ground = pyvista.ParametricRandomHills(u_res=120, v_res=120, w_res=120).triangulate()
ground = ground.compute_normals(cell_normals=False)
heights = ground.points[:, 2]
objects = rt_core.Mesh(
    ground.points, ground.regular_faces, normals=ground["Normals"], scalars=heights
)
size = float(ground.length)
view = {"size": (480, 360), "samples": 4, "ambient": 0.5}
plain = rt_core.render(objects, **view)
shaded = rt_core.render(objects, ambient_occlusion=(0.1 * size, 8), **view)

seen = plain.object == 0
darker = shaded.color[seen][:, :3].mean() / plain.color[seen][:, :3].mean()
print(f"{ground.n_cells} triangles; hollows take {100 * (1 - darker):.0f} % of the light")
assert 0.3 < darker < 1

# The highest point, looked at from above.
top = np.asarray(ground.points[heights.argmax()], dtype=float)
points, _, cells = rt_core.pyvista.multi_ray_trace(
    ground, [top + [0, 0, size]], [[0, 0, -1]], first_point=True
)
assert abs(points[0, 2] - top[2]) < 1e-4 * size and len(cells) == 1
shaded.save(sys.argv[1] if len(sys.argv) > 1 else "ambient_occlusion.png")
