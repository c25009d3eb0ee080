"""A jet of helium seen from all sides by an interferometer: views shared out to the ranks of MPI.

    mpirun -n 4 python mpi_views.py

Shows: mpi4py beside schlieren, where each rank renders its views with its share of the threads.
The rows of all views are a sinogram, from which tomography computes the jet.
"""

import sys

import numpy as np
import schlieren
from matplotlib import pyplot
from mpi4py import MPI

pyplot.switch_backend("Agg")
comm = MPI.COMM_WORLD

# Every rank makes the same field; a file would be read by each, or broadcast.
s = np.linspace(-20, 20, 65)
x, y, z = np.meshgrid(s, s, s, indexing="ij")
# The jet rises along z, leans and widens, and is not round: two streams of unequal strength.
width = 2.2 + 0.05 * (z + 20)
lean = 0.1 * (z + 20)
strong = np.exp(-(((x - 6 - lean) / width) ** 2) - (y / width) ** 2)
weak = np.exp(-(((x + 6) / width) ** 2) - ((y - 5) / width) ** 2)
mass = 0.03 * strong + 0.015 * weak
air, helium = 1.204, 0.166
density = 1 / (mass / helium + (1 - mass) / air)
field = schlieren.Field(
    density=density,
    species={"He": mass, "air": 1 - mass},
    spacing=s[1] - s[0],
    length_unit="mm",
    origin=(-20,) * 3,
)

angles_deg = np.arange(0, 180, 7.5)
mine = range(comm.rank, len(angles_deg), comm.size)
view = {
    "technique": "interferogram",
    "size": (160, 120),
    "field_of_view_m": 0.05,
    "layers": "phase",
    "tolerance_rad": 1e-4,
}


def rendered(number, **options):
    """The image from one side."""
    return schlieren.render(field, view=(float(angles_deg[number]), 0.0), **view, **options)


threads = max(1, schlieren.count_threads() // comm.size)
rows = {number: rendered(number, threads=threads).phase_waves[60] for number in mine}
gathered = comm.gather(rows, root=0)
if comm.rank == 0:
    found = {number: row for part in gathered for number, row in part.items()}
    sinogram = np.stack([found[number] for number in range(len(angles_deg))])
    # Which rank rendered a view makes no difference.
    first = rendered(0)
    last = rendered(len(angles_deg) - 1).phase_waves[60]
    np.testing.assert_array_equal(last, sinogram[-1])
    # From every side the same gas is looked through: the sum of a row changes little.
    sums = sinogram.sum(axis=1)
    print(
        f"{comm.size} ranks, {len(angles_deg)} views; deepest {sinogram.min():.2f} waves, "
        f"sums of rows within {100 * np.ptp(sums) / abs(sums.mean()):.2f} %"
    )
    assert np.ptp(sums) < 0.05 * abs(sums.mean())

    figure, (one, all_views) = pyplot.subplots(
        1, 2, figsize=(10, 4), layout="constrained", width_ratios=(1, 1.15)
    )
    first.plot(ax=one)
    one.set_title("interferogram at 0 degrees")
    one.axhline(0, color="tab:red", linewidth=1)
    left, right = 1e3 * first.extent_m[0], 1e3 * first.extent_m[1]
    shown = all_views.imshow(
        sinogram, aspect="auto", extent=(left, right, 180, 0), cmap="inferno_r"
    )
    all_views.set(xlabel="mm", ylabel="angle of the view in degrees", title="sinogram of that row")
    figure.colorbar(shown, ax=all_views, label="phase in waves")
    figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "mpi_views.png", dpi=80)
