"""Runs an ordinary script and saves what its window shows: run.py SCRIPT OUT.

The script leaves its window in `win` (VTK) or its view in `view` (ParaView), and may leave answers that must not depend on the renderer in
`answers`. OUT.rgba and OUT.z are raw rows from the bottom, OUT.json has the size, the answers and the class of the renderer.
"""
import json
import runpy
import sys

script, out = sys.argv[1:3]
names = runpy.run_path(script, run_name="__main__")
if "view" in names:
    win = names["view"].GetRenderWindow()
else:
    win = names["win"]
from vtkmodules.vtkCommonCore import vtkFloatArray, vtkUnsignedCharArray

width, height = win.GetSize()
rgba, depth = vtkUnsignedCharArray(), vtkFloatArray()
win.GetZbufferData(0, 0, width - 1, height - 1, depth)
win.GetRGBACharPixelData(0, 0, width - 1, height - 1, 0, rgba)
with open(out + ".rgba", "wb") as f:
    f.write(memoryview(rgba))
with open(out + ".z", "wb") as f:
    f.write(memoryview(depth))
renderers = win.GetRenderers()
classes = [renderers.GetItemAsObject(i).GetClassName() for i in range(renderers.GetNumberOfItems())]
with open(out + ".json", "w") as f:
    json.dump(dict(width=width, height=height, answers=names.get("answers"), classes=classes), f)
