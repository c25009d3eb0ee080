# ParaView's default lights on a contour and a sphere in one picture, with the axes grid and the scalar bar.
from paraview.simple import *

wavelet = Wavelet(WholeExtent=[-16, 16] * 3)
contour = Contour(Input=wavelet, ContourBy="RTData", Isosurfaces=[157.09, 210])
view = CreateRenderView()
view.ViewSize = [400, 300]
view.UseFXAA = 0
shown = Show(contour, view)
ColorBy(shown, ("POINTS", "RTData"))
shown.SetScalarBarVisibility(view, True)
sphere = Sphere(Radius=6, Center=[12, -22, 4], ThetaResolution=40, PhiResolution=40)
Show(sphere, view)
outline = Outline(Input=wavelet)
Show(outline, view)
view.AxesGrid.Visibility = 1
ResetCamera(view)
view.CameraPosition = [10, -100, 60]
view.CameraFocalPoint = [0, 0, 0]
view.CameraViewUp = [0, 0, 1]
Render(view)
