"""Images: layers, files, reports, plots."""

import sys
import warnings

import numpy as np
import pytest
import schlieren
from flows import TOLERANCE_RAD, field, render, same, warm


@pytest.mark.parametrize(
    "technique",
    [
        "schlieren", "shadowgraph", "interferogram", "bos",
        schlieren.Schlieren(schlieren.Circle(2e-4)),
        schlieren.Schlieren(schlieren.ComplementedCircle(2e-4)),
        schlieren.Schlieren(schlieren.ColorWheel()),
        schlieren.Schlieren(
            schlieren.Painting(
                (2e-3, 2e-3), (0.1, 0.1, 0.1), [schlieren.Stroke((0, 0), (1e-3, 0), 4e-4)]
            )
        ),
        schlieren.Interferogram(fringe_spacing_m=5e-3, fringe_angle_deg=45),
        schlieren.BOS(dot_diameter_m=2e-3, seed=7),
    ],
    ids=lambda t: t if isinstance(t, str) else type(getattr(t, "cutoff", t)).__name__,
)  # fmt: skip
def test_every_technique_shows_the_flow(technique):
    # Ten times as dense, so that every technique is sensitive enough.
    of = schlieren.Field(density=10 * warm(), spacing=0.1 / 32)
    still = schlieren.Field(density=12 + 0 * warm(), spacing=0.1 / 32)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", schlieren.SchlierenWarning)
        image, background = render(of, technique), render(still, technique)
    assert np.isfinite(image.brightness).all()
    assert np.abs(image.brightness - background.brightness).max() > 0.01


def test_layers_have_shapes_and_units():
    image = render(field())
    assert image.brightness.shape == (40, 48) and image.brightness.dtype == np.float32
    assert image.deflection_rad.shape == image.displacement_m.shape == (40, 48, 2)
    assert image.phase_waves.shape == image.transmission.shape == (40, 48)
    assert image.photons.dtype == np.uint32 and image.photons.sum() > 40 * 48
    assert render(field(), cutoff="color").brightness.shape == (40, 48, 3)
    assert render(field(), "bos").apparent_displacement_m.shape == (40, 48, 2)
    left, right, bottom, top = image.extent_m
    assert abs(right - left - 48 * image.pixel_m) < 1e-12 and top > bottom
    plain = render(field(), layers=())
    assert plain.layers == ("brightness",)
    with pytest.raises(AttributeError, match="layers='phase'"):
        plain.phase_waves
    with pytest.raises(AttributeError, match="did you mean 'noise'"):
        plain.nois


def test_reports_tell_the_tolerance_that_was_asked_for_and_got():
    report = render(field()).report
    assert report.tolerance_rad == TOLERANCE_RAD
    assert 0 < report.deflection_error_rad < TOLERANCE_RAD and report.warnings == ()
    assert report.counters["rays"] > 0 and report.grid == (33, 33, 33)
    with pytest.warns(schlieren.SchlierenWarning, match="tolerance_rad") as caught:
        image = render(field(), tolerance_rad=1e-12)
    assert caught[0].filename.endswith("flows.py"), "the warning names the caller's line"
    assert [str(w.message) for w in caught] == list(image.report.warnings)


def test_files(tmp_path):
    image = render(field())
    for name in ("a.png", "a.exr", "a.npy"):
        image.save(tmp_path / name)
    png = (tmp_path / "a.png").read_bytes()
    assert png == image._repr_png_() and png.startswith(b"\x89PNG")
    np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), image.deflection_rad)
    assert b"deflection.X" in (tmp_path / "a.exr").read_bytes()
    with pytest.raises(ValueError, match=r"a\.tif.*\.png, \.exr or \.npy"):
        image.save(tmp_path / "a.tif")
    with pytest.raises(OSError, match="none"):
        image.save(tmp_path / "none" / "a.png")
    with pytest.raises(ValueError, match="layers='deflection'"):
        render(field(), layers=()).save(tmp_path / "b.npy")


def test_scenes_are_files_of_the_program():
    scene = render(field(), cutoff=schlieren.Knife(30), view=(10, 20)).scene
    assert "angle_deg = 30.0" in scene and 'direction = "10,20"' in scene
    assert 'density = "density"' in scene


def test_plots():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    image = render(field())
    for layer in image.layers:
        axes = image.plot(layer)
        assert axes.get_xlabel() == "mm"
        matplotlib.pyplot.close(axes.figure)
    shown = image.plot("deflection_rad", component="up").images[0].get_array()
    np.testing.assert_array_equal(shown, image.deflection_rad[..., 1])
    matplotlib.pyplot.close("all")
    with pytest.raises(ValueError, match="component has no effect"):
        image.plot(component="up")


def test_plots_without_matplotlib_say_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ImportError, match="pip install matplotlib"):
        render(field()).plot()


def test_notebooks_get_a_picture_once(monkeypatch):
    import types

    shown = []
    shell = types.SimpleNamespace(config={"IPKernelApp": {}})
    module = types.SimpleNamespace(get_ipython=lambda: shell)
    display = types.SimpleNamespace(display=shown.append)
    monkeypatch.setitem(sys.modules, "IPython", module)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    assert schlieren.show(field(), size=(16, 16), tolerance_rad=TOLERANCE_RAD) is None
    assert len(shown) == 1 and shown[0]._repr_png_().startswith(b"\x89PNG")


def test_what_is_kept_can_be_forgotten():
    of = field()
    image = render(of)
    of.forget()
    assert same(render(of), image)
