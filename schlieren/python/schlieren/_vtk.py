"""Data sets of VTK, and so of PyVista."""

import numpy as np

from schlieren import _arrays, _words

_KINDS = {
    "vtkImageData": "ImageData",
    "vtkRectilinearGrid": "RectilinearGrid",
    "vtkStructuredGrid": "StructuredGrid",
    "vtkUnstructuredGrid": "UnstructuredGrid",
}
_POLYHEDRON = 42
#: Marks points and cells that a solver or a filter has hidden.
_GHOSTS = "vtkGhostType"


def _numbers(array):
    from vtkmodules.util.numpy_support import vtk_to_numpy

    return _arrays.array(array.GetName() or "an array", vtk_to_numpy(array))


def _names(data):
    found = []
    for attributes in (data.GetPointData(), data.GetCellData()):
        found += [attributes.GetArrayName(i) for i in range(attributes.GetNumberOfArrays())]
    return [name for name in found if name]


def _attributes(data, wanted):
    arrays = []
    for attributes, per_point in ((data.GetPointData(), True), (data.GetCellData(), False)):
        for name in (*wanted, _GHOSTS):
            array = attributes.GetArray(name)
            if array is not None:
                values = np.ascontiguousarray(_numbers(array)).reshape(-1)
                arrays.append((name, per_point, array.GetNumberOfComponents(), values))
    return arrays


def _flat(array, dtype):
    return np.ascontiguousarray(_numbers(array), dtype=dtype).reshape(-1)


def _points(data):
    array = data.GetPoints().GetData() if data.GetPoints() else None
    if array is None:
        return np.zeros(0)
    values = np.ascontiguousarray(_numbers(array)).reshape(-1)
    return values if values.dtype == np.float32 else values.astype(np.float64)


def _polyhedra(data, types):
    """The faces of polyhedra, those of each cell one after the other."""
    if not (types == _POLYHEDRON).any():
        return {}
    ends, ids, of_cells = [], [], [0]
    if hasattr(data, "GetPolyhedronFaces") and data.GetPolyhedronFaces() is not None:
        faces, places = data.GetPolyhedronFaces(), data.GetPolyhedronFaceLocations()
        starts = _flat(faces.GetOffsetsArray(), np.int64)
        all_ids = _flat(faces.GetConnectivityArray(), np.int64)
        first = _flat(places.GetOffsetsArray(), np.int64)
        numbers = _flat(places.GetConnectivityArray(), np.int64)
        sizes = np.diff(starts)[numbers]
        ends = np.cumsum(sizes)
        within = np.arange(int(sizes.sum())) - np.repeat(ends - sizes, sizes)
        ids = all_ids[np.repeat(starts[:-1][numbers], sizes) + within]
        of_cells = first
    else:
        stream, at = _flat(data.GetFaces(), np.int64), _flat(data.GetFaceLocations(), np.int64)
        for place in at:
            if place >= 0:
                count, place = stream[place], place + 1
                for _ in range(count):
                    size = stream[place]
                    ids.extend(stream[place + 1 : place + 1 + size])
                    ends.append(len(ids))
                    place += 1 + size
            of_cells.append(len(ends))
    as_ids = {"face_ends": ends, "face_ids": ids, "faces_of_cells": of_cells}
    return {name: np.ascontiguousarray(v, dtype=np.int64) for name, v in as_ids.items()}


def _types(data):
    """Numbers of the cells' types, by the call that this VTK has."""
    try:
        return _flat(data.GetCellTypes(), np.uint8)
    except TypeError:
        # Before VTK 9.6.
        return _flat(data.GetCellTypesArray(), np.uint8)


def _leaf(data, kind, wanted):
    found = {"kind": kind, "arrays": _attributes(data, wanted)}
    if kind == "UnstructuredGrid":
        types = _types(data) if data.GetNumberOfCells() else np.zeros(0, dtype=np.uint8)
        cells = data.GetCells()
        found |= {
            "points": _points(data),
            "types": types,
            "ends": _flat(cells.GetOffsetsArray(), np.int64)[1:].copy(),
            "ids": _flat(cells.GetConnectivityArray(), np.int64),
        } | _polyhedra(data, types)
        return found
    found["extent"] = list(data.GetExtent())
    if kind == "ImageData":
        matrix = data.GetDirectionMatrix()
        found["origin"], found["spacing"] = list(data.GetOrigin()), list(data.GetSpacing())
        found["direction"] = [matrix.GetElement(i // 3, i % 3) for i in range(9)]
    elif kind == "RectilinearGrid":
        axes = (data.GetXCoordinates(), data.GetYCoordinates(), data.GetZCoordinates())
        found["coordinates"] = [_flat(axis, np.float64) for axis in axes]
    else:
        found["points"] = _points(data)
    return found


def _blocks(data):
    """The data sets in blocks, which may lie in blocks."""
    iterator = data.NewIterator()
    iterator.InitTraversal()
    while not iterator.IsDoneWithTraversal():
        yield iterator.GetCurrentDataObject()
        iterator.GoToNextItem()


def dictionary(data, used):
    """What the native module makes a data set of. `used`: roles with names of arrays."""
    if not hasattr(data, "IsA"):
        raise TypeError(f"data is of type {type(data).__name__}; give a data set of VTK or PyVista")
    if data.IsA("vtkCompositeDataSet"):
        leaves = [d for d in _blocks(data) if d is not None]
        surfaces = [d for d in leaves if d.IsA("vtkPolyData")]
        # As readers of OpenFOAM give them: the patches of the border beside the mesh.
        if surfaces and len(surfaces) < len(leaves):
            leaves = [d for d in leaves if not d.IsA("vtkPolyData")]
            _words.warn([f"{len(surfaces)} blocks are surfaces and are left out"], 3)
    else:
        leaves = [data]
    names = {name for leaf in leaves if hasattr(leaf, "GetPointData") for name in _names(leaf)}
    wanted = []
    for role, name in used:
        plain = name if name in names else name.rpartition(":")[0]
        if plain not in names:
            raise ValueError(
                f"{role} is {name!r}, which no array is called{_arrays.meant(name, names)}; "
                f"there are: {', '.join(map(repr, sorted(names - {_GHOSTS}))) or 'none'}"
            )
        wanted.append(plain)
    wanted = list(dict.fromkeys(wanted))
    found = []
    for leaf in leaves:
        kind = next((k for k in _KINDS if leaf.IsA(k)), None)
        if kind is None:
            raise TypeError(
                f"data is a {leaf.GetClassName()}, which has no volume; give one of "
                f"{', '.join(_KINDS)}, or blocks of them"
            )
        found.append(_leaf(leaf, _KINDS[kind], wanted))
    if not found:
        raise ValueError("data has no blocks; give a data set with cells")
    if len(found) == 1:
        return found[0]
    return {"kind": "MultiBlock", "blocks": [(str(i), d) for i, d in enumerate(found)]}
