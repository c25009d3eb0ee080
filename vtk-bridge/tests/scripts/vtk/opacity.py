# Translucent spheres through each other and through an opaque plane, in the right order (depth peeling).
import vtk

from capture import actor, look, save, window


def ball(x, y, z, color, opacity):
    source = vtk.vtkSphereSource()
    source.SetCenter(x, y, z)
    source.SetThetaResolution(40)
    source.SetPhiResolution(40)
    made = actor(source, color)
    made.GetProperty().SetOpacity(opacity)
    return made


ren = vtk.vtkRenderer()
ren.SetBackground(0.9, 0.9, 0.8)
ren.SetUseDepthPeeling(1)
ren.SetMaximumNumberOfPeels(50)
ren.SetOcclusionRatio(0)
balls = [ball(0, 0, 0, (1, 0, 0), 0.5), ball(0.4, 0.2, 0.2, (0, 1, 0), 0.3), ball(0.2, -0.3, 0.5, (0, 0, 1), 0.7)]
for made in balls:
    ren.AddActor(made)
plane = vtk.vtkPlaneSource()
plane.SetOrigin(-1, -1, -0.1)
plane.SetPoint1(1, -1, -0.1)
plane.SetPoint2(-1, 1, -0.1)
ren.AddActor(actor(plane, (0.6, 0.6, 0.6)))
win = window(300, 300, ren)
win.SetAlphaBitPlanes(1)
look(ren, (2, -3, 2.5)).Zoom(1.3)
ren.ResetCameraClippingRange()
win.Render()
save(win, "opacity", props=ren.GetNumberOfPropsRendered())

# Opacity from the lookup table.
table = vtk.vtkLookupTable()
table.SetNumberOfTableValues(16)
for i in range(16):
    table.SetTableValue(i, i / 15, 0.3, 1 - i / 15, 0.1 + 0.8 * i / 15)
elevation = vtk.vtkElevationFilter()
cylinder = vtk.vtkCylinderSource()
cylinder.SetResolution(30)
cylinder.SetHeight(1.6)
cylinder.CappingOff()
elevation.SetInputConnection(cylinder.GetOutputPort())
elevation.SetLowPoint(0, -0.8, 0)
elevation.SetHighPoint(0, 0.8, 0)
by_table = actor(elevation)
by_table.GetMapper().SetLookupTable(table)
by_table.GetMapper().InterpolateScalarsBeforeMappingOn()
by_table.GetProperty().SetDiffuse(0.8)
by_table.GetProperty().SetAmbient(0.2)
for made in balls[1:]:
    ren.RemoveActor(made)
ren.AddActor(by_table)
ren.ResetCamera()
win.Render()
save(win, "table")
