"""Ctrl-C stops long calls before their end."""

import os

import interrupts
import pytest

PREPARE = """
import numpy as np
import rt_core
from rt_core._rt_core import count_stopped_calls
from shapes import slivers, sphere

# Every ray passes the boxes of all triangles, and no triangle.
scene = rt_core.Scene(*slivers(20_000))
rows = 1_000_000
origins = np.tile(np.float32([0.75, 0.25, -1]), (rows, 1))
directions = np.tile(np.float32([0, 0, 1]), (rows, 1))
out = scene.cast(origins[:0], directions[:0])
# The rays of contains() go another way.
points = np.tile(np.float32([0.3, 0.2, -0.01]), (rows, 1))
large = sphere(500)
"""
OUT = "out = type(out)(*(np.full((rows, *a.shape[1:]), 7, a.dtype) for a in out));"
AFTER = "assert rt_core.Scene(*sphere(8)).occluded([[0, 0, 5]], [[0, 0, -1]])[0]\n"


@pytest.mark.parametrize(
    "call, after",
    [
        # Rows that were not cast have their first value.
        (f"{OUT} scene.cast(origins, directions, out=out)", "assert (out.t == 7).sum() > rows / 2"),
        ("scene.occluded(origins, directions)", ""),
        ("scene.count(origins, directions)", ""),
        ("scene.all_hits(origins, directions)", ""),
        ("scene.contains(points)", ""),
        ("scene.closest_point(origins)", ""),
        ("scene.signed_distance(origins)", ""),
        ("rt_core.Scene(*large)", ""),
        ("rt_core.render(rt_core.Mesh(*sphere(8)), samples=10**6)", ""),
    ],
    ids="cast occluded count all_hits contains closest signed build render".split(),
)
def test_ctrl_c_stops_long_calls(call, after):
    interrupts.check([os.path.dirname(__file__)], PREPARE, call, AFTER + after)
