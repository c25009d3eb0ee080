# Clipping planes on mappers: one, three, on a moved actor, and on translucent and back-faced surfaces.
import vtk

from capture import actor, look, save, window

ren = vtk.vtkRenderer()
ren.SetBackground(0.2, 0.2, 0.3)
ball = vtk.vtkSphereSource()
ball.SetThetaResolution(40)
ball.SetPhiResolution(40)


def plane(origin, normal):
    made = vtk.vtkPlane()
    made.SetOrigin(origin)
    made.SetNormal(normal)
    return made


half = actor(ball, (0.9, 0.3, 0.2))
half.GetMapper().AddClippingPlane(plane((0, 0, 0.1), (0.3, 0.2, -1)))
corner = actor(ball, (0.3, 0.8, 0.2))
corner.SetPosition(1.2, 0, 0)
corner.RotateZ(20)
for normal in ((-1, 0, 0), (0, 1, 0), (0, 0, -1)):
    corner.GetMapper().AddClippingPlane(plane((1.3, -0.1, 0.1), normal))
inside = actor(ball, (0.2, 0.4, 0.9))
inside.SetPosition(0.6, 1.1, 0)
inside.SetScale(1, 0.8, 1.2)
inside.GetMapper().AddClippingPlane(plane((0.6, 1.1, 0), (0, 0.5, -1)))
back = vtk.vtkProperty()
back.SetColor(1, 0.9, 0.1)
inside.SetBackfaceProperty(back)
for prop in (half, corner, inside):
    ren.AddActor(prop)
win = window(360, 300, ren)
look(ren, (0.6, -2, 4), (0.6, 0.4, 0)).Zoom(1.4)
ren.ResetCameraClippingRange()
win.Render()
save(win, "clipping")
half.GetMapper().RemoveAllClippingPlanes()
corner.GetMapper().GetClippingPlanes().GetItem(0).SetOrigin(1.0, 0, 0)
win.Render()
save(win, "moved")
