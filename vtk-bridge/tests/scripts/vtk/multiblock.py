# Blocks with their own colours, opacities and visibility, one of them nested; then the settings change.
import vtk

from capture import look, save, window


def sphere(x, y, res=24, scalars=False):
    source = vtk.vtkSphereSource()
    source.SetCenter(x, y, 0)
    source.SetThetaResolution(res)
    source.SetPhiResolution(res)
    source.Update()
    if not scalars:
        return source.GetOutput()
    elevation = vtk.vtkElevationFilter()
    elevation.SetInputData(source.GetOutput())
    elevation.SetLowPoint(x - 0.5, 0, 0)
    elevation.SetHighPoint(x + 0.5, 0, 0)
    elevation.Update()
    return elevation.GetOutput()


inner = vtk.vtkMultiBlockDataSet()
inner.SetBlock(0, sphere(0, 1.2))
inner.SetBlock(1, sphere(1.2, 1.2, scalars=True))
blocks = vtk.vtkMultiBlockDataSet()
blocks.SetBlock(0, sphere(0, 0))
blocks.SetBlock(1, sphere(1.2, 0, scalars=True))
blocks.SetBlock(2, inner)
blocks.SetBlock(3, sphere(2.4, 0.6))
# Since VTK 9.3, one class has the features of both names.
mapper = getattr(vtk, "vtkCompositePolyDataMapper2", vtk.vtkCompositePolyDataMapper)()
mapper.SetInputDataObject(blocks)
attributes = vtk.vtkCompositeDataDisplayAttributes()
mapper.SetCompositeDataDisplayAttributes(attributes)
# Flat indices: 0 the root, 1 and 2 the first spheres, 3 the inner blocks, 4 and 5 theirs, 6 the last sphere.
mapper.SetBlockColor(1, (0.9, 0.2, 0.1))
mapper.SetBlockVisibility(6, False)
mapper.SetBlockColor(4, (0.1, 0.4, 0.9))
actor = vtk.vtkActor()
actor.SetMapper(mapper)
ren = vtk.vtkRenderer()
ren.SetBackground(0.1, 0.1, 0.2)
ren.AddActor(actor)
ren.SetUseDepthPeeling(1)
ren.SetMaximumNumberOfPeels(20)
ren.SetOcclusionRatio(0)
win = window(360, 300, ren)
win.SetAlphaBitPlanes(1)
look(ren, (1.2, 0.6, 6), (1.2, 0.6, 0), (0, 1, 0)).Zoom(1.2)
win.Render()
save(win, "blocks", props=ren.GetNumberOfPropsRendered())
mapper.SetBlockVisibility(6, True)
mapper.SetBlockColor(6, (0.2, 0.8, 0.2))
mapper.SetBlockVisibility(3, False)
mapper.SetBlockColor(1, (0.2, 0.8, 0.8))
win.Render()
save(win, "changed")
mapper.SetBlockVisibility(3, True)
mapper.SetBlockOpacity(1, 0.4)
mapper.SetBlockOpacity(3, 0.6)
win.Render()
save(win, "opacities")
