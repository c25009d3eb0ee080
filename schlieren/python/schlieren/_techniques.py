"""What makes an image of light: techniques, cut-offs, sources, and how the film is exposed."""

# The checks read the annotations as text.
from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass, field
from typing import ClassVar

from schlieren import _arrays


class _Part:
    """A part of a scene; its fields are the keys of a scene file."""

    _kind = ""
    _tag = "kind"
    #: Fields that are whole numbers.
    _whole: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self):
        for f in dataclasses.fields(self):
            value = getattr(self, f.name)
            name = f"{type(self).__name__}.{f.name}"
            if value is None and f.default is None:
                continue
            if f.name in self._whole:
                _arrays.whole(name, value, most=2**64 - 1)
            elif isinstance(f.default, (int, float)) or f.type.startswith("float"):
                _arrays.number(name, value)
            elif f.type.startswith("tuple[float"):
                _arrays.several(name, value, f.type.count("float"))

    def _spec(self):
        spec = {self._tag: self._kind} if self._kind else {}
        for f in dataclasses.fields(self):
            value = getattr(self, f.name)
            if value is None:
                continue
            if isinstance(value, _Part):
                value = value._spec()
            elif isinstance(value, os.PathLike):
                value = os.fspath(value)
            elif f.name in self._whole:
                value = int(value)
            elif isinstance(value, (tuple, list)):
                value = [v._spec() if isinstance(v, _Part) else float(v) for v in value]
            elif not isinstance(value, str):
                value = float(value)
            spec[f.name] = value
        return spec


# ---- Cut-offs ----


@dataclass(frozen=True)
class Knife(_Part):
    """A knife edge in the cut-off plane.

    Parameters
    ----------
    angle_deg : float
        Direction from the blade to the opening, counter-clockwise from the image's right:
        deflections that way brighten.
    open : float
        Fraction of the source's image that the knife leaves open.
    open_m : float, optional
        Height that it leaves open, instead of `open`.
    """

    angle_deg: float = 0.0
    open: float = 0.5
    open_m: float | None = None
    _kind = "knife"


@dataclass(frozen=True)
class Circle(_Part):
    """An iris of a radius in the cut-off plane."""

    radius_m: float = 0.5e-3
    center_m: tuple[float, float] = (0.0, 0.0)
    _kind = "circle"


@dataclass(frozen=True)
class ComplementedCircle(_Part):
    """An opaque spot of a radius in the cut-off plane."""

    radius_m: float = 0.5e-3
    center_m: tuple[float, float] = (0.0, 0.0)
    _kind = "complemented-circle"


@dataclass(frozen=True)
class ColorWheel(_Part):
    """A colour wheel; colours are saturated at `radius_m`, and `red_deg` is the side of red."""

    radius_m: float = 0.5e-3
    red_deg: float = 0.0
    _kind = "color"


@dataclass(frozen=True)
class FilterImage(_Part):
    """A PNG file as filter, `width_m` wide in the cut-off plane."""

    file: str | os.PathLike
    width_m: float = 1e-3
    _kind = "image"


@dataclass(frozen=True)
class Stroke(_Part):
    """A stroke of a round brush on a `Painting`, in metres of the cut-off plane."""

    from_m: tuple[float, float]
    to_m: tuple[float, float]
    radius_m: float
    rgb: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Painting(_Part):
    """A filter painted by hand: a ground colour, and strokes that cover it.

    Parameters
    ----------
    size_m : (float, float)
        Sides in the cut-off plane.
    ground_rgb : (float, float, float)
        Linear transmission where nothing is painted, 0 to 1.
    strokes : sequence of Stroke
    pixels : int
        Along the longer side.
    """

    size_m: tuple[float, float]
    ground_rgb: tuple[float, float, float] = (0.0, 0.0, 0.0)
    strokes: tuple = ()
    pixels: int = 512
    _kind = "painted"
    _whole = ("pixels",)


# ---- Techniques ----


@dataclass(frozen=True)
class Schlieren(_Part):
    """Light that was deflected passes a cut-off, or does not.

    Parameters
    ----------
    cutoff : Knife, Circle, ComplementedCircle, ColorWheel, FilterImage or Painting
    """

    cutoff: object = field(default_factory=Knife)
    _kind = "schlieren"

    def __post_init__(self):
        if not isinstance(self.cutoff, CUTOFFS):
            raise TypeError(
                f"Schlieren.cutoff is {self.cutoff!r}; give a cut-off, such as schlieren.Knife()"
            )


@dataclass(frozen=True)
class Shadowgraph(_Part):
    """Light that is spread or gathered on a film at `focus_m`."""

    _kind = "shadowgraph"


@dataclass(frozen=True)
class Interferogram(_Part):
    """Fringes of the optical path.

    Parameters
    ----------
    visibility : float
        Contrast of the fringes, 0 to 1.
    fringe_spacing_m : float, optional
        Distance of the fringes without flow; infinite fringe by default.
    fringe_angle_deg : float, optional
        Direction across them.
    """

    visibility: float = 1.0
    fringe_spacing_m: float | None = None
    fringe_angle_deg: float | None = None
    _kind = "interferogram"


@dataclass(frozen=True)
class BOS(_Part):
    """Background-oriented schlieren: a pattern of dots behind the flow.

    Parameters
    ----------
    dot_diameter_m : float, optional
        Three pixels by default.
    dot_spacing_m : float, optional
        Twice the diameter by default.
    seed : int
        Another seed gives another pattern.
    """

    dot_diameter_m: float | None = None
    dot_spacing_m: float | None = None
    seed: int = 0
    _kind = "bos"
    _whole = ("seed",)


@dataclass(frozen=True)
class Volume(_Part):
    """Volume rendering of the gradient, for comparison; it traces no light."""

    strength: float = 10.0
    _kind = "volume"


@dataclass(frozen=True)
class Slice(_Part):
    """The gradient on a slice, for comparison; it traces no light."""

    strength: float = 10.0
    depth_m: float = 0.0
    _kind = "slice"


# ---- Sources ----


@dataclass(frozen=True)
class PointSource(_Part):
    """A source without extent."""

    _kind = "point"


@dataclass(frozen=True)
class SlitSource(_Part):
    """A rectangle, `width_m` along `angle_deg` (that of the knife by default)."""

    width_m: float = 1e-3
    length_m: float = 5e-3
    angle_deg: float | None = None
    _kind = "slit"


@dataclass(frozen=True)
class CircleSource(_Part):
    """A disc."""

    diameter_m: float = 0.5e-3
    _kind = "circle"


# ---- Sampling ----


@dataclass(frozen=True)
class Photons(_Part):
    """The film is exposed by photons.

    Parameters
    ----------
    samples : int
        Photons per pixel.
    jitter : str
        ``"sobol"`` or ``"random"``.
    seed : int
    filter : str
        Against noise: ``"none"``, ``"gaussian:SIGMA"``, ``"mean:RADIUS"`` (in pixels, for one
        photon per pixel) or ``"cone:NEAREST"``.
    """

    samples: int = 16
    jitter: str = "sobol"
    seed: int = 0
    filter: str = "gaussian:0.8"
    _kind = "photons"
    _tag = "method"
    _whole = ("samples", "seed")

    def __post_init__(self):
        _arrays.whole("Photons.samples", self.samples, 1)
        _arrays.whole("Photons.seed", self.seed, 0, 2**64 - 1)
        _arrays.one_of("Photons.jitter", self.jitter, ("sobol", "random"))
        self._filter()

    def _filter(self):
        kind, _, number = str(self.filter).partition(":")
        if kind == "none" and not number:
            return {"kind": "none"}
        key = {"gaussian": "sigma_px", "mean": "radius_px", "cone": "nearest"}.get(kind)
        try:
            value = int(number) if kind == "cone" else float(number)
        except ValueError:
            key = None
        if key is None or not 0 <= value < 2**32:
            raise ValueError(
                f"Photons.filter is {self.filter!r}; give 'none', 'gaussian:0.8', 'mean:1' or "
                "'cone:8'"
            )
        return {"kind": kind, key: value}

    def _spec(self):
        return super()._spec() | {"filter": self._filter()}


@dataclass(frozen=True)
class Beams(_Part):
    """The film is exposed by the cells of a lattice of rays, without noise."""

    cells_per_side: int = 1
    _kind = "beams"
    _tag = "method"
    _whole = ("cells_per_side",)


CUTOFFS = (Knife, Circle, ComplementedCircle, ColorWheel, FilterImage, Painting)
TECHNIQUES = (Schlieren, Shadowgraph, Interferogram, BOS, Volume, Slice)
SOURCES = (PointSource, SlitSource, CircleSource)
SAMPLINGS = (Photons, Beams)


def part(name, value, classes):
    """One of some parts, or the name of one with its default values."""
    if isinstance(value, classes):
        return value
    by_name = {c._kind: c for c in classes}
    if isinstance(value, str):
        kind = _arrays.one_of(name, value, tuple(by_name))
        try:
            return by_name[kind]()
        except TypeError:
            made = by_name[kind].__name__
            raise ValueError(f"{name} is {value!r}; give schlieren.{made}(...)") from None
    classes = ", ".join(f"schlieren.{c.__name__}" for c in classes)
    raise TypeError(f"{name} is {value!r}; give a name, or one of {classes}")
