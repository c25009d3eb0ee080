"""The index of refraction for conditions."""

from dataclasses import dataclass

import numpy as np

from schlieren import _arrays, _words
from schlieren import _schlieren as native


@dataclass(frozen=True)
class Index:
    """Attributes
    ----------
    n_minus_1 : float or ndarray
        It has more digits than n.
    model : str
        The formula: ``"ciddor"`` or ``"gladstone-dale"``.
    """

    n_minus_1: object
    model: str


def index(
    *,
    wavelength_nm=633.0,
    temperature_c=20.0,
    pressure_pa=101325.0,
    humidity=0.0,
    co2_ppm=450.0,
    density_kg_m3=None,
    species=None,
    model="auto",
):
    """Computes n - 1 of a gas. All arguments but the last may be arrays, which are broadcast.

    Parameters
    ----------
    wavelength_nm : float or array_like
        In vacuum.
    temperature_c, pressure_pa : float or array_like
    humidity : float or array_like
        Relative, 0 to 1.
    co2_ppm : float or array_like
    density_kg_m3 : float or array_like, optional
        In place of the one that follows from temperature and pressure.
    species : dict, optional
        Mass fraction by gas; the rest is air.
    model : str
        ``"auto"``, ``"ciddor"`` or ``"gladstone-dale"``.

    Returns
    -------
    Index

    Examples
    --------
    >>> import schlieren
    >>> f"{schlieren.index(wavelength_nm=633, temperature_c=20).n_minus_1:.6e}"
    '2.717998e-04'
    >>> schlieren.index(temperature_c=[0, 20, 40]).n_minus_1.shape
    (3,)
    """
    if species is not None and not hasattr(species, "items"):
        raise TypeError(f"species is {species!r}; give a dictionary, such as {{'CH4': 0.1}}")
    species = dict(species or {})
    given = {
        "wavelength_nm": wavelength_nm,
        "temperature_c": temperature_c,
        "pressure_pa": pressure_pa,
        "humidity": humidity,
        "co2_ppm": co2_ppm,
    }
    if density_kg_m3 is not None:
        given["density_kg_m3"] = density_kg_m3
    given |= {f"species[{gas!r}]": part for gas, part in species.items()}
    cure = "give {}.compressed()"
    arrays = {name: _arrays.array(name, value, cure) for name, value in given.items()}
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise ValueError(f"{name} has a number that is not finite; give finite numbers")
    try:
        shape = np.broadcast_shapes(*(a.shape for a in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{n} {a.shape}" for n, a in arrays.items() if a.shape)
        raise ValueError(f"the shapes do not fit: {shapes}; give arrays of one shape") from None
    flat = [
        np.ascontiguousarray(np.broadcast_to(a, shape), dtype=np.float64).reshape(-1)
        for a in arrays.values()
    ]
    density = flat[5] if density_kg_m3 is not None else None
    parts = [(str(gas), f) for gas, f in zip(species, flat[len(flat) - len(species) :])]
    _arrays.one_of("model", model, ("auto", "ciddor", "gladstone-dale"))
    values, formula, texts = native.index(*flat[:5], density, parts, model)
    _words.warn(texts, 2)
    values = values.reshape(shape)
    return Index(values if shape else float(values), formula)
