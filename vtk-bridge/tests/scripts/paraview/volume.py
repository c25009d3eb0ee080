# A volume with a contour in it.
from paraview.simple import *

from capture_view import save, view

wavelet = Wavelet()
v = view([256, 256])
shown = Show(wavelet, v)
shown.SetRepresentationType("Volume")
ColorBy(shown, ("POINTS", "RTData"))
shown.ScalarOpacityUnitDistance = 4
contour = Contour(Input=Wavelet(), ContourBy="RTData", Isosurfaces=[220])
inside = Show(contour, v)
ColorBy(inside, None)
inside.DiffuseColor = [0.9, 0.9, 0.3]
v.CameraPosition, v.CameraFocalPoint, v.CameraViewUp = [15, -60, 30], [0, 0, 0], [0, 0, 1]
save(v, "volume")
