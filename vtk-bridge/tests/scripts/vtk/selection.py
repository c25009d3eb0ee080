# What is picked and selected must not depend on who draws.
from vtkmodules.vtkRenderingCore import *
import vtkmodules.vtkRenderingOpenGL2, vtkmodules.vtkRenderingFreeType, vtkmodules.vtkInteractionStyle
from vtkmodules.vtkFiltersSources import vtkConeSource, vtkSphereSource

ren = vtkRenderer()
actors = []
for i, source in enumerate((vtkSphereSource(), vtkConeSource())):
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    actor = vtkActor()
    actor.SetMapper(mapper)
    actor.SetPosition(1.2 * i, 0, 0)
    ren.AddActor(actor)
    actors.append(actor)
win = vtkRenderWindow()
win.SetOffScreenRendering(1)
win.SetMultiSamples(0)
win.SetSize(320, 240)
win.AddRenderer(ren)
ren.ResetCamera()
win.Render()
answers = []
prop, cell, world, points = vtkPropPicker(), vtkCellPicker(), vtkWorldPointPicker(), []
for x, y in [(80, 120), (100, 100), (230, 120), (250, 118), (5, 5)]:
    prop.Pick(x, y, 0, ren)
    cell.Pick(x, y, 0, ren)
    world.Pick(x, y, 0, ren)
    which = actors.index(prop.GetActor()) if prop.GetActor() else -1
    answers.append([which, cell.GetCellId(), [round(c, 4) for c in world.GetPickPosition()]])
selector = vtkHardwareSelector()
selector.SetRenderer(ren)
selector.SetFieldAssociation(1)
selector.SetArea(60, 60, 260, 180)
selection = selector.Select()
for n in range(selection.GetNumberOfNodes()):
    ids = selection.GetNode(n).GetSelectionList()
    answers.append(sorted(ids.GetValue(i) for i in range(ids.GetNumberOfTuples())))
win.Render()
