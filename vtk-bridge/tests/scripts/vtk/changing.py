# New topology every frame; actors that are added, removed, hidden, moved and recoloured; the same
# data in two actors.
import vtk

from capture import actor, look, save, window

ren = vtk.vtkRenderer()
ren.SetBackground(0.1, 0.2, 0.3)
source = vtk.vtkSphereSource()
first, second = actor(source, (0.9, 0.6, 0.3)), actor(source, (0.4, 0.6, 0.9))
second.SetPosition(1.1, 0, 0)
ren.AddActor(first)
ren.AddActor(second)
win = window(240, 180, ren)
look(ren, (0.5, -4, 1.5), (0.5, 0, 0)).Zoom(1.2)
ren.ResetCameraClippingRange()
for resolution in (3, 4, 30, 8, 5):
    source.SetThetaResolution(resolution)
    source.SetPhiResolution(resolution + 1)
    win.Render()
    save(win, "topology_%d" % resolution)
second.RotateX(50)
second.SetScale(0.5, 1, 1.5)
first.GetProperty().SetColor(0.2, 0.9, 0.2)
win.Render()
save(win, "moved")
first.VisibilityOff()
win.Render()
save(win, "hidden")
first.VisibilityOn()
ren.RemoveActor(second)
win.Render()
save(win, "removed")
# Points that move in place.
points = vtk.vtkPolyData()
source.Update()
points.DeepCopy(source.GetOutput())
first.GetMapper().SetInputDataObject(points)
win.Render()
for i in range(points.GetNumberOfPoints()):
    x, y, z = points.GetPoint(i)
    points.GetPoints().SetPoint(i, x * 0.5, y, z * 1.3)
points.GetPoints().Modified()
points.GetPointData().SetNormals(None)
win.Render()
save(win, "deformed")
