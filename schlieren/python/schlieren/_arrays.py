"""Checks arguments, and makes arrays of them in the order of VTK."""

import difflib
import math
import numbers

import numpy as np


def array(name, values, cure="give {}.filled(numpy.nan), and nan='blank' for cells without data"):
    """``values`` as an array of real numbers that the native module takes.

    `cure`: what to do with those that are masked.
    """
    if np.ma.isMaskedArray(values):
        if np.ma.is_masked(values):
            raise ValueError(f"{name} is masked; {cure.format(name)}")
        values = values.data
    try:
        found = np.asarray(values)
    except ValueError as error:
        raise ValueError(f"{name} is no array: {error}; give rows of equal length") from None
    if found.dtype.kind not in "fiu":
        raise TypeError(f"{name} has dtype {found.dtype}; give float32 or float64")
    if found.dtype.kind == "f" and found.dtype.itemsize not in (4, 8):
        found = found.astype(np.float32 if found.dtype.itemsize == 2 else np.float64)
    return found.astype(found.dtype.newbyteorder("="), copy=False)


def finite(name, values):
    """Refuses numbers that are not finite, and names the first."""
    if values.dtype.kind != "f" or np.isfinite(values.sum(dtype=np.float64)):
        return
    bad = ~np.isfinite(values)
    if bad.any():
        at = [int(i) for i in np.unravel_index(int(bad.argmax()), values.shape)]
        raise ValueError(
            f"{name}{at} is {values[tuple(at)]}, one of {int(bad.sum())} numbers that are not "
            "finite; give numbers, or nan='blank' for places without data"
        )


def flat(values):
    """The numbers with the first index fastest, as VTK has them."""
    return np.ascontiguousarray(values.ravel(order="F"))


def is_number(value):
    """Whether this is one real number."""
    if isinstance(value, np.ndarray):
        return value.ndim == 0 and value.dtype.kind in "fiu"
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


def number(name, value, rule="a finite number", accepts=math.isfinite):
    """A number that ``accepts`` takes."""
    if not is_number(value):
        raise TypeError(f"{name} is {value!r}; give {rule}")
    value = float(value)
    if not (math.isfinite(value) and accepts(value)):
        raise ValueError(f"{name} is {value}; give {rule}")
    return value


def positive(name, value):
    return number(name, value, "a positive finite number", lambda v: v > 0)


def whole(name, value, least=0, most=2**32 - 1):
    """A whole number."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
        raise TypeError(f"{name} is {value!r}; give a whole number")
    if not least <= value <= most:
        raise ValueError(f"{name} is {value}; give {least} to {most}")
    return int(value)


def items(name, values, cure):
    """What an iterable has, in a list."""
    try:
        return list(values)
    except TypeError:
        raise TypeError(f"{name} is {values!r}; {cure}") from None


def several(name, values, count):
    """A list of finite numbers."""
    try:
        found = list(values)
    except TypeError:
        raise TypeError(f"{name} is {values!r}; give {count} numbers") from None
    if isinstance(values, str) or len(found) != count:
        raise ValueError(f"{name} is {values!r}; give {count} numbers")
    return [number(f"{name}[{i}]", v) for i, v in enumerate(found)]


def one_of(name, value, names):
    """One of some names."""
    if not isinstance(value, str):
        raise TypeError(f"{name} is {value!r}; give one of {', '.join(map(repr, names))}")
    if value not in names:
        raise ValueError(
            f"{name} is {value!r}{meant(value, names)}; there are: {', '.join(map(repr, names))}"
        )
    return value


def meant(name, names):
    """The name that was probably meant, for messages."""
    near = difflib.get_close_matches(name, list(names), n=1)
    return f" (did you mean {near[0]!r}?)" if near else ""


def known(function, given, names):
    """Refuses keyword arguments that a function does not have."""
    for name in given:
        if name not in names:
            raise TypeError(
                f"{function}() got an unexpected keyword argument {name!r}{meant(name, names)}; "
                f"there are: {', '.join(sorted(names))}"
            )


def threads(value):
    """The number that the native module takes; 0 stands for all."""
    return 0 if value is None else whole("threads", value, 1, 1024)
