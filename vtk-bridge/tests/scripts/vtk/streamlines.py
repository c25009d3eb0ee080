# Streamlines of a swirl as tubes and as lines.
import math

import vtk

from capture import actor, look, save, window

image = vtk.vtkImageData()
n = 13
image.SetDimensions(n, n, n)
image.SetOrigin(-1, -1, -1)
image.SetSpacing(2 / (n - 1), 2 / (n - 1), 2 / (n - 1))
velocity = vtk.vtkFloatArray()
velocity.SetName("velocity")
velocity.SetNumberOfComponents(3)
for i in range(image.GetNumberOfPoints()):
    x, y, z = image.GetPoint(i)
    velocity.InsertNextTuple3(-y, x, 0.3 + 0.1 * math.sin(3 * x))
image.GetPointData().SetVectors(velocity)
seeds = vtk.vtkLineSource()
seeds.SetPoint1(0.1, 0, -0.95)
seeds.SetPoint2(0.9, 0, -0.95)
seeds.SetResolution(6)
tracer = vtk.vtkStreamTracer()
tracer.SetInputData(image)
tracer.SetSourceConnection(seeds.GetOutputPort())
tracer.SetMaximumPropagation(20)
tracer.SetIntegratorTypeToRungeKutta4()
tube = vtk.vtkTubeFilter()
tube.SetInputConnection(tracer.GetOutputPort())
tube.SetRadius(0.03)
tube.SetNumberOfSides(10)
tubes = actor(tube)
tubes.GetMapper().SetScalarModeToUsePointFieldData()
tubes.GetMapper().SelectColorArray("IntegrationTime")
tubes.GetMapper().SetScalarRange(0, 7)
lines = actor(tracer, (1, 1, 0.6))
lines.SetPosition(2.2, 0, 0)
lines.GetProperty().SetLineWidth(2)
ren = vtk.vtkRenderer()
ren.AddActor(tubes)
ren.AddActor(lines)
win = window(420, 260, ren)
look(ren, (1.1, -6, 2.5), (1.1, 0, 0)).Zoom(1.3)
ren.ResetCameraClippingRange()
win.Render()
save(win, "streamlines", props=ren.GetNumberOfPropsRendered())
