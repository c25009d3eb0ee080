"""VTK's arrays in the library's layout: numpy views, and keys that change with the data. Also colours and textures."""
import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_UNSIGNED_CHAR, reference, vtkLookupTable
from vtkmodules.vtkRenderingCore import vtkAbstractMapper

from . import library as rtv


def key_of(*things):
    """A number that changes when an object or value changes; never 0."""
    seen = tuple((t.__this__, t.GetMTime()) if hasattr(t, "GetMTime") else t for t in things)
    return hash(seen) & 0xFFFF_FFFF_FFFF_FFFF or 1


def numbers(array, kinds, keep):
    """Returns a VTK array as numpy, in its own type if that is one of `kinds`, else in the first of them."""
    try:
        found = vtk_to_numpy(array)
    except (TypeError, AttributeError, AssertionError, ValueError):
        # Implicit arrays and others without their own memory.
        n = array.GetNumberOfComponents()
        found = np.array([array.GetTuple(i) for i in range(array.GetNumberOfTuples())]).reshape(-1, n)
    if found.dtype not in kinds:
        found = found.astype(kinds[0])
    found = np.ascontiguousarray(found)
    keep.append(found)
    return found


def floats(array, components, keep, rows=None):
    """Wraps rows of an array with `components` floats for the library; an empty array if there are none."""
    if array is None or array.GetNumberOfComponents() < components or array.GetNumberOfTuples() == 0:
        return rtv.Array()
    found = numbers(array, [np.dtype(np.float32)], keep).reshape(array.GetNumberOfTuples(), -1)
    if found.shape[1] > components or rows is not None:
        found = found if rows is None else found[rows[rows < len(found)]]
        found = np.ascontiguousarray(found[:, :components])
        keep.append(found)
    return rtv.Array.of(found)


def rgba_of(colors):
    """Bytes of one to four components as RGBA."""
    colors = colors.reshape(len(colors), -1)
    n = colors.shape[1]
    if n == 4:
        return colors
    out = np.full((len(colors), 4), 255, np.uint8)
    out[:, :3] = colors[:, :3] if n >= 3 else colors[:, :1]
    if n == 2:
        out[:, 3] = colors[:, 1]
    return out


def add_colors(bridge, surface, mapper, data, cell_map, keep):
    """Adds colours from the mapper's own lookup."""
    if not mapper.GetScalarVisibility():
        return
    flag = reference(0)
    scalars = vtkAbstractMapper.GetAbstractScalars(
        data, mapper.GetScalarMode(), mapper.GetArrayAccessMode(), mapper.GetArrayId(), mapper.GetArrayName(), flag)
    if scalars is None:
        return
    flag = int(flag)
    if flag == 2 and mapper.GetFieldDataTupleId() < 0:
        # A field-data array with one value per cell; with a tuple index it would be one colour for everything.
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
    # A mapper caches one array of colours; another block's array must not be reused for this block.
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
    if flag == 2:
        # One colour for everything, from a tuple of field data.
        color = [c / 255 for c in rgba[0].tolist()]
        surface.property.ambient_color[:] = surface.property.diffuse_color[:] = color[:3]
        surface.property.opacity *= color[3]
        surface.color_key = 0
        return
    if flag == 1 and cell_map is not None:
        rgba = np.ascontiguousarray(rgba[cell_map[cell_map < len(rgba)]])
    keep.append(rgba)
    surface.color_source = rtv.COLOR_CELLS if flag == 1 else rtv.COLOR_POINTS
    surface.colors = rtv.Array.of(rgba)


# Textures of a property, by the library's field that receives them.
MAPS = {"material": "materialTex", "normal": "normalTex", "emissive": "emissiveTex"}


class Textures:
    """Texels as RGBA, by the key of their image; those of the last frame are cached."""

    def __init__(self):
        self._kept, self._used = {}, {}

    def end_frame(self):
        self._kept, self._used = self._used, {}

    def add(self, surface, texture, texcoords):
        image = self._image(texture, texcoords)
        surface.texture_key, surface.texture, surface.texture_width = image.key, image.texels, image.width
        surface.texture_srgb, surface.texture_interpolate, surface.texture_repeat = image.srgb, image.interpolate, image.repeat

    def maps_of(self, p, texcoords):
        """The textures of a physically based property other than its colour texture, or `None`."""
        found = {field: p.GetTexture(name) for field, name in MAPS.items() if p.GetTexture(name) is not None}
        if not found:
            return None
        maps = rtv.Maps(normal_scale=p.GetNormalScale(), occlusion_strength=p.GetOcclusionStrength())
        maps.emissive_factor[:] = p.GetEmissiveFactor()
        for field, texture in found.items():
            setattr(maps, field, self._image(texture, texcoords))
        return maps

    def _image(self, texture, texcoords):
        if texture.GetInputAlgorithm():
            texture.GetInputAlgorithm().Update()
        image = texture.GetInput()
        scalars = image.GetPointData().GetScalars() if image else None
        if scalars is None or texcoords is None or texcoords.GetNumberOfComponents() < 2:
            return rtv.Image()
        width, height, _ = image.GetDimensions()
        if scalars.GetNumberOfTuples() < width * height:
            return rtv.Image()
        key = key_of(image, scalars, texture)
        rgba = self._kept.get(key)
        if rgba is None:
            rgba = _texels(texture, scalars)[: width * height]
        self._used[key] = rgba
        flags = (int(bool(f)) for f in (texture.GetInterpolate(), texture.GetRepeat(), texture.GetUseSRGBColorSpace()))
        return rtv.Image(rtv.Array.of(rgba), key, width, *flags)


def _texels(texture, scalars):
    if scalars.GetDataType() != VTK_UNSIGNED_CHAR or texture.GetColorMode() == 1:
        table = texture.GetLookupTable()
        if table is None:
            table = vtkLookupTable()
            table.SetTableRange(scalars.GetRange())
            table.Build()
        scalars = table.MapScalars(scalars, texture.GetColorMode(), -1)
    return np.ascontiguousarray(rgba_of(numbers(scalars, [np.dtype(np.uint8)], []).reshape(scalars.GetNumberOfTuples(), -1)))
