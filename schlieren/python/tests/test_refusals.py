"""Bad input gets an exception of the right class that names field, value and cure."""

import re
import warnings

import numpy as np
import pytest
import schlieren
from flows import field, render, warm

DENSITY = warm(12)
NOT_FINITE = DENSITY.copy()
NOT_FINITE[1, 2, 3] = np.inf
MASKED = np.ma.masked_less(DENSITY, 1.19)
PLACE = {"spacing": 0.01}


@pytest.mark.parametrize(
    "given, error, parts",
    [
        ({}, ValueError, ["no array is given", "density"]),
        ({"density": 1.2}, ValueError, ["no array is given"]),
        ({"density": DENSITY, "spacing": None}, TypeError, ["spacing", "coordinates"]),
        ({"density": DENSITY, "spacing": -0.01}, ValueError, ["spacing", "-0.01", "numpy.flip"]),
        ({"density": DENSITY, "spacing": 0}, ValueError, ["spacing", "positive"]),
        ({"density": DENSITY, "spacing": (1, 2)}, ValueError, ["spacing", "(1, 2)", "3 numbers"]),
        ({"density": DENSITY, "spacing": np.nan}, ValueError, ["spacing", "nan"]),
        ({"density": DENSITY, "spacing": "1"}, ValueError, ["spacing", "'1'"]),
        ({"density": DENSITY, "origin": (0, 0)}, ValueError, ["origin", "(0, 0)", "3 numbers"]),
        ({"density": DENSITY[0, 0]}, ValueError, ["density", "(12,)", "(NX, NY, NZ)"]),
        ({"density": DENSITY[:1]}, ValueError, ["density", "(1, 12, 12)", "two nodes"]),
        ({"density": DENSITY[0]}, ValueError, ["density", "(12, 12)", "span", "revolve=True"]),
        ({"density": DENSITY.astype(complex)}, TypeError, ["density", "complex128", "float32"]),
        ({"density": DENSITY > 1}, TypeError, ["density", "bool"]),
        ({"density": "rho"}, TypeError, ["density", "'rho'", "Field.open"]),
        ({"density": [[[1, 2], [3]]]}, ValueError, ["density"]),
        ({"density": NOT_FINITE}, ValueError, ["density[1, 2, 3]", "inf", "nan='blank'"]),
        ({"density": MASKED}, ValueError, ["density", "masked", ".filled(numpy.nan)"]),
        ({"density": DENSITY, "nan": "skip"}, ValueError, ["nan", "'skip'", "'raise', 'blank'"]),
        (
            {"density": DENSITY, "density_unit": "kg/m"},
            ValueError,
            ["density_unit", "'kg/m'", "kg/m3"],
        ),
        ({"density": DENSITY, "length_unit": "mn"}, ValueError, ["length_unit", "'mn'"]),
        ({"density": DENSITY, "length_unit": 0}, ValueError, ["length_unit", "positive"]),
        (
            {"density": DENSITY, "pressure_unit": "Pa"},
            ValueError,
            ["pressure_unit", "leave one out"],
        ),
        ({"temperature": DENSITY * 300}, ValueError, ["temperature needs pressure: an array"]),
        ({"density": DENSITY, "temperature": DENSITY}, ValueError, ["alternatives"]),
        ({"density": DENSITY, "humidity": 0.5}, ValueError, ["humidity", "no effect"]),
        (
            {"density": DENSITY, "absorption": DENSITY[1:]},
            ValueError,
            ["absorption", "(11, 12, 12)", "density"],
        ),
        ({"density": DENSITY, "species": {"Unobtainium": DENSITY}}, ValueError, ["Unobtainium"]),
        ({"density": DENSITY, "species": ["He"]}, TypeError, ["species", "dictionary"]),
        ({"density": DENSITY, "species": {"He": 2}}, ValueError, ["species['He']", "0 to 1"]),
        ({"density": DENSITY, "smothing_nodes": 1}, TypeError, ["did you mean 'smoothing_nodes'"]),
        (
            {"density": DENSITY, "outside": "gass"},
            ValueError,
            ["outside", "'gass'", "did you mean 'gas'"],
        ),
        ({"density": DENSITY, "revolve": 1}, TypeError, ["revolve", "True or False"]),
        ({"density": DENSITY, "coordinates": (0, 1, 2)}, ValueError, ["spacing and coordinates"]),
    ],
)
def test_fields(given, error, parts):
    with pytest.raises(error) as caught:
        # Some are known only when the gas is looked through.
        render(schlieren.Field(**(PLACE | given)), size=(8, 8))
    assert type(caught.value) is error
    assert all(part in str(caught.value) for part in parts), caught.value


def test_coordinates():
    x = np.linspace(0, 1, 12)
    for coordinates, parts in [
        ((x, x), ["2 arrays", "3 axes"]),
        ((x, x[1:], x), ["coordinates[1]", "(11,)", "(12,)"]),
        ((x, x, np.where(x > 0.5, 0, x)), ["coordinates[2]", "rise, or fall"]),
        ((x, x, np.where(x > 0.5, np.nan, x)), ["coordinates[2]", "nan"]),
        (3, ["0 arrays"]),
    ]:
        with pytest.raises(ValueError) as caught:
            schlieren.Field(density=DENSITY, coordinates=coordinates)
        assert all(part in str(caught.value) for part in parts), caught.value


@pytest.mark.parametrize(
    "technique, options, error, parts",
    [
        ("schliern", {}, ValueError, ["technique", "'schliern'", "did you mean 'schlieren'"]),
        (3, {}, TypeError, ["technique", "3", "schlieren.BOS"]),
        ("schlieren", {"focus": 1}, TypeError, ["'focus'", "did you mean 'focus_m'"]),
        ("schlieren", {"size": (0, 5)}, ValueError, ["size[0]", "0", "1 to 16384"]),
        ("schlieren", {"size": 512}, ValueError, ["size", "512", "two numbers"]),
        ("schlieren", {"size": (5.5, 5)}, TypeError, ["size[0]", "5.5"]),
        ("schlieren", {"view": "w"}, ValueError, ["view", "'w'", "'x', 'y', 'z'"]),
        ("schlieren", {"view": (0, 100)}, ValueError, ["100"]),
        ("schlieren", {"wavelength_nm": -5}, ValueError, ["wavelength_nm", "-5"]),
        ("schlieren", {"wavelength_nm": []}, ValueError, ["wavelength_nm", "empty"]),
        ("schlieren", {"tolerance_rad": np.nan}, ValueError, ["tolerance_rad", "nan"]),
        ("schlieren", {"tolerance_rad": "fine"}, TypeError, ["tolerance_rad", "'fine'"]),
        ("schlieren", {"cutoff": "knive"}, ValueError, ["cutoff", "did you mean 'knife'"]),
        ("schlieren", {"cutoff": "image"}, ValueError, ["schlieren.FilterImage(...)"]),
        ("bos", {"cutoff": "knife"}, ValueError, ["cutoff", "no effect", "'bos'"]),
        ("schlieren", {"march": "verlett"}, ValueError, ["march", "verlett", "verlet"]),
        ("schlieren", {"step_voxels": -1}, ValueError, ["step_voxels", "-1"]),
        ("schlieren", {"layers": "depth"}, ValueError, ["layers", "'depth'", "'phase'"]),
        ("schlieren", {"threads": 0}, ValueError, ["threads", "0", "1 to 1024"]),
        ("schlieren", {"samples": 0}, ValueError, ["samples", "0"]),
        ("schlieren", {"samples": 4, "sampling": "beams"}, ValueError, ["samples", "sampling"]),
        ("schlieren", {"solids": ["none.obj"]}, OSError, ["none.obj"]),
        ("shadowgraph", {"focus_m": np.inf}, ValueError, ["focus_m", "inf"]),
        ("interferogram", {"analyser_deg": 90}, ValueError, ["analyser_deg", "rotation"]),
    ],
)
def test_arguments_of_render(technique, options, error, parts):
    with pytest.raises(error) as caught:
        schlieren.render(field(12), technique, **options)
    assert all(part in str(caught.value) for part in parts), caught.value


@pytest.mark.parametrize(
    "make, error, parts",
    [
        (lambda: schlieren.Knife(np.nan), ValueError, ["Knife.angle_deg", "nan"]),
        (lambda: schlieren.Circle("1"), TypeError, ["Circle.radius_m", "'1'"]),
        (lambda: schlieren.Circle(1e-3, (1, 2, 3)), ValueError, ["Circle.center_m", "2 numbers"]),
        (lambda: schlieren.Schlieren("knife"), TypeError, ["Schlieren.cutoff", "Knife()"]),
        (lambda: schlieren.Photons(filter="box"), ValueError, ["Photons.filter", "gaussian:0.8"]),
        (lambda: schlieren.Photons(jitter="blue"), ValueError, ["Photons.jitter", "'sobol'"]),
        (lambda: schlieren.BOS(seed=1.5), TypeError, ["BOS.seed", "1.5"]),
        (lambda: render(field(12), schlieren.Schlieren(schlieren.Circle(-1))), ValueError, ["-1"]),
        (lambda: render(field(12), schlieren.Interferogram(2)), ValueError, ["visibility", "2"]),
        (lambda: render(np.ones((4, 4, 4))), TypeError, ["field", "ndarray", "schlieren.Field"]),
        (lambda: schlieren.Field.open("none.vti", density="rho"), FileNotFoundError, ["none.vti"]),
        (lambda: schlieren.Field.from_vtk(3, density="rho"), TypeError, ["int", "VTK"]),
        (lambda: schlieren.Field.from_xarray(3, density="rho"), TypeError, ["int", "xarray"]),
    ],
)  # fmt: skip
def test_other_arguments(make, error, parts):
    with pytest.raises(error) as caught:
        make()
    assert all(part in str(caught.value) for part in parts), caught.value


def test_files_that_are_no_flow(tmp_path):
    (tmp_path / "a.vti").write_text("<VTKFile")
    with pytest.raises(ValueError, match=r"a\.vti"):
        schlieren.Field.open(tmp_path / "a.vti", density="rho")
    field(12).write(tmp_path / "b.vti")
    of = schlieren.Field.open(tmp_path / "b.vti", density="rho")
    with pytest.raises(ValueError, match="no array `rho`.*`density`"):
        render(of)


FOREIGN = re.compile(r"--[a-z]|\b(flow|light|film|march|media|lenses|sampling)\.\w")


def test_sentences_name_what_is_there():
    """Warnings and errors of the library name arguments of this package."""
    cases = [
        lambda: render(field(12), tolerance_rad=1e-15),
        lambda: render(schlieren.Field(density=warm(12) / warm(12).max(), spacing=0.01)),
        lambda: render(schlieren.Field(density=warm(12) * 0 + 1.2, spacing=0.01)),
        lambda: render(schlieren.Field(density=warm(12) * 0 + 1.2, spacing=0.01), "shadowgraph"),
        lambda: render(schlieren.Field(density=NOT_FINITE * 1.0, spacing=0.01, nan="blank")),
        lambda: render(schlieren.Field(density=1e4 * warm(12), spacing=0.01)),
        lambda: render(schlieren.Field(temperature=20 + 0 * warm(12), pressure=1.0, spacing=0.01)),
        lambda: render(schlieren.Field(density=warm(12)[0], spacing=0.01, revolve=True)),
        lambda: render(field(12), "slice", skip_rad=1e-9),
        lambda: render(field(12), "shadowgraph", stop_m=0.1),
        lambda: render(field(12), "bos", source="slit"),
        lambda: render(field(12), "slice", focus_m=1.0),
        lambda: render(field(12), march="x"),
    ]
    told = []
    for case in cases:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                case()
            except ValueError as error:
                told.append(str(error))
        told += [str(w.message) for w in caught]
    assert len(told) >= len(cases)
    foreign = [text for text in told if FOREIGN.search(text)]
    assert not foreign, "\n".join(foreign)


def test_no_number_crosses_as_a_panic():
    """Extreme arguments give an image or one of Python's own errors, never a RuntimeError."""
    of = field(8)
    extremes = [0, -1, 1e-300, 1e300, -1e300, 5e-324, 1.5]
    names = [
        "wavelength_nm", "collimator_m", "schlieren_lens_m", "field_of_view_m", "focus_m",
        "exposure", "tolerance_rad", "step_voxels", "skip_rad", "reference_n_minus_1",
    ]  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in names:
            for value in extremes:
                # Steps of 1e-300 voxels would take for ever.
                if name == "step_voxels" and abs(value) < 1e-3:
                    continue
                for technique in ("schlieren", "shadowgraph", "bos", "interferogram"):
                    try:
                        render(of, technique, size=(3, 2), **{name: value})
                    except ValueError:
                        pass
        for scale in (0, -1, 1e-30, 1e30, 1e300):
            for technique in ("schlieren", "volume"):
                try:
                    render(
                        schlieren.Field(density=warm(8) * scale, spacing=0.01),
                        technique,
                        size=(3, 2),
                    )
                except ValueError:
                    pass
        for spacing in (1e-300, 1e-30, 1e30, 1e300):
            try:
                render(schlieren.Field(density=warm(8), spacing=spacing), size=(3, 2))
            except ValueError:
                pass
