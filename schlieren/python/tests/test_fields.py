"""Fields from arrays: place, units, order and layout."""

import numpy as np
import pytest
import schlieren
from flows import field, render, same, warm

CLOSE = {"rtol": 1e-3, "atol": 1e-9}


def test_lattices_are_given_in_several_ways():
    density = warm(24)
    x = 0.004 * np.arange(24)
    reference = render(schlieren.Field(density=density, spacing=0.004))
    millimetres = schlieren.Field(density=density, spacing=(4, 4, 4), length_unit="mm")
    along = schlieren.Field(density=density, coordinates=(x, x, x))
    turned = schlieren.Field(density=density[::-1], coordinates=(x[::-1], x, x))
    for of in (millimetres, along, turned):
        np.testing.assert_allclose(render(of).deflection_rad, reference.deflection_rad, **CLOSE)
    # Layouts of one array.
    for other in (
        np.asfortranarray(density),
        density[::1].astype(">f8"),
        np.repeat(density, 2, 1)[:, ::2],
    ):
        assert same(render(schlieren.Field(density=other, spacing=0.004)), reference)
    density.flags.writeable = False
    assert same(render(schlieren.Field(density=density, spacing=0.004)), reference)


@pytest.mark.filterwarnings("ignore::schlieren.SchlierenWarning")
def test_curvilinear_nodes():
    x = 0.004 * np.arange(24)
    places = np.meshgrid(x, x, x, indexing="ij")
    curved = schlieren.Field(density=warm(24), coordinates=places)
    straight = render(schlieren.Field(density=warm(24), spacing=0.004))
    found = render(curved).deflection_rad
    assert (
        np.abs(found - straight.deflection_rad).max()
        < 0.05 * straight.report.largest_deflection_rad
    )


def test_the_first_index_is_x_and_right_of_the_image():
    density = 1.2 + 0 * warm(24)
    density[12:, :, :] -= 0.001 * np.arange(12)[:, None, None]
    found = render(schlieren.Field(density=density, spacing=0.004), layers="deflection")
    right, up = np.abs(found.deflection_rad).max(axis=(0, 1))
    assert right > 1e-7 and up < 1e-3 * right
    # The density falls to the right, so light bends to the left there.
    assert found.deflection_rad[20, 36, 0] < 0


@pytest.mark.parametrize(
    "quantity, si, unit, value",
    [
        ("density", 1.2, "g/cm^3", 1.2e-3),
        ("density", 1.2, "kg m-3", 1.2),
        ("density", 1.2, "kg·m⁻³", 1.2),
        ("density", 1.225, 1.225, 1.0),
        ("pressure", 101325.0, "hPa", 1013.25),
        ("pressure", 101325.0, "atm", 1.0),
    ],
)
def test_units_by_name(quantity, si, unit, value):
    shape = warm(16) / 1.2
    rest = {"temperature": 293.0} if quantity == "pressure" else {}
    expected = schlieren.Field(**{quantity: si * shape}, **rest, spacing=0.01)
    found = schlieren.Field(
        **{quantity: value * shape, f"{quantity}_unit": unit}, **rest, spacing=0.01
    )
    np.testing.assert_allclose(
        render(found).deflection_rad, render(expected).deflection_rad, **CLOSE
    )


def test_gases_and_mixtures():
    density = warm(24)
    air = render(schlieren.Field(density=density, spacing=0.004))
    helium = render(
        schlieren.Field(density=density, species={"He": np.ones_like(density)}, spacing=0.004)
    )
    ratio = helium.report.largest_deflection_rad / air.report.largest_deflection_rad
    assert 0.8 < ratio < 0.9, "helium's Gladstone-Dale constant is 0.196 cm³/g, air's 0.226"
    given = render(schlieren.Field(density=density, species={0.452: 1.0}, spacing=0.004))
    ratio = given.report.largest_deflection_rad / air.report.largest_deflection_rad
    assert 1.99 < ratio < 2.01


def test_other_quantities():
    density = warm(24)
    n_minus_1 = schlieren.Field(n_minus_1=2.26e-4 * density, spacing=0.004)
    electrons = schlieren.Field(electrons=1e24 * (1.2 - density), spacing=0.004)
    curve = schlieren.Field(curves={"smoke": (density, [(1.1, 0), (1.2, 2e-5)])}, spacing=0.004)
    for of, formula in [(n_minus_1, "given"), (electrons, "plasma"), (curve, "multifield")]:
        report = render(of).report
        assert report.index_formula == formula and report.largest_deflection_rad > 1e-6


def test_media_are_layers():
    x = warm(24)
    of = schlieren.Field(density=x, absorption=20 * (1.2 - x), rotation=3.0, spacing=0.004)
    image = render(of, analyser_deg=90)
    assert image.optical_depth.max() > 0.01
    # The image is wider than the field.
    np.testing.assert_allclose(image.rotation_rad[:, 8:40], 3.0 * 23 * 0.004, rtol=1e-3)
    with pytest.raises(AttributeError, match="property of the medium"):
        image.emission


@pytest.mark.filterwarnings("ignore::schlieren.SchlierenWarning")
def test_two_dimensional_flows():
    flow = warm(33)[:, :, 16]
    spanned = render(schlieren.Field(density=flow, spacing=0.003, span=0.05))
    assert spanned.report.largest_deflection_rad > 1e-5
    revolved = schlieren.Field(density=flow[:, 16:], spacing=0.003, revolve=True)
    assert render(revolved, view="z").report.largest_deflection_rad > 1e-6


def test_places_without_data_are_refused_or_blank():
    density = warm(24)
    density[3, 4, 5] = np.nan
    with pytest.raises(ValueError, match=r"density\[3, 4, 5\] is nan.*nan='blank'"):
        schlieren.Field(density=density, spacing=0.004)
    of = schlieren.Field(density=density, spacing=0.004, nan="blank")
    with pytest.warns(schlieren.SchlierenWarning, match="blank"):
        assert render(of).transmission.min() == 0


def test_fields_say_what_they_are():
    info = field().info()
    assert info["kind"] == "ImageData" and info["arrays"][0]["name"] == "density"
    assert "density, ImageData of 35937 points, 0.1 x 0.1 x 0.1 m" in repr(field())
