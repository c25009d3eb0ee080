"""The import is light."""

import imports


def test_the_import_loads_numpy_and_little_else():
    assert imports.heavy("rt_core") == []


def test_a_heavy_import_is_found():
    assert "email" in imports.heavy("http.client")
    assert "_pytest" in imports.heavy("pytest")
