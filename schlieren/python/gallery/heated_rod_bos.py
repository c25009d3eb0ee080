"""BOS of the warm air above a rod, of a case of OpenFOAM.

Shows: `Field.open` with the folder of a case, fields on cells, and how far the dots of the
background seem to move, which is what a correlation of two photographs finds.
"""

import sys
from pathlib import Path

import numpy as np
import schlieren
from matplotlib import pyplot

pyplot.switch_backend("Agg")

# A room of air, 20 x 30 x 20 cm, its cells finer above the rod, which lies along z.
s = np.linspace(-1, 1, 41)
x = 0.1 * (0.6 * s + 0.4 * s**3)
y = np.linspace(0, 0.3, 61)
z = np.linspace(-0.1, 0.1, 21)
nx, ny, nz = len(x) - 1, len(y) - 1, len(z) - 1


# -- What a solver of OpenFOAM would have written; skip this part if you have a case. --------------
def write(path, kind, text):
    """A file of OpenFOAM."""
    path.parent.mkdir(parents=True, exist_ok=True)
    head = f"FoamFile {{ version 2.0; format ascii; class {kind}; object {path.name}; }}\n"
    path.write_text(head + text)


def listed(rows):
    return f"{len(rows)}\n(\n" + "\n".join(rows) + "\n)\n"


def point(i, j, k):
    return i + (nx + 1) * (j + (ny + 1) * k)


def sides(axis, plane, i, j, k):
    """Faces of cells across an axis, seen from below it; `plane` 1 for the upper one."""
    at = [i, j, k]
    at[axis] = at[axis] + plane
    first, second = (axis + 1) % 3, (axis + 2) % 3
    corners = []
    for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
        corner = list(at)
        corner[first], corner[second] = corner[first] + a, corner[second] + b
        corners.append(point(*corner))
    return np.stack(corners, axis=-1)


i, j, k = (a.ravel(order="F") for a in np.indices((nx, ny, nz)))
cell = i + nx * (j + ny * k)
inner, walls = [], []
for axis, (at, count, stride) in enumerate(((i, nx, 1), (j, ny, nx), (k, nz, nx * ny))):
    within, low, high = at < count - 1, at == 0, at == count - 1
    inner.append((sides(axis, 1, i, j, k)[within], cell[within], cell[within] + stride))
    walls.append((sides(axis, 1, i, j, k)[high], cell[high]))
    # Outwards, so the other way round.
    walls.append((sides(axis, 0, i, j, k)[low][:, ::-1], cell[low]))
faces, owner, neighbour = (np.concatenate(part) for part in zip(*inner))
order = np.lexsort((neighbour, owner))
faces, owner, neighbour = faces[order], owner[order], neighbour[order]
outer, of_cell = (np.concatenate(part) for part in zip(*walls))

case, mesh = Path("rod"), Path("rod/constant/polyMesh")
grid = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
points = grid.transpose(2, 1, 0, 3).reshape(-1, 3)
write(mesh / "points", "vectorField", listed([f"({a:.9g} {b:.9g} {c:.9g})" for a, b, c in points]))
write(
    mesh / "faces",
    "faceList",
    listed([f"4({a} {b} {c} {d})" for a, b, c, d in np.concatenate([faces, outer]).tolist()]),
)
write(mesh / "owner", "labelList", listed([str(c) for c in np.concatenate([owner, of_cell])]))
write(mesh / "neighbour", "labelList", listed([str(c) for c in neighbour]))
patch = f"type wall; nFaces {len(outer)}; startFace {len(faces)};"
write(mesh / "boundary", "polyBoundaryMesh", f"1 ( walls {{ {patch} }} )\n")
write(case / "system" / "controlDict", "dictionary", "application buoyantPimpleFoam;\n")

# The plume: it widens and cools on its way up, and ends where the rod does.
middles = [(a[1:] + a[:-1]) / 2 for a in (x, y, z)]
right, up, along = (middles[a][index] for a, index in enumerate((i, j, k)))
height = np.maximum(up - 0.03, 0)
width = 0.008 + 0.06 * height
across = np.exp(-(((right - 0.006 * np.sin(25 * height)) / width) ** 2))
over_rod = 1 / (1 + np.exp((np.abs(along) - 0.06) / 0.006))
started = 1 / (1 + np.exp(-(up - 0.04) / 0.004))
temperature = 293.15 + 45 * across * over_rod * started * 0.008 / width
for name, values, dimensions in (
    ("T", temperature, "[0 0 0 1 0 0 0]"),
    ("p", np.full(len(cell), 101325.0), "[1 -1 -2 0 0 0 0]"),
):
    numbers = listed([f"{v:.8g}" for v in values])
    text = f"dimensions {dimensions};\ninternalField nonuniform List<scalar> {numbers};\n"
    text += "boundaryField { walls { type zeroGradient; } }\n"
    write(case / "2" / name, "volScalarField", text)

# -- From here on a case of yours would do. --------------------------------------------------------
field = schlieren.Field.open(
    case, temperature="T", pressure="p", resample_nodes=90, reconstruction="linear"
)
# The camera looks along z; the background stands 1 m behind the room's middle.
image = schlieren.render(
    field, schlieren.BOS(), view="z", size=(300, 450), focus_m=1.0, tolerance_rad=1e-5
)
moved = image.apparent_displacement_m
pixels = np.hypot(moved[..., 0], moved[..., 1]) / image.pixel_m
print(
    f"{len(cell)} cells; dots move by up to {np.nanmax(pixels):.2f} pixels, "
    f"{1e6 * image.report.largest_deflection_rad:.0f} microradians"
)
assert 0.05 < np.nanmax(pixels) < 20

# The plume is warm, so light bends away from it: dots left and right of it move opposite ways.
row = moved[150, :, 0]
assert np.nanmin(row) < -0.3 * np.nanmax(np.abs(row)) and np.nanmax(row) > 0

figure, axes = pyplot.subplots(1, 3, figsize=(10.5, 5), layout="constrained")
image.plot(ax=axes[0])
axes[0].set_title("the background")
for ax, name, component in zip(axes[1:], ("to the right", "up"), (0, 1)):
    um = 1e6 * moved[..., component]
    most = np.nanmax(np.abs(um))
    extent = [1e3 * e for e in image.extent_m]
    shown = ax.imshow(um, cmap="RdBu", vmin=-most, vmax=most, extent=extent)
    ax.set(title=f"dots move {name}", xlabel="mm", ylabel="mm")
    figure.colorbar(shown, ax=ax, label="displacement in µm", shrink=0.85)
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "heated_rod_bos.png", dpi=80)
