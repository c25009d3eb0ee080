# Contours of the wavelet on all ranks: ranks.py OUT OPACITY.
import sys

from paraview.simple import *

view = CreateRenderView()
view.ViewSize = [300, 300]
view.UseFXAA = 0
view.RemoteRenderThreshold = 0
view.OrientationAxesVisibility = 0
wavelet = Wavelet(WholeExtent=[-20, 20] * 3)
contour = Contour(Input=wavelet, ContourBy="RTData", Isosurfaces=[157.09, 200], ComputeScalars=1)
shown = Show(contour, view)
ColorBy(shown, ("POINTS", "RTData"))
transfer = GetColorTransferFunction("RTData")
transfer.RescaleTransferFunction(100, 250)
shown.Opacity = float(sys.argv[2])
view.CameraPosition = [20, -110, 60]
view.CameraFocalPoint = [0, 0, 0]
view.CameraViewUp = [0, 0, 1]
Render(view)
SaveScreenshot(sys.argv[1], view, ImageResolution=[300, 300])
print(view.GetRenderer().GetClassName() if hasattr(view, "GetRenderer") else view.SMProxy.GetRenderer().GetClassName())
