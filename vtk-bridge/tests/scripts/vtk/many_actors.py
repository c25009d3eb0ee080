# Five hundred actors, some of them translucent and some instances of the same data.
import vtk

from capture import actor, look, save, window

ren = vtk.vtkRenderer()
ball, box = vtk.vtkSphereSource(), vtk.vtkCubeSource()
for i in range(500):
    if i % 3:
        made = actor(ball if i % 2 else box, ((i * 37 % 100) / 100, (i * 53 % 100) / 100, 0.5))
    else:
        own = vtk.vtkConeSource()
        own.SetResolution(3 + i % 9)
        made = actor(own, (0.9, (i * 53 % 100) / 100, 0.2))
    made.SetPosition(i % 25, i // 25, (i * 7 % 11) * 0.2)
    made.SetScale(0.6)
    made.RotateX(i * 17)
    ren.AddActor(made)
win = window(400, 320, ren)
look(ren, (12, -15, 25), (12, 10, 0)).Zoom(1.3)
ren.ResetCameraClippingRange()
win.Render()
save(win, "many", props=ren.GetNumberOfPropsRendered())
