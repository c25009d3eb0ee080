"""Glyphs as instances: recomputes the matrices that vtkGlyph3DMapper makes for OpenGL, because it does not expose them."""
import numpy as np
from vtkmodules.vtkCommonCore import vtkBitArray
from vtkmodules.vtkCommonDataModel import vtkCompositeDataSet, vtkDataObject, vtkDataSet, vtkPolyData
from vtkmodules.vtkRenderingCore import vtkGlyph3DMapper

from . import library as rtv
from .arrays import key_of, numbers, rgba_of
from .eligibility import require

_REAL = [np.dtype(np.float64)]
# Indices of the mapper's arrays.
_SCALE, _INDEX, _MASK, _ORIENTATION = range(4)


class GlyphInput:
    """The sources of a glyph mapper by index, and the data sets whose points have glyphs. Raises `Untraceable`."""

    def __init__(self, bridge, mapper, data):
        self._check, self.facts = bridge.check_glyphs, _facts(mapper, data)
        self.require()
        self.sources = [self._source(mapper, i) for i in range(self.facts.num_sources)]
        self.leaves = _leaves(data)

    def require(self):
        require(self._check, self.facts)

    def _source(self, mapper, i):
        mapper.GetInputAlgorithm(1, i).Update()
        source, f = mapper.GetInputDataObject(1, i), self.facts
        is_polydata, f.has_source = isinstance(source, vtkPolyData), 1
        f.num_source_polygons = source.GetNumberOfPolys() + source.GetNumberOfStrips() if is_polydata else 0
        f.num_other_source_cells = source.GetNumberOfLines() + source.GetNumberOfVerts() if is_polydata else 0
        self.require()
        return source


def _facts(mapper, data):
    f, connected, blocks = rtv.GlyphFacts(), mapper.GetNumberOfInputConnections(1), mapper.GetBlockAttributes()
    f.source_table_tree, f.num_clipping_planes = bool(mapper.GetUseSourceTableTree()), mapper.GetNumberOfClippingPlanes()
    f.num_sources = connected if mapper.GetSourceIndexing() else min(connected, 1)
    f.data_set, f.composite = isinstance(data, vtkDataSet), isinstance(data, vtkCompositeDataSet)
    f.block_attributes = bool(blocks and (blocks.HasBlockVisibilities() or blocks.HasBlockColors() or blocks.HasBlockOpacities()))
    if f.composite:
        f.num_blocks_without_points = sum(not isinstance(leaf, vtkDataSet) for leaf in _leaves(data))
    return f


def _leaves(data):
    if isinstance(data, vtkDataSet):
        return [data]
    leaves, it = [], data.NewIterator()
    it.InitTraversal()
    while not it.IsDoneWithTraversal():
        leaves.append(it.GetCurrentDataObject())
        it.GoToNextItem()
    return leaves


def _array(mapper, number, data):
    info = mapper.GetInputArrayInformation(number)
    arrays = data.GetPointData()
    if info.Has(vtkDataObject.FIELD_NAME()):
        return arrays.GetArray(info.Get(vtkDataObject.FIELD_NAME()))
    if info.Has(vtkDataObject.FIELD_ATTRIBUTE_TYPE()):
        return arrays.GetAttribute(info.Get(vtkDataObject.FIELD_ATTRIBUTE_TYPE()))
    return None


def _rotation(axis, degrees):
    """Rotations (n, 3, 3) about axes (n, 3); an axis of length zero gives no rotation."""
    length = np.linalg.norm(axis, axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        x, y, z = np.where(length > 0, axis / length, 0.0).T
    angle = np.where(length[:, 0] > 0, np.radians(degrees), 0.0)
    c, s = np.cos(angle), np.sin(angle)
    d = 1 - c
    rows = [c + d * x * x, d * x * y - s * z, d * x * z + s * y, d * x * y + s * z, c + d * y * y, d * y * z - s * x, d * x * z - s * y,
            d * y * z + s * x, c + d * z * z]
    return np.stack(rows, -1).reshape(-1, 3, 3)


def _turns(mode, v):
    """Rotations by `v` (n, components), as vtkGlyph3DMapper documents the modes."""
    n = len(v)
    if mode == vtkGlyph3DMapper.ROTATION:
        about = [_rotation(np.tile(axis, (n, 1)), v[:, i]) for axis, i in (((0.0, 0, 1), 2), ((1.0, 0, 0), 0), ((0.0, 1, 0), 1))]
        return about[0] @ about[1] @ about[2]
    if mode == vtkGlyph3DMapper.DIRECTION:
        length = np.linalg.norm(v[:, :3], axis=1)
        axis = np.stack([(v[:, 0] + length) / 2, v[:, 1] / 2, v[:, 2] / 2], -1)
        degrees = np.full(n, 180.0)
        along = (v[:, 1] == 0) & (v[:, 2] == 0)
        axis[along] = 0, 1, 0
        degrees[along] = np.where(v[along, 0] < 0, 180.0, 0.0)
        return _rotation(axis, degrees)
    return _rotation(v[:, 1:4], np.degrees(2 * np.arccos(v[:, 0].clip(-1, 1))))


def _scales(mapper, array, n, keep):
    mode = mapper.GetScaleMode() if array is not None else mapper.NO_DATA_SCALING
    out = np.ones((n, 3))
    if mode != mapper.NO_DATA_SCALING:
        v = numbers(array, _REAL, keep).reshape(n, -1)
        if mode == mapper.SCALE_BY_MAGNITUDE:
            out[:] = v if v.shape[1] == 1 else np.linalg.norm(v, axis=1, keepdims=True)
        elif mode == mapper.SCALE_BY_COMPONENTS and v.shape[1] == 3:
            out[:] = v
        if mapper.GetClamping():
            low, high = mapper.GetRange()
            out = (out.clip(low, high) - low) / (high - low if high != low else 1.0)
    out = out * mapper.GetScaleFactor() if mapper.GetScaling() else np.ones((n, 3))
    out[out == 0] = 1e-10
    return out


class Glyphs:
    """Matrices and colours of mappers; those of the last frame are cached."""

    def __init__(self):
        self._kept, self._used = {}, {}

    def end_frame(self):
        self._kept, self._used = self._used, {}

    def of(self, mapper, data, given):
        """Index of the source, and matrices and colours of its instances, for each source of a `GlyphInput` that has any."""
        sources = len(given.sources)
        scale = _array(mapper, _SCALE, data)
        turn = _array(mapper, _ORIENTATION, data) if mapper.GetOrient() else None
        mask = _array(mapper, _MASK, data) if mapper.GetMasking() else None
        # VTK accepts nothing else as a mask.
        mask = mask if isinstance(mask, vtkBitArray) else None
        index = _array(mapper, _INDEX, data) if mapper.GetSourceIndexing() else None
        settings = (mapper.GetScaleMode(), mapper.GetScaling(), mapper.GetScaleFactor(), mapper.GetClamping(), mapper.GetRange(),
                    mapper.GetOrientationMode(), mapper.GetScalarVisibility(), mapper.GetColorMode(), mapper.GetScalarMode(),
                    mapper.GetScalarRange(), mapper.GetArrayName(), mapper.GetArrayId(), mapper.GetArrayComponent(),
                    mapper.GetUseLookupTableScalarRange(), sources)
        key = key_of(mapper.__this__, data, data.GetPointData(), scale, turn, mask, index, mapper.GetLookupTable(), *settings)
        found = self._kept.get(key)
        if found is None:
            found = list(_copies(mapper, data, scale, turn, mask, index, given))
        self._used[key] = found
        return found


def _copies(mapper, data, scale, turn, mask, index, given):
    keep, n, sources, f = [], data.GetNumberOfPoints(), len(given.sources), given.facts
    if n == 0:
        return
    rgba = None
    if mapper.GetScalarVisibility():
        mapper.ClearColorArrays()
        colors = mapper.MapScalars(data, 1.0)
        f.has_colors, f.num_points = colors is not None, n
        if colors is not None:
            f.num_colors, f.color_components = colors.GetNumberOfTuples(), colors.GetNumberOfComponents()
            given.require()
            rgba = rgba_of(numbers(colors, [np.dtype(np.uint8)], keep))
    points = data.GetPoints() if hasattr(data, "GetPoints") else None
    if points is not None and points.GetNumberOfPoints() == n:
        xyz = numbers(points.GetData(), _REAL, keep).reshape(-1, 3)
    else:
        xyz = np.array([data.GetPoint(i) for i in range(n)]).reshape(-1, 3)
    matrices = np.zeros((n, 4, 4))
    matrices[:, 3, 3] = 1
    matrices[:, :3, 3] = xyz
    turns = np.eye(3) if turn is None else _turns(mapper.GetOrientationMode(), numbers(turn, _REAL, keep).reshape(n, -1))
    matrices[:, :3, :3] = turns * _scales(mapper, scale, n, keep)[:, None, :]
    shown = np.ones(n, bool) if mask is None else numbers(mask, _REAL, keep).reshape(n, -1)[:, 0] != 0
    which = np.zeros(n, np.int64)
    if index is not None:
        which = np.linalg.norm(numbers(index, _REAL, keep).reshape(n, -1), axis=1).clip(0, sources - 1).astype(np.int64)
    for source in range(sources):
        chosen = shown & (which == source)
        if chosen.any():
            yield source, np.ascontiguousarray(matrices[chosen].reshape(-1, 16)), None if rgba is None else np.ascontiguousarray(rgba[chosen])
