# Edges on surfaces: of triangles, of polygons (without their diagonals), with cell colours, wide
# ones, of glyphs.
import vtk

from capture import actor, look, save, window

ren = vtk.vtkRenderer()
ren.SetBackground(0.3, 0.3, 0.3)


def place(source, x, y, color=(0.7, 0.8, 0.9), width=1.0, edge=(0.4, 0, 0)):
    made = actor(source, color)
    made.SetPosition(x, y, 0)
    made.GetProperty().EdgeVisibilityOn()
    made.GetProperty().SetEdgeColor(edge)
    made.GetProperty().SetLineWidth(width)
    ren.AddActor(made)
    return made


ball = vtk.vtkSphereSource()
ball.SetThetaResolution(12)
ball.SetPhiResolution(10)
place(ball, 0, 0)
place(ball, 1.1, 0, width=3)
cylinder = vtk.vtkCylinderSource()
cylinder.SetResolution(9)
place(cylinder, 2.2, 0).RotateX(50)
plane = vtk.vtkPlaneSource()
plane.SetResolution(6, 4)
cells = vtk.vtkElevationFilter()
cells.SetInputConnection(plane.GetOutputPort())
cells.SetLowPoint(-0.5, 0, 0)
cells.SetHighPoint(0.5, 0, 0)
colored = place(cells, 0, 1.1, None, edge=(0, 0, 0))
colored.RotateX(-20)
unlit = place(plane, 1.1, 1.1, width=2, edge=(1, 1, 0))
unlit.GetProperty().LightingOff()
place(ball, 2.2, 1.1).GetProperty().SetInterpolationToFlat()
win = window(420, 300, ren)
look(ren, (1.1, -2, 5), (1.1, 0.5, 0)).Zoom(1.4)
ren.ResetCameraClippingRange()
win.Render()
save(win, "edges", props=ren.GetNumberOfPropsRendered())
