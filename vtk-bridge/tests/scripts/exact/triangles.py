# Few large triangles, and where their corners lie on the screen.
import vtk

from capture import actor, look, save, window

ren = vtk.vtkRenderer()
source = vtk.vtkSphereSource()
source.SetThetaResolution(3)
source.SetPhiResolution(4)
props = [actor(source, (0.9, 0.6, 0.3)), actor(source, (0.4, 0.6, 0.9))]
props[1].SetPosition(1.1, 0, 0)
for prop in props:
    ren.AddActor(prop)
win = window(240, 180, ren)
camera = look(ren, (0.5, -4, 1.5), (0.5, 0, 0))
camera.Zoom(1.2)
ren.ResetCameraClippingRange()
win.Render()
matrix = camera.GetCompositeProjectionTransformMatrix(ren.GetTiledAspectRatio(), -1, 1)
corners = []
for prop in props:
    data = prop.GetMapper().GetInput()
    for c in range(data.GetNumberOfCells()):
        for k in range(3):
            place = prop.GetMatrix().MultiplyPoint(data.GetPoint(data.GetCell(c).GetPointId(k)) + (1,))
            x, y, z, w = matrix.MultiplyPoint(place)
            corners += [x / w, y / w, z / w]
save(win, "triangles", corners=corners)
