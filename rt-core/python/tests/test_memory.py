"""A hundred thousand calls leave no memory behind."""

import contextlib
import pickle

import leaks
import numpy as np
import pytest
import rt_core
from shapes import rays, sphere

VERTICES, TRIANGLES = sphere(6)
SCENE = rt_core.Scene(VERTICES, TRIANGLES)
RAYS = rays(4)
OUT = SCENE.cast(*RAYS)
BALL = rt_core.Spheres([[0, 0, 0]], 1.0)
FEW = {"size": (4, 4), "threads": 1}


def refused(call, *args, **options):
    with contextlib.suppress(ValueError, TypeError, IndexError):
        call(*args, **options)
        raise AssertionError("it was not refused")


CALLS = {
    "cast": (20_000, lambda: SCENE.cast(*RAYS)),
    "cast_out": (10_000, lambda: SCENE.cast(*RAYS, out=OUT)),
    "occluded": (20_000, lambda: SCENE.occluded(*RAYS)),
    "count": (5000, lambda: SCENE.count(*RAYS)),
    "all_hits": (20_000, lambda: SCENE.all_hits(*RAYS)),
    "contains": (5000, lambda: SCENE.contains(RAYS[0])),
    "closest_point": (5000, lambda: SCENE.closest_point(RAYS[0])),
    "signed_distance": (5000, lambda: SCENE.signed_distance(RAYS[0])),
    "build_and_drop": (1500, lambda: rt_core.Scene(VERTICES, TRIANGLES, threads=1)),
    "pickle": (1000, lambda: pickle.loads(pickle.dumps(SCENE))),
    "render": (500, lambda: rt_core.render(BALL, **FEW)),
    # By a check of Python's files, by the native module, in the middle of the rays, by the build.
    "refused_shapes": (5000, lambda: refused(SCENE.cast, RAYS[0], RAYS[1][:2])),
    "refused_rays": (5000, lambda: refused(SCENE.cast, RAYS[0], RAYS[1] * 0)),
    "refused_hits": (5000, lambda: refused(SCENE.all_hits, *RAYS, max_hits=1)),
    "refused_quality": (1000, lambda: refused(rt_core.Scene, VERTICES, TRIANGLES, quality="?")),
    "refused_meshes": (1000, lambda: refused(rt_core.Scene, VERTICES, TRIANGLES + 999)),
    "refused_objects": (500, lambda: refused(rt_core.render, BALL, rt_core.Volume(3, 4), **FEW)),
}


@pytest.mark.parametrize("name", CALLS)
def test_calls_leave_no_memory_behind(name):
    count, call = CALLS[name]
    leaks.check(call, count)


def test_they_are_a_hundred_thousand():
    assert sum(count for count, _ in CALLS.values()) >= 100_000


def test_a_leak_is_found():
    """Of Python's memory, and of memory that it does not know of."""
    kept = []
    with pytest.raises(AssertionError, match="of Python"):
        leaks.check(lambda: kept.append(bytes(100)), 5000)
    with pytest.raises(AssertionError, match="of the C library"):
        # Lists of hits come from the native module.
        leaks.check(lambda: kept.append(SCENE.all_hits(*RAYS).uv), 5000)
    assert len(kept) > 10_000 and isinstance(kept[-1], np.ndarray)
