# The same images on any number of ranks: opaque, translucent, and with props that OpenGL draws.
import sys

from paraview.simple import *

out = sys.argv[1]
wavelet = Wavelet(WholeExtent=[-16, 16, -16, 16, -16, 16])
# Without normals: a rank computes those at its border from its own side only, so the shading would
# show a seam.
contour = Contour(Input=wavelet, ContourBy="RTData", Isosurfaces=[157.09, 210], ComputeNormals=0)
ball = Sphere(Center=[14, -20, 8], Radius=8, ThetaResolution=64, PhiResolution=48)
view = CreateRenderView()
view.ViewSize = [320, 260]
view.UseFXAA = 0
view.OrientationAxesVisibility = 0
view.RemoteRenderThreshold = 0
view.CameraPosition, view.CameraFocalPoint, view.CameraViewUp = [0, -110, 60], [0, 0, 0], [0, 0, 1]
shown = Show(contour, view)
ColorBy(shown, ("POINTS", "RTData"))
shown.Interpolation = "Flat"
round_one = Show(ball, view)
round_one.DiffuseColor = [0.9, 0.5, 0.2]


def save(name):
    Render(view)
    SaveScreenshot("%s/%s.png" % (out, name), view, ImageResolution=[320, 260], TransparentBackground=0)


save("opaque")
shown.Opacity = 0.5
round_one.Opacity = 0.4
save("translucent")
round_one.Opacity = 1
save("mixed")
shown.Opacity = 1
Show(wavelet, view).SetRepresentationType("Outline")
view.AxesGrid.Visibility = 1
save("annotated")
