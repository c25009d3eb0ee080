"""Schlieren of a PLOT3D file: a wedge of 15 degrees at Mach 2.5, on the curved grid of a solver.

Shows: `Field.open` with densities that are relative to the free stream, and a colour filter.
"""

import sys

import numpy as np
import schlieren

MACH, GAMMA = 2.5, 1.4
HALF_ANGLE = np.radians(15)

# The shock's angle, from the relation of angles behind an oblique shock (weak branch).
angles = np.radians(np.linspace(24, 60, 200_000))
normal = (MACH * np.sin(angles)) ** 2
turned = 2 / np.tan(angles) * (normal - 1) / (MACH**2 * (GAMMA + np.cos(2 * angles)) + 2)
shock = angles[np.argmax(np.arctan(turned) > HALF_ANGLE)]
jump = (GAMMA + 1) * (MACH * np.sin(shock)) ** 2
jump /= (GAMMA - 1) * (MACH * np.sin(shock)) ** 2 + 2

# A grid along the wedge, as a solver has it: 10 cm long, 6 cm high, and 4 cm deep.
ni, nj, nk = 121, 97, 3
i, j, k = np.meshgrid(
    np.linspace(0, 1, ni), np.linspace(0, 1, nj), np.linspace(0, 1, nk), indexing="ij"
)
x = 0.1 * i - 0.02
floor = np.maximum(x, 0) * np.tan(HALF_ANGLE)
y = floor + (0.06 - floor) * j
z = 0.04 * k

# The solver spreads the shock over some cells.
behind = y - x * np.tan(shock)
density = 1 + (jump - 1) * 0.5 * (1 - np.tanh(behind / 1e-3))

# PLOT3D: the numbers of nodes, then x, y, z of all; and density, momentum, energy in a file beside.
shape = np.array([ni, nj, nk], dtype="<i4")
flat = [np.asarray(a, dtype="<f4").ravel(order="F") for a in (x, y, z)]
with open("wedge.xyz", "wb") as file:
    file.write(shape.tobytes() + np.concatenate(flat).tobytes())
conserved = [density, density * MACH, 0 * density, 0 * density, density]
with open("wedge.q", "wb") as file:
    file.write(shape.tobytes() + np.array([MACH, 0, 1e6, 0], dtype="<f4").tobytes())
    for values in conserved:
        file.write(np.asarray(values, dtype="<f4").ravel(order="F").tobytes())

# From here on a file of yours would do. Its free stream has 0.5 kg/m3.
field = schlieren.Field.open(
    "wedge.q",
    density="Density",
    density_unit=0.5,
    resample_nodes=160,
    outside="solid",
    reconstruction="linear",
)
image = schlieren.render(
    field, cutoff=schlieren.ColorWheel(radius_m=2e-3), size=(500, 300), tolerance_rad=2e-4
)
largest = image.report.largest_deflection_rad
print(
    f"shock at {np.degrees(shock):.1f} degrees, density x {jump:.2f}; "
    f"deflections up to {1e3 * largest:.2f} mrad, to {image.report.deflection_error_rad:.1e} rad"
)

# Where light is bent most, column by column, lies the shock.
strength = np.hypot(image.deflection_rad[..., 0], image.deflection_rad[..., 1])
left, right, bottom, top = image.extent_m
columns = np.arange(235, 435, 20)
rows = strength[:, columns].argmax(axis=0)
up = top - (rows + 0.5) * image.pixel_m
along = left + (columns + 0.5) * image.pixel_m
found = np.degrees(np.arctan(np.polyfit(along, up, 1)[0]))
print(f"in the image the shock is at {found:.1f} degrees")
assert abs(found - np.degrees(shock)) < 1
image.save(sys.argv[1] if len(sys.argv) > 1 else "plot3d_wedge.png")
