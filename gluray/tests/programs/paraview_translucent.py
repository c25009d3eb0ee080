# ParaView's translucent contours, coloured by a map, with an outline.
from paraview.simple import *

w = Wavelet(WholeExtent=[-20, 20, -20, 20, -20, 20])
c = Contour(Input=w, ContourBy=["POINTS", "RTData"], Isosurfaces=[120.0, 157.0, 200.0])
v = CreateRenderView(ViewSize=[768, 768])
v.MaximumNumberOfPeels = 100
d = Show(c, v)
ColorBy(d, ("POINTS", "RTData"))
d.Opacity = 0.4
Show(Outline(Input=w), v)
v.ResetCamera()
camera = v.GetActiveCamera()
camera.Azimuth(30)
camera.Elevation(20)
Render(v)
SaveScreenshot("out.png", v)
