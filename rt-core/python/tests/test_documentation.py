"""The examples in the documentation hold."""

import doctest
import importlib
import pkgutil

import pytest
import rt_core


def modules():
    names = [m.name for m in pkgutil.walk_packages(rt_core.__path__, "rt_core.")]
    return ["rt_core", *names]


#: Modules whose examples need other packages.
ADAPTED = {"rt_core.pyvista": "pyvista", "rt_core.trimesh": "trimesh"}


@pytest.mark.parametrize("name", modules())
def test_examples(name):
    if name in ADAPTED:
        pytest.importorskip(ADAPTED[name])
    assert doctest.testmod(importlib.import_module(name)).failed == 0
