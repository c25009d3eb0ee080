# Many actors, renderers that go away, windows that change.
import gc

from vtkmodules.vtkCommonCore import vtkFloatArray
from vtkmodules.vtkFiltersSources import vtkConeSource
from vtkmodules.vtkRenderingCore import *
import vtkmodules.vtkRenderingOpenGL2


def window(width, height):
    win = vtkRenderWindow()
    win.SetOffScreenRendering(1)
    win.SetMultiSamples(0)
    win.SetSize(width, height)
    return win


def covered(win):
    win.Render()
    w, h = win.GetSize()
    z = vtkFloatArray()
    win.GetZbufferData(0, 0, w - 1, h - 1, z)
    low = z.GetRange()[0]
    return low < 1


cone = vtkConeSource()
ren = vtkRenderer()
assert ren.GetClassName() == "vtkRtvRenderer", ren.GetClassName()
actors = []
for i in range(500):
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(cone.GetOutputPort())
    actor = vtkActor()
    actor.SetMapper(mapper)
    actor.SetPosition(i % 25, i // 25, 0)
    ren.AddActor(actor)
    actors.append(actor)
first = window(200, 160)
first.AddRenderer(ren)
ren.ResetCamera()
assert covered(first)
for i in range(5):
    actors[i].SetPosition(i, 30, 0)
    actors[-1 - i].SetVisibility(False)
    assert covered(first)

# The same actors in a second window, then the first goes.
other = vtkRenderer()
for actor in actors[:40]:
    other.AddActor(actor)
second = window(100, 80)
second.AddRenderer(other)
other.ResetCamera()
assert covered(second) and covered(first)
first.RemoveRenderer(ren)
del ren
first.Finalize()
del first
gc.collect()
assert covered(second)

# Sizes.
for size in ((1, 1), (2, 700), (7680, 4320), (64, 48)):
    second.SetSize(*size)
    other.ResetCamera()
    covered(second)
assert covered(second)

# A renderer that moves to another window.
second.RemoveRenderer(other)
third = window(50, 50)
third.AddRenderer(other)
assert covered(third)
print("survived")
