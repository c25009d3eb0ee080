"""BOS of the warm air above a rod, on a mesh as OpenFOAM's foamToVTK writes it.

Shows: an unstructured grid of PyVista with temperature and pressure, and how far the dots of the
background seem to move, which is what a correlation of two photographs finds.
"""

import sys

import numpy as np
import pyvista
import schlieren
from matplotlib import pyplot

pyplot.switch_backend("Agg")

# Cells of a room of air, 20 x 30 x 20 cm, finer above the rod, which lies along z.
s = np.linspace(-1, 1, 41)
x = 0.1 * (0.6 * s + 0.4 * s**3)
y = np.linspace(0, 0.3, 61)
z = np.linspace(-0.1, 0.1, 21)
mesh = pyvista.RectilinearGrid(x, y, z).cast_to_unstructured_grid()

# The plume: it widens and cools on its way up, and ends where the rod does.
at = mesh.cell_centers().points
height = np.maximum(at[:, 1] - 0.03, 0)
width = 0.008 + 0.06 * height
middle = 0.006 * np.sin(25 * height)
across = np.exp(-(((at[:, 0] - middle) / width) ** 2))
along = 1 / (1 + np.exp((np.abs(at[:, 2]) - 0.06) / 0.006))
started = 1 / (1 + np.exp(-(at[:, 1] - 0.04) / 0.004))
mesh.cell_data["T"] = 293.15 + 45 * across * along * started * 0.008 / width
mesh.cell_data["p"] = np.full(mesh.n_cells, 101325.0)

field = schlieren.Field.from_vtk(
    mesh, temperature="T", pressure="p", resample_nodes=90, reconstruction="linear"
)
# The camera looks along z; the background stands 1 m behind the room's middle.
image = schlieren.render(
    field, schlieren.BOS(), view="z", size=(300, 450), focus_m=1.0, tolerance_rad=1e-5
)
moved = image.apparent_displacement_m
pixels = np.hypot(moved[..., 0], moved[..., 1]) / image.pixel_m
print(
    f"{mesh.n_cells} cells; dots move by up to {np.nanmax(pixels):.2f} pixels, "
    f"{1e6 * image.report.largest_deflection_rad:.0f} microradians"
)
assert 0.05 < np.nanmax(pixels) < 20

# The plume is warm, so light bends away from it: dots left and right of it move opposite ways.
row = moved[150, :, 0]
assert np.nanmin(row) < -0.3 * np.nanmax(np.abs(row)) and np.nanmax(row) > 0

figure, axes = pyplot.subplots(1, 3, figsize=(10, 5), layout="constrained")
image.plot(ax=axes[0])
axes[0].set_title("the background through the air")
for ax, component in zip(axes[1:], ("right", "up")):
    image.plot("apparent_displacement_m", component=component, ax=ax)
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "heated_rod_bos.png", dpi=80)
