"""Options by keyword arguments: for all renderers, for those of one window, and refused ones.

`tests/pip_wheel.rs` runs it; it ends with 0 and says what it has seen.
"""
import gc
import os
import sys

import numpy as np
import rtvtk
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkFiltersSources import vtkPlaneSource, vtkSphereSource
from vtkmodules.vtkRenderingCore import (
    vtkActor,
    vtkLight,
    vtkPolyDataMapper,
    vtkRenderer,
    vtkRenderWindow,
    vtkWindowToImageFilter,
)


def scene():
    """A ball above a plane, lit from the side."""
    renderer, window = vtkRenderer(), vtkRenderWindow()
    plane, ball = vtkPlaneSource(), vtkSphereSource()
    plane.SetOrigin(-2, -2, -0.6)
    plane.SetPoint1(2, -2, -0.6)
    plane.SetPoint2(-2, 2, -0.6)
    ball.SetThetaResolution(64)
    ball.SetPhiResolution(64)
    for source in (ball, plane):
        mapper, actor = vtkPolyDataMapper(), vtkActor()
        mapper.SetInputConnection(source.GetOutputPort())
        actor.SetMapper(mapper)
        renderer.AddActor(actor)
    light = vtkLight()
    light.SetPosition(3, -1, 4)
    renderer.AddLight(light)
    renderer.GetActiveCamera().SetPosition(0, -4, 3)
    renderer.ResetCamera()
    window.SetOffScreenRendering(True)
    window.SetSize(160, 120)
    window.AddRenderer(renderer)
    return window, renderer


def picture(window):
    window.Render()
    grab = vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    grab.Update()
    return vtk_to_numpy(grab.GetOutput().GetPointData().GetScalars()).astype(int)


def darker(one, other):
    """Number of pixels that are darker in the second."""
    return int((one[:, 1] > other[:, 1] + 20).sum())


def refused(error, part, *args, **options):
    try:
        rtvtk.enable(*args, **options)
    except error as raised:
        assert part in str(raised), raised
        return
    raise AssertionError(f"{options} was not refused")


rtvtk.disable()
(first, _), (second, _) = scene(), scene()
stock = picture(first)
assert (stock == picture(second)).all()

# For all.
rtvtk.enable(shadows=True, samples=4)
assert min(darker(stock, picture(w)) for w in (first, second)) > 100
# Options that a call does not name are the defaults again.
rtvtk.enable(ao=16)
no_shadow = darker(stock, picture(first))
rtvtk.disable()
assert (picture(first) == stock).all() and (picture(second) == stock).all()

# For one window, by itself or by a plotter that has it.
rtvtk.enable(first, shadows=True)
assert darker(stock, picture(first)) > 100 and (picture(second) == stock).all()
rtvtk.disable(first)
assert (picture(first) == stock).all()


class Plotter:
    render_window = second


rtvtk.enable(Plotter(), shadows=np.True_, ao=np.int64(4), light_size=np.float32(1.5))
assert darker(stock, picture(second)) > 100 and (picture(first) == stock).all()
# For all, except for what was set for one.
rtvtk.enable()
assert darker(stock, picture(second)) > 100
rtvtk.disable()
assert (picture(first) == stock).all() and (picture(second) == stock).all()

# A call that is refused sets nothing.
refused(TypeError, "did you mean 'shadows'?", shadow=True)
refused(TypeError, "give True or False", shadows="yes")
refused(ValueError, "ao is -3; give 0 to 4096", shadows=True, ao=-3)
refused(ValueError, "material is 'wood'", material="wood")
refused(TypeError, "ao is True", ao=True)
refused(TypeError, "plotter is of type int", 3)
assert (picture(first) == stock).all()

# Renderers that are gone are forgotten.
del first
gc.collect()
rtvtk.disable()
os.environ["RTV_SHADOWS"] = "1"
rtvtk.enable(second, report=None)
assert darker(stock, picture(second)) > 100, "the environment's options stay"
print(f"options: {no_shadow} pixels darker by occlusion", file=sys.stdout)
