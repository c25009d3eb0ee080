"""The same bits from Python as from Rust."""

import os
import subprocess

import numpy as np
import pytest
import rt_core
from shapes import rays, sphere

PROGRAM = os.environ.get("RTSV_RT_CORE_BITS")


@pytest.mark.skipif(
    PROGRAM is None, reason="RTSV_RT_CORE_BITS names no program: see rt-core's example bits"
)
@pytest.mark.parametrize("scale, shift", [(1, 0), (1e-3, 0), (1, 1000), (1e4, 1e6)])
def test_python_has_the_bits_of_rust(scale, shift):
    vertices, triangles = sphere(48)
    vertices = vertices * np.float32(scale) + np.float32(shift)
    origins, directions = rays(30_000)
    origins = origins * np.float32(scale) + np.float32(shift)
    # Far away too, where origins are moved along their rays.
    origins[::7] -= directions[::7] * np.float32(1e3 * scale)
    counts = np.array([len(vertices), len(triangles), len(origins)], dtype=np.uint64)
    given = (counts, vertices, triangles, origins, directions)
    text = b"".join(array.tobytes() for array in given)
    answer = subprocess.run([PROGRAM], input=text, stdout=subprocess.PIPE, check=True).stdout
    words = np.frombuffer(answer, dtype=np.uint32).reshape(-1, 4)
    hits = rt_core.Scene(vertices, triangles).cast(origins, directions)
    assert hits.hit.sum() > 1000
    np.testing.assert_array_equal(words[:, 0], hits.t.view(np.uint32))
    np.testing.assert_array_equal(words[:, 1:3], hits.uv.view(np.uint32))
    np.testing.assert_array_equal(words[:, 3], hits.primitive)
