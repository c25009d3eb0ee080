"""Puts the traced image into OpenGL's framebuffer: rectangles over the whole viewport write its colours and depth."""
import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkFloatArray, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkImageData, vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkTexture


def _depth(name, texture):
    # VTK stores float textures in half precision, which is too coarse for depth. The four bytes of
    # each float are therefore stored as a colour, and the shader reassembles the number. All steps
    # are exact and available in OpenGL 3.2.
    return (f"uvec4 {name}B = uvec4(texture({texture}, uv) * 255.0 + 0.5); uint {name}E = ({name}B.a & 127u) << 1 | {name}B.b >> 7; "
            f"float {name} = {name}E < 97u ? 0.0 : float(8388608u | ({name}B.b & 127u) << 16 | {name}B.g << 8 | {name}B.r) / 8388608.0"
            f" / float(1u << (127u - min({name}E, 127u))); ")


# Common start of all rectangles' shaders; texel centres coincide with pixel centres.
_FETCH = "vec2 uv = tcoordVCVSOutput; vec4 c = texture(rtvColor, uv); if (c.a <= 0.0) discard; " + _depth("d", "rtvDepth")
# Colour and depth as they are.
_WHOLE = _FETCH + "gl_FragData[0] = c; gl_FragDepth = d;"
# Pixels with an opaque surface; their colour already includes everything in front of it.
_COVERED = _FETCH + "if (d >= 1.0) discard; gl_FragData[0] = vec4(c.rgb, 1.0); gl_FragDepth = d;"
# Pixels with translucent surfaces only; VTK blends them with colours that are not premultiplied.
_THROUGH = _FETCH + "if (d < 1.0) discard; " + _depth("f", "rtvFirst") + "gl_FragData[0] = vec4(c.rgb / c.a, c.a); gl_FragDepth = f;"


def _rectangle():
    points, cell, coordinates = vtkPoints(), vtkCellArray(), vtkFloatArray()
    coordinates.SetNumberOfComponents(2)
    cell.InsertNextCell(4)
    for i, (x, y) in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)]):
        points.InsertNextPoint(2 * x - 1, 2 * y - 1, 0)
        # Rows of the image start at the top, those of textures at the bottom.
        coordinates.InsertNextTuple2(x, 1 - y)
        cell.InsertCellPoint(i)
    data = vtkPolyData()
    data.SetPoints(points)
    data.SetPolys(cell)
    data.GetPointData().SetTCoords(coordinates)
    return data


class _Layer:
    """One rectangle with its textures."""

    def __init__(self, shader, names, translucent):
        self.actor = vtkActor()
        mapper = vtkPolyDataMapper()
        mapper.SetInputData(_rectangle())
        self.actor.SetMapper(mapper)
        self.actor.UseBoundsOff()
        self.actor.PickableOff()
        self.actor.GetProperty().LightingOff()
        if translucent:
            self.actor.ForceTranslucentOn()
        else:
            self.actor.ForceOpaqueOn()
        self.images = {}
        for name in names:
            image, texture = vtkImageData(), vtkTexture()
            texture.SetInputData(image)
            texture.InterpolateOff()
            texture.RepeatOff()
            texture.SetColorModeToDirectScalars()
            self.actor.GetProperty().SetTexture(name, texture)
            self.images[name] = image
        s = self.actor.GetShaderProperty()
        s.AddVertexShaderReplacement("//VTK::PositionVC::Impl", True, "//VTK::PositionVC::Impl\n  gl_Position = vec4(vertexMC.xy, 0.0, 1.0);\n", False)
        # Replaces the code that would multiply the lit colour with every texture.
        s.AddFragmentShaderReplacement("//VTK::TCoord::Impl", True, "  { " + shader + " }\n", False)
        s.AddFragmentShaderReplacement("//VTK::Depth::Impl", True, "  gl_FragDepth = gl_FragCoord.z;\n//VTK::Depth::Impl\n", False)

    def upload(self, **planes):
        for name, plane in planes.items():
            height, width, components = plane.shape
            image = self.images[name]
            image.SetDimensions(width, height, 1)
            # The library's own memory, which is valid until it draws again; OpenGL copies it before then.
            image.GetPointData().SetScalars(numpy_to_vtk(plane.reshape(width * height, components)))
            image.Modified()

    def stand(self, place, size):
        """Positions the rectangle. Its shader ignores the position, but VTK culls what lies outside the view."""
        self.actor.SetPosition(place)
        self.actor.SetScale(size)


class Overlay:
    """The rectangles of a renderer, created on demand."""

    def __init__(self):
        self._layers = {}

    def _layer(self, name, shader, planes, translucent=False):
        if name not in self._layers:
            self._layers[name] = _Layer(shader, planes, translucent)
        return self._layers[name]

    def actors(self, picture, camera):
        """The rectangles that show an image of the library."""
        shape = (picture.height, picture.width, 4)

        def plane(pointer, bytes_per_pixel):
            # Four bytes, or four floats.
            flat = np.ctypeslib.as_array(pointer, (shape[0] * shape[1] * bytes_per_pixel // 4,))
            return (flat.view(np.uint8) if bytes_per_pixel == 4 else flat).reshape(shape)

        if picture.opaque:
            opaque = np.ctypeslib.as_array(picture.opaque, shape)
            shown = [self._layer("opaque", _WHOLE, ["rtvColor", "rtvDepth"])]
            shown[0].upload(rtvColor=opaque, rtvDepth=plane(picture.depth, 4))
        elif picture.straight:
            # OpenGL blends opaque props too, by their alpha. As one of them, the rectangle comes last and needs no pass of translucent props.
            straight = np.ctypeslib.as_array(picture.straight, shape)
            shown = [self._layer("straight", _WHOLE, ["rtvColor", "rtvDepth"])]
            shown[0].upload(rtvColor=straight, rtvDepth=plane(picture.depth, 4))
        else:
            color, depth = plane(picture.blended, 16), plane(picture.depth, 4)
            covered = self._layer("covered", _COVERED, ["rtvColor", "rtvDepth"])
            through = self._layer("through", _THROUGH, ["rtvColor", "rtvDepth", "rtvFirst"], True)
            covered.upload(rtvColor=color, rtvDepth=depth)
            through.upload(rtvColor=color, rtvDepth=depth, rtvFirst=plane(picture.first_depth, 4))
            shown = [covered, through]
        near, far = camera.GetClippingRange()
        middle = [p + 0.5 * (near + far) * d for p, d in zip(camera.GetPosition(), camera.GetDirectionOfProjection())]
        for layer in shown:
            layer.stand(middle, 10 * (abs(near) + abs(far)))
        return [layer.actor for layer in shown]
