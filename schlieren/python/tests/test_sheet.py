"""Contact sheets, overlays, and what a file does not say itself."""

import numpy as np
import pytest
from flows import field

import schlieren


def test_a_sheet_has_all_techniques_and_writes_them(tmp_path):
    sheet = schlieren.sheet(field(), size=(48, 40), tolerance_rad=1e-5)
    assert len(sheet.panels) == 12 and sheet.panels["bos"].shape == (40, 48, 3)
    assert "slit" in sheet.labels["knife-x"][1] and "--source" in sheet.options["knife-x"]
    assert sheet.report["bench"]["strong_rad"] > 0
    sheet.save(tmp_path / "sheet.png", title="warm")
    sheet.save(tmp_path / "sheet.exr")
    assert (tmp_path / "sheet.png").read_bytes()[:4] == b"\x89PNG"
    with pytest.raises(ValueError, match="png or .exr"):
        sheet.save(tmp_path / "sheet.npy")
    with pytest.raises(ValueError, match="one wavelength"):
        schlieren.sheet(field(), wavelength_nm=[500, 600])
    with pytest.raises(TypeError, match="technique"):
        schlieren.sheet(field(), technique="bos")


def test_an_overlay_is_drawn_on_the_png_alone(tmp_path):
    image = schlieren.render(field(), "bos", size=(80, 60), focus_m=1.0, tolerance_rad=1e-5)
    image.save(tmp_path / "plain.png")
    image.save(tmp_path / "arrows.png", overlay="arrows")
    image.save(tmp_path / "lic.png", overlay="lic:deflection")
    read = [(tmp_path / f"{n}.png").read_bytes() for n in ("plain", "arrows", "lic")]
    assert len(set(read)) == 3
    with pytest.raises(ValueError, match="arrows, lic"):
        image.save(tmp_path / "a.png", overlay="dots")
    with pytest.raises(ValueError, match="drawn on .png"):
        image.save(tmp_path / "a.exr", overlay="arrows")


def test_an_array_in_a_file_gets_its_place(tmp_path):
    density = np.full((8, 9, 10), 1.2)
    density[4, 4, 4] = 1.1
    np.save(tmp_path / "rho.npy", density)
    with pytest.raises(ValueError, match="give spacing"):
        schlieren.Field.open(tmp_path / "rho.npy", density="rho")
    path = tmp_path / "rho.npy"
    opened = schlieren.Field.open(path, density="rho", spacing=0.01, origin=(1, 2, 3))
    assert opened.info()["size"] == pytest.approx([0.07, 0.08, 0.09])


def test_jumps_become_averages_and_places_outside_are_decided():
    step = np.where(np.add.outer(np.arange(24), 0.4 * np.arange(24)) < 16, 1.2, 1.5)
    density = np.repeat(step[:, :, None], 4, 2)
    jumps = schlieren.Field(density=density, spacing=0.001, smoothing_nodes="auto")
    with pytest.warns(schlieren.SchlierenWarning, match="averages over cells"):
        schlieren.render(jumps, size=(24, 24), tolerance_rad=1e-3)
    with pytest.raises(ValueError, match="smoothing_nodes"):
        schlieren.Field(density=density, spacing=0.001, smoothing_nodes="some")
    with pytest.raises(ValueError, match="did you mean 'auto'"):
        schlieren.Field(density=density, spacing=0.001, outside="auot")
