"""What the arrays of a flow mean: keys of a scene, and units."""

import numpy as np

from schlieren import _arrays, _units

#: Quantities that set the index, and that change it.
QUANTITIES = (
    "density", "temperature", "pressure", "humidity", "co2_ppm", "n_minus_1", "electrons",
)  # fmt: skip
#: Properties of the medium besides its index.
MEDIA = ("absorption", "emission", "rotation")
ROLES = ("blank", "solid", "gas")


def _smoothing(name, value):
    if isinstance(value, str):
        return _arrays.one_of(name, value, ("auto",))
    return _arrays.number(name, value, "0 or more, or 'auto'", lambda x: x >= 0)


def _options(given):
    """The keys of a scene's flow for options of the lattice."""
    flow = {}
    checks = {
        "span": _arrays.positive,
        "resample_nodes": lambda n, v: _arrays.whole(n, v, 2, 4096),
        "resample_samples": lambda n, v: _arrays.whole(n, v, 1, 8),
        "reconstruction": lambda n, v: _arrays.one_of(n, v, ("cubic", "linear")),
        "smoothing_nodes": _smoothing,
        "outside": lambda n, v: _arrays.one_of(n, v, ("auto", *ROLES)),
        "hidden": lambda n, v: _arrays.one_of(n, v, ROLES),
        "reference_n_minus_1": _arrays.number,
        "model": lambda n, v: _arrays.one_of(n, v, ("auto", "ciddor", "gladstone-dale")),
    }
    for name, check in checks.items():
        if given.get(name) is not None:
            flow[name] = check(name, given[name])
    if flow.get("smoothing_nodes") == "auto":
        del flow["smoothing_nodes"]
        flow["average_jumps"] = True
    for switch in ("revolve", "on_cells"):
        if not isinstance(given.get(switch, False), (bool, np.bool_)):
            raise TypeError(f"{switch} is {given[switch]!r}; give True or False")
        if given.get(switch):
            flow[switch] = True
    return flow


#: Names of arguments that all ways to make a field have.
OPTIONS = (
    "span", "revolve", "resample_nodes", "resample_samples", "reconstruction", "smoothing_nodes",
    "outside", "hidden", "reference_n_minus_1", "model", "on_cells",
)  # fmt: skip
UNITS = ("density_unit", "temperature_unit", "pressure_unit", "length_unit")
MEANING = (*QUANTITIES, *MEDIA, "species", "curves", "curve_rule")


class Meaning:
    """What is said about a flow, as keys of a scene, and the arrays that are named in it.

    `arrays(role, value)` gives the name that stands for a value.
    """

    def __init__(self, function, given, name_of):
        _arrays.known(function, given, (*MEANING, *OPTIONS, *UNITS))
        self.flow = {"file": ""} | _options(given)
        self.media = {}
        for role in (*QUANTITIES, *MEDIA):
            value = given.get(role)
            if value is None:
                continue
            if _arrays.is_number(value):
                value = repr(_arrays.number(role, value))
            else:
                value = name_of(role, value)
            (self.media if role in MEDIA else self.flow)[role] = value
        self._species(given.get("species"), name_of)
        self._curves(given.get("curves"), given.get("curve_rule"), name_of)
        self._units(given)

    def _species(self, species, name_of):
        if species is None:
            return
        if not hasattr(species, "items"):
            raise TypeError(
                f"species is {species!r}; give a dictionary of gases and mass fractions, "
                "such as {'CH4': fractions}"
            )
        found = {}
        for gas, part in species.items():
            role = f"species[{gas!r}]"
            if _arrays.is_number(part):
                name = repr(_arrays.number(role, part, "0 to 1", lambda v: 0 <= v <= 1))
            else:
                name = name_of(role, part)
            if name in found:
                raise ValueError(
                    f"{role} is {name}, as that of {found[name]}; add the gases' fractions up"
                )
            found[name] = str(gas)
        self.flow["species"] = found

    def _curves(self, curves, rule, name_of):
        if curves is None:
            if rule is not None:
                raise ValueError(f"curve_rule is {rule!r} and has no effect; give curves")
            return
        if not hasattr(curves, "items"):
            raise TypeError("curves is no dictionary; give {name: (values, knots)}")
        fields = {}
        for name, curve in curves.items():
            role = f"curves[{name!r}]"
            try:
                values, knots, *weight = curve
            except (TypeError, ValueError):
                raise TypeError(
                    f"{role} is {curve!r}; give (values, knots) or with a weight"
                ) from None
            knots = _arrays.array(f"{role} knots", knots)
            if knots.ndim != 2 or knots.shape[1] != 2:
                raise ValueError(f"{role} knots has shape {knots.shape}; give (K, 2)")
            spec = {"knots": knots.astype(float).tolist()}
            if weight:
                spec["weight"] = _arrays.number(f"{role} weight", weight[0])
            fields[name_of(role, values)] = spec
        rule = _arrays.one_of("curve_rule", "sum" if rule is None else rule, ("sum", "largest"))
        self.flow["multifield"] = {"rule": rule, "fields": fields}

    def _units(self, given):
        for quantity, key in [
            ("density", "density_unit_kg_m3"),
            ("temperature", "temperature_zero_k"),
            ("pressure", "pressure_unit_pa"),
            ("length", "length_unit_m"),
        ]:
            name = f"{quantity}_unit"
            if given.get(name) is None:
                continue
            if quantity != "length" and given.get(quantity) is None:
                raise ValueError(f"{name} is given and {quantity} is not; leave one out")
            self.flow[key] = _units.factor(name, quantity, given[name])
