# A ball in front of a background that is yellow below and blue above.
import vtk

from capture import actor, save, window

ren = vtk.vtkRenderer()
ren.SetBackground(0.9, 0.8, 0.1)
ren.SetBackground2(0.1, 0.2, 0.9)
ren.GradientBackgroundOn()
ball = vtk.vtkSphereSource()
ball.SetThetaResolution(64)
ball.SetPhiResolution(64)
ball.SetRadius(1)
ren.AddActor(actor(ball, (0.95, 0.95, 0.95)))
win = window(200, 200, ren)
camera = ren.GetActiveCamera()
camera.SetPosition(0, -6, 0)
camera.SetFocalPoint(0, 0, 0)
camera.SetViewUp(0, 0, 1)
ren.ResetCameraClippingRange()
win.Render()
save(win, "ball")
