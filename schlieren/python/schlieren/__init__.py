"""Photographs of a flow: what an optical bench would record of a gas, in physical units.

Light is traced through the index of refraction of the gas, and makes schlieren images,
shadowgraphs, interferograms or BOS images.

Examples
--------
>>> import numpy as np
>>> import schlieren
>>> x, y, z = np.mgrid[-1:1:33j, -1:1:33j, -1:1:33j]
>>> density = 1.2 - 0.05 * np.exp(-8 * (x**2 + y**2 + z**2))
>>> field = schlieren.Field(density=density, spacing=0.003)
>>> image = schlieren.render(field, size=(128, 128), tolerance_rad=1e-5)
>>> image.save("warm.png")
"""

from schlieren._field import Field, series
from schlieren._image import Image, Report
from schlieren._index import Index, index
from schlieren._probe import Probe, probe
from schlieren._render import render, show, stream, sweep
from schlieren._schlieren import count_threads
from schlieren._sheet import Sheet, sheet
from schlieren._techniques import (
    BOS,
    Beams,
    Circle,
    CircleSource,
    ColorWheel,
    ComplementedCircle,
    FilterImage,
    Interferogram,
    Knife,
    Painting,
    Photons,
    PointSource,
    Schlieren,
    Shadowgraph,
    Slice,
    SlitSource,
    Stroke,
    Volume,
)
from schlieren._words import SchlierenWarning

__version__ = "0.1.0"
__all__ = [
    "BOS",
    "Beams",
    "Circle",
    "CircleSource",
    "ColorWheel",
    "ComplementedCircle",
    "Field",
    "FilterImage",
    "Image",
    "Index",
    "Interferogram",
    "Knife",
    "Painting",
    "Photons",
    "PointSource",
    "Probe",
    "Report",
    "Schlieren",
    "SchlierenWarning",
    "Shadowgraph",
    "Sheet",
    "Slice",
    "SlitSource",
    "Stroke",
    "Volume",
    "count_threads",
    "index",
    "probe",
    "render",
    "series",
    "sheet",
    "show",
    "stream",
    "sweep",
]
