"""Units by name. Everything that is not SI is converted where it comes in."""

import difflib
import math
import numbers

#: SI units per unit. A temperature has a zero instead, in kelvin.
UNITS = {
    "density": {
        "kg/m3": 1.0, "g/cm3": 1000.0, "g/m3": 1e-3, "g/l": 1.0, "kg/l": 1000.0,
        "lb/ft3": 16.018463373960142, "slug/ft3": 515.3788183931961,
    },
    "temperature": {"K": 0.0, "degC": 273.15},
    "pressure": {
        "Pa": 1.0, "hPa": 100.0, "mbar": 100.0, "kPa": 1e3, "MPa": 1e6, "bar": 1e5,
        "atm": 101325.0, "psi": 6894.757293168361, "Torr": 101325.0 / 760,
    },
    "length": {
        "m": 1.0, "cm": 0.01, "mm": 1e-3, "um": 1e-6, "km": 1e3, "in": 0.0254, "ft": 0.3048,
    },
    "electrons": {"1/m3": 1.0, "1/cm3": 1e6},
    "fraction": {"1": 1.0, "%": 0.01},
    "ppm": {"ppm": 1.0, "1": 1e6, "%": 1e4},
    "attenuation": {"1/m": 1.0, "1/cm": 100.0, "1/mm": 1000.0},
    "rotation": {"rad/m": 1.0, "deg/m": math.pi / 180},
}  # fmt: skip

#: Other spellings, after `_plain`.
SPELLINGS = {
    "kgm-3": "kg/m3", "gcm-3": "g/cm3", "gm-3": "g/m3", "g/L": "g/l", "kg/L": "kg/l",
    "kg.m-3": "kg/m3", "g.cm-3": "g/cm3", "kg/(m3)": "kg/m3", "g/cc": "g/cm3", "g/mL": "g/cm3",
    "g/ml": "g/cm3", "kilogram/meter3": "kg/m3", "kilogram/m3": "kg/m3",
    "gram/centimeter3": "g/cm3", "kelvin": "K", "Kelvin": "K", "degK": "K",
    "C": "degC", "°C": "degC", "celsius": "degC", "Celsius": "degC", "deg_C": "degC",
    "degree_Celsius": "degC", "degrees_Celsius": "degC", "degree_celsius": "degC",
    "degrees_celsius": "degC", "degree_C": "degC", "degrees_C": "degC",
    "pascal": "Pa", "Pascal": "Pa", "pascals": "Pa", "Pascals": "Pa", "N/m2": "Pa", "Nm-2": "Pa",
    "torr": "Torr", "mmHg": "Torr",
    "millibar": "mbar", "millibars": "mbar", "mb": "mbar", "hectopascal": "hPa",
    "metre": "m", "meter": "m", "metres": "m", "meters": "m",
    "millimetre": "mm", "millimetres": "mm", "millimeter": "mm", "millimeters": "mm",
    "centimetre": "cm", "centimetres": "cm", "centimeter": "cm", "centimeters": "cm",
    "kilometre": "km", "kilometres": "km", "kilometer": "km", "kilometers": "km",
    "µm": "um", "μm": "um", "micron": "um", "microns": "um", "micrometer": "um",
    "micrometers": "um", "micrometre": "um", "micrometres": "um", "inch": "in", "inches": "in",
    "foot": "ft", "feet": "ft",
    "m-3": "1/m3", "/m3": "1/m3", "cm-3": "1/cm3", "/cm3": "1/cm3",
    "": "1", "dimensionless": "1", "kg/kg": "1", "kgkg-1": "1", "percent": "%",
    "m-1": "1/m", "cm-1": "1/cm", "mm-1": "1/mm", "radm-1": "rad/m", "degm-1": "deg/m",
}  # fmt: skip

_SUPERSCRIPTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def _plain(name):
    """A unit without its ways to write a product and a power."""
    plain = name.strip().translate(_SUPERSCRIPTS)
    for sign in ("**", "^", "·", "*", " "):
        plain = plain.replace(sign, "")
    return plain


def factor(argument, quantity, unit):
    """SI units per `unit`; for a temperature, its zero in kelvin.

    `unit` is a name, or already a number.
    """
    known = UNITS[quantity]
    if isinstance(unit, str):
        plain = _plain(unit)
        plain = SPELLINGS.get(plain, plain)
        if plain in known:
            return known[plain]
        near = difflib.get_close_matches(plain, [*known, *SPELLINGS], n=1)
        near = [SPELLINGS.get(n, n) for n in near if SPELLINGS.get(n, n) in known]
        meant = f" (did you mean {near[0]!r}?)" if near else ""
        raise ValueError(
            f"{argument} is {unit!r}, which is no unit of {quantity} known here{meant}; "
            f"there are: {', '.join(known)}; a number gives SI units per unit"
        )
    if isinstance(unit, bool) or not isinstance(unit, numbers.Real):
        raise TypeError(f"{argument} is {unit!r}; give the name of a unit, or a number")
    value = float(unit)
    if not math.isfinite(value) or (value <= 0 and quantity != "temperature"):
        raise ValueError(f"{argument} is {value}; give a positive finite number of SI units")
    return value
