# The same scene from 1e-20 to 1e20 across, and far from the origin.
import vtk

from capture import actor, save, window


def scene(size, origin):
    ren = vtk.vtkRenderer()
    ren.SetBackground(0.1, 0.1, 0.3)
    for i, color in enumerate(((0.9, 0.3, 0.2), (0.2, 0.8, 0.4))):
        ball = vtk.vtkSphereSource()
        ball.SetOutputPointsPrecision(vtk.vtkAlgorithm.DOUBLE_PRECISION)
        ball.SetThetaResolution(24)
        ball.SetPhiResolution(24)
        ball.SetRadius(0.5 * size)
        ball.SetCenter(origin + size * (0.7 * i), origin, origin - size * 0.3 * i)
        ren.AddActor(actor(ball, color))
    camera = ren.GetActiveCamera()
    camera.SetFocalPoint(origin + 0.35 * size, origin, origin)
    camera.SetPosition(origin + 0.35 * size, origin - 4 * size, origin + 1.5 * size)
    camera.SetViewUp(0, 0, 1)
    camera.SetClippingRange(2 * size, 7 * size)
    return ren


for size, origin in (
    (1, 0), (1e-20, 0), (1e-12, 0), (1e-6, 0), (1e6, 0), (1e12, 0), (1e20, 0), (1, 1e6), (1e-3, 1e6), (1, 1e9),
):  # fmt: skip
    ren = scene(size, origin)
    win = window(200, 160, ren)
    win.Render()
    save(win, "size_%g_at_%g" % (size, origin))
