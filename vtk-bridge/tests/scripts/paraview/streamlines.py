# Streamlines of a swirl, as tubes and as lines.
from paraview.simple import *

from capture_view import save, view

source = Wavelet(WholeExtent=[-8, 8, -8, 8, -8, 8])
swirl = Calculator(Input=source, ResultArrayName="velocity", Function="-coordsY*iHat+coordsX*jHat+3*kHat")
stream = StreamTracer(Input=swirl, SeedType="Line", Vectors=["POINTS", "velocity"], MaximumStreamlineLength=60)
stream.SeedType.Point1 = [1, 0, -7]
stream.SeedType.Point2 = [7, 0, -7]
stream.SeedType.Resolution = 6
tubes = Tube(Input=stream, Radius=0.25, NumberofSides=10)
v = view([360, 280])
ColorBy(Show(tubes, v), ("POINTS", "IntegrationTime"))
lines = Transform(Input=stream)
lines.Transform.Translate = [17, 0, 0]
shown = Show(lines, v)
ColorBy(shown, None)
shown.LineWidth = 2
v.CameraPosition, v.CameraFocalPoint, v.CameraViewUp = [8, -50, 20], [8, 0, 0], [0, 0, 1]
save(v, "streamlines")
