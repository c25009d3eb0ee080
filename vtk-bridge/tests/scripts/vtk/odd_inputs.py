# Invalid inputs: NaN points, no points, no cells, no input, no mapper, cells with points out of
# range, zero scale, huge cells.
import math

import vtk

from capture import actor, look, save, window

ren = vtk.vtkRenderer()
ren.SetBackground(0.2, 0.1, 0.1)
ball = vtk.vtkSphereSource()
ball.SetThetaResolution(16)
ball.SetPhiResolution(16)
ren.AddActor(actor(ball, (0.7, 0.8, 0.9)))


def from_data(data, x):
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(data)
    made = vtk.vtkActor()
    made.SetMapper(mapper)
    made.SetPosition(x, 0, 0)
    ren.AddActor(made)
    return made


from_data(vtk.vtkPolyData(), 0)  # empty
lonely = vtk.vtkPolyData()
points = vtk.vtkPoints()
points.InsertNextPoint(0, 0, 0)
lonely.SetPoints(points)  # a point, but no cell
from_data(lonely, 0)
ren.AddActor(vtk.vtkActor())  # no mapper
idle = vtk.vtkActor()
idle.SetMapper(vtk.vtkPolyDataMapper())  # no input
flat = actor(ball, (1, 0, 0))
flat.SetScale(0, 0, 0)
ren.AddActor(flat)
degenerate = vtk.vtkPolyData()
points = vtk.vtkPoints()
for p in ((1, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)):
    points.InsertNextPoint(p)
cells = vtk.vtkCellArray()
for ids in ((0, 1, 2), (0, 2, 3), (0,), (0, 1), ()):
    cells.InsertNextCell(len(ids))
    for i in ids:
        cells.InsertCellPoint(i)
degenerate.SetPoints(points)
degenerate.SetPolys(cells)  # no area, too few corners, none
from_data(degenerate, 0)
win = window(200, 160, ren)
camera = look(ren, (0, -4, 1))
camera.SetFocalPoint(0, 0, 0)
camera.SetPosition(0, -4, 1)
camera.SetClippingRange(2, 7)
win.Render()
save(win, "odd")

# One corner is not a number: its triangles are invisible, all others are visible.
ball.Update()
torn = vtk.vtkPolyData()
torn.DeepCopy(ball.GetOutput())
torn.GetPoints().SetPoint(40, math.nan, 0, 0)
torn.GetPoints().SetPoint(90, math.inf, 0, 0)
ren.RemoveAllViewProps()
from_data(torn, 0)
camera.SetClippingRange(2, 7)
win.Render()
save(win, "not_a_number")
ren.RemoveAllViewProps()
camera.SetClippingRange(2, 7)
win.Render()
save(win, "nothing")
# A polygon of many corners, a concave one, a strip, and a quad.
many = vtk.vtkPolyData()
points, polys, strips = vtk.vtkPoints(), vtk.vtkCellArray(), vtk.vtkCellArray()
polys.InsertNextCell(40)
for i in range(40):
    r = 0.5 if i % 2 else 0.9
    polys.InsertCellPoint(points.InsertNextPoint(r * math.cos(i * math.pi / 20), 0, r * math.sin(i * math.pi / 20)))
strips.InsertNextCell(8)
for i in range(8):
    strips.InsertCellPoint(points.InsertNextPoint(1 + 0.2 * (i // 2), -0.2, -0.5 + 0.4 * (i % 2)))
polys.InsertNextCell(4)
for x, z in ((-1.4, -0.5), (-1.0, -0.5), (-1.1, 0.3), (-1.5, 0.4)):
    polys.InsertCellPoint(points.InsertNextPoint(x, 0, z))
many.SetPoints(points)
many.SetPolys(polys)
many.SetStrips(strips)
shape = from_data(many, 0)
shape.GetProperty().SetColor(0.5, 0.9, 0.6)
camera.SetClippingRange(2, 7)
win.Render()
save(win, "polygons")
