"""Data sets of xarray, with the units in their attributes."""

import numpy as np
import pytest
import schlieren
from flows import field, render, same, warm

xarray = pytest.importorskip("xarray")

NODES, STEP = 24, 0.1 / 23


def data(order="xyz", unit="kg m-3", length="mm", scale=1.0):
    x = 1000 * STEP * np.arange(NODES) if length == "mm" else STEP * np.arange(NODES)
    rho = xarray.DataArray(
        warm(NODES) * scale,
        dims=("x", "y", "z"),
        coords={axis: (axis, x, {"units": length}) for axis in "xyz"},
        attrs={"units": unit},
    )
    return xarray.Dataset({"rho": rho.transpose(*order)})


@pytest.mark.parametrize(
    "options", [{}, {"order": "zyx"}, {"length": "m"}, {"unit": "g/cm3", "scale": 1e-3}]
)
def test_units_and_order_come_from_the_data(options):
    of = schlieren.Field.from_xarray(data(**options), density="rho")
    expected = render(field(NODES))
    np.testing.assert_allclose(
        render(of).deflection_rad, expected.deflection_rad, rtol=1e-3, atol=1e-9
    )


def test_names_of_dimensions_may_be_others():
    flow = data().rename(x="streamwise", y="lat", z="lev")
    with pytest.raises(ValueError, match="give dims"):
        schlieren.Field.from_xarray(flow, density="rho")
    of = schlieren.Field.from_xarray(flow, density="rho", dims=("streamwise", "lat", "lev"))
    assert same(render(of), render(schlieren.Field.from_xarray(data(), density="rho")))
    for name, axis in [("streamwise", "X"), ("lat", "Y"), ("lev", "Z")]:
        flow[name].attrs["axis"] = axis
    assert same(render(schlieren.Field.from_xarray(flow, density="rho")), render(of))


def test_units_that_the_scene_does_not_convert():
    flow = data()
    flow["T"] = (293 + 100 * (1.2 - flow.rho)).assign_attrs(units="K")
    flow["p"] = (1013.25 + 0 * flow.rho).assign_attrs(units="hPa")
    flow["RH"] = (40 + 0 * flow.rho).assign_attrs(units="%")
    of = schlieren.Field.from_xarray(flow, temperature="T", pressure="p", humidity="RH")
    expected = schlieren.Field(
        temperature=flow["T"].values, pressure=101325.0, humidity=0.4, spacing=STEP
    )
    np.testing.assert_allclose(
        render(of).deflection_rad, render(expected).deflection_rad, rtol=1e-3, atol=1e-9
    )


def test_what_is_not_said_is_asked_for():
    for change, parts in [
        (lambda d: d.rho.attrs.pop("units"), "rho has no attribute units; give density_unit"),
        (lambda d: d.x.attrs.pop("units"), "x has no attribute units; give length_unit"),
        (lambda d: d.rho.attrs.update(units="furlong"), "rho.units is 'furlong'"),
        (lambda d: d.x.attrs.update(units="m"), "different units"),
    ]:
        flow = data()
        change(flow)
        with pytest.raises(ValueError, match=parts):
            schlieren.Field.from_xarray(flow, density="rho")
    flow = data()
    del flow.rho.attrs["units"]
    schlieren.Field.from_xarray(flow, density="rho", density_unit="kg/m3")
    with pytest.raises(ValueError, match="'Rho'.*did you mean 'rho'"):
        schlieren.Field.from_xarray(flow, density="Rho")
    timed = data().expand_dims(time=2)
    with pytest.raises(ValueError, match="isel"):
        schlieren.Field.from_xarray(timed, density="rho")
