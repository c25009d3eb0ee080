# Axes, a scalar bar, text and a wireframe sphere that pierce a contour: OpenGL draws them, with the contour's depth.
from vtkmodules.vtkRenderingCore import *
import vtkmodules.vtkRenderingOpenGL2, vtkmodules.vtkRenderingFreeType, vtkmodules.vtkInteractionStyle
from vtkmodules.vtkFiltersCore import vtkContourFilter
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkImagingCore import vtkRTAnalyticSource
from vtkmodules.vtkRenderingAnnotation import vtkCubeAxesActor, vtkScalarBarActor

source = vtkRTAnalyticSource()
source.SetWholeExtent(-16, 16, -16, 16, -16, 16)
contour = vtkContourFilter()
contour.SetInputConnection(source.GetOutputPort())
contour.SetValue(0, 157.09)
mapper = vtkPolyDataMapper()
mapper.SetInputConnection(contour.GetOutputPort())
mapper.SetScalarRange(100, 250)
mapper.InterpolateScalarsBeforeMappingOn()
actor = vtkActor()
actor.SetMapper(mapper)
sphere = vtkSphereSource()
sphere.SetRadius(12)
wire_mapper = vtkPolyDataMapper()
wire_mapper.SetInputConnection(sphere.GetOutputPort())
wire = vtkActor()
wire.SetMapper(wire_mapper)
wire.GetProperty().SetRepresentationToWireframe()
bar = vtkScalarBarActor()
bar.SetLookupTable(mapper.GetLookupTable())
bar.SetTitle("RTData")
axes = vtkCubeAxesActor()
axes.SetBounds(-16, 16, -16, 16, -16, 16)
text = vtkTextActor()
text.SetInput("annotation")
ren = vtkRenderer()
axes.SetCamera(ren.GetActiveCamera())
for prop in (actor, wire, axes):
    ren.AddActor(prop)
ren.AddViewProp(bar)
ren.AddViewProp(text)
win = vtkRenderWindow()
win.SetOffScreenRendering(1)
win.SetMultiSamples(0)
win.SetSize(420, 320)
win.AddRenderer(ren)
ren.GetActiveCamera().SetPosition(40, -100, 60)
ren.GetActiveCamera().SetViewUp(0, 0, 1)
ren.ResetCamera()
win.Render()
