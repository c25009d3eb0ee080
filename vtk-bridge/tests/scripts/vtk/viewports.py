# Two renderers side by side with different cameras, backgrounds and actors, and a third with a gradient.
import vtk

from capture import actor, look, save, window

ball = vtk.vtkSphereSource()
ball.SetThetaResolution(30)
box = vtk.vtkCubeSource()
left, right, low = vtk.vtkRenderer(), vtk.vtkRenderer(), vtk.vtkRenderer()
left.SetViewport(0, 0.4, 0.5, 1)
right.SetViewport(0.5, 0.4, 1, 1)
low.SetViewport(0, 0, 1, 0.4)
left.SetBackground(0.3, 0.1, 0.1)
right.SetBackground(0.1, 0.3, 0.1)
low.SetBackground(0.1, 0.1, 0.3)
low.SetBackground2(0.7, 0.7, 0.9)
low.GradientBackgroundOn()
shared = actor(ball, (0.9, 0.8, 0.2))
left.AddActor(shared)
right.AddActor(actor(box, (0.2, 0.8, 0.9)))
low.AddActor(shared)
other = actor(box, (0.9, 0.4, 0.7))
other.SetPosition(1.2, 0, 0)
low.AddActor(other)
win = window(360, 300, left, right, low)
for ren, eye in ((left, (2, -3, 1)), (right, (-3, -3, 2)), (low, (1, -5, 3))):
    look(ren, eye)
win.Render()
save(win, "viewports", props=[r.GetNumberOfPropsRendered() for r in (left, right, low)])
