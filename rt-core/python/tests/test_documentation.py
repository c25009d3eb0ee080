"""The examples in the documentation hold."""

import doctest
import importlib
import pkgutil

import pytest
import rt_core


def modules():
    names = [m.name for m in pkgutil.walk_packages(rt_core.__path__, "rt_core.")]
    return ["rt_core", *names]


@pytest.mark.parametrize("name", modules())
def test_examples(name):
    try:
        module = importlib.import_module(name)
    except ModuleNotFoundError as error:
        pytest.skip(f"{name} needs {error.name}")
    assert doctest.testmod(module).failed == 0
