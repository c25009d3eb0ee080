# A mesh of 200,000 triangles in a small window, turned eight times: OpenGL draws the first image,
# and rays the last, unless they have to draw all.
import vtk

from capture import actor, look, save, window

ball = vtk.vtkSphereSource()
ball.SetThetaResolution(400)
ball.SetPhiResolution(250)
ren = vtk.vtkRenderer()
ren.AddActor(actor(ball, (0.8, 0.7, 0.4)))
win = window(200, 200, ren)
look(ren, (1, -4, 1))
win.Render()
save(win, "first")
for _ in range(8):
    ren.GetActiveCamera().Azimuth(5)
    win.Render()
save(win, "last")
