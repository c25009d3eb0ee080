# The same picture at every size of the domain, and far from zero (VisIt's issue 20271: a blank window at 1e20).
from vtkmodules.vtkCommonCore import vtkFloatArray, vtkUnsignedCharArray
from vtkmodules.vtkCommonTransforms import vtkTransform
from vtkmodules.vtkFiltersGeneral import vtkTransformPolyDataFilter
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkRenderingCore import *
import vtkmodules.vtkRenderingOpenGL2


def picture(scale, center):
    sphere = vtkSphereSource()
    sphere.SetThetaResolution(30)
    sphere.SetPhiResolution(20)
    sphere.SetOutputPointsPrecision(1)
    sphere.SetRadius(scale)
    sphere.SetCenter(*(c * scale for c in center))
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(sphere.GetOutputPort())
    actor = vtkActor()
    actor.SetMapper(mapper)
    ren = vtkRenderer()
    ren.AddActor(actor)
    win = vtkRenderWindow()
    win.SetOffScreenRendering(1)
    win.SetMultiSamples(0)
    win.SetSize(100, 100)
    win.AddRenderer(ren)
    camera = ren.GetActiveCamera()
    camera.SetFocalPoint(*(c * scale for c in center))
    camera.SetPosition(center[0] * scale, (center[1] - 5) * scale, (center[2] + 2) * scale)
    camera.SetViewUp(0, 0, 1)
    camera.SetClippingRange(3 * scale, 8 * scale)
    win.Render()
    rgb = vtkUnsignedCharArray()
    win.GetRGBACharPixelData(0, 0, 99, 99, 0, rgb)
    return [rgb.GetValue(i) for i in range(rgb.GetNumberOfValues())]


expected = picture(1.0, (0, 0, 0))
assert sum(v > 50 for v in expected) > 3000
failures = []
for scale in (1e-20, 1e-12, 1e-6, 1e6, 1e12, 1e20):
    found = picture(scale, (0, 0, 0))
    apart = sum(abs(a - b) > 2 for a, b in zip(expected, found)) / len(expected)
    if apart > 0.002:
        failures.append((scale, apart))
for center in ((1e4, 0, 0), (1e6, -1e6, 1e6), (1e9, 0, 0)):
    found = picture(1.0, center)
    apart = sum(abs(a - b) > 2 for a, b in zip(expected, found)) / len(expected)
    if apart > 0.002:
        failures.append((center, apart))
assert not failures, failures
print("survived")
