# Scalar bar, axes grid, orientation axes, text, and a gradient behind.
from paraview.simple import *

from capture_view import save, view

wavelet = Wavelet()
contour = Contour(Input=wavelet, ContourBy="RTData", Isosurfaces=[157.09])
v = view([400, 320])
v.OrientationAxesVisibility = 1
v.AxesGrid.Visibility = 1
v.BackgroundColorMode = "Gradient"
v.Background2 = [0.1, 0.1, 0.3]
shown = Show(contour, v)
ColorBy(shown, ("POINTS", "Normals", "X"))
shown.SetScalarBarVisibility(v, True)
label = Text(Text="a line of text")
Show(label, v)
outline = Show(wavelet, v)
outline.SetRepresentationType("Outline")
v.CameraPosition, v.CameraFocalPoint, v.CameraViewUp = [15, -60, 30], [0, 0, 0], [0, 0, 1]
save(v, "annotations")
