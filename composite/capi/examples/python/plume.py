"""A warm plume in air: the equation of heat with a wind, on bricks of the ranks of MPI.

Each tenth step the ranks make two pictures while they compute: a volume of the temperature, and a
schlieren photograph whose light is bent across the bricks of all ranks.

mpirun -n 8 python plume.py OUT [CELLS [STEPS [PIXELS]]]; rank 0 writes OUT-STEP.volume (RGBA) and
OUT-STEP.schlieren (grey), raw floats. The files have the same bytes for any number of ranks.
PLUME_STALL=RANK shows what becomes of the others.
"""

import os
import signal
import sys
from ctypes import POINTER, byref, c_float, c_void_p, sizeof

import numpy as np
import rtsv_composite as rc
from mpi4py import MPI

GHOSTS = 2  # The picture needs one layer above a brick, and light one more on each side.
SIDE_M, PRESSURE, R_AIR = 0.2, 101325.0, 287.0


class Plume:
    """Temperatures on this rank's brick, in arrays [z, y, x] with layers of neighbours."""

    def __init__(self, cells):
        self.cells, self.h = cells, SIDE_M / cells
        dims = MPI.Compute_dims(MPI.COMM_WORLD.size, 3)
        self.cart = MPI.COMM_WORLD.Create_cart(dims)
        at = self.cart.Get_coords(self.cart.rank)
        ends = [[cells * (a + side) // n for side in (0, 1)] for a, n in zip(at, dims)]
        self.first = [low for low, _ in ends]
        self.own = [high - low for low, high in ends]
        if min(self.own) < GHOSTS:
            sys.exit("more ranks than bricks of two cells a side")
        centres = [(np.arange(n + 2 * GHOSTS) - GHOSTS + f + 0.5) / cells
                   for n, f in zip(self.own, self.first)]
        z, y, x = np.meshgrid(*centres, indexing="ij")
        distance = (x - 0.45) ** 2 + (y - 0.5) ** 2 + (z - 0.2) ** 2
        self.source = 60.0 * (distance < 0.08 ** 2)
        self.kelvin = 293.0 + self.source
        self.density = PRESSURE / (R_AIR * self.kelvin)

    def exchange(self, values):
        """Layers of neighbours, axis after axis; at the walls of the box the nearest cell again."""
        for axis, own in enumerate(self.own):
            below, above = self.cart.Shift(axis, 1)
            layers = np.moveaxis(values, axis, 0)
            for start, to, into, source in [(GHOSTS, below, GHOSTS + own, above),
                                            (own, above, 0, below)]:
                came = np.repeat(layers[-GHOSTS - 1 if into else GHOSTS][None], GHOSTS, axis=0)
                sent = np.ascontiguousarray(layers[start:start + GHOSTS])
                self.cart.Sendrecv(sent, to, axis, came, source, axis)
                layers[into:into + GHOSTS] = came

    def step(self):
        self.exchange(self.kelvin)
        t, inner = self.kelvin, slice(GHOSTS, -GHOSTS)
        middle = t[inner, inner, inner]
        around = sum(np.roll(t, s, a)[inner, inner, inner] for a in range(3) for s in (-1, 1))
        upwind = middle - np.roll(t, 1, 0)[inner, inner, inner]
        warmer = middle + 0.1 * (around - 6.0 * middle) - 0.3 * upwind
        t[inner, inner, inner] = np.maximum(warmer, 293.0 + self.source[inner, inner, inner])

    def update_density(self):
        self.exchange(self.kelvin)
        np.divide(PRESSURE / R_AIR, self.kelvin, out=self.density)

    def brick(self, values, below, above):
        """A description of a solver's array, with so many layers of neighbours, where there are any."""
        low = [max(f - below, 0) for f in self.first]
        high = [min(f + n + above, self.cells) for f, n in zip(self.first, self.own)]
        part = values[tuple(slice(a - f + GHOSTS, b - f + GHOSTS)
                            for a, b, f in zip(low, high, self.first))]
        array = rc.Array(data=part.ctypes.data, count=part.size, components=1, kind=rc.F64,
                         stride_bytes=part.strides[2])
        brick = rc.Brick(values=array, row_bytes=part.strides[1], slice_bytes=part.strides[0])
        brick.first[:], brick.dims[:] = low[::-1], part.shape[::-1]
        return brick


def table(rows):
    values = np.array(rows, np.float32)
    return values, rc.Array(data=values.ctypes.data, count=values.shape[0],
                            components=values.shape[1], kind=rc.F32)


class Cameras:
    """The two pictures of a step."""

    def __init__(self, plume, pixels):
        self.plume, self.copies = plume, 0
        self.group, self.renderer = c_void_p(), c_void_p()
        rc.comm_from_mpi(MPI._addressof(plume.cart), MPI._sizeof(MPI.Comm), byref(self.group))
        self.gas = rc.Gas(gladstone_dale=2.26e-4, reference_density=PRESSURE / (R_AIR * 293.0))
        self.volume = rc.Volume(name=b"temperature", unit_distance=0.02)
        for grid, origin, spacing in [(self.gas, self.gas.origin_m, self.gas.spacing_m),
                                      (self.volume, self.volume.origin, self.volume.spacing)]:
            grid.dims[:] = [plume.cells] * 3
            origin[:], spacing[:] = [0.5 * plume.h] * 3, [plume.h] * 3
        self.kept = [table([[0.2, 0.1, 0.6], [1.0, 0.5, 0.1], [1.0, 1.0, 0.8]]),
                     table([[295.0, 0.0], [353.0, 0.8]])]
        self.volume.colors, self.volume.opacities = (array for _, array in self.kept)
        self.volume.range[:] = [293.0, 353.0]
        self.options, self.view, self.shot = rc.RenderOptions(), rc.View(), rc.Shot()
        rc.render_options_init(byref(self.options), sizeof(self.options))
        rc.view_init(byref(self.view), sizeof(self.view))
        rc.shot_init(byref(self.shot), sizeof(self.shot))
        self.options.timeout_secs = self.shot.timeout_secs = 10.0
        self.view.width = self.view.height = self.shot.width = self.shot.height = pixels
        self.view.eye[:], self.view.target[:] = [0.42, -0.25, 0.2], [0.1, 0.1, 0.1]
        self.view.up[:] = self.shot.up[:] = [0.0, 0.0, 1.0]
        self.shot.direction[:], self.shot.angle_deg = [0.7, 1.0, 0.2], 90.0
        self.grey = np.empty((pixels, pixels), np.float32)

    def photograph(self, path):
        brick = self.plume.brick(self.plume.density, 1, 2)
        photo = rc.Photograph(grey=self.grey.ctypes.data_as(POINTER(c_float)),
                              grey_count=self.grey.size)
        rc.photograph(self.group, byref(self.gas), byref(brick), byref(self.shot), byref(photo))
        self.copies += photo.copies
        if self.plume.cart.rank == 0:
            self.grey.tofile(path)

    def render(self, path):
        scene, picture = c_void_p(), rc.Picture()
        rc.scene_new(byref(scene))
        rc.scene_volume(scene, byref(self.volume), None)
        rc.scene_brick(scene, byref(self.plume.brick(self.plume.kelvin, 0, 1)))
        if self.renderer:
            rc.renderer_replace(self.renderer, scene)
        else:
            rc.renderer_new(self.group, scene, byref(self.options), byref(self.renderer))
        rc.scene_free(scene)
        rc.renderer_render(self.renderer, byref(self.view), byref(picture))
        if picture.color:
            shape = (picture.height, picture.width, 4)
            np.ctypeslib.as_array(picture.color, shape).tofile(path)

    def free(self):
        rc.renderer_free(self.renderer)
        rc.comm_free(self.group)


def main():
    out = sys.argv[1]
    cells, steps, pixels = (list(map(int, sys.argv[2:])) + [48, 40, 256][len(sys.argv) - 2:])[:3]
    plume = Plume(cells)
    cameras = Cameras(plume, pixels)
    spent = [0.0] * 3
    for step in range(1, steps + 1):
        times = [MPI.Wtime()]
        plume.step()
        times.append(MPI.Wtime())
        if step % 10 == 0:
            plume.update_density()
            if os.environ.get("PLUME_STALL") == str(plume.cart.rank):
                signal.pause()
            times = [*times, MPI.Wtime()]
            times[1] = times[2]
            try:
                cameras.photograph(f"{out}-{step}.schlieren")
                times[2] = MPI.Wtime()
                cameras.render(f"{out}-{step}.volume")
            except rc.Error as error:
                print(error, file=sys.stderr, flush=True)
                MPI.COMM_WORLD.Abort(1)
            times.append(MPI.Wtime())
        for k, (begin, end) in enumerate(zip(times, times[1:])):
            spent[k] += end - begin
    cameras.free()
    if plume.cart.rank == 0:
        print("solver {:.3f} s, photographs {:.3f} s, pictures {:.3f} s, {} copies of densities"
              .format(*spent, cameras.copies))


main()
