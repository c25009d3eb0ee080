# Data that are hardly data. Each frame must end; what is finite must be seen.
import math

from vtkmodules.vtkCommonCore import vtkIdList, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkMultiBlockDataSet, vtkPolyData
from vtkmodules.vtkCommonCore import vtkFloatArray
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkRenderingCore import *
from vtkmodules.vtkRenderingOpenGL2 import vtkCompositePolyDataMapper2

ren = vtkRenderer()
win = vtkRenderWindow()
win.SetOffScreenRendering(1)
win.SetSize(120, 100)
win.AddRenderer(ren)


def covered():
    win.Render()
    z = vtkFloatArray()
    win.GetZbufferData(0, 0, 119, 99, z)
    return sum(z.GetValue(i) < 1 for i in range(z.GetNumberOfTuples()))


def polygons(points, cells):
    p = vtkPoints()
    for q in points:
        p.InsertNextPoint(*q)
    c = vtkCellArray()
    for cell in cells:
        ids = vtkIdList()
        for i in cell:
            ids.InsertNextId(i)
        c.InsertNextCell(ids)
    data = vtkPolyData()
    data.SetPoints(p)
    data.SetPolys(c)
    return data


mapper = vtkPolyDataMapper()
actor = vtkActor()
actor.SetMapper(mapper)
ren.AddActor(actor)
square = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
mapper.SetInputData(polygons(square, [(0, 1, 2), (0, 2, 3)]))
ren.ResetCamera()
whole = covered()
assert whole > 1000, whole

# One corner is not a number: the triangle without it remains.
nan = float("nan")
mapper.SetInputData(polygons(square[:3] + [(nan, 1, 0)], [(0, 1, 2), (0, 2, 3)]))
half = covered()
assert 0.3 * whole < half < 0.7 * whole, half

# Nothing at all, in every way.
for data in (vtkPolyData(), polygons([], []), polygons(square, []), polygons(square, [(0,), (0, 1)])):
    mapper.SetInputData(data)
    assert covered() == 0
mapper.RemoveAllInputConnections(0)
win.Render()

# Cells of points that do not exist are not drawn by us; OpenGL must not be asked to.
mapper.SetInputData(polygons(square, [(0, 1, 2), (0, 2, 3)]))

# Topology that changes in every frame.
sphere = vtkSphereSource()
mapper.SetInputConnection(sphere.GetOutputPort())
for i in range(12):
    sphere.SetThetaResolution(4 + 3 * i)
    sphere.SetPhiResolution(3 + 2 * (i % 5))
    assert covered() > 300

# Blocks that are empty, missing and nested.
blocks = vtkMultiBlockDataSet()
blocks.SetNumberOfBlocks(4)
blocks.SetBlock(1, vtkPolyData())
blocks.SetBlock(2, vtkMultiBlockDataSet())
sphere.Update()
blocks.SetBlock(3, sphere.GetOutput())
composite = vtkCompositePolyDataMapper2()
composite.SetInputDataObject(blocks)
actor.SetMapper(composite)
assert covered() > 300

# Matrices and properties that are no numbers.
actor.SetMapper(mapper)
for scale in ((0, 1, 1), (1e-300, 1, 1), (nan, 1, 1)):
    actor.SetScale(*scale)
    win.Render()
actor.SetScale(1, 1, 1)
actor.GetProperty().SetSpecularPower(nan)
actor.GetProperty().SetColor(nan, 0, 5)
win.Render()
print("survived")
