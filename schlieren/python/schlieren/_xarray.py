"""Data sets of xarray, with units from their attributes."""

import numpy as np

from schlieren import _arrays, _units
from schlieren._field import _Lattice
from schlieren._meaning import MEANING, OPTIONS, UNITS, Meaning

#: The unit of a role, and whether the scene converts it.
_UNIT_OF = {
    "density": ("density", True),
    "temperature": ("temperature", True),
    "pressure": ("pressure", True),
    "humidity": ("fraction", False),
    "co2_ppm": ("ppm", False),
    "n_minus_1": ("fraction", False),
    "electrons": ("electrons", False),
    "absorption": ("attenuation", False),
    "emission": ("attenuation", False),
    "rotation": ("rotation", False),
}


def _axes(data, dims):
    """The dimensions along x, y and z."""
    if dims is not None:
        dims = [dims] if isinstance(dims, str) else list(dims)
        for dim in dims:
            if dim not in data.dims:
                raise ValueError(
                    f"dims has {dim!r}{_arrays.meant(str(dim), map(str, data.dims))}; "
                    f"there are: {', '.join(map(repr, data.dims))}"
                )
        if len(set(dims)) < len(dims):
            raise ValueError(f"dims has {dims}; give each dimension once")
        return dims
    found = {}
    for dim in data.dims:
        axis = str(data[dim].attrs.get("axis", dim) if dim in data.coords else dim).lower()
        if axis in ("x", "y", "z"):
            found[axis] = dim
    if not {"x", "y"} <= set(found):
        raise ValueError(
            f"the dimensions are {', '.join(map(repr, data.dims))}; give dims, those along x, y "
            "and z"
        )
    return [found[axis] for axis in ("x", "y", "z") if axis in found]


def _unit(name, variable, quantity):
    unit = variable.attrs.get("units")
    if unit is None:
        argument = f"{quantity}_unit"
        cure = f"give {argument}" if argument in UNITS else "add it"
        raise ValueError(f"{name} has no attribute units; {cure}")
    return _units.factor(f"{name}.units", quantity, str(unit))


def field(cls, data, dims, nan, meaning):
    """A field of a data set of xarray."""
    if not (hasattr(data, "coords") and hasattr(data, "dims")):
        raise TypeError(f"data is of type {type(data).__name__}; give an xarray.Dataset")
    if not hasattr(data, "data_vars"):
        data = data.to_dataset(name=data.name or "values")
    _arrays.known("Field.from_xarray", meaning, (*MEANING, *OPTIONS, *UNITS))
    meaning = dict(meaning)
    axes = _axes(data, dims)
    lattice = _Lattice(None, None, None, nan)

    def name_of(role, name):
        if not isinstance(name, str):
            raise TypeError(f"{role} is {type(name).__name__}; give the name of a variable")
        if name not in data:
            there = [str(v) for v in data.data_vars]
            raise ValueError(
                f"{role} is {name!r}, which no variable is called{_arrays.meant(name, there)}; "
                f"there are: {', '.join(map(repr, there)) or 'none'}"
            )
        variable = data[name]
        if set(variable.dims) != set(axes):
            raise ValueError(
                f"{name} has the dimensions {', '.join(map(repr, variable.dims))}; choose one of "
                f"the others than {', '.join(map(repr, axes))} with isel, or give dims"
            )
        values = _arrays.array(name, variable.transpose(*axes).values)
        quantity, converted = _UNIT_OF.get(role, ("fraction", False))
        argument = f"{quantity}_unit"
        if role.startswith("curves"):
            pass
        elif converted:
            if meaning.get(argument) is None:
                meaning[argument] = _unit(name, variable, quantity)
        elif "units" in variable.attrs or quantity != "fraction":
            factor = _unit(name, variable, quantity)
            values = values if factor == 1 else values * factor
        return lattice.add(role, values)

    said = Meaning("Field.from_xarray", meaning, name_of)
    along, lengths = [], set()
    for axis in axes:
        if axis not in data.coords:
            raise ValueError(
                f"the dimension {axis!r} has no coordinate; assign one, in metres or with units"
            )
        along.append(np.asarray(data[axis].values))
        if meaning.get("length_unit") is None:
            lengths.add(_unit(axis, data[axis], "length"))
    if len(lengths) > 1:
        raise ValueError(
            f"the coordinates {', '.join(map(repr, axes))} have different units; convert them"
        )
    if lengths:
        meaning["length_unit"] = lengths.pop()
    lattice.coordinates = along
    said._units(meaning)
    if len(axes) == 2 and not ("span" in said.flow or "revolve" in said.flow):
        raise ValueError("the data are two-dimensional; give span, their depth, or revolve=True")
    return cls._made(lattice.dictionary(), said)
