# Renderers, actors and mappers of classes derived in Python, as in PyVista; a renderer whose
# observers were all removed; a tiled image.
import vtk

from capture import look, save, window


class Renderer(vtk.vtkOpenGLRenderer):
    def __init__(self):
        self.SetBackground(0.1, 0.2, 0.3)


class Marked:
    pass


class Actor(Marked, vtk.vtkActor):
    pass


class Mapper(Marked, vtk.vtkPolyDataMapper):
    pass


def picture(name, cleared):
    source = vtk.vtkSphereSource()
    source.SetThetaResolution(24)
    source.SetPhiResolution(24)
    mapper = Mapper()
    mapper.SetInputConnection(source.GetOutputPort())
    actor = Actor()
    actor.SetMapper(mapper)
    actor.GetProperty().SetColor(0.9, 0.6, 0.3)
    ren = Renderer()
    ren.AddActor(actor)
    win = window(200, 150, ren)
    look(ren, (1, -4, 1))
    win.Render()
    if cleared:
        ren.RemoveAllObservers()
        win.RemoveAllObservers()
        # Programs do this when they close a window; the next renderer may have the address of this
        # one.
        return
    save(win, name)
    tiles = vtk.vtkWindowToImageFilter()
    tiles.SetInput(win)
    tiles.SetScale(2)
    tiles.ReadFrontBufferOff()
    tiles.Update()
    writer = vtk.vtkPNGWriter()
    writer.SetInputConnection(tiles.GetOutputPort())
    writer.WriteToMemoryOn()
    writer.Write()
    image = tiles.GetOutput()
    scalars = image.GetPointData().GetScalars()
    background = scalars.GetTuple3(0)
    facts = sum(scalars.GetTuple3(i) != background for i in range(scalars.GetNumberOfTuples()))
    # The tiled images differ by some pixels, so round to hundreds.
    save(win, name + "_tiled", shown=round(facts, -2))


for k in range(6):
    picture("closed", True)
picture("derived", False)
