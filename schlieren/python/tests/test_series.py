"""Sweeps, series, probes and the index."""

import numpy as np
import pytest
import schlieren
from flows import TOLERANCE_RAD, field, render, same, warm

OPTIONS = {"size": (48, 40), "tolerance_rad": TOLERANCE_RAD, "layers": "all"}


@pytest.mark.parametrize(
    "argument, values, technique",
    [
        ("focus_m", [0.2, 0.4], "shadowgraph"),
        ("view", ["x", (30, 10), "z"], "schlieren"),
        ("wavelength_nm", [500, 633], "interferogram"),
        ("technique", ["bos", schlieren.Schlieren(schlieren.Circle())], "schlieren"),
    ],
)
@pytest.mark.filterwarnings("ignore::schlieren.SchlierenWarning")
def test_sweeps_have_the_bits_of_single_images(argument, values, technique):
    images = list(schlieren.sweep(field(), argument, values, technique, **OPTIONS))
    assert [i.swept for i in images] == values
    for image, value in zip(images, values):
        assert same(image, render(field(), **({"technique": technique} | {argument: value})))


def test_sweeps_change_parts_of_parts():
    angles = [0.0, 90.0]
    for argument, options in [
        ("cutoff.angle_deg", {}),
        ("technique.cutoff.angle_deg", {"technique": schlieren.Schlieren()}),
    ]:
        images = schlieren.sweep(field(), argument, angles, **options, **OPTIONS)
        for image, angle in zip(images, angles, strict=True):
            assert same(image, render(field(), cutoff=schlieren.Knife(angle)))
    with pytest.raises(ValueError, match="'cutoff.angle'.*did you mean 'angle_deg'"):
        next(schlieren.sweep(field(), "cutoff.angle", angles))
    with pytest.raises(ValueError, match="did you mean 'focus_m'"):
        schlieren.sweep(field(), "focus", angles)


@pytest.mark.filterwarnings("ignore::schlieren.SchlierenWarning")
def test_steps_of_a_stream_are_relative_to_the_first_and_come_one_by_one():
    made = []

    def steps():
        for density in (1.0, 1.1):
            made.append(density)
            yield schlieren.Field(density=warm(24) * density, spacing=0.004)

    images = schlieren.stream(steps(), "interferogram", **OPTIONS)
    assert made == []
    first, second = next(images), next(images)
    assert made == [1.0, 1.1]
    assert second.report.reference_n_minus_1 == first.report.reference_n_minus_1
    # Ten per cent more gas on 92 mm of path.
    path_m = 0.1 * first.report.reference_n_minus_1 * 0.004 * 23
    waves = path_m / 633e-9
    more = second.phase_waves[2, 24] - first.phase_waves[2, 24]
    np.testing.assert_allclose(more, waves, rtol=0.02)


def test_series_of_files(tmp_path):
    paths = []
    for i in range(2):
        paths.append(tmp_path / f"{i}.vti")
        schlieren.Field(density=warm(20) * (1 + i), spacing=0.005).write(paths[-1])
    images = list(schlieren.stream(schlieren.series(paths, density="density"), **OPTIONS))
    ratio = images[1].report.largest_deflection_rad / images[0].report.largest_deflection_rad
    assert abs(ratio - 2) < 0.01


def test_probes_are_rays_of_the_image():
    image = render(field())
    for x, y in [(10, 20), (30, 12)]:
        options = {k: v for k, v in OPTIONS.items() if k != "layers"}
        ray = schlieren.probe(field(), (x + 0.5, y + 0.5), **options)
        np.testing.assert_allclose(
            ray.deflection_rad, image.deflection_rad[y, x], rtol=1e-5, atol=1e-12
        )
        assert ray.status == "free" and ray.transmission == 1
    with pytest.raises(ValueError, match="traces no light"):
        schlieren.probe(field(), (1, 1), "slice")


def test_index_for_numbers_and_arrays():
    # A row of NIST's table: 40 C, 120 kPa, 75 % humidity.
    one = schlieren.index(temperature_c=40, pressure_pa=120e3, humidity=0.75)
    assert isinstance(one.n_minus_1, float) and abs(one.n_minus_1 - 2.99418e-4) < 1e-9
    assert one.model == "ciddor"
    many = schlieren.index(
        temperature_c=[[40], [20]], pressure_pa=[120e3, 100e3, 90e3], humidity=0.75
    )
    assert many.n_minus_1.shape == (2, 3) and many.n_minus_1[0, 0] == one.n_minus_1
    methane = schlieren.index(species={"CH4": [0.0, 0.5]})
    assert methane.n_minus_1[1] > methane.n_minus_1[0]
    with pytest.raises(ValueError, match="unobtainium"):
        schlieren.index(species={"unobtainium": 0.1})
    with pytest.raises(ValueError, match="shapes do not fit"):
        schlieren.index(temperature_c=[1, 2], pressure_pa=[1, 2, 3])
    with pytest.warns(schlieren.SchlierenWarning):
        schlieren.index(temperature_c=150, model="ciddor")
