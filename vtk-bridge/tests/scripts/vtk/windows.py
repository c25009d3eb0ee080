# Windows that open, close and resize: two at once with shared actors, 1 by 1, wide, renderers
# deleted and moved.
import vtk

from capture import actor, look, save, window

ball = vtk.vtkSphereSource()
ball.SetThetaResolution(24)
ball.SetPhiResolution(24)
shared = actor(ball, (0.8, 0.7, 0.3))


def renderer(color):
    made = vtk.vtkRenderer()
    made.SetBackground(color)
    made.AddActor(shared)
    look(made, (1, -4, 1))
    return made


one, two = renderer((0.3, 0.1, 0.1)), renderer((0.1, 0.1, 0.3))
first, second = window(200, 150, one), window(150, 200, two)
for k in range(3):
    first.Render()
    second.Render()
save(second, "second")
first.Render()
save(first, "first")
first.SetSize(1, 1)
first.Render()
save(first, "one_pixel")
first.SetSize(333, 77)
first.Render()
save(first, "wide")
first.SetSize(200, 150)
# Replace the renderer while the window stays.
first.RemoveRenderer(one)
del one
first.Render()
save(first, "no_renderer")
again = renderer((0.1, 0.3, 0.1))
first.AddRenderer(again)
first.Render()
save(first, "again")
# Delete the window while the renderer stays.
second.RemoveRenderer(two)
second.Finalize()
del second
third = window(120, 120, two)
third.Render()
save(third, "third")
# As large as the largest screens; only one row of it is saved, and then a small image.
third.SetSize(7680, 4320)
third.Render()
row = vtk.vtkFloatArray()
third.GetZbufferData(0, 2160, 7679, 2160, row)
covered = sum(row.GetValue(i) < 1.0 for i in range(7680))
third.SetSize(120, 120)
third.Render()
save(third, "after_8k", covered=round(covered / 7680, 3))
two.RemoveActor(shared)
del shared
third.Render()
save(third, "actor_gone")
