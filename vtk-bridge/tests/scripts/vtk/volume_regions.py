# Parts of volumes: clipping planes, cropping to a box and to other regions, and scalars of cells.
import vtk

from capture import actor, look, save, window
from volume_scenes import image_of_cells, volume, wavelet

ren = vtk.vtkRenderer()
ren.SetBackground(0.2, 0.2, 0.2)
win = window(200, 200, ren)


def picture(name, made, turned=False):
    if turned:
        made.SetScale(1, 1.3, 0.8)
        made.RotateX(25)
        made.RotateZ(40)
    ren.AddVolume(made)
    look(ren, (20, -60, 30)).Zoom(1.2)
    ren.ResetCameraClippingRange()
    win.Render()
    save(win, name, props=ren.GetNumberOfPropsRendered())
    ren.RemoveVolume(made)


def cut(made, *planes):
    for origin, normal in planes:
        plane = vtk.vtkPlane()
        plane.SetOrigin(origin)
        plane.SetNormal(normal)
        made.GetMapper().AddClippingPlane(plane)
    return made


def cropped(made, flags, planes=(-6, 3, -4, 5, -7, 2)):
    mapper = made.GetMapper()
    mapper.CroppingOn()
    mapper.SetCroppingRegionPlanes(*planes)
    mapper.SetCroppingRegionFlags(flags)
    return made


SLANTED, LEVEL = ((1, 2, 0), (1, -0.5, 0.3)), ((0, 0, 3), (0, 0, -1))
BOX, FENCE, INVERTED_CROSS, CORNER = 0x2000, 0x2ebfeba, 0x7be8bef, 1
picture("one_plane", cut(volume(wavelet()), SLANTED))
picture("planes_of_a_turned_volume", cut(volume(wavelet()), SLANTED, LEVEL), turned=True)
picture("box", cropped(volume(wavelet()), BOX))
picture("box_of_a_turned_volume", cropped(volume(wavelet()), BOX), turned=True)
picture("fence", cropped(volume(wavelet()), FENCE))
picture("inverted_cross", cropped(volume(wavelet()), INVERTED_CROSS))
picture("first_and_last_corner", cropped(volume(wavelet()), CORNER | 1 << 26 | 1 << 2))
picture("box_and_plane", cut(cropped(volume(wavelet()), BOX), SLANTED))
largest = cropped(volume(wavelet()), BOX)
largest.GetMapper().SetBlendModeToMaximumIntensity()
picture("largest_in_a_box", largest)
shaded = cut(volume(wavelet()), SLANTED)
shaded.GetProperty().ShadeOn()
picture("plane_and_light", shaded)

# ---- Scalars of cells.
cells = image_of_cells(9)
picture("cells", volume(cells))
picture("cells_cut", cut(volume(cells), SLANTED))
nearest = volume(cells)
nearest.GetProperty().SetInterpolationTypeToNearest()
picture("cells_nearest", nearest)
shaded = volume(cells)
shaded.GetProperty().ShadeOn()
picture("cells_shaded", shaded)
largest = volume(cells)
largest.GetMapper().SetBlendModeToMaximumIntensity()
picture("cells_largest", largest)
picture("cells_smart", volume(cells, kind=vtk.vtkSmartVolumeMapper))

# ---- A surface in the part that is left.
ball = vtk.vtkSphereSource()
ball.SetRadius(5)
ball.SetCenter(2, -2, 2)
ball.SetThetaResolution(40)
ball.SetPhiResolution(40)
ren.AddActor(actor(ball, (0.9, 0.9, 0.3)))
picture("plane_and_surface", cut(volume(wavelet()), SLANTED))
picture("fence_and_surface", cropped(volume(wavelet()), FENCE))
