"""Frames of ParaView, one for each line that comes; for pvbatch."""
import sys
from paraview.simple import *

file, size = sys.argv[1], int(sys.argv[2])
reader = XMLPolyDataReader(FileName=[file])
view = CreateRenderView(ViewSize=[size, size])
shown = Show(reader, view)
ColorBy(shown, None)
view.ResetCamera()
camera = view.GetActiveCamera()
camera.Azimuth(30)
camera.Elevation(20)
Render(view)
print("ready", flush=True)
# Not `for line in sys.stdin`: pvbatch may read ahead.
while sys.stdin.readline():
    camera.Azimuth(5)
    Render(view)
    print("frame", flush=True)
