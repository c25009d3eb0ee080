"""What people try first who have not read the documentation: it works, or the message says how it
does."""

import copy
import pickle
import warnings

import numpy as np
import pytest
import schlieren
from flows import field, render, warm

OF = field(8)
FEW = {"size": (4, 4)}


@pytest.mark.parametrize(
    "call, error, parts",
    [
        (lambda: render(OF, wavelength_nm=None), TypeError, ["wavelength_nm is None", "633"]),
        (lambda: render(OF, layers=None), TypeError, ["layers is None", "'phase'", "()"]),
        (lambda: schlieren.sweep(OF, "focus_m", 3), TypeError, ["values is 3", "[3]"]),
        (lambda: schlieren.stream(OF), TypeError, ["fields is of type Field", "iterable"]),
        (lambda: pickle.dumps(OF), TypeError, ["does not pickle", "write()"]),
        (lambda: copy.deepcopy(OF), TypeError, ["does not pickle", "open()"]),
        (lambda: pickle.dumps(render(OF, **FEW)), TypeError, ["does not pickle", "save()"]),
        (
            lambda: schlieren.index(temperature_c=np.ma.masked_equal([0, 20.0], 20)),
            ValueError,
            ["temperature_c is masked", "temperature_c.compressed()"],
        ),
    ],
)
def test_what_does_not_work_is_said(call, error, parts):
    with pytest.raises(error) as caught:
        call()
    assert type(caught.value) is error
    assert all(part in str(caught.value) for part in parts), caught.value


@pytest.mark.parametrize(
    "quantity, units",
    [
        (
            "density",
            "kg/m3 kg/m^3 kg/m**3 kg.m-3 kg·m⁻³ kg/m³ kg*m^-3 kg/(m^3) g/L".split()
            + ["kilogram/meter**3", "kg m-3", "kg m^-3", "kg m**-3", "kilogram / meter ** 3", " kg / m^3 "],
        ),
        ("temperature", "K kelvin Kelvin".split()),
        ("pressure", "Pa pascal Pascals N/m2".split() + ["N m-2"]),
        ("length", "m metre meters".split()),
    ],
)
def test_units_may_be_spelled_in_many_ways(quantity, units):
    given = {"density": warm(4), "spacing": 0.01}
    if quantity in ("temperature", "pressure"):
        given = {"temperature": 240 * warm(4), "pressure": 1e5, "spacing": 0.01}
    expected = schlieren.Field(**given)._flow
    key = {
        "density": "density_unit_kg_m3",
        "temperature": "temperature_zero_k",
        "pressure": "pressure_unit_pa",
        "length": "length_unit_m",
    }[quantity]
    for unit in units:
        made = schlieren.Field(**given, **{f"{quantity}_unit": unit})._flow
        assert made == expected | {key: 0.0 if quantity == "temperature" else 1.0}, unit


@pytest.mark.parametrize(
    "name, factor",
    [("millimeters", 1e-3), ("centimetres", 1e-2), ("inches", 0.0254), ("kilometers", 1e3)],
)
def test_plurals_of_lengths(name, factor):
    of = schlieren.Field(density=warm(4), spacing=0.01, length_unit=name)
    assert of._flow["length_unit_m"] == factor


def test_copies_of_images_have_the_same_arrays():
    image = render(OF, **FEW)
    assert copy.copy(image).brightness is not None
    np.testing.assert_array_equal(copy.copy(image).brightness, image.brightness)


def test_dimensions_are_given_once():
    xarray = pytest.importorskip("xarray")
    x = np.linspace(0, 0.1, 8)
    coords = {axis: (axis, x, {"units": "m"}) for axis in "xyz"}
    rho = xarray.DataArray(warm(8), dims=tuple("xyz"), coords=coords, attrs={"units": "kg/m3"})
    with pytest.raises(ValueError, match=r"dims has \['x', 'x', 'z'\]; give each dimension once"):
        schlieren.Field.from_xarray(rho.to_dataset(name="r"), density="r", dims=("x", "x", "z"))


def test_patches_beside_the_mesh_are_left_out_with_a_warning():
    """As PyVista's reader of OpenFOAM gives them."""
    pyvista = pytest.importorskip("pyvista")
    grid = pyvista.ImageData(dimensions=[8] * 3, spacing=[0.1 / 7] * 3)
    grid["rho"] = warm(8).ravel(order="F")
    blocks = pyvista.MultiBlock([grid, pyvista.MultiBlock([pyvista.Sphere(), pyvista.Plane()])])
    with pytest.warns(schlieren.SchlierenWarning, match="2 blocks are surfaces and are left out"):
        of = schlieren.Field.from_vtk(blocks, density="rho")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        np.testing.assert_array_equal(render(of).brightness, render(field(8)).brightness)
