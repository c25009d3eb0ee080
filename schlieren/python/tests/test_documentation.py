"""The examples in the documentation hold."""

import doctest
import importlib
import pkgutil

import pytest
import schlieren


def modules():
    names = [m.name for m in pkgutil.walk_packages(schlieren.__path__, "schlieren.")]
    return ["schlieren", *names]


@pytest.mark.parametrize("name", modules())
def test_examples(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert doctest.testmod(importlib.import_module(name)).failed == 0


def test_public_things_are_described():
    bare = [n for n in schlieren.__all__ if not getattr(schlieren, n).__doc__]
    assert not bare
