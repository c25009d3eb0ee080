# Renderers that smooth their image (FXAA): with every prop traced, with a text that OpenGL draws,
# and with options of the filter's own.
import vtk

from capture import actor, look, save, window


def scene():
    ren = vtk.vtkRenderer()
    ren.SetBackground(0.2, 0.25, 0.3)
    # Cells in turns dark and bright: the filter changes the borders inside the surface as well.
    plane = vtk.vtkPlaneSource()
    plane.SetResolution(14, 14)
    plane.Update()
    data = plane.GetOutput()
    values = vtk.vtkFloatArray()
    for i in range(data.GetNumberOfCells()):
        values.InsertNextValue((i // 14 + i % 14) % 2)
    data.GetCellData().SetScalars(values)
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(data)
    mapper.SetScalarRange(0, 1)
    board = vtk.vtkActor()
    board.SetMapper(mapper)
    board.RotateZ(17)
    board.RotateX(-30)
    ren.AddActor(board)
    ball = vtk.vtkSphereSource()
    ball.SetRadius(0.2)
    ball.SetThetaResolution(40)
    ball.SetPhiResolution(40)
    made = actor(ball, (0.9, 0.8, 0.7))
    made.SetPosition(0.1, 0, 0.4)
    ren.AddActor(made)
    look(ren, (0.2, -0.6, 4), (0, 0, 0), (0, 1, 0)).Zoom(1.3)
    ren.ResetCameraClippingRange()
    return ren


def show(name, change=None):
    ren = scene()
    ren.UseFXAAOn()
    if change:
        change(ren)
    win = window(300, 300, ren)
    win.Render()
    save(win, name)


def with_text(ren):
    text = vtk.vtkTextActor()
    text.SetInput("text")
    text.SetPosition(10, 10)
    ren.AddActor(text)


def with_options(ren):
    ren.GetFXAAOptions().SetRelativeContrastThreshold(0.3)
    ren.GetFXAAOptions().SetSubpixelBlendLimit(0.1)


show("every_prop_traced")
show("with_text", with_text)
show("with_options", with_options)
