"""VTK's arrays as the library takes them: numpy views, and keys that tell when they change."""
import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_UNSIGNED_CHAR, reference
from vtkmodules.vtkCommonDataModel import vtkCellArray
from vtkmodules.vtkRenderingCore import vtkAbstractMapper

from . import library as rtv


def key_of(*things):
    """A number that changes when an object or value does; never 0."""
    seen = tuple((t.__this__, t.GetMTime()) if hasattr(t, "GetMTime") else t for t in things)
    return hash(seen) & 0xFFFF_FFFF_FFFF_FFFF or 1


def numbers(array, kinds, keep):
    """A VTK array as numpy, in its own type when that is one of `kinds`, else in the first of them."""
    try:
        found = vtk_to_numpy(array)
    except (TypeError, AttributeError, AssertionError, ValueError):
        # Implicit and other arrays without memory of their own.
        n = array.GetNumberOfComponents()
        found = np.array([array.GetTuple(i) for i in range(array.GetNumberOfTuples())]).reshape(-1, n)
    if found.dtype not in kinds:
        found = found.astype(kinds[0])
    found = np.ascontiguousarray(found)
    keep.append(found)
    return found


def floats(array, components, keep):
    """An array of the library with `components` floats, or none."""
    if array is None or array.GetNumberOfComponents() < components or array.GetNumberOfTuples() == 0:
        return rtv.Array()
    found = numbers(array, [np.dtype(np.float32)], keep).reshape(array.GetNumberOfTuples(), -1)
    if found.shape[1] > components:
        found = np.ascontiguousarray(found[:, :components])
        keep.append(found)
    return rtv.Array.of(found)


def cells(array, keep):
    if array is None or array.GetNumberOfCells() == 0:
        return rtv.Cells()
    whole = [np.dtype(np.int64), np.dtype(np.int32)]
    try:
        offsets, connectivity = (vtk_to_numpy(a) for a in (array.GetOffsetsArray(), array.GetConnectivityArray()))
        if offsets.dtype not in whole or connectivity.dtype not in whole:
            raise TypeError
    except (TypeError, AttributeError, AssertionError, ValueError):
        # Cells of one size have no offsets in memory (VTK 9.6 and later).
        plain = vtkCellArray()
        plain.DeepCopy(array)
        plain.ConvertTo64BitStorage()
        offsets, connectivity = (vtk_to_numpy(a) for a in (plain.GetOffsetsArray(), plain.GetConnectivityArray()))
        keep.append(plain)
    offsets, connectivity = np.ascontiguousarray(offsets), np.ascontiguousarray(connectivity)
    keep += [offsets, connectivity]
    return rtv.Cells(rtv.Array.of(offsets), rtv.Array.of(connectivity))


def add_shape(surface, data, as_points, keep):
    """Points, cells, normals and texture coordinates."""
    points = data.GetPoints()
    coordinates = points.GetData()
    kinds = [np.dtype(np.float64), np.dtype(np.float32)]
    surface.points = rtv.Array.of(numbers(coordinates, kinds, keep).reshape(-1, 3))
    if as_points:
        ids = np.arange(points.GetNumberOfPoints() + 1, dtype=np.int64)
        keep.append(ids)
        surface.verts = rtv.Cells(rtv.Array.of(ids), rtv.Array.of(ids[:-1]))
        surface.shape_key = key_of(points, coordinates, "points", surface.point_radius)
        return
    all_cells = [data.GetVerts(), data.GetLines(), data.GetPolys(), data.GetStrips()]
    surface.verts, surface.lines, surface.polys, surface.strips = (cells(c, keep) for c in all_cells)
    of_points = None if surface.property.flat else data.GetPointData().GetNormals()
    of_cells, texcoords = data.GetCellData().GetNormals(), data.GetPointData().GetTCoords()
    surface.point_normals, surface.cell_normals = floats(of_points, 3, keep), floats(of_cells, 3, keep)
    surface.texcoords = floats(texcoords, 2, keep)
    surface.shape_key = key_of(points, coordinates, *all_cells, of_points, of_cells, texcoords, surface.point_radius, surface.line_radius,
                               surface.edges_only)


def rgba_of(colors):
    """Bytes of one to four components as RGBA."""
    colors = colors.reshape(len(colors), -1)
    out = np.full((len(colors), 4), 255, np.uint8)
    n = colors.shape[1]
    out[:, :3] = colors[:, :3] if n >= 3 else colors[:, :1]
    if n in (2, 4):
        out[:, 3] = colors[:, -1]
    return out


def add_colors(bridge, surface, mapper, data, keep):
    """Colours by the mapper's own lookup. True unless the mapper colours by a tuple of field data."""
    if not mapper.GetScalarVisibility():
        return
    flag = reference(0)
    scalars = vtkAbstractMapper.GetAbstractScalars(
        data, mapper.GetScalarMode(), mapper.GetArrayAccessMode(), mapper.GetArrayId(), mapper.GetArrayName(), flag)
    if scalars is None:
        return
    flag = int(flag)
    if flag == 2 and mapper.GetFieldDataTupleId() < 0:
        # An array of the field data with a value for each cell.
        flag = 1
    key = key_of(scalars, mapper.GetLookupTable(), mapper.GetScalarRange(), mapper.GetColorMode(), mapper.GetScalarMode(),
                 mapper.GetInterpolateScalarsBeforeMapping(), mapper.GetUseLookupTableScalarRange(), flag, mapper.GetArrayComponent(),
                 mapper.GetFieldDataTupleId())
    surface.color_key = key
    mapped = bool(mapper.CanUseTextureMapForColoring(data))
    source = rtv.COLOR_CELLS if flag == 1 else rtv.COLOR_MAPPED if mapped else rtv.COLOR_POINTS
    if flag != 2 and bridge.has_colors(surface.shape_key, key):
        surface.color_source = source
        return
    # A mapper keeps one array of colours; that of another block must not be taken for this one's.
    mapper.ClearColorArrays()
    colors = mapper.MapScalars(data, 1.0)
    coordinates, table = mapper.GetColorCoordinates(), mapper.GetColorTextureMap()
    if mapped and coordinates and table and flag == 0:
        texels = numbers(table.GetPointData().GetScalars(), [np.dtype(np.uint8)], keep).reshape(-1, 4)
        width = table.GetDimensions()[0]
        row = np.ascontiguousarray(texels[:width])
        keep.append(row)
        surface.color_source = rtv.COLOR_MAPPED
        surface.colors = rtv.Array.of(numbers(coordinates, [np.dtype(np.float32)], keep).reshape(-1, 2))
        surface.map = rtv.Array.of(row)
        surface.nan_color[:] = [int(c) for c in texels[-1]]
        return
    if colors is None or colors.GetNumberOfTuples() == 0:
        return
    rgba = rgba_of(numbers(colors, [np.dtype(np.uint8)], keep))
    keep.append(rgba)
    if flag == 2:
        # One colour for everything, from a tuple of field data.
        color = [c / 255 for c in rgba[0]]
        surface.property.ambient_color[:] = surface.property.diffuse_color[:] = color[:3]
        surface.property.opacity *= color[3]
        surface.color_key = 0
        return
    surface.color_source = rtv.COLOR_CELLS if flag == 1 else rtv.COLOR_POINTS
    surface.colors = rtv.Array.of(rgba)


def why_not_texture(texture):
    if texture.GetTransform():
        return "a texture with a transform"
    if texture.GetUseSRGBColorSpace():
        return "a texture in sRGB"
    if texture.GetCubeMap():
        return "a cube map"
    return None


def add_texture(surface, texture, keep):
    if texture.GetInputAlgorithm():
        texture.GetInputAlgorithm().Update()
    image = texture.GetInput()
    scalars = image.GetPointData().GetScalars() if image else None
    if scalars is None or surface.texcoords.kind == rtv.NONE:
        return
    width, height, _ = image.GetDimensions()
    if scalars.GetDataType() != VTK_UNSIGNED_CHAR or texture.GetColorMode() == 1:
        table = texture.GetLookupTable()
        if table is None:
            from vtkmodules.vtkCommonCore import vtkLookupTable

            table = vtkLookupTable()
            table.SetTableRange(scalars.GetRange())
            table.Build()
        scalars = table.MapScalars(scalars, texture.GetColorMode(), -1)
    rgba = rgba_of(numbers(scalars, [np.dtype(np.uint8)], keep).reshape(scalars.GetNumberOfTuples(), -1))
    if len(rgba) < width * height:
        return
    keep.append(rgba)
    surface.texture_key = key_of(image, image.GetPointData().GetScalars(), texture)
    surface.texture = rtv.Array.of(rgba[: width * height])
    surface.texture_width = width
    surface.texture_interpolate, surface.texture_repeat = int(bool(texture.GetInterpolate())), int(bool(texture.GetRepeat()))
