# Two contours of the wavelet, coloured by a lookup table, lit by the default headlight.
from vtkmodules.vtkRenderingCore import *
import vtkmodules.vtkRenderingOpenGL2, vtkmodules.vtkRenderingFreeType, vtkmodules.vtkInteractionStyle
from vtkmodules.vtkFiltersCore import vtkContourFilter
from vtkmodules.vtkImagingCore import vtkRTAnalyticSource

source = vtkRTAnalyticSource()
source.SetWholeExtent(-20, 20, -20, 20, -20, 20)
contour = vtkContourFilter()
contour.SetInputConnection(source.GetOutputPort())
contour.SetValue(0, 157.09)
contour.SetValue(1, 210)
mapper = vtkPolyDataMapper()
mapper.SetInputConnection(contour.GetOutputPort())
mapper.SetScalarRange(100, 250)
actor = vtkActor()
actor.SetMapper(mapper)
ren = vtkRenderer()
ren.AddActor(actor)
ren.SetBackground(0.2, 0.3, 0.4)
win = vtkRenderWindow()
win.SetOffScreenRendering(1)
win.SetMultiSamples(0)
win.SetSize(400, 300)
win.AddRenderer(ren)
ren.GetActiveCamera().SetPosition(60, -220, 90)
ren.GetActiveCamera().SetViewUp(0, 0, 1)
ren.ResetCamera()
win.Render()
