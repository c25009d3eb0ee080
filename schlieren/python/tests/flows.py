"""Gases that the tests look at."""

import numpy as np
import schlieren

#: Coarse lattices resolve flows to about this.
TOLERANCE_RAD = 2e-5


def warm(nodes=33, half=(1.0, 1.0, 1.0)):
    """A warm spot, off the middle so that no axis is like another."""
    x, y, z = np.meshgrid(*(np.linspace(-h, h, nodes) for h in half), indexing="ij")
    return 1.2 - 0.05 * np.exp(-8 * ((x - 0.1) ** 2 + (y + 0.2) ** 2 + z**2))


def field(nodes=33, **options):
    return schlieren.Field(density=warm(nodes), spacing=0.1 / (nodes - 1), **options)


def render(of, technique="schlieren", **options):
    options = {"size": (48, 40), "tolerance_rad": TOLERANCE_RAD, "layers": "all"} | options
    return schlieren.render(of, technique, **options)


def same(one, other):
    """Whether two images have the same bits in all layers."""
    assert one.layers == other.layers
    for name in one.layers:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), name)
    return True
