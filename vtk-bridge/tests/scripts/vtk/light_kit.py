# The light kit of VTK around a cone and a torus, from the side.
from vtkmodules.vtkRenderingCore import *
import vtkmodules.vtkRenderingOpenGL2, vtkmodules.vtkRenderingFreeType, vtkmodules.vtkInteractionStyle
from vtkmodules.vtkFiltersSources import vtkConeSource, vtkParametricFunctionSource
from vtkmodules.vtkCommonComputationalGeometry import vtkParametricTorus

ren = vtkRenderer()
cone = vtkConeSource()
cone.SetResolution(40)
torus = vtkParametricFunctionSource()
torus.SetParametricFunction(vtkParametricTorus())
for source, color in [(cone, (0.3, 0.7, 0.9)), (torus, (0.9, 0.8, 0.4))]:
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    mapper.ScalarVisibilityOff()
    actor = vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().SetColor(*color)
    actor.RotateX(25)
    ren.AddActor(actor)
kit = vtkLightKit()
kit.SetKeyLightIntensity(1.1)
kit.AddLightsToRenderer(ren)
win = vtkRenderWindow()
win.SetOffScreenRendering(1)
win.SetMultiSamples(0)
win.SetSize(360, 300)
win.AddRenderer(ren)
ren.ResetCamera()
ren.GetActiveCamera().Azimuth(30)
ren.GetActiveCamera().Elevation(20)
win.Render()
