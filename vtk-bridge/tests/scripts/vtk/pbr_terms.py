# What VTK's shaders do to surfaces beyond the common case: lobes of nearly smooth metals, scalars and coefficients of physically
# based surfaces, highlights of small exponents, and edges under highlights.
import vtk

from capture import actor, look, save, window

ren = vtk.vtkRenderer()
ren.SetBackground(0.1, 0.1, 0.1)
win = window(420, 330, ren)


def scene(name, change, **settings):
    """Twelve balls, each changed by its row and column."""
    ren.RemoveAllViewProps()
    ren.RemoveAllLights()
    for i in range(4):
        for j in range(3):
            ball = vtk.vtkSphereSource()
            ball.SetThetaResolution(settings.get("resolution", 48))
            ball.SetPhiResolution(settings.get("resolution", 48))
            source = ball
            if settings.get("scalars"):
                source = vtk.vtkElevationFilter()
                source.SetInputConnection(ball.GetOutputPort())
                source.SetLowPoint(0, -0.5, 0)
                source.SetHighPoint(0, 0.5, 0)
            made = actor(source, None if settings.get("scalars") else (0.95, 0.7, 0.3))
            made.SetPosition(1.1 * i, 1.1 * j, 0)
            change(made, i, j)
            ren.AddActor(made)
    for position, color in (((3, 4, 8), (1, 1, 1)), ((-6, -2, 5), (0.3, 0.4, 0.8))):
        made = vtk.vtkLight()
        made.SetLightTypeToSceneLight()
        made.SetPosition(position)
        made.SetFocalPoint(1.6, 0.5, 0)
        made.SetColor(color)
        ren.AddLight(made)
    look(ren, (1.65, 1.1, 8), (1.65, 1.1, 0), (0, 1, 0)).Zoom(1.4)
    ren.ResetCameraClippingRange()
    win.Render()
    save(win, name, props=ren.GetNumberOfPropsRendered())


def physical(made, metallic, roughness):
    p = made.GetProperty()
    p.SetInterpolationToPBR()
    p.SetMetallic(metallic)
    p.SetRoughness(roughness)
    return p


def smooth(made, i, j):
    physical(made, 0.5 * j, (0.0, 0.012, 0.025, 0.07)[i])


def by_scalars(made, i, j):
    physical(made, 0.5 * j, 0.3)
    if i > 1:
        made.GetMapper().SetInterpolateScalarsBeforeMapping(i > 2)


def coefficients(made, i, j):
    physical(made, 0.5 * j, 0.4).SetDiffuse((1.0, 0.7, 0.4, 0.1)[i])


def unlit(made, i, j):
    physical(made, 0.5 * j, 0.4).SetLighting(i % 2 == 1)
    made.GetProperty().SetAmbient(0.1 * j)


def lined(made, i, j):
    physical(made, 0.5 * j, 0.3)
    edges(made, i, j)


def edges(made, i, j):
    p = made.GetProperty()
    p.SetEdgeVisibility(1)
    p.SetEdgeColor(0.1, 0.8, 0.2)
    p.SetLineWidth(1 + i)


def shining(made, i, j):
    made.GetProperty().SetSpecular(0.5 * j)
    made.GetProperty().SetSpecularPower(5 + 10 * i)
    made.GetProperty().SetAmbient(0.1)
    edges(made, i, j)


def blunt(made, i, j):
    made.GetProperty().SetSpecular(0.4)
    made.GetProperty().SetSpecularPower((0.1, 0.3, 0.8, 2.0)[i])


scene("smooth_metals", smooth)
scene("scalars", by_scalars, scalars=True)
scene("scalars_with_coefficients", coefficients, scalars=True)
scene("coefficients", coefficients)
scene("unlit", unlit)
scene("unlit_scalars", unlit, scalars=True)
scene("lines_of_physical_surfaces", lined, resolution=12)
scene("lines_under_highlights", shining, resolution=12)
scene("small_exponents", blunt)
