# Frames in which only the camera moves read no array; an error of the bridge leaves the frame to
# OpenGL.
import sys

import vtk

from capture import look, save, window

source = vtk.vtkSphereSource()
source.SetThetaResolution(40)
elevation = vtk.vtkElevationFilter()
elevation.SetInputConnection(source.GetOutputPort())
mapper = vtk.vtkPolyDataMapper()
mapper.SetInputConnection(elevation.GetOutputPort())
actor = vtk.vtkActor()
actor.SetMapper(mapper)
ren = vtk.vtkRenderer()
ren.AddActor(actor)
win = window(200, 150, ren)
look(ren, (1, -4, 1))
looks = [0]
ours = sys.modules.get("rtvtk.shape")
if ours:
    for module, name in ((ours, "_runs"), (ours, "numbers"), (sys.modules["rtvtk.arrays"], "numbers")):

        def counted(*arguments, call=getattr(module, name)):
            looks[0] += 1
            return call(*arguments)

        setattr(module, name, counted)
win.Render()
first = looks[0]
for k in range(5):
    ren.GetActiveCamera().Azimuth(10)
    win.Render()
save(win, "turned")
counts = [first, looks[0] - first]
if ours:
    extractor = sys.modules["rtvtk.extract"].Extractor

    def broken(*_):
        raise RuntimeError("planted")

    extractor.add = broken
ren.GetActiveCamera().Azimuth(10)
win.Render()
save(win, "after_a_fault")
with open(sys.argv[1] + "/looks.txt", "w") as file:
    print(*counts, file=file)
