# Two renderers in one window, and a third on a layer above.
from vtkmodules.vtkRenderingCore import *
import vtkmodules.vtkRenderingOpenGL2, vtkmodules.vtkRenderingFreeType, vtkmodules.vtkInteractionStyle
from vtkmodules.vtkFiltersSources import vtkConeSource, vtkCubeSource, vtkSphereSource

win = vtkRenderWindow()
win.SetOffScreenRendering(1)
win.SetMultiSamples(0)
win.SetSize(500, 240)
win.SetNumberOfLayers(2)
views = [((0, 0, 0.5, 1), vtkConeSource(), 0), ((0.5, 0.1, 1, 0.9), vtkCubeSource(), 0), ((0.3, 0.3, 0.7, 0.7), vtkSphereSource(), 1)]
for viewport, source, layer in views:
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    actor = vtkActor()
    actor.SetMapper(mapper)
    ren = vtkRenderer()
    ren.SetViewport(*viewport)
    ren.SetLayer(layer)
    ren.SetBackground(0.2, 0.1 + viewport[0], 0.3)
    ren.AddActor(actor)
    win.AddRenderer(ren)
    ren.ResetCamera()
    ren.GetActiveCamera().Azimuth(35)
    ren.GetActiveCamera().Elevation(25)
    ren.ResetCameraClippingRange()
win.Render()
