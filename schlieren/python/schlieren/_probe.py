"""The ray of one point of an image."""

import json
from dataclasses import dataclass

from schlieren import _arrays, _words
from schlieren._render import ARGUMENTS
from schlieren._render import _scene as scene_of


@dataclass(frozen=True)
class Probe:
    """The ray of one point of an image.

    Attributes
    ----------
    pixel : (float, float)
        Column and row from the upper left; (0.5, 0.5) is the first pixel's centre.
    status : str
        What becomes of the ray.
    start_m, direction : tuple of float
        The undisturbed ray.
    deflection_rad, exit_displacement_m : (float, float)
        Along the image's right and up.
    exit_depth_m : float
    path_difference_m, phase_waves : float
    film_shift_m, film_shift_px : (float, float)
    cutoff_point_m : (float, float)
    transmission : float
    energy : (float, float, float)
    march : str
    deflection_error_rad : float or None
    left_out : dict or None
        With `skip_rad`: how much was skipped.
    warnings : tuple of str
    optical_depth, emission, rotation_rad : float or None
    """

    pixel: tuple
    status: str
    start_m: tuple
    direction: tuple
    deflection_rad: tuple
    exit_displacement_m: tuple
    exit_depth_m: float
    path_difference_m: float
    phase_waves: float
    film_shift_m: tuple
    film_shift_px: tuple
    cutoff_point_m: tuple
    transmission: float
    energy: tuple
    march: str
    deflection_error_rad: float | None
    left_out: dict | None
    warnings: tuple
    optical_depth: float | None = None
    emission: float | None = None
    rotation_rad: float | None = None


def probe(field, pixel, technique="schlieren", *, threads=None, **options):
    """Traces the ray of one point of the image.

    Parameters
    ----------
    field : Field
    pixel : (float, float)
        Column and row from the upper left; (0.5, 0.5) is the first pixel's centre.
    technique, threads, **options
        As for `render`.

    Returns
    -------
    Probe
    """
    _arrays.known("probe", options, ARGUMENTS - {"layers"})
    scene = scene_of(field, technique, **options)
    kind = json.loads(scene)["technique"]["kind"]
    if kind in ("volume", "slice"):
        raise ValueError(f"technique is {kind!r}, which traces no light; give another")
    place = tuple(_arrays.several("pixel", pixel, 2))
    try:
        found = json.loads(field._native.probe(scene, place, _arrays.threads(threads)))
    except ValueError as error:
        raise _words.raised(error) from None
    _words.warn(found["warnings"], 2)
    return Probe(**{k: tuple(v) if isinstance(v, list) else v for k, v in found.items()})
