# Contours coloured by the magnitude of their normals and by a solid colour, a plane, a wireframe
# sphere; then the camera moves around them.
from paraview.simple import *

from capture_view import save, view

wavelet = Wavelet(WholeExtent=[-20, 20, -20, 20, -20, 20])
contour = Contour(Input=wavelet, ContourBy="RTData", Isosurfaces=[157.09, 200])
v = view([400, 320])
shown = Show(contour, v)
ColorBy(shown, ("POINTS", "RTData"))
plane = Plane(Origin=[-40, -40, -25], Point1=[40, -40, -25], Point2=[-40, 40, -25])
Show(plane, v).DiffuseColor = [0.8, 0.8, 0.7]
ball = Sphere(Radius=8, Center=[15, -25, 5], ThetaResolution=20, PhiResolution=20)
Show(ball, v).SetRepresentationType("Wireframe")
v.CameraPosition, v.CameraFocalPoint, v.CameraViewUp = [0, -130, 75], [0, 0, 0], [0, 0, 1]
save(v, "contours")
GetActiveCamera().Azimuth(30)
shown.SetRepresentationType("Surface With Edges")
save(v, "edges")
shown.SetRepresentationType("Surface")
ColorBy(shown, None)
shown.DiffuseColor = [0.4, 0.6, 0.9]
shown.Specular = 0.6
shown.Interpolation = "Flat"
save(v, "solid")
