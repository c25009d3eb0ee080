# A red box on a floor under one lamp, a distant box, and the pixels of named positions.
import vtk

from capture import actor, save, window

ren = vtk.vtkRenderer()
ren.SetBackground(0.2, 0.3, 0.5)
plane = vtk.vtkPlaneSource()
plane.SetOrigin(-6, -4, 0)
plane.SetPoint1(6, -4, 0)
plane.SetPoint2(-6, 12, 0)
ren.AddActor(actor(plane, (0.8, 0.8, 0.8)))
for place, color in (((0, 0, 0.5), (0.9, 0.1, 0.1)), ((2.0, 9, 0.5), (0.1, 0.8, 0.1))):
    box = vtk.vtkCubeSource()
    box.SetCenter(place)
    ren.AddActor(actor(box, color))
lamp = vtk.vtkLight()
lamp.SetLightTypeToSceneLight()
lamp.SetPosition(-5, -3, 6)
lamp.SetFocalPoint(0, -1, 0)
ren.AddLight(lamp)
win = window(320, 240, ren)
camera = ren.GetActiveCamera()
camera.SetPosition(0, -6, 4)
camera.SetFocalPoint(0, -0.5, 0.5)
camera.SetViewUp(0, 0, 1)
camera.SetViewAngle(40)
ren.ResetCameraClippingRange()
win.Render()


def pixel(*world):
    ren.SetWorldPoint(*world, 1)
    ren.WorldToDisplay()
    return [int(v) for v in ren.GetDisplayPoint()[:2]]


save(
    win,
    "room",
    # The lamp's light travels along (5, 2, -6): the box casts its shadow to the right and back.
    shadow=pixel(0.75, 0.2, 0),
    lit=pixel(-1.5, 0, 0),
    far_from_shadow=pixel(2.5, -1, 0),
    # The floor and the box form a concave corner. The top of the box is convex; the distant floor
    # is open.
    concave=pixel(-0.2, -0.53, 0),
    convex=pixel(-0.3, -0.4, 1),
    open=pixel(-2.2, -1.3, 0),
    # From here a mirror on the floor shows the box; from there the background.
    mirror_of_box=pixel(0, -0.75, 0),
    mirror_of_background=pixel(-2.2, -0.75, 0),
    # The left edges of the near and of the far box.
    near_edge=pixel(-0.5, -0.5, 0.5),
    far_edge=pixel(1.5, 8.5, 0.6),
)
