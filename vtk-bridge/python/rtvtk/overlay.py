"""The traced picture in OpenGL's: rectangles over the whole viewport that write its colours and its depth."""
import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkFloatArray, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkImageData, vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkTexture

# Depth travels as 24-bit whole numbers in three bytes: VTK keeps textures of floats in half precision, which is no depth.
_STEPS = 16777215


def _depth(texture):
    return f"dot(floor(texture({texture}, uv).rgb * 255.0 + 0.5), vec3(65536.0, 256.0, 1.0)) / {_STEPS}.0"


def _packed(depth):
    whole = np.rint(depth[..., 0].astype(np.float64).clip(0, 1) * _STEPS).astype(np.uint32)
    return np.stack([whole >> 16, whole >> 8 & 255, whole & 255], -1).astype(np.uint8)


# What both rectangles begin with; texel centres lie on pixel centres.
_FETCH = "vec2 uv = tcoordVCVSOutput; vec4 c = texture(rtvColor, uv); float d = " + _depth("rtvDepth") + "; if (c.a <= 0.0) discard;"
_OPAQUE = _FETCH + " gl_FragData[0] = c; gl_FragDepth = d;"
# Pixels with an opaque surface somewhere: what is in front of it is in the colour.
_COVERED = _FETCH + " if (d >= 1.0) discard; gl_FragData[0] = vec4(c.rgb, 1.0); gl_FragDepth = d;"
# Pixels with translucent surfaces only, blended by VTK with colours that are not premultiplied.
_THROUGH = _FETCH + " if (d < 1.0) discard; gl_FragData[0] = vec4(c.rgb / c.a, c.a); gl_FragDepth = " + _depth("rtvFirst") + ";"


def _rectangle():
    points, cell, coordinates = vtkPoints(), vtkCellArray(), vtkFloatArray()
    coordinates.SetNumberOfComponents(2)
    cell.InsertNextCell(4)
    for i, (x, y) in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)]):
        points.InsertNextPoint(2 * x - 1, 2 * y - 1, 0)
        coordinates.InsertNextTuple2(x, y)
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
        # In place of the code that would multiply the lit colour with every texture.
        s.AddFragmentShaderReplacement("//VTK::TCoord::Impl", True, "  { " + shader + " }\n", False)
        s.AddFragmentShaderReplacement("//VTK::Depth::Impl", True, "  gl_FragDepth = gl_FragCoord.z;\n//VTK::Depth::Impl\n", False)

    def upload(self, **planes):
        for name, plane in planes.items():
            height, width = plane.shape[:2]
            # Rows of the picture come from the top, those of textures from the bottom.
            values = np.ascontiguousarray(plane[::-1]).reshape(width * height, -1)
            image = self.images[name]
            image.SetDimensions(width, height, 1)
            image.GetPointData().SetScalars(numpy_to_vtk(values, deep=True))
            image.Modified()


class Overlay:
    def __init__(self):
        self._opaque = _Layer(_OPAQUE, ["rtvColor", "rtvDepth"], False)
        self._covered = _Layer(_COVERED, ["rtvColor", "rtvDepth"], False)
        self._through = _Layer(_THROUGH, ["rtvColor", "rtvDepth", "rtvFirst"], True)

    def actors(self, picture):
        """The rectangles that show a picture of the library's."""
        shape = (picture.height, picture.width)

        def plane(pointer, components=1):
            a = np.ctypeslib.as_array(pointer, (shape[0] * shape[1] * components,))
            return a.reshape(*shape, components)

        if not picture.blended:
            self._opaque.upload(rtvColor=plane(picture.opaque, 4), rtvDepth=_packed(plane(picture.depth)))
            return [self._opaque.actor]
        color, depth = plane(picture.blended, 4), _packed(plane(picture.depth))
        self._covered.upload(rtvColor=color, rtvDepth=depth)
        self._through.upload(rtvColor=color, rtvDepth=depth, rtvFirst=_packed(plane(picture.first_depth)))
        return [self._covered.actor, self._through.actor]
