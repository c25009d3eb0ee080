"""Turns the library's sentences, which name keys of scene files and options of the program, into
ones that name this package's arguments."""

import re
import warnings


class SchlierenWarning(UserWarning):
    """What a caller should know about an image: a tolerance that was not met, a repair."""


#: Keys and options that are called otherwise here.
_NAMES = {
    "light.source": "source",
    "lenses.collimator_m": "collimator_m",
    "lenses.schlieren_m": "schlieren_lens_m",
    "light.wavelengths_nm": "wavelength_nm",
    "march.method": "march",
    "technique.cutoff.file": "FilterImage.file",
    "technique.cutoff": "cutoff",
    "technique.fringe_spacing_m": "Interferogram.fringe_spacing_m",
    "technique.strength": "strength",
    "view.direction": "view",
    "solids.files": "solids",
    "sampling.samples": "samples",
    "flow.density_unit_kg_m3": "density_unit",
    "flow.temperature_zero_k to 273.15": "temperature_unit to 'degC'",
    "flow.temperature_zero_k": "temperature_unit",
    "flow.pressure_unit_pa": "pressure_unit",
    "set flow.pressure_zero_pa to 101325 if": "add 101325 Pa to it if",
    "flow.length_unit_m": "length_unit",
    "flow.average_jumps": "smoothing_nodes='auto'",
    "give it as --solid FILE": "give it to solids",
    "give --spacing DX,DY,DZ": "give spacing",
    "[flow]": "Field",
}
_SECTIONS = ("flow", "light", "film", "march", "media", "lenses", "sampling", "technique", "view")
_OPTIONS = {"length-unit": "length_unit", "density-unit": "density_unit", "march": "march"}


def here(text):
    """A sentence of the library in this package's words.

    >>> here("set the role of nodes outside the mesh (flow.outside)")
    'set the role of nodes outside the mesh (outside)'
    >>> here("set --outside solid (a body)")
    'set outside="solid" (a body)'
    """
    for key, name in _NAMES.items():
        text = text.replace(key, name)
    sections = "|".join(_SECTIONS)
    text = re.sub(rf"\b(?:{sections})(?:\.\w+)*\.(\w+)", r"\1", text)
    text = re.sub(r"--outside (\w+)", r'outside="\1"', text)
    text = re.sub(
        r"--([a-z][a-z-]+)", lambda m: _OPTIONS.get(m[1], m[1].replace("-", "_")) + "=", text
    )
    return text.replace("`Resolution::", "`").replace("TestSection::", "")


def raised(error):
    """The same exception with its sentence in this package's words."""
    if isinstance(error, OSError) or not error.args:
        return error
    return type(error)(*(here(a) if isinstance(a, str) else a for a in error.args))


def warn(texts, level):
    """Raises each sentence as a warning of who called `level` calls up."""
    for text in texts:
        warnings.warn(here(text), SchlierenWarning, stacklevel=level + 1)
