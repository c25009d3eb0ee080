# A translucent contour around an opaque one, with a clip through both.
from paraview.simple import *

wavelet = Wavelet(WholeExtent=[-16, 16] * 3)
view = CreateRenderView()
view.ViewSize = [400, 300]
view.UseFXAA = 0
for value, opacity, color in [(130, 0.4, (0.9, 0.4, 0.3)), (220, 1.0, (0.3, 0.5, 0.9))]:
    contour = Contour(Input=wavelet, ContourBy="RTData", Isosurfaces=[value])
    clip = Clip(Input=contour, ClipType="Plane")
    clip.ClipType.Normal = [0, 1, 0.3]
    shown = Show(clip, view)
    ColorBy(shown, None)
    shown.DiffuseColor = color
    shown.Opacity = opacity
ResetCamera(view)
view.CameraPosition = [30, -90, 50]
view.CameraFocalPoint = [0, 0, 0]
view.CameraViewUp = [0, 0, 1]
Render(view)
