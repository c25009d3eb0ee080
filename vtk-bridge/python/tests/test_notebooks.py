"""Notebooks with PyVista: what the static backend and the server show is ray traced."""

import base64
import io
import json

import numpy as np
import pytest

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("pyvista")

SETUP = """
import rtvtk, pyvista
pyvista.OFF_SCREEN = True

def plotter(traced):
    made = pyvista.Plotter(notebook=True, off_screen=True, window_size=(320, 240))
    made.add_mesh(pyvista.Sphere(theta_resolution=60, phi_resolution=60), color="white")
    made.add_mesh(pyvista.Plane(center=(0, 0, -0.6), i_size=3, j_size=3), color="white")
    made.remove_all_lights()
    made.add_light(pyvista.Light(position=(3, 1, 4), light_type="scene light"))
    made.camera_position = [(0, -4, 2.5), (0, 0, -0.2), (0, 0, 1)]
    if traced:
        rtvtk.enable(made, shadows=True, always_trace=True)
    else:
        rtvtk.disable(made)
    return made
"""


def executed(*cells):
    """The outputs of the cells of a notebook that a kernel has run."""
    notebook = nbformat.v4.new_notebook()
    notebook.cells = [nbformat.v4.new_code_cell(cell) for cell in (SETUP, *cells)]
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    return [cell.outputs for cell in notebook.cells[1:]]


def grey(data):
    """Luminance of a PNG or JPEG file."""
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(data)).convert("L"), dtype=int)


def darker(one, other):
    """Number of pixels that are much darker in the second."""
    return int((one > other + 40).sum())


def test_the_static_backend_shows_the_traced_picture():
    shown = "plotter({}).show(jupyter_backend='static', return_viewer=False)"
    outputs = executed(shown.format(False), shown.format(True))
    images = []
    for cell in outputs:
        pictures = [o["data"]["image/png"] for o in cell if "image/png" in o.get("data", {})]
        assert len(pictures) == 1, cell
        images.append(grey(base64.b64decode(pictures[0])))
    assert images[0].shape == images[1].shape == (240, 320)
    assert darker(*images) > 300 and darker(*images[::-1]) < 30


SERVER = """
import base64, json
from vtkmodules.vtkWebCore import vtkWebApplication

def sent(traced):
    made = plotter(traced)
    widget = made.show(jupyter_backend="server", return_viewer=True)
    # What trame's remote view sends to the browser.
    application = vtkWebApplication()
    application.SetImageEncoding(0)
    picture = application.StillRenderToBuffer(made.render_window, 0, 95)
    return type(widget).__name__, base64.b64encode(memoryview(picture)).decode()

print(json.dumps([sent(False), sent(True)]))
"""


def test_trames_server_sends_the_traced_picture():
    pytest.importorskip("trame_pyvista")
    (outputs,) = executed(SERVER)
    text = "".join(o["text"] for o in outputs if o.get("name") == "stdout")
    found = json.loads(text[text.index("[[") :])
    # An image would be the static backend, which PyVista falls back to without trame.
    assert [widget for widget, _ in found] == ["Widget"] * 2, found
    images = [grey(base64.b64decode(data)) for _, data in found]
    assert darker(*images) > 300 and darker(*images[::-1]) < 30
