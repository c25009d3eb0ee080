"""The import is light."""

import imports


def test_the_import_loads_numpy_and_little_else():
    assert imports.heavy("schlieren") == []
