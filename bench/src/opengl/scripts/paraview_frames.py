"""Frames of ParaView, one for each line that comes; for pvbatch."""
import os, sys
from paraview.simple import *

file, size = sys.argv[1], int(sys.argv[2])
reader = XMLPolyDataReader(FileName=[file])
view = CreateRenderView(ViewSize=[size, size])
shown = Show(reader, view)
# A single colour; `ColorBy(shown, None)` fails in ParaView 5.11 when nothing was coloured before.
shown.ColorArrayName = ["POINTS", ""]
view.ResetCamera()
camera = view.GetActiveCamera()
camera.Azimuth(30)
camera.Elevation(20)
Render(view)
# ParaView's own `print` goes through a buffer that `flush` does not empty, unless PYTHONUNBUFFERED
# is set.
os.write(1, b"ready\n")
# ParaView's own `sys.stdin` strips line ends, so an empty line looks like the end of the input.
commands = os.fdopen(os.dup(0))
while commands.readline():
    camera.Azimuth(5)
    Render(view)
    os.write(1, b"frame\n")
